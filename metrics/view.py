"""Structural similarity of what a viewer of the display sees."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ii_core import IIPicture, five_viewpoints, view_image
from ii_core.view import camera_of

from .psnr import check_finite, check_pair, peak

WINDOW = 11  # pixels across the Gaussian of Wang 2004
# BT.601, as MATLAB's rgb2gray, with which Wang's ssim.m is used.
LUMA = np.array([0.2989, 0.5870, 0.1140])


@dataclass(frozen=True)
class ViewQuality:
    """Mean SSIM of each view image, and their mean."""

    values: dict[str, float]

    @property
    def mean(self) -> float:
        """Arithmetic mean over the views."""
        return sum(self.values.values()) / len(self.values)


def q_view(reference: IIPicture, decoded: IIPicture) -> ViewQuality:
    """Mean structural similarity of five view images: front, up, down, left and right.

    The SSIM is that of Wang et al. 2004: luma on a range of 255, an 11×11 Gaussian window of σ = 1.5,
    K1 = 0.01, K2 = 0.03, averaged over the region the window fits into. Luma is BT.601, not rounded; code
    values of other types are scaled to 255 and taken as they are, without a change of gamma.

    Parameters
    ----------
    reference, decoded : IIPicture
        Of the same structure and type; the reference has a camera, from which `five_viewpoints` follow.

    Returns
    -------
    ViewQuality
        ``values`` by view name, and ``mean``; 1 for identical pictures.

    Raises
    ------
    ValueError
        If the pictures differ in structure or type, have no camera, have fewer than 11 lenses across or down,
        or hold a pixel that is not finite.

    References
    ----------
    Olsson 2008, (4.3).
    """
    check_pair(reference, decoded)
    camera = camera_of(reference)
    k, l = reference.lenses
    if min(k, l) < WINDOW:
        raise ValueError(f"{k}×{l} lenses give view images of {k}×{l} pixels: SSIM needs at least {WINDOW}×{WINDOW}")
    from skimage.metrics import structural_similarity

    other = reference.with_pixels(decoded.pixels)  # same structure, and surely the same camera
    values = {}
    for name, viewpoint in five_viewpoints(camera).items():
        a, b = _luma(reference, viewpoint), _luma(other, viewpoint)
        if not (np.isfinite(a).all() and np.isfinite(b).all()):
            check_finite(reference, decoded)
        values[name] = float(
            structural_similarity(a, b, data_range=255, gaussian_weights=True, sigma=1.5, use_sample_covariance=False)
        )
    return ViewQuality(values)


def _luma(picture: IIPicture, viewpoint: NDArray[np.float64]) -> NDArray[np.float64]:
    pixels, _ = view_image(picture, viewpoint)
    return pixels @ LUMA * (255 / peak(pixels.dtype))
