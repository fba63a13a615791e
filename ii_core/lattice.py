"""Where pixels and lens centres lie along one axis of a rectangular array, and which lens a pixel is under."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def pixel_positions(
    index: NDArray[Any], offset: NDArray[np.float64], pitch_mm: float, size_mm: float
) -> NDArray[np.float64]:
    """Distance of a point in each pixel from the array's centre, growing with the index (3.13)."""
    return (index + offset) * pitch_mm - size_mm / 2


def lens_centres(index: NDArray[Any], pitch_mm: float, size_mm: float) -> NDArray[np.float64]:
    """Distance of each lens centre from the array's centre, growing with the index (3.16)."""
    return (index + 0.5) * pitch_mm - size_mm / 2


def nearest_lens(pixel: NDArray[Any], pixels: int, lenses: int) -> NDArray[Any]:
    """Index of the lens nearest to each pixel's centre (3.19), in whole numbers so that no tie can be rounded."""
    return pixel // (pixels // lenses)
