"""Samples of a view between its own: blocks moved by a constant disparity.

Positions are in units of 2^-8 of a sample; their fractions are rounded down to sixteenths. Beyond its border a view
goes on with the border's samples.
"""

from __future__ import annotations

import numpy as np

from .jit import inner, lean

UNIT = 256
TAPS = 6
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


@inner
def clamped(i, n):
    """The index of the sample, or of the border's."""
    return min(max(i, 0), n - 1)


@lean
def moved_block(views, view, plane, y0, x0, n, dy, dx, rows, out):
    """out[plane, :n, :n] += 64² times the block at (y0 + dy, x0 + dx) of a plane; ``rows`` is (37, 32) for use."""
    source = views[view, plane]
    height, width = source.shape
    iy, ix = y0 + (dy >> 8), x0 + (dx >> 8)
    py, px = (dy >> 4) & 15, (dx >> 4) & 15
    first, count = (0, n) if py == 0 else (-BEFORE, n + TAPS - 1)
    inside = ix >= BEFORE and ix + n + TAPS - BEFORE - 1 <= width
    a, b, c, d, e, f = FILTERS[px, 0], FILTERS[px, 1], FILTERS[px, 2], FILTERS[px, 3], FILTERS[px, 4], FILTERS[px, 5]
    for i in range(count):
        line, row = source[clamped(iy + first + i, height)], rows[i]
        if not inside:
            for j in range(n):
                total = np.int32(0)
                for k in range(TAPS):
                    total += FILTERS[px, k] * line[clamped(ix + j + k - BEFORE, width)]
                row[j] = total
        elif px == 0:
            taken = line[ix : ix + n]
            for j in range(n):
                row[j] = np.int32(taken[j]) * np.int32(64)
        else:
            taken = line[ix - BEFORE : ix - BEFORE + n + TAPS - 1]
            for start in range(0, n, 4):  # loops of constant length are vectorised for the least blocks, too
                for j in range(start, start + 4):
                    row[j] = np.int32(
                        a * taken[j]
                        + b * taken[j + 1]
                        + c * taken[j + 2]
                        + d * taken[j + 3]
                        + e * taken[j + 4]
                        + f * taken[j + 5]
                    )
    a, b, c, d, e, f = FILTERS[py, 0], FILTERS[py, 1], FILTERS[py, 2], FILTERS[py, 3], FILTERS[py, 4], FILTERS[py, 5]
    for i in range(n):
        into = out[plane, i]
        if py == 0:
            row = rows[i]
            for j in range(n):
                into[j] = np.int32(into[j] + np.int32(row[j] * np.int32(64)))
        else:
            r0, r1, r2, r3, r4, r5 = rows[i], rows[i + 1], rows[i + 2], rows[i + 3], rows[i + 4], rows[i + 5]
            for start in range(0, n, 4):
                for j in range(start, start + 4):
                    total = a * r0[j] + b * r1[j] + c * r2[j] + d * r3[j] + e * r4[j] + f * r5[j]
                    into[j] = np.int32(into[j] + total)
