"""The payload: a header, an index of the levels, and a payload of the arithmetic coder for each level."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...bitstream.compact import leb128, read_leb128
from .planes import bt709_colours

# Versions 2, 3, 5 and 6 say by their number which tools they have: factors between planes, and residuals without a
# transform. Version 4 is that of segments of takes. Version 7 has flags, version 8 a dependent quantiser as well,
# version 9 other intra modes, too, version 10 halved blocks, version 11 views beside their places, version 12 bits of
# more contexts, version 13 limited differences in the loop filter, version 14 intra blocks that are guided by their
# surroundings, version 15 a learnt loop filter. Lossless coding still writes 2 and 3.
VERSION, UNCROSSED, SKIPPING, SKIPPING_UNCROSSED = 3, 2, 5, 6
FLAGGED = TUNED, DEPENDENT, DIRECTED, PARTED, RIGGED, REFINED, LIMITED, GUIDED, LEARNT = (
    7,
    8,
    9,
    10,
    11,
    12,
    13,
    14,
    15,
)
_VERSIONS = {
    (False, False): UNCROSSED,
    (True, False): VERSION,
    (True, True): SKIPPING,
    (False, True): SKIPPING_UNCROSSED,
}
_TOOLS = {version: tools for tools, version in _VERSIONS.items()}
QUARTERS, EIGHTHS = 2, 3  # binary logarithms of the unit of factors between planes
# Flags from version 7 on; the lowest two bits are 0, or the logarithm of the factors' unit.
_SKIPS, _FILTERS, _DOWN, _BT709, _SKEWED, _RIGGED = 4, 8, 16, 32, 64, 128
PIXELS_A_BYTE = (
    4096  # at least a byte for so many pixels, zeros if need be: few bytes cannot claim memory without end
)
MOST_LOG_STRIDE = 6
MOST_STEP = 1 << 18
MOST_SOURCES = 8
MOST_DISPARITY = 1 << 14
UPRIGHT = 1 << 10
MOST_LATTICE = 4 * UPRIGHT

_HEAD = struct.Struct("<BBBBbhh9h")
_LEVEL = struct.Struct("<II")
_TUNED = struct.Struct("<BBBhh")
_ROTATION = struct.Struct("<9h")
_LATTICE = struct.Struct("<3h")


@dataclass(frozen=True, kw_only=True)
class Header:
    """Parameters of a stream that the decoder needs besides the structure.

    Parameters
    ----------
    log_stride : int
        Binary logarithm of the distance between views of the second level.
    sources : int
        How many views a synthesis is made of; 0 for none.
    exact : bool
        Whether coding is lossless.
    lattice : (int, int, int)
        How far a row of views leads across, a column down, and a row down, in 2^-10 of how far a column leads across:
        (0, 0, ±`UPRIGHT`) on an upright grid, negative where disparity has the other sign along columns.
    low, high : int
        Range of disparity between neighbouring views, in 2^-8 samples.
    colours : ndarray of int32, (3, 3)
        RGB of each plane by rows, in units of 2^-14. In lossless coding they are a rotation.
    scales : (int, int) or None
        Of the planes of Cb and Cr in 2^-6, if planes are those of BT.709; None if ``colours`` are a rotation.
    crossed : int
        Binary logarithm of the unit of factors that predict residuals of the second and third plane from the first's;
        0 without them.
    skipping : bool
        Whether small blocks may have a residual without a transform.
    tuned : bool
        From version 7 on: large coefficients have contexts by their neighbourhood, and views may be filtered.
    filtered : bool
        Whether views may be filtered in the loop.
    dependent : bool
        From version 8 on: the quantiser of coefficients is a dependent one.
    directed : bool
        From version 9 on: intra blocks smooth borders, have contexts of directions, and transforms of sines.
    parted : bool
        From version 10 on: squares of blocks may be halved.
    refined : bool
        From version 12 on: all bits with contexts are mixed, those of coefficients of more contexts.
    limited : bool
        From version 13 on: the loop filter of the first plane has limited differences.
    guided : bool
        From version 14 on: intra blocks have more directions, colours that follow, and guessed signs; squares may be
        halved three times.
    learnt : bool
        From version 15 on: the loop filter of the first plane has a network's guess in the first two levels.
    rig : bytes
        From version 11 on: departures of views from their places on the lattice, as `rig` packs them; may be empty.
    steps : tuple of int
        The quantiser's step of each level, in 2^-7 of an 8-bit code.
    """

    log_stride: int
    sources: int
    exact: bool
    lattice: tuple[int, int, int]
    low: int
    high: int
    colours: NDArray[np.int32]
    scales: tuple[int, int] | None = None
    crossed: int
    skipping: bool
    tuned: bool = False
    filtered: bool = False
    dependent: bool = False
    directed: bool = False
    parted: bool = False
    refined: bool = False
    limited: bool = False
    guided: bool = False
    learnt: bool = False
    rig: bytes = b""
    steps: tuple[int, ...]


def pack(header: Header, levels: list[bytes], pixels: int) -> bytes:
    """The payload of a picture of so many pixels."""
    return (_head(header, levels) + b"".join(levels)).ljust(least_bytes(pixels), b"\0")


def _head(header: Header, levels: list[bytes]) -> bytes:
    colours = header.colours.ravel().tolist()
    index = list(zip(header.steps, map(len, levels), strict=False))  # a view of a take needs no levels beyond its own
    if not header.tuned:
        version = _VERSIONS[bool(header.crossed), header.skipping]
        down = header.lattice[2] // UPRIGHT
        common = header.log_stride, header.sources, header.exact, down, header.low, header.high
        return _HEAD.pack(version, *common, *colours) + b"".join(_LEVEL.pack(*level) for level in index)
    flags = header.crossed | _SKIPS * header.skipping | _FILTERS * header.filtered
    flags |= _DOWN * (header.lattice[2] < 0) | _BT709 * (header.scales is not None) | _SKEWED * _skewed(header)
    flags |= _RIGGED * bool(header.rig)
    head = _TUNED.pack(
        _version(header),
        flags,
        header.log_stride | header.sources << 3,
        header.low,
        header.high,
    )
    head += bytes(header.scales) if header.scales else _ROTATION.pack(*colours)
    head += _LATTICE.pack(*header.lattice) if _skewed(header) else b""
    head += leb128(len(header.rig)) + header.rig if header.rig else b""
    return head + b"".join(leb128(step) + leb128(length) for step, length in index)


def _version(header: Header) -> int:
    """Version of a payload with flags."""
    if header.refined:
        return REFINED + header.limited + header.guided + header.learnt
    return FLAGGED[header.dependent + header.directed + header.parted + bool(header.rig)]


def _skewed(header: Header) -> bool:
    return header.lattice not in ((0, 0, UPRIGHT), (0, 0, -UPRIGHT))


def head_bytes(header: Header, levels: list[bytes]) -> int:
    """Length of header and index."""
    return len(_head(header, levels))


def least_bytes(pixels: int) -> int:
    """Length of the shortest payload of a picture of so many pixels."""
    return -(-pixels // PIXELS_A_BYTE)


def unpack(payload: bytes, pixels: int) -> tuple[Header, list[bytes]]:
    """Header and levels.

    Raises
    ------
    ValueError
        If the payload is none of a picture of so many pixels.
    """
    if len(payload) < max(1, least_bytes(pixels)):
        raise ValueError(f"its light field has {len(payload)} bytes, too few for {pixels} pixels")
    version = payload[0]
    if version not in _TOOLS and version not in FLAGGED:
        known = ", ".join(map(str, sorted((*_TOOLS, *FLAGGED))))
        raise ValueError(f"its light field is of version {version}: this decoder reads versions {known}")
    try:
        values, index, start = (_read_fixed if version in _TOOLS else _read_tuned)(payload)
    except (IndexError, ValueError, struct.error):
        raise ValueError(f"its light field has {len(payload)} bytes, too few for its header and index") from None
    header = Header(**values, steps=tuple(step for step, _ in index))
    sound = header.log_stride <= MOST_LOG_STRIDE and header.sources <= MOST_SOURCES
    sound = sound and max(map(abs, header.lattice)) <= MOST_LATTICE and header.lattice[2] != 0
    sound = sound and header.crossed in (0, QUARTERS, EIGHTHS) and header.exact in (0, 1)
    sound = sound and (header.scales is None or min(header.scales) > 0)
    if not sound or not -MOST_DISPARITY <= header.low <= header.high <= MOST_DISPARITY:
        raise ValueError("its header holds values that no encoder writes")
    levels = []
    for step, length in index:
        if not 0 < step <= MOST_STEP:
            raise ValueError(f"its quantiser has a step of {step}: 1 to {MOST_STEP} is needed")
        levels.append(payload[start : start + length])
        start += length
    if len(payload) != max(start, least_bytes(pixels)) or payload[start:].strip(b"\0"):
        raise ValueError(f"its light field has {len(payload)} bytes, where its index says {start}")
    return header, levels


_Read = tuple[dict[str, Any], list[tuple[int, int]], int]  # values of the header, index, where the levels begin


def _read_fixed(payload: bytes) -> _Read:
    version, log_stride, sources, exact, down, low, high, *colours = _HEAD.unpack_from(payload)
    crossed, skipping = _TOOLS[version]
    values = {
        "log_stride": log_stride,
        "sources": sources,
        "exact": exact,
        "lattice": (0, 0, down * UPRIGHT),
        "low": low,
        "high": high,
        "colours": np.array(colours, np.int32).reshape(3, 3),
        "crossed": QUARTERS if crossed else 0,
        "skipping": skipping,
    }
    index = [_LEVEL.unpack_from(payload, _HEAD.size + i * _LEVEL.size) for i in range(log_stride + 2)]
    return values, index, _HEAD.size + len(index) * _LEVEL.size


def _read_tuned(payload: bytes) -> _Read:
    version, flags, counts, low, high = _TUNED.unpack_from(payload)
    at, scales = _TUNED.size, None
    if flags & _BT709:
        scales = payload[at], payload[at + 1]
        colours, at = bt709_colours(scales), at + 2
    else:
        colours = np.array(_ROTATION.unpack_from(payload, at), np.int32).reshape(3, 3)
        at += _ROTATION.size
    lattice = 0, 0, -UPRIGHT if flags & _DOWN else UPRIGHT
    if flags & _SKEWED:
        lattice = _LATTICE.unpack_from(payload, at)
        at += _LATTICE.size
    rig = b""
    if flags & _RIGGED and version >= RIGGED:
        length, at = read_leb128(payload, at)
        rig, at = payload[at : at + length], at + length
    index = []
    for _ in range((counts & 7) + 2):
        step, at = read_leb128(payload, at)
        length, at = read_leb128(payload, at)
        index.append((step, length))
    values = {
        "log_stride": counts & 7,
        "sources": counts >> 3,
        "exact": False,
        "lattice": lattice,
        "low": low,
        "high": high,
        "colours": colours,
        "scales": scales,
        "crossed": flags & (3 | (_RIGGED if version < RIGGED else 0)),  # with a flag that no encoder sets
        "skipping": bool(flags & _SKIPS),
        "tuned": True,
        "filtered": bool(flags & _FILTERS),
        "dependent": version >= DEPENDENT,
        "directed": version >= DIRECTED,
        "parted": version >= PARTED,
        "refined": version >= REFINED,
        "limited": version >= LIMITED,
        "guided": version >= GUIDED,
        "learnt": version >= LEARNT,
        "rig": rig,
    }
    return values, index, at
