"""Textures: counted checkers, noise on its lattice, texels of images, exact codes."""

import itertools
import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ii_core.base.files import read_image
from raytrace_ii import Scene, trace
from raytrace_ii.rendering.job import CURVES, STEPS
from raytrace_ii.scene.textures import Checker, Image, Noise, Stripes, image_texture, linear, normal_map
from raytrace_ii.shapes.primitives import rotation
from raytrace_ii.tracing.kernels.noise import _slope, gradient_noise
from raytrace_ii.tracing.kernels.srgb import encode_srgb, encode_steps
from raytrace_ii.tracing.kernels.tables import FLAT_COLUMNS
from raytrace_ii.tracing.packing import packed
from raytrace_ii.tracing.texture_table import TextureTable
from tests.support.trace_scenes import BLACK, WHITE, alpha_at, body, box, octaves, sphere, texture_at, wall

BOARD = Checker((WHITE, BLACK), (2.0, 2.0, 2.0))
CLOUD = Noise((BLACK, WHITE), (1.0, 1.0, 1.0), contrast=1.0)
finite = st.floats(-50, 50)


def red(texture, *points):
    return texture_at(texture, points)[:, 0]


# Checkers


def test_checker_fields_change_with_every_step_along_every_axis():
    # cells of 2 from the origin: (0, 0, 0) is the first colour
    points = [(1, 1, 1), (3, 1, 1), (3, 3, 1), (3, 3, 3), (-1, 1, 1), (-1, -1, 1), (5, 1, 1), (1, 1, -3)]
    np.testing.assert_array_equal(red(BOARD, *points), [1, 0, 1, 0, 0, 1, 1, 1])
    slab = Checker(((0.2, 0.4, 0.6), (0.7, 0.5, 0.3)), (1.0, 10.0, 0.5))
    np.testing.assert_array_equal(texture_at(slab, [(0.5, 5, 0.25)]), [(0.2, 0.4, 0.6)])
    np.testing.assert_allclose(texture_at(slab, [(0.5, 5, 0.75), (1.5, 9, 0.1)]), [(0.7, 0.5, 0.3)] * 2, atol=1e-15)


@given(finite, finite, finite)
@settings(max_examples=50)
def test_checker_parity(x, y, z):
    cells = [math.floor(c / 2 + 1e-6) for c in (x, y, z)]
    assert red(BOARD, (x, y, z))[0] == (1 - sum(cells) % 2)


def test_a_border_belongs_to_the_cell_after_it():
    """Also if rounding puts it slightly before: 1e-6 of a cell counts as the border."""
    for border in (-4, -2, 0, 2, 4, 100):
        after = red(BOARD, (border + 1, 1, 1))[0]
        for x in (border, np.nextafter(border, -np.inf), border - 1e-6, float(np.float32(border) * (1 - 1e-8))):
            assert red(BOARD, (x, 1, 1))[0] == after
        assert red(BOARD, (border - 1e-5, 1, 1))[0] != after


@pytest.mark.parametrize("size", [2.0, 0.1, 1 / 3, 0.7])
def test_a_face_on_a_border_has_no_noise(size):
    """A wall at a border of cells in z is a plain checkerboard in x and y, for any rounding."""
    for cells in (1, 3, 7, 10):
        z = cells * size
        mesh = wall(z, 20 * size)
        board = Checker((WHITE, BLACK), (size,) * 3)
        scene = Scene(bodies=[body(mesh, coordinates=mesh.vertices, texture=board, colour=WHITE)], ambient=WHITE)
        i, j = (a.ravel() for a in np.meshgrid(np.arange(-9, 9), np.arange(-9, 9)))
        start = np.column_stack([(i + 0.37) * size, (j + 0.61) * size, np.zeros(i.size)])
        seen = trace(scene, start, np.broadcast_to([0.0, 0, 1], start.shape)).radiance[:, 0]
        np.testing.assert_array_equal(seen, 1 - (i + j + cells) % 2)


def test_a_solid_texture_turns_with_its_body():
    """Coordinates are the body's own: moved, turned and far off, the same fields."""
    mesh = box(8, 8, 8)
    points = np.random.default_rng(0).uniform(-3.9, 3.9, (300, 2))
    # on the side of largest z, seen from behind it
    own = np.column_stack([points, np.full(300, 4.0)])
    expected = red(BOARD, *own)
    for at, turn in (((0, 0, 0), (0, 0, 0)), ((100, -50, 300), (0, 0, 0)), ((10, 20, 30), (25, -40, 100))):
        placed = body(mesh, at=at, turn=turn, coordinates=mesh.vertices, texture=BOARD, colour=WHITE)
        matrix = rotation(turn)
        start, ahead = (own + np.array([0, 0, 5.0])) @ matrix.T + at, matrix @ [0, 0, -1.0]
        seen = trace(Scene(bodies=[placed], ambient=WHITE), start, np.broadcast_to(ahead, start.shape))
        border = (np.abs(points / 2 - np.round(points / 2)) < 1e-4).any(axis=1)
        np.testing.assert_array_equal(seen.radiance[~border, 0], expected[~border])


# Noise


def noise(points, seed=0):
    return np.array([gradient_noise(*map(float, p), seed) for p in points])


def test_gradients_of_noise_are_perlins():
    """They point to the twelve edges of a cube, four of them twice, by the upper four bits of the hash."""
    found = {}
    for cell in range(400):
        place = (cell * 0x1E3779B97F4A7C15) % 2**64 >> 60
        with np.errstate(over="ignore"):  # the hash wraps
            found[place] = tuple(_slope(cell, *axis) for axis in np.eye(3).tolist())
    edges = [edge for edge in itertools.product((-1, 0, 1), repeat=3) if np.abs(edge).sum() == 2]
    counts = Counter(found.values())
    assert len(found) == 16 and set(counts) == set(edges)
    assert sorted(counts.values()) == [1] * 8 + [2] * 4


def test_noise_is_nothing_on_the_lattice():
    corners = np.stack(np.meshgrid([-3, -1, 0, 2, 7], [-2, 0, 1], [-5, 0, 4]), axis=-1).reshape(-1, 3)
    np.testing.assert_array_equal(noise(corners), 0)
    assert (red(CLOUD, (0, 0, 0), (3, -4, 5)) == 0.5).all(), "the middle of both colours"


def test_noise_is_decided_by_place_and_seed_and_well_spread():
    points = np.random.default_rng(0).uniform(-40, 40, (4000, 3))
    one, again, other = noise(points, 3), noise(points, 3), noise(points, 4)
    np.testing.assert_array_equal(one, again)
    assert (one != other).mean() > 0.99
    assert np.abs(one).max() <= 1.1 and one.std() > 0.2
    # no trend and no likeness of seeds: five standard errors of 4000
    assert abs(one.mean()) < 5 * one.std() / math.sqrt(4000)
    assert abs(np.corrcoef(one, other)[0, 1]) < 5 / math.sqrt(4000)
    # the cell before the origin is no mirror image or copy of the one after it
    assert np.abs(noise(points - [1, 0, 0], 3) - one).mean() > 0.1


@given(st.integers(-20, 20), st.integers(0, 2), st.floats(-9, 9), st.floats(-9, 9), st.integers(0, 1000))
@settings(max_examples=100)
def test_noise_runs_on_over_the_borders_of_cells(border, axis, a, b, seed):
    """Value and slope: a step of 1e-6 across changes the value by at most the slope, below 4, on both sides."""
    step = 1e-6
    points = np.insert(np.array([[a, b]] * 4), axis, border + step * np.array([-2, -1, 1, 2.0]), axis=1)
    before, just_before, just_after, after = noise(points, seed)
    assert abs(just_after - just_before) < 4 * 2 * step
    # slopes left and right of it agree to what curvature does in 3 steps, and to rounding over a step
    assert (after - just_after) / step == pytest.approx((just_before - before) / step, abs=1e-3)


def seen_on_a_wall(texture, points):
    """Colours of a wall at z = 10 behind (n, 3) points, in all-round light."""
    mesh = wall(10, 40)
    scene = Scene(bodies=[body(mesh, coordinates=mesh.vertices, texture=texture, colour=WHITE)], ambient=WHITE)
    start = points * [1, 1, 0]
    return trace(scene, start, np.broadcast_to([0.0, 0, 1], start.shape)).radiance


@given(finite, finite, finite, st.integers(0, 1023))
@settings(max_examples=50)
def test_noise_kernels_equal_their_python_source(x, y, z, seed):
    with np.errstate(over="ignore"):  # hashes wrap
        plain = gradient_noise.py_func(x, y, z, seed)
    # the same sums; a compiler may only fuse them: an ulp of about 1
    assert gradient_noise(x, y, z, seed) == pytest.approx(plain, abs=1e-13)


def test_octaves_add_half_as_much_at_half_the_size():
    points = np.random.default_rng(1).uniform(-5, 5, (20, 3))
    expected = sum(0.5**k * noise(points * 2.03**k, 7 + k) for k in range(4))
    np.testing.assert_allclose(octaves(points, 4, 7), expected, atol=1e-12)


def test_noise_mixes_its_colours():
    a, b = np.array([0.2, 0.4, 0.9]), np.array([0.8, 0.5, 0.1])
    points = np.random.default_rng(2).uniform(-9, 9, (200, 3))
    texture = Noise((tuple(a), tuple(b)), (2.0, 3.0, 0.5), octaves=2, contrast=0.7, seed=5)
    value = octaves(points / [2.0, 3.0, 0.5], 2, 5)
    share = np.clip(0.5 + 0.7 * value, 0, 1)[:, None]
    np.testing.assert_allclose(texture_at(texture, points), a + share * (b - a), atol=1e-12)
    seen = seen_on_a_wall(texture, points)
    np.testing.assert_allclose(seen, texture_at(texture, np.insert(points[:, :2], 2, 10, axis=1)), atol=2e-6)
    strong = texture_at(Noise((tuple(a), tuple(b)), (1.0,) * 3, contrast=50.0), points)
    assert (strong >= np.minimum(a, b) - 1e-12).all() and (strong <= np.maximum(a, b) + 1e-12).all()


# Images

PIXELS = np.random.default_rng(0).random((3, 5, 3)).astype(np.float32)


def single_rounding(height=3, width=5):
    """Largest error of a bilinear colour in lanes: places, weights and sums are float32.

    Half a rounding of the place in [0, 1], a texel's share of it; of the place in texels; three of a weight, five of
    the sum. Neighbouring texels differ by 1 at most.
    """
    places = sum(size * 2.0**-25 + np.spacing(np.float32(size)) / 2 for size in (height, width))
    return float(places) + (3 + 5) * 2.0**-24


def ways(image, points):
    """Both ways to read an image: colours in float32 lanes, and values of alpha in float64; with their errors."""
    exact = [
        alpha_at(Image(image.pixels, wrap=image.wrap, alpha=np.ascontiguousarray(image.pixels[..., c])), points)
        for c in range(3)
    ]
    return (texture_at(image, points), single_rounding(*image.pixels.shape[:2])), (np.stack(exact, axis=1), 0.0)


def test_texel_centres_are_exact_and_row_0_is_on_top():
    for j in range(3):
        for i in range(5):
            for seen, error in ways(Image(PIXELS), [((i + 0.5) / 5, 1 - (j + 0.5) / 3, 0)]):
                # (u, v) have an ulp of 1, five texels wide
                np.testing.assert_allclose(seen[0], PIXELS[j, i], rtol=0, atol=1e-14 + error)


def test_between_texels_images_are_bilinear():
    for fx, fy in ((0.25, 0.5), (0.9, 0.1)):
        (a, b), (c, d) = PIXELS[:2, 1:3].astype(float)
        top, bottom = (1 - fx) * a + fx * b, (1 - fx) * c + fx * d
        for seen, error in ways(Image(PIXELS), [((1.5 + fx) / 5, 1 - (0.5 + fy) / 3, 0)]):
            np.testing.assert_allclose(seen[0], (1 - fy) * top + fy * bottom, rtol=0, atol=1e-14 + error)


@given(st.floats(0, 1, exclude_max=True), st.floats(0, 1, exclude_max=True), st.integers(-3, 3), st.integers(-3, 3))
@settings(max_examples=50)
def test_images_repeat(u, v, i, j):
    for (a, b), error in ways(Image(PIXELS), [(u, v, 0), (u + i, v + j, 0)]):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-13 + 2 * error)  # an ulp of 4, five texels wide


def test_images_join_at_their_borders():
    points = [(0, 0.5, 0), (1, 0.5, 0), (0.5, 1, 0), (0.5, 0, 0), (1 - 1e-9, 0.5, 0)]
    for (left, right, top, bottom, before), error in ways(Image(PIXELS), points):
        middle = (PIXELS[1, 0].astype(float) + PIXELS[1, 4]) / 2
        np.testing.assert_allclose(left, middle, rtol=0, atol=1e-14 + error)
        np.testing.assert_array_equal(left, right)
        np.testing.assert_array_equal(top, bottom)
        # a step before the border changes little: the seam is smooth
        np.testing.assert_allclose(before, right, rtol=0, atol=1e-8 + 2 * error)


@given(st.floats(-3, 3), st.floats(-3, 3))
@settings(max_examples=50)
def test_images_are_mirrored_or_clamped(u, v):
    """Mirrored, it is the picture beside its mirror image; clamped, its own border goes on."""
    twice = Image(np.concatenate([PIXELS, PIXELS[:, ::-1]], axis=1)), Image(np.concatenate([PIXELS[::-1], PIXELS]))
    inner = np.clip(u, 0.1, 0.9), np.clip(v, 1 / 6, 5 / 6), 0  # the middles of the outermost texels
    clamped = Image(PIXELS, wrap=("clamp", "clamp"))
    for one, other, at, ulp in (
        (Image(PIXELS, wrap=("mirror", "repeat")), twice[0], (u / 2, v, 0), 1e-13),  # of 4, five texels wide
        (Image(PIXELS, wrap=("repeat", "mirror")), twice[1], (u, v / 2, 0), 1e-13),
        (clamped, clamped, inner, 1e-14),
    ):
        for (a, error), (b, also) in zip(ways(one, [(u, v, 0)]), ways(other, [at]), strict=True):
            np.testing.assert_allclose(a, b, rtol=0, atol=ulp + error + also)


def test_an_unknown_wrapping_is_refused():
    with pytest.raises(ValueError, match="unknown wrapping 'fold' of an image: known are repeat, mirror, clamp"):
        Image(PIXELS, wrap=("repeat", "fold"))


def test_one_texel_is_one_colour():
    texture = Image(np.full((1, 1, 3), 0.3, np.float32))
    np.testing.assert_allclose(
        texture_at(texture, [(0, 0, 0), (0.7, 0.2, 0), (-3.2, 9, 0)]), np.float32(0.3), atol=1e-16
    )


@pytest.mark.parametrize("bits", [8, 16])
def test_every_code_survives_texture_light_and_encoding(bits):
    """A picture on a wall in even light comes back code by code."""
    count = 2**bits
    dtype = f"uint{bits}"
    codes = np.arange(count).astype(dtype)
    texture = image_texture(np.broadcast_to(codes[None, :, None], (1, count, 3)))
    out = np.empty((count, 3), dtype)
    curve = CURVES[dtype]
    encode_srgb(texture.pixels[0], np.arange(len(texture.pixels[0])), 1.0, curve, out)
    np.testing.assert_array_equal(out, codes[:, None].repeat(3, axis=1))


def test_every_code_survives_a_rendered_wall():
    codes = np.arange(256, dtype=np.uint8).reshape(16, 16)
    texture = image_texture(np.stack([codes, codes[::-1], codes[:, ::-1]], axis=-1))
    mesh = wall(5, 8)
    coordinates = np.column_stack([mesh.uv, np.zeros(4)])
    scene = Scene(bodies=[body(mesh, coordinates=coordinates, texture=texture, colour=WHITE)], ambient=WHITE)
    x, y = np.meshgrid(np.arange(16) - 7.5, 7.5 - np.arange(16))
    start = np.stack([x, y, np.zeros_like(x)], axis=-1)
    radiance = trace(scene, start, np.broadcast_to([0.0, 0, 1], start.shape)).radiance
    out = np.empty(radiance.shape, np.uint8)
    encode_srgb(radiance, np.arange(len(radiance)), 1.0, CURVES["uint8"], out)
    # upright and unmirrored: row 0 on top, column 0 on the left
    np.testing.assert_array_equal(out.reshape(16, 16, 3)[..., 0], codes)
    np.testing.assert_array_equal(out.reshape(16, 16, 3)[..., 1], codes[::-1])
    np.testing.assert_array_equal(out.reshape(16, 16, 3)[..., 2], codes[:, ::-1])


@pytest.mark.parametrize("dtype", ["uint8", "uint16"])
def test_encoding_is_the_standards_curve(dtype):
    """IEC 61966-2-1 in float64; 0.02 of a code is where straight pieces of the curve may round otherwise."""
    peak = np.iinfo(dtype).max
    x = np.linspace(-0.1, 1.1, 100_001).astype(np.float32).reshape(-1, 1).repeat(3, axis=1)
    out = np.empty(x.shape, dtype)
    encode_srgb(x, np.arange(len(x)), 1.0, CURVES[dtype], out)
    light = np.clip(x[:, 0].astype(float), 0, 1)
    exact = peak * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    assert np.abs(out[:, 0] - exact).max() <= 0.52
    assert (np.diff(out[:, 0].astype(int)) >= 0).all()
    assert out[0, 0] == 0 and out[-1, 0] == peak


def test_steps_of_codes_are_those_of_the_curve():
    """Light on both sides of every code's end, beyond both ends of the curve, and none."""
    curve = CURVES["uint8"]
    ends = (STEPS[1][:-1] / (len(curve) - 1)).astype(np.float32)
    sides = [np.nextafter(ends, np.float32(side)) for side in (0, 1)]
    rest = [np.random.default_rng(0).uniform(-0.1, 1.1, 30_000), [np.nan, np.inf, -np.inf, 0, 1]]
    x = np.concatenate([ends, *sides, *rest]).astype(np.float32).reshape(-1, 1).repeat(3, axis=1)
    rows = np.random.default_rng(1).permutation(len(x)).astype(np.int32)
    for scale in (1.0, 1 / 3):
        by_curve, by_steps = np.empty((2, *x.shape), np.uint8)
        encode_srgb(x, rows, scale, curve, by_curve)
        encode_steps(x, rows, scale, *STEPS, by_steps)
        np.testing.assert_array_equal(by_steps, by_curve)
        encode_steps.py_func(x[:900].astype(float), rows, scale, *STEPS, by_steps)
        np.testing.assert_array_equal(by_steps, by_curve)


def test_linear_inverts_the_standards_curve():
    codes = np.linspace(0, 1, 1001)
    light = linear(codes)
    back = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(back, codes, atol=1e-7)  # the standard's two pieces meet to that
    assert linear(0.0) == 0 and linear(1.0) == 1


def test_stored_pixels_become_textures():
    np.testing.assert_array_equal(image_texture(np.full((2, 3, 1), 255, np.uint8)).pixels, np.ones((2, 3, 3)))
    grey_alpha = np.zeros((1, 1, 2), np.uint16)
    grey_alpha[..., 0], grey_alpha[..., 1] = 65535, 7
    np.testing.assert_array_equal(image_texture(grey_alpha).pixels, np.ones((1, 1, 3)))
    rgba = np.array([[[0, 255, 0, 3]]], np.uint8)
    np.testing.assert_array_equal(image_texture(rgba).pixels, [[[0, 1, 0]]])
    light = np.array([[[0.5, 2.0, 0.0]]], np.float32)
    np.testing.assert_array_equal(image_texture(light).pixels, light)  # floats are linear, and may exceed 1
    light[0, 0, 1] = np.nan
    with pytest.raises(ValueError, match="image holds pixels that are not finite"):
        image_texture(light)


# Tables


def test_a_scene_pays_for_textures_only_if_it_has_some():
    plain, ball = Scene(bodies=[body(wall(5))]), sphere(1, 8)
    assert packed(plain).coordinates.shape == (0, 3, 3) and packed(plain).surfaces.columns == FLAT_COLUMNS
    assert packed(plain).textures.table.shape[0] == 0 and [len(t) for t in packed(plain).textures.texels] == [0, 0]
    painted = Scene(bodies=[body(wall(5)), body(ball, coordinates=ball.vertices, texture=BOARD)])
    assert packed(painted).coordinates.shape == (2 + len(ball.faces), 3, 3)
    assert (packed(painted).coordinates[:2] == 0).all()


def test_each_texture_has_its_rows_and_its_own_texels():
    """Images of 5×3 and 5×2 texels have coarser levels of 2×1 and 1×1 in the rows after their own.

    One texel more stands behind all, since four values are read at once.
    """
    first, second = Image(PIXELS), Image(1 - PIXELS[:2])
    packed = TextureTable([first, None, BOARD, second, first, CLOUD, BOARD])
    assert packed.table.shape[0] == 8 and [len(texels) for texels in packed.texels] == [3 * (15 + 10 + 2 * 3 + 1), 0]
    assert [packed.index(t) for t in (first, BOARD, second, CLOUD, None)] == [0, 3, 4, 7, -1]
    # in one scene each body shows its own
    bodies = [
        body(wall(5, 1), at=(4 * i, 0, 0), coordinates=np.full((4, 3), 0.5), texture=t, colour=WHITE)
        for i, t in enumerate((first, BOARD, second, CLOUD))
    ]
    start = np.array([[4.0 * i, 0, 0] for i in range(4)])
    seen = trace(Scene(bodies=bodies, ambient=WHITE), start, np.broadcast_to([0.0, 0, 1], start.shape))
    expected = [texture_at(t, [(0.5, 0.5, 0.5)])[0] for t in (first, BOARD, second, CLOUD)]
    np.testing.assert_allclose(seen.radiance, expected, atol=1e-6)


# Stripes, alpha and normal maps


def test_stripes_alternate_along_their_axis_only():
    pair = Stripes((WHITE, BLACK), 2.0, axis=(0, 5, 0))
    np.testing.assert_array_equal(
        red(pair, (9, 1, 4), (-9, 3, 1), (0, 5, 0), (0, -1, 0), (3, -3, 0)), [1, 0, 1, 0, 1]
    )
    slanting = Stripes((WHITE, BLACK), 1.0, axis=(1, 1, 0))
    along = np.array([0.5, 1.5, 2.5])
    np.testing.assert_array_equal(red(slanting, *(a * np.array([1, 1, 0]) / math.sqrt(2) for a in along)), [1, 0, 1])
    np.testing.assert_array_equal(red(slanting, *((4.0 + 0.4, -4.0, z) for z in (0, 9))), [1, 1])


def test_a_border_of_stripes_belongs_to_the_one_after_it():
    pair = Stripes((WHITE, BLACK), 2.0)
    np.testing.assert_array_equal(
        red(pair, (2 - 1e-6, 0, 0), (2, 0, 0), (4 - 1e-6, 0, 0), (2 - 1e-4, 0, 0)), [0, 0, 1, 1]
    )


@given(finite)
@settings(max_examples=50)
def test_soft_stripes_are_a_clipped_triangle_wave(x):
    width, soft = 2.0, 0.25
    s = x / width % 2
    expected = np.interp(s, [0, soft / 2, 1 - soft / 2, 1 + soft / 2, 2 - soft / 2, 2], [0.5, 1, 1, 0, 0, 0.5])
    assert red(Stripes((WHITE, BLACK), width, soft=soft), (x, 0, 0))[0] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    "options", [{"width": 0}, {"width": math.nan}, {"axis": (0, 0, 0)}, {"axis": (0, math.nan, 1)}, {"soft": 1.5}]
)
def test_bad_stripes_are_refused(options):
    with pytest.raises(ValueError, match="stripes"):
        Stripes(**{"colours": (WHITE, BLACK), "width": 1.0, **options})


def test_alpha_is_kept_beside_the_colours():
    for channels in (2, 4):
        pixels = np.full((2, 3, channels), 255, np.uint8)
        pixels[..., -1] = [[0, 51, 102], [153, 204, 255]]
        image = image_texture(pixels)
        np.testing.assert_array_equal(image.pixels, np.ones((2, 3, 3)))
        np.testing.assert_allclose(image.alpha, [[0, 0.2, 0.4], [0.6, 0.8, 1]], atol=1e-7)
    assert image_texture(np.ones((1, 1, 3), np.float32)).alpha is None


def test_colours_under_alpha_are_read_as_stored(tmp_path):
    import OpenImageIO as oiio

    stored = np.array([[[200, 100, 50, 0], [200, 100, 50, 128], [200, 100, 50, 255]]], np.uint8)
    out = oiio.ImageOutput.create(str(tmp_path / "a.png"))
    spec = oiio.ImageSpec(3, 1, 4, "uint8")
    spec.attribute("oiio:UnassociatedAlpha", 1)
    out.open(str(tmp_path / "a.png"), spec)
    out.write_image(stored)
    out.close()
    np.testing.assert_array_equal(read_image(tmp_path / "a.png"), stored)


def test_a_normal_map_is_data_not_srgb():
    pixels = np.array([[[0, 51, 255], [102, 153, 204]]], np.uint8)
    np.testing.assert_allclose(normal_map(pixels).pixels, pixels / 255, atol=1e-7)
    with pytest.raises(ValueError, match="a normal map has 1 channels: three"):
        normal_map(pixels[..., :1])
