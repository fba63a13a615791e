"""Bits of an intra mode: one of two likely ones, flat, smooth, or a direction."""

from __future__ import annotations

import numpy as np

from ii_core.base.jit import part_kernel, stage_kernel

from . import contexts as at
from .arithmetic import REFINED, bit_cost, code_bit, code_mixed, code_of_four, code_raw
from .intra import MODES, SMOOTH, coarse
from .state import DIRECTION, INTRA, KIND, around_block, neighbours
from .transform import size_of

SIDE, STRAIGHT = 17, 8  # directions from one side, and the place of the straight one among them


@part_kernel
def likely_directions(blocks, by, bx):
    """Two intra modes, from the blocks left and above."""
    first = np.int64(blocks[DIRECTION, by, bx - 1]) if bx > 0 else SMOOTH
    second = np.int64(blocks[DIRECTION, by - 1, bx]) if by > 0 else 0
    if second == first:
        second = 0 if first else SMOOTH
    return first, second


@part_kernel
def mode_contexts(job, by, bx, shape):
    """Of the first likely mode, the second, flat or smooth, and which of these; the last is -1 of even bits."""
    if not job.directed:
        return np.int64(at.INTRA_MODE), np.int64(at.INTRA_MODE + 1), np.int64(at.INTRA_MODE + 2), np.int64(-1)
    blocks = job.blocks
    like = neighbours(blocks, np.int64(KIND), np.int64(INTRA), by, bx)
    if like == 2 and blocks[DIRECTION, by, bx - 1] == blocks[DIRECTION, by - 1, bx]:
        like = 3
    first = np.int64(at.LIKELY + (size_of(shape) - 2) * 4 + like)
    return first, first + 16, np.int64(at.UNDIRECTED + size_of(shape) - 2), np.int64(at.UNDIRECTED + 4)


@part_kernel
def code_mode(coder, job, by, bx, shape, mode):
    """Write or read an intra mode: one of two likely ones, flat, smooth, or a direction."""
    if coder.state[REFINED]:
        return _code_mode_around(coder, job, by, bx, shape, mode)
    first, second = likely_directions(job.blocks, by, bx)
    one, two, undirected, smooth = mode_contexts(job, by, bx, shape)
    if code_bit(coder, one, 1 if mode == first else 0):
        return first
    if code_bit(coder, two, 1 if mode == second else 0):
        return second
    if code_bit(coder, undirected, 1 if mode <= SMOOTH else 0):
        return code_bit(coder, smooth, mode) if smooth >= 0 else code_raw(coder, mode)
    if not job.directed:
        return 2 + _code_direction(coder, mode - 2)
    value = mode - 2
    side = code_bit(coder, np.int64(at.SIDE), 1 if value >= SIDE else 0)
    straight = code_bit(coder, np.int64(at.STRAIGHT + side), 1 if value == SIDE * side + STRAIGHT else 0)
    return 2 + (SIDE * side + STRAIGHT if straight else _code_slope(coder, value, side))


@part_kernel
def _code_mode_around(coder, job, by, bx, shape, mode):
    """As `code_mode`, from version 12 on: contexts are of the modes around, and mixed."""
    blocks = job.blocks
    first, second = likely_directions(blocks, by, bx)
    one, two, undirected, smooth = mode_contexts(job, by, bx, shape)
    like = (one - at.LIKELY) & 3
    form = 0 if shape[0] == shape[1] else (1 if shape[0] < shape[1] else 2)
    around = around_block(blocks, DIRECTION, by, bx, shape, np.int64(SMOOTH))
    if _code_likely(coder, first, 0, one, mode, around, like, form):
        return first
    if _code_likely(coder, second, 1, two, mode, around, like, form):
        return second
    return _code_other(coder, job, shape, mode, (first, second), around, (undirected, smooth), like, form)


@part_kernel
def _code_other(coder, job, shape, mode, likely, around, undirected, like, form):
    """Write or read a mode that is none of the likely ones, whose contexts are by the coarse modes around."""
    first, second, above, left = coarse(likely[0]), coarse(likely[1]), coarse(around[1]), coarse(around[2])
    exact, mode, (undirected, smooth) = mode, coarse(mode), undirected
    one_side, two_side, above_side, left_side = _side_of(first), _side_of(second), _side_of(above), _side_of(left)
    both = one_side * 3 + two_side
    directed = (1 if one_side else 0) + (1 if two_side else 0) + (1 if above_side else 0) + (1 if left_side else 0)
    directed = min(directed, 3)
    formed, liked = at.UNDIRECTED_FORM + directed * 3 + form, at.UNDIRECTED_LIKE + directed * 4 + like
    bit, weights = 1 if mode <= SMOOTH else 0, at.MODE_WEIGHTS + 4
    if code_of_four(coder, undirected, at.UNDIRECTED_SIDES + both, formed, liked, weights, bit):
        return code_bit(coder, smooth, mode)
    votes = 0
    for which in range(1, 3):
        count = 2 * ((1 if one_side == which else 0) + (1 if two_side == which else 0))
        count += (1 if above_side == which else 0) + (1 if left_side == which else 0)
        votes += min(count, 5) * (6 if which == 2 else 1)
    value, weights = mode - 2, at.MODE_WEIGHTS + 6
    sided, bit = at.SIDE_SIDES + both, 1 if value >= SIDE else 0
    side = code_of_four(coder, np.int64(at.SIDE), at.SIDE_VOTES + votes, at.SIDE_FORM + form, sided, weights, bit)
    straight = 2 + SIDE * side + STRAIGHT
    same = (1 if first == straight else 0) + (1 if second == straight else 0)
    same += (1 if above == straight else 0) + (1 if left == straight else 0)
    formed, sided = at.STRAIGHT_FORM + side * 3 + form, at.STRAIGHT_SIDES + side * 9 + both
    bit, weights = 1 if mode == straight else 0, at.MODE_WEIGHTS + 8
    if code_of_four(coder, at.STRAIGHT + side, at.STRAIGHT_SAME + side * 5 + same, formed, sided, weights, bit):
        mode = straight
    else:
        mode = 2 + _code_slope(coder, value, side)
    return _code_beside(coder, shape, likely, mode, exact) if job.guided else mode


@stage_kernel
def _relation(likely, mode):
    """Of a likely mode and a coarse one: 0 no direction from its side, 1 before it, 5 after, 2 it, 3, 4 beside it."""
    near = coarse(likely)
    if _side_of(near) != _side_of(mode):
        return 0
    if near != mode:
        return 1 if near < mode else 5
    return 2 if likely < MODES else 3 + ((likely - MODES) & 1)


@stage_kernel
def _beside_contexts(shape, likely, mode):
    """Of whether a direction is beside that of the mode, and of which way: two each."""
    near = _relation(likely[0], mode) * 6 + _relation(likely[1], mode)
    place = (size_of(shape) - 2) * 34 + mode - 2
    return at.BESIDE_PLACE + place, at.BESIDE_NEAR + near, at.WAY_PLACE + place, at.WAY_NEAR + near


@part_kernel
def _code_beside(coder, shape, likely, mode, exact):
    """Write or read which direction it is of the three by a coarse mode."""
    one, other, way, near = _beside_contexts(shape, likely, mode)
    if not code_mixed(coder, one, other, np.int64(at.GUIDED_WEIGHTS), 1 if exact >= MODES else 0):
        return mode
    up = code_mixed(coder, way, near, np.int64(at.GUIDED_WEIGHTS + 1), (exact - MODES) & 1)
    return MODES + 2 * (mode - 2) + up


@part_kernel
def _beside_cost(costs, shape, likely, exact):
    """Bits that `_code_beside` would take."""
    _, one, _, near = _beside_contexts(shape, likely, coarse(exact))
    bits = bit_cost(costs, one, 1 if exact >= MODES else 0)
    return bits + bit_cost(costs, near, (exact - MODES) & 1) if exact >= MODES else bits


@stage_kernel
def _side_of(mode):
    """0 without a direction, 1 from above, 2 from the left."""
    return 0 if mode <= SMOOTH else (1 if mode < 2 + SIDE else 2)


@stage_kernel
def mode_class(mode):
    """0 flat, 1 smooth, 2 from above, 3 from the left, 4 straight."""
    if mode <= SMOOTH:
        return np.int64(mode)
    return np.int64(4 if (mode - 2) % SIDE == STRAIGHT else 1 + _side_of(mode))


@stage_kernel
def _code_likely(coder, likely, which, one, where, around, like, form):
    """Write or read whether a mode is the first likely one, or the second; ``where`` holds the mode."""
    corner, above, left = around
    agree = (1 if corner == likely else 0) + (1 if above == likely else 0) + (1 if left == likely else 0)
    near = at.LIKELY_NEAR + (which * 5 + mode_class(coarse(likely))) * 4 + agree
    alike = at.LIKELY_MODE + (which * MODES + coarse(likely)) * 2 + (1 if left == likely else 0)
    formed = at.LIKELY_FORM + (which * 3 + form) * 4 + like
    return code_of_four(coder, one, near, alike, formed, at.MODE_WEIGHTS + 2 * which, 1 if where == likely else 0)


@part_kernel
def _code_direction(coder, value):
    """34 directions: 30 of five bits, the last 4 of six."""
    long = value >= 30
    head = 30 + ((value - 30) >> 1) if long else value
    found = 0
    for place in range(4, -1, -1):
        found = 2 * found + code_raw(coder, (head >> place) & 1)
    if found >= 30:
        found = 30 + 2 * (found - 30) + code_raw(coder, (value - 30) & 1)
    return min(found, 33)


@part_kernel
def _code_slope(coder, value, side):
    """The directions of a side but the straight one: which way it turns, and how far."""
    slope = value - SIDE * side - STRAIGHT
    back = code_bit(coder, np.int64(at.TURN + side), 1 if slope < 0 else 0)
    size, node = abs(slope) - 1, np.int64(1)
    for place in range(2, -1, -1):
        node = 2 * node + code_bit(coder, at.SLOPE + 8 * side + node, (size >> place) & 1)
    return SIDE * side + STRAIGHT + (7 - node if back else node - 7)


@part_kernel
def mode_cost(costs, job, by, bx, shape, mode):
    """Bits that `code_mode` would take."""
    first, second = likely_directions(job.blocks, by, bx)
    one, two, undirected, smooth = mode_contexts(job, by, bx, shape)
    bits = bit_cost(costs, one, 1 if mode == first else 0)
    if mode == first:
        return bits
    bits += bit_cost(costs, two, 1 if mode == second else 0)
    if mode == second:
        return bits
    bits += bit_cost(costs, undirected, 1 if mode <= SMOOTH else 0)
    if mode <= SMOOTH:
        return bits + (bit_cost(costs, smooth, mode) if smooth >= 0 else np.float32(1))
    bits += _slope_cost(costs, coarse(mode) - 2) if job.directed else np.float32(5.1)
    return bits + _beside_cost(costs, shape, (first, second), mode) if job.guided else bits


@part_kernel
def _slope_cost(costs, value):
    """Bits that a direction would take from version 9 on."""
    side = 1 if value >= SIDE else 0
    slope = value - SIDE * side - STRAIGHT
    bits = bit_cost(costs, np.int64(at.SIDE), side) + bit_cost(costs, at.STRAIGHT + side, 1 if slope == 0 else 0)
    if slope:
        bits += bit_cost(costs, at.TURN + side, 1 if slope < 0 else 0)
        size, node = abs(slope) - 1, 1
        for place in range(2, -1, -1):
            bit = (size >> place) & 1
            bits += bit_cost(costs, at.SLOPE + 8 * side + node, bit)
            node = 2 * node + bit
    return bits


assert MODES == 36  # `_code_direction` counts on 34 directions
