"""The payload: a header, an index of the levels, and a payload of the arithmetic coder for each level."""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# By factors between planes, and residuals without a transform. Version 4 is that of segments of takes.
VERSION, UNCROSSED, SKIPPING, SKIPPING_UNCROSSED = 3, 2, 5, 6
_VERSIONS = {
    (False, False): UNCROSSED,
    (True, False): VERSION,
    (True, True): SKIPPING,
    (False, True): SKIPPING_UNCROSSED,
}
_TOOLS = {version: tools for tools, version in _VERSIONS.items()}
PIXELS_A_BYTE = (
    4096  # at least a byte for so many pixels, zeros if need be: few bytes cannot claim memory without end
)
MOST_LOG_STRIDE = 6
MOST_STEP = 1 << 18
MOST_SOURCES = 8
MOST_DISPARITY = 1 << 14

_HEAD = struct.Struct("<BBBBbhh9h")
_LEVEL = struct.Struct("<II")


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
    down : int
        1, or -1 where disparity has the other sign along columns than along rows.
    low, high : int
        Range of disparity between neighbouring views, in 2^-8 samples.
    axes : ndarray of int16, (3, 3)
        Colours, in units of 2^-14.
    crossed : bool
        Whether the residuals of the second and third plane may be predicted from the first's.
    skipping : bool
        Whether small blocks may have a residual without a transform.
    steps : tuple of int
        The quantiser's step of each level, in 2^-7 of an 8-bit code.
    """

    log_stride: int
    sources: int
    exact: bool
    down: int
    low: int
    high: int
    axes: NDArray[np.int16]
    crossed: bool
    skipping: bool
    steps: tuple[int, ...]


def pack(header: Header, levels: list[bytes], pixels: int) -> bytes:
    """The payload of a picture of so many pixels."""
    head = _HEAD.pack(
        _VERSIONS[header.crossed, header.skipping],
        header.log_stride,
        header.sources,
        header.exact,
        header.down,
        header.low,
        header.high,
        *header.axes.ravel().tolist(),
    )
    index = b"".join(_LEVEL.pack(step, len(level)) for step, level in zip(header.steps, levels, strict=True))
    return (head + index + b"".join(levels)).ljust(least_bytes(pixels), b"\0")


def head_bytes(levels: int) -> int:
    """Length of header and index."""
    return _HEAD.size + levels * _LEVEL.size


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
    if len(payload) < max(_HEAD.size, least_bytes(pixels)):
        raise ValueError(f"its light field has {len(payload)} bytes, too few for {pixels} pixels")
    version, log_stride, sources, exact, down, low, high, *axes = _HEAD.unpack_from(payload)
    if version not in _TOOLS:
        known = ", ".join(map(str, sorted(_TOOLS)))
        raise ValueError(f"its light field is of version {version}: this decoder reads versions {known}")
    crossed, skipping = _TOOLS[version]
    sound = log_stride <= MOST_LOG_STRIDE and sources <= MOST_SOURCES and exact <= 1 and abs(down) == 1
    if not sound or not -MOST_DISPARITY <= low <= high <= MOST_DISPARITY:
        raise ValueError("its header holds values that no encoder writes")
    count = log_stride + 2
    start = head_bytes(count)
    if len(payload) < start:
        raise ValueError(f"its light field has {len(payload)} bytes: header and index alone have {start}")
    index = [_LEVEL.unpack_from(payload, _HEAD.size + i * _LEVEL.size) for i in range(count)]
    levels = []
    for step, length in index:
        if not 0 < step <= MOST_STEP:
            raise ValueError(f"its quantiser has a step of {step}: 1 to {MOST_STEP} is needed")
        levels.append(payload[start : start + length])
        start += length
    if len(payload) != max(start, least_bytes(pixels)) or payload[start:].strip(b"\0"):
        raise ValueError(f"its light field has {len(payload)} bytes, where its index says {start}")
    header = Header(
        log_stride=log_stride,
        sources=sources,
        exact=bool(exact),
        down=down,
        low=low,
        high=high,
        axes=np.array(axes, np.int16).reshape(3, 3),
        crossed=crossed,
        skipping=skipping,
        steps=tuple(step for step, _ in index),
    )
    return header, levels
