"""Headers of JPEG 2000 codestreams that hold many planes as components (ISO/IEC 15444-1, Annex A).

A stored stream leaves out image and component sizes (SIZ, 3 bytes per component) and OpenJPEG's comment. The sizes
follow from the structure of the picture; `whole_codestream` restores them, so that a forged stream cannot state other
sizes. It refuses any other coding style than ours.
"""

from __future__ import annotations

import struct
from collections.abc import Collection

from .packets import Tile, new_tile_part, packets_of, tile_part

LEVELS = 5
BITS = {"int16": 16, "int32": 24}  # of 32; OpenJPEG needs the others for itself
COM, SIZ, COD, QCD, SOT = 0xFF64, 0xFF51, 0xFF52, 0xFF5C, 0xFF90
SOD, EOC = b"\xff\x93", b"\xff\xd9"

Shape = tuple[int, int, int]


def without_head(codestream: bytes, shape: Shape, dtype: str) -> bytes:
    """Return a codestream from its coding style on, without comments.

    Raises
    ------
    ValueError
        If it starts with another header.
    """
    head = _head(shape, dtype)
    if not codestream.startswith(head):
        raise ValueError("another header than expected")
    return without_comments(codestream[len(head) :])


def whole_codestream(stream: bytes, shape: Shape, dtype: str, *, wavelet: str, lossless: bool) -> bytes:
    """Return the codestream with image and component sizes, as every JPEG 2000 decoder takes it.

    Raises
    ------
    ValueError
        If the stream is cut short, of another coding style, or shorter than its packets' headers.
    """
    levels = halvings(shape)
    # imagecodecs codes lossless in LRCP, else in RPCL with precincts of 256×256; always one layer, no colour
    # transform, code blocks of 64×64.
    precincts = b"" if lossless else b"\x88" * (levels + 1)
    style = struct.pack(">HHBBHB", COD, 12 + len(precincts), len(precincts) > 0, 0 if lossless else 2, 1, 0)
    style += bytes((levels, 4, 4, 0, wavelet == "5/3")) + precincts
    if not stream.startswith(style) or not stream.endswith(EOC):
        raise ValueError("its JPEG 2000 stream is cut short or of another coding style")
    if len(stream) < (least := tile_of(shape, lossless).packet_count()):
        raise ValueError(f"its JPEG 2000 stream has {len(stream)} bytes, its packets alone have {least}")
    check_segments(stream)
    return _head(shape, dtype) + stream


def check_segments(stream: bytes) -> None:
    """Check the segments of a stream, from its coding style on.

    A second coding style, in the main header or in that of a tile-part, can state precincts of one sample, of which
    OpenJPEG makes a structure each: 1600 bytes a pixel.

    Raises
    ------
    ValueError
        If there is more than a coding style, a quantisation, comments and one tile-part up to the end.
    """
    at, found = 0, []
    while (marker := int.from_bytes(stream[at : at + 2])) in (COD, QCD, COM):
        found.append(marker)
        at += 2 + int.from_bytes(stream[at + 2 : at + 4])
    part = int.from_bytes(stream[at + 6 : at + 10])
    whole = part in (0, len(stream) - at - len(EOC)) and stream.endswith(EOC)
    if [marker for marker in found if marker != COM] != [COD, QCD] or not whole or stream[at + 12 : at + 14] != SOD:
        raise ValueError("its JPEG 2000 stream is not one coding style, one quantisation and one tile-part")


def check_picture_stream(codestream: bytes, size: tuple[int, int], levels: int) -> None:
    """Check that a codestream is an RGB picture of 8 bit as Pillow writes it: one tile, one layer, whole precincts.

    Raises
    ------
    ValueError
        If it has another size, tiles, another coding style or further segments, which could take more memory.
    """
    width, height = size
    sizes = struct.pack(">HHH8IH", SIZ, 47, 0, width, height, 0, 0, width, height, 0, 0, 3) + b"\x07\x01\x01" * 3
    style = struct.pack(">HHBBHB", COD, 12, 0, 0, 1, 1) + bytes((levels, 4, 4, 0, 1))
    head = b"\xff\x4f" + sizes
    if not codestream.startswith(head + style):
        raise ValueError(f"its JPEG 2000 stream is no RGB picture of {width}×{height} px in one tile")
    check_segments(codestream[len(head) :])


def tile_of(shape: Shape, lossless: bool) -> Tile:
    """Return the layout of the packets of planes."""
    return Tile(
        components=shape[0],
        height=shape[1],
        width=shape[2],
        levels=halvings(shape),
        precinct=1 << 15 if lossless else 256,
        by_component=lossless,
    )


def some_components(stream: bytes, shape: Shape, picked: Collection[int], lossless: bool) -> bytes:
    """Return a stream of some components, by their packets.

    Raises
    ------
    ValueError
        If the stream is damaged.
    """
    start = _tile_start(stream)
    packets = packets_of(tile_part(stream, start), tile_of(shape, lossless), picked)
    return stream[:start] + new_tile_part(packets)


def _tile_start(stream: bytes) -> int:
    """Return the position of the first tile-part, after the segments of the main header."""
    at = 0
    while at + 4 <= len(stream):
        if int.from_bytes(stream[at : at + 2]) == SOT:
            return at
        at += 2 + max(2, int.from_bytes(stream[at + 2 : at + 4]))
    raise ValueError("its JPEG 2000 stream has no tile")


def halvings(shape: tuple[int, ...]) -> int:
    """Return the wavelet levels: imagecodecs halves planes until a side has fewer than 16 pixels."""
    return max(0, min(LEVELS, min(shape[1:]).bit_length() - 4))


def _head(shape: tuple[int, ...], dtype: str) -> bytes:
    """Return SOC and SIZ: one tile, signed components, no subsampling."""
    count, height, width = shape
    size = struct.pack(">HHH8IH", SIZ, 38 + 3 * count, 0, width, height, 0, 0, width, height, 0, 0, count)
    return b"\xff\x4f" + size + bytes((0x80 | (BITS[dtype] - 1), 1, 1)) * count


def without_comments(stream: bytes) -> bytes:
    """Return a stream without COM segments, from any marker segment of the main header on."""
    parts, at = [], 0
    while (marker := int.from_bytes(stream[at : at + 2])) != SOT:
        end = at + 2 + int.from_bytes(stream[at + 2 : at + 4])
        if marker != COM:
            parts.append(stream[at:end])
        at = end
    return b"".join([*parts, stream[at:]])
