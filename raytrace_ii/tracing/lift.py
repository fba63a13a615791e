"""Lift of spawned rays off the face that they start from, so that they do not meet it again."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Spawned rays start this share of the face's largest coordinate off the face: float32 places a hit to about
# 1e-7 of it, and from 1e-6 on no ray meets its own face again.
LIFT = 4e-6
# Embree tells the sides of a face by the product of its normal, as long as twice its area, and the way from the ray's
# start, in float32: a lift of fewer subnormal steps is rounded away. It is at most this share of the longest edge.
LIFT_STEPS, MOST_LIFT = 8 * float(np.finfo(np.float32).smallest_subnormal), 1e-3
SOME_FACES = 1 << 16


def fill_face_table(corners: NDArray[np.float32], out: NDArray[np.float32]) -> None:
    """Write unit normal (0 for a face without area) and lift in mm of every face as rows of ``out``."""
    for first in range(0, len(corners), SOME_FACES):  # in float64 all at once would take ten times the table
        some = slice(first, first + SOME_FACES)
        out[some] = _face_rows(corners[some].astype(np.float64))


def _face_rows(p: NDArray[np.float64]) -> NDArray[np.float64]:
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    unit = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    longest = np.linalg.norm(p - np.roll(p, 1, axis=1), axis=2).max(axis=1)
    least = np.divide(LIFT_STEPS, length[:, 0], out=np.zeros_like(longest), where=length[:, 0] > 0)
    lift = np.maximum(LIFT * np.abs(p).max(axis=(1, 2)), np.minimum(least, MOST_LIFT * longest))
    return np.column_stack([unit, lift])
