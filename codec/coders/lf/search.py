"""Encoder search of blocks: least squared error + weight · bits, from the largest block down."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .arithmetic import bit_cost
from .blocks import (
    CROSS_1,
    CROSS_2,
    EXPLICIT,
    INTRA,
    LIMIT,
    LOG_LARGEST,
    LOG_LEAST,
    MIXED,
    SYNTHESIS,
    TIMED,
    Job,
    coded_context,
    from_where,
    guesses,
    kind_cost,
    mark_block,
    mask_cost,
    new_work,
    predict_direction,
    predict_explicit,
    predict_synthesis,
    residual_context,
    seen_mask,
    split_context,
)
from .coefficients import quantise
from .cross import best_cross, cross_cost, keep_first, rebuild, subtract_cross
from .intra import MODES
from .jit import inner, kernel, lean
from .motion import predict_in_time
from .motion_search import best_vector
from .transform import LARGEST, forward
from .warp import clamped, moved_block

HUGE = np.float32(1e30)
ZERO = 0
MOST_GUESSES = 16


class Search(NamedTuple):
    """State of the encoder beside the job.

    Parameters
    ----------
    original : ndarray of int16, (3, H, W)
    volume : ndarray of float32, (indices, R, H / 4, W / 4)
        Squared error of the first plane for each reference and every ``every``-th index.
    every : int
    weight : float32
        Squared error that a bit is worth.
    least : int
        Binary logarithm of the least block.
    intra_tries : int
        Intra modes that are coded on trial.
    planes : int
        Planes that count in the choice of disparity and references.
    good : float32
        A block whose cost a sample is less, in units of the weight, is not split, and not tried in other ways.
    """

    original: Any
    volume: Any
    every: Any
    weight: Any
    least: Any
    intra_tries: Any
    planes: Any
    good: Any


class Trial(NamedTuple):
    """Memory of the search, by block size."""

    decoded: Any  # (6, 3, 32, 32) of the best way found; slot 0 for another one
    levels: Any
    trial_decoded: Any  # (3, 32, 32) of the way tried
    trial_levels: Any
    cross: Any  # (6, 2) factors of `cross`
    trial_cross: Any
    moved: Any  # (4, 3, 32, 32)


def new_trial() -> Trial:
    """Memory of the search."""
    return Trial(
        decoded=np.zeros((6, 3, LARGEST, LARGEST), np.int16),
        levels=np.zeros((6, 3, LARGEST, LARGEST), np.int16),
        trial_decoded=np.zeros((3, LARGEST, LARGEST), np.int16),
        trial_levels=np.zeros((3, LARGEST, LARGEST), np.int16),
        cross=np.zeros((6, 2), np.int64),
        trial_cross=np.zeros(2, np.int64),
        moved=np.zeros((4, 3, LARGEST, LARGEST), np.int32),
    )


@lean
def fill_volume(job, original, volume, every):
    """Squared error of each 4×4 of the first plane, for indices and references, between samples bilinearly."""
    height, width = original.shape[1:]
    views = job.views
    for k in range(volume.shape[0]):
        d = (job.low + k * every) * job.unit
        for r in range(volume.shape[1]):
            view = job.references[r, 0]
            dx, dy = d * job.references[r, 1], d * job.references[r, 2]
            ix, iy = dx >> 8, dy >> 8
            fx, fy = np.float32((dx & 255) / 256), np.float32((dy & 255) / 256)
            a, b = (np.float32(1) - fx) * (np.float32(1) - fy), fx * (np.float32(1) - fy)
            c, e = (np.float32(1) - fx) * fy, fx * fy
            from_, to = min(max(0, -ix), width), max(min(width, width - 1 - ix), 0)
            for by in range(height >> 2):
                for bx in range(width >> 2):
                    volume[k, r, by, bx] = 0
                for y in range(4 * by, 4 * by + 4):
                    y0, y1 = clamped(y + iy, height), clamped(y + iy + 1, height)
                    for bx in range(width >> 2):
                        total = np.float32(0)
                        if 4 * bx >= from_ and 4 * bx + 4 <= to:
                            for x in range(4 * bx, 4 * bx + 4):
                                value = a * views[view, 0, y0, x + ix] + b * views[view, 0, y0, x + ix + 1]
                                value += c * views[view, 0, y1, x + ix] + e * views[view, 0, y1, x + ix + 1]
                                value -= original[0, y, x]
                                total += value * value
                        else:
                            for x in range(4 * bx, 4 * bx + 4):
                                x0, x1 = clamped(x + ix, width), clamped(x + ix + 1, width)
                                value = a * views[view, 0, y0, x0] + b * views[view, 0, y0, x1]
                                value += c * views[view, 0, y1, x0] + e * views[view, 0, y1, x1]
                                value -= original[0, y, x]
                                total += value * value
                        volume[k, r, by, bx] += total


@lean
def _try_plane(contexts, work, plane, log, step, weight, kind, first, crossed, error):
    """Quantise work.block; return bits, whether there are levels, which array has them, and the factor of `cross`.

    ``first`` says whether the first plane has a residual, ``error`` is the squared error without one.
    """
    context = coded_context(plane, log, kind, first)
    free, full = bit_cost(contexts, context, np.int64(0)), bit_cost(contexts, context, np.int64(1))
    predictable = plane > 0 and first and crossed
    none = cross_cost(contexts, plane, log, np.int64(0)) if predictable else np.float32(0)
    bits, some, cross = free + none, 0, np.int64(0)
    if error <= np.float32(0.2) * step * step:
        return bits, some, cross
    forward(work.block, log, work.half, work.coefficients)
    more, missed = quantise(contexts, work.coefficients, plane, log, step, weight, work.levels)
    best = error + weight * bits
    if more > 0 and missed + weight * (more + full + none) < best:
        best, bits, some = missed + weight * (more + full + none), more + full + none, 1
    factor = best_cross(work) if predictable else np.int64(0)
    if factor:
        subtract_cross(work, factor)
        more, missed = quantise(contexts, work.coefficients, plane, log, step, weight, work.spare)
        more += (full if more > 0 else free) + cross_cost(contexts, plane, log, factor)
        if missed + weight * more < best:
            bits, some, cross = more, 1, factor
    return bits, some, cross


@lean
def try_residual(contexts, job, search, work, trial, y0, x0, log, kind):
    """Code the difference to work.predicted; return bits, error and whether there is a residual."""
    n, by, bx = 1 << log, y0 >> 2, x0 >> 2
    step = np.float32(job.step / 16)
    bits, error, without = np.float32(0), np.float32(0), np.float32(0)
    first, coded = 0, 0
    for p in range(3):
        least = np.float32(0)
        for y in range(n):
            for x in range(n):
                difference = search.original[p, y0 + y, x0 + x] - work.predicted[p, y, x]
                work.block[y, x] = difference
                least += np.float32(difference * difference)
        without += least
        more, some, cross = _try_plane(contexts, work, p, log, step, search.weight, kind, first, job.crossed, least)
        bits += more
        if p:
            trial.trial_cross[p - 1] = cross
        if some:
            levels = work.spare if cross else work.levels
            rows, cols = rebuild(work, levels, log, job.step, 1, cross)
            if p == 0:
                keep_first(work, rows, cols)
                first = 1
            coded = 1
            for y in range(n):
                for x in range(n):
                    value = min(max(np.int32(work.predicted[p, y, x] + work.block[y, x]), -LIMIT), LIMIT)
                    trial.trial_decoded[p, y, x] = value
                    trial.trial_levels[p, y, x] = levels[y, x]
                    difference = search.original[p, y0 + y, x0 + x] - value
                    error += np.float32(difference * difference)
        else:
            _leave(trial, work, p, n)
            error += least
    context = residual_context(job, by, bx, log, kind)
    empty = bit_cost(contexts, context, np.int64(0))
    if coded:
        bits += bit_cost(contexts, context, 1)
        if error + search.weight * bits < without + search.weight * empty:
            return bits, error, 1
        for p in range(3):
            _leave(trial, work, p, n)
    return empty, without, 0


@inner
def _leave(trial, work, p, n):
    """A plane without a residual."""
    for y in range(n):
        for x in range(n):
            trial.trial_decoded[p, y, x] = work.predicted[p, y, x]
            trial.trial_levels[p, y, x] = 0


@inner
def _keep(trial, log):
    n = 1 << log
    trial.cross[log, 0], trial.cross[log, 1] = trial.trial_cross[0], trial.trial_cross[1]
    for p in range(3):
        for y in range(n):
            for x in range(n):
                trial.decoded[log, p, y, x] = trial.trial_decoded[p, y, x]
                trial.levels[log, p, y, x] = trial.trial_levels[p, y, x]


@lean
def _best_disparities(job, search, y0, x0, log, found):
    """Fill ``found`` with indices worth trying; return their number."""
    by, bx, size = y0 >> 2, x0 >> 2, 1 << (log - 2)
    count = job.references.shape[0]
    made, left, above = guesses(job, by, bx, log)
    number = 0
    for guess in (made, left, above):
        if guess >= job.low:
            found[number] = guess
            number += 1
    b0 = b1 = b2 = b3 = best_all = best_two = HUGE
    k0 = k1 = k2 = k3 = k_all = k_two = job.low - 1
    for k in range(search.volume.shape[0]):
        total, least, second = np.float32(0), HUGE, HUGE
        for r in range(count):
            error = np.float32(0)
            for i in range(by, by + size):
                for j in range(bx, bx + size):
                    error += search.volume[k, r, i, j]
            total += error
            if error < least:
                least, second = error, least
            elif error < second:
                second = error
            if r == 0 and error < b0:
                b0, k0 = error, job.low + k * search.every
            elif r == 1 and error < b1:
                b1, k1 = error, job.low + k * search.every
            elif r == 2 and error < b2:
                b2, k2 = error, job.low + k * search.every
            elif r == 3 and error < b3:
                b3, k3 = error, job.low + k * search.every
        if total < best_all:
            best_all, k_all = total, job.low + k * search.every
        if least + second < best_two:
            best_two, k_two = least + second, job.low + k * search.every
    for k in (k_all, k_two, k0, k1, k2, k3):
        seen = k < job.low
        for i in range(number):
            if found[i] == k:
                seen = True
        if not seen:
            found[number] = k
            number += 1
    return number


@lean
def _best_explicit(contexts, job, search, work, trial, y0, x0, log, tried):
    """Index and mask of the least squared error + weight · bits, before any residual."""
    n, by, bx = 1 << log, y0 >> 2, x0 >> 2
    count = job.references.shape[0]
    moved = trial.moved
    number = _best_disparities(job, search, y0, x0, log, tried)
    best, best_index, best_mask = HUGE, job.low, 1
    t, between = 0, False
    while t < number:
        index = tried[t]
        d = index * job.unit
        where = from_where(job, by, bx, log, index)
        for r in range(count):
            for p in range(search.planes):
                for y in range(n):
                    for x in range(n):
                        work.predicted[p, y, x] = 0
                moved_block(
                    job.views,
                    job.references[r, 0],
                    p,
                    y0,
                    x0,
                    n,
                    d * job.references[r, 2],
                    d * job.references[r, 1],
                    work.rows,
                    work.predicted,
                )
                for y in range(n):
                    for x in range(n):
                        moved[r, p, y, x] = search.original[p, y0 + y, x0 + x] - (
                            np.int32(work.predicted[p, y, x] + 2048) >> 12
                        )
        index_bits = kind_cost(contexts, job, by, bx, log, np.int64(EXPLICIT), index, np.int64(0), np.int64(0))
        seen = seen_mask(job, by, bx, log, index)
        products = _products(moved, count, n, search.planes)
        for mask in range(1, 1 << count):
            members = 0
            error = np.float32(0)
            at = 0
            for r in range(count):
                for s in range(r + 1):
                    if (mask >> r) & 1 and (mask >> s) & 1:
                        error += products[at] if r == s else 2 * products[at]
                    at += 1
                members += (mask >> r) & 1
            total = error / np.float32(members * members) + search.weight * index_bits
            if total < best and count > 1:
                total += search.weight * mask_cost(contexts, job, by, bx, where, seen, mask)
            if total < best:
                best, best_index, best_mask = total, index, mask
        t += 1
        if t == number and not between and search.every > 1:
            # Then the two indices beside the best that the volume leaves out.
            between = True
            for index in (best_index - 1, best_index + 1):
                fresh = job.low <= index <= job.high
                for i in range(number):
                    if tried[i] == index:
                        fresh = False
                if fresh:
                    tried[number] = index
                    number += 1
    return best_index, best_mask


@inner
def _dot(moved, r, s, n, planes):
    total = np.float32(0)
    for p in range(planes):
        for y in range(n):
            for x in range(n):
                total += np.float32(moved[r, p, y, x]) * np.float32(moved[s, p, y, x])
    return total


@lean
def _products(moved, count, n, planes):
    """Inner products of the references' differences, the lower triangle by rows."""
    p00 = _dot(moved, 0, 0, n, planes)
    p10 = p11 = p20 = p21 = p22 = p30 = p31 = p32 = p33 = np.float32(0)
    if count > 1:
        p10, p11 = _dot(moved, 1, 0, n, planes), _dot(moved, 1, 1, n, planes)
    if count > 2:
        p20, p21, p22 = _dot(moved, 2, 0, n, planes), _dot(moved, 2, 1, n, planes), _dot(moved, 2, 2, n, planes)
    if count > 3:
        p30, p31 = _dot(moved, 3, 0, n, planes), _dot(moved, 3, 1, n, planes)
        p32, p33 = _dot(moved, 3, 2, n, planes), _dot(moved, 3, 3, n, planes)
    return p00, p10, p11, p20, p21, p22, p30, p31, p32, p33


@lean
def _best_direction(contexts, job, search, work, y0, x0, log, rank, errors):
    """The intra mode with the rank-th least sum of magnitudes; ``errors`` is filled at rank 0."""
    n, by, bx = 1 << log, y0 >> 2, x0 >> 2
    if rank == 0:
        for mode in range(MODES):
            total = np.float32(0)
            for p in range(3):
                predict_direction(job, work, p, y0, x0, n, mode)
                for y in range(n):
                    for x in range(n):
                        total += np.float32(abs(search.original[p, y0 + y, x0 + x] - work.predicted[p, y, x]))
            errors[mode] = total + np.float32(np.sqrt(search.weight)) * kind_cost(
                contexts, job, by, bx, log, INTRA, 0, 0, mode
            )
    best = 0
    for mode in range(MODES):
        if errors[mode] < errors[best]:
            best = mode
    errors[best] = HUGE
    return best


@kernel
def best_block(contexts, job, search, work, trial, y0, x0, log):
    """Try the ways to code a block and note the best; return its cost and whether it has a residual."""
    n, by, bx = 1 << log, y0 >> 2, x0 >> 2
    best, kind, index, mask, direction, coded = HUGE, INTRA, 0, 0, 0, 0
    good = search.good * search.weight * np.float32(n * n)
    if job.synthesised:
        side = kind_cost(contexts, job, by, bx, log, np.int64(SYNTHESIS), np.int64(0), np.int64(0), np.int64(0))
        predict_synthesis(job, work, y0, x0, n)
        bits, error, some = try_residual(contexts, job, search, work, trial, y0, x0, log, np.int64(SYNTHESIS))
        best, kind, coded = error + search.weight * (bits + side), SYNTHESIS, some
        index = guesses(job, by, bx, log)[0]
        _keep(trial, log)
    if job.references.shape[0] and best > good:
        tried = np.zeros(MOST_GUESSES, np.int64)
        k, m = _best_explicit(contexts, job, search, work, trial, y0, x0, log, tried)
        side = kind_cost(contexts, job, by, bx, log, np.int64(EXPLICIT), k, m, np.int64(0))
        predict_explicit(job, work, y0, x0, n, k, m)
        bits, error, some = try_residual(contexts, job, search, work, trial, y0, x0, log, np.int64(EXPLICIT))
        total = error + search.weight * (bits + side)
        if total < best:
            best, kind, index, mask, coded = total, EXPLICIT, k, m, some
            _keep(trial, log)
    if job.references.shape[0] == 0 or best > 2 * good:
        errors = np.zeros(MODES, np.float32)
        for rank in range(search.intra_tries):
            mode = _best_direction(contexts, job, search, work, y0, x0, log, rank, errors)
            side = kind_cost(contexts, job, by, bx, log, np.int64(INTRA), np.int64(0), np.int64(0), mode)
            for p in range(3):
                predict_direction(job, work, p, y0, x0, n, mode)
            bits, error, some = try_residual(contexts, job, search, work, trial, y0, x0, log, np.int64(INTRA))
            total = error + search.weight * (bits + side)
            if total < best:
                best, kind, index, mask, direction, coded = total, INTRA, 0, 0, mode, some
                _keep(trial, log)
    return best, kind, index, mask, direction, coded


@lean
def best_in_time(contexts, job, search, work, trial, y0, x0, log, good):
    """Try a block in time, alone and mixed with synthesis; return cost, kind, vector, and if it has a residual."""
    n = 1 << log
    vector = best_vector(contexts, job, search, work, y0, x0, log, good)
    best, kind, coded = HUGE, TIMED, 0
    for way in range(TIMED, TIMED + 1 + job.synthesised):
        side = kind_cost(contexts, job, y0 >> 2, x0 >> 2, log, way, vector, np.int64(0), np.int64(0))
        predict_in_time(job, work, y0, x0, n, vector, way == MIXED)
        bits, error, some = try_residual(contexts, job, search, work, trial, y0, x0, log, way)
        total = error + search.weight * (bits + side)
        if total < best:
            best, kind, coded = total, way, some
            _keep(trial, log)
    return best, kind, vector, coded


@kernel
def best_of_all(contexts, job, search, work, trial, y0, x0, log):
    """As `best_block`, with the ways in time if there are earlier instants."""
    if job.past.shape[0] == 0:
        return best_block(contexts, job, search, work, trial, y0, x0, log)
    n = 1 << log
    good = search.good * search.weight * np.float32(n * n)
    best, kind, vector, coded = best_in_time(contexts, job, search, work, trial, y0, x0, log, good)
    if best > good:
        _copy(
            trial.decoded[log],
            trial.levels[log],
            trial.cross[log],
            trial.decoded[0],
            trial.levels[0],
            trial.cross[0],
            n,
        )
        found = best_block(contexts, job, search, work, trial, y0, x0, log)
        if found[0] < best:
            return found
        _copy(
            trial.decoded[0],
            trial.levels[0],
            trial.cross[0],
            trial.decoded[log],
            trial.levels[log],
            trial.cross[log],
            n,
        )
    return best, kind, vector, 0, 0, coded


@inner
def _copy(decoded, levels, cross, to_decoded, to_levels, to_cross, n):
    to_cross[0], to_cross[1] = cross[0], cross[1]
    for p in range(3):
        for y in range(n):
            for x in range(n):
                to_decoded[p, y, x] = decoded[p, y, x]
                to_levels[p, y, x] = levels[p, y, x]


@kernel
def search_tree(contexts, job, search, work, trial, y0, x0, log):
    """Find, mark and decode the blocks of a square; return the cost."""
    height, width = job.levels.shape[1:]
    if y0 >= height or x0 >= width:
        return np.float32(0)
    n, by, bx = 1 << log, y0 >> 2, x0 >> 2
    half = n >> 1
    if y0 + n > height or x0 + n > width:
        total = np.float32(0)
        for part in range(4):
            total += search_tree(
                contexts, job, search, work, trial, y0 + (part >> 1) * half, x0 + (part & 1) * half, log - 1
            )
        return total
    best, kind, index, mask, direction, coded = best_of_all(contexts, job, search, work, trial, y0, x0, log)
    if log > LOG_LEAST:
        context = split_context(job, by, bx, log)
        best += search.weight * bit_cost(contexts, context, np.int64(0))
        if log > search.least and (coded or best > search.good * search.weight * np.float32(n * n)):
            total = search.weight * bit_cost(contexts, context, 1)
            for part in range(4):
                total += search_tree(
                    contexts, job, search, work, trial, y0 + (part >> 1) * half, x0 + (part & 1) * half, log - 1
                )
                if total > best:
                    break
            if total < best:
                return total
    for p in range(3):
        for y in range(n):
            for x in range(n):
                job.views[job.at, p, y0 + y, x0 + x] = trial.decoded[log, p, y, x]
                job.levels[p, y0 + y, x0 + x] = trial.levels[log, p, y, x]
    mark_block(job, by, bx, log, kind, index, mask, direction, coded)
    job.blocks[CROSS_1, by, bx], job.blocks[CROSS_2, by, bx] = trial.cross[log, 0], trial.cross[log, 1]
    return best


def find_blocks(contexts: NDArray[np.int32], job: Job, search: Search) -> None:
    """Find, mark and decode all blocks of a view; contexts stay as they are."""
    work, trial = new_work(), new_trial()
    height, width = job.levels.shape[1:]
    size = 1 << LOG_LARGEST
    for y0 in range(0, height, size):
        for x0 in range(0, width, size):
            search_tree(contexts, job, search, work, trial, y0, x0, LOG_LARGEST)
