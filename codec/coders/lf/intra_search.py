"""Encoder search of intra modes: ranked by their prediction error before any residual."""

from __future__ import annotations

import numpy as np

from ii_core.base.jit import part_kernel, stage_kernel

from .intra import ALL_MODES, DIRECTIONS, FROM_LEFT, MODES, coarse, fill_border, predict_along, predict_intra
from .kinds import kind_cost
from .matching import HUGE
from .modes import likely_directions
from .state import DONE, INTRA
from .transform import sides

FIRST_DIRECTION = MODES - DIRECTIONS


@stage_kernel
def _magnitudes(own, y0, x0, predicted, h, w):
    """Sum of the magnitudes of a difference."""
    total = np.int32(0)
    for y in range(h):
        one, other = own[np.uint64(y0 + y)], predicted[y]
        for x in range(w):
            total += np.int32(abs(np.int32(np.int32(one[np.uint64(x0 + x)]) - other[x])))
    return total


@part_kernel
def _add_magnitudes(search, work, y0, x0, shape, plane, modes, smoothed, errors):
    """errors[mode] += sum of magnitudes of a plane's difference from the intra prediction.

    Predictions from the left stay lying, and are compared with a lying copy of the block.
    """
    (h, w), (first, last, step) = sides(shape), modes
    own, lying, predicted = search.original[plane], work.block, work.predicted[plane]
    if last > FROM_LEFT:
        for y in range(h):
            for x in range(w):
                lying[x, y] = own[np.uint64(y0 + y), np.uint64(x0 + x)]
    for mode in range(first, last, step):
        if mode < 0 or mode >= ALL_MODES:
            continue
        if mode < FIRST_DIRECTION:
            predict_intra(work.border, mode, shape, work.predicted, plane, smoothed)
        else:
            predict_along(work.border, mode, shape, predicted, smoothed)
        if coarse(mode) < FROM_LEFT:
            total = _magnitudes(own, y0, x0, predicted, h, w)
        else:
            total = _magnitudes(lying, 0, 0, predicted, w, h)
        errors[mode] += np.float32(total)  # exact: 1024 differences of decoded samples stay below 2^24


@part_kernel
def rank_directions(costs, job, search, work, y0, x0, shape, errors):
    """errors[:MODES] = sums of magnitudes and weighted bits; a hurried search leaves out unlikely directions."""
    by, bx = y0 >> 2, x0 >> 2
    every = 4 if search.hurried and job.references.shape[0] else 1
    for mode in range(ALL_MODES):
        errors[mode] = HUGE
    _add_planes(job, search, work, y0, x0, shape, (0, FIRST_DIRECTION, 1), errors)
    _add_planes(job, search, work, y0, x0, shape, (FIRST_DIRECTION, MODES, every), errors)
    while every > 1:
        every >>= 1
        best = least_error(errors)
        if best >= FIRST_DIRECTION:
            for mode in (best - every, best + every):
                if FIRST_DIRECTION <= mode < MODES:
                    _add_planes(job, search, work, y0, x0, shape, (mode, mode + 1, 1), errors)
    if job.guided:
        for mode in likely_directions(job.blocks, by, bx):
            if mode >= MODES:
                _add_planes(job, search, work, y0, x0, shape, (mode, mode + 1, 1), errors)
    weight = np.float32(np.sqrt(search.weight))
    for mode in range(ALL_MODES if job.guided else MODES):
        if errors[mode] < HUGE:
            side = kind_cost(costs, job, by, bx, shape, np.int64(INTRA), np.int64(0), np.int64(0), mode)
            errors[mode] += weight * side


@part_kernel
def _add_planes(job, search, work, y0, x0, shape, modes, errors):
    """errors[mode] = sum of magnitudes of the difference from the intra prediction, for modes of a range."""
    first, last, step = modes
    for mode in range(first, last, step):
        errors[max(mode, 0)] = 0
    for p in range(3):
        fill_border(job.views, job.at, p, job.blocks, np.int64(DONE), y0, x0, shape, work.border, job.directed)
        _add_magnitudes(search, work, y0, x0, shape, p, modes, job.directed, errors)


@stage_kernel
def least_error(errors):
    """The mode of the least error."""
    best = 0
    for mode in range(ALL_MODES):
        if errors[mode] < errors[best]:
            best = mode
    return best
