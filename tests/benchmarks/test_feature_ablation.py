"""Scenes with features left out, and the criterion of visible difference."""

import numpy as np
import pytest

from benchmarks.speed import feature_ablation as ablation
from ii_core import IIPicture, preset
from raytrace_ii import Scene, trace
from raytrace_ii.scene.textures import Checker, Image, VertexColours
from tests.support.trace_scenes import WHITE, body, floor, hall, sphere, sun

CAMERA = preset("setup1", scale=16)


@pytest.fixture(scope="module")
def full():
    return ablation.shoot(ablation.build("objects", ()), CAMERA).picture


def test_without_shadows_all_is_lit_and_the_scene_itself_stays_shaded():
    ball, ground = body(sphere(1), at=(0, 2, 5)), body(floor(), name="floor", colour=WHITE)
    down = [(0, 0.5, 5)], [(0, -1.0, 0)]
    for scene in (Scene(bodies=[ball, ground], lights=[sun((0, 1, 0))]), hall()):
        shaded = trace(scene, *down)
        free = trace(ablation.unshadowed(scene), *down)
        assert (free.radiance >= shaded.radiance).all()
        np.testing.assert_array_equal(trace(scene, *down).radiance, shaded.radiance)
    plain = Scene(bodies=[ball, ground], lights=[sun((0, 1, 0))])
    assert trace(ablation.unshadowed(plain), *down).radiance[0] == pytest.approx([1, 1, 1])


def test_a_camera_in_glass_refracts_without_shadows():
    """Camera rays in glass use the same query as shadow rays through glass."""
    scene = Scene(
        bodies=[body(sphere(5), transmission=WHITE, absorption_per_mm=(0.2, 0, 0))], background=hall().background
    )
    rays = [(0, 0, 0)] * 2, [(0, 0, 1.0), (0.1, 0.2, 1)]
    np.testing.assert_array_equal(trace(ablation.unshadowed(scene), *rays).radiance, trace(scene, *rays).radiance)


def test_features_of_a_scene_are_found_and_left_out():
    parts = ablation.has("objects")
    assert {"shadows", "highlights", "smooth normals", "bounces beyond 5", "triangles, × 0.5"} <= set(parts)
    assert not {"fog", "textures", "texture filtering", "normal maps", "bounces beyond 6"} & set(parts)
    assert {"textures", "texture filtering"} <= set(ablation.has("cuboid"))
    bare = ablation.build("objects", parts)
    whole = ablation.build("objects", ())
    assert bare.max_depth == 0 and all(b.normals is None and b.material.specular == 0 for b in bare.bodies)
    assert sum(len(b.faces) for b in bare.bodies) < sum(len(b.faces) for b in whole.bodies) / 10
    shot = ablation.shoot(bare, CAMERA)
    assert shot.stats.rays["reflection"] == shot.stats.rays["refraction"] == 0


def test_plain_colours_are_the_mean_of_the_texture():
    image = Image(np.random.default_rng(0).random((5, 7, 3), np.float32))
    np.testing.assert_allclose(ablation.mean_colour(image, None), image.pixels.reshape(-1, 3).mean(axis=0), rtol=1e-6)
    np.testing.assert_array_equal(ablation.mean_colour(Checker((WHITE, (0, 0, 0)), (1, 1, 1)), None), [0.5] * 3)
    np.testing.assert_array_equal(ablation.mean_colour(VertexColours(), [[0, 1, 2], [2, 1, 0]]), [1, 1, 1])


def test_the_limit_is_the_noise_of_the_reference_set(full):
    """Rounding to 8 bits, noise of one step, rounding again: 1 + 2/12 squared steps, 47.46 dB."""
    limit = ablation.compared(full, ablation.noisy(full))
    assert limit["psnr"] == pytest.approx(10 * np.log10(255**2 / (1 + 2 / 12)), abs=0.05)
    assert 3 < limit["rare"] < 4 and 0.98 < limit["worst"] < 1
    assert ablation.alike(ablation.compared(full, full), limit)


def test_the_criterion_detects_small_distant_details(full):
    """A spot in two of a thousand pixels: 53 dB is better than the noise, but the spot is detected."""
    limit = ablation.compared(full, ablation.noisy(full))
    pixels = full.pixels.copy()
    rows, cols = np.unravel_index(np.arange(0, pixels.shape[0] * pixels.shape[1], 500), pixels.shape[:2])
    pixels[rows, cols] ^= 12 * 257
    found = ablation.compared(full, full.with_pixels(pixels))
    assert found["psnr"] > limit["psnr"] and not ablation.alike(found, limit)


def test_the_least_model_keeps_visible_features(full):
    limit = ablation.compared(full, ablation.noisy(full))
    rows = [{"what": f"bounces beyond {depth}", "time": -0.1 * depth} for depth in (0, 5)]
    for row in rows:
        row |= ablation.compared(full, ablation.shoot(ablation.build("objects", (row["what"],)), CAMERA).picture)
    least = ablation.least_model("objects", CAMERA, full, rows, limit)
    assert least["without"] == ["bounces beyond 5"] and ablation.alike(least, limit)


def test_pictures_are_enlarged_lens_by_lens_or_pixel_by_pixel():
    rng = np.random.default_rng(0)
    small = IIPicture(rng.integers(0, 65536, (4 * 3, 6 * 2, 3)).astype(np.uint16), (6, 4), (2, 3))
    same = ablation.enlarged(small, (2, 3), linear=False)
    np.testing.assert_array_equal(same[::2, ::2], small.pixels)
    np.testing.assert_array_equal(same, small.pixels.repeat(2, axis=0).repeat(2, axis=1))
    lenses = ablation.enlarged(small, (0, 1), linear=False)
    np.testing.assert_array_equal(lenses[:3, :2], lenses[3:6, 2:4])
    for axes in ((0, 1), (2, 3)):
        flat = small.with_pixels(np.full_like(small.pixels, 999))
        assert (ablation.enlarged(flat, axes, linear=True) == 999).all()
    ramp = np.broadcast_to((np.arange(8) * 100.0)[None, :, None], (8, 8, 3)).astype(np.uint16)
    np.testing.assert_array_equal(
        ablation.enlarged(IIPicture(ramp, (1, 1), (8, 8)), (2, 3), linear=True)[0, 1:-1, 0], 25 + 50 * np.arange(14)
    )
