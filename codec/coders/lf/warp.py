"""Samples of a view between its own: blocks moved by a constant disparity.

Positions are in units of 2^-8 of a sample; their fractions are rounded down to sixteenths. Beyond its border a view
goes on with the border's samples.
"""

from __future__ import annotations

import numpy as np

from ii_core.base.jit import part_kernel, stage_kernel

from .transform import LARGEST

UNIT = 256
TAPS = 6
NARROW = 16  # columns of a block that are computed at least
BEFORE = 2  # taps before the sample at or left of the position


def _filters():
    """Sinc under a cosine window at sixteenths, in units of 2^-6."""
    found = np.zeros((16, TAPS), np.int32)
    for phase in range(16):
        at = np.arange(TAPS) - BEFORE - phase / 16
        real = np.sinc(at) * np.cos(np.pi * at / (TAPS + 1.0)) ** 1
        real *= 64 / real.sum()
        whole = np.rint(real).astype(int)
        whole[np.argmax(real)] += 64 - whole.sum()
        found[phase] = whole
    return found


FILTERS = _filters()
assert (FILTERS.sum(axis=1) == 64).all() and FILTERS[0].tolist() == [0, 0, 64, 0, 0, 0]


UNSHIFTED = 3  # columns of references: number, and how far across and down
LATTICE = 10  # binary logarithm of the unit of views' positions on the grid


@stage_kernel
def lead(d, along):
    """How far a disparity leads to a view so far along rows or columns of the grid, in 2^-8 samples."""
    return (d * along) >> LATTICE


@stage_kernel
def clamped(i, n):
    """The index of the sample, or of the border's."""
    return min(max(i, 0), n - 1)


@stage_kernel
def led(references, r, d, y, x, shape):
    """How far a disparity leads down and across to a reference from a sample of the view, in 2^-8 samples.

    References have columns of shifts by square if views are beside their places (`rig`).
    """
    down, across = lead(d, references[r, 2]), lead(d, references[r, 1])
    if references.shape[1] > UNSHIFTED:
        height, width = shape
        row, column = clamped(y, height) // LARGEST, clamped(x, width) // LARGEST
        at = UNSHIFTED + 2 * (row * ((width + LARGEST - 1) // LARGEST) + column)
        across, down = across + references[r, np.uint64(at)], down + references[r, np.uint64(at + 1)]
    return down, across


@stage_kernel
def weighed(one, two, three, four, five, six, a, b, c, d, e, f):
    """Sum of six samples, weighted."""
    far = np.int32(np.int32(a * np.int32(one)) + np.int32(f * np.int32(six)))
    near = np.int32(np.int32(b * np.int32(two)) + np.int32(e * np.int32(five)))
    return np.int32(np.int32(far + near) + np.int32(np.int32(c * np.int32(three)) + np.int32(d * np.int32(four))))


@stage_kernel
def _filter_row(t, at, n, phase, row):
    """row[:n] = samples between those of t, from t[at + BEFORE] on, in units of 2^-6."""
    a, b, c = FILTERS[phase, 0], FILTERS[phase, 1], FILTERS[phase, 2]
    d, e, f = FILTERS[phase, 3], FILTERS[phase, 4], FILTERS[phase, 5]
    for j in range(n):
        one, two, three = t[np.uint64(at + j)], t[np.uint64(at + j + 1)], t[np.uint64(at + j + 2)]
        four, five, six = t[np.uint64(at + j + 3)], t[np.uint64(at + j + 4)], t[np.uint64(at + j + 5)]
        row[j] = weighed(one, two, three, four, five, six, a, b, c, d, e, f)


@part_kernel
def moved_block(views, view, plane, y0, x0, h, w, dy, dx, rows, out):
    """out[plane, :h, :w] += 64² times the block at (y0 + dy, x0 + dx) of a plane; ``rows`` is (38, 40) for use.

    Of narrow blocks 16 columns are computed, in vectors: those beyond hold anything. Indices that cannot be negative
    are cast to unsigned: for others, numba emits a look for negative ones.
    """
    source = views[view, plane]
    height, width = source.shape
    iy, ix = y0 + (dy >> 8), x0 + (dx >> 8)
    py, px = (dy >> 4) & 15, (dx >> 4) & 15
    first, count = (0, h) if py == 0 else (-BEFORE, h + TAPS - 1)
    start, taken, lanes = ix - BEFORE, w + TAPS - 1, max(w, NARROW)
    inside = start >= 0 and start + lanes + TAPS - 1 <= width
    bordered = rows[LARGEST + TAPS - 1]
    for i in range(count):
        line, row = source[np.uint64(clamped(iy + first + i, height))], rows[i]
        if not inside:
            for j in range(taken):
                bordered[j] = line[np.uint64(clamped(start + j, width))]
            _filter_row(bordered, 0, lanes, px, row)
        elif px == 0:
            for j in range(lanes):
                row[j] = np.int32(line[np.uint64(ix + j)]) * np.int32(64)
        else:
            _filter_row(line, start, lanes, px, row)
    a, b, c, d, e, f = FILTERS[py, 0], FILTERS[py, 1], FILTERS[py, 2], FILTERS[py, 3], FILTERS[py, 4], FILTERS[py, 5]
    for i in range(h):
        into, one = out[plane, i], rows[i]
        if py == 0:
            for j in range(lanes):
                into[j] = np.int32(into[j] + np.int32(one[j] * np.int32(64)))
        else:
            two, three, four, five, six = rows[i + 1], rows[i + 2], rows[i + 3], rows[i + 4], rows[i + 5]
            for j in range(lanes):
                total = weighed(one[j], two[j], three[j], four[j], five[j], six[j], a, b, c, d, e, f)
                into[j] = np.int32(into[j] + total)
