"""Many planes as the components of one JPEG 2000 codestream, by OpenJPEG through imagecodecs.

One codestream means one rate control: OpenJPEG cuts all code blocks of all components at one rate–distortion slope,
such that the squared error of all planes together is the one asked for.

What the reader knows anyway is left out of the bytes, and put back or checked by `decode_planes`: image and component
sizes (SIZ, 3 bytes for every component) and OpenJPEG's comment. No stream can thus claim another size than is
expected, nor another coding style than the one that we write.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import Any

import imagecodecs
import numpy as np
from numpy.typing import NDArray

from .packets import Tile, new_tile_part, packets_of, tile_part

MAX_COMPONENTS = 4095  # imagecodecs' limit; the standard's is 16384
LEVELS = 5
BITS = {"int16": 16, "int32": 24}  # OpenJPEG works in 32 bits of which it needs some itself
FINEST_DB = 140.0
COM, SIZ, COD, SOT = 0xFF64, 0xFF51, 0xFF52, 0xFF90
EOC = b"\xff\xd9"


def encode_planes(planes: NDArray[Any], squared_error: float, *, wavelet: str) -> bytes:
    """One tile, one quality layer, no colour transform, five levels unless planes are small.

    Parameters
    ----------
    planes : ndarray of int16 or int32, (C, H, W)
        At most `MAX_COMPONENTS`; 24 bits are used of 32.
    squared_error : float
        The mean over all planes that is allowed. 0 is lossless and needs the 5/3.
    wavelet : {"5/3", "9/7"}
        Within planes: the reversible 5/3, or the 9/7.

    Returns
    -------
    bytes
        A codestream from its coding style on.
    """
    if planes.shape[2] == 1:  # which imagecodecs takes for something else
        planes = np.repeat(planes, 2, axis=2)
    bits = BITS[planes.dtype.name]
    peak = 2.0**bits - 1
    level = None if squared_error == 0 else min(max(10 * math.log10(peak**2 / squared_error), 1e-3), FINEST_DB)
    whole = imagecodecs.jpeg2k_encode(
        planes,
        level,  # type: ignore[arg-type]
        codecformat="J2K",
        planar=True,
        mct=False,
        bitspersample=bits,
        resolutions=_levels(planes.shape) + 1,
        reversible=wavelet == "5/3",
        numthreads=1,
    )
    head = _head(planes.shape, planes.dtype.name)
    stream = bytes(whole)
    if not stream.startswith(head):
        raise RuntimeError(f"OpenJPEG {imagecodecs.jpeg2k_version()} writes another header than was foreseen")
    return without_comments(stream[len(head) :])


def decode_planes(
    stream: bytes, shape: tuple[int, int, int], dtype: str, *, wavelet: str, lossless: bool
) -> NDArray[np.integer]:
    """The planes of a codestream from `encode_planes`.

    Raises
    ------
    ValueError
        If it is none for planes of that shape.
    """
    coded = (*shape[:2], max(2, shape[2]))
    whole = whole_codestream(stream, coded, dtype, wavelet=wavelet, lossless=lossless)
    try:
        planes = imagecodecs.jpeg2k_decode(whole, planar=True, numthreads=1)
    except (RuntimeError, ValueError) as error:
        raise ValueError(f"its JPEG 2000 stream does not decode ({error})") from None
    if planes.size != math.prod(coded) or planes.dtype.name != dtype:
        raise ValueError(f"its JPEG 2000 stream is {planes.shape} {planes.dtype}, {coded} {dtype} is needed")
    return planes.reshape(coded)[:, :, : shape[2]]


def picked_planes(
    stream: bytes, shape: tuple[int, int, int], dtype: str, picked: Sequence[int], *, wavelet: str, lossless: bool
) -> NDArray[np.integer]:
    """Decode some planes of a codestream from `encode_planes`, in rising order, by their packets alone.

    Raises
    ------
    ValueError
        If it is none for planes of that shape.
    """
    coded = (*shape[:2], max(2, shape[2]))
    whole_codestream(stream, coded, dtype, wavelet=wavelet, lossless=lossless)  # its coding style is ours
    start = _tile_start(stream)
    tile = Tile(
        components=coded[0],
        height=coded[1],
        width=coded[2],
        levels=_levels(coded),
        precinct=1 << 15 if lossless else 256,
        by_component=lossless,
    )
    some = stream[:start] + new_tile_part(packets_of(tile_part(stream, start), tile, set(picked)))
    return decode_planes(some, (len(picked), *shape[1:]), dtype, wavelet=wavelet, lossless=lossless)


def _tile_start(stream: bytes) -> int:
    """Position of the first tile-part, after the segments of the main header."""
    at = 0
    while at + 4 <= len(stream):
        if int.from_bytes(stream[at : at + 2]) == SOT:
            return at
        at += 2 + max(2, int.from_bytes(stream[at + 2 : at + 4]))
    raise ValueError("its JPEG 2000 stream has no tile")


def whole_codestream(
    stream: bytes, shape: tuple[int, int, int], dtype: str, *, wavelet: str, lossless: bool
) -> bytes:
    """The codestream as any JPEG 2000 decoder takes it, with image and component sizes."""
    levels = _levels(shape)
    # imagecodecs codes lossless in LRCP, else in RPCL with precincts of 256×256; always one layer, no colour
    # transform, code blocks of 64×64.
    precincts = b"" if lossless else b"\x88" * (levels + 1)
    style = struct.pack(">HHBBHB", COD, 12 + len(precincts), len(precincts) > 0, 0 if lossless else 2, 1, 0)
    style += bytes((levels, 4, 4, 0, wavelet == "5/3")) + precincts
    if not stream.startswith(style) or not stream.endswith(EOC):
        raise ValueError("its JPEG 2000 stream is cut short or of another coding style")
    return _head(shape, dtype) + stream


def _levels(shape: tuple[int, ...]) -> int:
    """How often imagecodecs lets planes be halved: until a side has fewer than 16 pixels."""
    return max(0, min(LEVELS, min(shape[1:]).bit_length() - 4))


def _head(shape: tuple[int, ...], dtype: str) -> bytes:
    """SOC and SIZ: one tile, signed components, no subsampling."""
    count, height, width = shape
    size = struct.pack(">HHH8IH", SIZ, 38 + 3 * count, 0, width, height, 0, 0, width, height, 0, 0, count)
    return b"\xff\x4f" + size + bytes((0x80 | (BITS[dtype] - 1), 1, 1)) * count


def without_comments(stream: bytes) -> bytes:
    """Of the main header's marker segments, from any on, those that are no comments; then the tile."""
    parts, at = [], 0
    while (marker := int.from_bytes(stream[at : at + 2])) != SOT:
        end = at + 2 + int.from_bytes(stream[at + 2 : at + 4])
        if marker != COM:
            parts.append(stream[at:end])
        at = end
    return b"".join([*parts, stream[at:]])
