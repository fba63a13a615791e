"""YCbCr PSNR, SSIM and MS-SSIM of each sub-image, as usual for light fields."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ii_core.base import checks
from ii_core.base.colour import YCBCR

from .global_angle import angle_quality
from .pair import Compared, PicturePair, Structure, picture_pair
from .quality import AngleQuality
from .view import LUMA, WINDOW

Floats = NDArray[np.float64]
# Exponents of the scales, finest first (Wang, Simoncelli and Bovik 2003).
SCALES = (0.0448, 0.2856, 0.3001, 0.2363, 0.1333)


def q_angle_ycbcr(reference: Compared, decoded: Compared, *, structure: Structure | None = None) -> AngleQuality:
    """Return (6·PSNR_Y + PSNR_Cb + PSNR_Cr)/8 of each sub-image, in dB.

    Luma and chroma are those of BT.709 in full range, unrounded.

    Parameters
    ----------
    reference, decoded : IIPicture
        Regular, of the same structure and type.
    structure : IIPicture, IICamera or dict, optional
        Structure of pictures given as arrays (N, M, 3): that of a picture or a camera, or
        ``{"lenses": (K, L), "ei_pixels": (U, V)}``.

    Returns
    -------
    AngleQuality
        +inf for identical sub-images. The PSNR of a channel is at most 120 dB, an error of 1e-6 of the peak, which is
        below rounding: distortion of luma alone has a finite value.

    Raises
    ------
    ValueError
        If the pictures differ in structure or type, are not regular, or hold a pixel that is not finite.

    References
    ----------
    JPEG Pleno Light Field Coding common test conditions (the weights 6:1:1, from video coding).
    """
    return angle_ycbcr(picture_pair(reference, decoded, structure))


def angle_ycbcr(pair: PicturePair) -> AngleQuality:
    """Return `q_angle_ycbcr` of a pair."""

    def measure(a: Floats, b: Floats) -> float:
        if np.array_equal(a, b):
            return float("inf")
        return weighted_psnr(np.square((b - a) @ YCBCR.T).mean(axis=(0, 1)))

    return each_view(pair, measure)


def weighted_psnr(mse: Floats) -> float:
    """Return (6·PSNR_Y + PSNR_Cb + PSNR_Cr)/8 of mean squared errors (3,) against a peak of 1; 120 dB a channel."""
    return float(np.dot([6, 1, 1], -10 * np.log10(np.maximum(mse, 1e-12))) / 8)


@checks.checked(scales=checks.whole)
def q_angle_ssim(
    reference: Compared, decoded: Compared, *, scales: int = 1, structure: Structure | None = None
) -> AngleQuality:
    """Return the SSIM of each sub-image; with five ``scales``, its MS-SSIM.

    Luma and window are those of `q_view`. Each further scale averages over 2×2 pixels. The result is the product of
    contrast and structure of all scales and of the luminance of the coarsest, each with the exponent of its scale.
    With fewer than five scales the exponents are normalised to a sum of 1. Negative means count as 0.

    Parameters
    ----------
    reference, decoded : IIPicture
        Regular, of the same structure and type.
    scales : int
        1 to 5.
    structure : IIPicture, IICamera or dict, optional
        Structure of pictures given as arrays (N, M, 3): that of a picture or a camera, or
        ``{"lenses": (K, L), "ei_pixels": (U, V)}``.

    Returns
    -------
    AngleQuality
        1 for identical sub-images.

    Raises
    ------
    ValueError
        If the pictures differ in structure or type, are not regular, hold a pixel that is not finite, or have
        fewer than 11·2^(scales − 1) lenses across or down.

    References
    ----------
    Wang et al. 2004; Wang, Simoncelli and Bovik 2003, (7), with their exponents.
    """
    if not isinstance(scales, int | np.integer) or not 1 <= scales <= len(SCALES):
        raise ValueError(f"scales is {scales!r}: 1 to {len(SCALES)} are needed")
    return angle_ssim(picture_pair(reference, decoded, structure), scales=int(scales))


def angle_ssim(pair: PicturePair, *, scales: int = 1) -> AngleQuality:
    """Return `q_angle_ssim` of a pair."""
    k, l = pair.reference.lenses
    needed = WINDOW * 2 ** (scales - 1)
    if min(k, l) < needed:
        raise ValueError(
            f"{k}×{l} lenses give sub-images of {k}×{l} pixels: {scales} scales need at least {needed}×{needed}"
        )
    exponents = np.array(SCALES[:scales]) / sum(SCALES[:scales])

    def measure(a: Floats, b: Floats) -> float:
        a, b = (x @ LUMA * 255 for x in (a, b))
        product = 1.0
        for i, exponent in enumerate(exponents):
            whole, contrast = _ssim(a, b)
            last = i == scales - 1
            mean = whole if last else contrast
            product *= mean if scales == 1 else max(mean, 0.0) ** exponent
            if not last:
                a, b = (_halved(x) for x in (a, b))
        return product

    return each_view(pair, measure)


def each_view(pair: PicturePair, measure: Callable[[Floats, Floats], float]) -> AngleQuality:
    """Return a measure of each pair of sub-images; pixels are divided by the peak."""
    pair.reference.check_regular()
    if pair.dtype.kind == "f":
        pair.check_finite()
    fields = [picture.light_field for picture in pair.pictures]
    u_count, v_count = pair.reference.ei_pixels
    values = np.empty((v_count, u_count))
    for v, u in np.ndindex(values.shape):
        a, b = (field[:, :, v, u].astype(np.float64) / pair.peak for field in fields)
        values[v, u] = measure(a, b)
    return angle_quality(values, pair.reference)


def _ssim(a: Floats, b: Floats) -> tuple[float, float]:
    """Return mean SSIM, and mean of its contrast–structure term, where the whole window fits."""
    side = WINDOW // 2
    luminance, contrast = (x[side:-side, side:-side] for x in ssim_maps(a, b, peak=255.0, border="reflect"))
    return float((luminance * contrast).mean()), float(contrast.mean())


def ssim_maps(a: Floats, b: Floats, *, peak: float, border: str) -> tuple[Floats, Floats]:
    """Return the luminance term and the contrast–structure term of SSIM at every pixel.

    ``border`` is the mode of `skimage.filters.gaussian` beyond the picture.
    """
    from skimage.filters import gaussian

    def mean(x: Floats) -> Floats:
        return gaussian(x, sigma=1.5, truncate=(WINDOW // 2) / 1.5, mode=border)

    c1, c2 = (0.01 * peak) ** 2, (0.03 * peak) ** 2
    ma, mb = mean(a), mean(b)
    va, vb, both = mean(a * a) - ma * ma, mean(b * b) - mb * mb, mean(a * b) - ma * mb
    contrast = (2 * both + c2) / (va + vb + c2)
    luminance = (2 * ma * mb + c1) / (ma * ma + mb * mb + c1)
    return luminance, contrast


def _halved(x: Floats) -> Floats:
    """Return means over 2×2 pixels without an odd last row or column."""
    rows, cols = x.shape[0] // 2 * 2, x.shape[1] // 2 * 2
    return x[:rows, :cols].reshape(rows // 2, 2, cols // 2, 2).mean(axis=(1, 3))
