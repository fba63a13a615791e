"""Correlation and residual energy of frame orders, against numpy and by hand."""

import itertools
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codec.inspect.order_analysis import analyse_orders
from codec.order import ORDERS, selection_order
from ii_core import IIPicture, component_images
from ii_core.picture.component import KINDS

counts = st.integers(1, 6)


def direct(picture, kind, order):
    """Compute (5.3) and (5.7) literally."""
    stack = component_images(picture, kind).astype(np.float64)
    if kind == "ri":  # the stack is [v, l], the grid has v across
        stack = stack.swapaxes(0, 1)
    rows, cols = stack.shape[:2]
    frames = stack.reshape(rows * cols, -1)[selection_order(order, rows, cols)]
    c, e = [], []
    for before, now in itertools.pairwise(frames):
        a, b = now - now.mean(), before - before.mean()
        power = (a**2).sum() * (b**2).sum()
        constant = np.ptp(now) == 0 or np.ptp(before) == 0
        c.append(np.nan if constant else (a * b).sum() / np.sqrt(power))
        e.append(np.sqrt(((now - before) ** 2).sum()))
    return np.array(c), np.array(e)


@pytest.mark.slow
@given(
    structure=st.tuples(counts, counts, counts, counts),
    dtype=st.sampled_from(["uint8", "uint16", "float32"]),
    seed=st.integers(0, 99),
)
@settings(max_examples=40)
def test_against_whole_frames(structure, dtype, seed):
    k, l, u, v = structure
    rng = np.random.default_rng(seed)
    top = 1 if dtype == "float32" else np.iinfo(dtype).max
    values = rng.random((l * v, k * u, 3)) * top
    values[rng.random(values.shape[:2]) < 0.3] = top // 2  # some frames of small structures come out constant
    picture = IIPicture(values.astype(dtype), (k, l), (u, v))
    results = {(r.kind, r.order): r for r in analyse_orders(picture)}
    assert set(results) == {(kind, order) for kind in KINDS for order in ORDERS}
    for (kind, order), found in results.items():
        c, e = direct(picture, kind, order)
        np.testing.assert_array_equal(np.isnan(found.correlation), np.isnan(c))
        # float64 sums of at most 36·3 values against numpy's own; a residual is a root, of a difference of sums
        np.testing.assert_allclose(found.correlation, c, atol=1e-9)
        np.testing.assert_allclose(found.residual, e, atol=1e-5 * top)


def test_three_frames_by_hand():
    """Frames (0, 2), (2, 4), (4, 2) in grey: c = 1, −1; e² = 3·(4 + 4) both times."""
    line = np.array([0, 2, 2, 4, 4, 2], np.uint8).repeat(3).reshape(1, 6, 3)
    (row,) = analyse_orders(IIPicture(line, (3, 1), (2, 1)), kinds=["ei"], orders=["row"])
    np.testing.assert_allclose(row.correlation, [1, -1])
    np.testing.assert_allclose(row.residual**2, [24, 24])
    assert (row.mean, row.undefined, row.energy) == (pytest.approx(0), 0, pytest.approx(24))
    assert row.sigma == pytest.approx(np.sqrt(2))  # (1 + 1)/(J − 2)


def test_a_constant_frame_has_no_correlation():
    """Frames (0, 2), (7, 7), (2, 4), (0, 2): two pairs with the constant one count as undefined, one is left."""
    line = np.array([0, 2, 7, 7, 2, 4, 0, 2], np.uint8).repeat(3).reshape(1, 8, 3)
    (row,) = analyse_orders(IIPicture(line, (4, 1), (2, 1)), kinds=["ei"], orders=["row"])
    assert row.undefined == 2 and row.mean == pytest.approx(1) and np.isnan(row.sigma)
    assert row.energy == pytest.approx((3 * 74 + 3 * 34 + 3 * 8) / 3)


def test_a_constant_picture_and_a_single_frame():
    for row in analyse_orders(IIPicture(np.full((6, 8, 3), 9, np.uint8), (4, 3), (2, 2))):
        assert row.undefined == len(row.correlation) and np.isnan(row.mean) and row.energy == 0
    (one,) = analyse_orders(IIPicture(np.zeros((2, 2, 3), np.uint8), (1, 1), (2, 2)), kinds=["ei"], orders=["row"])
    assert len(one.correlation) == 0 and np.isnan(one.mean) and np.isnan(one.energy)


def test_low_contrast_on_bright_frames_is_not_cancelled():
    """Without cancellation, a contrast of one 16-bit code determines a correlation."""
    pixels = np.full((1, 4000, 3), 65000, np.uint16)
    pixels[0, 5], pixels[0, 2005] = 65001, 65001
    (row,) = analyse_orders(IIPicture(pixels, (2, 1), (2000, 1)), kinds=["ei"], orders=["row"])
    assert row.undefined == 0 and row.mean == pytest.approx(1, abs=1e-6)


def test_parallel_by_its_kind_of_neighbour_beats_row_on_a_ramp():
    """On a ramp, jumps to the start of the next row cost energy: the orders rank as in the table of §5.8.2."""
    v, u, t, s = 6, 6, 16, 24
    y, x = np.mgrid[:t, :s]
    field = np.empty((t, v, s, u, 3))
    for row in range(v):
        for col in range(u):
            field[:, row, :, col] = (128 + 100 * np.sin((x + 1.5 * col) / 3) * np.cos((y + 1.5 * row) / 4))[..., None]
    picture = IIPicture(field.reshape(t * v, s * u, 3).astype(np.uint8), (s, t), (u, v))
    mean = {r.order: r.mean for r in analyse_orders(picture, kinds=["si"])}
    assert mean["parallel"] > mean["row"]
    assert min(mean["parallel"], mean["spiral"]) > max(mean["row"], mean["column"], mean["zigzag"])


def test_unknown_names_are_refused():
    picture = IIPicture(np.zeros((2, 2, 3), np.uint8), (1, 1), (2, 2))
    with pytest.raises(ValueError, match="unknown component image 'vi'"):
        analyse_orders(picture, kinds=["vi"])
    with pytest.raises(ValueError, match="unknown order 'random'"):
        analyse_orders(picture, orders=["random"])


def test_study_orders_writes_numbers_and_a_table(run, refused, tmp_path):
    pixels = np.random.default_rng(0).integers(0, 9, (8, 8, 3), np.uint8)
    pixels[:, :2] = 5  # elementary images without contrast
    path, out = tmp_path / "small.png", tmp_path / "out"
    IIPicture(pixels, (4, 4), (2, 2)).save(path)
    code, said, _ = run("study", path, "--orders", "-o", out)
    assert code == 0 and "parallel" in said and "undefined" in said
    study = json.loads((out / "small_orders.json").read_text())
    assert len(study["rows"]) == 15 and study["rows"][0]["undefined"] > 0
    assert [p.name for p in out.iterdir()] == ["small_orders.json"]  # and nothing was coded
    refused(run("study", path, "--orders", "-o", out), "is there already")
