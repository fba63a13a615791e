"""Coefficients of a block: syntax, cost in bits, and rate–distortion optimised quantisation.

A *dependent* quantiser has two sets of values: even multiples of half a distance, and odd ones with zero. Parities of
the levels before choose the set by four states, so that values are twice as dense as those that one level can have
(Marcellin and Fischer 1990; Schwarz et al. 2019). Levels are then held as multiples of half a distance.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ii_core.base.jit import fused, part_kernel, stage_kernel
from ii_core.base.references import by_reference

from .arithmetic import REFINED, bit_cost, code_bit, code_mixed, code_number, code_of_four, code_raw, number_cost
from .contexts import (
    ABOVE_ONE,
    ABOVE_ONE_FINE,
    ABOVE_ONE_THERE,
    ABOVE_ONE_THERE_FINE,
    ABOVE_TWO,
    BESIDE,
    COEFFICIENT_WEIGHTS,
    LAST,
    LAST_PARTED,
    REST,
    REST_NEAR,
    SIGNIFICANT,
    SIGNIFICANT_FINE,
    SIGNIFICANT_THERE,
    SIGNIFICANT_THERE_FINE,
    TURNED,
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


@stage_kernel
def _beside(planes, plane, corner, y, x, h, w, near, dependent):
    """Class 0–287 by plane, magnitudes of earlier planes at the place, any around it, and the neighbourhood."""
    found, around = plane * 12, 0
    if plane:
        i, j = corner[0] + y, corner[1] + x
        found += 3 * min(_magnitude(planes[0, i, j], dependent), 3)
        if plane == 2:
            found += min(_magnitude(planes[1, i, j], dependent), 2)
        for down in range(max(y - 1, 0), min(y + 2, h)):
            for across in range(max(x - 1, 0), min(x + 2, w)):
                if planes[0, corner[0] + down, corner[1] + across]:
                    around = 1
    return (found * 2 + around) * 4 + (near if near < 2 else (2 if near < 4 else 3))


@part_kernel
def code_coefficients(coder, levels, plane, shape, intra, ways, planes, corner, turn, signed):
    """Write or read levels[:h, :w], of which one at least is not zero; a reader finds only zeros there before.

    ``ways`` say whether contexts are those of version 7, and whether the quantiser is dependent. In a refined coder
    ``planes`` are the levels of earlier planes, the block's from a corner on, and ``turn`` is `intra.turn_class` of
    its mode, 0 of other blocks. Signs are left out if levels are not ``signed``: a reader finds magnitudes.
    """
    (h, w), log, refined = sides(shape), size_of(shape), coder.state[REFINED]
    finer, dependent = ways
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
        beside = turned = np.int64(0)
        if refined:
            beside = BESIDE + _beside(planes, plane, corner, y, x, h, w, near, dependent)
            turned = TURNED + ((plane * 6 + turn) * 8 + min(y, 7)) * 8 + min(x, 7)
        by_size = plane * 4 + log - 2
        if k < last:
            if refined:
                third, fourth = max(state - 1, 0) * 288 + beside, max(state - 1, 0) * 1152 + turned
                weights = COEFFICIENT_WEIGHTS + 2 * by_size
                some = code_of_four(coder, context, other, third, fourth, weights, 1 if size else 0)
            else:
                some = code_mixed(coder, context, other, WEIGHTS + by_size, 1 if size else 0)
            if not some:
                state = np.int64(NEXT[state, 0]) if dependent else state
                continue
        context = (plane * 8 + near) * 2 + (1 if place == 0 else 0)
        found = 1
        one = _above_one_context(context, state)
        other = (ABOVE_ONE_THERE if state < 2 else ABOVE_ONE_THERE_FINE) + plane * 32 + there
        if refined:
            third, fourth = (3 + (state >> 1)) * 288 + beside, (3 + (state >> 1)) * 1152 + turned
            weights = COEFFICIENT_WEIGHTS + 24 + 2 * plane
            more = code_of_four(coder, one, other, third, fourth, weights, 1 if size > 1 else 0)
        else:
            more = code_mixed(coder, one, other, WEIGHTS + 12 + plane, 1 if size > 1 else 0)
        if more:
            found = 2
            if code_bit(coder, ABOVE_TWO + context, 1 if size > 2 else 0):
                rest = _rest_context(plane, around, finer)
                found = 3 + min(code_number(coder, rest, np.int64(16), np.int64(0), size - 3), MOST_LEVEL)
        if dependent:
            odd, state = state >> 1, np.int64(NEXT[state, found & 1])
            found = 2 * found - odd
        if signed:
            levels[y, x] = -found if code_raw(coder, 1 if value < 0 else 0) else found
        elif value == 0:  # a reader's
            levels[y, x] = found


@stage_kernel
def _size_cost(costs, bits, size, around, place, plane, finer, state):
    """``bits``, and those of a magnitude that is known not to be zero, with its sign."""
    bits += np.float32(1)
    context = (plane * 8 + min(around, 7)) * 2 + (1 if place == 0 else 0)
    bits += bit_cost(costs, _above_one_context(context, state), 1 if size > 1 else 0)
    if size > 1:
        bits += bit_cost(costs, ABOVE_TWO + context, 1 if size > 2 else 0)
        if size > 2:
            bits += number_cost(costs, _rest_context(plane, around, finer), np.int64(16), np.int64(0), size - 3)
    return bits


@stage_kernel
def _level_cost(costs, size, around, place, plane, log, last, finer, state):
    bits = np.float32(0)
    if not last:
        bits += bit_cost(costs, _significant_context(plane, log, place, min(around, 7), state), 1 if size else 0)
        if size == 0:
            return bits
    return _size_cost(costs, bits, size, around, place, plane, finer, state)


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


@by_reference
class Trellis(NamedTuple):
    """Memory of `quantise_dependent`: the best path to each state."""

    levels: Any  # (n · n, STATES) magnitude chosen at a place,
    came: Any  # and the state before; -1 where the path begins
    sizes: Any  # (2, STATES + 1, n + 5) magnitudes by row on the last two diagonals, after and before two zeros,
    around: Any  # (STATES + 1, n) and classes of their sums by row of the next; the last state's are zeros


def new_trellis() -> Trellis:
    """Memory of `quantise_dependent`."""
    return Trellis(
        levels=np.zeros((LARGEST * LARGEST, STATES), np.int32),
        came=np.zeros((LARGEST * LARGEST, STATES), np.int32),
        sizes=np.zeros((2, STATES + 1, LARGEST + 5), np.int32),
        around=np.zeros((STATES + 1, LARGEST), np.int64),
    )


@stage_kernel
def _candidates(exact, square, odd):
    """Levels next to a coefficient in halves, an even and an odd one, their errors, and whether zero is another.

    Errors are in squared halves and less that of zero, ``square``.
    """
    low: Any = min(np.int64((exact + odd) * np.float32(0.5)), MOST_LEVEL // 2 - 1)
    even, uneven = (low + 1, low) if low & 1 else (low, low + 1)
    missed = exact - (np.float32(2 * even) - odd if even else np.float32(0))
    other = exact - (np.float32(2 * uneven) - odd)
    return even, uneven, fused(missed, missed, -square), fused(other, other, -square), low == 1 or low == 2


@stage_kernel
def _branches(costs, path, state, near, where, sizes, candidates):
    """Extend the path to a state by an even level and by an odd one: twice cost, bits, level and state."""
    (total, bits, entered), (place, plane, log, finer) = path, where
    around = near[1][np.uint64(entered), np.uint64(near[0])]
    even, uneven, error, other_error, zero = candidates
    square, weight, nothing = sizes
    context = _significant_context(plane, log, place, min(around, 7), state)
    none, some = bit_cost(costs, context, 0), bit_cost(costs, context, 1)
    more = _size_cost(costs, some, even, around, place, plane, finer, state) if even else none
    cost = fused(weight, more, fused(square, error, total))
    if zero:
        least = fused(weight, none, fused(square, nothing, total))
        if least < cost:
            cost, more, even = least, none, np.int64(0)
    other = _size_cost(costs, some, uneven, around, place, plane, finer, state)
    other_cost = fused(weight, other, fused(square, other_error, total))
    return (cost, bits + more, even, state), (other_cost, bits + other, uneven, state)


@stage_kernel
def _beginnings(costs, k, shape, where, sizes, candidates):
    """As `_branches`, of a path that begins; both of its levels are coded."""
    place, plane, _, finer = where
    even, uneven, error, other_error, _ = candidates
    square, weight, _ = sizes
    bits = number_cost(costs, _last_context(plane, shape), np.int64(12), np.int64(0), k)
    total = weight * bits
    more = _size_cost(costs, np.float32(0), even, 0, place, plane, finer, 0)
    other = _size_cost(costs, np.float32(0), uneven, 0, place, plane, finer, 0)
    cost = fused(weight, more, fused(square, error, total)) if even else HUGE
    other_cost = fused(weight, other, fused(square, other_error, total))
    return (cost, bits + more, even, np.int64(-1)), (other_cost, bits + other, uneven, np.int64(-1))


@stage_kernel
def _cheaper(one, other):
    return other if other[0] < one[0] else one


@stage_kernel
def _arrive(trellis, k, to, found, paths):
    """Note the best branch to a state; return the path's cost, its bits, and its state before this diagonal."""
    cost, bits, level, came = found
    trellis.levels[np.uint64(k), np.uint64(to)], trellis.came[np.uint64(k), np.uint64(to)] = level, came
    entered = paths[0][2]
    if came == 1:
        entered = paths[1][2]
    elif came == 2:
        entered = paths[2][2]
    elif came == 3:
        entered = paths[3][2]
    elif came < 0:
        entered = np.int64(STATES)
    return cost, bits, entered


@stage_kernel
def _end_diagonal(trellis, now, first, end, diagonal, shape, entered):
    """Note the paths' magnitudes on a diagonal, of places first … end - 1, and their classes around the next."""
    h, w = sides(shape)
    low, high = max(diagonal - w + 1, 0), min(diagonal, h - 1)
    for state in range(STATES):
        sizes, before = trellis.sizes[now, state], trellis.sizes[1 - now, entered[state]]
        for y in range(low, high + 5):  # two zeros before and after
            sizes[np.uint64(y)] = 0
        at = np.int64(state)
        for k in range(first, end):
            y, _ = _scanned(shape, k)
            sizes[np.uint64(y + 2)] = trellis.levels[np.uint64(k), np.uint64(at)]
            at = np.int64(trellis.came[np.uint64(k), np.uint64(at)])
            if at < 0:
                break
        around = trellis.around[state]
        for y in range(max(low - 1, 0), min(diagonal, h)):
            near, far = sizes[np.uint64(y + 2)] + sizes[np.uint64(y + 3)], before[np.uint64(y + 2)]
            far += before[np.uint64(y + 3)] + before[np.uint64(y + 4)]
            around[np.uint64(y)] = _class_of(near + far)


@stage_kernel
def _inside(path, state):
    """A path to a state, which enters the next diagonal."""
    return path[0], path[1], np.int64(state)


@stage_kernel
def _arrivals(costs, paths, near, where, k, shape, size, half, weight):
    """The best branches by the k-th place to each of the states: cost, bits, level and state before."""
    exact = size / half
    square = exact * exact
    sizes = half * half, weight, fused(exact, exact, -square)
    even, odd = _candidates(exact, square, np.float32(0)), _candidates(exact, square, np.float32(1))
    from_0 = _branches(costs, paths[0], np.int64(0), near, where, sizes, even)
    from_1 = _branches(costs, paths[1], np.int64(1), near, where, sizes, even)
    from_2 = _branches(costs, paths[2], np.int64(2), near, where, sizes, odd)
    from_3 = _branches(costs, paths[3], np.int64(3), near, where, sizes, odd)
    to_0, to_2 = _cheaper(from_0[0], from_1[1]), _cheaper(from_0[1], from_1[0])
    to_1, to_3 = _cheaper(from_2[0], from_3[1]), _cheaper(from_2[1], from_3[0])
    if size > half:
        begun = _beginnings(costs, k, shape, where, sizes, even)
        to_0, to_2 = _cheaper(to_0, begun[0]), _cheaper(to_2, begun[1])
    return to_0, to_1, to_2, to_3


@stage_kernel
def _best_path(costs, coefficients, first, plane, shape, step, weight, finer, trellis):
    """Fill the trellis from the first place on; return the last state of the best path, its cost and its bits.

    Paths are by state: cost, less that of no levels, in squared error, bits, and state before the diagonal.
    """
    half = step * np.float32(HALF / 16)
    y, x = _scanned(shape, first)
    diagonal, end, now = y + x, first + 1, 0
    never = HUGE, np.float32(0), np.int64(STATES)
    paths = never, never, never, never
    for k in range(first, -1, -1):
        y, x = _scanned(shape, k)
        if y + x != diagonal:
            entered = paths[0][2], paths[1][2], paths[2][2], paths[3][2]
            _end_diagonal(trellis, now, k + 1, end, diagonal, shape, entered)
            diagonal, end, now = y + x, k + 1, 1 - now
            paths = _inside(paths[0], 0), _inside(paths[1], 1), _inside(paths[2], 2), _inside(paths[3], 3)
        size = abs(np.float32(coefficients[np.uint64(y), np.uint64(x)]))
        where, near = (_place(y, x), plane, size_of(shape), finer), (y, trellis.around)
        to = _arrivals(costs, paths, near, where, k, shape, size, half, weight)
        to_0, to_1 = _arrive(trellis, k, 0, to[0], paths), _arrive(trellis, k, 1, to[1], paths)
        to_2, to_3 = _arrive(trellis, k, 2, to[2], paths), _arrive(trellis, k, 3, to[3], paths)
        paths = to_0, to_1, to_2, to_3
    state, best = np.int64(0), paths[0]
    for other in range(1, STATES):
        if paths[other][0] < best[0]:
            state, best = np.int64(other), paths[other]
    return state, best[0], best[1]


@part_kernel
def quantise_dependent(costs, coefficients, plane, shape, step, weight, levels, finer, trellis):
    """As `quantise`, by a dependent quantiser: the path of least cost through its states (Viterbi)."""
    h, w = sides(shape)
    nothing, first = _none(coefficients, np.float32(NEVER) * step, levels, h, w)
    if first < 0:
        return np.float32(0), nothing
    state, least, bits = _best_path(costs, coefficients, first, plane, shape, step, weight, finer, trellis)
    if least >= 0:
        return np.float32(0), nothing
    for k in range(first + 1):
        level: Any = np.int64(trellis.levels[k, state])
        before: Any = np.int64(trellis.came[k, state])
        if level:
            y, x = _scanned(shape, k)
            level = 2 * level - (max(before, 0) >> 1)
            levels[np.uint64(y), np.uint64(x)] = -level if coefficients[np.uint64(y), np.uint64(x)] < 0 else level
        if before < 0:
            break
        state = before
    return bits, nothing + least - weight * bits


@part_kernel
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
