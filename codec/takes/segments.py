"""Segments of a take as pseudo video sequences: frames of several instants, gathered from and scattered to them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core import IIPicture

from ..coders.pseudo_video import PseudoVideo
from ..contract import Value
from ..frames import Film
from .order import Plan


@dataclass(frozen=True, kw_only=True)
class SegmentFilm(Film):
    """Frames of a segment: component images of several instants, whose pictures lie one after another."""

    plan: Plan
    instants: int

    @property
    def frames(self) -> int:
        """Number of frames, of all instants."""
        return (self.layout.frames * self.instants if self.stop is None else self.stop) - self.start

    def origins(self) -> NDArray[np.int64]:
        """The first pixel of each frame in the stack of pictures."""
        views = self.layout.origins(self.order, self.by)
        table = self.plan.table(self.layout.frames, self.instants)
        picture = self.layout.frames * self.layout.height * self.layout.width
        return (views[table[:, 0]] + table[:, 1] * picture)[self.start : self.stop]


def segment_film(
    coder: PseudoVideo[Any], structure: IIPicture, options: Mapping[str, Value], plan: Plan, instants: int
) -> SegmentFilm:
    """Return the frames of a segment of so many instants."""
    still = coder.film(structure, options)
    return SegmentFilm(**{f.name: getattr(still, f.name) for f in fields(Film)}, plan=plan, instants=instants)


def segment_options(
    coder: PseudoVideo[Any], options: Mapping[str, Value], plan: Plan, views: int, instants: int
) -> dict[str, Value]:
    """Return the options with the group of pictures in frames."""
    if not plan.group:
        return dict(options)
    if "gop" not in coder.options:
        raise ValueError(f"group is {plan.group}: scheme {coder.name} has no groups of pictures, 0 is needed")
    return {**options, "gop": plan.group_frames(views, instants)}
