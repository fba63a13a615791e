"""Coincident faces: Embree's choice among them varies, so the lowest is taken."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_BLOCK = 1 << 18  # faces hashed at a time
_MIX = np.uint64(0x9E3779B97F4A7C15)  # an odd factor with evenly spread bits


def first_of_same(corners: NDArray[np.float32]) -> NDArray[np.int32] | None:
    """Return for each face the first one with the same corners, in any order; None if no two faces are alike.

    Which of them a ray meets hangs on the width of its packet. Faces that only overlap in a plane are not told apart.

    Parameters
    ----------
    corners : (F, 3, 3) float32
        Finite.

    Returns
    -------
    (F,) int32 or None
    """
    hashes = np.concatenate(
        [_corner_keys(corners[i : i + _BLOCK]).sum(axis=1) for i in range(0, len(corners), _BLOCK)] or [[]]
    )
    ordered = np.sort(hashes)
    often = ordered[1:][ordered[1:] == ordered[:-1]]
    if not len(often):
        return None
    alike = np.flatnonzero(np.isin(hashes, often))
    order = np.argsort(_corner_keys(corners[alike]), axis=1)
    rows = np.take_along_axis(corners[alike] + np.float32(0), order[:, :, None], axis=1).reshape(-1, 9)
    _, first, which = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    if len(first) == len(alike):
        return None
    found = np.arange(len(corners), dtype=np.int32)
    found[alike] = alike[first[which.reshape(-1)]]
    return found


def _corner_keys(corners: NDArray[np.float32]) -> NDArray[np.uint64]:
    """Return a number of each corner, (F, 3): equal for equal corners, of either sign of zero."""
    bits = np.ascontiguousarray(corners + np.float32(0)).view(np.uint32).astype(np.uint64)
    keys = np.zeros(bits.shape[:2], np.uint64)
    for axis in range(3):
        keys = (keys ^ bits[:, :, axis]) * _MIX
        keys ^= keys >> np.uint64(29)
    return keys
