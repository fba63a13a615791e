"""Dyadic wavelets along the slice axis of a volume, by lifting in place.

Rows are slices, and rows do not move. After a transform, every 2^levels-th row from row 0 on holds the lowest band. A
row whose number has t trailing zero bits holds a sample of the high band of level t + 1. Ends are extended by
whole-sample symmetry, as in JPEG 2000, for any number of rows.

The filters are the lifting steps of Part 1 without its scaling steps. `synthesis_gains` returns the growth of an
error in each row; rows scaled by it contribute equally to a squared error.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ii_core.base.jit import exact_stage_kernel, kernel

# Alternately predictions of odd rows from even ones and updates of even rows from odd ones.
STEPS = {
    "5/3": (-0.5, 0.25),
    "9/7": (-1.586134342059924, -0.052980118572961, 0.882911075530934, 0.443506852043971),
}


def steps(wavelet: str) -> NDArray[np.float32]:
    """Return the lifting factors of a wavelet for `forward` and `backward`."""
    return np.array(STEPS[wavelet], np.float32)


@kernel
def forward(rows, factors, levels):
    """Transform float rows (J, n) in place."""
    for level in range(levels):
        for i in range(factors.size):
            _lift(rows, 1 << level, (i + 1) % 2, factors[i])


@kernel
def backward(rows, factors, levels):
    """Invert `forward`, within rounding."""
    for level in range(levels - 1, -1, -1):
        for i in range(factors.size - 1, -1, -1):
            _lift(rows, 1 << level, (i + 1) % 2, -factors[i])


@kernel
def forward_reversible(rows, levels):
    """Transform rows of whole numbers (J, n) in place by the reversible 5/3."""
    for level in range(levels):
        _lift_whole(rows, 1 << level, 1, 1)
        _lift_whole(rows, 1 << level, 0, 1)


@kernel
def backward_reversible(rows, levels):
    """Invert `forward_reversible` exactly."""
    for level in range(levels - 1, -1, -1):
        _lift_whole(rows, 1 << level, 0, -1)
        _lift_whole(rows, 1 << level, 1, -1)


@exact_stage_kernel
def _neighbours(count, step, row):
    """Return the rows at a distance before and after a row; beyond an end, the row on the other side."""
    before, after = row - step, row + step
    if before < 0:
        before = after
    if after >= count:
        after = before
    return before, after


@exact_stage_kernel
def _lift(rows, step, odd, factor):
    """Add to every even or odd row of the grid of ``step`` the sum of its neighbours times a factor."""
    if rows.shape[0] > step:  # a single row has no neighbours and is its own low band
        for row in range(odd * step, rows.shape[0], 2 * step):
            before, after = _neighbours(rows.shape[0], step, row)
            for x in range(rows.shape[1]):
                rows[row, x] += factor * (rows[before, x] + rows[after, x])


@exact_stage_kernel
def _lift_whole(rows, step, odd, sign):
    """Lift with the rounding of the reversible 5/3: odd rows −⌊(a + b)/2⌋, even rows +⌊(a + b + 2)/4⌋."""
    if rows.shape[0] > step:
        for row in range(odd * step, rows.shape[0], 2 * step):
            before, after = _neighbours(rows.shape[0], step, row)
            for x in range(rows.shape[1]):
                total = rows[before, x] + rows[after, x]
                if odd:
                    rows[row, x] -= sign * (total >> 1)
                else:
                    rows[row, x] += sign * ((total + 2) >> 2)


def synthesis_gains(wavelet: str, levels: int, count: int) -> NDArray[np.float32]:
    """Return the growth of an error in each row: the L2 norm of its synthesis waveform, away from the ends.

    Parameters
    ----------
    wavelet : {"5/3", "9/7"}
    levels, count : int
        Levels of the transform, number of rows.

    Returns
    -------
    ndarray of float32, (count,)
    """
    gains = np.array(_band_gains(wavelet, levels))
    row = np.arange(count)
    band = np.full(count, levels)
    for level in range(levels - 1, -1, -1):
        band[row % (2 << level) == 1 << level] = level
    return gains[band].astype(np.float32)


@lru_cache
def _band_gains(wavelet: str, levels: int) -> tuple[float, ...]:
    """Return the gains of the high bands from level 1 up, then that of the low band."""
    # The longest waveform spans less than 16 samples of the lowest band.
    middle = 16 << levels
    impulses = np.zeros((2 * middle, levels + 1), np.float32)
    for level in range(levels):
        impulses[middle + (1 << level), level] = 1
    impulses[middle, levels] = 1
    backward(impulses, steps(wavelet), levels)
    return tuple(map(float, np.linalg.norm(impulses, axis=0)))
