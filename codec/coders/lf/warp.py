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
    height, width = views.shape[2:]
    iy, ix = y0 + (dy >> 8), x0 + (dx >> 8)
    py, px = (dy >> 4) & 15, (dx >> 4) & 15
    first, count = (0, n) if py == 0 else (-BEFORE, n + TAPS - 1)
    inside = ix >= BEFORE and ix + n + TAPS - BEFORE - 1 <= width
    for i in range(count):
        y = clamped(iy + first + i, height)
        if px == 0:
            if inside:
                for j in range(n):
                    rows[i, j] = np.int32(views[view, plane, y, ix + j]) * np.int32(64)
            else:
                for j in range(n):
                    rows[i, j] = np.int32(views[view, plane, y, clamped(ix + j, width)]) * np.int32(64)
        elif inside:
            for j in range(n):
                rows[i, j] = 0
            for k in range(TAPS):
                f = FILTERS[px, k]
                for j in range(n):
                    rows[i, j] = np.int32(
                        rows[i, j] + np.int32(f * np.int32(views[view, plane, y, ix + j + k - BEFORE]))
                    )
        else:
            for j in range(n):
                total = np.int32(0)
                for k in range(TAPS):
                    total += FILTERS[px, k] * views[view, plane, y, clamped(ix + j + k - BEFORE, width)]
                rows[i, j] = total
    if py == 0:
        for i in range(n):
            for j in range(n):
                out[plane, i, j] = np.int32(out[plane, i, j] + np.int32(rows[i, j] * np.int32(64)))
    else:
        for i in range(n):
            for k in range(TAPS):
                f = FILTERS[py, k]
                for j in range(n):
                    out[plane, i, j] = np.int32(out[plane, i, j] + np.int32(f * rows[i + k, j]))
