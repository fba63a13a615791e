"""Texture filter: known means, smaller errors than point samples."""

import math

import numba
import numpy as np
import pytest

from ii_core import IICamera, camera_pose, preset
from raytrace_ii import Background, Scene, render
from raytrace_ii.rendering.job import footprint
from raytrace_ii.scene.textures import Image
from raytrace_ii.shapes.primitives import rotation
from raytrace_ii.tracing.kernels.images import add_mixed
from raytrace_ii.tracing.kernels.textures import filter_taps, logarithm
from raytrace_ii.tracing.kernels.textures import footprint as face_footprint
from raytrace_ii.tracing.texture_table import TextureTable, pyramid
from tests.support.slow import first_fast
from tests.support.trace_scenes import BLACK, WHITE, body, filtered, sphere, sun, wall

BOARD = Image(np.broadcast_to((np.add.outer(np.arange(64), np.arange(64)) % 2)[..., None], (64, 64, 3)).astype("f4"))
CAMERA = preset("setup1", scale=64)


def glowing(mesh, image, **more):
    coordinates = np.column_stack([mesh.uv, np.zeros(len(mesh.uv))])
    return body(mesh, coordinates=coordinates, colour=BLACK, emission=WHITE, emission_map=image, **more)


@pytest.mark.parametrize("shape", [(8, 8), (7, 5), (1, 9), (6, 1), (33, 20)])
def test_levels_of_a_pyramid_are_means_over_area(shape):
    """Every level has the image's mean, odd sizes too, and its texels are the integrals over theirs."""
    image = np.random.default_rng(0).random((*shape, 3), np.float32)
    levels = pyramid(image)
    assert levels[-1].shape == (1, 1, 3)
    for level in levels:
        np.testing.assert_allclose(level.mean(axis=(0, 1)), image.mean(axis=(0, 1)), rtol=1e-5)
    fine = np.repeat(np.repeat(image.astype(float), levels[0].shape[0], axis=0), levels[0].shape[1], axis=1)
    rows, columns = levels[0].shape[:2]
    blocks = fine.reshape(rows, fine.shape[0] // rows, columns, fine.shape[1] // columns, 3)
    np.testing.assert_allclose(levels[0], blocks.mean(axis=(1, 3)), rtol=1e-5)


@pytest.mark.slow
def test_a_width_of_a_texel_or_less_reads_the_image_itself():
    compiled = numba.njit(lambda *numbers: filter_taps(*numbers))
    for ellipse in ((1 / 64, 0, 0, 0.5 / 64), (0, 0, 0, 0)):
        assert compiled(*map(np.float32, (64, 64, 6, *ellipse)))[:2] == (1, 0.0)


def test_levels_follow_the_logarithm_of_the_width():
    widths = np.geomspace(1, 1e6, 1000, dtype=np.float32)
    together = numba.njit(lambda widths: np.array([logarithm(width) for width in widths]))
    for found in (together(widths), [logarithm.py_func(width) for width in widths]):
        np.testing.assert_allclose(found, np.log2(widths), atol=2e-6)


def test_four_texels_are_mixed_alike_in_vectors():
    """Compiled, the channels of a texel go together; b1dc540 read them one by one. The last texel has its spare."""
    rng = np.random.default_rng(0)
    texels = TextureTable([Image(rng.random((5, 4, 3), np.float32))]).texels[0]
    last = len(texels) - 2 * 3  # the row of the spare number follows
    weights = tuple(rng.random(4, np.float32))
    together = numba.njit(lambda texels, places, weights, out, at: add_mixed(texels, places, weights, out, at))
    for places in ((0, 3, 12, 15), (last, last - 3, last, 0)):
        places = tuple(map(np.uint64, places))
        found, single = np.ones((2, 6), np.float32)
        add_mixed(texels, places, weights, single, 1)
        together(texels, places, weights, found, 1)
        assert len(set(single[1:4])) == 3
        np.testing.assert_allclose(found, single, rtol=3e-7)  # products and sums may fuse


def test_a_wide_ray_sees_the_mean():
    packed = TextureTable([BOARD])
    for width in (0.5, 1.0, 20.0):
        colour = filtered(packed, 0, 0.3, 0.6, width, 0.0, 0.0, width)
        np.testing.assert_allclose(colour, 0.5, atol=1e-6)


def test_a_long_ellipse_is_read_along_its_length():
    """Stripes across the long axis are averaged, those along it are kept: no isotropic level could do both."""
    stripes = np.broadcast_to((np.arange(64) % 16 < 8)[:, None, None], (64, 64, 3)).astype(np.float32)
    packed = TextureTable([Image(stripes), Image(np.ascontiguousarray(stripes.swapaxes(0, 1)))])
    narrow, wide = 1 / 64, 16 / 64
    second = int(packed.table[0, 8]) + 1  # after the first's levels
    ellipse = (0.5, 1 - 4.5 / 64, wide, 0.0, 0.0, narrow)
    along = [filtered(packed, row, *ellipse)[0, 0] for row in (0, second)]
    assert along[0] > 0.99 and along[1] == pytest.approx(0.5, abs=0.07), along


@pytest.mark.parametrize("turn", [(0, 0, 0), (20, 130, 70)])
@pytest.mark.parametrize("slant", [0.0, 0.5, 1.2, math.pi / 2 - 1e-5])
def test_the_footprint_is_where_the_rays_beside_it_meet_the_face(slant, turn):
    """Diameters over (u, v) against neighbouring parallel rays, in the plane of incidence and across it.

    A ray that grazes the face has a thousandfold width at most.
    """
    mesh = wall(20.0)
    corners = mesh.vertices[mesh.faces].astype(np.float32)
    coordinates = np.zeros_like(corners)
    coordinates[..., :2] = mesh.uv[mesh.faces]
    ahead = np.array([math.sin(slant), 0.0, math.cos(slant)])
    matrix = rotation(turn)
    edges = ((corners[0, 1:] - corners[0, 0]).astype(float) @ matrix.T).ravel()
    grows = (coordinates[0, 1:, :2] - coordinates[0, 0, :2]).ravel()
    across_u, across_v, along_u, along_v = face_footprint(
        *edges, *grows, 0.2, *matrix @ ahead, *matrix @ (0.0, 0.0, -1.0)
    )
    ways = {tuple(np.round(np.abs(way), 9)) for way in ((across_u, across_v), (along_u, along_v))}
    # the wall is 100 mm wide: u and v grow by 1/100 a mm
    truth = {(0.0, 0.002), (round(0.002 * min(1 / math.cos(slant), 1000), 9), 0.0)}
    if slant:
        assert ways == truth
    else:  # straight on, any two directions square to each other will do
        lengths = [math.hypot(across_u, across_v), math.hypot(along_u, along_v)]
        np.testing.assert_allclose(lengths, 0.002, rtol=1e-6)


def test_the_footprint_of_a_camera_is_its_pixel():
    """Through pinholes the pixel pitch over the gap, on the axis; a camera of parallel rays has a width instead."""
    width, spread = footprint(CAMERA)
    assert width == 0 and spread == pytest.approx(CAMERA.pixel_pitch_mm / CAMERA.gap_mm, rel=0.05)
    rods = ({"kind": "lenticular"},)
    lenticular = IICamera(pixels=(64, 64), lenses=(4, 64), pixel_pitch_mm=0.1, gap_mm=3.0, optics=rods)
    width, spread = footprint(lenticular)
    assert width == pytest.approx(0.05) and spread == pytest.approx(0.1 / 3 / 2, rel=0.1)


def test_a_checker_finer_than_pixels_is_grey():
    """Cells of 0.3 mm at 60 mm, where a pixel is 1.6 mm wide; point samples are arbitrary."""
    board = Image(np.tile(BOARD.pixels, (2, 2, 1)))
    scene = Scene(bodies=[glowing(wall(60, 20), board)])
    kept = np.s_[20:-20, 40:-40]
    smooth, points = (
        render(scene, CAMERA, dtype="float32", texture_filter=on).picture.pixels[kept] for on in (True, False)
    )
    assert points.std() > 0.15
    np.testing.assert_allclose(smooth[smooth > 0], 0.5, atol=0.02)


@pytest.mark.parametrize("kind", first_fast(["slanted", "mirrored", "sky", "normals", "blended"], 2))
def test_errors_against_many_samples_fall(kind):
    """Errors of one and of four samples fall by at least a third wherever an image is read."""
    size = (512, 1024) if kind == "sky" else (128, 256)
    dots = np.random.default_rng(7).random(size) > 0.5
    noise = np.repeat((dots * 0.8 + 0.1)[..., None], 3, axis=2).astype(np.float32)
    paper, light = Image(noise), Background(horizon=(0.5,) * 3)
    mesh = wall(0, 25)
    uv = np.column_stack([mesh.uv, np.zeros(4)])
    if kind == "slanted":
        scene = Scene(bodies=[glowing(mesh, paper, at=(0, 0, 50), turn=(0, 55, 0))])
    elif kind == "mirrored":
        mirror = body(wall(40, 40), mirror=WHITE, turn=(0, 0, 0))
        scene = Scene(bodies=[mirror, glowing(mesh, paper, at=(0, 0, -20))], background=light)
    elif kind == "sky":
        scene = Scene(bodies=[body(sphere(2, 24), at=(0, 0, 30))], background=Background(image=paper))
    elif kind == "normals":
        flat = np.broadcast_to(np.float32([0.5, 0.5, 1.0]), noise.shape).copy()
        flat[..., 0] = 0.4 * noise[..., 0] + 0.3
        shiny = body(mesh, at=(0, 0, 50), coordinates=uv, normal_map=Image(flat))
        scene = Scene(bodies=[shiny], ambient=(0.1,) * 3, lights=[sun((1, 0.5, -1))])
    else:
        veil = Image(np.ones((128, 256, 3), np.float32), alpha=np.ascontiguousarray(noise[..., 0]))
        pane = body(mesh, at=(0, 0, 50), coordinates=uv, texture=veil, alpha_blend=1.0, colour=WHITE)
        scene = Scene(bodies=[pane], background=light, ambient=(1.0,) * 3)
    options = {"dtype": "float32", "support": ()}
    truth = render(scene, CAMERA, samples=256, texture_filter=False, **options).picture.pixels

    def error(samples, on):
        shot = render(scene, CAMERA, samples=samples, texture_filter=on, **options)
        return float(np.sqrt(((shot.picture.pixels - truth) ** 2).mean()))

    for samples in (1, 4):
        filtered, points = error(samples, True), error(samples, False)
        assert filtered < 0.67 * points, (samples, filtered, points)


def test_scenes_without_images_do_not_change():
    ball = body(sphere(5, 24), at=(0, 0, 30), mirror=(0.5,) * 3)
    plain = Scene(bodies=[ball], background=Background(horizon=WHITE))
    a, b = (render(plain, CAMERA, texture_filter=on).picture.pixels for on in (True, False))
    np.testing.assert_array_equal(a, b)


@pytest.mark.slow
def test_meridians_of_a_sky_are_grey_where_they_meet():
    """Stripes of 2° by longitude are 0.35° wide at an elevation of 80°, where a pixel of 2.9° sees eight of them."""
    camera = IICamera(pixels=(12, 8), lenses=(1, 1), pixel_pitch_mm=0.1, gap_mm=2.0)
    stripes = np.broadcast_to((np.arange(360) % 4 < 2)[None, :, None], (180, 360, 3)).astype(np.float32)
    below = body(sphere(0.01, 8), at=(0, -50, 0))
    scene = Scene(bodies=[below], background=Background(image=Image(stripes)))
    slope = math.radians(80)
    pose = camera_pose((0, 0, 0), look_at_mm=(0, 99 * math.sin(slope), 99 * math.cos(slope)), up=(0, 0, -1))
    seen, points = (
        render(scene, camera, pose=pose, dtype="float32", support=(), texture_filter=on).picture.pixels[..., 0]
        for on in (True, False)
    )
    assert np.abs(seen - 0.5).max() < 0.2 and np.abs(points - 0.5).max() > 0.4
