"""Encoder search of a block's explicit disparity and references: first by table, then between samples as decoded.

`fill_products` compares a square of 32×32 samples with every reference at every disparity. Its table holds inner
products of the references' differences, so that the error of the mean of any set of references is a sum of them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ii_core.base.jit import lean_kernel, part_kernel, stage_kernel
from ii_core.base.references import by_reference

from .kinds import from_where, guesses, kind_cost, mask_cost, seen_mask
from .state import EXPLICIT, MOST_REFERENCES, UNKNOWN
from .transform import LARGEST, sides
from .warp import clamped, led, moved_block

PAIRS = MOST_REFERENCES * (MOST_REFERENCES + 1) // 2  # the lower triangle by rows
CELLS = LARGEST // 4
HUGE = np.float32(1e30)
MOST_BEST, BEST = 6, 2  # disparities of least error by the table that are compared as decoded; in a hurried search
MOST_TRIED = MOST_BEST + 3 + 2
# A hurried search. Its table has every so many-th disparity, and those that the synthesis has up to so many samples
# around the square. Neighbours' disparities are compared as decoded if the table's error there is at most so many
# times the least and so many bits more, the second best of the table if it is at most half of that above the least.
OTHERS, AROUND = 4, 8
WORSE, MORE_BITS = np.float32(1.5), np.float32(4)


@by_reference
class Match(NamedTuple):
    """Memory of the search of disparities.

    Parameters
    ----------
    every : int
        The table holds every so many-th index of the range,
    indices : ndarray of int64, (indices,)
        and of these the first ``count[0]`` of this list.
    count : ndarray of int64, (1,)
    hurried : int
        Whether disparities that hardly ever pay are left out.
    products : ndarray of float32, (CELLS, CELLS, PAIRS, indices)
        Of the first plane, by 4×4 samples.
    total, errors : ndarray of float32, (PAIRS, indices) and (2, indices)
        Sums over a block; errors of the best and of one set of references.
    missed : ndarray of float32, (MOST_REFERENCES, 4 · LARGEST)
        Four rows of differences.
    between : ndarray of float32, (LARGEST + 1,)
        A row of a view between its own.
    sums : ndarray of float32, (PAIRS, LARGEST)
    moved : ndarray of float32, (MOST_REFERENCES, 3 · LARGEST²)
        Differences between a block and its references as decoded, plane by plane and row by row.
    known : ndarray of bool, (span, CELLS, CELLS)
        Of each index of the range and 4×4 samples of the square, whether ``decoded`` holds them.
    decoded : ndarray of float32, (span, CELLS, CELLS, PAIRS)
        Inner products of differences from references as decoded, for blocks of other shapes that try the same index.
    pairs : ndarray of float32, (PAIRS,)
        Their sums over a block.
    sets : ndarray of float64, (2^MOST_REFERENCES,)
        Sums of inner products over the pairs of each set of references.
    tried : ndarray of int64, (MOST_TRIED,)
    """

    every: Any
    indices: Any
    count: Any
    hurried: Any
    products: Any
    total: Any
    errors: Any
    missed: Any
    between: Any
    sums: Any
    moved: Any
    known: Any
    decoded: Any
    pairs: Any
    sets: Any
    tried: Any


def new_match(span: int, every: int, hurried: int = 0) -> Match:
    """Memory for one square after another, for a range of so many indices."""
    indices = (span - 1) // every + 1
    return Match(
        every=every,
        indices=np.zeros(indices, np.int64),
        count=np.zeros(1, np.int64),
        hurried=hurried,
        products=np.zeros((CELLS, CELLS, PAIRS, indices), np.float32),
        total=np.zeros((PAIRS, indices), np.float32),
        errors=np.zeros((2, indices), np.float32),
        missed=np.zeros((MOST_REFERENCES, 4 * LARGEST), np.float32),
        between=np.zeros(LARGEST + 1, np.float32),
        sums=np.zeros((PAIRS, LARGEST), np.float32),
        moved=np.zeros((MOST_REFERENCES, 3 * LARGEST * LARGEST), np.float32),
        known=np.zeros((span, CELLS, CELLS), np.bool_),
        decoded=np.zeros((span, CELLS, CELLS, PAIRS), np.float32),
        pairs=np.zeros(PAIRS, np.float32),
        sets=np.zeros(1 << MOST_REFERENCES),
        tried=np.zeros(MOST_TRIED, np.int64),
    )


@stage_kernel
def _between_rows(upper, lower, at, fy):
    """A sample between two rows, which is as far below the upper one as ``fy`` says."""
    one, other = np.float32(upper[np.uint64(at)]), np.float32(lower[np.uint64(at)])
    return (np.float32(1) - fy) * one + fy * other


@part_kernel
def _missed_rows(plane, original, y0, x0, dy, dx, between, missed):
    """Fill missed with four rows of samples: the plane moved, between samples bilinearly, less the original.

    ``between`` has room for one more than a row.
    """
    (height, width), row = plane.shape, between.size - 1
    iy, start = dy >> 8, x0 + (dx >> 8)
    fx, fy = np.float32((dx & 255) / 256), np.float32((dy & 255) / 256)
    # The row between two begins and ends with so many repetitions of the border's samples.
    before, within = min(max(-start, 0), between.size), max(min(width - start, between.size), 0)
    for i in range(4):
        y, own = y0 + i + iy, original[np.uint64(y0 + i)]
        upper, lower = plane[np.uint64(clamped(y, height))], plane[np.uint64(clamped(y + 1, height))]
        for x in range(before, within):
            between[np.uint64(x)] = _between_rows(upper, lower, start + x, fy)
        for x in range(before):
            between[x] = _between_rows(upper, lower, 0, fy)
        for x in range(within, between.size):
            between[np.uint64(x)] = _between_rows(upper, lower, width - 1, fy)
        for x in range(min(row, width - x0)):
            moved = (np.float32(1) - fx) * between[x] + fx * between[x + 1]
            missed[np.uint64(row * i + x)] = moved - np.float32(own[np.uint64(x0 + x)])


@stage_kernel
def _add_rows(one, other, at, columns, sums):
    """Add inner products of each column's samples in four rows from a place on."""
    for x in range(columns):
        a, b = np.uint64(at + x), np.uint64(at + columns + x)
        c, d = np.uint64(at + 2 * columns + x), np.uint64(at + 3 * columns + x)
        total = one[a] * other[a] + one[b] * other[b]
        sums[np.uint64(x)] += total + one[c] * other[c] + one[d] * other[d]


@stage_kernel
def _of_cell(sums, cell):
    """Sum of four columns."""
    a, b, c, d = np.uint64(4 * cell), np.uint64(4 * cell + 1), np.uint64(4 * cell + 2), np.uint64(4 * cell + 3)
    return (sums[a] + sums[b]) + (sums[c] + sums[d])


@part_kernel
def _list_indices(job, match, y0, x0):
    """match.indices = those of the table: the whole range, or of a hurried search of a synthesised view a part of it.

    The part is every fourth one, and those beside the disparities of the synthesis in the square and around it.
    """
    height, width = job.disparity.shape
    indices, last = match.indices, np.int64(UNKNOWN)
    part = match.hurried and job.synthesised
    for k in range(indices.size):
        indices[k] = 1 if not part or k % OTHERS == 0 else 0
    if part:
        for y in range(max(y0 - AROUND, 0), min(y0 + LARGEST + AROUND, height)):
            row = job.disparity[y]
            for x in range(max(x0 - AROUND, 0), min(x0 + LARGEST + AROUND, width)):
                if row[x] != last:
                    last = np.int64(row[x])
                    middle = ((2 * last + job.unit) // (2 * job.unit) - job.low) // match.every
                    for k in range(max(middle - 1, 0), min(middle + 3, indices.size)):
                        indices[k] = 1
    count = 0
    for k in range(indices.size):
        if indices[k]:
            indices[count] = job.low + k * match.every
            count += 1
    match.count[0] = count


@lean_kernel
def fill_products(job, original, y0, x0, match):
    """match.products = inner products of the references' differences from the square at (y0, x0)."""
    _list_indices(job, match, y0, x0)
    match.known[:] = False
    height, width = original.shape[1:]
    rows, cols = min(CELLS, (height - y0) >> 2), min(CELLS, (width - x0) >> 2)
    count = job.references.shape[0]
    sums, products = match.sums, match.products
    for k in range(match.count[0]):
        d = match.indices[k] * job.unit
        for by in range(rows):
            at = 0
            for r in range(count):
                dy, dx = led(job.references, r, d, y0, x0, (height, width))
                own, plane = match.missed[r], job.views[job.references[r, 0], 0]
                _missed_rows(plane, original[0], y0 + 4 * by, x0, dy, dx, match.between, own)
                for s in range(r + 1):
                    sums[at] = 0
                    _add_rows(own, match.missed[s], 0, LARGEST, sums[at])
                    at += 1
            for bx in range(cols):
                for at in range(count * (count + 1) >> 1):
                    products[by, bx, at, k] = _of_cell(sums[at], bx)


@lean_kernel
def fill_errors(job, original, between, missed, sums, errors):
    """errors[k, y, x] = squared differences of 4×4 samples from all references, of the indices from job.low on.

    ``between`` (n + 1,), ``missed`` (4 n,) and ``sums`` (n,) are memory for n columns at once.
    """
    height, width = original.shape[1:]
    for x0 in range(0, width, sums.size):
        cells = min(sums.size, width - x0) >> 2
        for y0 in range(0, height, 4):
            for k in range(errors.shape[0]):
                into = errors[k, y0 >> 2, x0 >> 2 :]
                for r in range(job.references.shape[0]):
                    dy, dx = led(job.references, r, (job.low + k) * job.unit, y0, x0, (height, width))
                    plane = job.views[job.references[r, 0], 0]
                    _missed_rows(plane, original[0], y0, x0, dy, dx, between, missed)
                    sums[:] = 0
                    _add_rows(missed, missed, 0, sums.size, sums)
                    for cell in range(cells):
                        into[np.uint64(cell)] += _of_cell(sums, cell)


@part_kernel
def _add_cells(match, by, bx, rows, cols, pairs):
    """match.total = products summed over a block."""
    for at in range(pairs):
        into, indices = match.total[at], match.count[0]
        for k in range(indices):
            into[k] = 0
        for i in range(by, by + rows):
            for j in range(bx, bx + cols):
                cell = match.products[i, j, at]
                for k in range(indices):
                    into[k] += cell[k]


@part_kernel
def _set_errors(match, count):
    """match.errors[0] = of each index the error of the best set of references."""
    least, error = match.errors[0], match.errors[1]
    indices = match.count[0]
    for k in range(indices):
        least[k] = HUGE
    for mask in range(1, 1 << count):
        for k in range(indices):
            error[k] = 0
        members, at = 0, 0
        for r in range(count):
            members += (mask >> r) & 1
            for s in range(r + 1):
                if (mask >> r) & 1 and (mask >> s) & 1:
                    pair, factor = match.total[at], np.float32(1 if r == s else 2)
                    for k in range(indices):
                        error[k] += factor * pair[k]
                at += 1
        share = np.float32(1) / np.float32(members * members)
        for k in range(indices):
            least[k] = min(least[k], share * error[k])


@stage_kernel
def _add_index(job, tried, number, index):
    if index < job.low or index > job.high:
        return number
    for i in range(number):
        if tried[i] == index:
            return number
    tried[number] = index
    return number + 1


@part_kernel
def _likely_indices(job, match, weight, y0, x0, shape):
    """Fill match.tried with indices worth comparing as decoded; return their number."""
    (h, w), by, bx = sides(shape), y0 >> 2, x0 >> 2
    count, indices, errors = job.references.shape[0], match.count[0], match.errors[0]
    _add_cells(match, by & (CELLS - 1), bx & (CELLS - 1), h >> 2, w >> 2, count * (count + 1) >> 1)
    _set_errors(match, count)
    least, number = HUGE, 0
    for k in range(indices):
        least = min(least, errors[k])
    most = WORSE * least + MORE_BITS * weight if match.hurried else HUGE
    for guess in guesses(job, by, bx, shape):
        if _error_near(match, guess) <= most:
            number = _add_index(job, match.tried, number, guess)
    for _ in range(BEST if match.hurried else MOST_BEST):
        best = 0
        for k in range(indices):
            if errors[k] < errors[best]:
                best = k
        if match.hurried and errors[best] > np.float32(0.5) * (least + most):
            break
        number = _add_index(job, match.tried, number, match.indices[best])
        for k in range(max(best - 1, 0), min(best + 2, indices)):
            errors[k] = HUGE
    return number


@stage_kernel
def _error_near(match, index):
    """The least error by the table beside an index; zero if the table has none there."""
    error = HUGE
    for k in range(match.count[0]):
        if abs(match.indices[k] - index) < match.every:
            error = min(error, match.errors[0, k])
    return error if error < HUGE else np.float32(0)


@part_kernel
def _compare(job, match, work, original, y0, x0, h, w, index, planes):
    """match.moved = the block's differences from each reference as decoded."""
    d = index * job.unit
    for r in range(job.references.shape[0]):
        for p in range(planes):
            into = work.predicted[p]
            for y in range(h):
                for x in range(w):
                    into[y, x] = 0
            dy, dx = led(job.references, r, d, y0, x0, job.views.shape[2:])
            moved_block(job.views, job.references[r, 0], p, y0, x0, h, w, dy, dx, work.rows, work.predicted)
            missed = match.moved[r]
            for y in range(h):
                own, moved, at = original[p, np.uint64(y0 + y)], into[y], (p * h + y) * w
                for x in range(w):
                    difference = np.int32(own[np.uint64(x0 + x)]) - (np.int32(moved[x] + 2048) >> 12)
                    missed[np.uint64(at + x)] = np.float32(difference)


@part_kernel
def _fill_decoded(job, match, work, original, planes, y0, x0, shape, index):
    """match.decoded = inner products of the block's differences from its references, of each of its 4×4."""
    (h, w), by, bx = sides(shape), (y0 >> 2) & (CELLS - 1), (x0 >> 2) & (CELLS - 1)
    _compare(job, match, work, original, y0, x0, h, w, index, planes)
    decoded, sums = match.decoded[index - job.low], match.sums[0]
    for i in range(h >> 2):
        at = 0
        for r in range(job.references.shape[0]):
            for s in range(r + 1):
                sums[:w] = 0
                for p in range(planes):
                    _add_rows(match.moved[r], match.moved[s], (p * h + 4 * i) * w, w, sums)
                for j in range(w >> 2):
                    decoded[by + i, bx + j, at] = _of_cell(sums, j)
                at += 1
        for j in range(w >> 2):
            match.known[index - job.low, by + i, bx + j] = True


@part_kernel
def _decoded_products(job, match, work, original, planes, y0, x0, shape, index):
    """match.pairs = inner products of a block's differences from its references as decoded."""
    (h, w), by, bx = sides(shape), (y0 >> 2) & (CELLS - 1), (x0 >> 2) & (CELLS - 1)
    known, missing = match.known[index - job.low], False
    for i in range(by, by + (h >> 2)):
        for j in range(bx, bx + (w >> 2)):
            missing |= not known[i, j]
    if missing:
        _fill_decoded(job, match, work, original, planes, y0, x0, shape, index)
    pairs, count = match.pairs, job.references.shape[0]
    pairs[:] = 0
    for i in range(by, by + (h >> 2)):
        for j in range(bx, bx + (w >> 2)):
            cell = match.decoded[index - job.low, i, j]
            for at in range(count * (count + 1) >> 1):
                pairs[at] += cell[at]


@part_kernel
def _best_set(costs, job, match, work, original, weight, planes, y0, x0, shape, index):
    """Squared error + weight · bits of an index by the best set of references, and that set."""
    by, bx = y0 >> 2, x0 >> 2
    count, pairs, sets = job.references.shape[0], match.pairs, match.sets
    where, seen = from_where(job, by, bx, shape, index), seen_mask(job, by, bx, shape, index)
    _decoded_products(job, match, work, original, planes, y0, x0, shape, index)
    side = weight * kind_cost(costs, job, by, bx, shape, np.int64(EXPLICIT), index, np.int64(0), np.int64(0))
    best, best_mask = HUGE, 1
    sets[0] = 0
    for r in range(count):
        # Sets of the references up to this one are those without it and its pairs.
        first = r * (r + 1) >> 1
        for rest in range(1 << r):
            members, error = 1, sets[rest]
            for s in range(r):
                if (rest >> s) & 1:
                    members += 1
                    error += 2 * pairs[first + s]
            error += pairs[first + r]
            mask = (1 << r) + rest
            sets[mask] = error
            cost = error / np.float32(members * members) + side
            if cost < best and count > 1:
                cost += weight * mask_cost(costs, job, by, bx, where, seen, mask)
            if cost < best:
                best, best_mask = cost, mask
    return best, best_mask


@part_kernel
def best_explicit(costs, job, match, work, original, weight, planes, y0, x0, shape):
    """Index and set of references of the least squared error + weight · bits, before any residual."""
    tried = match.tried
    number = _likely_indices(job, match, weight, y0, x0, shape)
    best, best_index, best_mask = HUGE, job.low, 1
    t, between = 0, match.every == 1
    while t < number:
        cost, mask = _best_set(costs, job, match, work, original, weight, planes, y0, x0, shape, tried[t])
        if cost < best:
            best, best_index, best_mask = cost, tried[t], mask
        t += 1
        if t == number and not between:
            # Then the two indices beside the best that the table leaves out.
            between = True
            number = _add_index(job, tried, number, best_index - 1)
            number = _add_index(job, tried, number, best_index + 1)
    return best_index, best_mask
