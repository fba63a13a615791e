"""Lens of each pixel, against distances to all lenses."""

import math

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from ii_core import IICamera
from ii_core.camera.lattice import Lattice, axes_of, nearest_hexagonal
from ii_core.camera.presets import camera_names, preset_cameras, scaled

# Eighths of a pixel make ties that are exact in binary; tenths make ties with rounding; other values, none.
LENGTHS = st.one_of(
    st.integers(2, 48).map(lambda i: i / 8), st.integers(2, 60).map(lambda i: i / 10), st.floats(0.3, 7.0)
)
COUNTS = st.integers(1, 6)


def by_distance(lattice, m, n):
    """Return lenses by brute force, and whether the second best is clearly a tie or clearly none.

    Distances equal to 1e-9 px² are a tie (rounding of squares up to 1e3 is 1e-13): the upper row wins, and in a row
    the lens to the right. Differences between this and 1e-4 px² are not tested.
    """
    l, k = (i.ravel() for i in np.mgrid[: lattice.lenses[1], : lattice.lenses[0]])
    x, y = lattice.centres(k, l)
    distance = (m[:, None] + 0.5 - x) ** 2 + (n[:, None] + 0.5 - y) ** 2
    excess = distance - distance.min(axis=1, keepdims=True)
    tied = excess < 1e-9
    best = np.where(tied, l * 1000 - k, math.inf).argmin(axis=1)
    return k[best], l[best], ~((excess > 1e-9) & (excess < 1e-4)).any(axis=1)


def check(lattice, width=12, height=12, outside=0):
    n, m = (i.ravel() for i in np.mgrid[-outside : height + outside, -outside : width + outside])
    k, l = lattice.nearest(m, n)
    right_k, right_l, clear = by_distance(lattice, m, n)
    np.testing.assert_array_equal(k[clear], right_k[clear])
    np.testing.assert_array_equal(l[clear], right_l[clear])


@settings(max_examples=150, deadline=None)
@given(lenses=st.tuples(COUNTS, COUNTS), pitch=st.tuples(LENGTHS, LENGTHS), shift=st.tuples(LENGTHS, LENGTHS))
@example(lenses=(20, 1), pitch=(0.3, 1.0), shift=(-1.0, 0.0))  # 1.5/0.3 and 4.5/0.3: ties that float64 just misses
def test_rectangular_nearest_is_nearest(lenses, pitch, shift):
    check(Lattice(lenses, pitch, (shift[0] - 2, shift[1] - 2), False), outside=2)


@settings(max_examples=150, deadline=None)
@given(lenses=st.tuples(COUNTS, COUNTS), across=LENGTHS, ratio=st.floats(0.2, 5.0), shift=st.tuples(LENGTHS, LENGTHS))
@example(lenses=(3, 3), across=4.0, ratio=0.5, shift=(2.0, 2.5))  # whole pixels: many ties of two, three and four
@example(lenses=(2, 5), across=4.0, ratio=5.0, shift=(2.5, 2.5))
def test_hexagonal_nearest_is_nearest(lenses, across, ratio, shift):
    check(Lattice(lenses, (across, across * ratio), (shift[0] - 2, shift[1] - 2), True), outside=2)


@settings(max_examples=60, deadline=None)
@given(
    lattice=st.sampled_from(["rectangular", "hexagonal"]), pitch=st.tuples(LENGTHS, LENGTHS),
    offset=st.tuples(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4)), lenses=st.tuples(COUNTS, COUNTS),
)  # fmt: skip
def test_a_shifted_array_moves_its_lenses(lattice, pitch, offset, lenses):
    camera = IICamera(
        pixels=(11, 9), lenses=lenses, pixel_pitch_mm=0.1, gap_mm=1, lattice=lattice,
        lens_pitch_mm=(pitch[0] * 0.1, pitch[1] * 0.1), lens_offset_mm=offset,
    )  # fmt: skip
    check(camera.lens_lattice, 11, 9)
    # Lens (0, 0) in millimetres: the array's corner, half a pitch, and the shift, whose y points up.
    x, y = camera.lens_lattice.centres(np.int64(0), np.int64(0))
    expected = (
        5.5 - lenses[0] * pitch[0] / 2 + pitch[0] / 2 + offset[0] / 0.1,
        4.5 - lenses[1] * pitch[1] / 2 + pitch[1] / 2 - offset[1] / 0.1,
    )
    assert (x, y) == pytest.approx(expected, abs=1e-7)  # pitch and shift are kept to a billionth of a pixel


def test_ties_go_right_or_up():
    # Lenses 2 px apart from a corner on a pixel's centre: every other pixel lies on a border.
    lattice = Lattice((3, 3), (2.0, 2.0), (0.5, 0.5), False)
    assert [int(k) for k in lattice.nearest(np.arange(6), 0)[0]] == [0, 0, 1, 1, 2, 2]
    assert [int(l) for l in lattice.nearest(0, np.arange(6))[1]] == [0, 0, 0, 1, 1, 2]
    # In a hexagonal array: right in a row; and between rows, where three lenses are equally far, the upper row.
    lattice = Lattice((3, 3), (2.0, 2.0), (0.5, 0.5), True)
    k, l = lattice.nearest(np.arange(6), np.zeros(6, int))
    assert (k.tolist(), l.tolist()) == ([0, 0, 1, 1, 2, 2], [0] * 6)
    # A 3-4-5 triangle: lenses (0, 0), (1, 0) and, in the odd row below, (0, 1) all stand 2.5 px from pixel (4, 3).
    lattice = Lattice((2, 2), (4.0, 4.0), (0.5, 0.0), True)
    x, y = lattice.centres(np.array([0, 1, 0]), np.array([0, 0, 1]))
    np.testing.assert_array_equal(np.hypot(x - 4.5, y - 3.5), 2.5)
    k, l = lattice.nearest(np.array([4]), np.array([3]))
    assert (k[0], l[0]) == (1, 0)


@pytest.mark.parametrize("hexagonal", [False, True])
@pytest.mark.parametrize("lost", [1e-12, -1e-12])
def test_a_tie_survives_the_way_its_border_was_computed(hexagonal, lost):
    exact = Lattice((4, 3), (3.0, 2.5), (0.5, 0.5), hexagonal)
    blurred = exact._replace(pitch=(3.0 + lost, 2.5 - lost), origin=(0.5 - lost, 0.5 + lost))
    n, m = np.mgrid[:9, :13]
    for one, other in zip(exact.nearest(m, n), blurred.nearest(m, n), strict=True):
        np.testing.assert_array_equal(*np.broadcast_arrays(one, other))


@pytest.mark.parametrize("ratio", [0.3, 0.8660254, 1.0, 3.7])
def test_kernel_is_its_python(ratio):
    n, m = (i.ravel() for i in np.mgrid[-3:15, -3:15])
    arguments = (m, n, (5, 4), (2.5, 2.5 * ratio), (0.3, -0.7))
    results = []
    for function in (nearest_hexagonal, nearest_hexagonal.py_func):
        k, l = np.full(m.size, -9), np.full(m.size, -9)
        function(*arguments, k, l)
        results.append((k, l))
    np.testing.assert_array_equal(results[0], results[1])


@pytest.mark.parametrize("lattice", ["rectangular", "hexagonal"])
def test_one_lens_takes_every_pixel(lattice):
    for pitch in (None, 0.01, 1000.0):  # as wide as the sensor, far smaller, far wider
        camera = IICamera(
            pixels=(5, 3), lenses=(1, 1), pixel_pitch_mm=0.1, gap_mm=1, lattice=lattice, lens_pitch_mm=pitch
        )
        L, D = camera.rays()
        assert (L == L[0, 0]).all() and np.isfinite(D).all()
        np.testing.assert_allclose(L[0, 0], (0, 0, 1), atol=1e-12)  # rounding of half the lens's width, 500 mm


def test_one_pixel_one_lens():
    L, D = IICamera(pixels=(1, 1), lenses=(1, 1), pixel_pitch_mm=0.1, gap_mm=1).rays()
    np.testing.assert_array_equal(L, [[[0, 0, 1]]])
    np.testing.assert_array_equal(D, [[[0, 0, 1]]])


def test_more_lenses_than_pixels():
    camera = IICamera(pixels=(3, 3), lenses=(9, 9), pixel_pitch_mm=0.1, gap_mm=1)
    k, l = camera.lens_lattice.nearest(np.arange(3)[None, :], np.arange(3)[:, None])
    assert k.ravel().tolist() == [1, 4, 7] and l.ravel().tolist() == [1, 4, 7]


IRREGULAR = {"hexagonal", "hdtv", "plenoptic", "grin-hexagonal-depth-control", "moving-lenslets"}


@pytest.mark.parametrize("name", sorted(camera_names()))
def test_which_presets_are_regular(name):
    for camera in preset_cameras(name):
        assert camera.regular == (name not in IRREGULAR)
        whole = all(isinstance(x, int) for x in camera.ei_pixels)
        assert whole == camera.regular


def test_whole_structures_share_pixels_out_exactly():
    for name in sorted(set(camera_names()) - IRREGULAR):
        camera = preset_cameras(name)[0]
        (u, v), (width, height) = camera.ei_pixels, camera.pixels
        k, l = camera.lens_lattice.nearest(np.arange(width), np.arange(height))
        np.testing.assert_array_equal(k, np.arange(width) // u)
        np.testing.assert_array_equal(l, np.arange(height) // v)


@settings(max_examples=100, deadline=None)
@given(
    structure=st.tuples(*[st.integers(1, 40)] * 4), pitch=st.floats(1e-4, 1.0), given_in_mm=st.booleans()
)  # fmt: skip
def test_any_whole_structure_is_regular(structure, pitch, given_in_mm):
    k, l, u, v = structure
    assume(k * u <= 400 and l * v <= 400)
    camera = IICamera(
        pixels=(k * u, l * v), lenses=(k, l), pixel_pitch_mm=pitch, gap_mm=1,
        lens_pitch_mm=(u * pitch, v * pitch) if given_in_mm else None,
    )  # fmt: skip
    assert camera.regular and camera.ei_pixels == (u, v)
    columns, rows = camera.lens_lattice.nearest(np.arange(k * u), np.arange(l * v))
    np.testing.assert_array_equal(columns, np.arange(k * u) // u)
    np.testing.assert_array_equal(rows, np.arange(l * v) // v)


# -- turn and shear


TURNS, SHEARS = st.floats(-59.0, 59.0), st.floats(-0.2, 0.2)


@given(turn=TURNS, shear=SHEARS)
def test_axes_are_a_shear_and_a_turn_and_keep_areas(turn, shear):
    """Rows rise to the right by the turn (y is down); the shear is applied first. Their determinants are 1."""
    cosine, sine = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    expected = np.array([[cosine, sine], [-sine, cosine]]) @ np.array([[1, shear], [0, 1]])
    axes = np.reshape(axes_of(turn, shear) or (1, 0, 0, 1), (2, 2))
    np.testing.assert_allclose(axes, expected, atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1, abs=1e-12)


@given(turn=TURNS, shear=SHEARS, pitch=st.tuples(LENGTHS, LENGTHS), origin=st.tuples(LENGTHS, LENGTHS))
def test_a_turned_and_sheared_grid_is_made_straight_again(turn, shear, pitch, origin):
    straight = Lattice((5, 4), pitch, origin, False)
    turned = straight._replace(axes=axes_of(turn, shear))
    k, l = (i.ravel() for i in np.meshgrid(np.arange(5), np.arange(4)))
    np.testing.assert_allclose(turned.straight(*turned.centres(k, l)), straight.centres(k, l), atol=1e-9)
    np.testing.assert_array_equal(np.stack(turned.nearest(*np.subtract(turned.centres(k, l), 0.5))), [k, l])


# -- drift

DRIFTS = st.tuples(*[st.tuples(*[st.floats(-1, 1)] * 7)] * 2)


def drifting(factors, *, lattice="rectangular", turn=2.0):
    """Return a camera of 200×120 px with a drift of some tenths of a pixel per factor."""
    return IICamera(
        pixels=(200, 120), lenses=(14, 8), pixel_pitch_mm=0.01, gap_mm=0.5, lens_pitch_mm=0.14, lattice=lattice,
        lens_turn_deg=turn, lens_shear=0.01, lens_drift_mm=[[0.006 * a for a in row] for row in factors],
    )  # fmt: skip


@settings(max_examples=40, deadline=None)
@given(factors=DRIFTS, lattice=st.sampled_from(("rectangular", "hexagonal")))
def test_pixels_at_drifted_centres_are_those_lenses(factors, lattice):
    grid = drifting(factors, lattice=lattice).lens_lattice
    k, l = (i.ravel() for i in np.meshgrid(np.arange(14), np.arange(8)))
    x, y = grid.centres(k, l)
    np.testing.assert_array_equal(np.stack(grid.nearest(x - 0.5, y - 0.5)), [k, l])
    straight = grid._replace(drift=None)
    # A fifth of the error is left by each of twelve steps: 1e-8 of a drift of less than 10 px.
    np.testing.assert_allclose(grid.drift.undone(x, y), straight.centres(k, l), atol=1e-6)


def test_signs_of_a_drift():
    """By hand: 0.02 mm to the right times ξ², 0.01 mm up times η³; at the right edge ξ is 1, at the top η is 0.6."""
    camera = drifting([[10 / 3, 0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0, 10 / 6]], turn=0.0)
    plain = IICamera(
        pixels=(200, 120), lenses=(14, 8), pixel_pitch_mm=0.01, gap_mm=0.5, lens_pitch_mm=0.14, lens_shear=0.01
    )
    k, l = np.array([13, 0]), np.array([0, 7])  # top right, bottom left
    x, y = plain.lens_lattice.centres(k, l)
    right, down = camera.lens_lattice.centres(k, l) - np.stack([x, y])
    np.testing.assert_allclose(right, 2 * ((x - 100) / 100) ** 2, rtol=1e-12)
    np.testing.assert_allclose(down, -(((60 - y) / 100) ** 3), rtol=1e-12)
    assert right.min() > 0 and down[0] < 0 < down[1]
    # Rays start at the drifted lens: 2 px to the right is 0.02 mm, up is positive.
    L, _ = camera.rays_at(np.floor(x[:1]), np.floor(y[:1]))
    at = camera.lens_lattice.centres(k[:1], l[:1])
    np.testing.assert_allclose(L[0, :2], [(at[0][0] - 100) * 0.01, (60 - at[1][0]) * 0.01], rtol=1e-12)


def test_a_drift_survives_files_and_scale():
    camera = drifting([[1, -1, 0.5, 0.2, 0, 0, 1], [0, 1, 0, -1, 0.3, 0.1, 0.7]])
    assert IICamera.from_json(camera.to_json()) == camera and not camera.regular
    coarse = scaled(camera, 2)
    a, b = camera.lens_lattice.drift, coarse.lens_lattice.drift
    np.testing.assert_allclose([b.right, b.down], [a.right, a.down], rtol=1e-9)  # as many pixels at the border


@pytest.mark.parametrize(
    ("drift", "message"),
    [
        ([[0] * 7], "two lists of 7 numbers"),
        ([[0] * 7, [0] * 6], "two lists of 7 numbers"),
        ("0000000", "lens_drift_mm"),
        ([[0] * 7, "0000000"], "lens_drift_mm"),
        ([[math.nan] * 7, [0] * 7], "lens_drift_mm is nan"),
        ([[0] * 7, [0, 0, 0, 1, 0, 0, 0]], r"may grow by 3 mm within 1 mm: at most 0\.2"),
    ],
)
def test_wrong_drifts_are_refused(drift, message):
    with pytest.raises((ValueError, TypeError), match=message):
        IICamera(pixels=(200, 120), lenses=(14, 8), pixel_pitch_mm=0.01, gap_mm=0.5, lens_drift_mm=drift)
