"""Prediction of the second and third plane from the first: the colours of a block often lie on a line.

Of a residual, by a factor in quarters or eighths, chosen for each block and plane. It multiplies the first plane's
coefficients as decoded. Of an intra block, if it *follows* its first plane: the line is that of the decoded samples
above and to the left.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ii_core.base.jit import part_kernel, stage_kernel

from . import contexts as at
from .arithmetic import bit_cost, code_bit, code_mixed
from .coefficients import dequantise
from .intra import coarse
from .modes import mode_class
from .state import FOLLOWS, LIMIT, neighbours
from .transform import inverse, sides, size_of

MOST_CROSS = 4  # units
STEEPEST_LINE = 4 << 10  # slope of the line that an intra block follows, in 2^-10


@part_kernel
def code_cross(coder, plane, log, cross):
    """Write or read the factor."""
    context = at.CROSS + (plane - 1) * 8
    if not code_bit(coder, context + log - 2, 1 if cross else 0):
        return 0
    negative = code_bit(coder, context + 4, 1 if cross < 0 else 0)
    size = 1
    while size < MOST_CROSS and code_bit(coder, context + 4 + size, 1 if abs(cross) > size else 0):
        size += 1
    return -size if negative else size


@part_kernel
def cross_cost(costs, plane, log, cross):
    """Bits that `code_cross` would take."""
    context = at.CROSS + (plane - 1) * 8
    bits = bit_cost(costs, context + log - 2, 1 if cross else 0)
    if cross:
        bits += bit_cost(costs, context + 4, 1 if cross < 0 else 0)
        for size in range(1, min(abs(cross) + 1, MOST_CROSS)):
            bits += bit_cost(costs, context + 4 + size, 1 if abs(cross) > size else 0)
    return bits


@part_kernel
def keep_first(work, rows, cols):
    """Remember work.coefficients[:rows, :cols] as the first plane's."""
    work.reach[0], work.reach[1] = rows, cols
    for y in range(rows):
        for x in range(cols):
            work.first[y, x] = work.coefficients[y, x]


@part_kernel
def best_cross(work, shift):
    """The factor, in 2^-shift, by which the first plane's coefficients come nearest to work.coefficients."""
    product = square = np.float32(0)
    for y in range(work.reach[0]):
        for x in range(work.reach[1]):
            first = np.float32(work.first[y, x])
            product += first * np.float32(work.coefficients[y, x])
            square += first * first
    if square == 0:
        return np.int64(0)
    factor = np.int64(np.floor(np.float32(1 << shift) * product / square + np.float32(0.5)))
    return min(max(factor, -MOST_CROSS), MOST_CROSS)


@part_kernel
def subtract_cross(work, cross, shift):
    """Take the prediction from work.coefficients."""
    for y in range(work.reach[0]):
        for x in range(work.reach[1]):
            work.coefficients[y, x] -= (cross * work.first[y, x]) >> shift


@part_kernel
def rebuild(work, levels, shape, step, some, cross, shift, skipped, dependent):
    """work.block = the residual, of levels if there are ``some``, and of the first plane by a factor in 2^-shift.

    ``skipped`` is 1 without a transform, else twice its kind. Return the rows and columns of work.coefficients that
    hold it.
    """
    rows = cols = 0
    if some:
        rows, cols = dequantise(levels, shape, step, work.coefficients, dependent and skipped != 1)
    if cross:
        high, wide = max(rows, work.reach[0]), max(cols, work.reach[1])
        for y in range(high):
            for x in range(wide):
                value = work.coefficients[y, x] if y < rows and x < cols else 0
                if y < work.reach[0] and x < work.reach[1]:
                    value += (cross * work.first[y, x]) >> shift
                work.coefficients[y, x] = value
        rows, cols = high, wide
    if skipped == 1:
        h, w = sides(shape)
        for y in range(h):
            for x in range(w):
                work.block[y, x] = work.coefficients[y, x] if y < rows and x < cols else 0
    else:
        inverse(work.coefficients, shape, rows, cols, work.half, work.block, skipped >> 1)
    return rows, cols


@stage_kernel
def _following_contexts(job, by, bx, shape, mode):
    like = neighbours(job.blocks, np.int64(FOLLOWS), np.int64(1), by, bx)
    return at.FOLLOWS_NEAR + (size_of(shape) - 2) * 3 + like, at.FOLLOWS_MODE + mode_class(coarse(mode)) * 3 + like


@part_kernel
def code_following(coder, job, by, bx, shape, mode, follows):
    """Write or read whether the colours of an intra block follow its first plane."""
    one, other = _following_contexts(job, by, bx, shape, mode)
    return code_mixed(coder, one, other, np.int64(at.GUIDED_WEIGHTS + 2), follows)


@part_kernel
def following_cost(costs, job, by, bx, shape, follows):
    """Bits that `code_following` would take."""
    return bit_cost(costs, _following_contexts(job, by, bx, shape, np.int64(0))[0], follows)


@part_kernel
def predict_following(job, first, work, plane, y0, x0, shape):
    """work.predicted[plane] = the line that fits the decoded samples around the block, of ``first``, those in it."""
    (h, w), firsts, own = sides(shape), job.views[job.at, 0], job.views[job.at, plane]
    above, left = w if y0 else 0, h if x0 else 0
    count = np.int64(above + left)
    xs = ys = xx = xy = np.int64(0)
    for i in range(above + left):
        row, col = (y0 - 1, x0 + i) if i < above else (y0 + i - above, x0 - 1)
        one, other = np.int64(firsts[row, col]), np.int64(own[row, col])
        xs, ys, xx, xy = xs + one, ys + other, xx + one * one, xy + one * other
    spread = count * xx - xs * xs
    slope: Any = ((count * xy - xs * ys) << 10) // spread if spread > 0 else 0
    slope = min(max(slope, -STEEPEST_LINE), STEEPEST_LINE)
    offset: Any = ((ys << 10) - slope * xs) // count + 512 if count else 0
    predicted = work.predicted[plane]
    for y in range(h):
        for x in range(w):
            predicted[y, x] = min(max((slope * np.int64(first[y, x]) + offset) >> 10, -LIMIT), LIMIT)
