"""Frames in a payload: a table of packets, for streams whose packets have no start codes, and units of AV1.

A payload is a table, the decoder's parameters and the packets. The table holds the size of the parameters, the number
of packets and their sizes, each in LEB128 (seven bits per byte, least first, the highest bit set on all but the
last). Temporal units of AV1 are told by the headers of open bitstream units (OBUs).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from .compact import leb128, read_leb128

TEMPORAL_DELIMITER = 2
NOT_WHOLE = "its AV1 stream is not made of whole units"


def pack(first: bytes, packets: Sequence[bytes]) -> bytes:
    """Return a payload of decoder parameters and packets."""
    table = b"".join(leb128(number) for number in (len(first), len(packets), *map(len, packets)))
    return b"".join([table, first, *packets])


def unpack(payload: bytes, count: int) -> tuple[bytes, list[memoryview]]:
    """Return the decoder parameters and the packets of a payload.

    Raises
    ------
    ValueError
        Unless there are ``count`` packets and exactly the bytes they need.
    """
    at = 0
    numbers: list[int] = []
    while len(numbers) < count + 2:
        try:
            number, at = read_leb128(payload, at)
        except ValueError:
            raise ValueError("its table of packets is broken") from None
        numbers.append(number)
        if len(numbers) == 2 and number != count:
            raise ValueError(f"it has {number} packets, {count} are needed")
    first, sizes = numbers[0], numbers[2:]
    if at + first + sum(sizes) != len(payload):
        raise ValueError(f"its packets have {first + sum(sizes)} bytes, {len(payload) - at} are there")
    view = memoryview(payload)
    head, at = bytes(view[at : at + first]), at + first
    packets = []
    for size in sizes:
        packets.append(view[at : at + size])
        at += size
    return head, packets


def units(payload: bytes) -> Iterator[tuple[int, int, int, int]]:
    """Yield type, start, start of the body and end of each OBU of a stream whose units carry their size.

    Raises
    ------
    ValueError
        If it is not made of whole OBUs.
    """
    at = 0
    while at < len(payload):
        kind, extension, has_size = payload[at] >> 3 & 15, payload[at] >> 2 & 1, payload[at] >> 1 & 1
        if not has_size:
            raise ValueError(NOT_WHOLE)
        try:
            size, body = read_leb128(payload, at + 1 + extension)
        except ValueError:
            raise ValueError(NOT_WHOLE) from None
        yield kind, at, body, body + size
        at = body + size
    if at != len(payload) or not payload:
        raise ValueError(NOT_WHOLE)


def temporal_units(payload: bytes) -> Iterator[memoryview]:
    """Yield the parts of a low-overhead stream that show one frame each.

    Raises
    ------
    ValueError
        If it is not made of whole OBUs that start with a temporal delimiter.
    """
    view, start = memoryview(payload), 0
    for kind, at, _, _ in units(payload):
        if at == 0 and kind != TEMPORAL_DELIMITER:
            raise ValueError(NOT_WHOLE)
        if kind == TEMPORAL_DELIMITER:
            if at > start + 2:  # older `si-avif` files hold delimiters without a frame
                yield view[start:at]
            start = at
    yield view[start:]
