"""Prediction of a block in time: from the same view at earlier instants of a take, moved by a vector.

A vector holds the instant, 0 for the latest, and a motion down and across in quarters of a sample. It is one number:
``instant · 2²⁴ + (down + 2¹¹) · 2¹² + across + 2¹¹``. Blocks that are not predicted in time note the vector that they
would inherit, so that neighbours find one everywhere.
"""

from __future__ import annotations

import numpy as np

from ii_core.base.jit import lean_kernel, part_kernel, stage_kernel

from . import contexts as at
from .arithmetic import bit_cost, code_bit, code_number, number_cost
from .transform import sides, size_of
from .warp import clamped, led, moved_block

MOST_PAST = 4  # earlier instants
QUARTER = 64  # of a sample, in 2^-8
HALF = 1 << 11
MOST = HALF - 1  # of a motion, in quarters
STILL = (HALF << 12) + HALF  # the vector of no motion since the latest instant
NONE = -1
# What is known of each 4×4: whether it is predicted in time, and its vector.
IN_TIME, PAST, DOWN, ACROSS, FIELDS = range(5)
NOTHING = np.zeros((0, 1, 1, 1), np.int16)  # earlier instants of a picture alone
# Steps of the encoder's search.
WIDE, NEAR = 32, 8  # quarters of a sample: first step of the largest blocks, and of others
ROUNDS = 4  # of a step


@stage_kernel
def packed(past, down, across):
    """A vector as one number."""
    return (past << 24) + ((down + HALF) << 12) + across + HALF


@stage_kernel
def unpacked(vector):
    """Instant, motion down, motion across."""
    return vector >> 24, ((vector >> 12) & 4095) - HALF, (vector & 4095) - HALF


@stage_kernel
def noted(job, view, by, bx):
    """The vector that a view notes at a 4×4."""
    motions = job.motions
    return packed(
        np.int64(motions[view, PAST, by, bx]),
        np.int64(motions[view, DOWN, by, bx]),
        np.int64(motions[view, ACROSS, by, bx]),
    )


@part_kernel
def note(job, by, bx, shape, in_time, vector):
    """Note the vector of a decoded block."""
    past, down, across = unpacked(vector)
    h, w = sides(shape)
    for y in range(by, by + (h >> 2)):
        for x in range(bx, bx + (w >> 2)):
            job.motions[job.at, IN_TIME, y, x] = in_time
            job.motions[job.at, PAST, y, x] = past
            job.motions[job.at, DOWN, y, x] = down
            job.motions[job.at, ACROSS, y, x] = across


@part_kernel
def inherited(job, by, bx, shape):
    """Vector of the nearest view of the same instant at what the block shows; and whether it is predicted in time.

    Without such a view: no motion, and 0; else 1 or 2.
    """
    if job.references.shape[0] == 0:
        return np.int64(STILL), 0
    height, width = job.blocks.shape[1:]
    h, w = sides(shape)
    y, x = 4 * by + (h >> 1), 4 * bx + (w >> 1)
    if job.synthesised:
        d = np.int64(job.disparity[y, x])
        dy, dx = led(job.references, 0, d, y, x, job.views.shape[2:])
        y, x = y + ((dy + 128) >> 8), x + ((dx + 128) >> 8)
    j, i = clamped(y >> 2, height), clamped(x >> 2, width)
    view = job.references[0, 0]
    return noted(job, view, j, i), 1 + np.int64(job.motions[view, IN_TIME, j, i])


@part_kernel
def guesses(job, by, bx, shape):
    """Vectors inherited, of the block left and of the block above; `NONE` where these are not predicted in time."""
    left = above = np.int64(NONE)
    if bx > 0 and job.motions[job.at, IN_TIME, by, bx - 1]:
        left = noted(job, job.at, by, bx - 1)
    if by > 0 and job.motions[job.at, IN_TIME, by - 1, bx]:
        above = noted(job, job.at, by - 1, bx)
    return inherited(job, by, bx, shape)[0], left, above


@part_kernel
def time_context(job, by, bx, shape):
    """By size, how many of the blocks above and left are predicted in time, and the inherited block."""
    motions, like = job.motions, 0
    if by > 0 and motions[job.at, IN_TIME, by - 1, bx]:
        like += 1
    if bx > 0 and motions[job.at, IN_TIME, by, bx - 1]:
        like += 1
    return at.IN_TIME + ((size_of(shape) - 2) * 3 + like) * 3 + inherited(job, by, bx, shape)[1]


@part_kernel
def code_vector(coder, job, by, bx, shape, vector):
    """Write or read a vector."""
    first, left, above = guesses(job, by, bx, shape)
    context = at.VECTOR + (size_of(shape) - 2) * 5
    if code_bit(coder, _first_context(context, first, left), 1 if vector == first else 0):
        return first
    if left != NONE and left != first and code_bit(coder, context + 3, 1 if vector == left else 0):
        return left
    new = above != NONE and above != first and above != left
    if new and code_bit(coder, context + 4, 1 if vector == above else 0):
        return above
    past, down, across = unpacked(vector)
    base = left if left != NONE else (above if above != NONE else first)
    _, base_down, base_across = unpacked(base)
    found = 0
    while found < job.past.shape[0] - 1 and code_bit(coder, at.INSTANT + found, 1 if past > found else 0):
        found += 1
    down = _code_component(coder, at.COMPONENT, down - base_down) + base_down
    across = _code_component(coder, at.COMPONENT + 15, across - base_across) + base_across
    return packed(found, min(max(down, -MOST), MOST), min(max(across, -MOST), MOST))


@stage_kernel
def _first_context(context, first, left):
    """Whether the block left has the inherited vector, another, or none."""
    return context + (0 if left == NONE else (1 if left == first else 2))


@part_kernel
def _code_component(coder, first, value):
    size = code_number(coder, np.int64(first), np.int64(14), np.int64(1), abs(value))
    if size:
        size = -size if code_bit(coder, np.int64(first + 14), 1 if value < 0 else 0) else size
    return size


@part_kernel
def vector_cost(costs, job, by, bx, shape, vector):
    """Bits that `code_vector` would take."""
    first, left, above = guesses(job, by, bx, shape)
    context = at.VECTOR + (size_of(shape) - 2) * 5
    bits = bit_cost(costs, _first_context(context, first, left), 1 if vector == first else 0)
    if vector == first:
        return bits
    if left != NONE and left != first:
        bits += bit_cost(costs, context + 3, 1 if vector == left else 0)
        if vector == left:
            return bits
    if above != NONE and above != first and above != left:
        bits += bit_cost(costs, context + 4, 1 if vector == above else 0)
        if vector == above:
            return bits
    past, down, across = unpacked(vector)
    base = left if left != NONE else (above if above != NONE else first)
    _, base_down, base_across = unpacked(base)
    for i in range(job.past.shape[0] - 1):
        if i <= past:
            bits += bit_cost(costs, at.INSTANT + i, 1 if past > i else 0)
    bits += _component_cost(costs, at.COMPONENT, down - base_down)
    return bits + _component_cost(costs, at.COMPONENT + 15, across - base_across)


@part_kernel
def _component_cost(costs, first, value):
    bits = number_cost(costs, np.int64(first), np.int64(14), np.int64(1), abs(value))
    return bits + bit_cost(costs, first + 14, 1 if value < 0 else 0) if value else bits


@part_kernel
def move(job, work, planes, y0, x0, shape, vector):
    """work.predicted = the first planes of the same view at an earlier instant, moved by a vector."""
    past, down, across = unpacked(vector)
    h, w = sides(shape)
    predicted = work.predicted
    for p in range(planes):
        for y in range(h):
            for x in range(w):
                predicted[p, y, x] = 0
        moved_block(job.past, past, p, y0, x0, h, w, down * QUARTER, across * QUARTER, work.rows, predicted)
        for y in range(h):
            for x in range(w):
                predicted[p, y, x] = np.int32(predicted[p, y, x] + np.int32(2048)) >> 12


@part_kernel
def predict_in_time(job, work, y0, x0, shape, vector, mixed):
    """work.predicted = the view at an earlier instant; ``mixed``: its mean with the synthesised view."""
    move(job, work, 3, y0, x0, shape, vector)
    if mixed:
        h, w = sides(shape)
        for p in range(3):
            for y in range(h):
                for x in range(w):
                    work.predicted[p, y, x] = (
                        work.predicted[p, y, x] + np.int32(job.made[p, y0 + y, x0 + x]) + 1
                    ) >> 1


@lean_kernel
def carry(job, past, out):
    """Disparity of blocks that are predicted in time: that of the earlier instant, moved with the samples."""
    height, width = out.shape
    for y in range(height):
        for x in range(width):
            if job.motions[job.at, IN_TIME, y >> 2, x >> 2]:
                instant, down, across = unpacked(noted(job, job.at, y >> 2, x >> 2))
                j, i = clamped(y + ((down + 2) >> 2), height), clamped(x + ((across + 2) >> 2), width)
                out[y, x] = past[instant, j, i]


@part_kernel
def _vector_error(costs, job, search, work, y0, x0, shape, vector):
    """Squared error of the first plane + weight · bits of the vector."""
    h, w = sides(shape)
    move(job, work, 1, y0, x0, shape, vector)
    total = np.float32(0)
    for y in range(h):
        for x in range(w):
            difference = np.float32(search.original[0, y0 + y, x0 + x] - work.predicted[0, y, x])
            total += difference * difference
    return total + search.weight * vector_cost(costs, job, y0 >> 2, x0 >> 2, shape, vector)


@part_kernel
def _descend(costs, job, search, work, y0, x0, shape, vector, best, step):
    """Move to the best of eight neighbours, by steps that halve; return vector and cost."""
    while step:
        for _ in range(ROUNDS):
            past, down, across = unpacked(vector)
            before = vector
            for place in range(9):
                y, x = down + (place // 3 - 1) * step, across + (place % 3 - 1) * step
                if place == 4 or max(abs(y), abs(x)) > MOST:
                    continue
                tried = packed(past, y, x)
                cost = _vector_error(costs, job, search, work, y0, x0, shape, tried)
                if cost < best:
                    best, vector = cost, tried
            if vector == before:
                break
        step >>= 1
    return vector, best


@part_kernel
def best_vector(costs, job, search, work, y0, x0, shape, enough):
    """The vector of the least cost, from the guesses outwards by steps that halve.

    A guess that costs less than ``enough`` is not refined.
    """
    first, left, above = guesses(job, y0 >> 2, x0 >> 2, shape)
    vector = first
    best = _vector_error(costs, job, search, work, y0, x0, shape, first)
    for guess in (left, above, np.int64(STILL)):
        if guess != NONE and guess != first:
            cost = _vector_error(costs, job, search, work, y0, x0, shape, guess)
            if cost < best:
                best, vector = cost, guess
    if best < enough:
        return vector
    step = WIDE if shape == (5, 5) else NEAR
    vector, best = _descend(costs, job, search, work, y0, x0, shape, vector, best, step)
    past, down, across = unpacked(vector)
    for other in range(job.past.shape[0]):
        if other != past:
            y, x = down * (other + 1) // (past + 1), across * (other + 1) // (past + 1)
            tried = packed(other, min(max(y, -MOST), MOST), min(max(x, -MOST), MOST))
            cost = _vector_error(costs, job, search, work, y0, x0, shape, tried)
            tried, cost = _descend(costs, job, search, work, y0, x0, shape, tried, cost, 4)
            if cost < best:
                best, vector = cost, tried
    return vector
