"""The measure that `si-lf` is tuned for: PSNR-YUV of JPEG Pleno's common test conditions, and scales of planes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ii_core.base.colour import video_codes

from .planes import SCALE

PEAK = 1023  # of 10 bit
LEAST_ERROR = 1e-12  # 120 dB
# Scales of the planes of Cb and Cr with which a trial begins, their least, and their most.
START, LEAST, MOST = 35, 12, SCALE
# From few to many views scales grow to so many times those of the measure, by the logarithm of their number: scenes
# of 256 views then take 0.4–1.6 % less by CTC and 11–17 % less by RGB.
FACTOR, FEW_VIEWS, MANY_VIEWS = 1.3, 25, 80


def psnr_yuv(original: NDArray[np.uint8 | np.uint16], decoded: NDArray[np.uint8 | np.uint16]) -> float:
    """Return (6·PSNR_Y + PSNR_Cb + PSNR_Cr)/8 of a view, in dB; a channel has 120 dB at most.

    `metrics.q_ctc_psnr` computes the same independently.
    """
    error = np.square((_codes(decoded) - _codes(original)) / PEAK).mean(axis=(0, 1))
    return float(np.dot([6, 1, 1], -10 * np.log10(np.maximum(error, LEAST_ERROR))) / 8)


def _codes(pixels: NDArray[np.uint8 | np.uint16]) -> NDArray[np.float64]:
    top = np.iinfo(pixels.dtype).max
    return video_codes(np.floor(pixels * (PEAK / top) + 0.5) / PEAK)


def better_scales(scales: tuple[int, int], errors: NDArray[np.float64], views: int) -> tuple[int, int]:
    """Return scales of Cb and Cr of a number of views by the squared errors (3,) of the planes that others gave.

    The measure is a mean of logarithms: one more of squared error changes it by 6/8 of the error of Y, and by 1/8 of
    that of Cb. Planes are scaled so that equal squared errors in them change it equally.
    """
    least = np.maximum(errors, 1.0)
    share = np.log(views / FEW_VIEWS) / np.log(MANY_VIEWS / FEW_VIEWS)
    factor = FACTOR ** min(max(share, 0), 1)
    found = [factor * scale * np.sqrt(least[0] / (6 * error)) for scale, error in zip(scales, least[1:], strict=True)]
    cb, cr = (int(min(max(round(float(scale)), LEAST), MOST)) for scale in found)
    return cb, cr
