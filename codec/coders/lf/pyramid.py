"""In what order the views on a grid are coded, by levels of ever closer views, and which ones predict which."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

Place = tuple[int, int]
NEAREST = 24  # decoded views among which references are looked for
ALIKE = 81, 95  # hundredths of the squared cosine between two directions that are alike: of references, of sources


@dataclass(frozen=True)
class Node:
    """A view: its row and column on the grid, its level, and the decoded views near it, the nearest first."""

    row: int
    col: int
    level: int
    references: tuple[Place, ...]
    sources: tuple[Place, ...]


@lru_cache(maxsize=16)
def pyramid(rows: int, cols: int, log_stride: int, references: int, sources: int) -> tuple[tuple[Node, ...], ...]:
    """Views by level. The first level has every 2^log_stride-th row and column, and the last ones of the grid.

    Every further level halves the stride, the centres of squares first.

    Parameters
    ----------
    references, sources : int
        How many views predict a block, and a synthesised view, at most.
    """
    levels: list[tuple[Node, ...]] = []
    done: dict[Place, None] = {}
    for level in range(log_stride + 1):
        stride = 1 << (log_stride - level)
        grid = [(row, col) for row in _stops(rows, stride) for col in _stops(cols, stride) if (row, col) not in done]
        if level == 0:
            middle = (_nearest_stop(rows, stride), _nearest_stop(cols, stride))
            grid.sort(key=lambda place: (_apart(place, middle), place))
        else:
            grid.sort(key=lambda place: (not (place[0] % (2 * stride) and place[1] % (2 * stride)), place))
        nodes = []
        for row, col in grid:
            near = _near(done, (row, col), 2 * stride)
            predicting = _spread(near, (row, col), references, ALIKE[0]), _spread(near, (row, col), sources, ALIKE[1])
            nodes.append(Node(row, col, level, *predicting))
            done[row, col] = None
        levels.append(tuple(nodes))
    return tuple(levels)


def _stops(count: int, stride: int) -> list[int]:
    return sorted({*range(0, count, stride), count - 1})


def _nearest_stop(count: int, stride: int) -> int:
    return min(_stops(count, stride), key=lambda stop: (abs(2 * stop - count + 1), stop))


def _near(done: dict[Place, None], place: Place, reach: int) -> list[Place]:
    """Decoded views by distance; within ``reach`` if there are enough."""
    row, col = place
    across = range(col - reach, col + reach + 1)
    window = [(r, c) for r in range(row - reach, row + reach + 1) for c in across if (r, c) in done]
    found = window if len(window) >= 8 else list(done)
    return sorted(found, key=lambda other: (_apart(other, place), other))[:NEAREST]


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
