"""Rendered pictures: equal to the bit for all tiles and numbers of threads; counts of rays."""

import json
import pickle
from concurrent.futures import CancelledError
from dataclasses import replace

import numpy as np
import pytest

from ii_core import IICamera, add_sensor_noise, five_viewpoints, preset, read_maps, view_image, write_maps
from ii_core.picture.view import view_positions
from raytrace_ii import Audit, Background, Scene, load_scene, render, trace
from raytrace_ii.rendering import job
from raytrace_ii.rendering.tiles import ray_order, tiles
from raytrace_ii.sampling.sample_kernels import places as sample_places
from raytrace_ii.sampling.sample_places import fixed_places
from raytrace_ii.tracing.kernels.srgb import encode_srgb
from raytrace_ii.tracing.support_images import SUPPORT, SUPPORT_IMAGES
from tests.support.trace_scenes import UNIFORM, WHITE, body, box, floor, hall, lamp, sphere, sun, wall

SMALL = preset("setup1", scale=64)  # 128×64 px, 8×4 lenses
OFF_CENTRE = [(3.0, -2.0, -60.0), (40.0, 25.0, -55.0), (-9.0, 7.0, -300.0)]  # the second leaves the picture
ONE_LENS = IICamera(pixels=(24, 16), lenses=(1, 1), pixel_pitch_mm=0.1, gap_mm=2.0)


def encoded(radiance, dtype="uint8"):
    """Return codes as stored by `render`."""
    out = np.empty(radiance.shape, dtype)
    encode_srgb(radiance, np.arange(len(radiance)), 1.0, job.CURVES[dtype], out)
    return out


def assert_same(a, b):
    np.testing.assert_array_equal(a.picture.pixels, b.picture.pixels)
    for name in SUPPORT:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    assert a.stats.rays == b.stats.rays


@pytest.fixture(scope="module")
def hall_scene():
    return hall()


@pytest.mark.parametrize("which", ["apples", "hall"])
def test_view_image_equals_its_traced_rays(which, hall_scene):
    """Camera, picture and view against the tracer alone, to the bit."""
    scene = load_scene("apples") if which == "apples" else hall_scene
    camera = preset("setup1", scale=32)
    shot = render(scene, camera)
    for viewpoint in [*five_viewpoints(camera).values(), *OFF_CENTRE]:
        view, valid = view_image(shot.picture, viewpoint, interpolation="nearest")
        x, y = view_positions(camera, viewpoint)
        m, n = np.floor(x + 0.5).astype(int), np.floor(y + 0.5).astype(int)
        inside = ((n >= 0) & (n < camera.pixels[1]))[:, None] & ((m >= 0) & (m < camera.pixels[0]))[None, :]
        np.testing.assert_array_equal(valid, inside)
        m, n = m.clip(0, camera.pixels[0] - 1), n.clip(0, camera.pixels[1] - 1)
        seen = trace(scene, *camera.rays_at(m[None, :], n[:, None]))
        direct = encoded(seen.radiance).reshape(view.shape)
        assert len(np.unique(direct.reshape(-1, 3), axis=0)) > 10, "a picture with something in it"
        np.testing.assert_array_equal(view[valid], direct[valid])
        for name in ("depth", "normal", "object_id"):
            support = getattr(shot, name)[n[:, None], m[None, :]]
            np.testing.assert_array_equal(support, getattr(seen, name).reshape(support.shape))


@pytest.mark.parametrize("dtype", ["uint16", "float32"])
def test_view_image_equals_its_traced_rays_in_every_type(dtype, hall_scene):
    shot = render(hall_scene, SMALL, dtype=dtype)
    viewpoint = five_viewpoints(SMALL)["left"]
    view, valid = view_image(shot.picture, viewpoint, interpolation="nearest")
    assert valid.all()
    x, y = view_positions(SMALL, viewpoint)
    m, n = np.floor(x + 0.5).astype(int), np.floor(y + 0.5).astype(int)
    radiance = trace(hall_scene, *SMALL.rays_at(m[None, :], n[:, None])).radiance
    direct = radiance if dtype == "float32" else encoded(radiance, dtype)
    np.testing.assert_array_equal(view, direct.reshape(view.shape))


@pytest.mark.parametrize("samples", [1, 5])
def test_same_bits_for_any_workers_and_tiles(samples, hall_scene, monkeypatch):
    options = {"samples": samples, "seed": 4, "noise": 2.0}
    whole = render(hall_scene, SMALL, workers=1, **options)
    for workers in (2, 5):
        assert_same(whole, render(hall_scene, SMALL, workers=workers, **options))
    # 50 splits every row of 128 in three, 700 leaves a remainder, 10**6 is more than the picture
    for tile in (50, 700, 10**6):
        monkeypatch.setattr(job, "TILE_RAYS", tile)
        assert_same(whole, render(hall_scene, SMALL, workers=2, **options))


def test_tiles_cover_every_pixel_once():
    for tile in (1, 7, 24, 25, 100, 10**6):
        seen = np.zeros((16, 24), int)
        for rows, cols in tiles(ONE_LENS, tile):
            seen[rows, cols] += 1
            assert seen[rows, cols].size <= tile
        assert (seen == 1).all()


def test_support_images_are_of_the_first_sample_and_as_requested(hall_scene):
    full = render(hall_scene, SMALL, samples=3, seed=1)
    some = render(hall_scene, SMALL, samples=3, seed=1, support=("object_id",))
    assert some.depth is None and some.normal is None
    np.testing.assert_array_equal(some.object_id, full.object_id)
    np.testing.assert_array_equal(some.picture.pixels, full.picture.pixels)
    none = render(hall_scene, SMALL, samples=3, seed=1, support=())
    assert none.object_id is None
    np.testing.assert_array_equal(none.picture.pixels, full.picture.pixels)

    m, n = np.meshgrid(np.arange(128), np.arange(64))
    place = np.empty((128 * 64, 2))
    sample_places(1, m.ravel(), n.ravel(), 128, 0, 1, 0, fixed_places(3), (16, 16), place)
    first = trace(hall_scene, *SMALL.rays(sample=place.reshape(64, 128, 2)))
    np.testing.assert_array_equal(full.depth.ravel(), first.depth)
    np.testing.assert_array_equal(np.isnan(full.depth), full.object_id == -1)
    np.testing.assert_array_equal((full.normal == 0).all(axis=-1), full.object_id == -1)


def test_object_ids_name_their_objects():
    """Glass goes behind opaque objects inside; the names must follow."""
    scene = Scene(
        bodies=[
            body(wall(5, 50), name="pane", transmission=WHITE),
            body(wall(9, 50), name="wall"),
        ]
    )
    shot = render(scene, ONE_LENS)
    assert shot.object_names == ["wall", "pane"]
    assert {shot.object_names[i] for i in np.unique(shot.object_id)} == {"pane"}


def test_noise_is_the_picture_s_own(hall_scene):
    clean = render(hall_scene, SMALL)
    noisy = render(hall_scene, SMALL, noise=3.0, seed=7)
    np.testing.assert_array_equal(noisy.picture.pixels, add_sensor_noise(clean.picture, 3.0, 7).pixels)
    assert (noisy.picture.pixels != clean.picture.pixels).mean() > 0.5


def test_progress_counts_every_tile(monkeypatch):
    monkeypatch.setattr(job, "TILE_RAYS", 64)
    calls = []
    render(Scene(bodies=[body(wall(5))]), ONE_LENS, progress=lambda *at: calls.append(at))
    assert calls == [(i, 6) for i in range(1, 7)]


def test_an_interrupted_picture_stops(monkeypatch):
    monkeypatch.setattr(job, "TILE_RAYS", 24)

    def stop(done, tiles):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render(Scene(bodies=[body(wall(5))]), ONE_LENS, progress=stop)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"samples": 0}, "samples is 0"),
        ({"samples": 2.5}, "samples is 2.5"),
        ({"seed": -1}, "seed is -1"),
        ({"workers": 0}, "workers is 0"),
        ({"dtype": "float64"}, "unknown pixel type 'float64': known are uint8, uint16, float32"),
        ({"support": ("depht",)}, "unknown support image depht: known are depth, normal, object_id"),
        ({"noise": -1.0}, "noise sigma is -1"),
        ({"noise": float("nan")}, "noise sigma is nan"),
        ({"pose": np.zeros((3, 3))}, "pose is not a finite 4×4 matrix"),
        ({"pose": np.diag([2.0, 2.0, 2.0, 1.0])}, "pose is not rigid"),
        ({"pose": np.diag([1.0, 1.0, -1.0, 1.0])}, "pose is not rigid"),
        ({"pose": np.full((4, 4), np.nan)}, "pose is not a finite 4×4 matrix"),
    ],
)
def test_parameters_out_of_range_are_refused(wrong, says):
    with pytest.raises(ValueError, match=says):
        render(Scene(bodies=[body(wall(5))]), ONE_LENS, **wrong)


def test_rays_by_row_and_column_make_the_same_picture(monkeypatch):
    scene, camera, pose = hall(), preset("setup1", scale=64), np.eye(4)
    pose[:3, :3] = [[0.96, 0, 0.28], [0, 1, 0], [-0.28, 0, 0.96]]
    pose[:3, 3] = 1, -2, 0.5
    by_row = render(scene, camera, pose=pose, support=tuple(SUPPORT_IMAGES))
    monkeypatch.setattr(IICamera, "separable_rays", lambda *block: None)
    one_by_one = render(scene, camera, pose=pose, support=tuple(SUPPORT_IMAGES))
    np.testing.assert_array_equal(by_row.picture.pixels, one_by_one.picture.pixels)
    for name in SUPPORT_IMAGES:
        np.testing.assert_array_equal(getattr(by_row, name), getattr(one_by_one, name))
    assert len(np.unique(by_row.picture.pixels)) > 20


# Supersampling


class Watched(IICamera):
    """A camera that records the requested rays."""

    asked = None

    def separable_rays(self, rows=slice(None), cols=slice(None)):
        return None

    def weighted_rays_at(self, m, n, sample=(0.5, 0.5), place=(0.5, 0.5)):
        L, D, weight = super().weighted_rays_at(m, n, sample, place)
        m, n = np.broadcast_arrays(m, n, np.asarray(sample)[..., 0])[:2]
        self.asked.append((m.ravel(), n.ravel(), np.broadcast_to(sample, (*m.shape, 2)).reshape(-1, 2), L - D))
        return L, D, weight


def places(samples, seed=0):
    """Return the positions of samples in their pixels, (pixels, samples, 2), and points that their rays pass."""
    camera = Watched(pixels=(24, 16), lenses=(3, 2), pixel_pitch_mm=0.1, gap_mm=2.0)
    object.__setattr__(camera, "asked", [])
    render(Scene(bodies=[body(wall(5))]), camera, samples=samples, seed=seed)
    *_, (m, n, place, pixel) = camera.asked  # before them, the rays that measure the distance of the content
    order = np.lexsort((m, n), axis=0)  # stable: samples of a pixel stay in their order
    return camera, place[order].reshape(24 * 16, samples, 2), pixel.reshape(-1, 3)[order].reshape(16, 24, samples, 3)


@pytest.mark.parametrize("samples", [1, 2, 4, 8, 16, 32])
def test_samples_stay_in_their_pixel_under_their_lens_where_their_set_puts_them(samples):
    """More than 16 lie one in each cell of every grid."""
    camera, place, pixel = places(samples)
    width, height = camera.size_mm
    row, column = np.mgrid[:16, :24]
    x = (pixel[..., 0] + width / 2) / camera.pixel_pitch_mm - column[..., None]
    y = (height / 2 - pixel[..., 1]) / camera.pixel_pitch_mm - row[..., None]
    # 1e-12: rounding of lens − (lens − pixel) over coordinates of a millimetre
    np.testing.assert_allclose(np.stack([x, y], axis=-1).reshape(place.shape), place, atol=1e-12)
    assert (place >= 0).all() and (place < 1).all()
    if samples <= 16:
        table = fixed_places(samples)
        middle = np.abs(table - 0.5)
        turned = np.minimum(
            np.abs(np.abs(place - 0.5) - middle).max(axis=(1, 2)),
            np.abs(np.abs(place - 0.5) - middle[:, ::-1]).max(axis=(1, 2)),
        )
        assert turned.max() < 1e-15
    across = 1
    while 16 < samples and across <= samples:
        down = samples // across
        cell = (place[..., 1] * down).astype(int) * across + (place[..., 0] * across).astype(int)
        np.testing.assert_array_equal(np.sort(cell, axis=1), np.broadcast_to(np.arange(samples), cell.shape))
        across *= 2
    if samples == 1:
        assert (place == 0.5).all()


def test_samples_depend_on_seed_and_pixel_alone():
    stacks = [places(4, seed)[1] for seed in (3, 3, 4)]
    np.testing.assert_array_equal(stacks[0], stacks[1])
    # 3 of 4 pixels have the first sample elsewhere in x: it has four places along each axis
    assert (stacks[0] != stacks[2]).mean() == pytest.approx(0.75, abs=0.08)
    assert len(np.unique(stacks[0][:, 0], axis=0)) == 8
    stacks = [places(32, seed)[1] for seed in (3, 3, 4)]
    np.testing.assert_array_equal(stacks[0], stacks[1])
    assert (stacks[0] != stacks[2]).mean() > 0.99
    first = stacks[0][:, 0]
    assert len(np.unique(first, axis=0)) == 24 * 16, "no two pixels share their positions"
    # uniform over the pixel: mean ½ ± 5 standard errors of 384 uniform positions
    np.testing.assert_allclose(first.mean(axis=0), 0.5, atol=5 / np.sqrt(12 * 384))


def test_a_fixed_number_is_adaptive_sampling_between_equal_numbers(hall_scene):
    """Two ways to the same samples; the sums differ in their last bit (float32, then float64)."""
    options = {"dtype": "float32", "seed": 3}
    fixed, adaptive = (render(hall_scene, SMALL, samples=s, **options) for s in (8, (8, 8)))
    np.testing.assert_allclose(fixed.picture.pixels, adaptive.picture.pixels, rtol=2e-6, atol=1e-7)
    np.testing.assert_array_equal(fixed.depth, adaptive.depth)
    assert fixed.stats.rays == adaptive.stats.rays


def test_samples_converge_to_the_area_an_edge_covers():
    """A bright wall ends on the line y = 0.37·x + 0.13 seen through one lens: each pixel is its covered share."""
    slope, z = 0.37, 42.0
    scale = (z - ONE_LENS.gap_mm) / ONE_LENS.gap_mm
    xs = np.array([-1000.0, 1000.0])
    line = slope * xs + 0.13 * scale
    corners = np.array([[xs[0], -3000, z], [xs[1], -3000, z], [xs[1], line[1], z], [xs[0], line[0], z]])
    mesh = wall(z)
    lit = body(type(mesh)(corners, mesh.faces), colour=WHITE)
    scene = Scene(bodies=[lit], ambient=WHITE)
    # the covered area by 400 × 400 points in each pixel: right to about 1/400
    at = (np.arange(400) + 0.5) / 400
    exact = np.empty((16, 24))
    for n in range(16):
        for m in range(24):
            x = (m + at) * 0.1 - 1.2
            y = 0.8 - (n + at) * 0.1
            exact[n, m] = (-y[:, None] <= slope * -x[None, :] + 0.13).mean()  # pixels see through the lens: inverted
    edge = (exact > 0) & (exact < 1)
    assert edge.sum() > 20
    errors = []
    for samples in (4, 16, 256):
        picture = render(scene, ONE_LENS, samples=samples, dtype="float32", support=()).picture.pixels
        off = picture[..., 0] - exact
        # inside and outside: 256 float32 ones add up exactly, a mean of them is 1 or 0
        assert np.abs(off[~edge]).max() == 0
        errors.append(np.abs(off[edge]).max())
    # A line crosses at most across + down − 1 of the strata; only those are left to chance, each with a variance
    # of at most ¼. Five standard deviations, and the 1/400 of the reference.
    for samples, error in zip((4, 16, 256), errors, strict=True):
        crossed = 2 * np.sqrt(samples) - 1
        assert error <= min(crossed, 5 * np.sqrt(crossed) / 2) / samples + 1 / 400
    assert errors[2] < errors[1] < errors[0]


# What a picture cost, counted by hand


def counts(scene, camera=ONE_LENS, **more):
    stats = render(scene, camera, workers=1, **more).stats
    assert 0 <= stats.embree_seconds <= stats.cpu_seconds and stats.seconds > 0
    return stats.rays


def kinds(primary, shadow=0, reflection=0, refraction=0):
    return {"primary": primary, "shadow": shadow, "reflection": reflection, "refraction": refraction}


def test_rays_of_a_lit_wall():
    pixels = 24 * 16
    full = body(wall(20, 100))
    front, behind = sun((0, 0, -1)), sun((0, 0, 1))
    assert counts(Scene(bodies=[full])) == kinds(pixels)
    assert counts(Scene(bodies=[full], lights=[front])) == kinds(pixels, shadow=pixels)
    assert counts(Scene(bodies=[full], lights=[front, front])) == kinds(pixels, shadow=2 * pixels)
    assert counts(Scene(bodies=[full], lights=[behind])) == kinds(pixels), "no shadow ray from a face turned away"
    assert counts(Scene(bodies=[full], lights=[front]), samples=3) == kinds(3 * pixels, shadow=3 * pixels)
    assert counts(Scene(bodies=[full], lights=[sun((0, 0, -1), (0, 0, 0))])) == kinds(pixels), "no light, no ray"

    half = Scene(bodies=[body(wall(20, 5), name="patch")], lights=[front])
    shot = render(half, ONE_LENS)
    hit = int((shot.object_id == 0).sum())
    assert 0 < hit < pixels
    assert shot.stats.rays == kinds(pixels, shadow=hit)


def test_rays_of_a_mirror_and_of_a_pane():
    pixels = 24 * 16
    mirror = body(wall(20, 100), mirror=(0.5, 0.5, 0.5))
    assert counts(Scene(bodies=[mirror], background=UNIFORM)) == kinds(pixels, reflection=pixels)
    assert counts(Scene(bodies=[mirror], max_depth=0)) == kinds(pixels)
    patch = Scene(bodies=[body(wall(20, 5), mirror=WHITE)], max_depth=9)
    assert counts(patch)["reflection"] == (render(patch, ONE_LENS).object_id == 0).sum()
    # Back and forth between two faces, 4 % reflected each time: all goes on at the first face, the second and the
    # first again; at the second again 0.15 % leaves, and 0.006 % reflected is too little for a pixel.
    pane = body(box(200, 200, 1), at=(0, 0, 20), transmission=WHITE)
    assert counts(Scene(bodies=[pane])) == kinds(pixels, reflection=3 * pixels, refraction=4 * pixels)
    assert counts(Scene(bodies=[pane], max_depth=1)) == kinds(pixels, reflection=pixels, refraction=pixels)
    # A pane in a light's way: one shadow ray to it, one through it, one on from it.
    below = Scene(
        bodies=[body(floor(200), at=(0, -5, 0)), body(box(500, 1, 500), at=(0, 30, 0), transmission=WHITE)],
        lights=[sun((0, 1, 0))],
        max_depth=0,
    )
    lit = int((render(below, ONE_LENS).object_id == 0).sum())
    assert lit > 50
    assert counts(below) == kinds(pixels, shadow=3 * lit)


def test_a_sky_alone_is_seen_where_nothing_is():
    scene = Scene(bodies=[body(sphere(1), at=(0, 0, -50))], background=Background(horizon=(0.25, 0.5, 0.75)))
    shot = render(scene, ONE_LENS, dtype="float32")
    assert (shot.object_id == -1).all() and np.isnan(shot.depth).all() and (shot.normal == 0).all()
    assert shot.stats.rays == kinds(24 * 16)
    far = Scene(bodies=scene.bodies, background=UNIFORM, lights=[lamp((0, 0, 5))])
    assert (render(far, ONE_LENS, dtype="float32").picture.pixels == 1).all()


REGULAR = IICamera(pixels=(96, 64), lenses=(12, 8), pixel_pitch_mm=0.1, gap_mm=2.0)
HEXAGONAL = IICamera(pixels=(100, 61), lenses=(8, 5), pixel_pitch_mm=0.4, gap_mm=11.7, lattice="hexagonal")
LINES = IICamera(pixels=(96, 64), lenses=(12, 64), pixel_pitch_mm=0.1, gap_mm=2.0)
LARGE = IICamera(pixels=(400, 200), lenses=(2, 1), pixel_pitch_mm=0.1, gap_mm=20.0)


@pytest.mark.parametrize("camera", [REGULAR, HEXAGONAL, LINES, LARGE, ONE_LENS])
def test_every_pixel_of_a_tile_is_traced_once(camera):
    for rays in (30, 1000, 4096):
        for rows, cols in tiles(camera, rays):
            order = ray_order(camera, rows, cols)
            shape = rows.stop - rows.start, cols.stop - cols.start
            np.testing.assert_array_equal(np.sort(order.pixels), np.arange(np.prod(shape)))
            np.testing.assert_array_equal(np.ravel_multi_index((order.rows, order.columns), shape), order.pixels)
            np.testing.assert_array_equal(order.in_place(order.pixels), np.arange(np.prod(shape)))


@pytest.mark.parametrize("camera", [REGULAR, LINES])
def test_packets_are_of_one_place_under_neighbouring_lenses(camera):
    u, v = camera.ei_pixels
    for rows, cols in tiles(camera, 4096):
        order = ray_order(camera, rows, cols)
        m, n = (cols.start + order.columns).reshape(-1, 16), (rows.start + order.rows).reshape(-1, 16)
        assert (np.ptp(m % u, axis=1) == 0).all() and (np.ptp(n % v, axis=1) == 0).all()
        assert (np.ptp(m // u, axis=1) == 3).all() and (np.ptp(n // v, axis=1) == 3).all()


def test_under_large_lenses_and_in_plain_pictures_packets_are_neighbouring_pixels():
    for camera in (LARGE, ONE_LENS):
        for rows, cols in tiles(camera, 4096):
            order = ray_order(camera, rows, cols)
            packets = order.rows.reshape(-1, 16), order.columns.reshape(-1, 16)
            assert all((np.ptp(p, axis=1) == 3).all() for p in packets)


def test_rays_of_maps_without_lenses_are_grouped_by_direction(tmp_path):
    """Maps of an II-camera without its lenses: packets spread little more than those of the camera."""
    write_maps([REGULAR], tmp_path, format="exr")
    sheet = json.loads((tmp_path / "camera.json").read_text())
    bare = {"arrays": [{"samples": array["samples"]} for array in sheet["arrays"]]}
    (tmp_path / "camera.json").write_text(json.dumps(bare))
    (camera,) = read_maps(tmp_path)
    L, D = REGULAR.rays()
    D = D / np.linalg.norm(D, axis=-1, keepdims=True)

    def spread(camera):
        order = ray_order(camera, slice(0, 64), slice(0, 96)).pixels.reshape(-1, 16)
        return [np.median(np.ptp(x.reshape(-1, 3)[order], axis=1).sum(axis=1)) for x in (L, D)]

    (near, narrow), (own_near, own_narrow) = spread(camera), spread(REGULAR)
    assert near < 2 * own_near and narrow <= own_narrow + 1e-6
    scene = hall()
    np.testing.assert_array_equal(render(scene, camera).picture.pixels, render(scene, REGULAR).picture.pixels)


# -- three wavelengths


@pytest.mark.parametrize("samples", [1, (4, 8)])
def test_each_channel_has_the_rays_of_its_wavelength(hall_scene, samples):
    camera = preset("plenoptic1-double-gauss", scale=64)
    model, field_lens, glass = camera.optics
    three = replace(camera, optics=(model, field_lens, replace(glass, wavelengths_nm=(640.0, 550.0, 450.0))))
    support = ("depth", "samples")
    shot, rays = render(hall_scene, three, support=support, samples=samples), 0
    for channel, wavelength in enumerate((640.0, 550.0, 450.0)):
        alone = replace(camera, optics=(model, field_lens, replace(glass, wavelength_nm=wavelength)))
        single = render(hall_scene, alone, support=support, samples=samples)
        np.testing.assert_array_equal(shot.picture.pixels[..., channel], single.picture.pixels[..., channel])
        if channel == 1:
            np.testing.assert_array_equal(shot.depth, single.depth)
            np.testing.assert_array_equal(shot.samples, single.samples)
        rays += single.stats.rays["primary"]
    assert shot.stats.rays["primary"] == rays
    assert (shot.picture.pixels != single.picture.pixels).any() and shot.picture.camera == three


def test_a_job_of_three_wavelengths_reaches_worker_processes(hall_scene):
    camera = preset("plenoptic1-double-gauss", scale=128)
    model, field_lens, glass = camera.optics
    three = replace(camera, optics=(model, field_lens, replace(glass, wavelengths_nm=(640.0, 550.0, 450.0))))
    made = job.Job(hall_scene, three, 1, 0, np.eye(4), "uint8", ())
    rows, cols = made.tiles()[0]
    pixels = [j.tile(rows, cols).arrays["pixels"] for j in (made, pickle.loads(pickle.dumps(made)))]
    np.testing.assert_array_equal(*pixels)
    made.stop()  # all channels leave their tiles
    with pytest.raises(CancelledError):
        made.tile(rows, cols)


def test_three_wavelengths_are_audited_channel_by_channel(hall_scene, monkeypatch):
    """The audit of green's own pixels said nothing of red and blue."""
    monkeypatch.setattr(job, "FULL_SAMPLES", 4)
    camera, deep = preset("plenoptic1-double-gauss", scale=64), hall_scene.with_depth(12)
    model, field_lens, glass = camera.optics
    three = replace(camera, optics=(model, field_lens, replace(glass, wavelengths_nm=(640.0, 550.0, 450.0))))
    exact = render(deep, three, samples=4, audit=1, support=())
    assert exact.stats.audit == Audit(pixels=exact.picture.pixels[..., 0].size), "no difference"
    one = render(deep, three, audit=1, support=())
    off = np.abs(one.picture.pixels.astype(int) - exact.picture.pixels).max(axis=2)
    assert one.stats.audit.wrong == (off > 2).sum() > 0 and one.stats.audit.worst == off.max()
