"""Planes of the colours of views, in integer eighths of an 8-bit code: principal axes, or Y, Cb and Cr of BT.709.

The latter are scaled for the measure of `psnr_yuv`, which `si-lf` is tuned for.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core.base.colour import CB, CR, KB, KG, KR, YCBCR, video_codes
from ii_core.base.jit import lean_kernel

from ..volume import principal_axes
from .warp import clamped

MOST_COMPARED = 1 << 22  # pixels of which the principal axes are found
ONE = 1 << 14  # unit of matrices
SCALE = 64  # unit of the scales of Cb and Cr
PEAK = 1023  # of 10 bit
LEAST_ERROR = 1e-12  # 120 dB
FIRST_SCALES = 35, 35  # of Cb and Cr, with which a trial begins
LEAST_SCALE, MOST_SCALE = 12, SCALE
# From few to many views scales grow to so many times those of the measure, by the logarithm of their number: scenes
# of 256 views then take 0.4–1.6 % less by CTC and 11–17 % less by RGB.
FACTOR, FEW_VIEWS, MANY_VIEWS = 1.3, 25, 80
# RGB of a unit of the planes √3·Y, √3·Cb and √3·Cr, the latter two in 2^-20: grey has the same length in both spaces.
_COLOURS = np.rint(
    np.array([[1 / SCALE] * 3, [0, -KB * CB / KG, CB], [CR, -KR * CR / KG, 0]]) * (ONE * SCALE / 3**0.5)
).astype(np.int32)


def bt709_axes(scales: tuple[int, int]) -> NDArray[np.int32]:
    """Return √3·Y and the scaled √3·Cb and √3·Cr of RGB by rows, in units of 2^-14."""
    factors = np.array([SCALE, *scales])[:, None] / SCALE
    return np.rint(YCBCR * factors * (3**0.5 * ONE)).astype(np.int32)


def bt709_colours(scales: tuple[int, int]) -> NDArray[np.int32]:
    """Return RGB of each plane of `bt709_axes` by rows, in units of 2^-14, by integer division."""
    divisors = np.array([1, *np.maximum(scales, 1)], np.int32)[:, None]
    return (_COLOURS + divisors // 2) // divisors


def better_scales(scales: tuple[int, int], errors: NDArray[np.float64], views: int) -> tuple[int, int]:
    """Return scales of Cb and Cr of a number of views by the squared errors (3,) of the planes that others gave.

    The measure is a mean of logarithms: one more of squared error changes it by 6/8 of the error of Y, and by 1/8 of
    that of Cb. Planes are scaled so that equal squared errors in them change it equally.
    """
    least = np.maximum(errors, 1.0)
    share = np.log(views / FEW_VIEWS) / np.log(MANY_VIEWS / FEW_VIEWS)
    factor = FACTOR ** min(max(share, 0), 1)
    found = [factor * scale * np.sqrt(least[0] / (6 * error)) for scale, error in zip(scales, least[1:], strict=True)]
    cb, cr = (int(min(max(round(float(scale)), LEAST_SCALE), MOST_SCALE)) for scale in found)
    return cb, cr


def psnr_yuv(original: NDArray[np.uint8 | np.uint16], decoded: NDArray[np.uint8 | np.uint16]) -> float:
    """Return (6·PSNR_Y + PSNR_Cb + PSNR_Cr)/8 of a view, in dB; a channel has 120 dB at most.

    `metrics.q_ctc_psnr` computes the same independently.
    """
    error = np.square((_codes(decoded) - _codes(original)) / PEAK).mean(axis=(0, 1))
    return float(np.dot([6, 1, 1], -10 * np.log10(np.maximum(error, LEAST_ERROR))) / 8)


def _codes(pixels: NDArray[np.uint8 | np.uint16]) -> NDArray[np.float64]:
    top = np.iinfo(pixels.dtype).max
    return video_codes(np.floor(pixels * (PEAK / top) + 0.5) / PEAK)


def detail_axes(pixels: NDArray[Any], grid: tuple[int, int]) -> NDArray[np.int32]:
    """Return the rotation to the principal axes of differences between neighbouring samples of a view.

    What prediction misses is detail, and its colours are not spread as those of areas are: of areas alone they are
    sky and ground.

    Parameters
    ----------
    pixels : ndarray of uint8 or uint16, (N, M, 3)
    grid : (int, int)
        Rows and columns of views, which are interleaved.

    Returns
    -------
    ndarray of int32, (3, 3)
        Axes by rows, by falling variance, in units of 2^-14.
    """
    rows, cols = grid
    views = pixels.reshape(pixels.shape[0] // rows, rows, pixels.shape[1] // cols, cols, 3)
    some = views[:, :: max(1, pixels.size // 3 // MOST_COMPARED)].astype(np.int32)
    detail = np.concatenate([np.diff(some, axis=axis).reshape(-1, 3) for axis in (0, 2)])
    return principal_axes(detail if len(detail) else pixels).astype(np.int32)


@lean_kernel
def gather(pixels, grid, row, col, axes, sixteen, out):
    """out (3, H, W) = the planes of a view; sides beyond the view repeat its border.

    Parameters
    ----------
    pixels : ndarray of uint8 or uint16, (N, M, 3)
    grid : (int, int)
        Rows and columns of views, which are interleaved.
    axes : ndarray of int32, (3, 3)
        Planes of RGB by rows, in units of 2^-14.
    sixteen : bool
        Whether pixels have 16 bits.
    """
    height, width = pixels.shape[0] // grid[0], pixels.shape[1] // grid[1]
    middle, shift = (1 << 15, 19) if sixteen else (1 << 7, 11)
    for y in range(out.shape[1]):
        for x in range(out.shape[2]):
            i, j = clamped(y, height) * grid[0] + row, clamped(x, width) * grid[1] + col
            for p in range(3):
                total = np.int64(1 << (shift - 1))
                for c in range(3):
                    total += np.int64(axes[p, c]) * (np.int64(pixels[i, j, c]) - middle)
                out[p, y, x] = total >> shift


@lean_kernel
def scatter(views, at, grid, row, col, colours, sixteen, pixels):
    """The inverse of `gather`, rounded and clipped; ``colours`` are RGB of each plane by rows, in units of 2^-14."""
    height, width = pixels.shape[0] // grid[0], pixels.shape[1] // grid[1]
    middle, shift, top = (1 << 15, 9, 65535) if sixteen else (1 << 7, 17, 255)
    for y in range(height):
        for x in range(width):
            i, j = y * grid[0] + row, x * grid[1] + col
            for c in range(3):
                total = np.int64(1 << (shift - 1))
                for p in range(3):
                    total += np.int64(colours[p, c]) * np.int64(views[at, p, y, x])
                pixels[i, j, c] = min(max((total >> shift) + middle, 0), top)
