"""Rays that share a packet: chosen by the distance of the content, with equal pictures either way."""

import numpy as np
import pytest

from ii_core import IICamera
from raytrace_ii import Scene, render
from raytrace_ii.rendering import job
from raytrace_ii.rendering.nearness import FAVOUR, parts_of_pixel
from raytrace_ii.rendering.render import _job, _options
from raytrace_ii.rendering.tiles import ray_order, tiles
from tests.support.trace_scenes import body, hall, lamp, sphere, sun, wall

ARRAY = {"pixels": (96, 64), "lenses": (12, 8), "pixel_pitch_mm": 0.1, "gap_mm": 2.0}
CAMERA = IICamera(**ARRAY)
HEXAGONAL = IICamera(pixels=(100, 61), lenses=(8, 5), pixel_pitch_mm=0.4, gap_mm=11.7, lattice="hexagonal")


def by_lens(scene, camera=CAMERA):
    return _job(scene, camera, _options(scene, camera, {}, None), ())._by_lens()


def test_the_distance_of_the_content_decides():
    """Rays of neighbouring pixels are FAVOUR of a lens pitch apart, 0.8 mm, at 0.8 mm / FAVOUR / (0.1 / 2) from L.

    Rays stand obliquely, by up to 0.2 of their length: a margin of 20 % holds either way.
    """
    crossing = 0.8 / FAVOUR / (0.1 / 2.0)
    assert by_lens(Scene(bodies=[body(wall(2.0 + 0.8 * crossing, 1000))]))
    assert not by_lens(Scene(bodies=[body(wall(2.0 + 1.2 * crossing, 1000))]))


def test_without_content_or_with_few_pixels_a_lens_rays_go_by_position():
    assert not by_lens(Scene(bodies=[body(wall(-100, 1))]))
    near = Scene(bodies=[body(wall(2.1, 1000))])
    assert by_lens(near) and by_lens(Scene(bodies=[body(wall(12, 1000))]), HEXAGONAL)
    assert not by_lens(near, IICamera(**ARRAY | {"lenses": (32, 64)}))
    assert not by_lens(near, IICamera(**ARRAY | {"lenses": (1, 1)}))


@pytest.mark.parametrize("camera", [CAMERA, HEXAGONAL])
def test_packets_of_a_lens_are_its_neighbouring_pixels(camera):
    for rows, cols in tiles(camera, 4096):
        order = ray_order(camera, rows, cols, by_lens=True)
        shape = rows.stop - rows.start, cols.stop - cols.start
        np.testing.assert_array_equal(np.sort(order.pixels), np.arange(np.prod(shape)))
        if camera is CAMERA:
            packets = (order.rows + rows.start).reshape(-1, 16), (order.columns + cols.start).reshape(-1, 16)
            assert all((np.ptp(p, axis=1) == 3).all() and (p.min(axis=1) % 4 == 0).all() for p in packets)
            quarters = order.rows.reshape(-1, 4), order.columns.reshape(-1, 4)
            assert all((np.ptp(p, axis=1) == 1).all() for p in quarters)


@pytest.mark.parametrize("samples", [1, 4, (4, 8)])
def test_pictures_are_equal_in_both_orders_for_any_workers_and_tiles(samples, monkeypatch):
    scene = Scene(
        bodies=[body(sphere(2, 24), at=(0, 0, 12)), body(wall(20, 60))], lights=[sun((1, 2, -3)), lamp((3, 5, 2))]
    )
    pictures = []
    for chosen in (False, True):
        monkeypatch.setattr(job.Job, "_by_lens", lambda _, chosen=chosen: chosen)
        pictures += [render(scene, CAMERA, samples=samples, workers=n).picture.pixels for n in (1, 3)]
    monkeypatch.setattr(job, "TILE_RAYS", 1024)
    pictures.append(render(scene, CAMERA, samples=samples, workers=2).picture.pixels)
    for other in pictures[1:]:
        np.testing.assert_array_equal(other, pictures[0])
    assert len(np.unique(pictures[0])) > 20


def test_samples_of_a_part_of_their_pixels_share_packets_where_that_spreads_less():
    """By hand, in steps of lenses, p of pixels times FAVOUR: 16 samples of one pixel spread p, of a quarter of four
    pixels p/2 + 1, of a sixteenth of 16 pixels p/4 + 3. They meet at p = 2 and 8."""

    def parts(samples, step):
        return parts_of_pixel(samples, np.tile([step / FAVOUR, 1.0], (3, 1)))

    assert [parts(16, step) for step in (0.3, 1.9, 2.1, 7.9, 8.1, 1e9)] == [(1, 1)] * 2 + [(2, 4)] * 2 + [(4, 16)] * 2
    assert [parts(4, step) for step in (3.9, 4.1, 1e9)] == [(1, 1), (2, 16), (2, 16)]  # p + 1 and p/2 + 3
    assert [parts(1, 1e9), parts(2, 1e9), parts(64, 1e9), parts(9, 5.0)] == [(1, 1), (1, 1), (8, 16), (2, 4)]
    assert parts_of_pixel(16, np.full((3, 2), np.nan)) == parts_of_pixel(16, np.zeros((3, 2))) == (1, 1)


@pytest.mark.parametrize("samples", [4, 9, 16, (4, 16)])
def test_pictures_are_equal_whatever_samples_share_packets(samples, monkeypatch):
    scene = Scene(
        bodies=[body(sphere(2, 24), at=(0, 0, 12), mirror=(0.3, 0.3, 0.3)), body(wall(20, 60))],
        lights=[sun((1, 2, -3)), lamp((3, 5, 2))],
    )
    shots = []
    for parts in ((1, 1), (2, 4), (2, 16), (4, 16), (8, 2)):
        monkeypatch.setattr(job.Job, "_parts", lambda _, __, parts=parts: parts)
        shots.append(render(scene, CAMERA, samples=samples, support=("depth", "object_id")))
    for other in shots[1:]:
        np.testing.assert_array_equal(other.picture.pixels, shots[0].picture.pixels)
        for name in ("depth", "object_id"):
            np.testing.assert_array_equal(getattr(other, name), getattr(shots[0], name))
    assert len(np.unique(shots[0].picture.pixels)) > 20


def test_rough_mirrors_keep_their_places_in_lobes_whatever_samples_share_packets(monkeypatch):
    mirror = body(wall(20, 60), mirror=(0.9, 0.9, 0.9), roughness=0.3)
    scene = Scene(bodies=[mirror, body(sphere(2, 24), at=(0, 0, -9))], lights=[lamp((3, 5, 2))])
    pictures = []
    for parts in ((1, 1), (2, 4)):
        monkeypatch.setattr(job.Job, "_parts", lambda _, __, parts=parts: parts)
        pictures.append(render(scene, CAMERA, samples=16).picture.pixels)
    np.testing.assert_array_equal(*pictures)
    assert len(np.unique(pictures[0])) > 20


def test_a_scene_with_mirrors_and_glass_is_the_same_for_any_workers_lens_by_lens(monkeypatch):
    """Ties may fall otherwise in another order, but not with other workers."""
    monkeypatch.setattr(job.Job, "_by_lens", lambda _: True)
    one, three = (render(hall(), CAMERA, samples=2, workers=n).picture.pixels for n in (1, 3))
    np.testing.assert_array_equal(one, three)
