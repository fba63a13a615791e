"""Order Γ of component images as frames (5.2).

Component images lie on a grid of ``rows`` × ``cols`` (see `codec.frames.layout`) and have the flat index
``row * cols + col``. An order is the permutation that lists these indices frame by frame.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.int64]
BY = ("rows", "columns")


def selection_order(order: str, rows: int, cols: int, by: str = "rows") -> Indices:
    """Return Γ(j) for j = 0 … J−1: the component image of frame j.

    Parameters
    ----------
    order : {"row", "column", "parallel", "zigzag", "spiral"}
        Row by row; column by column; rows alternately rightward and leftward; anti-diagonals alternately down and up,
        as in JPEG blocks; or rings around the centre, outward.
    rows, cols : int
        The grid, at least 1 × 1.
    by : {"rows", "columns"}
        ``columns`` applies the order to the transposed grid.

    Returns
    -------
    ndarray of int64, (rows * cols,)
        Flat indices. Consecutive frames of ``parallel`` and ``spiral`` are neighbours on every grid.

    Raises
    ------
    ValueError
        If ``order`` or ``by`` is unknown, or the grid is empty.

    References
    ----------
    Olsson 2008, §5.5.2 and Figure 5.4. The figure's spiral is not legible. Ours starts at the centre, since the
    central view differs least from all others and makes the best single I picture; it ends in the upper left corner.
    """
    if order not in ORDERS:
        raise ValueError(f"unknown order {order!r}: known are {', '.join(ORDERS)}")
    if rows < 1 or cols < 1:
        raise ValueError(f"a grid of {rows}×{cols} component images has no order: at least 1×1 is needed")
    if by not in BY:
        raise ValueError(f"unknown by {by!r}: known are {', '.join(BY)}")
    grid = np.arange(rows * cols, dtype=np.int64).reshape(rows, cols)
    return np.ascontiguousarray(ORDERS[order](grid if by == "rows" else grid.T.copy()))


def inverse(permutation: NDArray[Any]) -> Indices:
    """Return the frame of each component image: ``inverse(p)[p[j]] == j``."""
    back = np.empty(len(permutation), np.int64)
    back[permutation] = np.arange(len(permutation))
    return back


def _parallel(grid: Indices) -> Indices:
    grid[1::2] = grid[1::2, ::-1].copy()
    return grid.ravel()


def _zigzag(grid: Indices) -> Indices:
    row, col = np.indices(grid.shape)
    diagonal = row + col
    along = np.where(diagonal % 2, row, -row)
    return grid.ravel()[np.lexsort((along.ravel(), diagonal.ravel()))]


def _spiral(grid: Indices) -> Indices:
    """Return the reverse of the clockwise path from the upper left corner inward."""
    peeled = []
    while grid.size:
        peeled.append(grid[0])
        grid = np.rot90(grid[1:])
    return np.concatenate(peeled)[::-1]


ORDERS: dict[str, Callable[[Indices], Indices]] = {
    "row": lambda grid: grid.ravel(),
    "column": lambda grid: grid.T.ravel(),
    "parallel": _parallel,
    "zigzag": _zigzag,
    "spiral": _spiral,
}
