"""Choice of the rays that share a packet: those of neighbouring pixels under a lens, or of neighbouring lenses.

Rays of neighbouring lenses keep their distance of a lens pitch; rays of neighbouring pixels spread. Which are closer
at the content follows from its distances, which a few rays over the whole picture measure. So does what part of
their pixels the samples of a packet are taken from.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ii_core import Camera

from .tiles import SIDE, lens_cells

PROBES = 12  # rays along each axis of the picture
# Of distances: the nearest content, where most edges are, and the quartiles. Rays of pixels may cross between these,
# where views converge.
QUANTILES = 0.05, 0.25, 0.75
# Rays of one position under several lenses are parallel and bear a wider spread (CPU time of *Apples*, *Twins*,
# *Cuboid* and *Objects* at scales 8, 16 and 32 of setup1, 2026-11-22).
FAVOUR = 1.5

Floats = NDArray[np.float64]
Distances = Callable[[Floats, Floats], Floats]


def steps_at_content(camera: Camera, distances: Distances) -> Floats:
    """Return (3, 2) how far rays of neighbouring pixels, and of neighbouring lenses, are apart at the content, in mm.

    Each row is at one of `QUANTILES` of its distances; NaN if there is no content, a single lens or few pixels under
    it. ``distances`` returns the distances of the content in mm along rays of origins and unit directions (n, 3); NaN
    without a hit.
    """
    cells, unknown = lens_cells(camera), np.full((len(QUANTILES), 2), np.nan)
    if cells is None or min(cells) < SIDE:
        return unknown
    columns, rows = camera.pixels
    # odd steps: the rays stand at all positions under their lenses
    everywhere = (slice(None, None, (size // PROBES) | 1) for size in (rows, columns))
    far = distances(*(array.reshape(-1, 3) for array in _unit_rays(camera, *everywhere)))
    far = far[np.isfinite(far)]
    if not len(far):
        return unknown
    steps = []
    for axis, cell in enumerate(cells[::-1]):  # down and across, through the middle of the picture
        line = [slice(size // 2, size // 2 + 1) for size in (rows, columns)]
        line[axis] = slice(max(line[axis].start - cell, 0), line[axis].start + cell)
        L, D = (part.reshape(-1, 3) for part in _unit_rays(camera, *line))
        steps.append([[_step(L + at * D, apart) for apart in (1, cell)] for at in np.quantile(far, QUANTILES)])
    return np.mean(steps, axis=0)


def pixels_are_nearer(steps: Floats) -> bool:
    """Return whether packets hold neighbouring pixels under a lens, from `steps_at_content`."""
    of_pixels, of_lenses = steps[1:].max(axis=0)
    return bool(FAVOUR * of_pixels < of_lenses)


def parts_of_pixel(samples: int, steps: Floats) -> tuple[int, int]:
    """Return how many parts a pixel has along each side for packets of samples, and the pixels that share packets.

    Those pixels lie under neighbouring lenses, at most `tiles.SIDE` along each side. A packet of 16 samples of one
    part spreads over the part and the lenses; the parts are those that spread least at the nearest content. One part
    and one pixel mean that samples stay in their order.
    """
    of_pixels, of_lenses = steps[0]
    step = of_pixels / of_lenses if of_lenses > 0 else math.nan
    least, best = math.inf, (1, 1)
    for parts in (1, 2, 4, 8):
        lenses = SIDE * parts / samples**0.5
        spread = FAVOUR * step / parts + max(lenses, 1.0) - 1.0
        if lenses <= SIDE and spread < least:
            side = 2 ** round(math.log2(max(lenses, 1.0)))
            least, best = spread, (parts, side * side if parts > 1 else 1)
    return best


def _unit_rays(camera: Camera, rows: slice, cols: slice) -> tuple[Floats, Floats]:
    L, D = camera.rays(rows, cols)
    length = np.linalg.norm(D, axis=-1, keepdims=True)
    return L, np.divide(D, length, out=np.zeros_like(D), where=length > 0)


def _step(points: Floats, apart: int) -> float:
    """Return the median distance of points (n, 3) so many places apart; infinite if there are none."""
    steps = np.linalg.norm(points[apart:] - points[:-apart], axis=1)
    return float(np.median(steps)) if len(steps) else np.inf
