"""Table of the errors of calibration, for ``docs/calibration.md``."""

from __future__ import annotations

import textwrap

from benchmarks.accuracy.calibration import DISTORTED_SIZE, KEYS, RECORDS
from benchmarks.pages.tables import Tables
from benchmarks.records import origin


def tables() -> Tables:
    """Return the table of the page of calibration."""
    lines = [
        "| lattice | lenses dark or saturated | pixels a side | cameras | pitch, worst (median) | turn | centres |",
        "|---" * 7 + "|",
    ]
    rows = [row for key in KEYS for row in RECORDS.rows() if key.items() <= row.items()]
    measured = [row for row in rows if "lattice" in row]
    lines += [
        f"| {row['lattice']} | {row['bad']:.0%} | {row['pixels'].replace('-', '–').replace('x', '×')} | "
        f"{row['cameras']} | {row['pitch_worst']:.1e} ({row['pitch_median']:.1e}) | "
        f"{row['turn_deg_worst']:.4f}° ({row['turn_deg_median']:.4f}°) | "
        f"{row['centres_px_worst']:.4f} px ({row['centres_px_median']:.4f} px) |"
        for row in measured
    ]
    large = [
        f"The picture of {row['pixels'].replace('x', '×')} px took {row['calibrate_cpu_seconds_worst']:.0f} s of CPU "
        f"time and {row['calibrate_peak_bytes_worst'] / 1e9:.1f} GB at the most."
        for row in measured
        if "calibrate_peak_bytes_worst" in row
    ]
    glass = [
        f"Behind a double Gauss (`plenoptic1-double-gauss`, scale {row['scale']}, its stop at 80 %), centres lie "
        f"{row['straight_px']:.3f} px rms off the best straight grid and {row['followed_px']:.3f} px off the "
        "calibrated one; truth is the light of micro-images without noise."
        for row in rows
        if "main_lens" in row
    ]
    bent = [row for row in rows if "distortion" in row]
    size = "×".join(map(str, DISTORTED_SIZE))
    caption = (
        f"Grids that no straight grid fits: discs on {size} px, lenses of 10–16 px, with the same noise. The shift "
        "is that of the left or right border off the straight grid of the middle. Distances are root mean squares, "
        "worst of the cameras. Where a drift would be steeper than cameras support, `calibrate` refuses the picture."
    )
    bent_lines = [
        "",
        *textwrap.wrap(caption, 100, break_on_hyphens=False),
        "",
        "| distortion | shift at the border, pitches | cameras refused | centres | best straight grid |",
        "|---" * 5 + "|",
        *(
            f"| {row['distortion']} | {row['border_pitches']:g} | {row['refused']} of {row['cameras']} | "
            + (
                f"{row['centres_px_worst']:.4f} px | {row['straight_px_worst']:.2f} px |"
                if row["refused"] < row["cameras"]
                else "– | – |"
            )
            for row in bent
        ),
    ]
    told = [line for text in (*large, *glass) for line in ("", *textwrap.wrap(text, 100, break_on_hyphens=False))]
    return {("docs/calibration.md", "calibration"): [*lines, *told, *bent_lines, "", origin(rows)]}
