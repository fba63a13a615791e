"""Coding order of the views on a grid: levels of increasing density, and the references of each view.

A level has *phases*: views of one phase do not predict each other, so that they may be coded at the same time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

Place = tuple[int, int]
BATCH = 16  # views that are held in memory at once
NEAREST = 24  # decoded views among which references are looked for
ALIKE = 81, 95  # hundredths of the squared cosine between two directions that are alike: of references, of sources


@dataclass(frozen=True)
class Node:
    """A view: its row and column on the grid, level and phase, and the decoded views near it, the nearest first."""

    row: int
    col: int
    level: int
    phase: int
    references: tuple[Place, ...]
    sources: tuple[Place, ...]


@lru_cache(maxsize=16)
def pyramid(rows: int, cols: int, log_stride: int, references: int, sources: int) -> tuple[tuple[Node, ...], ...]:
    """Views by level. The first level is the view in the middle; it predicts all others, directly or not.

    The second level has every 2^log_stride-th row and column, and the last ones of the grid. Its views are a phase
    each. Every further level halves the stride; the centres of squares are its first phase, the other views its
    second.

    Parameters
    ----------
    references, sources : int
        How many views predict a block, and a synthesised view, at most.
    """
    middle = (rows // 2, cols // 2)
    levels: list[tuple[Node, ...]] = [(Node(*middle, 0, 0, (), ()),)]
    done = np.zeros((rows, cols), bool)
    done[middle] = True
    for level in range(1, log_stride + 2):
        stride = 1 << (log_stride + 1 - level)
        grid = [(row, col) for row in _stops(rows, stride) for col in _stops(cols, stride) if not done[row, col]]
        if level == 1:
            grid.sort(key=lambda place: (_apart(place, middle), place))
            phases = [[place] for place in grid]
        else:
            phases = [
                [place for place in grid if _amid(place, stride)],
                [place for place in grid if not _amid(place, stride)],
            ]
        nodes = []
        for phase, places in enumerate(phases):
            for place in places:
                near = _near(done, place, 2 * stride)
                predicting = _spread(near, place, references, ALIKE[0]), _spread(near, place, sources, ALIKE[1])
                nodes.append(Node(*place, level, phase, *predicting))
            for place in places:
                done[place] = True
        levels.append(tuple(nodes))
    return tuple(levels)


def batches(level: Sequence[Node]) -> Iterator[list[Node]]:
    """Views of a level that do not depend on each other, `BATCH` at most at a time."""
    for _, nodes in groupby(level, key=lambda node: node.phase):
        phase = list(nodes)
        for start in range(0, len(phase), BATCH):
            yield phase[start : start + BATCH]


def _amid(place: Place, stride: int) -> bool:
    """Whether a view is in the middle of four of the levels above."""
    return bool(place[0] % (2 * stride) and place[1] % (2 * stride))


def _stops(count: int, stride: int) -> list[int]:
    return sorted({*range(0, count, stride), count - 1})


def _near(done: NDArray[np.bool_], place: Place, reach: int) -> list[Place]:
    """Return the nearest decoded views by distance, then by row and column; of a square of ``reach`` if it has 8.

    Otherwise the square grows until no view outside it is among the nearest: 16 384 views in a row took 67 s when all
    decoded views were sorted for each (2026-11-23).
    """
    rows, cols = _within(done, place, reach)
    if len(rows) < 8:
        while reach < max(done.shape) and np.count_nonzero(_squared(rows, cols, place) <= reach**2) < NEAREST:
            reach = min(4 * reach, max(done.shape))
            rows, cols = _within(done, place, reach)
    order = np.lexsort((cols, rows, _squared(rows, cols, place)))[:NEAREST]
    return list(zip(rows[order].tolist(), cols[order].tolist(), strict=True))


def _within(done: NDArray[np.bool_], place: Place, reach: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return rows and columns of the decoded views in a square around a place."""
    top, left = (max(0, middle - reach) for middle in place)
    rows, cols = np.nonzero(done[top : place[0] + reach + 1, left : place[1] + reach + 1])
    return rows + top, cols + left


def _squared(rows: NDArray[np.intp], cols: NDArray[np.intp], place: Place) -> NDArray[np.intp]:
    """Return squared distances from a place."""
    return np.square(rows - place[0]) + np.square(cols - place[1])


def _spread(near: list[Place], place: Place, count: int, alike: int) -> tuple[Place, ...]:
    """The nearest of views that lie in different directions."""
    found: list[Place] = []
    for other in near:
        if len(found) < count and not any(_alike(other, kept, place, alike) for kept in found):
            found.append(other)
    return tuple(found)


def _apart(a: Place, b: Place) -> int:
    """Squared distance."""
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2


def _alike(one: Place, other: Place, place: Place, alike: int) -> bool:
    a, b = (one[0] - place[0], one[1] - place[1]), (other[0] - place[0], other[1] - place[1])
    product = a[0] * b[0] + a[1] * b[1]
    return product > 0 and 100 * product**2 > alike * _apart(one, place) * _apart(other, place)
