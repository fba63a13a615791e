"""Temporal units of AV1 streams, from the headers of open bitstream units (OBUs)."""

from __future__ import annotations

from collections.abc import Iterator

from .compact import read_leb128

TEMPORAL_DELIMITER = 2
NOT_WHOLE = "its AV1 stream is not made of whole units"


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
