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
    assert waves.crossing(points, "rays_db") == "2 (pixel of 4.0 λΛ/δL)"
    assert waves.crossing(points[1:], "rays_db") == "nowhere: always above"


def test_the_rule_of_thumb_agrees_with_the_records():
    """Of all points in focus: rays above 40 dB with pixels of 5.4 λΛ/δL and more, and not much below."""
    points = [
        p for row in waves.RECORDS.rows() if row.get("sweep") in ("pitch", "gap", "pixels") for p in row["points"]
    ]
    assert "at least 5.4 λΛ/δL" in (ROOT / "docs/waves.md").read_text()
    assert min(p["rays_db"] for p in points if p["pixel_over_spread"] >= 5.4) >= 39.9
    assert max(p["rays_db"] for p in points if p["pixel_over_spread"] <= 4.5) < 40
    assert min(p["model_db"] for row in waves.RECORDS.rows() for p in row.get("points", ())) > 53
