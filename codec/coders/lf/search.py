"""Encoder search of blocks: least squared error + weight · bits, from the largest block down."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .arithmetic import bit_cost
from .blocks import (
    CROSS_1,
    CROSS_2,
    DONE,
    EXPLICIT,
    INTRA,
    LIMIT,
    LOG,
    LOG_LARGEST,
    LOG_LEAST,
    MIXED,
    SYNTHESIS,
    TIMED,
    Job,
    coded_context,
    guesses,
    kind_cost,
    mark_block,
    new_work,
    note_skipped,
    predict_direction,
    predict_explicit,
    predict_synthesis,
    residual_context,
    skipped_context,
    split_context,
)
from .coefficients import quantise
from .cross import best_cross, cross_cost, keep_first, rebuild, subtract_cross
from .field import EIGHTH
from .intra import DIRECTIONS, MODES, fill_border, predict_intra
from .jit import inner, kernel, lean
from .matching import HUGE, best_explicit, fill_products, new_match
from .motion import predict_in_time
from .motion_search import best_vector
from .samples import LARGEST_SKIPPED, quantise_samples
from .transform import LARGEST, forward

FIRST_DIRECTION = MODES - DIRECTIONS
WORTH_SKIPPING = np.float32(1.2)  # times the least cost so far: beyond it, skipping the transform is not tried
FEW = 12  # disparities that are all searched; of more, every second, and then those beside the best


class Search(NamedTuple):
    """State of the encoder beside the job.

    Parameters
    ----------
    original : ndarray of int16, (3, H, W)
    weight : float32
        Squared error that a bit is worth.
    least : int
        Binary logarithm of the least block.
    intra_tries : int
        Intra modes that are coded on trial.
    planes : int
        Planes that count in the choice of disparity and references.
    hurried : int
        Whether intra directions are found coarse to fine, and sizes and disparities that hardly ever pay left out.
    good : float32
        A block whose cost a sample is less, in units of the weight, is not split, and not tried in other ways.
    surely : float32
        A block that costs less than so many times ``good`` is not tried by intra modes.
    """

    original: Any
    weight: Any
    least: Any
    intra_tries: Any
    planes: Any
    hurried: Any
    good: Any
    surely: Any


class Trial(NamedTuple):
    """Memory of the search, by block size."""

    decoded: Any  # (6, 3, 32, 32) of the best way found; slot 0 for another one
    levels: Any
    trial_decoded: Any  # (3, 32, 32) of the way tried
    trial_levels: Any
    cross: Any  # (6, 2) factors of `cross`
    trial_cross: Any
    skipped: Any  # (6,) whether there is no transform
    trial_skipped: Any  # (1,)
    errors: Any  # (MODES,) of intra prediction


def new_trial() -> Trial:
    """Memory of the search."""
    return Trial(
        decoded=np.zeros((6, 3, LARGEST, LARGEST), np.int16),
        levels=np.zeros((6, 3, LARGEST, LARGEST), np.int16),
        trial_decoded=np.zeros((3, LARGEST, LARGEST), np.int16),
        trial_levels=np.zeros((3, LARGEST, LARGEST), np.int16),
        cross=np.zeros((6, 2), np.int64),
        trial_cross=np.zeros(2, np.int64),
        skipped=np.zeros(6, np.int64),
        trial_skipped=np.zeros(1, np.int64),
        errors=np.zeros(MODES, np.float32),
    )


@inner
def _copy_block(block, to, n):
    for y in range(n):
        for x in range(n):
            to[y, x] = block[y, x]


@lean
def _quantise(costs, work, trial, plane, log, step, weight, levels, skipped):
    """Quantise work.coefficients, which are samples if the transform is skipped."""
    if skipped:
        return quantise_samples(costs, work.coefficients, trial.trial_levels, plane, log, step, weight, levels)
    return quantise(costs, work.coefficients, plane, log, step, weight, levels)


@lean
def _try_plane(costs, work, trial, plane, log, step, weight, kind, first, crossed, error, skipped):
    """Quantise work.block; return bits, whether there are levels, which array has them, and the factor of `cross`.

    ``first`` says whether the first plane has a residual, ``error`` is the squared error without one.
    """
    context = coded_context(plane, log, kind, first, skipped)
    free, full = bit_cost(costs, context, np.int64(0)), bit_cost(costs, context, np.int64(1))
    predictable = plane > 0 and first and crossed
    none = cross_cost(costs, plane, log, np.int64(0)) if predictable else np.float32(0)
    bits, some, cross = free + none, 0, np.int64(0)
    if error <= np.float32(0.2) * step * step:
        return bits, some, cross
    if skipped:
        _copy_block(work.block, work.coefficients, 1 << log)
    else:
        forward(work.block, log, work.half, work.coefficients)
    more, missed = _quantise(costs, work, trial, plane, log, step, weight, work.levels, skipped)
    best = error + weight * bits
    if more > 0 and missed + weight * (more + full + none) < best:
        best, bits, some = missed + weight * (more + full + none), more + full + none, 1
    factor = best_cross(work) if predictable else np.int64(0)
    if factor:
        subtract_cross(work, factor)
        more, missed = _quantise(costs, work, trial, plane, log, step, weight, work.spare, skipped)
        more += (full if more > 0 else free) + cross_cost(costs, plane, log, factor)
        if missed + weight * more < best:
            bits, some, cross = more, 1, factor
    return bits, some, cross


@lean
def try_residual(costs, job, search, work, trial, y0, x0, log, kind, so_far):
    """Code the difference to work.predicted; return bits, error and whether there is a residual.

    ``so_far`` is the least cost of the block: far above it, skipping the transform is not tried.
    """
    n = 1 << log
    trial.trial_skipped[0] = 0
    bits, error, coded = _try_way(costs, job, search, work, trial, y0, x0, log, kind, 0, HUGE)
    cost = error + search.weight * bits
    if not coded or not job.skipping or log > LARGEST_SKIPPED or cost > WORTH_SKIPPING * so_far:
        return bits, error, coded
    trial.cross[1, 0], trial.cross[1, 1] = trial.trial_cross[0], trial.trial_cross[1]
    _copy(
        trial.trial_decoded,
        trial.trial_levels,
        trial.trial_cross,
        trial.decoded[1],
        trial.levels[1],
        trial.cross[1],
        n,
    )
    more, missed, some = _try_way(costs, job, search, work, trial, y0, x0, log, kind, 1, cost)
    if some and missed + search.weight * more < cost:
        trial.trial_skipped[0] = 1
        return more, missed, some
    _copy(
        trial.decoded[1],
        trial.levels[1],
        trial.cross[1],
        trial.trial_decoded,
        trial.trial_levels,
        trial.trial_cross,
        n,
    )
    return bits, error, coded


@lean
def _try_way(costs, job, search, work, trial, y0, x0, log, kind, skipped, limit):
    """As `try_residual`, with a transform or without; give up without a residual beyond a cost."""
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
        more, some, cross = _try_plane(
            costs, work, trial, p, log, step, search.weight, kind, first, job.crossed, least, skipped
        )
        bits += more
        if p:
            trial.trial_cross[p - 1] = cross
        if some:
            levels = work.spare if cross else work.levels
            rows, cols = rebuild(work, levels, log, job.step, 1, cross, skipped)
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
        if error + search.weight * bits > limit:
            return bits, error, 0
    context = residual_context(job, by, bx, log, kind)
    empty = bit_cost(costs, context, np.int64(0))
    if coded:
        bits += bit_cost(costs, context, 1)
        if job.skipping and log <= LARGEST_SKIPPED:
            bits += bit_cost(costs, skipped_context(job, by, bx, log), skipped)
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
    trial.skipped[log] = trial.trial_skipped[0]
    for p in range(3):
        for y in range(n):
            for x in range(n):
                trial.decoded[log, p, y, x] = trial.trial_decoded[p, y, x]
                trial.levels[log, p, y, x] = trial.trial_levels[p, y, x]


@lean
def _add_magnitudes(search, work, y0, x0, n, plane, modes, errors):
    """errors[mode] += sum of magnitudes of a plane's difference from the intra prediction."""
    first, last, step = modes
    predicted = work.predicted[plane]
    for mode in range(first, last, step):
        if mode < 0 or mode >= MODES:
            continue
        predict_intra(work.border, mode, n, work.predicted, plane)
        total = np.float32(0)
        for y in range(n):
            own, row = search.original[plane, y0 + y, x0 : x0 + n], predicted[y]
            for x in range(n):
                total += np.float32(abs(np.int32(own[x]) - row[x]))
        errors[mode] += total


@lean
def _rank_directions(costs, job, search, work, y0, x0, log, errors):
    """errors[:MODES] = sums of magnitudes and weighted bits; a hurried search leaves out unlikely directions."""
    n, by, bx = 1 << log, y0 >> 2, x0 >> 2
    every = 4 if search.hurried and job.references.shape[0] else 1
    for mode in range(MODES):
        errors[mode] = HUGE
    _add_planes(job, search, work, y0, x0, n, (0, FIRST_DIRECTION, 1), errors)
    _add_planes(job, search, work, y0, x0, n, (FIRST_DIRECTION, MODES, every), errors)
    while every > 1:
        every >>= 1
        best = _least(errors)
        if best >= FIRST_DIRECTION:
            for mode in (best - every, best + every):
                if FIRST_DIRECTION <= mode < MODES:
                    _add_planes(job, search, work, y0, x0, n, (mode, mode + 1, 1), errors)
    weight = np.float32(np.sqrt(search.weight))
    for mode in range(MODES):
        if errors[mode] < HUGE:
            errors[mode] += weight * kind_cost(costs, job, by, bx, log, INTRA, 0, 0, mode)


@lean
def _add_planes(job, search, work, y0, x0, n, modes, errors):
    """errors[mode] = sum of magnitudes of the difference from the intra prediction, for modes of a range."""
    first, last, step = modes
    for mode in range(first, last, step):
        errors[max(mode, 0)] = 0
    for p in range(3):
        fill_border(job.views, job.at, p, job.blocks, np.int64(DONE), y0, x0, n, work.border)
        _add_magnitudes(search, work, y0, x0, n, p, modes, errors)


@inner
def _least(errors):
    best = 0
    for mode in range(MODES):
        if errors[mode] < errors[best]:
            best = mode
    return best


@lean
def best_block(costs, job, search, match, work, trial, y0, x0, log):
    """Try the ways to code a block and note the best; return its cost and whether it has a residual."""
    n, by, bx = 1 << log, y0 >> 2, x0 >> 2
    best, kind, index, mask, direction, coded = HUGE, INTRA, 0, 0, 0, 0
    good = search.good * search.weight * np.float32(n * n)
    if job.synthesised:
        side = kind_cost(costs, job, by, bx, log, np.int64(SYNTHESIS), np.int64(0), np.int64(0), np.int64(0))
        predict_synthesis(job, work, y0, x0, n)
        bits, error, some = try_residual(costs, job, search, work, trial, y0, x0, log, np.int64(SYNTHESIS), HUGE)
        best, kind, coded = error + search.weight * (bits + side), SYNTHESIS, some
        index = guesses(job, by, bx, log)[0]
        _keep(trial, log)
    if job.references.shape[0] and best > good:
        k, m = best_explicit(costs, job, match, work, search.original, search.weight, search.planes, y0, x0, log)
        side = kind_cost(costs, job, by, bx, log, np.int64(EXPLICIT), k, m, np.int64(0))
        predict_explicit(job, work, y0, x0, n, k, m)
        bits, error, some = try_residual(costs, job, search, work, trial, y0, x0, log, np.int64(EXPLICIT), best)
        total = error + search.weight * (bits + side)
        if total < best:
            best, kind, index, mask, coded = total, EXPLICIT, k, m, some
            _keep(trial, log)
    if job.references.shape[0] == 0 or best > search.surely * good:
        errors = trial.errors
        _rank_directions(costs, job, search, work, y0, x0, log, errors)
        for _ in range(search.intra_tries):
            mode = _least(errors)
            errors[mode] = HUGE
            side = kind_cost(costs, job, by, bx, log, np.int64(INTRA), np.int64(0), np.int64(0), mode)
            for p in range(3):
                predict_direction(job, work, p, y0, x0, n, mode)
            bits, error, some = try_residual(costs, job, search, work, trial, y0, x0, log, np.int64(INTRA), best)
            total = error + search.weight * (bits + side)
            if total < best:
                best, kind, index, mask, direction, coded = total, INTRA, 0, 0, mode, some
                _keep(trial, log)
    return best, kind, index, mask, direction, coded


@lean
def best_in_time(costs, job, search, work, trial, y0, x0, log, good):
    """Try a block in time, alone and mixed with synthesis; return cost, kind, vector, and if it has a residual."""
    n = 1 << log
    vector = best_vector(costs, job, search, work, y0, x0, log, good)
    best, kind, coded = HUGE, TIMED, 0
    for way in range(TIMED, TIMED + 1 + job.synthesised):
        side = kind_cost(costs, job, y0 >> 2, x0 >> 2, log, way, vector, np.int64(0), np.int64(0))
        predict_in_time(job, work, y0, x0, n, vector, way == MIXED)
        bits, error, some = try_residual(costs, job, search, work, trial, y0, x0, log, way, best)
        total = error + search.weight * (bits + side)
        if total < best:
            best, kind, coded = total, way, some
            _keep(trial, log)
    return best, kind, vector, coded


@lean
def best_of_all(costs, job, search, match, work, trial, y0, x0, log):
    """As `best_block`, with the ways in time if there are earlier instants."""
    if job.past.shape[0] == 0:
        return best_block(costs, job, search, match, work, trial, y0, x0, log)
    n = 1 << log
    good = search.good * search.weight * np.float32(n * n)
    best, kind, vector, coded = best_in_time(costs, job, search, work, trial, y0, x0, log, good)
    if best > good:
        trial.skipped[0] = trial.skipped[log]
        _copy(
            trial.decoded[log],
            trial.levels[log],
            trial.cross[log],
            trial.decoded[0],
            trial.levels[0],
            trial.cross[0],
            n,
        )
        found = best_block(costs, job, search, match, work, trial, y0, x0, log)
        if found[0] < best:
            return found
        trial.skipped[log] = trial.skipped[0]
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


@inner
def _much_smaller(blocks, by, bx, log):
    """Whether all blocks above and to the left have a quarter of the side at most."""
    if by == 0 or bx == 0:
        return False
    for i in range(1 << (log - 2)):
        above = blocks[LOG, by - 1, bx + i] if bx + i < blocks.shape[2] else 0
        left = blocks[LOG, by + i, bx - 1] if by + i < blocks.shape[1] else 0
        if above > log - 2 or left > log - 2:
            return False
    return True


@lean
def search_tree(costs, job, search, match, work, trial, y0, x0, log):
    """Find, mark and decode the blocks of a square; return the cost."""
    height, width = job.levels.shape[1:]
    if y0 >= height or x0 >= width:
        return np.float32(0)
    n, by, bx = 1 << log, y0 >> 2, x0 >> 2
    half = n >> 1
    total, split = np.float32(0), y0 + n > height or x0 + n > width
    if not split and search.hurried and log > 3 and job.past.shape[0] == 0 and _much_smaller(job.blocks, by, bx, log):
        total, split = search.weight * bit_cost(costs, split_context(job, by, bx, log), 1), True
    if split:
        for part in range(4):
            total += search_tree(
                costs, job, search, match, work, trial, y0 + (part >> 1) * half, x0 + (part & 1) * half, log - 1
            )
        return total
    best, kind, index, mask, direction, coded = best_of_all(costs, job, search, match, work, trial, y0, x0, log)
    if log > LOG_LEAST:
        context = split_context(job, by, bx, log)
        best += search.weight * bit_cost(costs, context, np.int64(0))
        if log > search.least and (coded or best > search.good * search.weight * np.float32(n * n)):
            total = search.weight * bit_cost(costs, context, 1)
            for part in range(4):
                total += search_tree(
                    costs,
                    job,
                    search,
                    match,
                    work,
                    trial,
                    y0 + (part >> 1) * half,
                    x0 + (part & 1) * half,
                    log - 1,
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
    note_skipped(job.blocks, by, bx, log, trial.skipped[log] if coded else 0)
    return best


@kernel
def _search_view(costs, job, search, match, work, trial):
    height, width = job.levels.shape[1:]
    for y0 in range(0, height, 1 << LOG_LARGEST):
        for x0 in range(0, width, 1 << LOG_LARGEST):
            if job.references.shape[0]:
                fill_products(job, search.original, y0, x0, match)
            search_tree(costs, job, search, match, work, trial, y0, x0, np.int64(LOG_LARGEST))


def find_blocks(costs: NDArray[np.float32], job: Job, search: Search) -> None:
    """Find, mark and decode all blocks of a view."""
    references = len(job.references)
    every = 2 if job.unit <= EIGHTH // 2 or job.high - job.low > FEW else 1
    match = new_match((job.high - job.low) // every + 1 if references else 1, every, search.hurried)
    _search_view(costs, job, search, match, new_work(), new_trial())
