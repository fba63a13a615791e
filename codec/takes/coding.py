"""Coding of one segment of a take: by a pseudo video scheme, or by the light field coder."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core import IIPicture

from ..coders import groups
from ..coders.lf import segment
from ..coders.lf.coder import EXACT_SETTINGS, FRACTIONS, SIZES, LightField
from ..coders.pseudo_video import PseudoVideo, Source
from ..contract import Coder, Goal, Value, find, parse_scheme
from ..frames import Film
from ..order import inverse
from ..search import Axis, Run, meet_size
from .order import Plan
from .segments import segment_film, segment_options

Pixels = NDArray[Any]


def segment_coder(
    name: str, structure: IIPicture, options: Mapping[str, Value], plan: Plan
) -> FilmSegments | FieldSegments:
    """Return what codes the segments of a take; ValueError if the scheme codes no takes or not by this plan."""
    coder = take_coder(name)
    if isinstance(coder, LightField):
        return FieldSegments(coder, structure, options, plan)
    return FilmSegments(coder, structure, options, plan)


def codes_takes(scheme: str) -> bool:
    """Return whether a scheme, with options after a colon, codes takes: a pseudo video sequence, or ``si-lf``.

    Raises
    ------
    ValueError
        If the scheme is unknown, or an option is unknown or out of range.
    """
    return isinstance(parse_scheme(scheme)[0], PseudoVideo | LightField)


def take_coder(name: str) -> PseudoVideo[Any] | LightField:
    """Return the coder of a scheme; ValueError if it codes no takes."""
    coder = find(name)
    if not isinstance(coder, PseudoVideo | LightField):
        raise ValueError(f"scheme {name} codes no takes: a pseudo video sequence, as si-h264, or si-lf is needed")
    return coder


@dataclass(frozen=True, eq=False)
class SegmentCoder(ABC):
    """Coder of segments of pictures of one structure.

    Pixels of a segment are pictures one below the other, (T · N, M, 3).
    """

    coder: Coder
    structure: IIPicture
    options: Mapping[str, Value]
    plan: Plan

    @abstractmethod
    def check(self) -> None:
        """Raise ValueError if the plan does not fit the views or the scheme."""

    @property
    @abstractmethod
    def axis(self) -> Axis:
        """Quantisers to search over a take."""

    @abstractmethod
    def run_at(self, pixels: Pixels, quantiser: float) -> Run:
        """Code a segment at a quantiser of the axis."""

    @abstractmethod
    def run(self, pixels: Pixels, goal: Goal) -> Run:
        """Code a segment at a rate or a quantiser, or lossless."""

    @abstractmethod
    def decoded(self, payload: bytes, instants: int) -> Pixels:
        """Decode a segment; ValueError if it is damaged."""

    @abstractmethod
    def component(self, payload: bytes, instants: int, instant: int, place: tuple[int, int]) -> Pixels:
        """Decode the component image (across, down) of one instant; ValueError if what it needs is damaged."""

    def instants(self, pixels: Pixels) -> int:
        """Return the number of pictures in the pixels of a segment."""
        return int(pixels.shape[0]) // self.structure.size[1]


class FilmSegments(SegmentCoder):
    """Segments as pseudo video sequences."""

    coder: PseudoVideo[Any]

    def check(self) -> None:
        """Groups divide the views."""
        views = self.film(1).layout.frames
        self.plan.check(views)
        segment_options(self.coder, self.options, self.plan, views, 1)

    @property
    def axis(self) -> Axis:
        """Those of a still."""
        return self.coder.axis(self.options)

    def film(self, instants: int) -> Film:
        """Return the frames of a segment."""
        return segment_film(self.coder, self.structure, self.options, self.plan, instants)

    def run_at(self, pixels: Pixels, quantiser: float) -> Run:
        """Code all frames at a quantiser."""
        return self._source(pixels).run_at(quantiser)

    def run(self, pixels: Pixels, goal: Goal) -> Run:
        """Code all frames as one stream."""
        source = self._source(pixels)
        return self.coder.encode_film(source.pixels, source.film, source.options, goal).run

    def decoded(self, payload: bytes, instants: int) -> Pixels:
        """Decode frame by frame."""
        width, height = self.structure.size
        blank = np.broadcast_to(np.zeros((), self.structure.pixels.dtype), (instants * height, width, 3))
        return self.coder.decode_film(payload, self.film(instants), blank)[0]

    def component(self, payload: bytes, instants: int, instant: int, place: tuple[int, int]) -> Pixels:
        """Decode the frames of a group up to the one needed."""
        grid = self.coder.film(self.structure, self.options).layout
        order = inverse(self.coder.frame_order(grid.rows, grid.cols, self.options))
        table = self.plan.table(grid.rows * grid.cols, instants)
        view = int(order[place[1] * grid.cols + place[0]])
        index = int(np.flatnonzero((table[:, 0] == view) & (table[:, 1] == instant))[0])
        return groups.decode_frame(self._packets(payload, instants), index, self.structure.pixels.dtype)

    def _source(self, pixels: Pixels) -> Source[Any]:
        film = self.film(self.instants(pixels))
        return Source(coder=self.coder, pixels=pixels, film=film, options=self._options(film, self.instants(pixels)))

    def _options(self, film: Film, instants: int) -> dict[str, Value]:
        return segment_options(self.coder, self.options, self.plan, film.layout.frames, instants)

    def _packets(self, payload: bytes, instants: int) -> groups.Sequence:
        """Packets of a segment; those of the latest one are kept."""
        key, found = self._kept.get("packets", (None, None))
        if key is not payload:
            whole = self.film(instants)
            row = replace(whole.layout, rows=1, cols=whole.frames)
            sides = {"width": whole.width, "height": whole.height}
            film = Film(layout=row, order=whole.order, by=whole.by, format=whole.format, **sides)
            found = groups.sequence(self.coder, payload, film, self._options(whole, instants))
            self._kept["packets"] = payload, found
        return found

    @cached_property
    def _kept(self) -> dict[str, Any]:
        return {}


class FieldSegments(SegmentCoder):
    """Segments as light fields with references in time."""

    coder: LightField

    def check(self) -> None:
        """Instants follow one another, and all views of one are a group."""
        if self.plan.walk != "view-first" or self.plan.group:
            plan = f"walk is {self.plan.walk!r} and group {self.plan.group}"
            raise ValueError(f"{plan}: scheme {self.coder.name} codes whole instants and needs 'view-first' and 0")

    @property
    def axis(self) -> Axis:
        """Those of a still."""
        return SIZES

    def run_at(self, pixels: Pixels, quantiser: float) -> Run:
        """Code all instants at a quantiser."""
        return self._segment(pixels).run_at(quantiser)

    def run(self, pixels: Pixels, goal: Goal) -> Run:
        """Search the quantiser for a rate."""
        coded = self._segment(pixels)
        if goal.qp is not None:
            return coded.run_at(goal.qp * FRACTIONS)
        if goal.bpp is None:
            return min((coded.run_at(setting) for setting in EXACT_SETTINGS), key=lambda run: len(run.payload))
        return meet_size(coded.run_at, goal.bpp * math.prod(pixels.shape[:2]) / 8, SIZES).run

    def decoded(self, payload: bytes, instants: int) -> Pixels:
        """Decode instant by instant."""
        blank, height = self.structure, self.structure.size[1]
        pixels = None
        for instant, field in enumerate(segment.decoded_fields(payload, blank, self.options, instants)):
            if pixels is None:  # the first instant has decoded: take memory for the others
                pixels = np.empty((instants * height, *blank.pixels.shape[1:]), blank.pixels.dtype)
            field.show(pixels[instant * height : (instant + 1) * height])
        assert pixels is not None
        return pixels

    def component(self, payload: bytes, instants: int, instant: int, place: tuple[int, int]) -> Pixels:
        """Decode the levels up to that of the view, of all instants up to its own."""
        view = place[1], place[0]
        return segment.decode_view(payload, self.structure, self.options, instants, instant, view)[0]

    def _segment(self, pixels: Pixels) -> segment.Segment:
        parts = np.split(pixels, self.instants(pixels))
        return segment.Segment([self.structure.with_pixels(part) for part in parts], self.options)
