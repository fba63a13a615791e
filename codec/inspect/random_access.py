"""Random access to component images: packets, groups of pictures, single frames.

A stream coded with ``gop=`` has an I picture every so many frames. One component image is decoded from the packets of
its group of pictures alone. The starts of groups are read from the stream.
"""

from __future__ import annotations

import io
import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import av
import numpy as np

from ..api import Encoded, blank_picture
from ..bitstream import framing
from ..bitstream.obu import temporal_units
from ..checks import check_type, whole_pair
from ..coders.lf.coder import LightField
from ..coders.pseudo_video import PseudoVideo, copy_plane, decoded_frames
from ..coders.volume import Separate
from ..contract import MAX_DECODED_PIXELS, Options, Pixels, find
from ..frames import Film, layout
from ..order import inverse, selection_order

OBU_SEQUENCE_HEADER = 1
DEMUXERS = {"H.264": "h264", "HEVC": "hevc", "MPEG-2": "mpegvideo"}


@dataclass(frozen=True)
class Packet:
    """The bytes of one frame, in the order of the stream, and whether decoding can start there."""

    data: bytes
    key: bool


@dataclass(frozen=True, kw_only=True)
class Sequence:
    """A coded pseudo video sequence taken apart.

    Parameters
    ----------
    coder : PseudoVideo
    options : mapping
    film : Film
        The frames of the whole picture.
    first : bytes
        What the decoder needs before the packets.
    packets : list of Packet
        One a frame.
    """

    coder: PseudoVideo[Any]
    options: Options
    film: Film
    first: bytes
    packets: list[Packet]

    def group(self, index: int) -> tuple[int, int]:
        """The frames from the start of a frame's group up to that of the next."""
        starts = [i for i, packet in enumerate(self.packets) if packet.key]
        after = int(np.searchsorted(starts, index, side="right"))
        if not starts or starts[0] != 0:
            raise ValueError("the stream does not start with a picture that needs no other")
        return starts[after - 1], starts[after] if after < len(starts) else len(self.packets)


def sequence(coded: Encoded) -> Sequence:
    """The packets of a coded picture.

    Raises
    ------
    ValueError
        If the scheme codes no pseudo video sequence, or the stream does not hold as many packets as frames.
    """
    check_type("coded", coded, Encoded, "a coded picture")
    coder = _with_frames(coded)
    if isinstance(coder, Separate | LightField):
        raise ValueError(f"scheme {coded.scheme} codes no sequence: its frames are parts of one codestream")
    film = coder.film(blank_picture(coded.structure, coded.dtype), coded.options)
    if film.width * film.height > MAX_DECODED_PIXELS:
        raise ValueError(
            f"frames have {film.width}×{film.height} pixels: at most {MAX_DECODED_PIXELS} are decoded alone"
        )
    first = b""
    try:
        if coder.framed:
            first, parts = framing.unpack(coded.payload, film.frames)
            key = _KEYS.get(coder.standard) or _by_gop(int(coded.options["gop"]))
            packets = [Packet(bytes(part), key(i, part)) for i, part in enumerate(parts)]
        elif coder.standard == "AV1":
            units = temporal_units(coded.payload)
            packets = [Packet(bytes(unit), _has_sequence_header(unit)) for unit in units]
        else:
            packets = _demuxed(coded.payload, DEMUXERS[coder.standard])
    except (ValueError, IndexError, av.FFmpegError) as error:
        raise ValueError(f"the coded picture is damaged: {error}") from None
    if len(packets) != film.frames:
        raise ValueError(f"the coded picture is damaged: {len(packets)} packets, {film.frames} frames are needed")
    return Sequence(coder=coder, options=coded.options, film=film, first=first, packets=packets)


def decode_frame(coded: Encoded, index: int) -> Pixels:
    """One frame of a pseudo video sequence, without those of other groups.

    Parameters
    ----------
    coded : Encoded
        With ``gop=1`` just one frame is decoded, with the default ``gop=0`` all up to this one.
    index : int
        Frame number j, in the order of the sequence.

    Returns
    -------
    ndarray, (T, S, 3)
        The component image PVS_j, just as it is in the whole decoded picture.

    Raises
    ------
    TypeError
        If an argument is of the wrong type.
    ValueError
        If there is no such frame, the scheme codes no frames, or the stream is damaged.
    """
    check_type("coded", coded, Encoded, "a coded picture")
    check_type("index", index, (int, np.integer), "a whole number")
    coder = _with_frames(coded)
    if isinstance(coder, Separate | LightField):
        count = layout(coded.structure["lenses"], coded.structure["ei_pixels"], coder.kind).frames
        if isinstance(index, bool) or not 0 <= index < count:
            raise ValueError(f"frame index {index} is asked for: there are {count}, from 0")
        return _slice(coder, coded, int(index))
    stream = sequence(coded)
    if isinstance(index, bool) or not 0 <= index < len(stream.packets):
        raise ValueError(f"frame index {index} is asked for: there are {len(stream.packets)}, from 0")
    start, stop = stream.group(index)
    part = stream.packets[start:stop]
    film = replace(stream.film, layout=replace(stream.film.layout, rows=1, cols=len(part)))
    data = [packet.data for packet in part]
    payload = framing.pack(stream.first, data) if stream.coder.framed else b"".join(data)
    try:
        frames = decoded_frames(stream.coder, payload, film)
        frame = next(itertools.islice(frames, index - start, None), None)
    except av.FFmpegError as error:
        raise ValueError(f"the coded picture is damaged: {error.strerror}") from None
    if frame is None:
        raise ValueError("the coded picture is damaged: a group of frames is not whole")
    return _pixels(frame, film, np.dtype(coded.dtype))


def decode_component(coded: Encoded, place: tuple[int, int]) -> Pixels:
    """One component image of a coded picture, without those of other groups.

    Parameters
    ----------
    coded : Encoded
    place : (int, int)
        (u, v) of a sub-image, (k, l) of an elementary image, (v, l) of a ray-space image.

    Returns
    -------
    ndarray, (T, S, 3)

    Raises
    ------
    ValueError
        As `decode_frame`; or if there is no such component image.
    """
    check_type("coded", coded, Encoded, "a coded picture")
    col, row = whole_pair("place", place)
    coder = _with_frames(coded)
    grid = layout(coded.structure["lenses"], coded.structure["ei_pixels"], coder.kind)
    if not (0 <= row < grid.rows and 0 <= col < grid.cols):
        raise ValueError(f"component image {place} is asked for: there are {grid.cols}×{grid.rows}, from (0, 0)")
    index = row * grid.cols + col
    if isinstance(coder, Separate | LightField):
        return _slice(coder, coded, index)
    order = selection_order(str(coded.options["order"]), grid.rows, grid.cols, str(coded.options["by"]))
    return decode_frame(coded, int(inverse(order)[index]))


def _with_frames(coded: Encoded) -> PseudoVideo[Any] | Separate | LightField:
    """The coder of a coded picture, if it codes component images that can be decoded alone."""
    coder = find(coded.scheme)
    if not isinstance(coder, PseudoVideo | Separate | LightField):
        raise ValueError(f"scheme {coded.scheme} codes the picture as a whole: it has no frames to be had alone")
    return coder


def _slice(coder: Separate | LightField, coded: Encoded, index: int) -> Pixels:
    """One component image of a scheme that codes each alone, or in levels."""
    try:
        return coder.decode_slice(coded.payload, blank_picture(coded.structure, coded.dtype), coded.options, index)
    except ValueError as error:
        raise ValueError(f"the coded picture is damaged: {error}") from None


def _pixels(frame: Any, film: Film, dtype: np.dtype[Any]) -> Pixels:
    """The component image of a decoded frame, RGB."""
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
    """Whether a temporal unit, which starts with a two-byte delimiter, goes on with a sequence header."""
    return len(unit) > 2 and unit[2] >> 3 & 15 == OBU_SEQUENCE_HEADER


def _vp9_key(_: int, packet: memoryview) -> bool:
    """frame_type of the uncompressed header (VP9 bitstream specification, 6.2)."""
    bits = packet[0]
    reserved = bits >> 4 & 3 == 3  # profile 3 has a bit more
    shown_again, inter = (bits >> 2 & 1, bits >> 1 & 1) if reserved else (bits >> 3 & 1, bits >> 2 & 1)
    return not shown_again and not inter


def _by_gop(gop: int) -> Callable[[int, memoryview], bool]:
    return lambda index, _: index == 0 if gop == 0 else index % gop == 0


_KEYS: dict[str, Callable[[int, memoryview], bool]] = {"VP9": _vp9_key}
