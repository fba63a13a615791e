"""Table of the errors of calibration, for ``docs/calibration.md``."""

from __future__ import annotations

from benchmarks.accuracy.calibration import RECORDS
from benchmarks.pages.tables import Tables
from benchmarks.records import origin


def tables() -> Tables:
    """Return the table of the page of calibration."""
    lines = [
        "| lattice | lenses dark or saturated | pixels a side | cameras | pitch, worst (median) | turn | centres |",
        "|---" * 7 + "|",
    ]
    measured = RECORDS.rows()
    lines += [
        f"| {row['lattice']} | {row['bad']:.0%} | {row['pixels'].replace('-', '–').replace('x', '×')} | "
        f"{row['cameras']} | {row['pitch_worst']:.1e} ({row['pitch_median']:.1e}) | "
        f"{row['turn_deg_worst']:.4f}° ({row['turn_deg_median']:.4f}°) | "
        f"{row['centres_px_worst']:.4f} px ({row['centres_px_median']:.4f} px) |"
        for row in measured
    ]
    return {("docs/calibration.md", "calibration"): [*lines, "", origin(measured)]}
