"""Order Γ of the component images of a take over view and time.

A component image of a take has a view, its place j in the order Γ of a still (5.2), and an instant τ. A *segment* of
``span`` instants is a stream of its own. Within it, ``group`` views × ``span`` instants are a group of pictures that
starts with an I picture and needs no other group. A *walk* orders the frames of a group. Consecutive frames of every
walk are neighbours in view or in time: every second line runs backwards, as in the order ``parallel``.

===========  =========================================================================================
walk         frames of a group
===========  =========================================================================================
time-first   view by view, each a film over the instants
view-first   instant by instant, each a pseudo video over the views
interleaved  strips of ``strip`` views; in each strip instant by instant. Both neighbours of a frame, the
             last view and the last instant, are at most 2·strip − 1 frames back: an encoder with as many
             reference pictures predicts from both
===========  =========================================================================================
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ii_core.base import checks

from ..checks import check_type, whole

WALKS = ("time-first", "view-first", "interleaved")
Table = NDArray[np.int64]
MOST_FRAMES = 1 << 24  # largest views × instants of an access cost


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Order and groups of a take.

    Parameters
    ----------
    walk : {"time-first", "view-first", "interleaved"}
    span : int
        Instants of a segment, the group of pictures in time; 0 for the whole take.
    group : int
        Views of a group of pictures, a divisor of their number J; 0 for all.
    strip : int
        Views of a strip of the interleaved walk.

    Raises
    ------
    TypeError, ValueError
        If the walk is unknown or a number is negative.
    """

    walk: str = "view-first"
    span: int = 8
    group: int = 0
    strip: int = 4

    def __post_init__(self) -> None:
        if not isinstance(self.walk, str) or self.walk not in WALKS:
            raise ValueError(f"unknown walk {self.walk!r}: known are {', '.join(WALKS)}")
        for name, least in (("span", 0), ("group", 0), ("strip", 1)):
            whole(name, getattr(self, name), least, 1 << 30)

    def check(self, views: int) -> None:
        """Raise ValueError unless the groups divide the views."""
        if self.group and views % self.group:
            raise ValueError(f"group is {self.group} views: a divisor of their number {views}, or 0, is needed")

    def count(self, instants: int) -> int:
        """Number of segments of a take."""
        whole("instants", instants, 1, 1 << 30)
        return -(-instants // (self.span or instants))

    def segments(self, instants: int) -> list[range]:
        """Instants of each segment of a take."""
        whole("instants", instants, 1, 1 << 30)
        span = self.span or instants
        return [range(first, min(first + span, instants)) for first in range(0, instants, span)]

    def group_frames(self, views: int, instants: int) -> int:
        """Return the number of frames of a group of pictures in a segment of so many instants."""
        return (self.group or views) * instants

    def table(self, views: int, instants: int) -> Table:
        """(view, instant) of every frame of a segment, (views · instants, 2)."""
        self.check(views)
        return _table(self.walk, views, instants, self.group or views, self.strip)


@lru_cache(maxsize=64)
def _table(walk: str, views: int, instants: int, group: int, strip: int) -> Table:
    blocks = [(first, min(first + group, views)) for first in range(0, views, group)]
    strips = [
        (start, min(strip, stop - start) if walk == "interleaved" else stop - start)
        for first, stop in blocks
        for start in range(first, stop, strip if walk == "interleaved" else stop - first)
    ]
    if walk == "time-first":
        lines = [_snake(instants, width, start)[:, ::-1] for start, width in strips]
    else:
        lines = [_snake(width, instants) + np.array([start, 0]) for start, width in strips]
    table = np.concatenate(lines)
    table.flags.writeable = False
    return table


def _snake(width: int, height: int, first: int = 0) -> Table:
    """(column, row) row by row from row ``first``, every second row backwards."""
    columns = np.tile(np.arange(width), (height, 1))
    columns[1::2] = columns[1::2, ::-1].copy()
    return np.stack([columns.ravel(), np.repeat(first + np.arange(height), width)], axis=1)


@dataclass(frozen=True, kw_only=True)
class AccessCost:
    """Number of frames decoded to show one image at one instant: statistics over all places and instants."""

    mean: float
    worst: int


def component_cost(plan: Plan, views: int, instants: int) -> AccessCost:
    """Return the cost of one component image: the frames of its group up to it, without B pictures.

    The mean is (G + 1)/2 for groups of G frames, the worst case G.

    Raises
    ------
    TypeError, ValueError
        If an argument is of another type or out of range.
    """
    _check_counts(plan, views, instants)
    costs = [
        np.arange(len(plan.table(views, len(part)))) % plan.group_frames(views, len(part)) + 1
        for part in plan.segments(instants)
    ]
    every = np.concatenate(costs)
    return AccessCost(mean=float(every.mean()), worst=int(every.max()))


def view_cost(plan: Plan, views: int, instants: int, needed: Sequence[int]) -> AccessCost:
    """Return the cost of a view image at one instant: for each group, the frames up to the last one needed.

    Parameters
    ----------
    needed : sequence of int
        Places j of the component images in the order Γ of a still.

    Raises
    ------
    TypeError, ValueError
        If an argument is of another type or out of range.
    """
    _check_counts(plan, views, instants)
    checks.sequence("needed", needed)
    wanted = {whole("needed", place, 0, MOST_FRAMES) for place in needed}
    if not wanted or max(wanted) >= views:
        raise ValueError(f"needed is {list(needed)[:5]}: one or more of the {views} views, from 0, are needed")
    costs: list[int] = []
    for part in plan.segments(instants):
        table, size = plan.table(views, len(part)), plan.group_frames(views, len(part))
        for instant in range(len(part)):
            at = np.flatnonzero((table[:, 1] == instant) & np.isin(table[:, 0], list(wanted)))
            last = np.zeros(len(table) // size, np.int64)
            np.maximum.at(last, at // size, at % size + 1)
            costs.append(int(last.sum()))
    return AccessCost(mean=float(np.mean(costs)), worst=max(costs))


def _check_counts(plan: Plan, views: int, instants: int) -> None:
    check_type("plan", plan, Plan, "a Plan")
    whole("views", views, 1, MOST_FRAMES)
    whole("instants", instants, 1, MOST_FRAMES // views)
    plan.check(views)
