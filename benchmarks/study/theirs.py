"""Results of Olsson 2008 as numbers from its text and tables, and criteria of agreement."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

# Figure 5.10 and §5.8.1: mean gain of SI-PVS in dB over JPEG 2000, SI-PVI and EI-PVS.
GAIN_JPEG2000 = {"apples": 17.9, "twins": 12.6, "car": 14.2, "cuboid": 10.9}
GAIN_VOLUME = {"apples": 5.1, "twins": 4.5, "car": 4.3, "cuboid": 6.0}
GAIN_EI = {"apples": 13.4, "twins": 8.2, "car": 9.1, "cuboid": 5.8}
EI_FLOOR = {"EI-PVS": 0.63}  # bpp
# Times JPEG 2000's rate at equal quality over that of SI-PVS, and SI-PVI's at about 30 dB.
RATE_JPEG2000 = {"twins": 60.0, "car": 60.0}
RATE_VOLUME = {"apples": 4.0, "twins": 4.0, "car": 4.0, "cuboid": 4.0}
# Figure 5.11 and §5.8.2: parallel first, row with very small difference, column last.
ORDERS = {"parallel": 4.0, "row": 3.0, "zigzag": 2.0, "spiral": 2.0, "column": 1.0}
# Figure 5.12: the better kind, SI (+) or EI (−), by pixels of an elementary image each way.
DUELS = {"16": 1.0, "32": 1.0, "64": 1.0, "128": -1.0, "256": -1.0}
# Table 5.5: dB against IP… with one I picture; rows J, 128, 32, 16, columns IP, IBP, IBBP, IBBBP.
TYPES = (
    (0.0, -0.57, -0.75, -0.96),
    (-0.05, -0.67, -0.82, -1.02),
    (-0.23, -0.99, -1.13, -1.35),
    (-0.42, -1.25, -1.48, -1.67),
)
# Table 5.6: dB and times of encoding against a range of 16.
RANGE_DB = {"apples": (0.0, 0.12, 0.18, 0.21), "twins": (0.0, 0.01, 0.05, 0.11)}
RANGE_TIME = {"apples": (1.0, 2.8, 9.2, 28.0), "twins": (1.0, 3.3, 11.0, 31.0)}
# Table 5.7: dB and times of encoding against constant bit rate.
CONTROL_DB = {"apples": {"cq": 0.39, "2pass": 0.15}, "twins": {"cq": 0.29, "2pass": 0.18}}
CONTROL_TIME = {"apples": {"cq": 0.95, "2pass": 1.12}, "twins": {"cq": 0.96, "2pass": 1.30}}
# Table 5.8: seconds of encoding, in the order of the scenes.
ENCODE = {
    "SI-PVS": (9.1, 10.7, 10.9, 12.0),
    "JPEG 2000": (6.2, 6.2, 6.8, 7.2),
    "SI-PVI": (53.4, 67.2, 74.2, 93.4),
    "EI-PVS": (1405.3, 1400.3, 1441.0, 1421.9),
    "RI-PVS": (15.9, 17.8, 18.9, 17.0),
}
# Figure 5.19 at 0.15 bpp and §5.8.5.2: ranks, the best first; schemes of one rank were equally good.
VIEW_PLACES = {
    "apples": (("EI",), ("SI",), ("RI",), ("JPEG 2000", "PVI")),
    "twins": (("EI",), ("SI",), ("RI",), ("JPEG 2000", "PVI")),
    "car": (("EI", "SI"), ("RI",), ("JPEG 2000", "PVI")),
    "cuboid": (("EI", "SI", "PVI"), ("RI",), ("JPEG 2000",)),
}
# Figures 4.5 and 5.20: bpp that *Apples* needs for 28 dB in setup 3.
RATE_28_DB = {"JPEG 2000": 0.35, "PVI": 0.26, "SI": 0.14, "EI": 0.08}
# Figure 5.21 and §5.8.5.3: EI-PVS and JPEG 2000 lose most from near to far, SI-PVS less; SI-PVI fluctuates least.
DECLINE = {"EI": 2.0, "JPEG 2000": 2.0, "SI": 1.0}
FLUCTUATION = {"EI": 3.0, "JPEG 2000": 3.0, "SI": 2.0, "PVI": 1.0}

TWICE = 2.0


@dataclass(frozen=True)
class Verdict:
    """Agreement by sign, order and size, each as (number that agrees, number compared)."""

    sign: tuple[int, int]
    order: tuple[int, int]
    size: tuple[int, int]


def compare(
    theirs: Mapping[str, float], ours: Mapping[str, float | None], *, only: str = "sign order size", even: float = 0.0
) -> Verdict:
    """Compare sign, order and size of numbers by name.

    Parameters
    ----------
    theirs, ours : mapping of str to float
        None or missing where there is no number, which counts as disagreement.
    only : str
        Restriction of the comparison: ranks have no sign and no size.
    even : float
        Tolerance for ours where theirs are equal.

    Returns
    -------
    Verdict
        Sign: of theirs that are not 0. Order: pairs with the same greater number. Size: within a factor of 2, of
        those that are not 0.
    """
    known = {name: value for name in theirs if (value := ours.get(name)) is not None and math.isfinite(value)}
    some = [name for name, value in theirs.items() if value]
    same = sum(name in known and known[name] * theirs[name] > 0 for name in some)
    near = sum(
        name in known and known[name] * theirs[name] > 0 and 1 / TWICE <= known[name] / theirs[name] <= TWICE
        for name in some
    )
    pairs = [(a, b) for a, b in combinations(theirs, 2) if theirs[a] != theirs[b] or even]
    ordered = sum(_alike(theirs[a] - theirs[b], known, a, b, even) for a, b in pairs)
    return Verdict(
        (same, len(some)) if "sign" in only else (0, 0),
        (ordered, len(pairs)) if "order" in only else (0, 0),
        (near, len(some)) if "size" in only else (0, 0),
    )


def _alike(difference: float, known: Mapping[str, float], a: str, b: str, even: float) -> bool:
    if a not in known or b not in known:
        return False
    ours = known[a] - known[b]
    return ours * difference > 0 if difference else abs(ours) <= even


def said(good: int, of: int) -> str:
    """Return yes, no, or the number that agrees of all."""
    if not of:
        return ""
    return "yes" if good == of else "no" if not good else f"{good} of {of}"
