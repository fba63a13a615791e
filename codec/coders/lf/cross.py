"""Prediction of the residual's second and third plane from its first: the colours of a block often lie on a line.

The factor is in quarters or eighths, chosen for each block and plane. It multiplies the first plane's coefficients as
decoded.
"""

from __future__ import annotations

import numpy as np

from ii_core.base.jit import part_kernel

from . import contexts as at
from .arithmetic import bit_cost, code_bit
from .coefficients import dequantise
from .transform import inverse, sides

MOST_CROSS = 4  # units


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
