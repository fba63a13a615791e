"""Encoder's noise reduction of a view that predicts many others: its mean with neighbours, along the disparity.

After temporal filters before video encoders (Enhorn et al., A temporal pre-filter for video coding based on bilateral
filtering, ICIP 2020). Noise of a view predicts no other view, and costs most bits where the quantiser is finest.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ii_core.base.jit import array_kernel

from .pyramid import Place
from .ranges import UNIT, Lattice, cell_errors, offsets, over_squares
from .rig import Rig
from .transform import LARGEST
from .warp import led, moved_block

# The best whole unit of disparity is found by bilinear interpolation. These beside it are then compared in so many
# views, with the filters of prediction.
PARTS, NEAREST = range(-48, 49, 16), 4
REACH = 1  # rows and columns of views around it that a view is averaged with
# The noise of a cell of 4×4 samples is this quantile of the misfits of as many cells of about the same luma; a
# neighbour's weight falls as a normal distribution of its misfit.
GROUPS, QUANTILE = 8, 0.3
MOST = 0.1  # of the quantiser's step: misfits beyond are no noise that the step hides


def denoised(
    view: Callable[[int, int], NDArray[np.int16]],
    grid: Place,
    place: Place,
    lattice: Lattice,
    limits: tuple[int, int],
    step: int,
    rig: Rig | None = None,
) -> NDArray[np.int16]:
    """Planes (3, H, W) of a view with less noise.

    Parameters
    ----------
    view : callable
        Planes of the view at (row, column).
    grid, place : (int, int)
        Rows and columns of views; row and column of the view.
    lattice : (int, int, int)
        As in the header.
    limits : (int, int)
        Least and greatest disparity, in 2^-8 samples.
    step : int
        Of the quantiser of most views, in 2^-7 of an 8-bit code.
    rig : Rig, optional
        Departures of views from the lattice.
    """
    (row, col), original = place, view(*place)
    near = [
        (r, c)
        for r in range(max(0, row - REACH), min(grid[0], row + REACH + 1))
        for c in range(max(0, col - REACH), min(grid[1], col + REACH + 1))
        if (r, c) != place
    ]
    if not near:
        return original
    near.sort(key=lambda other: (abs(other[0] - row) + abs(other[1] - col), other))
    views, references = np.stack([view(*other) for other in near]), offsets(place, near, lattice, grid, rig)
    first, last = limits[0] // UNIT, -(-limits[1] // UNIT)
    errors = over_squares(cell_errors(view, grid, place, lattice, (first, last), rig))
    disparity = UNIT * (first + errors.argmin(axis=0))
    moved = np.empty((len(near), *original.shape), np.int16)
    misfits = np.empty((len(near), *disparity.shape))
    fits = []
    for part in PARTS:
        _move(views, references[:NEAREST], disparity + part, original[:1], moved, misfits)
        fits.append(misfits[:NEAREST].sum(axis=0))
    disparity += np.array(PARTS)[over_squares(np.stack(fits)).argmin(axis=0)]
    _move(views, references, disparity, original, moved, misfits)
    noise = np.minimum(_noise(original[0], np.median(misfits, axis=0)), (MOST * step / 16) ** 2)
    apart = np.array([np.hypot(r - row, c - col) for r, c in near])
    weights = np.exp(-misfits / (2 * noise + 1e-6)) / np.sqrt(apart)[:, None, None]
    weights = weights.repeat(4, axis=1).repeat(4, axis=2)
    total = original + np.einsum("ryx,rpyx->pyx", weights, moved)
    return np.rint(total / (1 + weights.sum(axis=0))).astype(np.int16)


def _noise(luma: NDArray[np.int16], misfits: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the squared misfit that noise alone makes, by cell: noise depends on luma."""
    rows, cols = misfits.shape
    order = luma.reshape(rows, 4, cols, 4).mean(axis=(1, 3)).argsort(axis=None, kind="stable")
    noise = np.empty(misfits.size)
    for group in np.array_split(order, min(GROUPS, len(order))):
        noise[group] = np.quantile(misfits.ravel()[group], QUANTILE)
    return noise.reshape(rows, cols)


@array_kernel
def _move(views, references, disparity, original, moved, misfits):
    """moved[r] = a view's planes along the disparity, misfits[r] their mean squared difference by cell.

    Planes are as many as the original has.
    """
    rows = np.zeros((LARGEST + 6, LARGEST + 8), np.int32)
    block = np.zeros((3, LARGEST, LARGEST), np.int32)
    planes = len(original)
    for r in range(len(references)):
        for by in range(disparity.shape[0]):
            for bx in range(disparity.shape[1]):
                d, total, y0, x0 = disparity[by, bx], np.int64(0), 4 * by, 4 * bx
                dy, dx = led(references, r, d, y0, x0, views.shape[2:])
                for p in range(planes):
                    for y in range(4):
                        for x in range(4):
                            block[p, y, x] = 0
                    moved_block(views, references[r, 0], p, y0, x0, 4, 4, dy, dx, rows, block)
                    for y in range(4):
                        for x in range(4):
                            value = (block[p, y, x] + 2048) >> 12
                            moved[r, p, y0 + y, x0 + x] = value
                            total += (original[p, y0 + y, x0 + x] - value) ** 2
                misfits[r, by, bx] = total / (16 * planes)
