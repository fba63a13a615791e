"""Meeting a rate with a coder that only nearly does as it is told."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
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
    reruns: int = RERUNS,
) -> tuple[Run, int]:
    """The run whose size comes nearest to a target, and how many runs there were.

    The coder is asked for the target; while it misses by more than `TOLERANCE` it is asked again, for more or less,
    at most ``reruns`` times. A miss by a factor of `FAR`, or a size that does not follow what is asked, suggests a
    limit: one run at the limit itself tells whether the target lies beyond it.

    Parameters
    ----------
    encode_at : callable
        Encodes at a size asked for, in bytes.
    target : float
        Bytes.
    coarsest, finest : callable
        Encode at the least and the highest quality.
    reruns : int
        More of them are worth it where the coder is quick.
    """
    runs: list[Run] = []
    points: list[tuple[float, float]] = []
    probed: set[bool] = set()
    ask = target
    for _ in range(1 + reruns):
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
    return nearest(runs, target), len(runs)


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


SEARCH_RUNS = 5
SHARE_RUNS = 4


def nearest(runs: Iterable[Run], target: float) -> Run:
    """The run whose size comes nearest to a target, as a ratio."""
    return min(runs, key=lambda run: abs(math.log(len(run.payload) / target)))


def nearest_quantiser(
    encode_at: Callable[[float], Run], target: float, *, low: float, high: float, step: float, octave: float
) -> dict[float, Run]:
    """Runs that close in on a target, by quantiser, for a coder that takes a quantiser and no rate.

    The logarithm of the size is taken to fall straight with the quantiser, by half every ``octave``, until two runs
    on either side of the target tell better. It ends within `TOLERANCE`, with neighbours on either side of it, or
    after `SEARCH_RUNS`.

    Parameters
    ----------
    encode_at : callable
        Encodes at a quantiser.
    target : float
        Bytes.
    low, high : float
        The finest and the coarsest quantiser.
    step : float
        Between quantisers that differ.
    octave : float
        Quantisers per halving of the size, about.
    """
    runs: dict[float, Run] = {}
    steps = round((high - low) * 0.6 / step)
    quantiser = low + steps * step
    while quantiser not in runs and len(runs) < SEARCH_RUNS:
        runs[quantiser] = run = encode_at(quantiser)
        if within(len(run.payload), target):
            break
        steps = round((_aimed(runs, target, octave, low, high) - low) / step)
        if (tried := runs.get(low + steps * step)) is not None:
            # The target lies within a step of it, and the neighbour is the other end.
            steps += 1 if len(tried.payload) > target else -1
        quantiser = min(max(low + steps * step, low), high)
    return runs


def nearest_share(encode_at: Callable[[float], Run], target: float, *, none: Run, all_: Run) -> list[Run]:
    """Runs that close in on a target by how much of a sequence is coded finer, at most `SHARE_RUNS`.

    Parameters
    ----------
    encode_at : callable
        Encodes with a share from 0 to 1.
    target : float
        Bytes, between the sizes of ``none`` and ``all_``.
    none, all_ : Run
        With a share of 0 and of 1.
    """
    below, above = (0.0, len(none.payload)), (1.0, len(all_.payload))
    runs: list[Run] = []
    for _ in range(SHARE_RUNS):
        share = below[0] + (above[0] - below[0]) * (target - below[1]) / (above[1] - below[1])
        runs.append(encode_at(share))
        size = len(runs[-1].payload)
        if within(size, target):
            break
        if size < target:
            below = share, size
        else:
            above = share, size
    return runs


def straddling(runs: Mapping[float, Run], target: float) -> tuple[float, float] | None:
    """The nearest quantisers tried on either side of a target, the finer first; None if all lie on one side."""
    fine = max((q for q, run in runs.items() if len(run.payload) > target), default=None)
    coarse = min((q for q, run in runs.items() if len(run.payload) < target), default=None)
    return None if fine is None or coarse is None or fine > coarse else (fine, coarse)


def _aimed(runs: dict[float, Run], target: float, octave: float, low: float, high: float) -> float:
    """The quantiser to try next: between the nearest on either side if there are any, else along the slope."""
    excess = {quantiser: math.log2(len(run.payload) / target) for quantiser, run in runs.items()}
    if (pair := straddling(runs, target)) is not None:
        fine, coarse = pair
        return fine + (coarse - fine) * excess[fine] / (excess[fine] - excess[coarse])
    nearest = min(excess, key=lambda q: abs(excess[q]))
    if len(excess) > 1:
        a, b = sorted(excess, key=lambda q: abs(q - nearest))[:2]
        if excess[a] != excess[b]:
            octave = min(max((b - a) / (excess[a] - excess[b]), octave / 3), 4 * octave)
    return min(max(nearest + octave * excess[nearest], low), high)
