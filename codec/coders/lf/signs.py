"""Signs of an intra block's coefficients, guessed from the decoded samples above and to the left.

With the right signs a block goes on from its surroundings (Henry and Clare 2017). What a sign says of the border is
compared with what the border wants after the signs before; only the first row and column of the residual count, so
that a coefficient takes two products.
"""

from __future__ import annotations

import numpy as np

from ii_core.base.jit import part_kernel, stage_kernel

from . import contexts as at
from .arithmetic import code_mixed, code_raw
from .coefficients import HALF
from .transform import LARGEST, MATRICES, SINE_ACROSS, SINE_DOWN, sides

SORTED = 32  # coefficients of the greatest weight at the border that come first, by it


@part_kernel
def _find_wanted(job, work, down, across, y0, x0, shape):
    """work.wanted = the transforms of what a residual should be at the upper and left border, twice that.

    The line through the two decoded samples before the border goes on; the prediction is less or more by so much.
    """
    (h, w), view, predicted = sides(shape), job.views[job.at, 0], work.predicted[0]
    wanted, missed = work.wanted, work.rows[0]
    for side in range(2):
        length, matrix = (h, down) if side else (w, across)
        for i in range(length):
            if side:
                line = 3 * np.int64(view[y0 + i, x0 - 1]) - view[y0 + i, x0 - 2] if x0 else 0
                missed[i] = line - 2 * predicted[i, 0] if x0 else 0
            else:
                line = 3 * np.int64(view[y0 - 1, x0 + i]) - view[y0 - 2, x0 + i] if y0 else 0
                missed[i] = line - 2 * predicted[0, i] if y0 else 0
        for k in range(length):
            total = np.int64(0)
            for i in range(length):
                total += np.int64(matrix[k, i]) * missed[i]
            wanted[side, k] = total


@stage_kernel
def _contexts(guess, weight, size, place):
    """By how much of a coefficient the border wants, by the coefficient, and by its place in the order."""
    part, magnitude = 0, 0
    while part < 7 and abs(guess) << 5 >= weight << part:
        part += 1
    while magnitude < 5 and size > 1 << magnitude:
        magnitude += 1
    return at.SIGN_SIZE + part * 6 + magnitude, at.SIGN_PLACE + part * 8 + min(place, 7)


@part_kernel
def _sort(levels, shape, down, across, places, keys):
    """Places of levels that are not zero, those of the greatest weight at the border first; return their number."""
    (h, w), count = sides(shape), 0
    for y in range(h):
        for x in range(w):
            level = np.int64(levels[y, x])
            if level:
                places[count] = y * LARGEST + x
                keys[count] = level * level * (down[y] + across[x])
                count += 1
    for first in range(min(count, SORTED)):
        best = first
        for other in range(first + 1, count):
            if keys[other] > keys[best]:
                best = other
        places[first], places[best] = places[best], places[first]
        keys[first], keys[best] = keys[best], keys[first]
    return count


@part_kernel
def code_signs(coder, job, work, levels, y0, x0, shape, kind):
    """Write the signs of levels, or read those of magnitudes, of the first plane after a kind of transform."""
    down = MATRICES[1 if kind & SINE_DOWN else 0, shape[0]]
    across = MATRICES[1 if kind & SINE_ACROSS else 0, shape[1]]
    _find_wanted(job, work, down, across, y0, x0, shape)
    of_row, of_col = work.norms[0], work.norms[1]
    for i in range(LARGEST):
        of_row[i] = np.int64(down[i, 0]) * down[i, 0] if y0 else 0
        of_col[i] = np.int64(across[i, 0]) * across[i, 0] if x0 else 0
    count = _sort(levels, shape, of_row, of_col, work.places, work.keys)
    for k in range(count):
        y, x = work.places[k] >> 5, work.places[k] & 31
        level = np.int64(levels[y, x])
        size = (abs(level) * job.step * HALF + 128) >> 8
        from_above = np.int64(down[y, 0]) if y0 else np.int64(0)
        from_left = np.int64(across[x, 0]) if x0 else np.int64(0)
        guess = from_above * work.wanted[0, x] + from_left * work.wanted[1, y]
        negative = 1 if level < 0 else 0
        if guess == 0:
            negative = code_raw(coder, negative)
        else:
            one, other = _contexts(guess, 2 * size * (of_row[y] + of_col[x]), abs(level), k)
            opposite = 1 if guess < 0 else 0
            negative = opposite ^ code_mixed(coder, one, other, np.int64(at.GUIDED_WEIGHTS + 3), negative ^ opposite)
        levels[y, x] = -abs(level) if negative else abs(level)
        value = 2 * (-size if negative else size)
        work.wanted[0, x] -= from_above * value
        work.wanted[1, y] -= from_left * value


assert LARGEST == 32  # places are read by shifts
