"""Coding of II-video: takes as segments of pseudo video sequences, and their ``.ii`` file."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core import IIVideo
from ii_core.base import checks
from ii_core.base.files import one_line

from .. import file_header
from ..api import blank_picture, check_coded
from ..checks import check_type, whole
from ..clock import cpu_seconds
from ..contract import MAX_DECODED_PIXELS, Goal, Value, check_picture, checked_goal, parse_scheme
from ..search import Axis, Run, Trial, bracket, nearest, trials, within
from . import container
from .coding import SegmentCoder, segment_coder, take_coder
from .container import DamagedTake
from .decoding import CodedFrames
from .order import Plan
from .unfinished import Unfinished

RATES = ("take", "segment")
MAX_FRAMES = 1 << 24
QUANTISER_RUNS = 7  # encoder runs over the whole take, at most
Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False, kw_only=True)
class EncodedTake:
    """A coded II-video.

    Parameters
    ----------
    scheme, options, structure, dtype, target_bpp, qp, quality
        As in `codec.Encoded`; the structure is that of a frame.
    frames : int
        Number T of frames.
    fps : float
        Frames per second.
    plan : Plan
        Order and groups.
    segments : list of bytes
        Payload of each segment.
    runs : int or None
        Encoder runs over the whole take. None if read from a file.
    encode_seconds, codec_seconds : float or None
        CPU time of coding, and inside the encoder for the runs that were kept. None if read from a file.
    """

    scheme: str
    options: Mapping[str, Value]
    structure: Mapping[str, Any]
    dtype: str
    frames: int
    fps: float
    plan: Plan
    segments: list[bytes] = field(repr=False)
    target_bpp: float | None = None
    qp: int | None = None
    quality: float | None = None
    runs: int | None = None
    encode_seconds: float | None = None
    codec_seconds: float | None = None

    def __post_init__(self) -> None:
        check_coded(self)
        take_coder(self.scheme)
        check_type("plan", self.plan, Plan, "a Plan")
        whole("frames", self.frames, 1, MAX_FRAMES)
        if not 0 < checks.number("fps", self.fps) < math.inf:
            raise ValueError(f"fps is {self.fps!r}: a finite number above 0 is needed")
        check_type("segments", self.segments, list, "a list of bytes")
        for payload in self.segments:
            check_type("segments holds a value that", payload, bytes, "bytes")

    @property
    def size(self) -> tuple[int, int]:
        """(M, N) of a frame."""
        (k, l), (u, v) = self.structure["lenses"], self.structure["ei_pixels"]
        return k * u, l * v

    @property
    def overhead(self) -> int:
        """Bytes of the file beyond the payloads."""
        framing = sum(len(container.framed(i, b"")) for i in range(len(self.segments)))
        lengths = sum(len(container.leb128(len(payload))) - 1 for payload in self.segments)
        return len(container.head(_values(self))) + framing + lengths

    @property
    def nbytes(self) -> int:
        """Bytes of the ``.ii`` file."""
        return self.overhead + sum(map(len, self.segments))

    @property
    def bpp(self) -> float:
        """Bits of the file per pixel of all frames."""
        return 8 * self.nbytes / (self.frames * math.prod(self.size))

    @property
    def mbit_per_second(self) -> float:
        """Bits of the file per second of the take, in millions."""
        return 8e-6 * self.nbytes / (self.frames / self.fps)

    @property
    def reached(self) -> bool:
        """Whether the rate is within 2 % of its target, if there was one."""
        pixels = self.frames * math.prod(self.size)
        return self.target_bpp is None or within(self.nbytes, self.target_bpp * pixels / 8)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write an ``.ii`` file, whole or not at all."""
        checks.path("path", path)
        container.write(path, _values(self), self.segments)

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, partial: bool = False) -> EncodedTake:
        """Read an ``.ii`` file of a take without decoding it.

        Parameters
        ----------
        partial : bool
            Keep the whole segments before the damage of a file that ends early or is damaged.

        Raises
        ------
        DamagedTake
            If it is truncated or damaged in a segment, without ``partial`` or in the first one.
        ValueError
            If the file is no coded take, or its header is damaged.
        OSError
            If it cannot be read.
        """
        checks.path("path", path)
        checks.flag("partial", partial)
        name = os.fspath(path)
        values, start = container.read_header(path)
        try:
            coded = _from_values(values)
            count = coded.plan.count(coded.frames)
        except (ValueError, TypeError, OverflowError, KeyError) as error:
            raise ValueError(f"{name} is damaged: {one_line(error)}") from None
        segments, wrong = container.read_segments(path, start, count)
        if not wrong:
            return replace(coded, segments=segments)
        there = min(len(segments) * (coded.plan.span or coded.frames), coded.frames)
        if partial and there:
            return replace(coded, segments=segments, frames=there)
        can = f"frames 0..{there - 1} can be decoded with partial=True (--partial)" if there else "no frame is whole"
        place = f"segment {min(len(segments) + 1, count)} of {count}"
        raise DamagedTake(f"{name} {wrong}, in {place}: {can}", len(segments))


def _values(coded: EncodedTake) -> list[Any]:
    """Return the values of the header: those of a picture, then frames, rate and plan."""
    plan = coded.plan
    return [*file_header.values(coded), coded.frames, coded.fps, plan.walk, plan.span, plan.group, plan.strip]


def _from_values(values: list[Any]) -> EncodedTake:
    if len(values) != 15:
        raise ValueError(f"its header has {len(values)} values: 15 are needed")
    frames, fps, walk, span, group, strip = values[9:]
    fields = file_header.fields(values[:9])
    blank = blank_picture(fields["structure"], fields["dtype"])
    whole("its number of frames", frames, 1, MAX_FRAMES)
    if not isinstance(fps, int | float) or not 0 < fps < math.inf:
        raise ValueError(f"its frame rate is {fps!r}: a number above 0 is needed")
    plan = Plan(walk=walk, span=span, group=group, strip=strip)
    segment_coder(fields["scheme"], blank, fields["options"], plan).check()
    known = {name: fields[name] for name in ("scheme", "options", "dtype", "target_bpp", "qp", "quality")}
    return EncodedTake(
        **known, structure=blank.structure_json(), frames=frames, fps=float(fps), plan=plan, segments=[]
    )


def encode_take(
    video: IIVideo,
    scheme: str,
    *,
    bpp: float | None = None,
    qp: int | None = None,
    plan: Plan | None = None,
    rate: str = "take",
    path: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
    **options: Value,
) -> EncodedTake:
    """Code an II-video by a pseudo video scheme, or by ``si-lf`` with references in time.

    Memory holds the frames of one segment.

    Parameters
    ----------
    video : IIVideo
    scheme : str
        A pseudo video scheme or ``si-lf``, with options after a colon, as for `encode`.
    bpp : float
        Target: bits of the file per pixel of all frames.
    qp : int
        Quantiser, in the scheme's range. Give neither ``bpp`` nor ``qp`` for lossless coding.
    plan : Plan, optional
        Order over view and time, and groups; the default plan if not given.
    rate : {"take", "segment"}
        "take" searches one quantiser for the whole take, and uses the next finer one in its first segments (constant
        quality). "segment" meets the target in each segment (constant rate).
    path : path, optional
        Write the ``.ii`` file here. Segments are kept in ``path.part`` until all are done, those of a search at each
        quantiser: after a killed run, the next call continues after the last whole segment.
    progress : callable, optional
        Called with the number of segments done and in all; a search codes all of them several times.
    **options
        Options of the scheme. ``gop`` follows from the plan.

    Returns
    -------
    EncodedTake

    Raises
    ------
    TypeError, ValueError
        If an argument is unknown or out of range, or the scheme codes no takes or not this one; before coding starts.
    OSError
        If a frame cannot be read, or the file cannot be written.
    """
    started = cpu_seconds()
    check_type("video", video, IIVideo, "an IIVideo")
    if plan is None:
        plan = Plan()
    check_type("plan", plan, Plan, "a Plan")
    if path is not None:
        checks.path("path", path)
    if progress is not None:
        checks.callable_("progress", progress)
    if not isinstance(rate, str) or rate not in RATES:
        raise ValueError(f"unknown rate {rate!r}: known are {', '.join(RATES)}")
    coder, settings = parse_scheme(scheme, **options)
    if settings.get("gop"):
        raise ValueError(f"gop is {settings['gop']}: the plan's span and group set the groups of a take")
    segment_coder(coder.name, video.structure, settings, plan)
    goal = checked_goal(coder, settings, bpp, qp, None)
    if goal.bpp is not None and rate == "take" and settings.get("rate") in ("cbr", "2pass"):
        settings = {**settings, "rate": "cq"}  # the take's own search is the rate control
    check_picture(coder, settings, video.structure)
    segments = segment_coder(coder.name, video.structure, settings, plan)
    segments.check()
    coded = EncodedTake(
        scheme=coder.name, options=settings, structure=video.structure.structure_json(),
        dtype=video.structure.pixels.dtype.name, frames=video.frames, fps=float(video.fps), plan=plan, segments=[],
        target_bpp=goal.bpp, qp=goal.qp,
    )  # fmt: skip
    kept = None if path is None else Unfinished(Path(os.fspath(path)), container.head(_values(coded)))
    work = _Work(video, segments, plan, coded, kept)
    if goal.bpp is not None and rate == "take":
        runs, times = work.search(goal.bpp, progress)
    else:
        runs, times = work.one_by_one(goal, progress), 1
    seconds = sum(run.codec_seconds for run in runs)
    coded = replace(coded, segments=[run.payload for run in runs], runs=times, codec_seconds=seconds)
    coded = replace(coded, encode_seconds=cpu_seconds() - started)
    if path is not None and kept is not None:
        coded.save(path)
        kept.remove()
    return coded


@dataclass(frozen=True, eq=False)
class _Work:
    """A take to be coded, segment by segment."""

    video: IIVideo
    coder: SegmentCoder
    plan: Plan
    coded: EncodedTake
    kept: Unfinished | None

    def segments(self) -> list[range]:
        """Instants of each segment."""
        return self.plan.segments(self.video.frames)

    def stack(self, part: range) -> NDArray[Any]:
        """Pictures of a segment, one below the other."""
        width, height = self.video.size
        pixels = np.empty((len(part) * height, width, 3), self.video.structure.pixels.dtype)
        for i, frame in enumerate(part):
            pixels[i * height : (i + 1) * height] = self.video[frame].pixels
        return pixels

    def run(self, number: int, part: range, settings: str, code: Callable[[NDArray[Any]], Run]) -> Run:
        """Code a segment; use the one of an earlier run if its pixels and settings are the same."""
        pixels = self.stack(part)
        return self.kept.run(number, pixels, settings, lambda: code(pixels)) if self.kept else code(pixels)

    def one_by_one(self, goal: Goal, progress: Progress | None) -> list[Run]:
        """Code every segment at the goal."""
        parts, runs = self.segments(), []
        if goal.bpp is not None:
            goal = Goal(bpp=max(goal.bpp - self.framing(len(parts)), goal.bpp / 2))

        def code(pixels: NDArray[Any]) -> Run:
            return self.coder.run(pixels, goal)

        for number, part in enumerate(parts):
            runs.append(self.run(number, part, "goal", code))
            if progress:
                progress(number + 1, len(parts))
        return runs

    def framing(self, segments: int) -> float:
        """Bits of header and framing per pixel of the take."""
        framed = replace(self.coded, segments=[b"\0" * 128] * segments).overhead  # payloads of two-byte lengths
        return 8 * framed / (self.video.frames * math.prod(self.video.size))

    def search(self, bpp: float, progress: Progress | None) -> tuple[list[Run], int]:
        """Meet a rate by one quantiser for all segments and the next finer one in the first segments."""
        parts = self.segments()
        pixels = self.video.frames * math.prod(self.video.size)
        target = max((bpp - self.framing(len(parts))) * pixels / 8, 1.0)
        done = 0

        def at(quantiser: float) -> list[Run]:
            nonlocal done
            runs = []
            for number, part in enumerate(parts):
                runs.append(
                    self.run(number, part, f"at {quantiser!r}", lambda pixels: self.coder.run_at(pixels, quantiser))
                )
                done += 1
                if progress:
                    progress(min(done, len(parts) * QUANTISER_RUNS - 1), len(parts) * QUANTISER_RUNS)
            return runs

        def miss(runs: list[Run]) -> float:
            return math.log2(sum(len(run.payload) for run in runs) / target)

        axis = self.axis()
        tried = list(trials(at, miss, axis))
        best = nearest(tried).result
        pair = bracket(tried, axis)
        if pair is not None:
            best = min((best, *_mixtures(pair)), key=lambda runs: abs(miss(runs)))
        if progress:
            progress(len(parts) * QUANTISER_RUNS, len(parts) * QUANTISER_RUNS)
        return best, len(tried)

    def axis(self) -> Axis:
        """Quantisers to search over the take."""
        return replace(self.coder.axis, runs=QUANTISER_RUNS)


def _mixtures(pair: tuple[Trial[list[Run]], Trial[list[Run]]]) -> Iterator[list[Run]]:
    """Return mixtures: the first segments at the finer quantiser, the others at the coarser one."""
    coarse, fine = (trial.result for trial in pair)
    for first in range(1, len(fine)):
        yield [*fine[:first], *coarse[first:]]


def open_take(
    coded: EncodedTake | str | os.PathLike[str], *, partial: bool = False, max_pixels: int = MAX_DECODED_PIXELS
) -> IIVideo:
    """II-video of a coded take, decoded when frames are used.

    A frame needs its segment, which is kept until another is used. A component image of the scheme's kind needs the
    frames of its group of pictures up to it (`IIVideo.component`).

    Parameters
    ----------
    coded : EncodedTake or path
    partial : bool
        As for `EncodedTake.load`.
    max_pixels : int
        Largest number of pixels of a segment.

    Raises
    ------
    TypeError, ValueError
        If ``coded`` is neither, the file is damaged, or a segment has more than ``max_pixels``.
    OSError
        If the file cannot be read.
    """
    check_type("coded", coded, (EncodedTake, str, os.PathLike), "a coded take or a path")
    checks.flag("partial", partial)
    name = "the coded take"
    if not isinstance(coded, EncodedTake):
        name, coded = os.fspath(coded), EncodedTake.load(coded, partial=partial)
    longest = min(coded.plan.span or coded.frames, coded.frames)
    pixels = longest * math.prod(coded.size)
    if pixels > whole("max_pixels", max_pixels, 1, 1 << 40):
        raise ValueError(
            f"{name} has segments of {pixels} pixels: at most {max_pixels} are decoded, "
            "raise max_pixels (--max-pixels)"
        )
    needed = coded.plan.count(coded.frames)
    if len(coded.segments) != needed:
        raise ValueError(f"{name} has {len(coded.segments)} segments: {needed} are needed for {coded.frames} frames")
    blank = blank_picture(coded.structure, coded.dtype)
    coder = segment_coder(coded.scheme, blank, coded.options, coded.plan)
    source = CodedFrames(coder, coded.plan, coded.segments, coded.frames, blank, name)
    return IIVideo(coded.frames, coded.fps, source, blank)


__all__ = ["DamagedTake", "EncodedTake", "Plan", "encode_take", "open_take"]
