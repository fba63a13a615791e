"""PSNR and SSIM of views by JPEG Pleno's common test conditions: YCbCr of BT.709 in integer codes of 10 bit.

Y has codes 64–940, Cb and Cr 64–960, as BT.709-6 quantises them; the peak is 1023 all the same. The PSNR is therefore
1.30 dB above that of unrounded full-range values, `q_angle_ycbcr`, before rounding.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ii_core.base.colour import video_codes

from .angle import each_view, ssim_maps, weighted_psnr
from .pair import Compared, PicturePair, Structure, picture_pair
from .quality import AngleQuality

PEAK = 1023  # of 10 bit
Floats = NDArray[np.float64]


def q_ctc_psnr(reference: Compared, decoded: Compared, *, structure: Structure | None = None) -> AngleQuality:
    """Return (6·PSNR_Y + PSNR_Cb + PSNR_Cr)/8 of each sub-image by JPEG Pleno's common test conditions, in dB.

    Parameters
    ----------
    reference, decoded : IIPicture
        Regular, of the same structure and type. Values are rounded to RGB codes of 10 bit, then to YCbCr codes.
    structure : IIPicture, IICamera or dict, optional
        Structure of pictures given as arrays (N, M, 3): that of a picture or a camera, or
        ``{"lenses": (K, L), "ei_pixels": (U, V)}``.

    Returns
    -------
    AngleQuality
        +inf for identical sub-images. The PSNR of a channel is at most 120 dB.

    Raises
    ------
    ValueError
        If the pictures differ in structure or type, are not regular, or hold a pixel that is not finite.

    References
    ----------
    ISO/IEC JTC 1/SC 29/WG 1 N84025, JPEG Pleno light field coding common test conditions, version 3.3; ITU-R
    BT.709-6, §3 and §4.
    """
    return ctc_psnr(picture_pair(reference, decoded, structure))


def q_ctc_ssim(reference: Compared, decoded: Compared, *, structure: Structure | None = None) -> AngleQuality:
    """Return the SSIM of the luma of each sub-image by JPEG Pleno's common test conditions.

    The window is a Gaussian with σ = 1.5 pixels and 11×11 samples. The mean is over all pixels; the border repeats.

    Parameters
    ----------
    reference, decoded, structure
        As for `q_ctc_psnr`.

    Returns
    -------
    AngleQuality
        1 for identical sub-images.

    Raises
    ------
    ValueError
        As `q_ctc_psnr`.

    References
    ----------
    As for `q_ctc_psnr`; Wang et al. 2004.
    """
    return ctc_ssim(picture_pair(reference, decoded, structure))


def ctc_psnr(pair: PicturePair) -> AngleQuality:
    """Return `q_ctc_psnr` of a pair."""

    def measure(a: Floats, b: Floats) -> float:
        return weighted_psnr(np.square((b - a) / PEAK).mean(axis=(0, 1)))

    return _each_view(pair, measure, float("inf"))


def ctc_ssim(pair: PicturePair) -> AngleQuality:
    """Return `q_ctc_ssim` of a pair."""

    def measure(a: Floats, b: Floats) -> float:
        luminance, contrast = ssim_maps(a[..., 0] / PEAK, b[..., 0] / PEAK, peak=1.0, border="nearest")
        return float((luminance * contrast).mean())

    return _each_view(pair, measure, 1.0)


def _each_view(pair: PicturePair, measure: Callable[[Floats, Floats], float], same: float) -> AngleQuality:
    """Return a measure of the codes of each pair of sub-images; ``same`` is that of equal ones."""
    own = None if pair.codes is None else pair.reference.with_pixels(pair.codes.astype(np.uint16)).light_field
    places = iter(np.ndindex(*pair.reference.ei_pixels[::-1]))  # the order of `each_view`

    def coded(a: Floats, b: Floats) -> float:
        v, u = next(places)
        if own is None and np.array_equal(a, b):
            return same
        found = codes(b) if own is None else own[:, :, v, u].astype(np.float64)
        wanted = codes(a)
        return same if np.array_equal(wanted, found) and own is not None else measure(wanted, found)

    return each_view(pair, coded)


def codes(rgb: Floats) -> Floats:
    """Return the YCbCr codes of RGB in [0, 1], (…, 3)."""
    return video_codes(np.floor(np.clip(rgb, 0, 1) * PEAK + 0.5) / PEAK)
