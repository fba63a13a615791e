"""Lenslet mosaic: the II-picture itself, U×V pixels under each lens."""

from __future__ import annotations

import os
import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base import checks
from ..camera.camera import Pair
from ..picture.picture import IIPicture
from .grid import read_view


@checks.checked(path=checks.path, ei_pixels=checks.whole_pair)
def load_mosaic(path: str | os.PathLike[str], ei_pixels: Pair) -> IIPicture:
    """Read a lenslet picture of integer lens pitch as an II-picture.

    Warns
    -----
    UserWarning
        If pixels at the right and bottom do not fill a lens and are cut off, or if the micro-images seem to lie in a
        hexagonal lattice; see `looks_hexagonal`.

    Raises
    ------
    ValueError
        If a lens is larger than the picture.
    OSError
        If it cannot be read.
    """
    pixels = read_view(path)
    (u, v), (height, width) = ei_pixels, pixels.shape[:2]
    if not (1 <= u <= width and 1 <= v <= height):
        raise ValueError(f"lenses of {u}×{v} px do not fit {path} of {width}×{height} px")
    k, l = width // u, height // v
    if (k * u, l * v) != (width, height):
        warnings.warn(
            f"{path} has {width}×{height} px, {k}×{l} lenses of {u}×{v} px fill {k * u}×{l * v}: "
            f"{width - k * u} px at the right and {height - l * v} px at the bottom are cut off",
            stacklevel=2,
        )
    if looks_hexagonal(pixels, ei_pixels):
        warnings.warn(
            f"{path} looks hexagonal, every other row of micro-images half a lens aside: lenses of {u}×{v} px in "
            "straight rows do not fit it. Give it a camera with a hexagonal lattice, then run `raytrace-ii regular`",
            stacklevel=2,
        )
    return IIPicture(np.ascontiguousarray(pixels[: l * v, : k * u]), (k, l), (u, v))


def looks_hexagonal(pixels: NDArray[Any], ei_pixels: Pair) -> bool:
    """Return whether the borders of micro-images repeat as in a hexagonal lattice of this pitch.

    The edges of a picture repeat with its lenses. In straight rows of pitch p their spectrum has a peak at (1/p, 0).
    In a hexagonal lattice it has none there but at (1/p, ±1/(√3·p)); likewise with the axes exchanged. The
    lattice is hexagonal if its weaker peak is twice the straight one and thrice the value between the peaks.
    """
    size = min(1024, *pixels.shape[:2])
    top, left = ((n - size) // 2 for n in pixels.shape[:2])
    grey = pixels[top : top + size, left : left + size].astype(np.float32).mean(axis=2)
    for pitch, image in zip(ei_pixels, (grey, grey.T), strict=True):
        if pitch < 3 or size < 8 * pitch:
            continue
        edges = np.abs(np.diff(image, axis=1, prepend=image[:, :1]))
        window = np.hanning(size).astype(np.float32)
        power = np.abs(np.fft.fft2((edges - edges.mean()) * window * window[:, None]))

        def peak(across: float, down: float, power: NDArray[Any] = power) -> float:
            # A pitch in whole pixels has an error of up to half a pixel.
            x, y = round(across * size), round(down * size)
            reach = max(2, abs(x) // 30)
            rows, columns = np.arange(y - 2, y + 3), np.arange(x - reach, x + reach + 1)
            return float(power[np.ix_(rows % size, columns % size)].max())

        f, g = 1 / pitch, 1 / (3**0.5 * pitch)
        weaker, straight, between = min(peak(f, g), peak(f, -g)), peak(f, 0), peak(f, g / 2)
        if weaker > 2 * straight and weaker > 3 * between:
            return True
    return False
