"""Coefficients of a block: syntax, cost in bits, and rate–distortion optimised quantisation.

A *dependent* quantiser has two sets of values: even multiples of half a distance, and odd ones with zero. Parities of
the levels before choose the set by four states, so that values are twice as dense as those that one level can have
(Marcellin and Fischer 1990; Schwarz et al. 2019). Levels are then held as multiples of half a distance.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ii_core.base.jit import part_kernel, stage_kernel, tuned_kernel

from .arithmetic import bit_cost, code_bit, code_mixed, code_number, code_raw, number_cost
from .contexts import (
    ABOVE_ONE,
    ABOVE_ONE_FINE,
    ABOVE_ONE_THERE,
    ABOVE_ONE_THERE_FINE,
    ABOVE_TWO,
    LAST,
    LAST_PARTED,
    REST,
    REST_NEAR,
    SIGNIFICANT,
    SIGNIFICANT_FINE,
    SIGNIFICANT_THERE,
    SIGNIFICANT_THERE_FINE,
    WEIGHTS,
)
from .transform import LARGEST, SCANS, sides, size_of

MOST_LEVEL = 32000
NEVER = 0.62  # of a step: less is never worth being the last coefficient
STATES = 4  # of a dependent quantiser; 2 and 3 have the odd multiples
NEXT = np.array([[0, 2], [2, 0], [1, 3], [3, 1]])  # state by the state before and the parity of its level
HALF = 9  # half a distance of a dependent quantiser in sixteenths of the step
HUGE = np.float32(1e30)
HOPE = np.float32(2.5)  # bits that a lone last coefficient costs besides its own


@stage_kernel
def _scanned(shape, k):
    """Row and column of the k-th place in the order of the scan."""
    place = np.int64(SCANS[np.uint64(shape[0]), np.uint64(shape[1]), np.uint64(k)])
    return place >> 5, place & 31


@stage_kernel
def _at(square, shape, k):
    y, x = _scanned(shape, k)
    return square[np.uint64(y), np.uint64(x)]


@stage_kernel
def _magnitude(level, dependent):
    """Of a level, which a dependent quantiser holds in halves."""
    return (abs(level) + dependent) >> dependent


@stage_kernel
def _neighbourhood(levels, y, x, h, w, dependent):
    """Class 0–9 by the sum of the magnitudes of the five places before, in the order of coding."""
    total = 0
    row, below = levels[np.uint64(y)], levels[np.uint64(min(y + 1, h - 1))]
    if x + 1 < w:
        total += _magnitude(row[np.uint64(x + 1)], dependent)
        if y + 1 < h:
            total += _magnitude(below[np.uint64(x + 1)], dependent)
        if x + 2 < w:
            total += _magnitude(row[np.uint64(x + 2)], dependent)
    if y + 1 < h:
        total += _magnitude(below[np.uint64(x)], dependent)
        if y + 2 < h:
            total += _magnitude(levels[np.uint64(y + 2), np.uint64(x)], dependent)
    return _class_of(total)


@stage_kernel
def _class_of(total):
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


@stage_kernel
def _last_context(plane, shape):
    """By plane and area; areas between those of squares have contexts of their own."""
    log = size_of(shape) - 2
    odd = (shape[0] + shape[1]) & 1
    return LAST_PARTED + (plane * 3 + log) * 12 if odd else LAST + (plane * 4 + log) * 12


@stage_kernel
def _significant_context(plane, log, place, near, state):
    context = ((plane * 4 + log - 2) * 4 + place) * 8 + near
    return SIGNIFICANT + context if state < 2 else SIGNIFICANT_FINE + (state - 2) * 384 + context


@stage_kernel
def _significant_there(plane, log, there, state):
    context = (plane * 4 + log - 2) * 32 + there
    return SIGNIFICANT_THERE + context if state < 2 else SIGNIFICANT_THERE_FINE + (state - 2) * 384 + context


@stage_kernel
def _above_one_context(context, state):
    return (ABOVE_ONE if state < 2 else ABOVE_ONE_FINE) + context


@tuned_kernel
def code_coefficients(coder, levels, plane, shape, intra, finer, dependent):
    """Write or read levels[:h, :w], of which one at least is not zero; a reader finds only zeros there before."""
    (h, w), log = sides(shape), size_of(shape)
    state: Any = np.int64(0)
    last = h * w - 1
    while last > 0 and _at(levels, shape, last) == 0:
        last -= 1
    last = min(code_number(coder, _last_context(plane, shape), np.int64(12), np.int64(0), last), h * w - 1)
    for k in range(last, -1, -1):
        y, x = _scanned(shape, k)
        value = np.int64(levels[y, x])
        size = _magnitude(value, dependent)
        around = _neighbourhood(levels, y, x, h, w, dependent)
        near, place = min(around, 7), _place(y, x)
        context = _significant_context(plane, log, place, near, state)
        there = ((y << 2 >> shape[0]) * 4 + (x << 2 >> shape[1])) * 2 + intra
        other = _significant_there(plane, log, there, state)
        if k < last and not code_mixed(coder, context, other, WEIGHTS + plane * 4 + log - 2, 1 if size else 0):
            state = np.int64(NEXT[state, 0]) if dependent else state
            continue
        context = (plane * 8 + near) * 2 + (1 if place == 0 else 0)
        found = 1
        one = _above_one_context(context, state)
        other = (ABOVE_ONE_THERE if state < 2 else ABOVE_ONE_THERE_FINE) + plane * 32 + there
        if code_mixed(coder, one, other, WEIGHTS + 12 + plane, 1 if size > 1 else 0):
            found = 2
            if code_bit(coder, ABOVE_TWO + context, 1 if size > 2 else 0):
                rest = _rest_context(plane, around, finer)
                found = 3 + min(code_number(coder, rest, np.int64(16), np.int64(0), size - 3), MOST_LEVEL)
        if dependent:
            odd, state = state >> 1, np.int64(NEXT[state, found & 1])
            found = 2 * found - odd
        levels[y, x] = -found if code_raw(coder, 1 if value < 0 else 0) else found


@stage_kernel
def _level_cost(costs, size, around, place, plane, log, last, finer, state):
    bits, near = np.float32(0), min(around, 7)
    if not last:
        bits += bit_cost(costs, _significant_context(plane, log, place, near, state), 1 if size else 0)
        if size == 0:
            return bits
    bits += np.float32(1)
    context = (plane * 8 + near) * 2 + (1 if place == 0 else 0)
    bits += bit_cost(costs, _above_one_context(context, state), 1 if size > 1 else 0)
    if size > 1:
        bits += bit_cost(costs, ABOVE_TWO + context, 1 if size > 2 else 0)
        if size > 2:
            bits += number_cost(costs, _rest_context(plane, around, finer), np.int64(16), np.int64(0), size - 3)
    return bits


@stage_kernel
def _places_within(diagonal, h, w):
    """Number of places whose row and column add up to so much at most."""
    below, right = max(diagonal - h + 1, 0), max(diagonal - w + 1, 0)
    return ((diagonal + 1) * (diagonal + 2) - below * (below + 1) - right * (right + 1)) >> 1


@stage_kernel
def _none(coefficients, never, levels, h, w):
    """levels[:h, :w] = 0; return the squared error, and the first place in the order of coding that may be more."""
    nothing, furthest = np.float32(0), np.int32(-1)
    large = np.int32(never)
    for y in range(h):
        row, into = coefficients[y], levels[y]
        for x in range(w):
            into[x] = 0
            nothing += np.float32(row[x]) * np.float32(row[x])
            furthest = max(furthest, np.int32(y + x) if abs(row[x]) > large else np.int32(-1))
    return nothing, _places_within(furthest, h, w) - 1 if furthest >= 0 else -1


@part_kernel
def quantise(costs, coefficients, plane, shape, step, weight, levels, finer):
    """Fill levels[:h, :w]; return the bits, those of "coded or not" left out, and the squared error.

    Parameters
    ----------
    step : float32
        Of the quantiser, in units of the coefficients.
    weight : float32
        Squared error that a bit is worth.
    """
    (h, w), log = sides(shape), size_of(shape)
    never = np.float32(NEVER) * step
    nothing, first = _none(coefficients, never, levels, h, w)
    error, bits, last = nothing, np.float32(0), -1
    for k in range(first, -1, -1):
        value = _at(coefficients, shape, k)
        size = abs(np.float32(value))
        if size <= never:  # a level of 1 gains 0.24 squared steps at most, and its bits weigh 0.42 at least
            continue
        y, x = _scanned(shape, k)
        level: Any = min(np.int64(size / step + np.float32(0.5)), MOST_LEVEL)
        cost = _level_cost(costs, level, 0, _place(y, x), plane, log, True, finer, 0)
        missed = size - np.float32(level) * step
        gain = size * size - missed * missed
        if level > 1 or gain >= weight * (cost + HOPE):
            last = k
            bits += cost
            error -= gain
            levels[np.uint64(y), np.uint64(x)] = -level if value < 0 else level
            break
    for k in range(last - 1, -1, -1):
        y, x = _scanned(shape, k)
        value = coefficients[np.uint64(y), np.uint64(x)]
        size = abs(np.float32(value))
        level = min(np.int64(size / step + np.float32(0.5)), MOST_LEVEL)
        near, where = _neighbourhood(levels, y, x, h, w, 0), _place(y, x)
        best: Any = 0
        cost = _level_cost(costs, 0, near, where, plane, log, False, finer, 0)
        least = size * size + weight * cost
        kept, missed2 = cost, size * size
        for tried in range(max(1, level - 1), level + 1):
            cost = _level_cost(costs, tried, near, where, plane, log, False, finer, 0)
            missed = size - np.float32(tried) * step
            total = missed * missed + weight * cost
            if total < least:
                least, best, kept, missed2 = total, tried, cost, missed * missed
        bits += kept
        error += missed2 - size * size
        levels[np.uint64(y), np.uint64(x)] = -best if value < 0 else best
    if last < 0:
        return np.float32(0), nothing
    bits += number_cost(costs, _last_context(plane, shape), np.int64(12), np.int64(0), last)
    if error + weight * bits >= nothing:
        for y in range(h):
            for x in range(w):
                levels[y, x] = 0
        return np.float32(0), nothing
    return bits, error


class Trellis(NamedTuple):
    """Memory of `quantise_dependent`: the best path to each state."""

    recent: Any  # (2, STATES, 3 · (LARGEST + 3)) magnitudes by row on the last three diagonals, before and after one
    totals: Any  # (2, STATES) cost, less that of no levels, in squared error
    bits: Any  # (2, STATES)
    levels: Any  # (STATES, n · n) magnitude chosen at a place,
    came: Any  # and the state before; -1 where the path begins


def new_trellis() -> Trellis:
    """Memory of `quantise_dependent`."""
    return Trellis(
        recent=np.zeros((2, STATES, 3 * (LARGEST + 3)), np.int16),
        totals=np.zeros((2, STATES), np.float32),
        bits=np.zeros((2, STATES), np.float32),
        levels=np.zeros((STATES, LARGEST * LARGEST), np.int32),
        came=np.zeros((STATES, LARGEST * LARGEST), np.int8),
    )


@stage_kernel
def _branch(costs, trellis, now, came, around, where, half, size, weight, finer):
    """Extend the path to a state, or begin one if it is -1, by the levels next to a coefficient; keep the better."""
    k, place, plane, shape = where
    log = size_of(shape)
    first = came < 0
    state: Any = max(came, 0)
    odd = np.float32(state >> 1)
    if first:
        bits = number_cost(costs, _last_context(plane, shape), np.int64(12), np.int64(0), k)
        total = weight * bits
    else:
        total, bits = trellis.totals[now, state], trellis.bits[now, state]
    exact = size / half
    low: Any = min(np.int64((exact + odd) * np.float32(0.5)), MOST_LEVEL // 2 - 1)
    for tried in range(2 if low > 2 or low == 0 else 3):  # the nearest two, and zero
        level: Any = low + tried if tried < 2 else np.int64(0)
        if level == 0 and first:
            continue
        missed = exact - (np.float32(2 * level) - odd if level else np.float32(0))
        more = _level_cost(costs, level, around, place, plane, log, first, finer, state)
        cost = total + half * half * (missed * missed - exact * exact) + weight * more
        to = NEXT[state, level & 1]
        if cost < trellis.totals[1 - now, to]:
            trellis.totals[1 - now, to], trellis.bits[1 - now, to] = cost, bits + more
            trellis.levels[to, k], trellis.came[to, k] = level, came


@stage_kernel
def _clear_recent(recent, slot, reach):
    """Forget one diagonal of each path, or all if there is no slot."""
    for state in range(STATES):
        row = recent[state]
        for i in range(max(slot, 0), 3 * reach, 3 if slot >= 0 else 1):
            row[np.uint64(i)] = 0


@stage_kernel
def _recent_sum(recent, slot, y):
    """Sum of the magnitudes that `_neighbourhood` adds, of a path."""
    one, two = 3 * y + (slot + 1 if slot < 2 else 0), 3 * y + (slot + 2 if slot < 1 else slot - 1)
    near = recent[np.uint64(one)] + recent[np.uint64(one + 3)]
    return near + recent[np.uint64(two)] + recent[np.uint64(two + 3)] + recent[np.uint64(two + 6)]


@stage_kernel
def _follow(trellis, now, k, y, slot, reach):
    """Copy what contexts need to the paths that were extended by place k: diagonals to come have no further rows."""
    for to in range(STATES):
        came, new = np.int64(trellis.came[to, k]), trellis.recent[1 - now, to]
        if came >= 0:
            old = trellis.recent[now, came]
            for i in range(3 * reach):
                new[np.uint64(i)] = old[np.uint64(i)]
        else:
            for i in range(3 * reach):
                new[np.uint64(i)] = 0
        new[np.uint64(3 * y + slot)] = trellis.levels[to, k]


@part_kernel
def quantise_dependent(costs, coefficients, plane, shape, step, weight, levels, finer, trellis):
    """As `quantise`, by a dependent quantiser: the path of least cost through its states (Viterbi)."""
    h, w = sides(shape)
    nothing, first = _none(coefficients, np.float32(NEVER) * step, levels, h, w)
    half = step * np.float32(HALF / 16)
    now = diagonal = slot = reach = 0
    for came in range(STATES):
        trellis.totals[0, came] = HUGE
    for k in range(first, -1, -1):
        y, x = _scanned(shape, k)
        if k == first or y + x != diagonal:
            diagonal, reach = y + x, min(h, y + x) + 3
            slot = diagonal % 3
            _clear_recent(trellis.recent[now], -1 if k == first else slot, reach)
        size = abs(np.float32(coefficients[np.uint64(y), np.uint64(x)]))
        where = k, _place(y, x), plane, shape
        for to in range(STATES):
            trellis.totals[1 - now, to], trellis.came[to, k], trellis.levels[to, k] = HUGE, -1, 0
        for came in range(STATES):
            if trellis.totals[now, came] < HUGE:
                around = _class_of(_recent_sum(trellis.recent[now, came], slot, y))
                _branch(costs, trellis, now, came, around, where, half, size, weight, finer)
        if size > half:
            _branch(costs, trellis, now, np.int64(-1), 0, where, half, size, weight, finer)
        _follow(trellis, now, k, y, slot, reach)
        now = 1 - now
    state: Any = np.int64(0)
    for other in range(1, STATES):
        if trellis.totals[now, other] < trellis.totals[now, state]:
            state = np.int64(other)
    least, bits = trellis.totals[now, state], trellis.bits[now, state]
    if least >= 0:
        return np.float32(0), nothing
    for k in range(first + 1):
        level: Any = np.int64(trellis.levels[state, k])
        before: Any = np.int64(trellis.came[state, k])
        if level:
            y, x = _scanned(shape, k)
            level = 2 * level - (max(before, 0) >> 1)
            levels[np.uint64(y), np.uint64(x)] = -level if coefficients[np.uint64(y), np.uint64(x)] < 0 else level
        if before < 0:
            break
        state = before
    return bits, nothing + least - weight * bits


@tuned_kernel
def dequantise(levels, shape, step, coefficients, dependent):
    """Fill coefficients[:h, :w] where they are not zero; return the rows and columns that hold them.

    ``step`` is in units of 1/16.
    """
    h, w = sides(shape)
    rows = cols = 0
    for y in range(h):
        for x in range(w):
            if levels[y, x]:
                rows = y + 1
                cols = max(cols, x + 1)
    for y in range(rows):
        for x in range(cols):
            if dependent:
                coefficients[y, x] = (np.int64(levels[y, x]) * step * HALF + 128) >> 8
            else:
                coefficients[y, x] = (np.int64(levels[y, x]) * step + 8) >> 4
    return rows, cols


assert LARGEST == 32  # the scans' places are read by shifts
