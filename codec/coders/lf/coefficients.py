"""Coefficients of a block: syntax, cost in bits, and rate–distortion optimised quantisation."""

from __future__ import annotations

from typing import Any

import numpy as np

from ii_core.base.jit import part_kernel, stage_kernel, tuned_kernel

from .arithmetic import bit_cost, code_bit, code_mixed, code_number, code_raw, number_cost
from .contexts import (
    ABOVE_ONE,
    ABOVE_ONE_THERE,
    ABOVE_TWO,
    LAST,
    REST,
    REST_NEAR,
    SIGNIFICANT,
    SIGNIFICANT_THERE,
    WEIGHTS,
)
from .transform import LARGEST, SCANS

MOST_LEVEL = 32000
NEVER = 0.62  # of a step: less is never worth being the last coefficient
HOPE = np.float32(2.5)  # bits that a lone last coefficient costs besides its own


@stage_kernel
def _scanned(log, k):
    """Row and column of the k-th place in the order of the scan."""
    place = np.int64(SCANS[np.uint64(log), np.uint64(k)])
    return place >> 5, place & 31


@stage_kernel
def _at(square, log, k):
    y, x = _scanned(log, k)
    return square[np.uint64(y), np.uint64(x)]


@stage_kernel
def _neighbourhood(levels, y, x, n):
    """Class 0–9 by the sum of the magnitudes of the five places before, in the order of coding."""
    total = 0
    row, below = levels[np.uint64(y)], levels[np.uint64(min(y + 1, n - 1))]
    if x + 1 < n:
        total += abs(row[np.uint64(x + 1)])
        if y + 1 < n:
            total += abs(below[np.uint64(x + 1)])
        if x + 2 < n:
            total += abs(row[np.uint64(x + 2)])
    if y + 1 < n:
        total += abs(below[np.uint64(x)])
        if y + 2 < n:
            total += abs(levels[np.uint64(y + 2), np.uint64(x)])
    if total < 11:
        return total if total < 5 else (5 if total < 7 else 6)
    return 7 if total < 18 else (8 if total < 30 else 9)


@stage_kernel
def _rest_context(plane, around, finer):
    return REST_NEAR + (plane * 6 + max(around - 4, 0)) * 16 if finer else REST + plane * 16


@stage_kernel
def _place(y, x):
    s = y + x
    return 0 if s == 0 else (1 if s < 3 else (2 if s < 7 else 3))


@tuned_kernel
def code_coefficients(coder, levels, plane, log, intra, finer):
    """Write or read levels[:n, :n], of which one at least is not zero; a reader finds only zeros there before."""
    n = 1 << log
    last = n * n - 1
    while last > 0 and _at(levels, log, last) == 0:
        last -= 1
    last = min(code_number(coder, LAST + (plane * 4 + log - 2) * 12, np.int64(12), np.int64(0), last), n * n - 1)
    for k in range(last, -1, -1):
        y, x = _scanned(log, k)
        value = np.int64(levels[y, x])
        size = abs(value)
        around = _neighbourhood(levels, y, x, n)
        near, place = min(around, 7), _place(y, x)
        context = SIGNIFICANT + ((plane * 4 + log - 2) * 4 + place) * 8 + near
        there = ((y << 2 >> log) * 4 + (x << 2 >> log)) * 2 + intra
        other = SIGNIFICANT_THERE + (plane * 4 + log - 2) * 32 + there
        if k < last and not code_mixed(coder, context, other, WEIGHTS + plane * 4 + log - 2, 1 if size else 0):
            continue
        context = (plane * 8 + near) * 2 + (1 if place == 0 else 0)
        found = 1
        other = ABOVE_ONE_THERE + plane * 32 + there
        if code_mixed(coder, ABOVE_ONE + context, other, WEIGHTS + 12 + plane, 1 if size > 1 else 0):
            found = 2
            if code_bit(coder, ABOVE_TWO + context, 1 if size > 2 else 0):
                rest = _rest_context(plane, around, finer)
                found = 3 + min(code_number(coder, rest, np.int64(16), np.int64(0), size - 3), MOST_LEVEL)
        levels[y, x] = -found if code_raw(coder, 1 if value < 0 else 0) else found


@stage_kernel
def _level_cost(costs, size, around, place, plane, log, last, finer):
    bits, near = np.float32(0), min(around, 7)
    if not last:
        bits += bit_cost(costs, SIGNIFICANT + ((plane * 4 + log - 2) * 4 + place) * 8 + near, 1 if size else 0)
        if size == 0:
            return bits
    bits += np.float32(1)
    context = (plane * 8 + near) * 2 + (1 if place == 0 else 0)
    bits += bit_cost(costs, ABOVE_ONE + context, 1 if size > 1 else 0)
    if size > 1:
        bits += bit_cost(costs, ABOVE_TWO + context, 1 if size > 2 else 0)
        if size > 2:
            bits += number_cost(costs, _rest_context(plane, around, finer), np.int64(16), np.int64(0), size - 3)
    return bits


@stage_kernel
def _places_within(diagonal, n):
    """Number of places whose row and column add up to so much at most."""
    beyond = max(diagonal - n + 1, 0)
    return ((diagonal + 1) * (diagonal + 2) >> 1) - beyond * (beyond + 1)


@part_kernel
def quantise(costs, coefficients, plane, log, step, weight, levels, finer):
    """Fill levels[:n, :n]; return the bits, those of "coded or not" left out, and the squared error.

    Parameters
    ----------
    step : float32
        Of the quantiser, in units of the coefficients.
    weight : float32
        Squared error that a bit is worth.
    """
    n = 1 << log
    nothing, furthest = np.float32(0), np.int32(-1)
    never = np.float32(NEVER) * step
    large = np.int32(never)
    for y in range(n):
        row, into = coefficients[y], levels[y]
        for x in range(n):
            into[x] = 0
            nothing += np.float32(row[x]) * np.float32(row[x])
            furthest = max(furthest, np.int32(y + x) if abs(row[x]) > large else np.int32(-1))
    if furthest < 0:
        return np.float32(0), nothing
    error, bits, last = nothing, np.float32(0), -1
    for k in range(_places_within(furthest, n) - 1, -1, -1):
        value = _at(coefficients, log, k)
        size = abs(np.float32(value))
        if size <= never:  # a level of 1 gains 0.24 squared steps at most, and its bits weigh 0.42 at least
            continue
        y, x = _scanned(log, k)
        level: Any = min(np.int64(size / step + np.float32(0.5)), MOST_LEVEL)
        cost = _level_cost(costs, level, 0, _place(y, x), plane, log, True, finer)
        missed = size - np.float32(level) * step
        gain = size * size - missed * missed
        if level > 1 or gain >= weight * (cost + HOPE):
            last = k
            bits += cost
            error -= gain
            levels[np.uint64(y), np.uint64(x)] = -level if value < 0 else level
            break
    for k in range(last - 1, -1, -1):
        y, x = _scanned(log, k)
        value = coefficients[np.uint64(y), np.uint64(x)]
        size = abs(np.float32(value))
        level = min(np.int64(size / step + np.float32(0.5)), MOST_LEVEL)
        near, where = _neighbourhood(levels, y, x, n), _place(y, x)
        best: Any = 0
        cost = _level_cost(costs, 0, near, where, plane, log, False, finer)
        least = size * size + weight * cost
        kept, missed2 = cost, size * size
        for tried in range(max(1, level - 1), level + 1):
            cost = _level_cost(costs, tried, near, where, plane, log, False, finer)
            missed = size - np.float32(tried) * step
            total = missed * missed + weight * cost
            if total < least:
                least, best, kept, missed2 = total, tried, cost, missed * missed
        bits += kept
        error += missed2 - size * size
        levels[np.uint64(y), np.uint64(x)] = -best if value < 0 else best
    if last < 0:
        return np.float32(0), nothing
    bits += number_cost(costs, LAST + (plane * 4 + log - 2) * 12, np.int64(12), np.int64(0), last)
    if error + weight * bits >= nothing:
        for y in range(n):
            for x in range(n):
                levels[y, x] = 0
        return np.float32(0), nothing
    return bits, error


@tuned_kernel
def dequantise(levels, log, step, coefficients):
    """Fill coefficients[:n, :n] where they are not zero; return the rows and columns that hold them.

    ``step`` is in units of 1/16.
    """
    n = 1 << log
    rows = cols = 0
    for y in range(n):
        for x in range(n):
            if levels[y, x]:
                rows = y + 1
                cols = max(cols, x + 1)
    for y in range(rows):
        for x in range(cols):
            coefficients[y, x] = (np.int64(levels[y, x]) * step + 8) >> 4
    return rows, cols


assert LARGEST == 32  # the scans' places are read by shifts
