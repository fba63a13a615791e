"""Where the frames of an AV1 stream begin: its open bitstream units (OBUs), as far as their headers."""

from __future__ import annotations

from collections.abc import Iterator

TEMPORAL_DELIMITER = 2


def temporal_units(payload: bytes) -> Iterator[memoryview]:
    """The parts of a low-overhead stream that each show one frame.

    Raises
    ------
    ValueError
        If it is not made of whole OBUs that start with a temporal delimiter.
    """
    view, start, at = memoryview(payload), 0, 0
    while at < len(payload):
        kind = payload[at] >> 3 & 15
        if at == 0 and kind != TEMPORAL_DELIMITER:
            break
        if kind == TEMPORAL_DELIMITER:
            if at > start + 2:  # a delimiter of two bytes alone shows nothing; older `si-avif` files have them
                yield view[start:at]
            start = at
        extension, has_size = payload[at] >> 2 & 1, payload[at] >> 1 & 1
        at += 1 + extension
        size = shift = 0
        while has_size and at < len(payload) and shift < 35:
            byte = payload[at]
            at += 1
            size |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                break
        else:
            break
        at += size
    if at != len(payload) or not payload:
        raise ValueError("its AV1 stream is not made of whole units")
    yield view[start:]
