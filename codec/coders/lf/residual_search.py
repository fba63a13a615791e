"""Encoder search of a block's residual: with a transform or without, colours predicted or not."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ii_core.base.jit import part_kernel, stage_kernel
from ii_core.base.references import by_reference

from . import motion
from .arithmetic import bit_cost
from .blocks import coded_context, residual_context, skipped_context, transform_cost
from .coefficients import Trellis, new_trellis, quantise, quantise_dependent
from .cross import (
    best_cross,
    cross_cost,
    following_cost,
    keep_first,
    predict_following,
    rebuild,
    subtract_cross,
)
from .intra import ALL_MODES
from .samples import LARGEST_SKIPPED, quantise_samples
from .state import FIELDS, INTRA, LIMIT
from .transform import LARGEST, forward, sides, size_of

BEST = 2
FIRST_BITS, OCTAVE_BITS = 4.5, 1.6  # of a coefficient of one step, and for each doubling, about
NOTHING = np.float32(0)
BEYOND = np.float32(1.00001)  # times the least cost so far: more by far than sums of the same terms are rounded
WORTH_SKIPPING = np.float32(1.2)  # times the least cost so far: beyond it, skipping the transform is not tried


@by_reference
class Kept(NamedTuple):
    """The best blocks found in a region so far, by the binary logarithm of its area."""

    decoded: Any
    levels: Any
    blocks: Any
    motions: Any


@by_reference
class Trial(NamedTuple):
    """Memory of the search."""

    decoded: Any  # (3, 3, 32, 32) of the best way found in slot `BEST`; slots 0 and 1 for others
    levels: Any
    trial_decoded: Any  # (3, 32, 32) of the way tried
    trial_levels: Any
    cross: Any  # (3, 3) factors of `cross`, and whether colours follow the first plane
    trial_cross: Any
    skipped: Any  # (3,) whether there is no transform
    trial_skipped: Any  # (1,)
    errors: Any  # (ALL_MODES,) of intra prediction
    modes: Any  # (ALL_MODES,) of the least errors
    trellis: Trellis
    kept: Kept


def new_trial() -> Trial:
    """Memory of the search."""
    return Trial(
        decoded=np.zeros((3, 3, LARGEST, LARGEST), np.int16),
        levels=np.zeros((3, 3, LARGEST, LARGEST), np.int16),
        trial_decoded=np.zeros((3, LARGEST, LARGEST), np.int16),
        trial_levels=np.zeros((3, LARGEST, LARGEST), np.int16),
        cross=np.zeros((3, 3), np.int64),
        trial_cross=np.zeros(3, np.int64),
        skipped=np.zeros(3, np.int64),
        trial_skipped=np.zeros(1, np.int64),
        errors=np.zeros(ALL_MODES, np.float32),
        modes=np.zeros(ALL_MODES, np.int64),
        trellis=new_trellis(),
        kept=Kept(
            decoded=np.zeros((11, 3, LARGEST, LARGEST), np.int16),
            levels=np.zeros((11, 3, LARGEST, LARGEST), np.int16),
            blocks=np.zeros((11, FIELDS, LARGEST // 4, LARGEST // 4), np.int16),
            motions=np.zeros((11, motion.FIELDS, LARGEST // 4, LARGEST // 4), np.int16),
        ),
    )


@stage_kernel
def _copy_block(block, to, shape):
    h, w = sides(shape)
    for y in range(h):
        for x in range(w):
            to[y, x] = block[y, x]


@part_kernel
def _quantise(costs, work, trial, plane, shape, step, weight, levels, skipped, ways):
    """Quantise work.coefficients, which are samples if the transform is skipped."""
    if skipped == 1:
        return quantise_samples(costs, work.coefficients, trial.trial_levels, plane, shape, step, weight, levels)
    finer, dependent = ways
    if dependent:
        return quantise_dependent(costs, work.coefficients, plane, shape, step, weight, levels, finer, trial.trellis)
    return quantise(costs, work.coefficients, plane, shape, step, weight, levels, finer)


@part_kernel
def _try_plane(costs, work, trial, plane, shape, step, weight, kind, first, crossed, error, skipped, ways):
    """Quantise work.block; return bits, whether there are levels, which array has them, and the factor of `cross`.

    ``first`` says whether the first plane has a residual, ``error`` is the squared error without one, and ``ways``
    say whether contexts are those of version 7, and whether the quantiser is dependent.
    """
    context = coded_context(plane, shape, kind, first, skipped)
    free, full = bit_cost(costs, context, np.int64(0)), bit_cost(costs, context, np.int64(1))
    predictable = plane > 0 and first and crossed
    none = cross_cost(costs, plane, size_of(shape), np.int64(0)) if predictable else np.float32(0)
    bits, some, cross = free + none, 0, np.int64(0)
    if error <= np.float32(0.2) * step * step:
        return bits, some, cross
    if skipped == 1:
        _copy_block(work.block, work.coefficients, shape)
    else:
        forward(work.block, shape, work.half, work.coefficients, skipped >> 1)
    more, missed = _quantise(costs, work, trial, plane, shape, step, weight, work.levels, skipped, ways)
    best = error + weight * bits
    if more > 0 and missed + weight * (more + full + none) < best:
        best, bits, some = missed + weight * (more + full + none), more + full + none, 1
    factor = best_cross(work, crossed) if predictable else np.int64(0)
    if factor:
        subtract_cross(work, factor, crossed)
        more, missed = _quantise(costs, work, trial, plane, shape, step, weight, work.spare, skipped, ways)
        more += (full if more > 0 else free) + cross_cost(costs, plane, size_of(shape), factor)
        if missed + weight * more < best:
            bits, some, cross = more, 1, factor
    return bits, some, cross


@part_kernel
def try_residual(costs, job, search, work, trial, y0, x0, shape, kind, so_far):
    """Code the difference to work.predicted; return bits, error and whether there is a residual.

    ``so_far`` is the least cost of the block: far above it, skipping the transform is not tried. The way is left when
    its first planes cost more than that, and those of a block without a residual, too.
    """
    trial.trial_skipped[0] = trial.trial_cross[2] = 0
    small = job.skipping and shape[0] + shape[1] <= LARGEST_SKIPPED
    useless = BEYOND * so_far
    limit = WORTH_SKIPPING * useless if small else useless
    bits, error, coded = _try_way(costs, job, search, work, trial, y0, x0, shape, kind, np.int64(0), limit, useless)
    cost = error + search.weight * bits
    if not coded or not small or cost > WORTH_SKIPPING * so_far:
        return bits, error, coded
    copy_trial(
        trial.trial_decoded,
        trial.trial_levels,
        trial.trial_cross,
        trial.decoded[1],
        trial.levels[1],
        trial.cross[1],
        shape,
    )
    limit = min(cost, useless)
    more, missed, some = _try_way(costs, job, search, work, trial, y0, x0, shape, kind, 1, limit, NOTHING)
    if some and missed + search.weight * more < cost:
        trial.trial_skipped[0] = 1
        return more, missed, some
    copy_trial(
        trial.decoded[1],
        trial.levels[1],
        trial.cross[1],
        trial.trial_decoded,
        trial.trial_levels,
        trial.trial_cross,
        shape,
    )
    return bits, error, coded


@part_kernel
def try_transform(costs, job, search, work, trial, y0, x0, shape, kind, limit):
    """As `try_residual` of an intra block, by a kind of transform; give up without a residual beyond a cost."""
    trial.trial_skipped[0], trial.trial_cross[2] = 2 * kind, 0
    return _try_way(costs, job, search, work, trial, y0, x0, shape, np.int64(INTRA), 2 * kind, limit, NOTHING)


@part_kernel
def try_following(costs, job, search, work, trial, y0, x0, shape, limit):
    """As `try_residual` of an intra block, by its best transform; its colours follow. Give up beyond a cost."""
    skipped = trial.skipped[BEST]
    trial.trial_skipped[0], trial.trial_cross[2] = skipped, 1
    return _try_way(costs, job, search, work, trial, y0, x0, shape, np.int64(INTRA), skipped, limit, NOTHING)


@part_kernel
def _try_way(costs, job, search, work, trial, y0, x0, shape, kind, skipped, limit, useless):
    """As `try_residual`, without a transform or by twice its kind; give up beyond a cost.

    Not if the block without a residual costs less than another one.
    """
    by, bx = y0 >> 2, x0 >> 2
    step = np.float32(job.step / 16)
    bits, error, without = np.float32(0), np.float32(0), np.float32(0)
    first, coded = 0, 0
    ways = job.finer, job.dependent
    context = residual_context(job, by, bx, shape, kind)
    empty = bit_cost(costs, context, np.int64(0))
    follows = trial.trial_cross[2]
    for p in range(3):
        if p and follows:
            predict_following(job, trial.trial_decoded[0], work, p, y0, x0, shape)
        least = _subtract_prediction(search, work, p, y0, x0, shape)
        without += least
        more, some, cross = _try_plane(
            costs, work, trial, p, shape, step, search.weight, kind, first, job.crossed, least, skipped, ways
        )
        bits += more
        if p:
            trial.trial_cross[p - 1] = cross
        if some:
            levels = work.spare if cross else work.levels
            rows, cols = rebuild(work, levels, shape, job.step, 1, cross, job.crossed, skipped, job.dependent)
            if p == 0:
                keep_first(work, rows, cols)
                first = 1
            coded = 1
            error = _add_prediction(search, work, trial, p, y0, x0, shape, error)
            _copy_block(levels, trial.trial_levels[p], shape)
        else:
            _leave(trial, work, p, shape)
            error += least
        if error + search.weight * bits > limit:
            if follows:
                return bits, error, 0
            least = without + search.weight * empty
            for other in range(p + 1, 3):
                if least <= useless:
                    least += _subtract_prediction(search, work, other, y0, x0, shape)
            if least > useless:
                return bits, error, 0
    if coded:
        bits += bit_cost(costs, context, 1)
        if job.skipping and shape[0] + shape[1] <= LARGEST_SKIPPED:
            bits += bit_cost(costs, skipped_context(job, by, bx, shape), skipped & 1)
        if job.directed and kind == INTRA and skipped != 1:
            bits += transform_cost(costs, shape, skipped >> 1)
        if job.guided and job.crossed and kind == INTRA:
            bits += following_cost(costs, job, by, bx, shape, follows)
            if follows:
                return bits, error, 1
        if error + search.weight * bits < without + search.weight * empty:
            return bits, error, 1
        for p in range(3):
            _leave(trial, work, p, shape)
    return empty, without, 0


@part_kernel
def estimated_cost(job, search, work, y0, x0, shape, kind, planes):
    """Squared error + weight · bits of the first planes' differences to work.predicted, by their coefficients alone.

    A coefficient is left out, or costs the error of a uniform quantiser and bits that grow with its logarithm.
    """
    (h, w), total = sides(shape), np.float32(0)
    step = np.float32(job.step / 16)
    per_step, least = np.float32(1) / step, np.float32(0.09) * step * step + np.float32(FIRST_BITS) * search.weight
    for p in range(planes):
        _subtract_prediction(search, work, p, y0, x0, shape)
        forward(work.block, shape, work.half, work.coefficients, kind)
        for y in range(h):
            row = work.coefficients[y]
            for x in range(w):
                size = abs(np.float32(row[x]))
                cost = size * size
                if cost > least:
                    cost = least + np.float32(OCTAVE_BITS) * search.weight * np.log2(
                        max(size * per_step, np.float32(1))
                    )
                total += cost
    return total


@stage_kernel
def _subtract_prediction(search, work, p, y0, x0, shape):
    """work.block = the difference to work.predicted; return its squared error."""
    (h, w), error = sides(shape), np.float32(0)
    for y in range(h):
        own, predicted, block = search.original[p, np.uint64(y0 + y)], work.predicted[p, y], work.block[y]
        for x in range(w):
            difference = np.int32(own[np.uint64(x0 + x)] - predicted[x])
            block[x] = difference
            error += np.float32(difference * difference)
    return error


@stage_kernel
def _add_prediction(search, work, trial, p, y0, x0, shape, error):
    """trial.trial_decoded = work.predicted and the decoded difference; return ``error`` and its squared error."""
    h, w = sides(shape)
    for y in range(h):
        own, predicted, block = search.original[p, np.uint64(y0 + y)], work.predicted[p, y], work.block[y]
        decoded = trial.trial_decoded[p, y]
        for x in range(w):
            value = min(max(np.int32(predicted[x] + block[x]), np.int32(-LIMIT)), np.int32(LIMIT))
            decoded[x] = value
            difference = np.int32(own[np.uint64(x0 + x)] - value)
            error += np.float32(difference * difference)
    return error


@stage_kernel
def _leave(trial, work, p, shape):
    """A plane without a residual."""
    h, w = sides(shape)
    for y in range(h):
        for x in range(w):
            trial.trial_decoded[p, y, x] = work.predicted[p, y, x]
            trial.trial_levels[p, y, x] = 0


@stage_kernel
def keep(trial, shape):
    """Note the way tried as the best one of a block."""
    h, w = sides(shape)
    for i in range(3):
        trial.cross[BEST, i] = trial.trial_cross[i]
    trial.skipped[BEST] = trial.trial_skipped[0]
    for p in range(3):
        for y in range(h):
            for x in range(w):
                trial.decoded[BEST, p, y, x] = trial.trial_decoded[p, y, x]
                trial.levels[BEST, p, y, x] = trial.trial_levels[p, y, x]


@stage_kernel
def copy_trial(decoded, levels, cross, to_decoded, to_levels, to_cross, shape):
    """Copy what a way makes of a block."""
    h, w = sides(shape)
    to_cross[0], to_cross[1], to_cross[2] = cross[0], cross[1], cross[2]
    for p in range(3):
        for y in range(h):
            for x in range(w):
                to_decoded[p, y, x] = decoded[p, y, x]
                to_levels[p, y, x] = levels[p, y, x]
