"""Encoder search of intra modes: ranked by their prediction error before any residual."""

from __future__ import annotations

import numpy as np

from ii_core.base.jit import part_kernel, stage_kernel

from .blocks import DONE, INTRA, kind_cost
from .intra import DIRECTIONS, MODES, fill_border, predict_intra
from .matching import HUGE
from .transform import sides

FIRST_DIRECTION = MODES - DIRECTIONS


@part_kernel
def _add_magnitudes(search, work, y0, x0, shape, plane, modes, smoothed, errors):
    """errors[mode] += sum of magnitudes of a plane's difference from the intra prediction."""
    (h, w), (first, last, step) = sides(shape), modes
    predicted = work.predicted[plane]
    for mode in range(first, last, step):
        if mode < 0 or mode >= MODES:
            continue
        predict_intra(work.border, mode, shape, work.predicted, plane, smoothed)
        total = np.int32(0)
        for y in range(h):
            own, row = search.original[plane, np.uint64(y0 + y)], predicted[y]
            for x in range(w):
                total += np.int32(abs(np.int32(np.int32(own[np.uint64(x0 + x)]) - row[x])))
        errors[mode] += np.float32(total)  # exact: 1024 differences of decoded samples stay below 2^24


@part_kernel
def rank_directions(costs, job, search, work, y0, x0, shape, errors):
    """errors[:MODES] = sums of magnitudes and weighted bits; a hurried search leaves out unlikely directions."""
    by, bx = y0 >> 2, x0 >> 2
    every = 4 if search.hurried and job.references.shape[0] else 1
    for mode in range(MODES):
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
    weight = np.float32(np.sqrt(search.weight))
    for mode in range(MODES):
        if errors[mode] < HUGE:
            errors[mode] += weight * kind_cost(costs, job, by, bx, shape, INTRA, 0, 0, mode)


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
    for mode in range(MODES):
        if errors[mode] < errors[best]:
            best = mode
    return best
