"""Bits of how a block is predicted: its kind, disparity, references and mode, each by what is known around it."""

from __future__ import annotations

import numpy as np

from ii_core.base.jit import part_kernel

from . import contexts as at
from . import motion
from .arithmetic import bit_cost, code_bit, code_number, number_cost
from .modes import code_mode, mode_cost
from .state import EXPLICIT, INDEX, INTRA, KIND, MASK, MIXED, SYNTHESIS, TIMED, UNKNOWN, doubt_class, neighbours
from .transform import sides, size_of
from .warp import LATTICE, led

DIFFERENT = 205  # disparities that lead this far apart, in 2^-8 samples, are of different surfaces


@part_kernel
def synthesis_context(job, by, bx, shape):
    """By size, how many of the blocks above and left are synthesised, and doubt."""
    like = neighbours(job.blocks, np.int64(KIND), np.int64(SYNTHESIS), by, bx)
    return at.SYNTHESIS + ((size_of(shape) - 2) * 3 + like) * 4 + doubt_class(job, by, bx, shape)


@part_kernel
def mixed_context(job, by, bx, shape):
    """By size, and how many of the blocks above and left are mixed."""
    return at.MIXED + (size_of(shape) - 2) * 3 + neighbours(job.blocks, np.int64(KIND), np.int64(MIXED), by, bx)


@part_kernel
def guesses(job, by, bx, shape):
    """Indices that the synthesis and the blocks left and above suggest; below the range where there is none."""
    none = job.low - 1
    made = left = above = none
    if job.synthesised:
        h, w = sides(shape)
        d = np.int64(job.disparity[by * 4 + (h >> 1), bx * 4 + (w >> 1)])
        made = min(max((2 * d + job.unit) // (2 * job.unit), job.low), job.high)
    if bx > 0 and job.blocks[KIND, by, bx - 1] == EXPLICIT:
        left = np.int64(job.blocks[INDEX, by, bx - 1])
    if by > 0 and job.blocks[KIND, by - 1, bx] == EXPLICIT:
        above = np.int64(job.blocks[INDEX, by - 1, bx])
    return made, left, above


@part_kernel
def from_where(job, by, bx, shape, index):
    """Return the source that predicts an index: 1 synthesis, 2 block to the left, 3 block above, 0 none."""
    made, left, above = guesses(job, by, bx, shape)
    none = job.low - 1
    if made > none and index == made:
        return 1
    if left > none and index == left:
        return 2
    return 3 if above > none and index == above else 0


@part_kernel
def seen_mask(job, by, bx, shape, index):
    """The references whose own disparity agrees at three of five places of the block, or is not known."""
    height, width = job.disparities.shape[1:]
    h, w = sides(shape)
    down, right = h >> 2, w >> 2
    seen = 0
    for r in range(job.references.shape[0]):
        view, columns, rows = job.references[r, 0], job.references[r, 1], job.references[r, 2]
        d = index * job.unit
        farthest = max(abs(columns), abs(rows))
        against = 0
        for place in range(5):
            y = 4 * by + (2 * down if place == 4 else down + 2 * down * (place >> 1))
            x = 4 * bx + (2 * right if place == 4 else right + 2 * right * (place & 1))
            dy, dx = led(job.references, r, d, y, x, (height, width))
            i, j = x + ((dx + 128) >> 8), y + ((dy + 128) >> 8)
            if i < 0 or j < 0 or i >= width or j >= height:
                against += 1
            else:
                other = np.int64(job.disparities[view, j, i])
                if other != UNKNOWN and abs(other - d) * farthest > DIFFERENT << LATTICE:
                    against += 1
        if against < 3:
            seen |= 1 << r
    return seen


@part_kernel
def expected_mask(job, by, bx, where, seen):
    """The references of the block left or above, or those that see the block; and a context."""
    left = above = np.int64(0)
    if bx > 0 and job.blocks[KIND, by, bx - 1] == EXPLICIT:
        left = np.int64(job.blocks[MASK, by, bx - 1])
    if by > 0 and job.blocks[KIND, by - 1, bx] == EXPLICIT:
        above = np.int64(job.blocks[MASK, by - 1, bx])
    expected = left
    if left == 0 or (where == 3 and above):
        expected = above
    if expected == 0:
        expected = seen
    if expected == 0:
        expected = (1 << job.references.shape[0]) - 1
    return expected, at.SAME_MASK + 2 * where + (1 if left == above else 0) + (8 if expected == seen else 0)


@part_kernel
def _made_context(made, left, none, shape):
    """By size, and whether the block left has the same index, another, or none."""
    return at.MERGE + (size_of(shape) - 2) * 5 + (0 if left <= none else (1 if left == made else 2))


@part_kernel
def code_kind(coder, job, by, bx, shape, kind, index, mask, direction):
    """Write or read how a block is predicted; return kind, index, mask and direction.

    The index of a block predicted in time is its vector.
    """
    blocks, count = job.blocks, job.references.shape[0]
    if job.past.shape[0] and code_bit(coder, motion.time_context(job, by, bx, shape), 1 if kind >= TIMED else 0):
        mixed = 0
        if job.synthesised:
            mixed = code_bit(coder, mixed_context(job, by, bx, shape), 1 if kind == MIXED else 0)
        vector = motion.code_vector(coder, job, by, bx, shape, index)
        return np.int64(MIXED if mixed else TIMED), vector, mask, direction
    if count == 0:
        kind = INTRA
    else:
        made = 0
        if job.synthesised:
            made = code_bit(coder, synthesis_context(job, by, bx, shape), 1 if kind == SYNTHESIS else 0)
        if made:
            kind = SYNTHESIS
        else:
            context = at.INTRA + neighbours(blocks, np.int64(KIND), np.int64(INTRA), by, bx)
            kind = INTRA if code_bit(coder, context, 1 if kind == INTRA else 0) else EXPLICIT
    if kind == SYNTHESIS:
        index = guesses(job, by, bx, shape)[0]
    elif kind == INTRA:
        direction = code_mode(coder, job, by, bx, shape, direction)
    else:
        index = _code_index(coder, job, by, bx, shape, index)
        where = from_where(job, by, bx, shape, index)
        seen = seen_mask(job, by, bx, shape, index)
        mask = _code_mask(coder, job, by, bx, where, seen, mask) if count > 1 else 1
    return kind, index, mask, direction


@part_kernel
def _code_index(coder, job, by, bx, shape, index):
    made, left, above = guesses(job, by, bx, shape)
    none = job.low - 1
    if made > none and code_bit(coder, _made_context(made, left, none, shape), 1 if index == made else 0):
        return made
    context = at.MERGE + (size_of(shape) - 2) * 5 + 3
    if left > none and left != made and code_bit(coder, context, 1 if index == left else 0):
        return left
    new = above > none and above != made and above != left
    if new and code_bit(coder, context + 1, 1 if index == above else 0):
        return above
    base = left if left > none else (above if above > none else (made if made > none else 0))
    size = code_number(coder, np.int64(at.DELTA), np.int64(14), np.int64(1), abs(index - base))
    if size:
        size = -size if code_bit(coder, np.int64(at.DELTA + 14), 1 if index < base else 0) else size
    return min(max(base + size, job.low), job.high)


@part_kernel
def _code_mask(coder, job, by, bx, where, seen, mask):
    expected, context = expected_mask(job, by, bx, where, seen)
    if code_bit(coder, context, 1 if mask == expected else 0):
        return expected
    count = job.references.shape[0]
    found = 0
    for i in range(count):
        if i == count - 1 and found == 0:
            found = 1 << i
        else:
            context = at.MASK + (((count - 1) * 4 + i) * 2 + (1 if found else 0)) * 2 + ((seen >> i) & 1)
            found |= code_bit(coder, context, (mask >> i) & 1) << i
    return found


@part_kernel
def kind_cost(costs, job, by, bx, shape, kind, index, mask, direction):
    """Bits that `code_kind` would take; those of the references left out if the mask is 0."""
    blocks, count = job.blocks, job.references.shape[0]
    bits = np.float32(0)
    if job.past.shape[0]:
        bits += bit_cost(costs, motion.time_context(job, by, bx, shape), 1 if kind >= TIMED else 0)
    if kind >= TIMED:
        if job.synthesised:
            bits += bit_cost(costs, mixed_context(job, by, bx, shape), 1 if kind == MIXED else 0)
        return bits + motion.vector_cost(costs, job, by, bx, shape, index)
    if count and job.synthesised:
        bits += bit_cost(costs, synthesis_context(job, by, bx, shape), 1 if kind == SYNTHESIS else 0)
    if count and kind != SYNTHESIS:
        context = at.INTRA + neighbours(blocks, np.int64(KIND), np.int64(INTRA), by, bx)
        bits += bit_cost(costs, context, 1 if kind == INTRA else 0)
    if kind == INTRA:
        bits += mode_cost(costs, job, by, bx, shape, direction)
    elif kind == EXPLICIT:
        bits += _index_cost(costs, job, by, bx, shape, index)
        if count > 1 and mask:
            seen = seen_mask(job, by, bx, shape, index)
            bits += mask_cost(costs, job, by, bx, from_where(job, by, bx, shape, index), seen, mask)
    return bits


@part_kernel
def _index_cost(costs, job, by, bx, shape, index):
    made, left, above = guesses(job, by, bx, shape)
    none = job.low - 1
    bits = np.float32(0)
    if made > none:
        bits += bit_cost(costs, _made_context(made, left, none, shape), 1 if index == made else 0)
        if index == made:
            return bits
    context = at.MERGE + (size_of(shape) - 2) * 5 + 3
    if left > none and left != made:
        bits += bit_cost(costs, context, 1 if index == left else 0)
        if index == left:
            return bits
    if above > none and above != made and above != left:
        bits += bit_cost(costs, context + 1, 1 if index == above else 0)
        if index == above:
            return bits
    base = left if left > none else (above if above > none else (made if made > none else 0))
    bits += number_cost(costs, np.int64(at.DELTA), np.int64(14), np.int64(1), abs(index - base))
    if index != base:
        bits += bit_cost(costs, np.int64(at.DELTA + 14), 1 if index < base else 0)
    return bits


@part_kernel
def mask_cost(costs, job, by, bx, where, seen, mask):
    """Bits that a set of references would take."""
    expected, context = expected_mask(job, by, bx, where, seen)
    bits = bit_cost(costs, context, 1 if mask == expected else 0)
    if mask == expected:
        return bits
    count = job.references.shape[0]
    found = 0
    for i in range(count):
        bit = (mask >> i) & 1
        if i < count - 1 or found:
            context = at.MASK + (((count - 1) * 4 + i) * 2 + (1 if found else 0)) * 2 + ((seen >> i) & 1)
            bits += bit_cost(costs, context, bit)
        found |= bit
    return bits
