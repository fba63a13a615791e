"""Q_view: structural similarity of the five view images; error maps."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ii_core import IIPicture, five_viewpoints, view_image
from ii_core.base import checks
from ii_core.picture.picture import peak
from ii_core.picture.view import camera_of

from .global_angle import psnr
from .pair import Compared, PicturePair, Structure, picture_pair
from .quality import ViewQuality

WINDOW = 11  # pixels across the Gaussian of Wang 2004
# BT.601, as in MATLAB's rgb2gray, which is usual with Wang's ssim.m.
LUMA = np.array([0.2989, 0.5870, 0.1140])


@checks.checked(viewpoints=checks.mapping)
def q_view(
    reference: Compared,
    decoded: Compared,
    *,
    viewpoints: Mapping[str, ArrayLike] | None = None,
    mask: ArrayLike | None = None,
    structure: Structure | None = None,
) -> ViewQuality:
    """Return mean structural similarity and PSNR of five view images: front, up, down, left and right.

    SSIM follows Wang et al. 2004: luma on a range of 255, an 11×11 Gaussian window of σ = 1.5, K1 = 0.01, K2 = 0.03,
    averaged where the whole window fits. Luma is BT.601, unrounded. Code values of other types are scaled to 255
    without a change of gamma.

    Parameters
    ----------
    reference, decoded : IIPicture
        Of the same structure and type; the reference has a camera.
    viewpoints : mapping of str to array_like (3,), optional
        Viewpoints by name, mm in camera coordinates; `five_viewpoints` if not given.
    mask : array_like of bool, (N, M), optional
        Pixels that count; see `q_global`. A view pixel counts if all pixels of its interpolation count.
    structure : IIPicture, IICamera or dict, optional
        Structure of pictures given as arrays (N, M, 3): that of a picture or a camera, or
        ``{"lenses": (K, L), "ei_pixels": (U, V)}``.

    Returns
    -------
    ViewQuality
        ``values`` by view name, and ``mean``; 1 for identical pictures. View pixels whose line misses the pixel array
        are not valid: PSNR omits them, and MSSIM omits every window that contains one.

    Raises
    ------
    ValueError
        If the pictures differ in structure or type, have no camera, have fewer than 11 lenses across or down, or hold
        a pixel in view that is not finite; if there is no viewpoint, or one is not in front of the lens plane.

    References
    ----------
    Olsson 2008, (4.3).
    """
    return view_quality(picture_pair(reference, decoded, structure, mask=mask), viewpoints)


def view_quality(pair: PicturePair, viewpoints: Mapping[str, ArrayLike] | None = None) -> ViewQuality:
    """Return `q_view` of a pair."""
    camera = camera_of(pair.reference)
    k, l = pair.reference.lenses
    if min(k, l) < WINDOW:
        raise ValueError(f"{k}×{l} lenses give view images of {k}×{l} pixels: SSIM needs at least {WINDOW}×{WINDOW}")
    viewpoints = five_viewpoints(camera) if viewpoints is None else viewpoints
    if not viewpoints:
        raise ValueError("there are no viewpoints: at least one is needed")
    values, each, errors, counts = {}, {}, 0.0, 0
    for name, viewpoint in viewpoints.items():
        a, b, valid = view_pair(pair, viewpoint)
        if not (np.isfinite(a[valid]).all() and np.isfinite(b[valid]).all()):
            pair.check_finite()
        values[name] = mssim(a, b, valid)
        squared = float(np.square(a[valid].astype(np.float64) - b[valid]).sum())
        each[name] = float(psnr(squared, 3 * valid.sum(), a.dtype))
        errors, counts = errors + squared, counts + 3 * int(valid.sum())
    return ViewQuality(values, each, float(psnr(errors, counts, pair.dtype)))


def view_pair(pair: PicturePair, viewpoint_mm: ArrayLike) -> tuple[NDArray[Any], NDArray[Any], NDArray[np.bool_]]:
    """Return the view images of both pictures, (L, K, 3) each, and their valid pixels, (L, K)."""
    (a, valid), (b, _) = (view_image(picture, viewpoint_mm) for picture in pair.pictures)
    if pair.mask is not None:
        counted = np.repeat(pair.mask[..., None].astype(np.float32), 3, axis=2)
        valid &= view_image(pair.reference.with_pixels(counted), viewpoint_mm)[0][..., 0] == 1
    return a, b, valid


@checks.checked(viewpoint_mm=checks.numbers)
def error_map(reference: IIPicture, decoded: IIPicture, viewpoint_mm: Any) -> NDArray[np.float64]:
    """Return the root of the mean squared error over R, G and B at each pixel of a view image.

    Parameters
    ----------
    reference, decoded : IIPicture
        Of the same structure and type; the reference has a camera.
    viewpoint_mm : array_like, (3,)
        Camera coordinates, in front of the lens plane.

    Returns
    -------
    ndarray of float64, (L, K)
        Error over the peak; NaN if the line of sight misses the pixel array.

    Raises
    ------
    TypeError, ValueError
        If the pictures differ in structure or type, the reference has no camera, or the viewpoint is invalid.
    """
    a, b, valid = view_pair(PicturePair(reference, decoded), viewpoint_mm)
    error = np.sqrt(np.square(a.astype(np.float64) - b).mean(axis=-1)) / peak(a.dtype)
    return np.where(valid, error, np.nan)


def mssim(a: NDArray[Any], b: NDArray[Any], valid: NDArray[np.bool_]) -> float:
    """Mean SSIM of two views, over the windows whose pixels are all valid."""
    from skimage.metrics import structural_similarity

    x, y = (image @ LUMA * (255 / peak(image.dtype)) for image in (a, b))
    options = {"data_range": 255, "gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False}
    if valid.all():
        return float(structural_similarity(x, y, **options))
    side = WINDOW // 2
    x, y = (np.where(valid, image, 0.0) for image in (x, y))
    _, similarity = structural_similarity(x, y, full=True, **options)
    whole = np.lib.stride_tricks.sliding_window_view(valid, (WINDOW, WINDOW)).all(axis=(2, 3))
    return float(similarity[side:-side, side:-side][whole].mean()) if whole.any() else math.nan
