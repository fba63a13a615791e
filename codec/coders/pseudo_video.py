"""Pseudo video sequences: component images as the frames of a video stream."""

from __future__ import annotations

import itertools
import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Generic, TypeVar

import av
import numpy as np
from numpy.typing import NDArray

from ii_core import IIPicture

from ..bitstream import framing
from ..clock import cpu_seconds
from ..colour import Format, ycbcr
from ..contract import Coder, Goal, Option, Options, Pixels
from ..frames import Film, layout
from ..order import BY, ORDERS, selection_order
from ..progress import frames_done
from ..search import TOLERANCE, Axis, CodingResult, Run, Trial, bracket, met, nearest, size_miss, trials
from . import groups
from .decoding import copy_plane, decoded_frames, missing_codec

NAMES = {"ei": "Elementary images", "si": "Sub-images", "ri": "Ray-space images"}

ORDER: dict[str, Option] = {
    "order": Option(about="of the component images", default="parallel", choices=tuple(ORDERS)),
    "by": Option(about="whether the order goes by rows or by columns", default="rows", choices=BY),
}
DEPTH = Option(about="bits of a sample inside the coder", default="10", choices=("8", "10"))

ERROR_ROWS = 256  # rows of pixels compared at once
LEAST_ERROR = 1e-9  # of lossless runs, instead of 0
MAX_TARGET = 1e18  # bytes; upper cap on the target size
# Budgets of encoder runs: for the quantiser, and for the share of frames coded finer.
QUANTISER_RUNS, SHARE_RUNS = 8, 4
# From this target on a lossless finest quantiser is tried first. Where it meets the target, quantisers above it take
# more bytes for a worse picture.
NEARLY_LOSSLESS_BPP = 2.0
LOSS_DB = 0.2  # largest loss of other runs below the line between two quantisers
START = 0.6  # first trial of a search, as a share of the range of quantisers from the finest on

Settings = TypeVar("Settings")


@dataclass(frozen=True, kw_only=True)
class Packets:
    """Packets of one run of an encoder.

    ``first`` is what a decoder needs before them, ``seconds`` the CPU time inside the encoder.
    """

    packets: list[bytes]
    first: bytes = b""
    seconds: float


@dataclass(frozen=True, kw_only=True)
class Source(Generic[Settings]):
    """A picture as frames, coded by one run of an encoder after another."""

    coder: PseudoVideo[Settings]
    pixels: NDArray[Any]
    film: Film
    options: Options

    def run(self, settings: Settings) -> Run:
        """Code all frames with the same settings."""
        return self.run_parts([(self.film, settings)])

    def run_at(self, quantiser: float) -> Run:
        """Code all frames at a quantiser."""
        return self.run(self.coder.constant(quantiser, self.film, self.options))

    def run_parts(self, parts: list[tuple[Film, Settings]]) -> Run:
        """Code sequences that follow one another, each with its own settings."""
        runs = [self.coder.run_encoder(self.pixels, film, settings) for film, settings in parts]
        packets = [packet for run in runs for packet in run.packets]
        payload = framing.pack(runs[0].first, packets) if self.coder.framed else b"".join(packets)
        return Run(payload, sum(run.seconds for run in runs))

    def error(self, run: Run) -> float:
        """Return the mean squared error of a run, decoded."""
        pixels, _ = self.coder.decode_film(run.payload, self.film, self.pixels)
        blocks = range(0, len(pixels), ERROR_ROWS)
        sums = (
            np.sum((pixels[i : i + ERROR_ROWS].astype(np.float64) - self.pixels[i : i + ERROR_ROWS]) ** 2)
            for i in blocks
        )
        return float(sum(sums)) / pixels.size

    def on_curve(self, run: Run, coarse: Run, fine: Run) -> bool:
        """Whether a run is as good as the coarser of two quantisers, and near the line between both (`LOSS_DB`).

        A run that is longer than the finer quantiser's is worse: that quantiser is better for fewer bytes.
        """
        sizes = [math.log(len(each.payload)) for each in (coarse, run, fine)]
        if not sizes[1] < sizes[2]:
            return False
        share = max(0.0, (sizes[1] - sizes[0]) / (sizes[2] - sizes[0]))
        low, found, high = (-10 * math.log10(max(self.error(each), LEAST_ERROR)) for each in (coarse, run, fine))
        return found >= max(low, low + share * (high - low) - LOSS_DB)


class PseudoVideo(Coder, Generic[Settings]):
    """Component images of one kind as a pseudo video sequence.

    A subclass sets the attributes and implements `constant` and `run_encoder`. ``Settings`` is its type of encoder
    settings.

    Attributes
    ----------
    standard : str
        Standard of the stream.
    encoder : str
        Name of the encoder library.
    decoder : str
        FFmpeg's name of the decoder.
    framed : bool
        Whether the payload needs a table of packets (`codec.bitstream.framing`); else it is the stream itself.
    min_side, max_side, min_width : int
        Limits of a frame in pixels. Smaller frames are padded, or transposed if that suffices.
    min_coded_frame : int
        Least bytes of a coded frame in any such stream. Shorter streams are refused before memory is taken.
    min_frame_bytes : int
        Least bytes of a frame that the encoder writes. Lower rates are not searched.
    octave : float
        Quantiser steps that about halve the rate.
    finest_lossless : bool
        Whether the finest quantiser codes YCbCr lossless.
    quantiser_step : float
        Finest step of the quantiser; see `step`.
    relabel : str
        FFmpeg bitstream filter that writes the colour matrix of the frames, for streams that name another one.

    References
    ----------
    Olsson 2008, §5.5.1 (5.1), §5.5.3 (5.8)–(5.10), §5.7.
    """

    standard: ClassVar[str]
    encoder: ClassVar[str]
    decoder: ClassVar[str]
    framed: ClassVar[bool] = False
    min_side: ClassVar[int] = 1
    min_width: ClassVar[int] = 1
    max_side: ClassVar[int] = 16384
    min_coded_frame: ClassVar[int] = 1
    min_frame_bytes: ClassVar[int] = 1
    octave: ClassVar[float] = 6.0
    finest_lossless: ClassVar[bool] = False
    quantiser_step: ClassVar[float] = 1.0
    relabel: ClassVar[str] = ""
    presets: ClassVar[Mapping[str, Options]] = {}
    components_alone: ClassVar[bool] = True

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self.name = f"{kind}-{type(self).__name__.lower()}"
        self.about = f"{NAMES[kind]} as a pseudo video sequence, {self.standard} by {self.encoder}"

    @property
    def missing(self) -> str:
        """Return the name of FFmpeg's decoder if PyAV lacks it: target rates need it, too."""
        return missing_codec(self.decoder)

    @property
    def versions(self) -> dict[str, str]:
        """Return the versions of PyAV and its libavcodec."""
        return {"av": av.__version__, "libavcodec": ".".join(map(str, av.library_versions["libavcodec"]))}

    @abstractmethod
    def constant(self, quantiser: float, film: Film, options: Options) -> Settings:
        """Return the settings for a quantiser, on the coder's own scale."""

    @abstractmethod
    def run_encoder(self, pixels: NDArray[Any], film: Film, settings: Settings) -> Packets:
        """Code the frames of a film once."""

    def step(self, options: Options) -> float:
        """Return the distance of neighbouring quantisers."""
        return self.quantiser_step

    def meet(self, target: float, source: Source[Settings]) -> CodingResult:
        """Meet a target size in bytes: by the quantiser, unless a subclass has a better way."""
        return self.between(self.quantisers(target, source), target, source)

    def quantisers(self, target: float, source: Source[Settings]) -> list[Trial[Run]]:
        """Return trials of quantisers that approach a target."""
        return list(trials(source.run_at, lambda run: size_miss(run, target), self.axis(source.options)))

    def axis(self, options: Options) -> Axis:
        """Return the quantisers to search."""
        assert self.qp_range is not None
        low, high = self.qp_range
        return Axis(
            low=low,
            high=high,
            start=low + START * (high - low),
            octave=-self.octave,
            step=self.step(options),
            overshoot=0.0,
            runs=QUANTISER_RUNS,
        )

    def between(self, tried: list[Trial[Run]], target: float, source: Source[Settings]) -> CodingResult:
        """Meet a target between two quantisers: the first frames take the finer one, the rest the coarser one."""
        pair = self.pair(tried, source)
        if pair is None or self.mixed(pair[1].setting, pair[0].setting, 1, source.film, source.options) is None:
            return CodingResult(run=nearest(tried).result, runs=len(tried))
        mixes = self.mixes(*pair, target, source)
        return CodingResult(run=self.kept(tried, mixes, target, source), runs=len(tried) + len(mixes))

    def pair(self, tried: list[Trial[Run]], source: Source[Settings]) -> tuple[Trial[Run], Trial[Run]] | None:
        """Return the coarser and finer quantiser around a target; None if there are none or one meets it."""
        pair = bracket(tried, self.axis(source.options))
        return None if met(nearest(tried).miss) or pair is None or pair[1].setting > pair[0].setting else pair

    def kept(self, tried: list[Trial[Run]], others: list[Run], target: float, source: Source[Settings]) -> Run:
        """Return the run nearest to a target, of the quantisers and of other runs that are `Source.on_curve`."""
        best, pair = nearest(tried), self.pair(tried, source)
        assert pair is not None  # other runs are between two quantisers
        ends = pair[0].result, pair[1].result
        for run in sorted(others, key=lambda run: abs(size_miss(run, target))):
            if abs(size_miss(run, target)) >= abs(best.miss):
                break
            if run in ends or source.on_curve(run, *ends):
                return run
        return best.result

    def mixes(self, coarse: Trial[Run], fine: Trial[Run], target: float, source: Source[Settings]) -> list[Run]:
        """Return runs that approach a target by the share of frames that take the finer of two quantisers."""

        def at_share(share: float) -> Run:
            frames = round(share * source.film.frames)
            parts = self.mixed(fine.setting, coarse.setting, frames, source.film, source.options)
            assert parts is not None
            return source.run_parts(parts)

        axis = Axis(low=0.0, high=1.0, start=0.5, octave=1.0, runs=SHARE_RUNS)
        ends = [Trial(0.0, coarse.miss, coarse.result), Trial(1.0, fine.miss, fine.result)]
        made = []
        for trial in trials(at_share, lambda run: size_miss(run, target), axis, known=ends):
            made.append(trial.result)
            if trial.miss >= fine.miss:  # one more I picture costs more than the finer quantiser
                break
        return made

    def mixed(
        self, fine: float, coarse: float, frames: int, film: Film, options: Options
    ) -> list[tuple[Film, Settings]] | None:
        """Return sequences with one quantiser in the first frames and another in the rest; None if impossible."""
        return None

    def two_sequences(
        self, fine: float, coarse: float, frames: int, film: Film, options: Options
    ) -> list[tuple[Film, Settings]]:
        """Return two sequences one after the other, for `mixed`; they cost one more I picture."""
        parts = [(replace(film, stop=frames), fine), (replace(film, start=frames), coarse)]
        return [(part, self.constant(quantiser, part, options)) for part, quantiser in parts if part.frames]

    def format(self, options: Options, dtype: str) -> Format:
        """Return the colour format of frames for a pixel type."""
        return ycbcr(str(options.get("chroma", "420")), int(options.get("depth", 8)))

    def film(self, picture: IIPicture, options: Options) -> Film:
        """Return the frames of a picture, at the size that the encoder needs."""
        shape = layout(picture.lenses, picture.ei_pixels, self.kind)
        form = self.format(options, picture.pixels.dtype.name)
        if shape.width < self.min_width <= shape.height:  # transposed frames need no padding
            shape = shape.transposed()
        even = 2 if form.chroma == "420" else 1
        sides = max(shape.width, self.min_width, self.min_side), max(shape.height, self.min_side)
        width, height = (-(-side // even) * even for side in sides)
        by, order = str(options["by"]), str(options["order"])
        return Film(layout=shape, order=order, by=by, format=form, width=width, height=height)

    def check(self, picture: IIPicture, options: Options) -> None:
        """Refuse frames larger than the encoder takes."""
        film = self.film(picture, options)
        if max(film.width, film.height) > self.max_side:
            raise ValueError(
                f"frames of scheme {self.name} would have {film.width}×{film.height} pixels: "
                f"at most {self.max_side}×{self.max_side} are allowed"
            )

    def encode(self, picture: IIPicture, options: Options, goal: Goal) -> CodingResult:
        """Write one stream with its parameter sets in band."""
        return self.encode_film(np.ascontiguousarray(picture.pixels), self.film(picture, options), options, goal)

    def encode_film(self, pixels: NDArray[Any], film: Film, options: Options, goal: Goal) -> CodingResult:
        """Code the frames of a film over pixels (N, M, 3), at a rate per pixel or a quantiser."""
        source = Source(coder=self, pixels=pixels, film=film, options=options)
        if goal.bpp is None:
            return CodingResult(run=source.run_at(goal.qp or 0))
        target = min(goal.bpp * pixels.shape[0] * pixels.shape[1] / 8, MAX_TARGET)
        if target < self.min_frame_bytes * film.frames:  # headers alone exceed it
            assert self.qp_range is not None
            return CodingResult(run=source.run_at(self.qp_range[1]))
        near = self.finest_lossless and goal.bpp >= NEARLY_LOSSLESS_BPP
        if near and len((finest := source.run_at(0)).payload) <= (1 + TOLERANCE) * target:
            return CodingResult(run=finest)
        found = self.meet(target, source)
        return CodingResult(run=found.run, runs=found.runs + near)

    def decode(self, payload: bytes, blank: IIPicture, options: Options) -> tuple[Pixels, float]:
        """Decode frame by frame, at most one batch in memory."""
        return self.decode_film(payload, self.film(blank, options), blank.pixels)

    def decode_film(self, payload: bytes, film: Film, blank: NDArray[Any]) -> tuple[Pixels, float]:
        """Decode the frames of a film into pixels of the shape and type of ``blank``; errors as `decode`."""
        try:
            return _decode(self, payload, film, blank)
        except av.FFmpegError as error:
            raise ValueError(f"its {self.standard} stream does not decode ({error.strerror})") from None

    def frame_order(self, rows: int, cols: int, options: Options) -> NDArray[np.int64]:
        """Return the order that the options name."""
        return selection_order(str(options["order"]), rows, cols, str(options["by"]))

    def decode_component(self, payload: bytes, blank: IIPicture, options: Options, index: int) -> Pixels:
        """Decode the frame of a component image from the packets of its group of pictures."""
        film = self.film(blank, options)
        stream = groups.sequence(self, payload, film, options)
        (number,) = np.flatnonzero(self.frame_order(film.layout.rows, film.layout.cols, options) == index)
        return groups.decode_frame(stream, int(number), blank.pixels.dtype)


def _decode(coder: PseudoVideo[Any], payload: bytes, film: Film, blank: NDArray[Any]) -> tuple[Pixels, float]:
    if len(payload) < coder.min_coded_frame * film.frames:  # before memory is taken for the sequence
        raise ValueError(f"its {coder.standard} stream of {len(payload)} bytes cannot hold {film.frames} frames")
    frames = decoded_frames(coder, payload, film)
    started = cpu_seconds()
    first = next(frames, None)
    seconds, done = cpu_seconds() - started, 0
    if first is None:
        raise ValueError(f"its {coder.standard} stream holds no frames")
    # A first frame of the right size has decoded: take memory for the others.
    frames, origins, planes = itertools.chain([first], frames), film.origins(), film.batch()
    pixels = np.empty((0, 0, 3), blank.dtype)
    while True:
        started = cpu_seconds()
        batch = list(itertools.islice(frames, len(planes[0])))
        seconds += cpu_seconds() - started
        if not batch:
            break
        if done == 0:
            pixels = np.empty(blank.shape, blank.dtype)
        if done + len(batch) > film.frames:
            raise ValueError(f"its {coder.standard} stream has more than {film.frames} frames")
        for index, frame in enumerate(batch):
            for plane, target in zip(frame.planes, planes, strict=True):
                copy_plane(plane, target[index])
        film.scatter(planes, origins[done : done + len(batch)], pixels)
        done += len(batch)
        frames_done(done, film.frames)
    if done < film.frames:
        raise ValueError(f"its {coder.standard} stream has {done} frames, {film.frames} are needed")
    return pixels, seconds
