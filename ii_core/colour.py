"""Colour: the curve of sRGB (IEC 61966-2-1) and luma of BT.709."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

KR, KG, KB = 0.2126, 0.7152, 0.0722  # luma's shares of red, green and blue, BT.709 §3.2
CB, CR = 1.8556, 1.5748  # B − Y and R − Y over these are from −1/2 to 1/2


def linear(srgb: Any) -> NDArray[np.float64]:
    """Return linear light of sRGB in [0, 1], of any shape."""
    c = np.asarray(srgb, dtype=np.float64)
    return np.where(c <= 0.04045, c / 12.92, ((np.maximum(c, 0) + 0.055) / 1.055) ** 2.4)


def srgb(light: NDArray[Any]) -> NDArray[Any]:
    """Return sRGB of linear light, of any shape and of the array's precision; not clipped to [0, 1]."""
    # the bound keeps the power of what the straight foot covers from warnings of negative light
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 1e-9) ** (1 / 2.4) - 0.055)


LINEAR = linear(np.arange(256) / 255).astype(np.float32)  # of codes of 8 bits
