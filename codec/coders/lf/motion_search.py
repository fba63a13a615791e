"""Encoder search of vectors: from the guesses outwards by steps that halve, least squared error + weight · bits."""

from __future__ import annotations

import numpy as np

from ii_core.base.jit import part_kernel

from . import motion
from .motion import MOST, NONE, STILL, packed, unpacked, vector_cost
from .transform import sides

WIDE, NEAR = 32, 8  # quarters of a sample: first step of the largest blocks, and of others
ROUNDS = 4  # of a step


@part_kernel
def _cost(costs, job, search, work, y0, x0, shape, vector):
    """Squared error of the first plane + weight · bits of the vector."""
    h, w = sides(shape)
    motion.move(job, work, 1, y0, x0, shape, vector)
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
                cost = _cost(costs, job, search, work, y0, x0, shape, tried)
                if cost < best:
                    best, vector = cost, tried
            if vector == before:
                break
        step >>= 1
    return vector, best


@part_kernel
def best_vector(costs, job, search, work, y0, x0, shape, enough):
    """The vector of the least cost; a guess that costs less than ``enough`` is not refined."""
    first, left, above = motion.guesses(job, y0 >> 2, x0 >> 2, shape)
    vector = first
    best = _cost(costs, job, search, work, y0, x0, shape, first)
    for guess in (left, above, np.int64(STILL)):
        if guess != NONE and guess != first:
            cost = _cost(costs, job, search, work, y0, x0, shape, guess)
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
            cost = _cost(costs, job, search, work, y0, x0, shape, tried)
            tried, cost = _descend(costs, job, search, work, y0, x0, shape, tried, cost, 4)
            if cost < best:
                best, vector = cost, tried
    return vector
