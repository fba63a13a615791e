"""Pseudo video sequences coded by FFmpeg's encoders through PyAV."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from ..clock import OwnThreads, cpu_seconds
from ..contract import Option
from ..frames import Film
from ..progress import frames_done
from ..search import Run
from .decoding import missing_codec
from .pseudo_video import ORDER, Packets, PseudoVideo, Source

# Options of every FFmpeg encoder.
COMMON: dict[str, Option] = {
    **ORDER,
    "gop": Option(about="frames from I picture to I picture, 0 for only one", default=0, low=0, high=1 << 30),
}
THREADS = Option(about="threads of the encoder; the bytes depend on it", default=1, low=1, high=16)


def chroma(default: str) -> Option:
    """Return the option for chroma subsampling."""
    return Option(about="444 for full chroma, 420 for a quarter", default=default, choices=("444", "420"))


# The frame rate f in R = S·T·r·f (5.10) is free, since a pseudo video has no time. `fine_rate` sets f such that R is
# always about 10⁹ bit/s, of which whole kilobits are fine steps.
BIT_RATE = 1e9
MAX_FRAME_RATE = 10**8
MAX_KBIT = 2_000_000  # some encoders multiply by 1000 in 32 bits


def fine_rate(size: float, film: Film) -> tuple[int, int]:
    """Return kilobits per second and frame rate at which a sequence has ``size`` bytes."""
    frame_bits = 8 * size / film.frames
    frame_rate = round(min(max(BIT_RATE / frame_bits, 1), MAX_FRAME_RATE))
    return max(1, round(min(frame_bits * frame_rate / 1000, MAX_KBIT))), frame_rate


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of an FFmpeg encoder."""

    parameters: Mapping[str, str]
    frame_rate: int = 25
    bit_rate: int | None = None
    threads: int = 1


class Video(PseudoVideo[Settings]):
    """Pseudo video sequence by an FFmpeg encoder; ``encoder`` is its name in FFmpeg."""

    @property
    def missing(self) -> str:
        """Return the name of FFmpeg's encoder or decoder if PyAV lacks it."""
        return missing_codec(self.encoder) or super().missing

    def run_encoder(self, pixels: NDArray[Any], film: Film, settings: Settings) -> Packets:
        """Code the frames of a film once."""
        context = open_encoder(self, film, settings)
        threads = OwnThreads(context.open)
        frame = new_frame(film, context)
        # One frame object serves for all: encoders copy it before `encode` returns.
        views = [np.frombuffer(plane, film.format.dtype) for plane in frame.planes]
        size = np.dtype(film.format.dtype).itemsize
        planes = film.batch([plane.line_size // size for plane in frame.planes])
        packets: list[bytes] = []
        seconds, number = 0.0, 0
        for count in film.gathered(pixels, planes):
            started = cpu_seconds()
            for index in range(count):
                for view, plane in zip(views, planes, strict=True):
                    view[:] = plane[index].ravel()
                frame.pts = number
                number += 1
                packets.extend(map(bytes, context.encode(frame)))
            seconds += cpu_seconds() - started
            frames_done(number, film.frames)
        started = cpu_seconds()
        packets.extend(map(bytes, context.encode(None)))
        threads.end()
        seconds += cpu_seconds() - started
        packets[0] = self.trimmed(packets[0])
        first = bytes(context.extradata or b"") if self.framed else b""
        return Packets(packets=packets, first=first, seconds=seconds)

    def trimmed(self, packet: bytes) -> bytes:
        """Return the first packet without messages that no decoder needs."""
        return packet


def open_encoder(coder: Video, film: Film, settings: Settings, context: Any = None) -> Any:
    """Return the encoder, or the one given, ready for frames."""
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
    """Return an empty frame for an encoder."""
    frame: Any = av.VideoFrame(film.width, film.height, film.format.name)
    if film.format.chroma in ("444", "420"):
        frame.color_range = av.video.reformatter.ColorRange.JPEG
        frame.colorspace = av.video.reformatter.Colorspace.ITU709
    frame.time_base = context.time_base
    return frame


def two_passes(source: Source[Settings], kilobits: int, settings: Callable[[str], Settings]) -> Run:
    """Code in two passes of x264 or x265 at a bit rate; the result is the second stream and the time of both.

    ``settings`` returns the settings for a text of rate parameters.
    """
    with tempfile.TemporaryDirectory() as folder:
        rate = f"bitrate={kilobits}:stats={Path(folder) / 'statistics'}"
        passes = [source.run(settings(f"{rate}:pass={number}")) for number in (1, 2)]
    return Run(passes[1].payload, sum(run.codec_seconds for run in passes))


def with_zone(settings: Settings, key: str, frames: int, finer: str) -> Settings:
    """Return settings of x264 or x265 whose first frames form a zone of finer quantisation.

    ``key`` names the parameters of the library, ``finer`` is the rate parameter of the zone.
    """
    parameters = settings.parameters[key] + f":zones=0,{max(0, frames - 1)},{finer}"
    return replace(settings, parameters={**settings.parameters, key: parameters})


def finer_rate(fine: float, coarse: float) -> str:
    """Return the zone parameter for a rate factor finer by coarse − fine: 6 steps double the rate."""
    return f"b={2 ** ((coarse - fine) / 6):.4f}"
