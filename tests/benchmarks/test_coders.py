"""Table and chart of coders, also with schemes not measured on every scene."""

from itertools import combinations

import pytest
from matplotlib.figure import Figure

from benchmarks.coding.coders import LETTERS, offsets, rate_table, shortened, summary, touch

ROWS = [
    {"scene": scene, "scheme": scheme, "bd_rate": rate, "seconds": seconds, "commit": "abcdef0"}
    for scheme, scene, rate, seconds in (
        ("everywhere", "apples", -10.0, 1.0),
        ("everywhere", "car", -30.0, 3.0),
        ("once", "apples", -90.0, 2.0),
        ("undefined", "apples", -80.0, 2.0),
        ("undefined", "car", None, 2.0),
    )
]


def test_the_mean_rate_needs_all_scenes():
    """A scheme with one good scene must not rank before schemes measured on all scenes."""
    found = {row["scheme"]: row for row in summary(ROWS)}
    assert found["everywhere"]["mean"] == pytest.approx(-20) and found["everywhere"]["seconds"] == pytest.approx(2)
    assert found["once"]["mean"] is None and found["undefined"]["mean"] is None
    assert next(iter(found)) == "everywhere"


def test_a_scene_that_was_not_measured_is_a_dash():
    assert "| `once` | -90 | – | – | 2.00 |" in rate_table(ROWS)


def test_the_short_table_has_the_best_setting_of_each_scheme_that_is_no_si_scheme():
    rates = {
        "si-a:best": 10.2,
        "si-a:fast": 30.0,
        "si-a": 10.4,
        "ei-a:best": 40.0,
        "ei-a": 50.0,
        "b:best": None,
        "b": None,
    }
    rows = [
        {"scene": "car", "scheme": name, "bd_rate": rate, "seconds": 1.0, "commit": "abcdef0"}
        for name, rate in rates.items()
    ]
    assert [row["scheme"] for row in shortened(summary(rows))] == ["si-a", "si-a:fast", "ei-a:best", "b"]


def test_labels_of_neighbouring_points_do_not_overlap():
    """Eight points at one position and one far away: no label covers another label or a point."""
    figure = Figure(figsize=(6, 6), dpi=90)
    axes = figure.add_subplot(xscale="log", yscale="log", xlim=(0.1, 10), ylim=(0.1, 10))
    named = [(f"si-coder{i}", (1.0, 1.0), "") for i in range(8)] + [("si-far", (5.0, 5.0), "")]
    found = offsets(named, axes)
    assert found[-1] == (5, 3)  # a free position
    boxes = [(x, y, x + 0.55 * LETTERS * 9, y + 1.1 * LETTERS) for x, y in found[:-1]]
    assert not any(touch(a, b) for a, b in combinations(boxes, 2))
    assert not any(touch(box, (-4, -4, 4, 4)) for box in boxes)
