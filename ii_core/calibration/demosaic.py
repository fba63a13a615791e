"""Demosaicing of raw pictures with a Bayer pattern."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base import checks

MOSAICS = ("rggb", "bggr", "grbg", "gbrg")  # colours of the first two pixels of the first two rows


def phases(mosaic: str) -> dict[str, tuple[tuple[int, int], ...]]:
    """Places (row, column) in the 2×2 tile of each colour.

    Raises
    ------
    ValueError
        If the mosaic is unknown.
    """
    checks.one_of(*MOSAICS)("mosaic", mosaic)
    return {colour: tuple((i // 2, i % 2) for i in range(4) if mosaic[i] == colour) for colour in "rgb"}


def evened(raw: NDArray[Any], mosaic: str) -> NDArray[np.float32]:
    """A raw picture as grey: each of the tile's four places brought to the mean of all."""
    checks.one_of(*MOSAICS)("mosaic", mosaic)
    grey = np.asarray(raw, np.float32).copy()
    mean = float(grey.mean())
    for row, col in ((0, 0), (0, 1), (1, 0), (1, 1)):
        part = grey[row::2, col::2]
        level = float(part.mean())
        if level > 0:
            part *= mean / level
    return grey


@checks.checked(raw=checks.array, mosaic=checks.one_of(*MOSAICS))
def demosaiced(raw: NDArray[Any], mosaic: str, owner: NDArray[Any] | None = None) -> NDArray[np.float32]:
    """R, G and B of a raw picture, (N, M, 3), bilinear: the mean of the neighbours that have the colour.

    Parameters
    ----------
    raw : ndarray, (N, M)
        Linear.
    mosaic : {"rggb", "bggr", "grbg", "gbrg"}
    owner : ndarray of int, (N, M), optional
        Lens of each pixel, see `regular.owners`: pixels of other lenses, which look elsewhere, are left out. A pixel
        whose lens has none of a colour beside it takes that of any neighbour.

    Raises
    ------
    ValueError
        If the mosaic is unknown.
    """
    raw = np.asarray(raw, np.float32)
    height, width = raw.shape
    out = np.empty((height, width, 3), np.float32)
    padded = np.pad(raw, 1)
    lens = None if owner is None else np.pad(owner, 1, constant_values=-2)
    for channel, (_, places) in enumerate(phases(mosaic).items()):
        has = np.zeros((height, width), np.float32)
        for row, col in places:
            has[row::2, col::2] = 1
        known = np.pad(has, 1)
        own, own_weight, any_, any_weight = (np.zeros((height, width), np.float32) for _ in range(4))
        for i in (0, 1, 2):
            for j in (0, 1, 2):
                here = slice(i, i + height), slice(j, j + width)
                weight = known[here] * (1.0, 0.5, 0.25)[abs(i - 1) + abs(j - 1)]
                any_ += weight * padded[here]
                any_weight += weight
                if lens is not None:
                    weight = weight * (lens[here] == lens[1:-1, 1:-1])
                    own += weight * padded[here]
                    own_weight += weight
        mean = any_ / np.maximum(any_weight, 1e-9)
        if lens is not None:
            mean = np.where(own_weight > 0, own / np.maximum(own_weight, 1e-9), mean)
        out[..., channel] = np.where(has > 0, raw, mean)
    return out
