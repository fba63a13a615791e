"""Temporal units of AV1 streams, from the headers of open bitstream units (OBUs)."""

from __future__ import annotations

from collections.abc import Iterator

TEMPORAL_DELIMITER = 2


def temporal_units(payload: bytes) -> Iterator[memoryview]:
    """Yield the parts of a low-overhead stream that show one frame each.

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
            if at > start + 2:  # older `si-avif` files hold delimiters without a frame
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
