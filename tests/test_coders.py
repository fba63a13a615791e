"""What the table of coders says of curves, some of which were not measured on every scene."""

import pytest

from benchmarks.coders import summary, table

ROWS = [
    {"scene": scene, "scheme": scheme, "bd_rate": rate, "seconds": seconds}
    for scheme, scene, rate, seconds in (
        ("everywhere", "apples", -10.0, 1.0),
        ("everywhere", "car", -30.0, 3.0),
        ("once", "apples", -90.0, 2.0),
        ("undefined", "apples", -80.0, 2.0),
        ("undefined", "car", None, 2.0),
    )
]


def test_a_mean_is_of_all_scenes_or_there_is_none():
    """One good scene must not put a scheme before those that were measured on all."""
    found = {row["scheme"]: row for row in summary(ROWS)}
    assert found["everywhere"]["mean"] == pytest.approx(-20) and found["everywhere"]["seconds"] == pytest.approx(2)
    assert found["once"]["mean"] is None and found["undefined"]["mean"] is None
    assert next(iter(found)) == "everywhere"


def test_a_scene_that_was_not_measured_is_a_dash():
    assert "| `once` | -90 % | – | – | 2.00 |" in table(ROWS)
