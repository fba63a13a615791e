"""Encoder search of blocks: least squared error + weight · bits, from the largest block down."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ii_core.base.jit import array_kernel, part_kernel, stage_kernel
from ii_core.base.references import by_reference

from .arithmetic import bit_cost
from .blocks import (
    LOG_LARGEST,
    LOG_LEAST,
    halved,
    mark_block,
    note_skipped,
    part_ways,
    predict_direction,
    predict_explicit,
    predict_synthesis,
    split_context,
    way_cost,
)
from .field import EIGHTH
from .intra import ALL_MODES, MODES, SMOOTH, coarse
from .intra_search import least_error, rank_directions
from .kinds import guesses, kind_cost
from .matching import HUGE, best_explicit, fill_products, new_match
from .motion import best_vector, predict_in_time
from .residual_search import (
    BEST,
    copy_trial,
    estimated_cost,
    keep,
    new_trial,
    try_following,
    try_residual,
    try_transform,
)
from .state import CROSS_1, CROSS_2, DONE, EXPLICIT, INTRA, LOG, MIXED, PARTS, SYNTHESIS, TIMED, Job, new_work
from .transform import sides

# A block is not divided if so many times its cost are more than another way to code the region may cost. Of the part
# that is coded later, at least so much of its share is taken to be needed.
SPLIT_GAIN, PART_GAIN, REST = np.float32(0.7), np.float32(0.82), np.float32(0.35)
PROMISING = np.float32(
    1.02
)  # other transforms are tried whose estimated cost is at most so many times that of cosines
MANY_SPLIT = 4  # quarters that are divided themselves: then halves are not tried
FEW = 12  # disparities that are all searched; of more, every second, and then those beside the best


@by_reference
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
        Intra modes that are coded on trial,
    intra_estimates : int
        and of how many they are the best by their coefficients; 0: of all by sums of magnitudes.
    planes : int
        Planes that count in the choice of disparity and references.
    promising : int
        Whether only those transforms of an intra block are tried whose estimated cost is low.
    hurried : int
        Whether intra directions are found coarse to fine, and sizes and disparities that hardly ever pay left out.
    halvings : int
        How often squares are halved at most.
    good : float32
        A block whose cost a sample is less, in units of the weight, is not split, and not tried in other ways.
    surely : float32
        A block that costs less than so many times ``good`` is not tried by intra modes.
    """

    original: Any
    weight: Any
    least: Any
    intra_tries: Any
    intra_estimates: Any
    planes: Any
    promising: Any
    hurried: Any
    halvings: Any
    good: Any
    surely: Any


@part_kernel
def best_block(costs, job, search, match, work, trial, y0, x0, shape):
    """Try the ways to code a block and note the best; return its cost and whether it has a residual."""
    (h, w), by, bx = sides(shape), y0 >> 2, x0 >> 2
    best, kind, index, mask, direction, coded = HUGE, INTRA, 0, 0, 0, 0
    good = search.good * search.weight * np.float32(h * w)
    if job.synthesised:
        side = kind_cost(costs, job, by, bx, shape, np.int64(SYNTHESIS), np.int64(0), np.int64(0), np.int64(0))
        predict_synthesis(job, work, y0, x0, shape)
        bits, error, some = try_residual(costs, job, search, work, trial, y0, x0, shape, np.int64(SYNTHESIS), HUGE)
        best, kind, coded = error + search.weight * (bits + side), SYNTHESIS, some
        index = guesses(job, by, bx, shape)[0]
        keep(trial, shape)
    if job.references.shape[0] and best > good:
        k, m = best_explicit(costs, job, match, work, search.original, search.weight, search.planes, y0, x0, shape)
        side = kind_cost(costs, job, by, bx, shape, np.int64(EXPLICIT), k, m, np.int64(0))
        predict_explicit(job, work, y0, x0, shape, k, m)
        bits, error, some = try_residual(costs, job, search, work, trial, y0, x0, shape, np.int64(EXPLICIT), best)
        total = error + search.weight * (bits + side)
        if total < best:
            best, kind, index, mask, coded = total, EXPLICIT, k, m, some
            keep(trial, shape)
    if job.references.shape[0] == 0 or best > search.surely * good:
        errors = trial.errors
        rank_directions(costs, job, search, work, y0, x0, shape, errors)
        if search.intra_estimates:
            _rank_by_estimates(costs, job, search, work, trial, y0, x0, shape)
        for _ in range(search.intra_tries):
            mode = least_error(errors)
            if errors[mode] >= HUGE:
                break
            errors[mode] = HUGE
            total, some = _try_mode(costs, job, search, work, trial, y0, x0, shape, mode, best)
            if total < best:
                best, kind, index, mask, direction, coded = total, INTRA, 0, 0, mode, some
    if job.guided and kind == INTRA and direction > SMOOTH:
        near = _nearest_direction(costs, job, search, work, y0, x0, shape, direction)
        if near != direction:
            total, some = _try_mode(costs, job, search, work, trial, y0, x0, shape, near, best)
            if total < best:
                best, direction, coded = total, near, some
    if job.directed and kind == INTRA and coded:
        best = _best_transform(costs, job, search, work, trial, y0, x0, shape, direction, best)
    if job.guided and job.crossed and kind == INTRA and coded:
        best = _following_first(costs, job, search, work, trial, y0, x0, shape, direction, best)
    return best, kind, index, mask, direction, coded


@part_kernel
def _predict_mode(costs, job, work, y0, x0, shape, mode):
    """work.predicted by an intra mode; return the bits that saying so takes."""
    for p in range(3):
        predict_direction(job, work, p, y0, x0, shape, mode)
    return kind_cost(costs, job, y0 >> 2, x0 >> 2, shape, np.int64(INTRA), np.int64(0), np.int64(0), mode)


@part_kernel
def _try_mode(costs, job, search, work, trial, y0, x0, shape, mode, best):
    """Cost of a block by an intra mode, noted if it is less than the best so far, and whether it has a residual."""
    side = _predict_mode(costs, job, work, y0, x0, shape, mode)
    bits, error, some = try_residual(costs, job, search, work, trial, y0, x0, shape, np.int64(INTRA), best)
    total = error + search.weight * (bits + side)
    if total < best:
        keep(trial, shape)
    return total, some


@part_kernel
def _estimated_mode(costs, job, search, work, y0, x0, shape, mode):
    """Estimated cost of a block by an intra mode."""
    side = search.weight * _predict_mode(costs, job, work, y0, x0, shape, mode)
    return side + estimated_cost(job, search, work, y0, x0, shape, np.int64(0), np.int64(3))


@part_kernel
def _rank_by_estimates(costs, job, search, work, trial, y0, x0, shape):
    """trial.errors = estimated costs of the modes of the least errors, the others' beyond all."""
    errors, modes = trial.errors, trial.modes
    for k in range(search.intra_estimates):
        modes[k] = least_error(errors)
        errors[modes[k]] = HUGE
    for mode in range(ALL_MODES):
        errors[mode] = HUGE
    for k in range(search.intra_estimates):
        errors[modes[k]] = _estimated_mode(costs, job, search, work, y0, x0, shape, modes[k])


@part_kernel
def _nearest_direction(costs, job, search, work, y0, x0, shape, direction):
    """Of a direction and the two beside it, the one of the least estimated cost."""
    middle, best, least = coarse(direction), direction, HUGE
    for turn in range(3):
        mode = middle if turn == 0 else MODES + 2 * (middle - 2) + turn - 1
        cost = _estimated_mode(costs, job, search, work, y0, x0, shape, mode)
        if cost < least:
            best, least = mode, cost
    return best


@part_kernel
def _best_transform(costs, job, search, work, trial, y0, x0, shape, mode, best):
    """Note another transform of an intra block if it costs less than the best so far; return the least cost."""
    side = search.weight * _predict_mode(costs, job, work, y0, x0, shape, mode)
    most = HUGE
    if search.promising:
        most = PROMISING * estimated_cost(job, search, work, y0, x0, shape, np.int64(0), np.int64(1))
    for transform in range(1, 4):
        if most < HUGE and estimated_cost(job, search, work, y0, x0, shape, transform, np.int64(1)) > most:
            continue
        bits, error, some = try_transform(costs, job, search, work, trial, y0, x0, shape, transform, best - side)
        total = error + search.weight * bits + side
        if some and total < best:
            best = total
            keep(trial, shape)
    return best


@part_kernel
def _following_first(costs, job, search, work, trial, y0, x0, shape, mode, best):
    """Let the colours of an intra block follow its first plane if that costs less than the best so far."""
    side = search.weight * _predict_mode(costs, job, work, y0, x0, shape, mode)
    bits, error, some = try_following(costs, job, search, work, trial, y0, x0, shape, best - side)
    total = error + search.weight * bits + side
    if some and total < best:
        best = total
        keep(trial, shape)
    return best


@part_kernel
def best_in_time(costs, job, search, work, trial, y0, x0, shape, good):
    """Try a block in time, alone and mixed with synthesis; return cost, kind, vector, and if it has a residual."""
    vector = best_vector(costs, job, search, work, y0, x0, shape, good)
    best, kind, coded = HUGE, TIMED, 0
    for way in range(TIMED, TIMED + 1 + job.synthesised):
        side = kind_cost(costs, job, y0 >> 2, x0 >> 2, shape, way, vector, np.int64(0), np.int64(0))
        predict_in_time(job, work, y0, x0, shape, vector, way == MIXED)
        bits, error, some = try_residual(costs, job, search, work, trial, y0, x0, shape, way, best)
        total = error + search.weight * (bits + side)
        if total < best:
            best, kind, coded = total, way, some
            keep(trial, shape)
    return best, kind, vector, coded


@part_kernel
def best_of_all(costs, job, search, match, work, trial, y0, x0, shape):
    """As `best_block`, with the ways in time if there are earlier instants."""
    if job.past.shape[0] == 0:
        return best_block(costs, job, search, match, work, trial, y0, x0, shape)
    h, w = sides(shape)
    good = search.good * search.weight * np.float32(h * w)
    best, kind, vector, coded = best_in_time(costs, job, search, work, trial, y0, x0, shape, good)
    if best > good:
        trial.skipped[0] = trial.skipped[BEST]
        copy_trial(
            trial.decoded[BEST],
            trial.levels[BEST],
            trial.cross[BEST],
            trial.decoded[0],
            trial.levels[0],
            trial.cross[0],
            shape,
        )
        found = best_block(costs, job, search, match, work, trial, y0, x0, shape)
        if found[0] < best:
            return found
        trial.skipped[BEST] = trial.skipped[0]
        copy_trial(
            trial.decoded[0],
            trial.levels[0],
            trial.cross[0],
            trial.decoded[BEST],
            trial.levels[BEST],
            trial.cross[BEST],
            shape,
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
def _fill(job, trial, y0, x0, shape):
    """Store the best way found as decoded."""
    h, w = sides(shape)
    for p in range(3):
        for y in range(h):
            for x in range(w):
                job.views[job.at, p, y0 + y, x0 + x] = trial.decoded[BEST, p, y, x]
                job.levels[p, y0 + y, x0 + x] = trial.levels[BEST, p, y, x]


@part_kernel
def _copy_region(job, kept, y0, x0, shape, back):
    """Copy all that is known of a region to memory, or back."""
    h, w = sides(shape)
    slot = shape[0] + shape[1]
    for p in range(3):
        view, plane = job.views[job.at, p], job.levels[p]
        decoded, levels = kept.decoded[slot, p], kept.levels[slot, p]
        for y in range(h):
            for x in range(w):
                if back:
                    view[y0 + y, x0 + x], plane[y0 + y, x0 + x] = decoded[y, x], levels[y, x]
                else:
                    decoded[y, x], levels[y, x] = view[y0 + y, x0 + x], plane[y0 + y, x0 + x]
    _copy_notes(job.blocks, kept.blocks[slot], y0 >> 2, x0 >> 2, h >> 2, w >> 2, back)
    if job.past.shape[0]:
        _copy_notes(job.motions[job.at], kept.motions[slot], y0 >> 2, x0 >> 2, h >> 2, w >> 2, back)


@part_kernel
def _copy_notes(notes, kept, by, bx, rows, cols, back):
    for field in range(notes.shape[0]):
        for y in range(rows):
            for x in range(cols):
                if back:
                    notes[field, by + y, bx + x] = kept[field, y, x]
                else:
                    kept[field, y, x] = notes[field, by + y, bx + x]


@stage_kernel
def _forget(job, y0, x0, shape):
    """A region is to be decoded anew."""
    h, w = sides(shape)
    for y in range(y0 >> 2, (y0 + h) >> 2):
        for x in range(x0 >> 2, (x0 + w) >> 2):
            job.blocks[DONE, y, x] = 0


@stage_kernel
def _split_further(blocks, by, bx, log):
    """Number of a split square's quarters that are split or parted themselves."""
    count, half = 0, 1 << (log - 3)
    for part in range(4):
        y, x = by + half * (part >> 1), bx + half * (part & 1)
        if blocks[LOG, y, x] < log - 1 or blocks[PARTS, y, x]:
            count += 1
    return count


@part_kernel
def search_tree(costs, job, search, match, work, trial, y0, x0, shape, leaf, depth, limit):
    """Find, mark and decode the blocks of a square, or of a part of one; return the cost.

    A cost beyond the limit is of no use.
    """
    height, width = job.levels.shape[1:]
    if y0 >= height or x0 >= width:
        return np.float32(0)
    (h, w), by, bx, log = sides(shape), y0 >> 2, x0 >> 2, leaf[0]
    total, split = np.float32(0), y0 + h > height or x0 + w > width
    whole = depth == 0
    hurried = search.hurried and whole and log > 3 and job.past.shape[0] == 0
    if hurried and not split and _much_smaller(job.blocks, by, bx, log):
        total, split = search.weight * bit_cost(costs, split_context(job, by, bx, log), 1), True
    if split:
        quarter, below = (log - 1, log - 1), (log - 1, np.int64(0))
        for part in range(4):
            y, x = y0 + (part >> 1) * (h >> 1), x0 + (part & 1) * (w >> 1)
            total += search_tree(costs, job, search, match, work, trial, y, x, quarter, below, np.int64(0), HUGE)
        return total
    best, kind, index, mask, direction, coded = best_of_all(costs, job, search, match, work, trial, y0, x0, shape)
    _fill(job, trial, y0, x0, shape)
    mark_block(job, by, bx, shape, leaf, kind, index, mask, direction, coded)
    job.blocks[CROSS_1, by, bx], job.blocks[CROSS_2, by, bx] = trial.cross[BEST, 0], trial.cross[BEST, 1]
    note_skipped(job.blocks, by, bx, shape, trial.skipped[BEST] if coded else 0, trial.cross[BEST, 2] if coded else 0)
    ways, side = part_ways(job, shape, depth), np.float32(0)
    if whole and log > LOG_LEAST:
        side = search.weight * bit_cost(costs, split_context(job, by, bx, log), 0)
    best += side + search.weight * way_cost(costs, job, by, bx, shape, ways, 0)
    if not coded and best <= search.good * search.weight * np.float32(h * w):
        return best
    if (SPLIT_GAIN if whole else PART_GAIN) * best > limit:
        return best
    kept, latest = trial.kept, True
    for step in range(3):
        way = 3 if step == 0 else step
        if way == 3:
            if not (whole and log > search.least):
                continue
        elif depth >= search.halvings or not (ways >> (way - 1)) & 1:
            continue
        if latest:
            _copy_region(job, kept, y0, x0, shape, np.int64(0))
        _forget(job, y0, x0, shape)
        if way == 3:
            total = search.weight * bit_cost(costs, split_context(job, by, bx, log), 1)
            some, below, deeper = (shape[0] - 1, shape[1] - 1), (log - 1, np.int64(0)), np.int64(0)
        else:
            total = side + search.weight * way_cost(costs, job, by, bx, shape, ways, way)
            some, below, deeper = halved(shape, way), (log, leaf[1] + (way << (2 * depth))), depth + 1
        down, across = 1 << some[0], 1 << some[1]
        parts = 4 if way == 3 else 2
        for part in range(parts):
            y = y0 + down * (part >> 1 if way == 3 else (part if way == 1 else 0))
            x = x0 + across * (part & 1 if way == 3 else (part if way == 2 else 0))
            others = np.float32(parts - 1 - part) / np.float32(parts) * REST * best
            most = best - total - others
            total += search_tree(costs, job, search, match, work, trial, y, x, some, below, deeper, most)
            if total > best:
                break
        latest = total < best
        if latest:
            best = total
            if way == 3 and _split_further(job.blocks, by, bx, log) >= MANY_SPLIT:
                break
    if not latest:
        _copy_region(job, kept, y0, x0, shape, np.int64(1))
    return best


@array_kernel
def _search_view(costs, job, search, match, work, trial):
    height, width = job.levels.shape[1:]
    largest, never = np.int64(LOG_LARGEST), np.int64(0)
    for y0 in range(0, height, 1 << LOG_LARGEST):
        for x0 in range(0, width, 1 << LOG_LARGEST):
            if job.references.shape[0]:
                fill_products(job, search.original, y0, x0, match)
            search_tree(
                costs, job, search, match, work, trial, y0, x0, (largest, largest), (largest, never), never, HUGE
            )


def find_blocks(costs: NDArray[np.float32], job: Job, search: Search) -> None:
    """Find, mark and decode all blocks of a view."""
    references = len(job.references)
    every = 2 if job.unit <= EIGHTH // 2 or job.high - job.low > FEW else 1
    match = new_match(job.high - job.low + 1 if references else 1, every, search.hurried)
    _search_view(costs, job, search, match, new_work(), new_trial())
