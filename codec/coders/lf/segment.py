"""Segments of takes: a picture, and later instants predicted from earlier ones, too.

===========================  ==============================================================================
bytes                        field
===========================  ==============================================================================
1                            version: 4
1                            earlier instants that a view may be predicted from, 1–4
1                            number of levels
4 times the levels           step of the quantiser of each level, in 2⁻⁷ of an 8-bit code, of later instants
LEB128, and so many bytes    the first instant: the payload of a picture (`stream`), which also has the least
                             and greatest disparity of all instants
for each later instant       length of each level in LEB128, then the bytes of the levels
===========================  ==============================================================================
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core import IIPicture

from ... import clock
from ...bitstream.compact import leb128, read_leb128
from ...contract import Options
from ...search import Run
from . import stream
from .coder import FRACTIONS, Source, check_views, decoded_batches, shape, threads_of
from .contexts import Contexts
from .field import Field
from .motion import MOST_PAST
from .pyramid import Place

VERSION = 4
# The encoder's choices by Bjøntegaard rates at `setup1`, scale 32, 4 instants, 2026-11-22. Earlier instants: 2 save
# 0.6 % against 1 on car, 4 another 3 %. Quantisers by which later instants are coarser, since less is predicted from
# them: 1 % less rate than 0 on apples and car, the same on cuboid.
PAST = 4
COARSER = 1.0
_STEP = struct.Struct("<I")


@dataclass(frozen=True)
class Instant:
    """Coded bytes of an instant: its header, and levels."""

    header: stream.Header
    levels: list[bytes]


class Segment:
    """Pictures of consecutive instants, to be coded at one quantiser after another."""

    def __init__(self, pictures: Sequence[IIPicture], options: Options) -> None:
        first, *later = (Source(picture, options) for picture in pictures)
        sources = [first, *later]
        low = min(source.header.low for source in sources)
        high = max(source.header.high for source in sources)
        header = replace(first.header, low=low, high=high)
        for source in sources:
            source.header = header
        self.sources = sources

    def run_at(self, setting: float) -> Run:
        """Code all instants at a quantiser, in the fractions of `coder`."""
        started = clock.cpu_seconds()
        first, *later = self.sources
        contexts = Contexts(first.header.refined)
        field = first.field(first.header_at(setting))
        picture = stream.pack(field.header, first.levels(field, contexts), first.count)
        steps = field.header.steps if first.header.exact else first.steps(setting + COARSER * FRACTIONS)
        header = replace(field.header, steps=steps)
        head = bytes([VERSION, PAST, len(steps)]) + b"".join(map(_STEP.pack, steps))
        parts, past = [head, leb128(len(picture)), picture], [field]
        for source in later:
            source.axes = first.axes
            field = source.field(header, past)
            levels = source.levels(field, contexts)
            parts += [*(leb128(len(level)) for level in levels), *levels]
            past = _later(past, field, PAST)
        return Run(b"".join(parts), clock.cpu_seconds() - started)


def _later(past: list[Field], field: Field, count: int) -> list[Field]:
    """Return the instants that predict the next one; those that predicted this one are needed no more."""
    field.past = ()
    return [field, *past][:count]


def unpack(payload: bytes, pixels: int, instants: int) -> tuple[int, list[Instant]]:
    """Return the number of earlier instants that predict a view, and all instants.

    Raises
    ------
    ValueError
        If the payload is none of so many pictures of so many pixels.
    """
    if not payload or payload[0] != VERSION:
        state = f"of version {payload[0]}" if payload else "empty"
        raise ValueError(f"its segment is {state}: this decoder reads version {VERSION}")
    try:
        past, count, at = payload[1], payload[2], 3
        steps = tuple(_STEP.unpack_from(payload, at + i * _STEP.size)[0] for i in range(count))
        length, at = _length(payload, at + count * _STEP.size)
        header, levels = stream.unpack(payload[at : at + length], pixels)
        at += length
        if not 1 <= past <= MOST_PAST or len(levels) != count or not all(0 < s <= stream.MOST_STEP for s in steps):
            raise ValueError("its segment holds values that no encoder writes")
        found = [Instant(header, levels)]
        later = replace(header, steps=steps)
        for _ in range(1, instants):
            lengths = []
            for _ in range(count):
                length, at = _length(payload, at)
                lengths.append(length)
            ends = np.cumsum([at, *lengths]).tolist()
            if ends[-1] > len(payload):
                raise IndexError
            found.append(Instant(later, [payload[a:b] for a, b in pairwise(ends)]))
            at = ends[-1]
    except (IndexError, struct.error):
        raise ValueError(f"its segment of {instants} instants ends early") from None
    if at != len(payload):
        raise ValueError(f"its segment has {len(payload) - at} bytes more than its {instants} instants")
    return past, found


def _length(payload: bytes, at: int) -> tuple[int, int]:
    try:
        return read_leb128(payload, at)
    except ValueError:
        raise IndexError from None


def decoded_fields(payload: bytes, blank: IIPicture, options: Options, instants: int) -> Iterator[Field]:
    """Decode instant by instant; yield the views of each.

    Raises
    ------
    ValueError
        If the payload is damaged.
    """
    past_count, found = _opened(payload, blank, instants)
    contexts, past = Contexts(found[0].header.refined), list[Field]()
    for number, instant in enumerate(found):
        field = _field(instant, blank, past)
        for _ in _batches(field, instant, options, contexts, number):
            pass
        yield field
        past = _later(past, field, past_count)


def decode_view(
    payload: bytes, blank: IIPicture, options: Options, instants: int, at: int, place: Place
) -> tuple[NDArray[Any], int]:
    """Return a view (row, column) of one instant, and the number of views decoded.

    Of earlier instants the levels up to that of the view are decoded, of its own instant the batches up to its own.

    Raises
    ------
    ValueError
        If the payload is damaged so far as it is read.
    """
    past_count, found = _opened(payload, blank, instants)
    contexts, past, views = Contexts(found[0].header.refined), list[Field](), 0
    for number, instant in enumerate(found[: at + 1]):
        field = _field(instant, blank, past)
        last = next(i for i, level in enumerate(field.levels) if place in [(node.row, node.col) for node in level])
        needed = Instant(instant.header, instant.levels[: last + 1])
        for _, nodes, _ in _batches(field, needed, options, contexts, number):
            views += len(nodes)
            if number == at and any((node.row, node.col) == place for node in nodes):
                return field.view_pixels(field.number(place)).copy(), views
        past = _later(past, field, past_count)
    raise AssertionError("the pyramid has every view")


def _opened(payload: bytes, blank: IIPicture, instants: int) -> tuple[int, list[Instant]]:
    check_views(blank)
    return unpack(payload, blank.pixels.size // 3, instants)


def _field(instant: Instant, blank: IIPicture, past: list[Field]) -> Field:
    height, width, grid = shape(blank)
    return Field(instant.header, grid, height, width, blank.pixels.dtype, past)


def _batches(field: Field, instant: Instant, options: Options, contexts: Contexts, number: int) -> Iterator[Any]:
    try:
        yield from decoded_batches(field, instant.levels, threads_of(options), contexts)
    except ValueError as error:
        raise ValueError(f"instant {number}: {error}") from None
