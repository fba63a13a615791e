"""Table of packets, for streams whose packets have no start codes.

A payload is a table, the decoder's parameters and the packets. The table holds the size of the parameters, the number
of packets and their sizes, each in LEB128 (seven bits per byte, least first, the highest bit set on all but the
last).
"""

from __future__ import annotations

from collections.abc import Sequence

from .compact import leb128, read_leb128


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
