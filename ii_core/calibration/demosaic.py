"""Demosaicing of raw pictures with a Bayer pattern."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base import checks
from ..base.parallel import over_rows
from .demosaic_kernels import green_by_direction, mean_of_neighbours, red_and_blue

MOSAICS = ("rggb", "bggr", "grbg", "gbrg")  # colours of the first two pixels of the first two rows
METHODS = ("directional", "bilinear")


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


@checks.checked(raw=checks.array, mosaic=checks.one_of(*MOSAICS), method=checks.one_of(*METHODS))
def demosaiced(
    raw: NDArray[Any], mosaic: str, owner: NDArray[Any] | None = None, *, method: str = "directional"
) -> NDArray[np.float32]:
    """R, G and B of a raw picture, (N, M, 3), from pixels of the same lens.

    Parameters
    ----------
    raw : ndarray, (N, M)
        Linear.
    mosaic : {"rggb", "bggr", "grbg", "gbrg"}
    owner : ndarray of int, (N, M), optional
        Lens of each pixel, see `regular.owners`: pixels of other lenses, which look elsewhere, are left out. A pixel
        whose lens has none of a colour beside it takes that of any neighbour.
    method : {"directional", "bilinear"}
        Directional: green at a red pixel is, in each of four directions, that of the neighbour plus half the
        difference of red from the pixel after it; directions of small differences weigh more. Red and blue are green
        plus the mean difference of the neighbours from their green. Bilinear: the mean of the neighbours that have
        the colour.

    Raises
    ------
    ValueError
        If the mosaic is unknown.

    References
    ----------
    Hamilton and Adams, US patent 5629734, 1997, whose directions are weighted here instead of chosen.
    """
    raw = np.ascontiguousarray(raw, np.float32)
    lens = np.zeros(raw.shape, np.int32) if owner is None else np.ascontiguousarray(owner, np.int32)
    colours = np.array(["rgb".index(c) for c in mosaic]).reshape(2, 2)
    out = np.empty((*raw.shape, 3), np.float32)
    height = len(raw)
    if method == "bilinear":
        over_rows(lambda first, last: mean_of_neighbours(raw, lens, colours, first, last, out), height)
        return out
    least = np.float32(0.01 * max(float(np.abs(raw).mean()), 1e-9))
    over_rows(lambda first, last: green_by_direction(raw, lens, colours, least, first, last, out), height)
    over_rows(lambda first, last: red_and_blue(raw, lens, colours, first, last, out), height)
    return out
