"""Depth from focus: planes at known depth, patterns, costs."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from ii_core import IICamera, IIPicture, orthoscopic, preset
from ii_core.depth.focus import BASE, FILTER, REFERENCE
from ii_core.depth.focus_kernels import Star, Tables, choose, focus_cost, half_cost, judge, pass_on, weigh
from ii_core.depth.layers import nearest_layer, virtual_camera_pixels
from ii_core.depth.lens_tables import NOWHERE, pixel_tables, pixels_per_lens, star, whole_pixel_steps
from metrics import depth_from_focus, linear_layers, logarithmic_layers, q_depth
from raytrace_ii import Scene, render
from raytrace_ii.scene.textures import Image
from tests.support.trace_scenes import UNIFORM, WHITE, body, wall

GAP = 1.5
PEAKS = {"uint8": 255, "uint16": 65535, "float32": 1.0}
# No line of any layer meets a border between pixels, where rounding would decide.
LAYERS = GAP * np.array([2.137, 3.219, 4.871, 7.93, 13.37, 29.1])


def picture(lenses=(12, 8), ei_pixels=(6, 6), seed=0, dtype="uint8", optics=()):
    size = lenses[0] * ei_pixels[0], lenses[1] * ei_pixels[1]
    camera = IICamera(pixels=size, lenses=lenses, pixel_pitch_mm=0.1, gap_mm=GAP, optics=optics)
    values = np.random.default_rng(seed).random((size[1], size[0], 3)) * PEAKS[dtype]
    return IIPicture(values.astype(dtype), lenses, ei_pixels, camera)


def textured_wall(z, half=100.0, seed=0, left=None):
    """A wall of random colours, blotches a fifteenth of its distance wide; with ``left``, half of it."""
    mesh = wall(z, half)
    vertices, count = mesh.vertices.copy(), int(2 * half / (z / 15))
    uv = mesh.uv.copy()
    if left is not None:
        across = np.where(vertices[:, 0] < 0, -half, 0) if left else np.where(vertices[:, 0] < 0, 0, half)
        vertices[:, 0] = across
        uv[:, 0] = (across + half) / (2 * half)
    texels = np.random.default_rng(seed).random((count, count, 3)).astype(np.float32)
    coordinates = np.column_stack([uv, np.zeros(4)])
    mesh = type(mesh)(vertices, mesh.faces, None, uv)
    return body(mesh, coordinates=coordinates, colour=WHITE, texture=Image(texels), name=f"wall at {z}")


def shoot(*walls):
    scene = Scene(bodies=walls, lights=(), background=UNIFORM, ambient=(1.0, 1.0, 1.0))
    return render(scene, preset("setup1", scale=8), support=("depth",))


def seen_depth(shot):
    return shot.depth[virtual_camera_pixels(shot.picture.camera)].astype(np.float64)


def point_of(camera, k, l, z):
    """Where the line from the virtual camera through the centre of lens (k, l) meets a plane, and that centre."""
    lens = np.array([
        (k + 0.5) * camera.lens_pitch_mm[0] - camera.size_mm[0] / 2,
        camera.size_mm[1] / 2 - (l + 0.5) * camera.lens_pitch_mm[1],
        camera.gap_mm,
    ])  # fmt: skip
    v = np.array([0, 0, camera.gap_mm * (1 - camera.lenses[0])])
    return v + (lens - v) * (z - v[2]) / (lens[2] - v[2]), lens


@pytest.mark.parametrize("optics", [(), ({"kind": "grin"},), ({"kind": "lenticular"},)])
def test_the_ray_of_a_neighbours_pixel_meets_the_point(optics):
    camera = picture(optics=optics).camera
    steps = np.arange(-11, 12)
    (cols, _), (rows, _) = pixel_tables(camera, LAYERS, steps, steps, erect=camera.erect, nearest=True)
    start, towards = camera.rays()
    met = 0
    for d, z in enumerate(LAYERS):
        footprint = camera.pixel_pitch_mm * (z - GAP) / GAP
        for k, l in np.ndindex(camera.lenses):
            point, _ = point_of(camera, k, l, z)
            for i, j in ((0, 0), (1, 0), (0, 1), (-1, 2), (2, -1), (-3, -3), (7, -2)):
                m, n = cols[d, i + 11, k], rows[d, j + 11, l]
                if m < 0 or n < 0:
                    continue
                assert (m // 6, n // 6) == (k + i, l + j)  # the lens's own elementary image
                if optics and camera.lens_model.vertical_parallax is False:
                    assert j == 0  # no other row of lenses sees that row of the scene
                    point[1] = start[n, m, 1]
                at = start[n, m] + towards[n, m] * (z - GAP) / towards[n, m, 2]
                # Half a pixel's footprint, and the rounding of coordinates of tens of mm.
                assert np.abs(at - point)[:2].max() <= footprint / 2 + 1e-9
                met += (i, j) != (0, 0)
    assert met > 300  # the loop was no empty one


def test_an_array_that_stands_aside_finds_the_same_depth_from_where_it_stands():
    a = picture()
    aside = IIPicture(a.pixels, a.lenses, a.ei_pixels, replace(a.camera, origin_mm=(7.0, -3.0, 2.5)))
    layers = LAYERS + 2.5
    for method in ("dissertation", "robust"):
        f, g = (depth_from_focus(p, layers_mm=z, method=method) for p, z in ((a, LAYERS), (aside, layers)))
        np.testing.assert_array_equal(f.layer, g.layer)
        # Positions of tens of mm, taken from one another.
        np.testing.assert_allclose(g.depth_mm - 2.5, f.depth_mm, rtol=1e-9)
    np.testing.assert_allclose(linear_layers(aside.camera), linear_layers(a.camera) + 2.5)
    indices = zip(virtual_camera_pixels(a.camera), virtual_camera_pixels(aside.camera), strict=True)
    assert all((one == other).all() for one, other in indices)


def test_neighbours_left_out_are_those_that_do_not_see_the_point():
    camera = picture().camera
    steps = np.arange(-11, 12)
    (cols, _), _ = pixel_tables(camera, LAYERS, steps, steps)
    for d, z in enumerate(LAYERS):
        for k in range(12):
            point, _ = point_of(camera, k, 0, z)
            for i in steps:
                if 0 <= k + i < 12:
                    _, lens = point_of(camera, k + i, 0, z)
                    off = (lens[0] - point[0]) * GAP / (z - GAP)  # on the sensor, from below the lens, mm
                    assert (cols[d, i + 11, k] >= 0) == (abs(off) < 0.3)
                else:
                    assert cols[d, i + 11, k] == -1


def naive_cost(a, layers, base, reference, nearest):
    """Σ_rgb |B − R| by the geometry of rays, lens by lens."""
    camera, (u, v) = a.camera, a.ei_pixels
    pixels = a.pixels.astype(np.float64)
    sign = -1 if a.erect else 1

    def seen(k, l, i, j, z):
        if not (0 <= k + i < camera.lenses[0] and 0 <= l + j < camera.lenses[1]):
            return None
        point, _ = point_of(camera, k, l, z)
        _, lens = point_of(camera, k + i, l + j, z)
        off = (lens - point)[:2] * GAP / (z - GAP) / camera.pixel_pitch_mm * sign
        x, y = (u - 1) / 2 + off[0], (v - 1) / 2 - off[1]
        if not (-0.5 <= x < u - 0.5 and -0.5 <= y < v - 0.5):
            return None
        ei = pixels[(l + j) * v : (l + j + 1) * v, (k + i) * u : (k + i + 1) * u]
        if nearest:
            return ei[math.floor(y + 0.5), math.floor(x + 0.5)]
        x, y = min(max(x, 0), u - 1), min(max(y, 0), v - 1)
        m, n = min(int(x), u - 2), min(int(y), v - 2)
        top = ei[n, m] * (1 - x + m) + ei[n, m + 1] * (x - m)
        bottom = ei[n + 1, m] * (1 - x + m) + ei[n + 1, m + 1] * (x - m)
        return top * (1 - y + n) + bottom * (y - n)

    cost = np.full((len(layers), camera.lenses[1], camera.lenses[0]), np.nan)
    for d, l, k in np.ndindex(cost.shape):
        sets = []
        for pattern in (base, reference):
            found = {(i, j): seen(k, l, i, j, layers[d]) for i, j in pattern.tolist()}
            sets.append({step: value for step, value in found.items() if value is not None})
        if sets[0] and sets[1] and sets[0].keys() != sets[1].keys():
            b, r = (np.mean(list(s.values()), axis=0) for s in sets)
            cost[d, l, k] = np.abs(b - r).sum()
    return cost


def naive_choice(cost, h):
    up, left = h.shape[0] // 2, h.shape[1] // 2
    padded = np.pad(cost, ((0, 0), (up, up), (left, left)), constant_values=np.nan)
    total, weight = np.zeros(cost.shape), np.zeros(cost.shape)
    for j, i in np.ndindex(h.shape):
        part = padded[:, j : j + cost.shape[1], i : i + cost.shape[2]]
        w = h[::-1, ::-1][j, i]
        total += np.where(np.isnan(part), 0, w * part)
        weight += np.where(np.isnan(part), 0, w)
    smooth = np.where(np.isnan(cost), np.inf, total / np.maximum(weight, 1e-300))
    return smooth.argmin(axis=0)


@pytest.mark.parametrize("interpolation", ["linear", "nearest"])
@pytest.mark.parametrize(("dtype", "erect"), [("uint8", False), ("uint16", True), ("float32", False)])
def test_against_the_naive_sum_over_rays(dtype, erect, interpolation):
    a = picture((10, 7), dtype=dtype)
    a = orthoscopic(a) if erect else a
    reference, h = REFERENCE // 7 * 3, np.arange(1.0, 16).reshape(3, 5)  # an uneven filter: a convolution mirrors it
    expected = naive_choice(naive_cost(a, LAYERS, BASE, reference, interpolation == "nearest"), h)
    f = depth_from_focus(a, layers_mm=LAYERS, reference=reference, weights=h, interpolation=interpolation)
    np.testing.assert_array_equal(f.layer, expected)
    np.testing.assert_array_equal(f.depth_mm, LAYERS[expected])
    assert (f.confidence >= 0).all() and (f.confidence <= 1).all()


def test_cost_is_that_of_the_naive_sum():
    a = picture()
    lenses = np.unique(np.concatenate([BASE, REFERENCE]), axis=0)
    members = np.stack([(lenses[:, None] == p).all(axis=2).any(axis=1) for p in (BASE, REFERENCE)], axis=1)
    across = np.unique(lenses[:, 0])
    cols, rows = pixel_tables(a.camera, LAYERS, across, across)
    cost = np.zeros((8, 12, 6), np.float32)
    focus_cost(a.pixels, Tables(*cols, *rows), np.searchsorted(across, lenses), members, cost, 0, 8)
    expected = naive_cost(a, LAYERS, BASE, REFERENCE, nearest=False)
    # Kept in float32; sums of 25 values in float64 in another order.
    np.testing.assert_allclose(np.moveaxis(cost, 2, 0), expected, rtol=1e-6, atol=1e-4)


def test_kernels_against_their_python():
    a = picture((5, 4))
    lenses = np.unique(np.concatenate([BASE, REFERENCE]), axis=0)
    members = np.stack([(lenses[:, None] == p).all(axis=2).any(axis=1) for p in (BASE, REFERENCE)], axis=1)
    across = np.unique(lenses[:, 0])
    cols, rows = pixel_tables(a.camera, LAYERS[:3], across, across)
    where = np.searchsorted(across, lenses)
    results = []
    for kind in ("__call__", "py_func"):
        cost, smooth, halves, total = (np.zeros((4, 5, 3), np.float32) for _ in range(4))
        layer, fit, confidence = np.zeros((4, 5), np.int64), np.zeros((4, 5)), np.zeros((4, 5), np.float32)
        sides, own = np.column_stack([lenses < 0, lenses > 0]), int(np.flatnonzero((lenses == 0).all(axis=1))[0])
        view = a.pixels[::6, ::6].astype(float)
        getattr(focus_cost, kind)(a.pixels, Tables(*cols, *rows), where, members, cost, 0, 4)
        getattr(half_cost, kind)(a.pixels, Tables(*cols, *rows), Star(where, sides, own), 90.0, halves, 0, 4)
        getattr(weigh, kind)(halves, FILTER, view, 60.0, smooth, 0, 4)
        for down, back in product((False, True), repeat=2):
            lines = 5 if down else 4
            getattr(pass_on, kind)(smooth, view, np.log(LAYERS[:3]), 60.0, 30.0, 60.0, down, back, total, 0, lines)
        getattr(choose, kind)(total, 1e-4, layer, fit, 0, 4)
        getattr(judge, kind)(halves, layer, 1.0, 7.0, 60, confidence, 0, 4)
        results.append((cost, smooth, halves, total, layer, fit, confidence))
    for compiled, plain in zip(*results, strict=True):
        np.testing.assert_allclose(compiled, plain, rtol=1e-5)  # plain Python adds what is kept in float32


def test_any_number_of_threads_gives_the_same():
    a = picture()
    one, three = (depth_from_focus(a, layers_mm=LAYERS, workers=n) for n in (1, 3))
    np.testing.assert_array_equal(one.layer, three.layer)
    np.testing.assert_array_equal(one.confidence, three.confidence)


@pytest.mark.parametrize("method", ["dissertation", "robust"])
@pytest.mark.parametrize("d", [7, *(pytest.param(d, marks=pytest.mark.slow) for d in (12, 20)), 40])
def test_a_textured_wall_lies_in_its_layer(d, method):
    camera = preset("setup1", scale=8)
    shot = shoot(textured_wall(d * camera.gap_mm))
    f = depth_from_focus(shot.picture, method=method, layers_mm=linear_layers(camera))
    error = np.abs(f.layer + 1 - d)
    # Lenses at the picture's edge have their partners on one side only: a few of them may miss.
    assert (error <= 1).mean() > 0.97


@pytest.mark.slow
@pytest.mark.parametrize("method", ["dissertation", "robust"])
@pytest.mark.parametrize("d", [7, 40, 400])  # the dissertation's layers end at 250
def test_default_layers_find_a_wall_near_and_far(d, method):
    camera = preset("setup1", scale=8)
    shot = shoot(textured_wall(d * camera.gap_mm, half=1000.0 if d > 250 else 200.0))
    f = depth_from_focus(shot.picture, method=method)
    # One of the dissertation's layers, as above, and a tenth of a pixel over the spread of 14 lenses: from lens to
    # lens a point moves 16/d pixels.
    assert np.median(abs(f.depth_mm / (d * camera.gap_mm) - 1)) < 1 / d + d / 2240
    assert q_depth(shot.picture, shot.picture, depth=f).outside == 0


@pytest.mark.parametrize("make", ["black", "constant", "one lens", "one-pixel images", "layers before the lenses"])
@pytest.mark.parametrize("method", ["dissertation", "robust"])
def test_indistinguishable_layers_have_no_depth(make, method):
    a, layers = picture(), LAYERS
    if make == "black":
        a = a.with_pixels(np.zeros_like(a.pixels))
    elif make == "constant":
        a = a.with_pixels(np.full_like(a.pixels, 77))
    elif make == "one lens":
        a = picture((1, 1), (8, 8))
    elif make == "one-pixel images":
        # One direction a lens: all layers but those whose lines leave the pixel show the same lenses.
        a = picture((12, 8), (1, 1))
        layers = GAP * np.array([100.0, 101.0, 102.0])
    else:
        layers = np.array([0.2, 0.5, 1.0]) * GAP
    f = depth_from_focus(a, layers_mm=layers, method=method)
    assert np.isnan(f.depth_mm).all() and (f.layer == -1).all() and (f.confidence == 0).all()
    q = q_depth(a, a, layers_mm=layers, method=method)
    assert np.isnan(q.values).all() and q.counts.sum() == q.outside == 0


def test_layers_beyond_the_scene_stay_empty_when_those_of_the_scene_are_there():
    camera = preset("setup1", scale=8)
    shot = shoot(textured_wall(12 * camera.gap_mm))
    f = depth_from_focus(shot.picture, layers_mm=camera.gap_mm * np.array([0.5, 1, 12, 5000, 90000]))
    assert (f.layer == 2).mean() > 0.99  # the edges, as above


def test_an_array_higher_than_wide_has_no_depth_where_the_camera_does_not_see():
    a = picture((6, 12))
    f = depth_from_focus(a, layers_mm=LAYERS)
    outside = np.isnan(f.depth_mm).all(axis=1)
    assert outside[[0, -1]].all() and not np.isnan(f.depth_mm[4:8]).any()
    assert q_depth(a, a, layers_mm=LAYERS).counts.sum() == (~np.isnan(f.depth_mm)).sum()


def test_noise_on_what_stands_at_one_depth_is_found_there_and_nowhere_else():
    camera = preset("setup1", scale=8)
    near, far = 8, 24
    shot = shoot(textured_wall(near * camera.gap_mm, left=True), textured_wall(far * camera.gap_mm, seed=1))
    noisy = shot.picture.pixels.astype(int)
    there = np.isclose(shot.depth, far * camera.gap_mm, rtol=1e-5)
    # A step of ±8 up or down: no value leaves 8 bits, every pixel's error is the same.
    noisy[there] += np.where(noisy[there] < 128, 8, -8)
    noisy = shot.picture.with_pixels(noisy.astype(np.uint8))
    at = 20 * math.log10(255 / 8)
    layers = linear_layers(camera)
    given = q_depth(shot.picture, noisy, depth=shot.depth, layers_mm=layers)
    assert np.flatnonzero(np.isfinite(given.values)).tolist() == [far - 1]
    assert given.values[far - 1] == pytest.approx(at, abs=1e-9)  # exact sums, one logarithm
    assert given.source == "given"

    focus = q_depth(shot.picture, noisy, layers_mm=layers)
    assert focus.source == "focus (dissertation)" and focus.outside == 0
    error = np.where(focus.counts > 0, 3 * focus.counts * 255**2 / 10 ** (focus.values / 10), 0)
    assert focus.values[far - 1] < at + 0.5
    # R and h look across the edge between the walls: of 14 columns of lenses beside it some land elsewhere (15 %).
    assert error[far - 2 : far + 1].sum() > 0.8 * error.sum()
    assert focus.values[near - 1] > at + 10


def test_equal_distortion_at_two_depths_gives_equal_values():
    camera = preset("setup1", scale=8)
    shot = shoot(textured_wall(8 * camera.gap_mm, left=True), textured_wall(24 * camera.gap_mm, seed=1))
    pixels = shot.picture.pixels.astype(int)
    worse = shot.picture.with_pixels(np.where(pixels < 128, pixels + 5, pixels - 5).astype(np.uint8))
    for depth in (shot.depth, None):
        q = q_depth(shot.picture, worse, depth=depth, layers_mm=linear_layers(camera))
        assert q.counts[[7, 23]].min() > 300
        np.testing.assert_allclose(q.values[q.counts > 0], 20 * math.log10(255 / 5), rtol=1e-14)


@pytest.mark.parametrize("dtype", ["uint16", "float32"])
def test_other_types_give_the_same_depth(dtype):
    a = picture()
    scale = PEAKS[dtype] / 255
    b = a.with_pixels((a.pixels * scale).astype(dtype))
    f, g = (depth_from_focus(p, layers_mm=LAYERS) for p in (a, b))
    # float32 cannot hold n/255: with costs as near as that the choice may fall the other way.
    assert (f.layer == g.layer).mean() > 0.98
    np.testing.assert_allclose(f.confidence, g.confidence, atol=1e-5)


def test_the_robust_method_finds_the_same_in_sixteen_bits():
    """Its prices of a change of depth are in codes of the picture's type: those of noise decide many pixels."""
    eight = picture(lenses=(24, 16), seed=3)
    sixteen = replace(eight, pixels=eight.pixels.astype(np.uint16) * 257)
    layers = [depth_from_focus(p, layers_mm=LAYERS, method="robust").layer for p in (eight, sixteen)]
    assert len(np.unique(layers[0])) > 3 and (layers[0] == layers[1]).mean() > 0.99


def test_robust_cost_in_the_open():
    a = picture((9, 9), (5, 5))
    shift = pixels_per_lens(a.camera, LAYERS) * 5
    steps = whole_pixel_steps(shift, 5)
    cols, rows = pixel_tables(a.camera, LAYERS, steps, steps, snap=True)
    middle = steps.shape[1] // 2
    where = star(middle, middle)
    sides = np.column_stack([where < middle, where > middle])
    cost = np.zeros((9, 9, 6), np.float32)
    half_cost(a.pixels, Tables(*cols, *rows), Star(where, sides, len(where) - 1), 30.0, cost, 0, 9)
    expected = np.full(cost.shape, np.nan)
    n0, m0 = virtual_camera_pixels(a.camera)
    for d, l, k in np.ndindex(6, 9, 9):
        mine = a.pixels[n0[l, 0], m0[0, k]].astype(float)  # the very pixel that is measured
        far = {}
        for i, j in (where[:-1] - middle).tolist():
            right, down = (int(np.sign(x) * steps[d, middle + abs(x)]) for x in (i, j))
            x, y = m0[0, k] - 5 * k + right * shift[d], n0[l, 0] - 5 * l + down * shift[d]
            other = k + right, l + down
            if not (0 <= other[0] < 9 and 0 <= other[1] < 9 and -0.5 <= x < 4.5 and -0.5 <= y < 4.5):
                continue
            x, y = min(max(x, 0), 4), min(max(y, 0), 4)
            ei = np.pad(a.pixels[5 * other[1] : 5 * other[1] + 5, 5 * other[0] : 5 * other[0] + 5].astype(float),
                        ((0, 1), (0, 1), (0, 0)))  # fmt: skip
            m, n, x, y = int(x), int(y), x % 1, y % 1
            p = (ei[n, m] * (1 - x) + ei[n, m + 1] * x) * (1 - y) + (
                ei[n + 1, m] * (1 - x) + ei[n + 1, m + 1] * x
            ) * y
            far[i, j] = min(np.abs(p - mine).sum(), 30)
        halves = [[v for s, v in far.items() if sign * s[axis] > 0] for axis in (0, 1) for sign in (-1, 1)]
        means = [np.mean(half) for half in halves if len(half) >= 2]
        expected[l, k, d] = min(means) if means else np.nan
    assert np.isfinite(expected).sum() > 100
    np.testing.assert_allclose(cost, expected, rtol=1e-6)  # kept in float32


def test_lenses_are_those_with_the_point_on_whole_pixels():
    camera = preset("setup1", scale=2)
    layers = linear_layers(camera)
    shift = pixels_per_lens(camera, layers) * 16
    steps = whole_pixel_steps(shift, 16)
    assert steps.shape == (250, 15) and (steps[:, 7] == 0).all() and (steps == -steps[:, ::-1]).all()
    real = np.where(steps == NOWHERE, 0, steps)[:, 8:]
    off = real[4:] * shift[4:, None]
    assert (np.abs(off - np.rint(off)).max(axis=1)[60:] <= shift[64:] / 2 + 1e-12).all()  # half a lens's step
    np.testing.assert_array_equal(np.rint(off[60:]), np.tile(np.arange(1, 8), (186, 1)))
    for row in steps:  # each lens once
        once = row[(np.abs(row) < NOWHERE)]
        assert len(set(once)) == len(once)
    assert whole_pixel_steps(shift, 1).shape == (250, 1)  # one direction a lens: nothing to compare
    assert whole_pixel_steps(shift, 2).shape == (250, 3)


def naive_pass(cost, view, place, slope, leap, alike):
    """Aggregate costs along rows, left to right: each layer's own cost plus the least cost from the lens before."""
    rows, cols, layers = cost.shape
    total = cost.astype(float).copy()
    for l in range(rows):
        for k in range(1, cols):
            w = math.exp(-np.abs(view[l, k] - view[l, k - 1]).sum() / alike)
            before = total[l, k - 1]
            asked = [
                min(before[e] - before.min() + slope * w * abs(place[d] - place[e]) for e in range(layers))
                for d in range(layers)
            ]
            total[l, k] += np.minimum(asked, leap * w)
    return total


def test_aggregated_cost_is_the_minimum_over_all_changes():
    rng = np.random.default_rng(3)
    cost = rng.random((3, 6, 9)).astype(np.float32) * 30
    view = rng.random((3, 6, 3)) * 40
    place = np.log(np.arange(2.0, 11))
    options = place, 60.0, 20.0, 60.0
    expected = naive_pass(cost, view, *options)
    for down, back in product((False, True), repeat=2):
        total = np.zeros(cost.shape, np.float32)
        turned, seen = cost, view
        if back:
            turned, seen = turned[:, ::-1], seen[:, ::-1]
        if down:
            turned, seen = turned.transpose(1, 0, 2), seen.transpose(1, 0, 2)
            total = np.zeros(turned.shape, np.float32)
        pass_on(np.ascontiguousarray(turned), np.ascontiguousarray(seen), *options, down, back, total, 0, 3)
        total = total.transpose(1, 0, 2) if down else total
        total = total[:, ::-1] if back else total
        np.testing.assert_allclose(total, expected, rtol=1e-6)  # kept in float32


def test_the_robust_method_sees_past_edges_and_between_layers():
    camera = preset("setup1", scale=8)
    shot = shoot(textured_wall(8 * camera.gap_mm, left=True), textured_wall(24.3 * camera.gap_mm, seed=1))
    z = seen_depth(shot) / camera.gap_mm
    right = {}
    for method in ("dissertation", "robust"):
        f = depth_from_focus(shot.picture, method=method, layers_mm=linear_layers(camera))
        right[method] = (np.abs(f.layer + 1 - z) <= 1).mean()
    assert right["robust"] > 0.99 > 0.95 > right["dissertation"]
    behind = z > 20
    assert np.abs(f.depth_mm / camera.gap_mm - z)[behind].mean() < 0.2  # the nearest layer alone: 0.3


def test_layers():
    camera = picture().camera
    np.testing.assert_allclose(linear_layers(camera)[[0, 99, 249]], [GAP, 100 * GAP, 250 * GAP], rtol=1e-15)
    log = logarithmic_layers(2, 200, 5)
    np.testing.assert_allclose(log, [2, 2 * 10**0.5, 20, 20 * 10**0.5, 200], rtol=1e-12)
    a = picture()
    q = q_depth(a, a, depth=np.full(a.pixels.shape[:2], 21.0), layers_mm=log)
    assert np.flatnonzero(q.counts).tolist() == [2] and (q.depth_mm == log).all()
    np.testing.assert_array_equal(
        nearest_layer(np.array([0.9, 1, 1.49, 1.5, 2.9, 4, 4.99, 5, np.nan]), np.array([1.0, 2, 4]), 1.0),
        [0, 0, 0, 1, 1, 2, 2, -1, -1],
    )
    np.testing.assert_array_equal(nearest_layer(np.array([6.9, 7, 8.9, 9]), np.array([8.0]), 2.0), [-1, 0, 0, -1])


@pytest.mark.parametrize(
    ("bad", "said"),
    [
        ({"layers_mm": [3.0, 2.0]}, "increase"),
        ({"layers_mm": [[3.0]]}, r"shape \(1, 1\)"),
        ({"layers_mm": []}, "list of depths"),
        ({"layers_mm": [1.0, np.inf]}, "finite"),
        ({"layers_mm": [-1.0, 1.0]}, "positive"),
        ({"base": [[0.5, 1.0]]}, "base is float64"),
        ({"reference": [1, 2]}, r"reference is int64 of shape \(2,\)"),
        ({"weights": np.ones((4, 3))}, "two odd sides"),
        ({"weights": np.zeros((3, 3))}, "not all 0"),
        ({"method": "guess"}, "known are dissertation, robust"),
        ({"interpolation": "cubic"}, "known are linear, nearest"),
    ],
)
def test_parameters_refused(bad, said):
    with pytest.raises(ValueError, match=said):
        depth_from_focus(picture(), **bad)


def test_pictures_refused():
    a = picture()
    with pytest.raises(ValueError, match="no camera"):
        depth_from_focus(IIPicture(a.pixels, a.lenses, a.ei_pixels))
    f = picture(dtype="float32")
    f.pixels[40, 7, 1] = np.nan
    with pytest.raises(ValueError, match=r"picture pixel \(7, 40\)"):
        depth_from_focus(f)
    bent = picture(optics=("pinhole", {"kind": "lens", "z_mm": 30, "focal_mm": 25}))
    with pytest.raises(ValueError, match="lens before the lens array bends lines of sight"):
        depth_from_focus(bent)
    hexagonal = IICamera(pixels=(60, 40), lenses=(6, 4), pixel_pitch_mm=0.1, gap_mm=GAP, lattice="hexagonal")
    irregular = IIPicture(np.zeros((40, 60, 3), np.uint8), (6, 4), hexagonal.ei_pixels, hexagonal)
    with pytest.raises(ValueError, match="not regular"):
        depth_from_focus(irregular)
    with pytest.raises(ValueError, match="0 < near < far"):
        logarithmic_layers(3, 2)
