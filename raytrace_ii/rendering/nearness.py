"""Choice of the rays that share a packet: those of neighbouring pixels under a lens, or of neighbouring lenses.

Rays of neighbouring lenses keep their distance of a lens pitch; rays of neighbouring pixels spread. Which are closer
at the content follows from its distances, which a few rays over the whole picture measure.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ii_core import Camera

from .tiles import SIDE, lens_cells

PROBES = 12  # rays along each axis of the picture
QUARTILES = 0.25, 0.75  # of distances: rays of pixels may cross between them, where views converge
# Rays of one position under several lenses are parallel and bear a wider spread (CPU time of *Apples*, *Twins*,
# *Cuboid* and *Objects* at scales 8, 16 and 32 of setup1, 2026-11-22).
FAVOUR = 1.5

Floats = NDArray[np.float64]
Distances = Callable[[Floats, Floats], Floats]


def pixels_are_nearer(camera: Camera, distances: Distances) -> bool:
    """Return whether rays of neighbouring pixels under a lens are the nearer ones at the content's distances.

    ``distances`` returns the distances of the content in mm along rays of origins and unit directions (n, 3); NaN
    without a hit.
    """
    cells = lens_cells(camera)
    if cells is None or min(cells) < SIDE:
        return False
    columns, rows = camera.pixels
    # odd steps: the rays stand at all positions under their lenses
    everywhere = (slice(None, None, (size // PROBES) | 1) for size in (rows, columns))
    far = distances(*(array.reshape(-1, 3) for array in _unit_rays(camera, *everywhere)))
    far = far[np.isfinite(far)]
    if not len(far):
        return False
    steps = []
    for axis, cell in enumerate(cells[::-1]):  # down and across, through the middle of the picture
        line = [slice(size // 2, size // 2 + 1) for size in (rows, columns)]
        line[axis] = slice(max(line[axis].start - cell, 0), line[axis].start + cell)
        L, D = (part.reshape(-1, 3) for part in _unit_rays(camera, *line))
        steps.append([[_step(L + at * D, apart) for apart in (1, cell)] for at in np.quantile(far, QUARTILES)])
    of_pixels, of_lenses = np.mean(steps, axis=0).max(axis=0)
    return bool(FAVOUR * of_pixels < of_lenses)


def _unit_rays(camera: Camera, rows: slice, cols: slice) -> tuple[Floats, Floats]:
    L, D = camera.rays(rows, cols)
    length = np.linalg.norm(D, axis=-1, keepdims=True)
    return L, np.divide(D, length, out=np.zeros_like(D), where=length > 0)


def _step(points: Floats, apart: int) -> float:
    """Return the median distance of points (n, 3) so many places apart; infinite if there are none."""
    steps = np.linalg.norm(points[apart:] - points[:-apart], axis=1)
    return float(np.median(steps)) if len(steps) else np.inf
