"""Lazy decoding of frames and component images of a coded take."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from numpy.typing import NDArray

from ii_core import IIPicture

from .coding import SegmentCoder
from .order import Plan


@dataclass(eq=False)
class CodedFrames:
    """Source of an `IIVideo`: the latest segment is kept."""

    coder: SegmentCoder
    plan: Plan
    payloads: list[bytes]
    frames: int
    structure: IIPicture
    name: str
    _latest: tuple[int, NDArray[Any]] | None = field(default=None, repr=False)

    def picture(self, frame: int) -> IIPicture:
        """Return a frame of its decoded segment."""
        number, instant, part = self._place(frame)
        if self._latest is None or self._latest[0] != number:
            self._latest = None  # memory of one segment
            try:
                self._latest = number, self.coder.decoded(self.payloads[number], len(part))
            except ValueError as error:
                raise self._damaged(number, error) from None
        height = self.structure.size[1]
        return self.structure.with_pixels(self._latest[1][instant * height : (instant + 1) * height])

    def component(self, frame: int, kind: str, place: tuple[int, int]) -> NDArray[Any] | None:
        """Decode one component image from its group of pictures; None if the stream codes images of another kind."""
        number, instant, part = self._place(frame)
        if kind != self.coder.coder.kind or (self._latest is not None and self._latest[0] == number):
            return None
        try:
            return self.coder.component(self.payloads[number], len(part), instant, place)
        except ValueError as error:
            raise self._damaged(number, error) from None

    def _damaged(self, number: int, error: ValueError) -> ValueError:
        return ValueError(f"{self.name} is damaged in segment {number + 1}: {error}")

    def _place(self, frame: int) -> tuple[int, int, range]:
        parts = self.plan.segments(self.frames)
        number = frame // len(parts[0])
        return number, frame - parts[number].start, parts[number]
