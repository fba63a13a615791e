"""Metrics against truth: published values, closed forms, directly traced rays."""

import math

import numpy as np
import pytest
from skimage import data

from ii_core import IICamera, IIPicture, five_viewpoints, preset, view_image
from ii_core.picture.view import view_positions
from metrics import linear_layers, q_angle, q_depth, q_global, q_view
from raytrace_ii import load_scene, render


def flat(image):
    """A grey image as an II-picture of one pixel a lens: from the front, the picture is the view."""
    rows, cols = image.shape
    camera = IICamera(pixels=(cols, rows), lenses=(cols, rows), pixel_pitch_mm=0.1, gap_mm=0.2)
    return IIPicture(np.repeat(image[..., None], 3, axis=2), (cols, rows), (1, 1), camera)


def test_mssim_published_for_the_reference_implementation():
    """scikit-image's photograph *camera* with noise, measured with IPOL's imdiff (doi 10.5201/ipol.2011.g_lmii).

    The value and the seed are those in scikit-image's own tests, where G. Lee reports it (pull request 4913).
    """
    image = data.camera()
    noisy = np.clip(image + 20.0 * np.random.RandomState(5).randn(*image.shape), 0, 255).astype(np.uint8)
    value = q_view(flat(image), flat(noisy), viewpoints={"front": (0, 0, -500.0)}).values["front"]
    # imdiff mirrors at the border, where we measure nothing: 4 % of the pixels. Its luma is grey itself.
    assert value == pytest.approx(0.357959091663361, abs=1.5e-3)


@pytest.mark.parametrize(("a", "b"), [(100, 100), (0, 255), (50, 60), (0, 10)])
def test_mssim_of_even_images_in_closed_form(a, b):
    images = (np.full((20, 24), value, np.uint8) for value in (a, b))
    a, b = 0.9999 * a, 0.9999 * b  # the weights of luma as published
    c1 = (0.01 * 255) ** 2
    q = q_view(*map(flat, images))
    # Wang 2004, (6): no contrast, no structure; variances are differences of squares of up to 255².
    assert q.mean == pytest.approx((2 * a * b + c1) / (a * a + b * b + c1), abs=1e-9)


def test_mssim_falls_with_noise_and_blur_and_forgives_a_shift_of_level():
    """Wang 2004, Figure 2: at equal MSE a shift in level lowers SSIM little, noise much."""
    y, x = np.mgrid[0:64, 0:64]
    image = (128 + 50 * np.sin(x / 5) * np.cos(y / 7)).astype(np.uint8)
    sign = np.where(np.random.default_rng(0).random(image.shape) < 0.5, -12, 12)
    shifted, noisy = flat(image + np.uint8(12)), flat((image + sign).astype(np.uint8))
    assert q_global(flat(image), shifted) == q_global(flat(image), noisy) == pytest.approx(20 * math.log10(255 / 12))
    q = [q_view(flat(image), other).mean for other in (shifted, noisy)]
    assert q[0] > 0.95 > 0.8 > q[1]


def test_a_view_image_equals_ray_tracing_from_the_viewpoint():
    """From U·Λ before the lenses every line through a lens ends on a pixel's very centre."""
    scene, camera = load_scene("cuboid"), preset("setup1", scale=16)
    # Two cameras have two ray widths: filtered textures would differ.
    picture = render(scene, camera, support=(), texture_filter=False).picture
    (k, l), (u, _), gap = camera.lenses, camera.ei_pixels, camera.gap_mm
    viewpoint = np.array([0, 0, gap * (1 - u)])
    seen = [view_image(picture, viewpoint, interpolation=how) for how in ("nearest", "linear")]
    valid = seen[0][1]
    own = valid & (np.abs(np.arange(k) - (k - 1) / 2) < u / 2) & (np.abs(np.arange(l) - (l - 1) / 2) < u / 2)[:, None]

    # A pinhole at the viewpoint whose pixels look through the lens centres; its picture stands on its head.
    pinhole = IICamera(pixels=(k, l), lenses=(1, 1), pixel_pitch_mm=camera.lens_pitch_mm[0] / u, gap_mm=gap)
    pose = np.eye(4)
    pose[2, 3] = viewpoint[2] - gap
    traced = render(scene, pinhole, pose=pose, support=(), texture_filter=False).picture.pixels[::-1, ::-1]
    assert own.sum() == 16 * 16
    for view, _ in seen:
        apart = np.abs(view[own].astype(int) - traced[own])
        # Another start along the same ray, in float32: a rare one at an edge meets another face.
        assert (apart > 1).any(axis=1).mean() < 0.01


def test_a_distortion_of_one_direction_is_seen_from_there_and_in_no_other_sub_image():
    scene, camera = load_scene("apples"), preset("setup1", scale=32)
    a = render(scene, camera, support=()).picture
    pixels = a.pixels.copy()
    pixels.reshape(8, 16, 16, 16, 3)[:, 5, :, 11] ^= 4
    q = q_angle(a, a.with_pixels(pixels)).values
    assert q[5, 11] == pytest.approx(20 * math.log10(255 / 4), rel=1e-14)
    assert np.isinf(q).sum() == 255


def test_noise_on_one_true_layer_of_a_scene_finds_that_layer_and_no_other():
    camera = preset("setup1", scale=16)
    shot = render(load_scene("cuboid"), camera, support=("depth",))
    layer = np.floor(shot.depth / camera.gap_mm + 0.5)
    layers, counts = np.unique(layer[np.isfinite(layer)], return_counts=True)
    target = layers[counts.argsort()[-3]]
    pixels = shot.picture.pixels.astype(int)
    there = layer == target
    pixels[there] += np.where(pixels[there] < 128, 6, -6)
    q = q_depth(
        shot.picture,
        shot.picture.with_pixels(pixels.astype(np.uint8)),
        depth=shot.depth,
        layers_mm=linear_layers(camera),
    )
    if q.counts[int(target) - 1] == 0:
        pytest.fail("the view has no pixel in the layer: nothing was tested")
    assert np.flatnonzero(np.isfinite(q.values)).tolist() == [int(target) - 1]
    assert q.values[int(target) - 1] == pytest.approx(20 * math.log10(255 / 6), rel=1e-14)


@pytest.mark.parametrize("name", ["setup1", "setup2-64", "setup3"])
def test_the_five_views_reach_the_limits_of_the_viewing_zone(name):
    """At φ and θ every lens shows its own elementary image; two pixels' angle farther, one shows its neighbour's.

    Half a pixel is kept in reserve, and the array's border, which φ goes by, lies half a lens past the last centre.
    """
    camera = preset(name, scale=4)
    (u, v), (k, l) = camera.ei_pixels, camera.lenses
    centre = np.array([0, 0, camera.gap_mm])

    def strays(viewpoint):
        x, y = view_positions(camera, viewpoint)
        x, y = x - np.arange(k) * u, y - np.arange(l) * v
        # The outermost position is the border itself: a billionth for rounding.
        return any(abs(at - (side - 1) / 2).max() > side / 2 + 1e-9 for at, side in ((x, u), (y, v)))

    for viewpoint in five_viewpoints(camera).values():
        assert not strays(viewpoint)
        arm = viewpoint - centre
        r, side = np.linalg.norm(arm), arm[:2] / max(np.linalg.norm(arm[:2]), 1e-300)
        if np.linalg.norm(arm[:2]) < 1e-9:
            # Three times as far as the array's border asks for; the last lens's centre is half a lens inside.
            assert strays(centre + arm / 3 / (1 + 2 / min(k, l)))
            continue
        angle = math.atan2(np.linalg.norm(arm[:2]), -arm[2]) + math.atan(2 * camera.pixel_pitch_mm / camera.gap_mm)
        assert strays(centre + r * np.array([*(math.sin(angle) * side), -math.cos(angle)]))


def test_a_side_zone_shows_the_neighbouring_elementary_images():
    """One zone to the side, (4.1) runs on: the view is that of the array with every lens's neighbour."""
    camera = preset("setup1", scale=16)
    pixels = np.random.default_rng(0).integers(0, 256, (*camera.pixels[::-1], 3), np.uint8)
    picture = IIPicture(pixels, camera.lenses, camera.ei_pixels, camera)
    front = five_viewpoints(camera)["front"]
    zone = camera.lens_pitch_mm[0] * (camera.gap_mm - front[2]) / camera.gap_mm
    straight, _ = view_image(picture, front, interpolation="nearest")
    aside, valid = view_image(picture, front + np.array([zone, 0, 0]), interpolation="nearest")
    moved = picture.with_pixels(np.roll(pixels, -16, axis=1))
    expected, _ = view_image(moved, front, interpolation="nearest")
    assert valid[:, :-1].all() and not valid[:, -1].any()  # the last lens has no neighbour
    np.testing.assert_array_equal(aside[:, :-1], expected[:, :-1])
    assert (aside[:, :-1] != straight[:, :-1]).any()
