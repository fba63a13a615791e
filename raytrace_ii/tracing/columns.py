"""Columns along the light of lamps, by which most points of large pictures are told to be lit or in shadow."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .kernels.arrays import Columns
from .kernels.columns import (
    MATRIX,
    NUMBERS,
    OF_FACE,
    OF_SHEET,
    SLACK,
    TOLD,
    draw_rims,
    draw_sheets,
    find_extents,
    find_mates,
    tell_columns,
)
from .kernels.tables import DIRECTIONAL

ROUNDING = 1e-5  # of the greatest height: a few lifts of rays
MOST_LAMPS = 8  # that have columns
# Columns pay if a shadow ray is traced for 12 ns more than it is told, and twice their making: 0.4 µs a face and
# 60 ns a column (eight scenes, full setup1, 2026-11-28).
SIZES, RAY, FACE, COLUMN, TWICE = (1024, 512), 12e-9, 0.4e-6, 60e-9, 2

NO_COLUMNS = Columns(np.zeros(NUMBERS, np.float32), np.empty(0, np.float32), 0, True)


def columns_across(rays: int, faces: int, lamps: int) -> int:
    """Return how many columns across and down pay for so many camera rays; 0 if none do. By counts: never by time."""
    for size in SIZES:
        if lamps and TWICE * (FACE * faces + COLUMN * size**2 * min(lamps, MOST_LAMPS)) < RAY * rays:
            return size
    return 0


def light_columns(
    corners: NDArray[np.float32], normals: NDArray[np.float32], lights: NDArray[np.float64], size: int, solid: bool
) -> Columns:
    """Return the columns of lamps, ``size`` across and down.

    Parameters
    ----------
    corners : (F, 3, 3) float32
    normals : (F, 3) float32
        Of unit length.
    lights : (L, 12) float64
        The table of `PackedScene`.
    solid : bool
        Whether all faces stop light; if not, only what is lit is told.
    """
    flat, count = corners.reshape(-1), len(corners)
    turns, known = np.zeros((len(lights), NUMBERS), np.float32), []
    mates = np.empty(3 * count, np.int32)
    find_mates(flat, np.full(1 << (6 * count).bit_length(), -1, np.int32), mates)
    work = np.empty((2, OF_FACE))
    for turn, lamp in zip(turns, lights[:MOST_LAMPS], strict=False):
        found = _matrix(lamp, corners, size, work[0])
        own = np.full(size * size, np.nan, np.float32)
        known.append(own)
        if found is None:
            continue
        matrix, slack = found
        rims, layers = np.full(size * size, -np.inf, np.float32), np.zeros(size * size, np.uint8)
        draw_rims(matrix, flat, normals, mates, size, work, rims)
        sheets = np.full((size * size, OF_SHEET), -np.inf, np.float32)
        draw_sheets(matrix, flat, size, slack, work[0], sheets, layers)
        tell_columns(sheets, layers, rims, slack, own)
        turn[MATRIX:SLACK], turn[SLACK], turn[TOLD] = matrix, slack, 1
    return Columns(turns.reshape(-1), np.concatenate(known), size, solid)


def _matrix(
    lamp: NDArray[np.float64], corners: NDArray[np.float32], size: int, work: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float] | None:
    """Return the matrix (16,) from mm to u, v, weight and h, and the slack of h; None if a lamp has faces all around.

    The lattice encloses all faces but those that are as large as half of the scene.
    """
    far, place = lamp[0] == DIRECTIONAL, lamp[1:4]
    up = -place if far else _from_faces(place, corners)
    if up is None:
        return None
    side = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    side /= np.linalg.norm(side)
    axes = np.array([side, np.cross(up, side), up])
    matrix = np.zeros((4, 4))
    if far:
        matrix[[0, 1, 3], :3], matrix[2, 3] = axes, 1
    else:
        matrix[:3, :3], matrix[3, 3] = axes * [[1], [1], [-1]], 1
        matrix[:3, 3] = -matrix[:3, :3] @ place
    flat, all_of_them, small = corners.reshape(-1), np.empty((3, 2)), np.empty((3, 2))
    find_extents(matrix.reshape(-1), flat, np.full(3, np.inf), work, all_of_them)
    find_extents(matrix.reshape(-1), flat, np.ptp(all_of_them, axis=1) / 2, work, small)
    for axis in (0, 1):
        start, end = (small if small[axis, 0] <= small[axis, 1] else all_of_them)[axis]
        scale = (size - 4) / max(end - start, np.finfo(np.float32).tiny)
        matrix[axis] = scale * (matrix[axis] - start * matrix[2]) + 2 * matrix[2]
    return matrix.reshape(-1), ROUNDING * float(np.abs(all_of_them[2]).max())


def _from_faces(place: NDArray[np.float64], corners: NDArray[np.float32]) -> NDArray[np.float64] | None:
    """Return a unit vector along which a lamp lies beyond all faces, by the most; None if it lies among them."""
    points = corners.reshape(-1, 3)
    low, high = points.min(axis=0).astype(np.float64), points.max(axis=0).astype(np.float64)
    ways = [place - (low + high) / 2, *np.eye(3), *-np.eye(3)]
    ways = [way / length for way in ways if (length := np.linalg.norm(way)) > 0]
    beyond = [float((place @ way) - (points @ way.astype(np.float32)).max()) for way in ways]
    best = int(np.argmax(beyond))
    return ways[best] if beyond[best] > 1e-3 * float(np.abs(high - low).max()) else None
