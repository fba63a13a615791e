"""Colour: the curve of sRGB (IEC 61966-2-1) and luma of BT.709."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

KR, KG, KB = 0.2126, 0.7152, 0.0722  # luma's shares of red, green and blue, BT.709 §3.2
CB, CR = 1.8556, 1.5748  # B − Y and R − Y over these are from −1/2 to 1/2
# BT.709, full range: Y, Cb and Cr from R, G and B.
YCBCR = np.array([
    [KR, KG, KB],
    [-KR / CB, -KG / CB, 0.5],
    [0.5, -KG / CR, -KB / CR],
])  # fmt: skip
VIDEO_SCALE = 4 * np.array([219, 224, 224])  # codes of 10 bit from black to white, and between the ends of a colour
VIDEO_OFFSET = 4 * np.array([16, 128, 128])


def linear(srgb: Any) -> NDArray[np.float64]:
    """Return linear light of sRGB in [0, 1], of any shape."""
    c = np.asarray(srgb, dtype=np.float64)
    return np.where(c <= 0.04045, c / 12.92, ((np.maximum(c, 0) + 0.055) / 1.055) ** 2.4)


def srgb(light: NDArray[Any]) -> NDArray[Any]:
    """Return sRGB of linear light, of any shape and of the array's precision; not clipped to [0, 1]."""
    # the bound keeps the power of what the straight foot covers from warnings of negative light
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 1e-9) ** (1 / 2.4) - 0.055)


def video_codes(rgb: NDArray[Any]) -> NDArray[np.float64]:
    """Return the YCbCr codes of 10 bit of RGB in [0, 1], (…, 3): BT.709, Y 64–940, Cb and Cr 64–960."""
    return np.floor(rgb @ YCBCR.T * VIDEO_SCALE + VIDEO_OFFSET + 0.5)


def of_video_codes(codes: NDArray[Any]) -> NDArray[np.float64]:
    """Return the RGB of `video_codes`, not clipped to [0, 1]."""
    return (codes - VIDEO_OFFSET) / VIDEO_SCALE @ np.linalg.inv(YCBCR).T


LINEAR = linear(np.arange(256) / 255).astype(np.float32)  # of codes of 8 bits
