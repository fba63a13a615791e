"""Meeting a rate with a coder that only knows settings, such as a quality, by trying some."""

from __future__ import annotations

import math
from collections.abc import Callable

from .rate import Run, within

MAX_RUNS = 12
# No guess reaches further than so many doublings of the size, or closer than this part of a bracket to its ends.
REACH, MARGIN = 4.0, 0.05


def nearest_setting(
    encode_at: Callable[[float], Run],
    target: float,
    *,
    low: float,
    high: float,
    start: float,
    octave: float,
    whole: bool = False,
    finest: Callable[[], Run] | None = None,
) -> tuple[Run, int]:
    """The run whose size comes nearest to a target, and how many runs there were.

    The size is taken to grow from one end of the settings to the other, smoothly on a logarithmic scale. Each try is
    interpolated between the nearest ones on either side of the target, or extrapolated from one, until the size is
    within the tolerance of `codec.rate`, an end is reached or no setting is left in between.

    Parameters
    ----------
    encode_at : callable
        Encodes with a setting.
    target : float
        Bytes.
    low, high : float
        The ends of the settings, whichever is the coarser.
    start : float
        The first to try, brought within the ends.
    octave : float
        By how much the setting changes, about, where the size doubles: negative if larger settings are coarser.
    whole : bool
        Only whole settings will do.
    finest : callable, optional
        Encodes still better than the finest setting.
    """
    goal = math.log2(min(max(target, 1e-300), 1e300))
    tried: dict[float, tuple[float, Run]] = {}
    setting = _placed(start, low, high, whole)
    runs = 0
    while setting not in tried and runs < MAX_RUNS:
        run = encode_at(setting)
        runs += 1
        if within(len(run.payload), target):
            return run, runs
        tried[setting] = math.log2(len(run.payload)) - goal, run
        setting = _placed(_next({s: miss for s, (miss, _) in tried.items()}, octave, whole), low, high, whole)
    kept = min(tried.values(), key=lambda point: abs(point[0]))[1]
    end = high if octave > 0 else low
    if finest is not None and end in tried and len(tried[end][1].payload) < target:
        best = finest()
        runs += 1
        if len(best.payload) <= target or abs(math.log2(len(best.payload)) - goal) < abs(tried[end][0]):
            kept = best
    return kept, runs


def _placed(setting: float, low: float, high: float, whole: bool) -> float:
    setting = min(max(setting, low), high)
    return float(round(setting)) if whole else setting


def _next(misses: dict[float, float], octave: float, whole: bool) -> float:
    """Where the miss, in doublings of the size, should vanish."""
    finer = math.copysign(1, octave)
    under = max((s for s, miss in misses.items() if miss < 0), key=lambda s: finer * s, default=None)
    over = min((s for s, miss in misses.items() if miss > 0), key=lambda s: finer * s, default=None)
    if under is None or over is None:
        return _beyond(misses, octave, whole)
    if whole and abs(over - under) <= 1:
        return under
    part = (_through(misses) - under) / (over - under)
    if not 0 < part < 1:
        part = misses[under] / (misses[under] - misses[over])
    setting = under + min(max(part, MARGIN), 1 - MARGIN) * (over - under)
    if whole:
        first, last = min(under, over) + 1, max(under, over) - 1
        setting = min(max(round(setting), first), last)
    return setting


def _through(misses: dict[float, float]) -> float:
    """Where the parabola through the three least misses vanishes, as a function of the miss; NaN if there is none."""
    three = sorted(misses, key=lambda s: abs(misses[s]))[:3]
    if len({misses[s] for s in three}) < 3:
        return math.nan
    return sum(
        s * math.prod(misses[other] / (misses[other] - misses[s]) for other in three if other != s) for s in three
    )


def _beyond(misses: dict[float, float], octave: float, whole: bool) -> float:
    """Where to look next while all sizes are on one side: as far as the two nearest tell, and a little further."""
    nearest, *others = sorted(misses, key=lambda s: abs(misses[s]))
    if others and misses[nearest] != misses[others[0]]:
        slope = (nearest - others[0]) / (misses[nearest] - misses[others[0]])
        if slope * octave > 0:
            octave = math.copysign(min(max(abs(slope), abs(octave) / REACH), abs(octave) * REACH), octave)
    away = max(-REACH, min(REACH, -misses[nearest]))
    change = 1.1 * octave * (away + math.copysign(0.05, away))
    return nearest + (math.copysign(max(1, abs(change)), change) if whole else change)
