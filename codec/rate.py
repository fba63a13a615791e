"""Meeting a rate with a coder that only nearly does as it is told."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

TOLERANCE = 0.02  # of the target
RERUNS = 3
# A miss so large that the coder is probably at its limit, which one run there settles.
FAR = 1.25
# The coarsest quantiser is the floor unless rate control has got well below it already, by starving the pictures that
# others are predicted from.
FLOOR = 1.1


@dataclass(frozen=True)
class Run:
    """One run of an encoder: its bytes, and the seconds of CPU time spent inside it."""

    payload: bytes
    codec_seconds: float


def within(size: float, target: float) -> bool:
    """Whether a size counts as the target."""
    return abs(size / target - 1) <= TOLERANCE


def nearest_rate(
    encode_at: Callable[[float], Run],
    target: float,
    *,
    coarsest: Callable[[], Run],
    finest: Callable[[], Run],
) -> tuple[Run, int]:
    """The run whose size comes nearest to a target, and how many runs there were.

    The coder is asked for the target; while it misses by more than `TOLERANCE` it is asked again, for more or less,
    at most `RERUNS` times. A miss by a factor of `FAR`, or a size that does not follow what is asked, suggests a
    limit: one run at the limit itself tells whether the target lies beyond it.

    Parameters
    ----------
    encode_at : callable
        Encodes at a size asked for, in bytes.
    target : float
        Bytes.
    coarsest, finest : callable
        Encode at the least and the highest quality.
    """
    runs: list[Run] = []
    points: list[tuple[float, float]] = []
    probed: set[bool] = set()
    ask = target
    for _ in range(1 + RERUNS):
        run = encode_at(ask)
        runs.append(run)
        size = len(run.payload)
        if within(size, target):
            return run, len(runs)
        over = size > target
        if (not 1 / FAR < size / target < FAR or _stuck(points, ask, size)) and over not in probed:
            probed.add(over)
            limit = coarsest() if over else finest()
            runs.append(limit)
            if not over and len(limit.payload) <= target:
                return limit, len(runs)  # more bytes of a worse run would buy nothing
            if over and target < len(limit.payload) < FLOOR * size:
                break
        points.append((ask, size))
        ask = _next(points, target)
    return min(runs, key=lambda run: abs(math.log(len(run.payload) / target))), len(runs)


def _stuck(points: list[tuple[float, float]], ask: float, size: float) -> bool:
    """Whether the size followed the latest change of what was asked by less than half, on a logarithmic scale."""
    if not points:
        return False
    asked, got = math.log(ask / points[-1][0]), math.log(size / points[-1][1])
    return asked == 0 or got / asked < 0.5


def _next(points: list[tuple[float, float]], target: float) -> float:
    """What to ask for next: between the nearest points on either side if there are any, else in proportion."""
    below = max((p for p in points if p[1] < target), key=lambda p: p[1], default=None)
    above = min((p for p in points if p[1] > target), key=lambda p: p[1], default=None)
    if below is None or above is None:
        ask, size = points[-1]
        return ask * target / size
    part = math.log(target / below[1]) / math.log(above[1] / below[1])
    return below[0] * (above[0] / below[0]) ** part
