"""Encoder search of blocks: least squared error + weight · bits, from the largest block down."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ii_core.base.jit import array_kernel, part_kernel, stage_kernel

from .arithmetic import bit_cost
from .blocks import (
    CROSS_1,
    CROSS_2,
    EXPLICIT,
    INTRA,
    LOG,
    LOG_LARGEST,
    LOG_LEAST,
    MIXED,
    SYNTHESIS,
    TIMED,
    Job,
    guesses,
    kind_cost,
    mark_block,
    new_work,
    note_skipped,
    predict_direction,
    predict_explicit,
    predict_synthesis,
    split_context,
)
from .field import EIGHTH
from .intra_search import least_error, rank_directions
from .matching import HUGE, best_explicit, fill_products, new_match
from .motion import predict_in_time
from .motion_search import best_vector
from .residual_search import copy_trial, keep, new_trial, try_residual, try_transform

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


@part_kernel
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
        keep(trial, log)
    if job.references.shape[0] and best > good:
        k, m = best_explicit(costs, job, match, work, search.original, search.weight, search.planes, y0, x0, log)
        side = kind_cost(costs, job, by, bx, log, np.int64(EXPLICIT), k, m, np.int64(0))
        predict_explicit(job, work, y0, x0, n, k, m)
        bits, error, some = try_residual(costs, job, search, work, trial, y0, x0, log, np.int64(EXPLICIT), best)
        total = error + search.weight * (bits + side)
        if total < best:
            best, kind, index, mask, coded = total, EXPLICIT, k, m, some
            keep(trial, log)
    if job.references.shape[0] == 0 or best > search.surely * good:
        errors = trial.errors
        rank_directions(costs, job, search, work, y0, x0, log, errors)
        for _ in range(search.intra_tries):
            mode = least_error(errors)
            errors[mode] = HUGE
            side = kind_cost(costs, job, by, bx, log, np.int64(INTRA), np.int64(0), np.int64(0), mode)
            for p in range(3):
                predict_direction(job, work, p, y0, x0, n, mode)
            bits, error, some = try_residual(costs, job, search, work, trial, y0, x0, log, np.int64(INTRA), best)
            total = error + search.weight * (bits + side)
            if total < best:
                best, kind, index, mask, direction, coded = total, INTRA, 0, 0, mode, some
                keep(trial, log)
    if job.directed and kind == INTRA and coded:
        best = _best_transform(costs, job, search, work, trial, y0, x0, log, direction, best)
    return best, kind, index, mask, direction, coded


@part_kernel
def _best_transform(costs, job, search, work, trial, y0, x0, log, mode, best):
    """Note another transform of an intra block if it costs less than the best so far; return the least cost."""
    side = search.weight * kind_cost(
        costs, job, y0 >> 2, x0 >> 2, log, np.int64(INTRA), np.int64(0), np.int64(0), mode
    )
    for p in range(3):
        predict_direction(job, work, p, y0, x0, 1 << log, mode)
    for transform in range(1, 4):
        bits, error, some = try_transform(costs, job, search, work, trial, y0, x0, log, transform, best - side)
        total = error + search.weight * bits + side
        if some and total < best:
            best = total
            keep(trial, log)
    return best


@part_kernel
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
            keep(trial, log)
    return best, kind, vector, coded


@part_kernel
def best_of_all(costs, job, search, match, work, trial, y0, x0, log):
    """As `best_block`, with the ways in time if there are earlier instants."""
    if job.past.shape[0] == 0:
        return best_block(costs, job, search, match, work, trial, y0, x0, log)
    n = 1 << log
    good = search.good * search.weight * np.float32(n * n)
    best, kind, vector, coded = best_in_time(costs, job, search, work, trial, y0, x0, log, good)
    if best > good:
        trial.skipped[0] = trial.skipped[log]
        copy_trial(
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
        copy_trial(
            trial.decoded[0],
            trial.levels[0],
            trial.cross[0],
            trial.decoded[log],
            trial.levels[log],
            trial.cross[log],
            n,
        )
    return best, kind, vector, 0, 0, coded


@stage_kernel
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


@part_kernel
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


@array_kernel
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
