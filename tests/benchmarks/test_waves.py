"""Chart of rays against waves: its errors by hand, and the rule of thumb of its page in its records."""

import math

import numpy as np
import pytest

from benchmarks.accuracy import waves
from benchmarks.records import ROOT


def test_error_of_equal_and_of_shifted_kernels_by_hand():
    still = np.eye(1, 5, 2)[0]
    assert waves.error_db(still, still) == 200
    # the mean of neighbours: an edge of a patch, one in 8 pixels, is off by half its step, of mean square 1/6
    half = np.array([0, 0.5, 0.5, 0, 0])
    assert waves.error_db(half, still) == pytest.approx(-10 * math.log10(1 / 8 / 4 / 6), abs=0.5)


def test_crossing_is_interpolated():
    points = [
        {"value": 1.0, "pixel_over_spread": 2.0, "rays_db": 30.0},
        {"value": 4.0, "pixel_over_spread": 8.0, "rays_db": 50.0},
    ]
    assert waves.crossing(points, "rays_db") == "2 (4.0 λΛ/δL)"
    assert waves.crossing(points[1:], "rays_db") == "always above"


@pytest.mark.slow
def test_round_kernels_agree_where_the_field_gives_way_to_airys_pattern():
    """The closed form that stands in for the field of wide lenses is the field's where both are there: 70 dB."""
    pitch, gap, pixel = 0.2, 0.374, 0.0125
    x, columns = waves.round_wave(pitch, gap, 550.0, math.inf, pixel)
    airy = np.linspace(-100, 100, 2001) * 550e-6 * gap / pitch
    closed = waves.diffraction_limit(np.hypot(airy, airy[:, None]), pitch, gap, 550.0, 2).sum(axis=0)
    both = [waves.pixel_kernel(places, light, pixel, 8) for places, light in ((x, columns), (airy, closed))]
    assert waves.error_db(*both) > 60


def test_the_rule_of_thumb_is_what_was_measured():
    """Of all points in focus: rays above 40 dB from the rule's pixels on, and not much below; maps above theirs."""
    page = " ".join((ROOT / "docs/waves.md").read_text().split())
    least = float(page.split("at least ")[1].split(" λΛ/δL")[0])
    floor = float(page.split("stay above ")[1].split(" dB")[0])
    rows = [row for row in waves.RECORDS.rows(lens="round") if "sweep" in row]
    points = [p for row in rows if row["sweep"] != "depth" for p in row["points"]]
    assert min(p["rays_db"] for p in points if p["pixel_over_spread"] >= least) >= 39.9
    assert max(p["rays_db"] for p in points if p["pixel_over_spread"] <= least - 0.9) < 40
    assert min(p["model_db"] for row in rows for p in row["points"]) > floor
