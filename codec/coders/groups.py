"""Packets of a coded pseudo video sequence, its groups of pictures, and single frames decoded from their group.

A stream coded with ``gop=`` has an I picture every so many frames. The starts of groups are read from the stream.
"""

from __future__ import annotations

import io
import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import av
import numpy as np

from ..bitstream import framing
from ..bitstream.framing import temporal_units
from ..contract import MAX_DECODED_PIXELS, Options, Pixels
from ..frames import Film
from .decoding import Stream, copy_plane, decoded_frames

OBU_SEQUENCE_HEADER = 1
DEMUXERS = {"H.264": "h264", "HEVC": "hevc", "MPEG-2": "mpegvideo"}


@dataclass(frozen=True)
class Packet:
    """The bytes of one frame, and whether decoding can start there."""

    data: bytes
    key: bool


@dataclass(frozen=True, kw_only=True)
class Sequence:
    """Packets of a coded pseudo video sequence.

    Parameters
    ----------
    coder : Stream
        A `PseudoVideo`.
    film : Film
        The frames of the whole picture.
    options : mapping
        All options of the scheme.
    first : bytes
        Input of the decoder before the packets.
    packets : list of Packet
        One per frame, in the order of the stream.
    """

    coder: Any
    film: Film
    options: Options
    first: bytes
    packets: list[Packet]

    def group(self, index: int) -> tuple[int, int]:
        """Return the range of frames from the start of a frame's group to the start of the next group."""
        starts = [i for i, packet in enumerate(self.packets) if packet.key]
        after = int(np.searchsorted(starts, index, side="right"))
        if not starts or starts[0] != 0:
            raise ValueError("its first picture refers to another")
        return starts[after - 1], starts[after] if after < len(starts) else len(self.packets)


def sequence(coder: Stream, payload: bytes, film: Film, options: Options) -> Sequence:
    """Return the packets of a payload.

    Parameters
    ----------
    coder : Stream
    payload : bytes
    film : Film
    options : mapping
        ``gop`` gives the starts of groups where packets do not (FFV1).

    Raises
    ------
    ValueError
        If the payload does not hold one packet per frame, or frames are larger than can be decoded alone.
    """
    if film.width * film.height > MAX_DECODED_PIXELS:
        raise ValueError(
            f"its frames have {film.width}×{film.height} pixels: at most {MAX_DECODED_PIXELS} are decoded alone"
        )
    first = b""
    try:
        if coder.framed:
            first, parts = framing.unpack(payload, film.frames)
            key = _KEYS.get(coder.standard) or _by_gop(int(options["gop"]))
            packets = [Packet(bytes(part), key(i, part)) for i, part in enumerate(parts)]
        elif coder.standard == "AV1":
            packets = [Packet(bytes(unit), _has_sequence_header(unit)) for unit in temporal_units(payload)]
        else:
            packets = _demuxed(payload, DEMUXERS[coder.standard])
    except (ValueError, IndexError, av.FFmpegError) as error:
        raise ValueError(str(error)) from None
    if len(packets) != film.frames:
        raise ValueError(f"{len(packets)} packets, {film.frames} frames are needed")
    return Sequence(coder=coder, film=film, options=options, first=first, packets=packets)


def decode_frame(stream: Sequence, index: int, dtype: np.dtype[Any]) -> Pixels:
    """Decode one frame from the packets of its group, as an image (T, S, 3).

    Raises
    ------
    ValueError
        If the group does not decode.
    """
    start, stop = stream.group(index)
    part = stream.packets[start:stop]
    film = replace(stream.film, layout=replace(stream.film.layout, rows=1, cols=len(part)))
    data = [packet.data for packet in part]
    payload = framing.pack(stream.first, data) if stream.coder.framed else b"".join(data)
    try:
        frames = decoded_frames(stream.coder, payload, film)
        frame = next(itertools.islice(frames, index - start, None), None)
    except av.FFmpegError as error:
        raise ValueError(str(error.strerror)) from None
    if frame is None:
        raise ValueError("a group of frames is not whole")
    return _pixels(frame, film, dtype)


def _pixels(frame: Any, film: Film, dtype: np.dtype[Any]) -> Pixels:
    """Return the component image of a decoded frame, RGB."""
    height, width = film.layout.height, film.layout.width
    alone = replace(film.layout, rows=1, cols=1, step_row=0, step_col=0, step_y=width, step_x=1)
    single = replace(film, layout=alone)
    planes = single.batch()
    for plane, target in zip(frame.planes, planes, strict=True):
        copy_plane(plane, target[0])
    pixels = np.empty((height, width, 3), dtype)
    single.scatter(planes, np.zeros(1, np.int64), pixels)
    return np.ascontiguousarray(pixels.swapaxes(0, 1)) if film.layout.turned else pixels


def _demuxed(payload: bytes, format: str) -> list[Packet]:
    container: Any = av.open(io.BytesIO(payload), format=format)
    with container:
        stream = container.streams.video[0]
        return [Packet(bytes(packet), packet.is_keyframe) for packet in container.demux(stream) if packet.size]


def _has_sequence_header(unit: memoryview) -> bool:
    """Return whether a temporal unit has a sequence header after its two-byte delimiter."""
    return len(unit) > 2 and unit[2] >> 3 & 15 == OBU_SEQUENCE_HEADER


def _vp9_key(_: int, packet: memoryview) -> bool:
    """Return whether frame_type of the uncompressed header is a key frame (VP9 bitstream specification, 6.2)."""
    bits = packet[0]
    reserved = bits >> 4 & 3 == 3  # profile 3 has one more bit
    shown_again, inter = (bits >> 2 & 1, bits >> 1 & 1) if reserved else (bits >> 3 & 1, bits >> 2 & 1)
    return not shown_again and not inter


def _by_gop(gop: int) -> Callable[[int, memoryview], bool]:
    return lambda index, _: index == 0 if gop == 0 else index % gop == 0


_KEYS: dict[str, Callable[[int, memoryview], bool]] = {"VP9": _vp9_key}
