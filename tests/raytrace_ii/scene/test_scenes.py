"""Reference scenes: detail, depth and fill, measured at small scale.

The subject of a scene are all bodies but those that only lie under and behind it. Detail is the share of the 2D
projection's pixels whose brightness changes by more than 12 of 255 steps to the next; depth is that of the subject's
pixels, from the lenses; fill is the share of pixels that show the subject.
"""

from dataclasses import dataclass

import numpy as np
import pytest

from ii_core import orthoscopic, preset, projection_camera
from raytrace_ii import load_scene, render, scene_names, trace
from tests.support.pictures import scene
from tests.support.slow import first_fast

NAMES = ("apples", "car", "cuboid", "dolphin", "hairdo", "mountains", "objects", "twins")
SURROUNDINGS = {"floor", "road", "meadow", "wood", "sea"}


@dataclass(frozen=True)
class Measured:
    detail: float
    fill: float
    depth: np.ndarray  # of the subject's pixels
    every_depth: np.ndarray  # of all pixels that hit anything


@pytest.fixture(scope="module")
def measured():
    known = {}

    def measure(name):
        if name not in known:
            camera, pose = projection_camera(preset("setup1", scale=16), 192)
            shot = render(scene(name), camera, pose=pose)
            bright = orthoscopic(shot.picture).pixels @ np.array([0.299, 0.587, 0.114])
            hit = shot.object_id >= 0
            around = [i for i, body in enumerate(shot.object_names) if body in SURROUNDINGS]
            subject = hit & ~np.isin(shot.object_id, around)
            depth = shot.depth + pose[2, 3]
            known[name] = Measured(
                detail=float((np.hypot(*np.gradient(bright)) > 12).mean()),
                fill=float(subject.mean()),
                depth=depth[subject],
                every_depth=depth[hit],
            )
        return known[name]

    return measure


def test_all_reference_scenes_come_with_the_package():
    assert set(NAMES) <= set(scene_names())


@pytest.mark.slow
def test_packaged_scenes_load_and_have_a_description():
    for name, about in scene_names().items():
        assert about
        one = scene(name)
        assert one.name == name and one.bodies and one.lights
        assert np.isfinite(one.bounds_mm).all()
        seen = trace(one, np.zeros((50, 3)), [(x, -0.1, 1) for x in np.linspace(-0.3, 0.3, 50)])
        assert np.isfinite(seen.radiance).all() and seen.radiance.max() > 0


@pytest.mark.slow
@pytest.mark.parametrize("high", ["twins", "cuboid", "hairdo"])
def test_scenes_of_high_detail_have_twice_the_edges_of_those_of_low(measured, high):
    for low in ("apples", "car", "objects", "dolphin"):
        assert measured(high).detail > 2 * measured(low).detail


@pytest.mark.slow
@pytest.mark.parametrize("name", ["car", "twins", "hairdo"])
def test_scenes_of_short_depth(measured, name):
    near, far = np.percentile(measured(name).depth, [5, 95])
    assert 12 < near and far < 50


@pytest.mark.slow
@pytest.mark.parametrize("name", ["objects", "dolphin"])
def test_scenes_of_medium_depth(measured, name):
    near, far = np.percentile(measured(name).depth, [5, 95])
    assert 12 < near and 30 < far < 110


@pytest.mark.slow
@pytest.mark.parametrize("name", ["apples", "cuboid", "mountains"])
def test_scenes_of_long_depth(measured, name):
    near, far = np.percentile(measured(name).every_depth, [5, 95])
    assert near < 70 and far > 150


@pytest.mark.slow
def test_fill(measured):
    for low in ("apples", "twins", "objects", "dolphin"):
        assert measured(low).fill < 0.45, low
    for high in ("car", "cuboid"):
        assert measured(high).fill > 0.6, high


@pytest.mark.slow
@pytest.mark.parametrize("name", first_fast(NAMES, 2))
def test_scenes_load_the_same_every_time_and_are_no_burden(name):
    first, second = scene(name), load_scene(name)
    assert [body.name for body in first.bodies] == [body.name for body in second.bodies]
    for a, b in zip(first.bodies, second.bodies, strict=True):
        np.testing.assert_array_equal(a.vertices, b.vertices)
        np.testing.assert_array_equal(a.faces, b.faces)
        assert (a.texture_coordinates is None) == (b.texture_coordinates is None)
        if a.texture_coordinates is not None:
            np.testing.assert_array_equal(a.texture_coordinates, b.texture_coordinates)
    assert sum(len(body.faces) for body in first.bodies) < 400_000


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_no_lens_stands_in_or_under_a_body(name):
    """Bodies at z < 8 mm stay below the lowest lens."""
    for body in scene(name).bodies:
        near = body.vertices[body.vertices[:, 2] < 8]
        near = near[(np.abs(near[:, 0]) < 25) & (near[:, 2] > 0)]
        assert not len(near) or near[:, 1].max() < -12.5, body.name


def test_the_head_has_the_stated_number_of_hairs():
    hair = next(body for body in scene("hairdo").bodies if body.name == "hair")
    assert len(hair.faces) / (2 * 6) > 20_000
