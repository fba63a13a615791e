"""Tables of Q_view through the display, from rows whose order is known."""

import pytest

from benchmarks.accuracy import eye_views
from benchmarks.study.views import SHOWN


def row(scene, scheme, rate, q, ideal, faults):
    measures = dict.fromkeys(eye_views.MEASURES, 10 * q + rate)
    point = {"scheme": SHOWN[scheme], "target_bpp": rate, "q_view": q, "ideal": ideal, "faults": faults}
    return {**measures, **point, "scene": scene, "commit": "0123456"}


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
    assert lines[2] == "| apples | 2 | 2 | 1 | 0 |"
    assert lines[5] == "| cuboid | 1 | 0 | 0 | 1 |" and lines[6] == "| all | 3 | 2 | 1 | 1 |"


def test_observers_are_named_simulated_and_each_measure_has_a_row(rows):
    made = eye_views.simulated()
    assert made.simulated and made.observers >= 20 and len(made.judged) == 8
    lines = eye_views.simulated_table()
    assert len(lines) == 2 + len(eye_views.MEASURES) + 2 and "`0123456`" in lines[-1]
