"""The encoder's estimate of the disparity between neighbouring views: its range, and where it leads on the grid."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .matching import fill_errors
from .rig import Rig, departing
from .state import Job
from .stream import UPRIGHT
from .transform import LARGEST

REACH = 32  # samples between neighbouring views
UNIT = 64
LARGE, SMALL = 4, 2  # blocks of 4×4 a side that are matched as one, a cell
DISTINCT = 0.5  # the error at the best disparity is at most this part of the median over all,
# and disparities of up to 1.5 times that error lie within so many units, by size: those of flat sky do not.
ALIKE, NARROW = 1.5, {LARGE: 8 * 256 // UNIT, SMALL: 2 * 256 // UNIT}
MARGIN = 128  # half a sample
# Lattices are compared if disparities reach so far: 1.5 samples. Another one is taken if it fits so much better.
FAR, WORTH_SKEWING = 384, 0.9
STEPS = (64, 64, 64, 32, 32, 16, 16, 8, 8, 4)


Views = Callable[[int, int], NDArray[np.int16]]
Lattice = tuple[int, int, int]


def estimated(view: Views, grid: tuple[int, int], *, skewed: bool = True) -> tuple[int, int, Lattice]:
    """Least and greatest disparity, and the lattice of the views; all as in the header.

    Parameters
    ----------
    view : callable
        Planes (3, H, W) of the view at (row, column).
    grid : (int, int)
        Rows and columns of views.
    skewed : bool
        Whether the lattice may be other than upright.
    """
    middle = grid[0] // 2, grid[1] // 2
    signs = (1, -1) if grid[0] > 1 and grid[1] > 1 else (1,)
    upright: list[Lattice] = [(0, 0, sign * UPRIGHT) for sign in signs]
    found = [cell_errors(view, grid, middle, lattice) for lattice in upright]
    errors, lattice = min(zip(found, upright, strict=True), key=lambda one: _misfit(one[0]))
    low, high = _range(view, grid, middle, errors, lattice)
    if skewed and max(-low, high) - MARGIN >= FAR:
        other = _best_lattice(view, grid, middle, lattice, (low, high))
        if other != lattice:
            lattice = other
            low, high = _range(view, grid, middle, cell_errors(view, grid, middle, lattice), lattice)
    return low, high, lattice


def moved_range(view: Views, grid: tuple[int, int], lattice: Lattice, rig: Rig) -> tuple[int, int]:
    """Return least and greatest disparity of views beside their places."""
    middle = grid[0] // 2, grid[1] // 2
    return _range(view, grid, middle, cell_errors(view, grid, middle, lattice, rig=rig), lattice, rig)


def _range(
    view: Views,
    grid: tuple[int, int],
    middle: tuple[int, int],
    errors: NDArray[np.float32],
    lattice: Lattice,
    rig: Rig | None = None,
) -> tuple[int, int]:
    """Return least and greatest disparity from those of the middle view and of four others."""
    # Views near the corners see what the one in the middle does not.
    rows, cols = ({count // 6, count - 1 - count // 6} for count in grid)
    others = sorted({(row, col) for row in rows for col in cols} - {middle})
    best = [_distinct(errors, LARGE), _distinct(errors, SMALL)]
    best += [_distinct(cell_errors(view, grid, place, lattice, rig=rig), SMALL) for place in others]
    distinct = np.concatenate(best) - len(errors) // 2
    if not len(distinct):
        return -UNIT, UNIT
    # Things near the plane of the display may be smaller than a cell: zero is always within the range.
    return min(int(distinct.min()), 0) * UNIT - MARGIN, max(int(distinct.max()), 0) * UNIT + MARGIN


def _best_lattice(
    view: Views, grid: tuple[int, int], middle: tuple[int, int], upright: Lattice, within: tuple[int, int]
) -> Lattice:
    """Return the lattice by which the middle view fits its neighbours best; the upright one unless it fits worse."""
    limits, kept = (within[0] // UNIT, -(-within[1] // UNIT)), cache(view)

    def misfit(lattice: Lattice) -> float:
        return _misfit(cell_errors(kept, grid, middle, lattice, limits))

    best, least = upright, misfit(upright)
    bound = least * WORTH_SKEWING
    for step in STEPS:
        for place in range(3):
            for sign in (1, -1):
                values = list(best)
                values[place] += sign * step
                tried = values[0], values[1], values[2]
                error = misfit(tried)
                if error < least:
                    best, least = tried, error
                    break
    return best if least < bound else upright


def _misfit(errors: NDArray[np.float32]) -> float:
    """Return the sum of the least errors of large cells."""
    return float(_cells(errors, LARGE).min(axis=0).sum())


def cell_errors(
    view: Views,
    grid: tuple[int, int],
    place: tuple[int, int],
    lattice: Lattice,
    limits: tuple[int, int] | None = None,
    rig: Rig | None = None,
) -> NDArray[np.float32]:
    """Squared error (disparities, H / 4, W / 4) of a view against its neighbours.

    Disparities are those within limits, or as far as `REACH` on either side of zero.
    """
    row, col = place
    near = [(row, col - 1), (row, col + 1), (row - 1, col), (row + 1, col)]
    near = [(r, c) for r, c in near if 0 <= r < grid[0] and 0 <= c < grid[1]]
    if not near:
        return np.zeros((1, 1, 1), np.float32)
    references = offsets(place, near, lattice, grid, rig)
    original, views = view(row, col), np.stack([view(r, c) for r, c in near])
    reach = min(REACH, max(original.shape[1:]) // 2) * 256 // UNIT
    low, high = limits or (-reach, reach)
    height, width = original.shape[1:]
    errors = np.zeros((high - low + 1, height // 4, width // 4), np.float32)
    blank = np.zeros((1, 1, 1), np.int16)
    job = Job(
        views=views,
        disparities=blank,
        at=0,
        references=references,
        unit=UNIT,
        low=low,
        high=high,
        made=blank,
        disparity=blank[0],
        doubt=blank[0],
        synthesised=0,
        crossed=0,
        skipping=0,
        step=1,
        blocks=blank,
        levels=blank,
    )
    at_once = width if rig is None else LARGEST  # columns of one shift
    rows = (np.zeros(size, np.float32) for size in (at_once + 1, 4 * at_once, at_once))
    fill_errors(job, original, *rows, errors)
    return errors


def offsets(
    place: tuple[int, int],
    others: Sequence[tuple[int, int]],
    lattice: Lattice,
    grid: tuple[int, int],
    rig: Rig | None = None,
) -> NDArray[np.int64]:
    """Return number, columns and rows (J, 3) of how far other views are on the lattice, as `state.Job` has them."""
    (row, col), (across, down, apart) = place, lattice
    rows = [
        (i, UPRIGHT * (c - col) + across * (r - row), down * (c - col) + apart * (r - row))
        for i, (r, c) in enumerate(others)
    ]
    found = np.array(rows, np.int64).reshape(-1, 3)
    return found if rig is None else departing(found, row * grid[1] + col, [r * grid[1] + c for r, c in others], rig)


def over_squares(errors: NDArray[Any]) -> NDArray[Any]:
    """Return errors (disparities, rows, columns) of cells, summed over 3×3 cells."""
    for axis in (1, 2):
        before, after = beside(errors, axis)
        errors = before + errors + after
    return errors


def beside(values: NDArray[Any], axis: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return what stands before and after each value along an axis; the outermost ones are repeated."""
    places, last = np.arange(values.shape[axis]), values.shape[axis] - 1
    return values.take(np.maximum(places - 1, 0), axis), values.take(np.minimum(places + 1, last), axis)


def _cells(errors: NDArray[np.float32], size: int) -> NDArray[np.float32]:
    """Errors (disparities, cells) summed over cells of so many blocks a side."""
    rows, cols = (-(-count // size) * size for count in errors.shape[1:])
    padded = np.zeros((len(errors), rows, cols), np.float32)
    padded[:, : errors.shape[1], : errors.shape[2]] = errors
    cells = padded.reshape(len(errors), rows // size, size, cols // size, size).sum(axis=(2, 4))
    return cells.reshape(len(errors), -1)


def _distinct(errors: NDArray[np.float32], size: int) -> NDArray[np.int64]:
    """Best disparities, counted from the least, of cells that fit there much better than elsewhere."""
    cells = _cells(errors, size)
    least = cells.min(axis=0)
    alike = cells < ALIKE * least
    last = len(cells) - 1 - alike[::-1].argmax(axis=0)
    narrow = last - alike.argmax(axis=0) <= NARROW[size]
    return cells.argmin(axis=0)[narrow & (least < DISTINCT * np.median(cells, axis=0))]
