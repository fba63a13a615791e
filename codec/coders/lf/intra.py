"""Intra prediction of a block from decoded samples above and to the left: flat, smooth, or 34 directions."""

from __future__ import annotations

import numpy as np

from .jit import lean

FLAT, SMOOTH, DIRECTIONS = 0, 1, 34
MODES = 2 + DIRECTIONS
# Directions 0–16 go on from the row above by (m − 8) / 8 of a sample a row; 17–33 likewise from the column left.


@lean
def fill_border(views, at, plane, blocks, done, y0, x0, n, border):
    """border[0] = the corner and 2·n samples above, border[1] = the corner and 2·n to the left.

    ``blocks[done]`` says by 4×4 samples what is decoded. What is not there takes the value before it.
    """
    height, width = views.shape[2:]
    above, left = y0 > 0, x0 > 0
    for i in range(2 * n):
        x, y = x0 + i, y0 + i
        if above:
            if x < width and blocks[done, (y0 - 1) >> 2, x >> 2]:
                border[0, i + 1] = views[at, plane, y0 - 1, x]
            else:
                border[0, i + 1] = border[0, i]
        if left:
            if y < height and blocks[done, y >> 2, (x0 - 1) >> 2]:
                border[1, i + 1] = views[at, plane, y, x0 - 1]
            else:
                border[1, i + 1] = border[1, i]
    if not above:
        for i in range(2 * n):
            border[0, i + 1] = border[1, 1] if left else 0
    if not left:
        for i in range(2 * n):
            border[1, i + 1] = border[0, 1] if above else 0
    corner = views[at, plane, y0 - 1, x0 - 1] if above and left else (border[0, 1] if above else border[1, 1])
    border[0, 0] = border[1, 0] = corner


@lean
def predict_intra(border, mode, n, out, plane):
    """out[plane, :n, :n] = the prediction."""
    if mode == FLAT:
        total = n
        for i in range(1, n + 1):
            total += border[0, i] + border[1, i]
        value = total // (2 * n)
        for y in range(n):
            for x in range(n):
                out[plane, y, x] = value
    elif mode == SMOOTH:
        for y in range(n):
            for x in range(n):
                total = (n - 1 - x) * border[1, y + 1] + (x + 1) * border[0, n + 1]
                total += (n - 1 - y) * border[0, x + 1] + (y + 1) * border[1, n + 1]
                out[plane, y, x] = (total + n) // (2 * n)
    else:
        from_left = mode - 2 >= DIRECTIONS // 2
        slope = (mode - 2) % (DIRECTIONS // 2) - 8
        one, other = (1, 0) if from_left else (0, 1)
        for along in range(n):  # the distance from the border
            shift = (along + 1) * slope
            across = 0
            while across < n and 8 * (across + 1) + shift < 0:  # beyond the corner
                at = max(0, 8 * (along + 1) - 64 * (across + 1) // -slope)
                i, part = at >> 3, at & 7
                value = (border[other, i] * (8 - part) + border[other, i + 1] * part + 4) >> 3
                if from_left:
                    out[plane, across, along] = value
                else:
                    out[plane, along, across] = value
                across += 1
            start, part, side = 1 + (shift >> 3), np.int32(shift & 7), border[one]
            rest = np.int32(8 - part)
            if from_left:
                for i in range(across, n):
                    out[plane, i, along] = (side[start + i] * (8 - part) + side[start + i + 1] * part + 4) >> 3
            else:
                row = out[plane, along]
                for i in range(across, n):
                    total = np.int32(np.int32(side[start + i] * rest) + np.int32(side[start + i + 1] * part))
                    row[i] = np.int32(total + np.int32(4)) >> np.int32(3)


assert np.iinfo(np.int32).max > 64 * 64 * (1 << 14)  # the largest sum above
