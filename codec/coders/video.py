"""Pseudo video sequences: component images as the frames of a stream, by FFmpeg's coders through PyAV.

Here is what all have in common. A coder of its own file says which encoder and decoder, what it may be asked, and
which parameters make that.
"""

from __future__ import annotations

import itertools
from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, ClassVar

import av
import numpy as np
from numpy.typing import NDArray

from ii_core import IIPicture

from ..bitstream import framing
from ..bitstream.obu import temporal_units
from ..colour import Format, ycbcr
from ..contract import Coder, Coding, Goal, Option, Options, Pixels
from ..frames import Film, layout
from ..order import BY, ORDERS
from ..rate import Run, nearest, nearest_quantiser, nearest_share, straddling, within
from .clock import OwnThreads, cpu_seconds

NAMES = {"ei": "Elementary images", "si": "Sub-images", "ri": "Ray-space images"}

# What every pseudo video sequence may be asked.
COMMON: dict[str, Option] = {
    "order": Option(about="of the component images", default="parallel", choices=tuple(ORDERS)),
    "by": Option(about="whether the order goes by rows or by columns", default="rows", choices=BY),
    "gop": Option(about="frames from I picture to I picture, 0 for only one", default=0, low=0, high=1 << 30),
}
DEPTH = Option(about="bits of a sample inside the coder", default="10", choices=("8", "10"))
THREADS = Option(about="threads of the encoder; the bytes depend on it", default=1, low=1, high=16)


def chroma(default: str) -> Option:
    """The option for chroma subsampling."""
    return Option(about="444 keeps all of the colour, 420 a quarter", default=default, choices=("444", "420"))


FAR_TOO_MUCH = 1e18  # bytes; more than that is as well asked for by that
CHUNK = 1 << 16  # bytes of a stream parsed at once

# Time means nothing in a pseudo video, so that the frame rate f in R = S·T·r·f (5.10) is free. For the encoders that
# take any, it is set so that R is always the same large number, of which whole kilobits are fine steps.
BIT_RATE = 1e9
MAX_FRAME_RATE = 10**8
MAX_KBIT = 2_000_000  # some multiply by 1000 in 32 bits


def fine_rate(size: float, film: Film) -> tuple[int, int]:
    """The kilobits a second and the frame rate at which a sequence has ``size`` bytes."""
    frame_bits = 8 * size / film.frames
    frame_rate = round(min(max(BIT_RATE / frame_bits, 1), MAX_FRAME_RATE))
    return max(1, round(min(frame_bits * frame_rate / 1000, MAX_KBIT))), frame_rate


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of an encoder. Frames from ``frames`` on are a sequence of their own with ``then``, if it is given."""

    parameters: Mapping[str, str]
    frame_rate: int = 25
    bit_rate: int | None = None
    threads: int = 1
    frames: int = 0
    then: Settings | None = None


class Video(Coder):
    """Component images of one kind as a pseudo video sequence.

    A coder states the attributes and writes `constant`.

    Attributes
    ----------
    standard : str
        What the stream is.
    encoder, decoder : str
        FFmpeg's names.
    framed : bool
        Whether the payload needs a table of packets, see `codec.bitstream.framing`; else it is the stream as it is.
    min_side, max_side, min_width : int
        Of a frame. Smaller ones are filled up, or turned on their side if that is enough.
    min_coded_frame : int
        Bytes below which no frame of such a stream can be; guards the decoder.
    min_frame_bytes : int
        Bytes below which the encoder writes none; spares the search for lower rates.
    octave : float
        Quantiser steps that about halve the rate; where the search starts from.
    quantiser_step : float
        Finest step of the quantiser, where `step` says nothing else.
    relabel : str
        FFmpeg's bitstream filter for files of other programs, where the stream names other colours than it holds.

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
    quantiser_step: ClassVar[float] = 1.0
    relabel: ClassVar[str] = ""

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self.name = f"{kind}-{type(self).__name__.lower()}"
        self.about = f"{NAMES[kind]} as a pseudo video sequence, {self.standard} by {self.encoder}"

    @property
    def versions(self) -> dict[str, str]:
        """PyAV and the libavcodec in it."""
        return {"av": av.__version__, "libavcodec": ".".join(map(str, av.library_versions["libavcodec"]))}

    @abstractmethod
    def constant(self, quantiser: float, film: Film, options: Options) -> Settings:
        """The settings for a quantiser, on the coder's own scale."""

    def step(self, options: Options) -> float:
        """Between quantisers that differ."""
        return self.quantiser_step

    def meet(self, target: float, film: Film, options: Options, run: Callable[[Settings], Run]) -> tuple[Run, int]:
        """The run whose bytes come nearest to a target, and how many runs there were: by the quantiser, if not
        otherwise."""
        assert self.qp_range is not None
        low, high = self.qp_range
        runs = nearest_quantiser(
            lambda quantiser: run(self.constant(quantiser, film, options)),
            target,
            low=low,
            high=high,
            step=self.step(options),
            octave=self.octave,
        )
        return self.between(runs, target, film, options, run)

    def between(
        self,
        runs: dict[float, Run],
        target: float,
        film: Film,
        options: Options,
        run: Callable[[Settings], Run],
    ) -> tuple[Run, int]:
        """What lies between the quantisers tried, where the target is missed by all: the finer for the first
        frames, the coarser for the rest."""
        best, pair = nearest(runs.values(), target), straddling(runs, target)
        if within(len(best.payload), target) or pair is None or self.mixed(*pair, 1, film, options) is None:
            return best, len(runs)
        fine, coarse = pair

        def at_share(share: float) -> Run:
            settings = self.mixed(fine, coarse, round(share * film.frames), film, options)
            assert settings is not None
            return run(settings)

        more = nearest_share(at_share, target, none=runs[coarse], all_=runs[fine])
        return nearest([best, *more], target), len(runs) + len(more)

    def mixed(self, fine: float, coarse: float, frames: int, film: Film, options: Options) -> Settings | None:
        """The settings for one quantiser in the first frames and another in the rest, if there are such."""
        return None

    def format(self, options: Options, dtype: str) -> Format:
        """How frames hold the colours of pixels of this type."""
        return ycbcr(str(options.get("chroma", "420")), int(options.get("depth", 8)))

    def film(self, picture: IIPicture, options: Options) -> Film:
        """The frames of a picture, each as large as the coder needs it."""
        shape = layout(picture.lenses, picture.ei_pixels, self.kind)
        form = self.format(options, picture.pixels.dtype.name)
        if shape.width < self.min_width <= shape.height:  # on their side they need no filling up
            shape = shape.transposed()
        even = 2 if form.chroma == "420" else 1
        sides = max(shape.width, self.min_width, self.min_side), max(shape.height, self.min_side)
        width, height = (-(-side // even) * even for side in sides)
        by, order = str(options["by"]), str(options["order"])
        return Film(layout=shape, order=order, by=by, format=form, width=width, height=height)

    def check(self, picture: IIPicture, options: Options) -> None:
        """Frames must not be larger than the encoder takes."""
        film = self.film(picture, options)
        if max(film.width, film.height) > self.max_side:
            raise ValueError(
                f"frames of scheme {self.name} would have {film.width}×{film.height} pixels: "
                f"at most {self.max_side}×{self.max_side} are allowed"
            )

    def encode(self, picture: IIPicture, options: Options, goal: Goal) -> Coding:
        """A stream, parameter sets in band."""
        pixels, film = np.ascontiguousarray(picture.pixels), self.film(picture, options)

        def run(settings: Settings) -> Run:
            packets, first, seconds = encoded(self, pixels, film, settings)
            return Run(framing.pack(first, packets) if self.framed else b"".join(packets), seconds)

        if goal.bpp is None:
            return Coding(run=run(self.constant(goal.qp or 0, film, options)))
        target = min(goal.bpp * picture.size[0] * picture.size[1] / 8, FAR_TOO_MUCH)
        if target < self.min_frame_bytes * film.frames:  # no need to ask for what headers alone exceed
            assert self.qp_range is not None
            return Coding(run=run(self.constant(self.qp_range[1], film, options)))
        found, runs = self.meet(target, film, options, run)
        return Coding(run=found, runs=runs)

    def decode(self, payload: bytes, blank: IIPicture, options: Options) -> tuple[Pixels, float]:
        """Frame by frame, never more of them than a batch."""
        try:
            return _decode(self, payload, self.film(blank, options), blank.pixels)
        except av.FFmpegError as error:
            raise ValueError(f"its {self.standard} stream does not decode ({error.strerror})") from None

    def trimmed(self, packet: bytes) -> bytes:
        """The first packet without messages that no decoder needs."""
        return packet


def open_encoder(coder: Video, film: Film, settings: Settings, context: Any = None) -> Any:
    """The encoder, or the one given, ready for frames."""
    context = context or av.CodecContext.create(coder.encoder, "w")
    context.width, context.height, context.pix_fmt = film.width, film.height, film.format.name
    if film.format.chroma in ("444", "420"):
        context.color_range = av.video.reformatter.ColorRange.JPEG
        context.colorspace = av.video.reformatter.Colorspace.ITU709
    context.framerate, context.time_base = Fraction(settings.frame_rate), Fraction(1, settings.frame_rate)
    context.thread_count = settings.threads
    if settings.bit_rate is not None:
        context.bit_rate = settings.bit_rate
    context.options = dict(settings.parameters)
    return context


def new_frame(film: Film, context: Any) -> Any:
    """An empty frame for an encoder."""
    frame: Any = av.VideoFrame(film.width, film.height, film.format.name)
    if film.format.chroma in ("444", "420"):
        frame.color_range = av.video.reformatter.ColorRange.JPEG
        frame.colorspace = av.video.reformatter.Colorspace.ITU709
    frame.time_base = context.time_base
    return frame


def encoded(coder: Video, pixels: NDArray[Any], film: Film, settings: Settings) -> tuple[list[bytes], bytes, float]:
    """One run of an encoder over all frames: its packets, what a decoder needs before them, CPU seconds inside it."""
    if settings.then is not None:
        start, end = replace(film, stop=settings.frames), replace(film, start=settings.frames)
        packets, first, seconds = encoded(coder, pixels, start, replace(settings, then=None))
        more, _, longer = encoded(coder, pixels, end, settings.then)
        return packets + more, first, seconds + longer
    context = open_encoder(coder, film, settings)
    threads = OwnThreads(context.open)
    frame = new_frame(film, context)
    # Encoders copy a frame before `encode` returns, so that one serves for all.
    views = [np.frombuffer(plane, film.format.dtype) for plane in frame.planes]
    size = np.dtype(film.format.dtype).itemsize
    planes = film.batch([plane.line_size // size for plane in frame.planes])
    chunks: list[bytes] = []
    seconds, number = 0.0, 0
    for count in film.gathered(pixels, planes):
        started = cpu_seconds()
        for index in range(count):
            for view, plane in zip(views, planes, strict=True):
                view[:] = plane[index].ravel()
            frame.pts = number
            number += 1
            chunks.extend(map(bytes, context.encode(frame)))
        seconds += cpu_seconds() - started
    started = cpu_seconds()
    chunks.extend(map(bytes, context.encode(None)))
    threads.end()
    seconds += cpu_seconds() - started
    chunks[0] = coder.trimmed(chunks[0])
    return chunks, bytes(context.extradata or b"") if coder.framed else b"", seconds


def _decode(coder: Video, payload: bytes, film: Film, blank: NDArray[Any]) -> tuple[Pixels, float]:
    if len(payload) < coder.min_coded_frame * film.frames:  # before anything as long as the sequence is laid out
        raise ValueError(f"its {coder.standard} stream of {len(payload)} bytes cannot hold {film.frames} frames")
    frames = decoded_frames(coder, payload, film)
    started = cpu_seconds()
    first = next(frames, None)
    seconds, done = cpu_seconds() - started, 0
    if first is None:
        raise ValueError(f"its {coder.standard} stream holds no frames")
    # Only now that a frame of that size is there is memory taken for more of them.
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
    if done < film.frames:
        raise ValueError(f"its {coder.standard} stream has {done} frames, {film.frames} are needed")
    return pixels, seconds


def decoder_of(coder: Video, film: Film) -> Any:
    """The decoder, ready for packets."""
    context: Any = av.CodecContext.create(coder.decoder, "r")
    context.thread_count = 1
    # A stream of larger frames is refused before they take memory. The decoder counts what it would allocate: whole
    # blocks, rows padded for its vector instructions.
    coded = (-(-film.width // 128) * 128) * (-(-film.height // 128) * 128)
    context.options = {"max_pixels": str(coded), "err_detect": "explode"}
    if coder.framed:  # nothing in the packets says it
        context.width, context.height = film.width, film.height
    return context


def decoded_frames(coder: Video, payload: bytes, film: Film) -> Iterator[Any]:
    """The frames of a stream in display order, each checked for its size."""
    context = decoder_of(coder, film)
    for packet in _packets(coder, context, payload, film):
        yield from _checked(coder, context.decode(packet), film)
    yield from _checked(coder, context.decode(None), film)


def _packets(coder: Video, context: Any, payload: bytes, film: Film) -> Iterator[Any]:
    if coder.decoder == "libdav1d":
        for unit in temporal_units(payload):
            yield av.Packet(bytes(unit))
        return
    if coder.framed:
        first, packets = framing.unpack(payload, film.frames)
        if first:
            context.extradata = first
        for packet in packets:
            yield av.Packet(bytes(packet))
        return
    view = memoryview(payload)
    for start in range(0, len(view), CHUNK):
        yield from context.parse(view[start : start + CHUNK])
    yield from context.parse(None)


def _checked(coder: Video, frames: list[Any], film: Film) -> list[Any]:
    needed = film.width, film.height, film.format.name
    for frame in frames:
        found = frame.width, frame.height, frame.format.name.replace("yuvj", "yuv")
        if found != needed:
            raise ValueError(f"its {coder.standard} stream has frames of {found}, {needed} needed")
    return frames


def copy_plane(plane: Any, target: NDArray[Any]) -> None:
    """The samples of a decoded plane, without the padding of its lines."""
    target[:] = np.ndarray(target.shape, target.dtype, plane, strides=(plane.line_size, target.itemsize))
