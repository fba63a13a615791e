"""Search of one encoder setting, such as a quantiser, whose stream has a target size.

All coders search alike. `trials` is the search; `meet_size` uses it for settings, `meet_rate` for encoders with a
rate control that misses its target. A *miss* is the binary logarithm of size over target.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from ii_core.base.checks import callable_, checked, instance, number

from .progress import run_begins, runs_so_far

TOLERANCE = 0.02  # of the target
# No guess reaches further than so many doublings of the size, or closer than this part of a bracket to its ends. The
# measured slope counts between 1/REACH and REACH of the one expected.
REACH, MARGIN = 4.0, 0.05

RERUNS = 3
# Rate control that misses by this factor is probably at its limit; one run at the limit settles it.
FAR = 1.25
# The coarsest quantiser is the floor, unless rate control has written this factor less: it then drops residuals of
# pictures that predict others.
FLOOR = 1.1


@dataclass(frozen=True)
class Run:
    """One run of an encoder: its bytes, and the seconds of CPU time inside it."""

    payload: bytes
    codec_seconds: float


@dataclass(frozen=True, kw_only=True)
class CodingResult:
    """The run that a coder keeps, and the number of runs it took."""

    run: Run
    runs: int = 1


Result = TypeVar("Result")


@dataclass(frozen=True)
class Trial(Generic[Result]):
    """A setting, its miss and its result; the size falls short of the target where the miss is negative."""

    setting: float
    miss: float
    result: Result


@dataclass(frozen=True, kw_only=True)
class Axis:
    """The settings to search.

    Parameters
    ----------
    low, high : float
        The ends, whichever is the coarser.
    start : float
        The first setting to try.
    octave : float
        Change of the setting that doubles the size, approximately; negative if larger settings are coarser.
    step : float
        Distance of neighbouring settings, counted from ``low``; 0 for real numbers.
    overshoot : float
        How far an extrapolation goes beyond its aim, as a part, to bracket the target.
    runs : int
        Largest number of encoder runs.
    """

    low: float
    high: float
    start: float
    octave: float
    step: float = 0.0
    overshoot: float = 0.1
    runs: int = 12

    def place(self, setting: float) -> float:
        """Return the nearest setting there is."""
        if self.step:
            setting = self.low + round((min(max(setting, self.low), self.high) - self.low) / self.step) * self.step
        return min(max(setting, self.low), self.high)

    def finer(self, setting: float) -> float:
        """Return a number that grows with the size of the stream."""
        return math.copysign(1, self.octave) * setting


def within(size: float, target: float) -> bool:
    """Whether a size meets a target."""
    return target > 0 and abs(size / target - 1) <= TOLERANCE  # a file may state 0; infinity is never met


def size_miss(run: Run, target: float) -> float:
    """Binary logarithm of size over target."""
    return math.log2(len(run.payload)) - math.log2(min(max(target, 1e-300), 1e300))


def met(miss: float) -> bool:
    """Whether a miss is within `TOLERANCE`, less what logarithms round, so that `within` agrees."""
    return math.log2(1 - TOLERANCE) + 1e-12 < miss < math.log2(1 + TOLERANCE) - 1e-12


def trials(
    try_at: Callable[[float], Result],
    miss_of: Callable[[Result], float],
    axis: Axis,
    *,
    known: Sequence[Trial[Result]] = (),
    enough: Callable[[float], bool] = met,
) -> Iterator[Trial[Result]]:
    """Try settings that approach a target.

    The search assumes that the miss is monotone and smooth in the setting. It interpolates between the nearest trials
    on either side of the target, or extrapolates from trials on one side. It ends when the target is met, an end of
    the axis is reached, no setting is left in between, or the runs are used up.

    Parameters
    ----------
    try_at : callable
        Runs the encoder at a setting.
    miss_of : callable
        The miss of a result.
    axis : Axis
    known : sequence of Trial
        Earlier trials. The first setting follows from them, if there are any.
    enough : callable
        Whether a miss meets the target.

    Yields
    ------
    Trial
    """
    tried = {trial.setting: trial for trial in known}
    setting = _next(tried, axis) if tried else axis.place(axis.start)
    most = runs_so_far() + axis.runs
    for _ in range(axis.runs):
        if setting in tried:
            return
        run_begins(most)
        result = try_at(setting)
        tried[setting] = trial = Trial(setting, miss_of(result), result)
        yield trial
        if enough(trial.miss):
            return
        setting = _next(tried, axis)


def nearest(tried: Sequence[Trial[Result]]) -> Trial[Result]:
    """Return the trial with the least miss."""
    return min(tried, key=lambda trial: abs(trial.miss))


def bracket(tried: Sequence[Trial[Result]], axis: Axis) -> tuple[Trial[Result], Trial[Result]] | None:
    """Return the nearest trials below and above the target; None if all lie on one side."""
    under = max((t for t in tried if t.miss < 0), key=lambda t: axis.finer(t.setting), default=None)
    over = min((t for t in tried if t.miss > 0), key=lambda t: axis.finer(t.setting), default=None)
    return None if under is None or over is None else (under, over)


@checked(encode_at=callable_, target=number, axis=lambda name, value: instance(Axis)(name, value), finest=callable_)
def meet_size(
    encode_at: Callable[[float], Run], target: float, axis: Axis, *, finest: Callable[[], Run] | None = None
) -> CodingResult:
    """Return the run whose size is nearest to a target.

    Parameters
    ----------
    encode_at : callable
        Encodes at a setting.
    target : float
        Bytes.
    axis : Axis
    finest : callable, optional
        Encodes better than the finest setting of the axis, say lossless.
    """
    tried = list(trials(encode_at, lambda run: size_miss(run, target), axis))
    best, runs = nearest(tried), len(tried)
    end = axis.high if axis.octave > 0 else axis.low
    if finest is not None and (last := next((t for t in tried if t.setting == end and t.miss < 0), None)):
        run_begins()
        run = finest()
        runs += 1
        if len(run.payload) <= target or abs(size_miss(run, target)) < abs(last.miss):
            return CodingResult(run=run, runs=runs)
    return CodingResult(run=best.result, runs=runs)


def meet_rate(
    encode_at: Callable[[float], Run],
    target: float,
    *,
    coarsest: Callable[[], Run],
    finest: Callable[[], Run],
    reruns: int = RERUNS,
) -> CodingResult:
    """Return the run whose size is nearest to a target, for an encoder with rate control.

    The setting is the size given to the encoder. A miss by a factor of `FAR`, or a size that does not follow the
    setting, suggests a limit: one run at the limit shows whether the target lies beyond it.

    Parameters
    ----------
    encode_at : callable
        Encodes at a size in bytes.
    target : float
        Bytes.
    coarsest, finest : callable
        Encode at the least and the highest quality.
    reruns : int
        Largest number of further runs.
    """
    axis = Axis(low=-math.inf, high=math.inf, start=0.0, octave=1.0, overshoot=0.0, runs=1 + reruns)
    limits: dict[bool, Run] = {}
    tried: list[Trial[Run]] = []
    for trial in trials(lambda octaves: encode_at(target * 2.0**octaves), lambda run: size_miss(run, target), axis):
        last = tried[-1] if tried else None
        tried.append(trial)
        over = trial.miss > 0
        far = abs(trial.miss) >= math.log2(FAR) or (last is not None and _stuck(last, trial))
        if met(trial.miss) or not far or over in limits:
            continue
        run_begins()
        limit = limits[over] = coarsest() if over else finest()
        if not over and len(limit.payload) <= target:
            return CodingResult(run=limit, runs=len(tried) + len(limits))  # a worse run would only take more bytes
        if over and target < len(limit.payload) < FLOOR * len(trial.result.payload):
            break
    tried += [Trial(math.nan, size_miss(run, target), run) for run in limits.values()]
    return CodingResult(run=nearest(tried).result, runs=len(tried))


def _stuck(last: Trial[Run], trial: Trial[Run]) -> bool:
    """Whether the size followed the latest change of the setting by less than half."""
    change = trial.setting - last.setting
    return change == 0 or (trial.miss - last.miss) / change < 0.5


def _next(tried: dict[float, Trial[Result]], axis: Axis) -> float:
    """Return the setting at which the miss should vanish."""
    points = list(tried.values())
    pair = bracket(points, axis)
    if pair is None:
        return _beyond(points, axis)
    under, over = pair
    width = over.setting - under.setting
    if axis.step and abs(width) < 1.5 * axis.step:
        return under.setting
    part = (_root(points) - under.setting) / width if width else math.nan
    if not 0 < part < 1:
        part = under.miss / (under.miss - over.miss)
    setting = under.setting + min(max(part, MARGIN), 1 - MARGIN) * width
    if axis.step:
        first, last = sorted((under.setting, over.setting))
        setting = min(max(setting, first + axis.step), last - axis.step)
    return axis.place(setting)


def _root(points: Sequence[Trial[Result]]) -> float:
    """Return the root of the parabola through the three least misses, as a function of the miss; NaN if none."""
    three = sorted(points, key=lambda t: abs(t.miss))[:3]
    if len({t.miss for t in three}) < 3:
        return math.nan
    return sum(t.setting * math.prod(o.miss / (o.miss - t.miss) for o in three if o is not t) for t in three)


def _beyond(points: Sequence[Trial[Result]], axis: Axis) -> float:
    """Extrapolate along the slope of the two least misses, where all sizes lie on one side of the target."""
    near, *others = sorted(points, key=lambda t: abs(t.miss))
    octave = axis.octave
    if others and near.miss != others[0].miss:
        slope = (near.setting - others[0].setting) / (near.miss - others[0].miss)
        if slope * octave > 0:
            octave = math.copysign(min(max(abs(slope), abs(octave) / REACH), abs(octave) * REACH), octave)
    away = max(-REACH, min(REACH, -near.miss))
    change = (1 + axis.overshoot) * octave * (away + math.copysign(axis.overshoot / 2, away))
    return axis.place(near.setting + math.copysign(max(axis.step, abs(change)), change))
