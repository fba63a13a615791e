"""The encoder's estimate of the disparity between neighbouring views: its range, and its sign along columns."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .blocks import Job
from .matching import DIAGONAL, fill_products, new_match
from .transform import LARGEST

REACH = 32  # samples between neighbouring views
UNIT = 64
LARGE, SMALL = 4, 2  # blocks of 4×4 a side that are matched as one, a cell
DISTINCT = 0.5  # the error at the best disparity is at most this part of the median over all,
# and disparities of up to 1.5 times that error lie within so many units, by size: those of flat sky do not.
ALIKE, NARROW = 1.5, {LARGE: 8 * 256 // UNIT, SMALL: 2 * 256 // UNIT}
MARGIN = 128  # half a sample


def estimated(view: Callable[[int, int], NDArray[np.int16]], grid: tuple[int, int]) -> tuple[int, int, int]:
    """Least and greatest disparity, and 1, or -1 where columns have the other sign; all as in the header.

    Parameters
    ----------
    view : callable
        Planes (3, H, W) of the view at (row, column).
    grid : (int, int)
        Rows and columns of views.
    """
    middle = grid[0] // 2, grid[1] // 2
    signs = (1, -1) if grid[0] > 1 and grid[1] > 1 else (1,)
    found = [_errors(view, grid, middle, down) for down in signs]
    errors, down = min(zip(found, signs, strict=True), key=lambda one: float(_cells(one[0], LARGE).min(axis=0).sum()))
    # Views near the corners see what the one in the middle does not.
    rows, cols = ({count // 6, count - 1 - count // 6} for count in grid)
    others = sorted({(row, col) for row in rows for col in cols} - {middle})
    best = [_distinct(errors, LARGE), _distinct(errors, SMALL)]
    best += [_distinct(_errors(view, grid, place, down), SMALL) for place in others]
    distinct = np.concatenate(best) - len(errors) // 2
    if not len(distinct):
        return -UNIT, UNIT, down
    # Things near the plane of the display may be smaller than a cell: zero is always within the range.
    return min(int(distinct.min()), 0) * UNIT - MARGIN, max(int(distinct.max()), 0) * UNIT + MARGIN, down


def _errors(
    view: Callable[[int, int], NDArray[np.int16]], grid: tuple[int, int], place: tuple[int, int], down: int
) -> NDArray[np.float32]:
    """Squared error (disparities, H / 4, W / 4) of a view against its neighbours; the middle disparity is zero."""
    row, col = place
    near = [(row, col - 1), (row, col + 1), (row - 1, col), (row + 1, col)]
    near = [(r, c) for r, c in near if 0 <= r < grid[0] and 0 <= c < grid[1]]
    if not near:
        return np.zeros((1, 1, 1), np.float32)
    references = np.array([(i, c - col, down * (r - row)) for i, (r, c) in enumerate(near)], np.int64)
    original, views = view(row, col), np.stack([view(r, c) for r, c in near])
    reach = min(REACH, max(original.shape[1:]) // 2) * 256 // UNIT
    height, width = original.shape[1:]
    errors = np.zeros((2 * reach + 1, height // 4, width // 4), np.float32)
    blank = np.zeros((1, 1, 1), np.int16)
    job = Job(
        views=views,
        disparities=blank,
        at=0,
        references=references,
        unit=UNIT,
        low=-reach,
        high=reach,
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
    match = new_match(2 * reach + 1, 1)
    for y0 in range(0, height, LARGEST):
        for x0 in range(0, width, LARGEST):
            fill_products(job, original, y0, x0, match)
            rows, cols = min(LARGEST, height - y0) // 4, min(LARGEST, width - x0) // 4
            squares = match.products[:rows, :cols, DIAGONAL[: len(references)]].sum(axis=2)
            errors[:, y0 // 4 : y0 // 4 + rows, x0 // 4 : x0 // 4 + cols] = squares.transpose(2, 0, 1)
    return errors


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
