"""The encoder's estimate of the disparity between neighbouring views: its range, and its sign along columns."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .blocks import Job
from .search import fill_volume

REACH = 32  # samples between neighbouring views
UNIT = 64
AGGREGATED = 4  # blocks of 4×4 a side that are matched as one
DISTINCT = 0.5  # the error at the best disparity is at most this part of the median over all
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
    row, col = grid[0] // 2, grid[1] // 2
    near = [(row, col - 1), (row, col + 1), (row - 1, col), (row + 1, col)]
    near = [(r, c) for r, c in near if 0 <= r < grid[0] and 0 <= c < grid[1]]
    if not near:
        return 0, 0, 1
    original = view(row, col)
    views = np.stack([view(r, c) for r, c in near])
    found = []
    for down in (1, -1) if grid[0] > 1 and grid[1] > 1 else (1,):
        references = np.array([(i, c - col, down * (r - row)) for i, (r, c) in enumerate(near)], np.int64)
        found.append((*_matched(views, original, references), down))
    _, low, high, down = min(found, key=lambda one: one[0])
    return low, high, down


def _matched(
    views: NDArray[np.int16], original: NDArray[np.int16], references: NDArray[np.int64]
) -> tuple[float, int, int]:
    """Error at the best disparities, and the range of those that are distinct."""
    reach = min(REACH, max(original.shape[1:]) // 2) * 256 // UNIT
    height, width = original.shape[1:]
    volume = np.zeros((2 * reach + 1, len(references), height // 4, width // 4), np.float32)
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
        step=1,
        blocks=blank,
        levels=blank,
    )
    fill_volume(job, original, volume, 1)
    errors = volume.sum(axis=1)
    size = AGGREGATED
    rows, cols = -(-errors.shape[1] // size) * size, -(-errors.shape[2] // size) * size
    padded = np.zeros((len(errors), rows, cols), np.float32)
    padded[:, : errors.shape[1], : errors.shape[2]] = errors
    cells = padded.reshape(len(errors), rows // size, size, cols // size, size).sum(axis=(2, 4))
    cells = cells.reshape(len(errors), -1)
    best = cells.argmin(axis=0)
    least = cells.min(axis=0)
    distinct = best[least < DISTINCT * np.median(cells, axis=0)]
    if not len(distinct):
        return float(least.sum()), -UNIT, UNIT
    # Things near the plane of the display may be smaller than a cell: zero is always within the range.
    low, high = min(int(distinct.min()) - reach, 0) * UNIT, max(int(distinct.max()) - reach, 0) * UNIT
    return float(least.sum()), low - MARGIN, high + MARGIN
