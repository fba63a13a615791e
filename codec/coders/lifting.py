"""Dyadic wavelets along the slice axis of a volume, by lifting in place.

Rows are slices. After a transform row 0 and every 2^levels-th after it hold the lowest band, and a row j whose number
has t trailing zero bits holds a sample of the high band of level t + 1: no row moves. Ends are extended by
whole-sample symmetry, as in JPEG 2000, so that any number of rows will do.

The filters are the lifting steps of Part 1 without its scaling steps. Instead `synthesis_gains` tells for each row by
how much an error in it grows: scaled by these, all rows count alike in a squared error.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ii_core.jit import inline_kernel, kernel

# Alternately predictions of odd rows from even ones and updates of even rows from odd ones.
STEPS = {
    "5/3": (-0.5, 0.25),
    "9/7": (-1.586134342059924, -0.052980118572961, 0.882911075530934, 0.443506852043971),
}


def steps(wavelet: str) -> NDArray[np.float32]:
    """The lifting factors of a wavelet for `forward` and `backward`."""
    return np.array(STEPS[wavelet], np.float32)


@kernel
def forward(rows, factors, levels):
    """Transform float rows (J, n) in place."""
    for level in range(levels):
        for i in range(factors.size):
            _lift(rows, 1 << level, (i + 1) % 2, factors[i])


@kernel
def backward(rows, factors, levels):
    """The inverse of `forward`, but for rounding."""
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
    """The inverse of `forward_reversible`, exactly."""
    for level in range(levels - 1, -1, -1):
        _lift_whole(rows, 1 << level, 0, -1)
        _lift_whole(rows, 1 << level, 1, -1)


@inline_kernel
def _neighbours(count, step, row):
    """The rows before and after one at a distance, each the other's mirror image beyond the ends."""
    before, after = row - step, row + step
    if before < 0:
        before = after
    if after >= count:
        after = before
    return before, after


@inline_kernel
def _lift(rows, step, odd, factor):
    """Add to every even or odd one of the rows at a distance ``step`` its neighbours' sum times a factor."""
    if rows.shape[0] > step:  # a single row has no neighbours and is its own low band
        for row in range(odd * step, rows.shape[0], 2 * step):
            before, after = _neighbours(rows.shape[0], step, row)
            for x in range(rows.shape[1]):
                rows[row, x] += factor * (rows[before, x] + rows[after, x])


@inline_kernel
def _lift_whole(rows, step, odd, sign):
    """`_lift` with the rounding of the reversible 5/3: odd rows −⌊(a + b)/2⌋, even rows +⌊(a + b + 2)/4⌋."""
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
    """How much an error in each row grows: the L2 norm of the row's synthesis waveform, away from the ends.

    Parameters
    ----------
    wavelet : {"5/3", "9/7"}
    levels, count : int
        Of the transform, and how many rows there are.

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
    """Gains of the high bands from level 1 up, and of the low band last."""
    # The longest waveform spans less than 16 samples of the lowest band.
    middle = 16 << levels
    impulses = np.zeros((2 * middle, levels + 1), np.float32)
    for level in range(levels):
        impulses[middle + (1 << level), level] = 1
    impulses[middle, levels] = 1
    backward(impulses, steps(wavelet), levels)
    return tuple(map(float, np.linalg.norm(impulses, axis=0)))
