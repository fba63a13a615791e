"""Tables of Q_view through the display, from rows whose order is known."""

import importlib.util

import numpy as np
import pytest

from benchmarks.accuracy import eye_views, view_measures
from benchmarks.study.views import SHOWN
from ii_core import IIPicture


def row(scene, scheme, rate, q, ideal, faults):
    measures = dict.fromkeys(eye_views.MEASURES, 10 * q + rate)
    point = {"scheme": SHOWN[scheme], "target_bpp": rate, "q_view": q, "ideal": ideal, "faults": faults}
    return {**measures, **point, "scene": scene, "scale": 4, "commit": "0123456"}


@pytest.fixture
def rows(monkeypatch):
    found = [
        row("apples", 0, 0.1, 0.80, 0.85, 0.80),
        row("apples", 1, 0.1, 0.90, 0.95, 0.795),  # before the display with faults it is the worse one, by 0.005
        row("apples", 2, 0.1, 0.7995, 0.8, 0.6),  # too near the first in Q_view to have an order with it
        row("apples", 0, 0.2, 0.99, 0.99, 0.99),  # another rate
        row("cuboid", 0, 0.1, 0.50, 0.60, 0.60),
        row("cuboid", 1, 0.1, 0.40, 0.65, 0.65),  # reversed by 0.05 before both
    ]
    monkeypatch.setattr(eye_views, "rows", lambda: found)


def test_pairs_of_one_rate_are_counted_and_reversals_found(rows):
    lines = eye_views.order_table()
    assert lines[2] == "| 4 | all 2 | 3 | 2 | 1 | 1 |" and lines[3] == ""


def test_observers_are_named_simulated_and_each_measure_has_a_row(rows):
    made = eye_views.simulated()
    assert made.simulated and made.observers >= 20 and len(made.judged) == 8
    lines = eye_views.simulated_table()
    assert len(lines) == 2 + len(eye_views.MEASURES) + 2 and "`0123456`" in lines[-1]


def test_simulated_observers_judge_the_finest_complete_scale(rows, monkeypatch):
    coarse = eye_views.rows()
    fine = [{**one, "scale": 2} for one in coarse]
    monkeypatch.setattr(eye_views, "rows", lambda: coarse + fine[:3])  # cuboid is missing
    assert {one["scale"] for one in eye_views.finest()} == {4}
    assert eye_views.order_table()[3] == "| 2 | apples | 2 | 2 | 1 | 0 |"
    monkeypatch.setattr(eye_views, "rows", lambda: coarse + fine)
    assert {one["scale"] for one in eye_views.finest()} == {2}


def test_an_error_common_to_all_views_is_consistent_and_one_that_alternates_is_not():
    """Lenses of 2×2 pixels; an error of +8 everywhere, then of +8 and −8 by turns along the columns of a lens."""
    picture = IIPicture(np.full((8, 8, 3), 100, np.uint8), (4, 4), (2, 2))
    even = picture.with_pixels(picture.pixels + np.uint8(8))
    assert view_measures.epi_psnr(picture, even) == np.inf
    signs = np.where(np.arange(8) % 2, 1, -1)[:, None, None] * np.ones((8, 8, 3), int)
    turns = picture.with_pixels((100 + 8 * signs).astype(np.uint8))
    # between rows the error changes by 16, between columns not at all
    assert view_measures.epi_psnr(picture, turns) == pytest.approx(10 * np.log10(255**2 / (16**2 / 2)))


@pytest.mark.skipif(not importlib.util.find_spec("sewar"), reason="sewar is of this comparison alone")
def test_multi_scale_ssim_has_as_many_scales_as_fit():
    rng = np.random.default_rng(0)
    for side in (24, 64, 200):
        view = rng.integers(0, 256, (side, side, 3), np.uint8)
        assert view_measures.ms_ssim(view, view) == pytest.approx(1)
        assert view_measures.ms_ssim(view, np.rint(view * 0.8).astype(np.uint8)) < 1
