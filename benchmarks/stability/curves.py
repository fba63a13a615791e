"""Limits of Bjøntegaard differences: little overlap, non-monotonic curves, few points.

The truth is known: the curves are parts of measured ones, interpolated by monotone cubics (Fritsch and Carlson 1980)
and taken as exact. The measured curves are in ``rd_curves.json`` beside this file, from ``benchmarks.coding.coders``
on two scenes. The file does not follow later runs: the limits are those of the method, and independent of the coders.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import bjontegaard
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from benchmarks.coding.coders import ANCHOR
from benchmarks.coding.rd import climbing
from benchmarks.stability.geometry import Row
from metrics import bd_psnr, bd_rate
from metrics.rates.rd import METHOD, UndefinedDifference

CURVES = Path(__file__).parent / "rd_curves.json"
SCHEMES = ("si-h264", "si-hevc", "si-av1", "si-vp9", "si-jpeg2000", "si-jp3d", "si-mpeg2")
SHARED = (1.0, 0.75, 0.5, 0.3, 0.2, 0.1, 0.05, 0.02)
DENTS_DB = (0.0, 0.05, 0.1, 0.2, 0.5, 1.0, 1.5, 2.0, 3.0)
POINTS = (4, 5, 6, 8, 12, 24)


@dataclass(frozen=True)
class Pair:
    """Two curves, log10 of the rate over quality, and the qualities that both reach."""

    a: PchipInterpolator
    b: PchipInterpolator
    low: float
    high: float

    def truth(self, low: float, high: float) -> float:
        """Return the excess rate of b over a in percent, over a range of quality."""
        quality = np.linspace(low, high, 2001)
        return float(100 * (10 ** np.mean(self.b(quality) - self.a(quality)) - 1))

    def points(self, curve: str, low: float, high: float, n: int = 5) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return rates and qualities of n points along a part of one curve, with rates in equal ratios."""
        joined = getattr(self, curve)
        every = np.linspace(low, high, 2001)
        quality = np.interp(np.linspace(joined(low), joined(high), n), joined(every), every)
        quality[[0, -1]] = low, high
        return 10 ** joined(quality), quality


@cache
def pairs() -> tuple[Pair, ...]:
    """Return every scheme with the anchor on every scene, if both reach a common range of 3 dB."""
    rows = json.loads(CURVES.read_text(encoding="utf-8"))["rows"]
    curves = {(row["scene"], row["scheme"]): climbing(row["points"]) for row in rows}
    found = []
    for (scene, scheme), points in curves.items():
        if scheme in SCHEMES:
            both = [curves[scene, ANCHOR], points]
            low = max(curve[0]["psnr"] for curve in both)
            high = min(curve[-1]["psnr"] for curve in both)
            if high - low >= 3:
                found.append(Pair(*(_joined(curve) for curve in both), low, high))
    return tuple(found)


def _joined(points: list[dict[str, float]]) -> PchipInterpolator:
    return PchipInterpolator([p["psnr"] for p in points], [np.log10(p["bpp"]) for p in points])


def figure(a: tuple[Any, Any], b: tuple[Any, Any], method: str = METHOD) -> float:
    """Return the Bjøntegaard rate of the package, for any overlap of the curves."""
    return float(bjontegaard.bd_rate(*a, *b, method=method, require_matching_points=False, min_overlap=0))


def bd_overlap() -> list[Row]:
    """Return errors over shrinking overlap: five points each on the lower end of a and on the upper end of b."""
    rows = []
    for shared in SHARED:
        off: dict[str, list[float]] = {"whole": [], "piece": [], "cubic": []}
        given = 0
        for pair in pairs():
            width = (pair.high - pair.low) / (2 - shared)  # such that both cover the given share of it
            a = pair.points("a", pair.low, pair.low + width)
            b = pair.points("b", pair.high - width, pair.high)
            found, piece = figure(a, b), pair.truth(pair.high - width, pair.low + width)
            off["whole"].append(abs(found - pair.truth(pair.low, pair.high)))
            off["piece"].append(abs(found - piece))
            off["cubic"].append(abs(figure(a, b, "cubic") - piece))
            given += _given(bd_rate, a, b)
        rows.append(
            {
                "curves share": shared, "off the whole curves', median": float(np.median(off["whole"])),
                "most": max(off["whole"]), "off what they share, median": float(np.median(off["piece"])),
                "at most": max(off["piece"]), "at most, cubic": max(off["cubic"]),
                "given": f"{given} of {len(pairs())}",
            }
        )  # fmt: skip
    return rows


def bd_dents() -> list[Row]:
    """Return errors if the third of seven points of the tested curve is too low, up to below its neighbour."""
    rows = []
    for dent in DENTS_DB:
        off_rate, off_psnr, given = [], [], 0
        for pair in pairs():
            a, b = (pair.points(curve, pair.low, pair.high, 7) for curve in ("a", "b"))
            sound = bd_rate(*a, *b), bd_psnr(*a, *b)
            b[1][2] -= dent
            off_psnr.append(abs(bd_psnr(*a, *b) - sound[1]))
            if _given(bd_rate, a, b):
                off_rate.append(abs(bd_rate(*a, *b) - sound[0]))
                given += 1
        rows.append(
            {
                "point too low by, dB": dent, "rate off, median": float(np.median(off_rate)) if off_rate else None,
                "rate off, most": max(off_rate, default=None), "PSNR off, dB, most": max(off_psnr),
                "rate given": f"{given} of {len(pairs())}",
            }
        )  # fmt: skip
    return rows


def bd_points() -> list[Row]:
    """Return errors over the number of points on the whole of both curves."""
    rows = []
    for n in POINTS:
        row: Row = {"points a curve": n}
        for method in (METHOD, "pchip", "cubic"):
            off = [
                abs(figure(*(pair.points(curve, pair.low, pair.high, n) for curve in ("a", "b")), method)
                    - pair.truth(pair.low, pair.high))
                for pair in pairs()
            ]  # fmt: skip
            row[f"{method}, median"], row[f"{method}, most"] = float(np.median(off)), max(off)
        rows.append(row)
    return rows


def _given(difference: Any, a: tuple[Any, Any], b: tuple[Any, Any]) -> bool:
    try:
        difference(*a, *b)
    except UndefinedDifference:
        return False
    return True
