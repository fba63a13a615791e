"""Lazy decoding of frames and component images of a coded take."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core import IIPicture

from ..coders import groups
from ..coders.pseudo_video import PseudoVideo
from ..contract import Value
from ..frames import Film
from ..order import inverse
from .order import Plan
from .segments import segment_film, segment_options


@dataclass(eq=False)
class CodedFrames:
    """Source of an `IIVideo`: the latest segment is kept."""

    coder: PseudoVideo[Any]
    options: Mapping[str, Value]
    plan: Plan
    payloads: list[bytes]
    frames: int
    structure: IIPicture
    name: str
    _latest: tuple[int, NDArray[Any]] | None = field(default=None, repr=False)
    _sequence: tuple[int, groups.Sequence] | None = field(default=None, repr=False)

    def picture(self, frame: int) -> IIPicture:
        """Return a frame of its decoded segment."""
        number, instant, part = self._place(frame)
        if self._latest is None or self._latest[0] != number:
            self._latest = None  # memory of one segment
            self._latest = number, self._decoded(number, part)
        height = self.structure.size[1]
        return self.structure.with_pixels(self._latest[1][instant * height : (instant + 1) * height])

    def component(self, frame: int, kind: str, place: tuple[int, int]) -> NDArray[Any] | None:
        """Decode one component image from its group of pictures; None if the stream codes images of another kind."""
        number, instant, part = self._place(frame)
        if kind != self.coder.kind or (self._latest is not None and self._latest[0] == number):
            return None
        stream = self._stream(number, part)
        grid = self.coder.film(self.structure, self.options).layout
        rows, cols = grid.rows, grid.cols
        view = int(inverse(self.coder.frame_order(rows, cols, self.options))[place[1] * cols + place[0]])
        table = self.plan.table(rows * cols, len(part))
        index = int(np.flatnonzero((table[:, 0] == view) & (table[:, 1] == instant))[0])
        try:
            return groups.decode_frame(stream, index, self.structure.pixels.dtype)
        except ValueError as error:
            raise ValueError(f"{self.name} is damaged in segment {number + 1}: {error}") from None

    def _place(self, frame: int) -> tuple[int, int, range]:
        parts = self.plan.segments(self.frames)
        number = frame // len(parts[0])
        return number, frame - parts[number].start, parts[number]

    def _decoded(self, number: int, part: range) -> NDArray[Any]:
        film = segment_film(self.coder, self.structure, self.options, self.plan, len(part))
        width, height = self.structure.size
        blank = np.broadcast_to(np.zeros((), self.structure.pixels.dtype), (len(part) * height, width, 3))
        try:
            return self.coder.decode_film(self.payloads[number], film, blank)[0]
        except ValueError as error:
            raise ValueError(f"{self.name} is damaged in segment {number + 1}: {error}") from None

    def _stream(self, number: int, part: range) -> groups.Sequence:
        """The packets of a segment."""
        if self._sequence is None or self._sequence[0] != number:
            whole = segment_film(self.coder, self.structure, self.options, self.plan, len(part))
            views = whole.layout.frames
            row = replace(whole.layout, rows=1, cols=whole.frames)
            sides = {"width": whole.width, "height": whole.height}
            film = Film(layout=row, order=whole.order, by=whole.by, format=whole.format, **sides)
            options = segment_options(self.coder, self.options, self.plan, views, len(part))
            try:
                self._sequence = number, groups.sequence(self.coder, self.payloads[number], film, options)
            except ValueError as error:
                raise ValueError(f"{self.name} is damaged in segment {number + 1}: {error}") from None
        return self._sequence[1]
