"""Residuals whose transform is skipped: the samples themselves are quantised and coded, row by row.

This takes fewer bits where few samples differ from their prediction, as at edges of point-sampled pictures.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ii_core.base.jit import part_kernel, stage_kernel

from .arithmetic import bit_cost, code_bit, code_mixed, code_number, number_cost
from .coefficients import MOST_LEVEL
from .contexts import (
    SAMPLE,
    SAMPLE_ABOVE_ONE,
    SAMPLE_ABOVE_ONE_BESIDE,
    SAMPLE_ABOVE_TWO,
    SAMPLE_BESIDE,
    SAMPLE_REST,
    SAMPLE_SIGN,
    SAMPLE_WEIGHTS,
)
from .transform import sides, size_of

LARGEST_SKIPPED = 6  # binary logarithm of the number of samples
# Class by samples before that are not zero, and all samples before.
_SAMPLES = np.arange(1 << LARGEST_SKIPPED)
DENSITY = np.minimum(8 * _SAMPLES[:, None] // np.maximum(_SAMPLES, 4), 8).astype(np.uint8)


@stage_kernel
def _around(levels, y, x, w):
    """Class 0–7 by the magnitudes left, above (twice each) and diagonally above."""
    total = 0
    row, above = levels[np.uint64(y)], levels[np.uint64(max(y - 1, 0))]
    if x:
        total += 2 * abs(row[np.uint64(x - 1)])
    if y:
        total += 2 * abs(above[np.uint64(x)])
        if x:
            total += abs(above[np.uint64(x - 1)])
        if x + 1 < w:
            total += abs(above[np.uint64(x + 1)])
    return total if total < 5 else (5 if total < 7 else (6 if total < 10 else 7))


@stage_kernel
def _beside(planes, plane, y, x, before, seen):
    """Class 0–8: by the levels of earlier planes at the sample; in the first, by the density of samples before."""
    if plane == 0:
        return np.int64(DENSITY[np.uint64(before), np.uint64(seen)])
    first = min(abs(planes[0, y, x]), 2)
    second = min(abs(planes[1, y, x]), 2) if plane == 2 else 0
    return 3 * first + second


@stage_kernel
def _sign_context(planes, plane, y, x):
    """By plane, and the sign of the first plane's level."""
    first = planes[0, y, x] if plane else 0
    return SAMPLE_SIGN + plane * 3 + (0 if first == 0 else (1 if first > 0 else 2))


@part_kernel
def code_samples(coder, levels, planes, y0, x0, plane, shape):
    """Write or read levels[:h, :w]; a reader finds only zeros there before.

    ``planes[:plane, y0 : y0 + h, x0 : x0 + w]`` are the levels of earlier planes.
    """
    (h, w), log, before = sides(shape), size_of(shape), 0
    for k in range(h * w):
        y, x = k >> shape[1], k & (w - 1)
        value = np.int64(levels[y, x])
        size = abs(value)
        around = _around(levels, y, x, w)
        beside = _beside(planes, plane, y0 + y, x0 + x, before, k)
        by_size = plane * 2 + log - 2
        one, other = SAMPLE + by_size * 8 + around, SAMPLE_BESIDE + by_size * 9 + beside
        if not code_mixed(coder, one, other, SAMPLE_WEIGHTS + by_size, 1 if size else 0):
            continue
        before += 1
        found = 1
        one, other = SAMPLE_ABOVE_ONE + plane * 8 + around, SAMPLE_ABOVE_ONE_BESIDE + plane * 9 + beside
        if code_mixed(coder, one, other, SAMPLE_WEIGHTS + 6 + plane, 1 if size > 1 else 0):
            found = 2
            if code_bit(coder, SAMPLE_ABOVE_TWO + plane * 8 + around, 1 if size > 2 else 0):
                rest = code_number(coder, SAMPLE_REST + plane * 16, np.int64(16), np.int64(0), size - 3)
                found = 3 + min(rest, MOST_LEVEL)
        negative = code_bit(coder, _sign_context(planes, plane, y0 + y, x0 + x), 1 if value < 0 else 0)
        levels[y, x] = -found if negative else found


@stage_kernel
def _mixed_cost(costs, one, other, bit):
    return np.float32(0.5) * (bit_cost(costs, one, bit) + bit_cost(costs, other, bit))


@stage_kernel
def _sample_cost(costs, size, around, beside, plane, log):
    """Bits of a sample, those of the sign left out."""
    by_size = plane * 2 + log - 2
    some = 1 if size else 0
    bits = _mixed_cost(costs, SAMPLE + by_size * 8 + around, SAMPLE_BESIDE + by_size * 9 + beside, some)
    if size:
        one, other = SAMPLE_ABOVE_ONE + plane * 8 + around, SAMPLE_ABOVE_ONE_BESIDE + plane * 9 + beside
        bits += _mixed_cost(costs, one, other, 1 if size > 1 else 0)
        if size > 1:
            bits += bit_cost(costs, SAMPLE_ABOVE_TWO + plane * 8 + around, 1 if size > 2 else 0)
            if size > 2:
                bits += number_cost(costs, SAMPLE_REST + plane * 16, np.int64(16), np.int64(0), size - 3)
    return bits


@part_kernel
def quantise_samples(costs, block, planes, plane, shape, step, weight, levels):
    """Fill levels[:h, :w]; return the bits, 0 if there are no levels, and the squared error.

    ``planes[:plane, :h, :w]`` are the levels of earlier planes; units are those of `coefficients.quantise`.
    """
    (h, w), log, before = sides(shape), size_of(shape), 0
    error, bits = np.float32(0), np.float32(0)
    for k in range(h * w):
        y, x = k >> shape[1], k & (w - 1)
        value = block[np.uint64(y), np.uint64(x)]
        size = abs(np.float32(value))
        around = _around(levels, y, x, w)
        beside = _beside(planes, plane, y, x, before, k)
        level: Any = min(np.int64(size / step + np.float32(0.5)), MOST_LEVEL)
        best: Any = np.int64(0)
        kept, missed = _sample_cost(costs, 0, around, beside, plane, log), size * size
        least = missed + weight * kept
        sign = _sign_context(planes, plane, y, x)
        for tried in range(max(1, level - 1), level + 1):
            cost = _sample_cost(costs, tried, around, beside, plane, log)
            cost += bit_cost(costs, sign, 1 if value < 0 else 0)
            left = size - np.float32(tried) * step
            total = left * left + weight * cost
            if total < least:
                least, best, kept, missed = total, tried, cost, left * left
        bits += kept
        error += missed
        levels[np.uint64(y), np.uint64(x)] = -best if value < 0 else best
        if best:
            before += 1
    return bits if before else np.float32(0), error
