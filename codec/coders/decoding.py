"""Decoding of pseudo video sequences frame by frame, by FFmpeg's decoders through PyAV."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Protocol

import av
import numpy as np
from numpy.typing import NDArray

from ii_core.base.extras import NotInstalled

from ..bitstream import framing
from ..bitstream.framing import temporal_units
from ..frames import Film

CHUNK = 1 << 16  # bytes of a stream parsed at once


class Stream(Protocol):
    """Kind of a coded sequence; `codec.coders.pseudo_video.PseudoVideo` explains the attributes."""

    @property
    def standard(self) -> str: ...
    @property
    def decoder(self) -> str: ...
    @property
    def framed(self) -> bool: ...


def missing_codec(name: str) -> str:
    """Return FFmpeg's name of a codec and the library that lacks it, if it does; else an empty text."""
    return "" if name in av.codecs_available else f"{name} in PyAV {av.__version__}"


def open_decoder(coder: Stream, film: Film) -> Any:
    """Return the decoder, ready for packets.

    Raises
    ------
    NotInstalled
        If PyAV lacks it.
    """
    if missing := missing_codec(coder.decoder):
        raise NotInstalled(f"decoding of {coder.standard} needs {missing}, which is not installed")
    context: Any = av.CodecContext.create(coder.decoder, "r")
    context.thread_count = 1
    # Refuse larger frames before they take memory. The decoder counts what it allocates: whole blocks, and rows
    # padded for vector instructions.
    coded = (-(-film.width // 128) * 128) * (-(-film.height // 128) * 128)
    context.options = {"max_pixels": str(coded), "err_detect": "explode"}
    if coder.framed:  # the packets do not carry the size
        context.width, context.height = film.width, film.height
    return context


def decoded_frames(coder: Stream, payload: bytes, film: Film) -> Iterator[Any]:
    """Yield the frames of a stream in display order, each checked for its size."""
    context = open_decoder(coder, film)
    for packet in stream_packets(coder, context, payload, film):
        yield from _checked(coder, context.decode(packet), film)
    yield from _checked(coder, context.decode(None), film)


def stream_packets(coder: Stream, context: Any, payload: bytes, film: Film) -> Iterator[Any]:
    """Yield the packets of a payload for a decoder."""
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


def _checked(coder: Stream, frames: list[Any], film: Film) -> list[Any]:
    needed = film.width, film.height, film.format.name
    for frame in frames:
        found = frame.width, frame.height, frame.format.name.replace("yuvj", "yuv")
        if found != needed:
            raise ValueError(f"its {coder.standard} stream has frames of {found}, {needed} needed")
    return frames


def copy_plane(plane: Any, target: NDArray[Any]) -> None:
    """Copy the samples of a decoded plane without the padding of its lines."""
    target[:] = np.ndarray(target.shape, target.dtype, plane, strides=(plane.line_size, target.itemsize))
