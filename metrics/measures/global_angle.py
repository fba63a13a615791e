"""Q_global and Q_angle: PSNR of the whole II-picture and of each sub-image, in one pass."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ii_core import IICamera, IIPicture
from ii_core.base import checks
from ii_core.base.jit import kernel
from ii_core.picture.picture import peak, picture_order

from .pair import Compared, PicturePair, Structure, picture_pair
from .quality import AngleQuality


def q_global(
    reference: Compared, decoded: Compared, *, mask: ArrayLike | None = None, structure: Structure | None = None
) -> float:
    """Return the PSNR of the whole picture, from the mean squared error pooled over all 3·M·N values.

    Parameters
    ----------
    reference, decoded : IIPicture
        Of the same structure and type. The peak is 255 for uint8, 65535 for uint16 and 1.0 for float32.
    mask : array_like of bool, (N, M), optional
        Pixels that count, such as those with an owner after conversion to a regular structure; all if not given.
    structure : IIPicture, IICamera or dict, optional
        Structure of pictures given as arrays (N, M, 3): that of a picture or a camera, or
        ``{"lenses": (K, L), "ei_pixels": (U, V)}``.

    Returns
    -------
    float
        dB; +inf for identical pictures, NaN if no pixel counts.

    Raises
    ------
    ValueError
        If the pictures differ in structure or type, or hold a pixel that counts and is not finite, or if the mask has
        another shape or type.

    References
    ----------
    Olsson 2008, (2.15)–(2.17).
    """
    return global_psnr(picture_pair(reference, decoded, structure, mask=mask))


def global_psnr(pair: PicturePair) -> float:
    """Return `q_global` of a pair."""
    total, count = _squared_errors(pair)
    return float(psnr(total.sum(), 3 * count.sum(), pair.dtype))


def q_angle(
    reference: Compared, decoded: Compared, *, mask: ArrayLike | None = None, structure: Structure | None = None
) -> AngleQuality:
    """Return the PSNR of each sub-image: quality over the viewing angle.

    Parameters
    ----------
    reference, decoded, mask
        As for `q_global`.
    structure : IIPicture, IICamera or dict, optional
        Structure of pictures given as arrays (N, M, 3): that of a picture or a camera, or
        ``{"lenses": (K, L), "ei_pixels": (U, V)}``.

    Returns
    -------
    AngleQuality
        ``values`` in dB, (V, U), pooled over the values of SI_{u,v} that count; +inf for an identical sub-image, NaN
        if no value counts. ``u_deg`` and ``v_deg`` if the picture has a camera.

    Raises
    ------
    ValueError
        As `q_global`.

    References
    ----------
    Olsson 2008, (2.18).
    """
    return angle_psnr(picture_pair(reference, decoded, structure, mask=mask))


def angle_psnr(pair: PicturePair) -> AngleQuality:
    """Return `q_angle` of a pair."""
    total, count = _squared_errors(pair)
    pair.reference.check_regular()
    return angle_quality(psnr(total, 3 * count, pair.dtype), pair.reference)


def mean_q_angle(
    reference: Compared, decoded: Compared, *, mask: ArrayLike | None = None, structure: Structure | None = None
) -> float:
    """Return the mean of the PSNRs of sub-images, in dB.

    It is at least `q_global`, which pools errors over all sub-images, and exceeds it by several dB if distortion
    varies with the angle. It is +inf if one sub-image is identical. Sub-images without a pixel that counts are left
    out.
    """
    return q_angle(reference, decoded, mask=mask, structure=structure).mean


def angle_quality(values: NDArray[np.float64], picture: IIPicture) -> AngleQuality:
    """Return values of each sub-image with the angles of the picture's camera, if it has one."""
    axes = () if picture.camera is None else angle_axes(picture.camera, erect=picture.erect)
    return AngleQuality(values, *axes)


@checks.checked(camera=checks.instance(IICamera), erect=checks.flag)
def angle_axes(camera: IICamera, *, erect: bool = False) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the directions of the rays of each column u and row v of an elementary image.

    A ray has the direction D = lens − pixel: to the left for a pixel to the right of the lens centre, up for a pixel
    below it. Angles decrease from left to right and increase from top to bottom; with erect images the reverse.

    Parameters
    ----------
    camera : IICamera
    erect : bool
        True for upright elementary images.

    Returns
    -------
    u_deg, v_deg : ndarray of float64, (U,) and (V,)
        ∓atan((u − (U−1)/2)·δP/Λ): positive to the right and up.

    References
    ----------
    Olsson 2008, (3.15), Figure 4.6.
    """
    u, v = camera.ei_pixels
    per_pixel = camera.pixel_pitch_mm / camera.gap_mm * (-1 if erect else 1)
    right = -(np.arange(u) - (u - 1) / 2) * per_pixel
    up = (np.arange(v) - (v - 1) / 2) * per_pixel
    return np.degrees(np.arctan(right)), np.degrees(np.arctan(up))


def psnr(squared_error: Any, count: Any, dtype: np.dtype[Any]) -> NDArray[np.float64]:
    """Return 20·log10(peak/√MSE) of a sum of squared errors over ``count`` values; NaN for none."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return 10 * np.log10(peak(dtype) ** 2 * count / np.asarray(squared_error, dtype=np.float64))


def _squared_errors(pair: PicturePair) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the sum of squared errors of each sub-image and its number of pixels, (V, U) each."""
    reference, decoded = pair.pictures
    structure: Any = reference.lenses, reference.ei_pixels
    if not reference.regular:
        structure = reference.size, (1, 1)
    a, b = picture_order(reference.pixels, *structure), picture_order(decoded.pixels, *structure)
    l, v, k, u, _ = a.shape
    total, count = np.zeros((v, u)), np.full((v, u), l * k)
    if pair.mask is None:
        sum_squared_errors(a.reshape(l, v, k, -1), b.reshape(l, v, k, -1), np.empty(3 * u), total)
    else:
        counts = np.ascontiguousarray(pair.mask).reshape(l, v, k, u)
        count[:] = 0
        sum_masked_errors(a, b, counts, total, count)
    if not math.isfinite(total.sum()):
        pair.check_finite()
    return total, count


# Not parallel: studies call it from several threads, which some numba threading layers do not support, and one
# thread already runs at the speed of memory. Sums of whole numbers below 2^53 are exact in float64.
@kernel
def sum_squared_errors(a, b, run, out):
    """out[v, u] = Σ (a − b)² over l, k and colour; the fields are [l, v, k, i], i over the U·3 values of a run."""
    for v in range(a.shape[1]):
        run[:] = 0.0
        for l in range(a.shape[0]):
            for k in range(a.shape[2]):
                for i in range(a.shape[3]):
                    d = np.float64(a[l, v, k, i]) - np.float64(b[l, v, k, i])
                    run[i] += d * d
        for u in range(out.shape[1]):
            out[v, u] = run[3 * u] + run[3 * u + 1] + run[3 * u + 2]


@kernel
def sum_masked_errors(a, b, mask, total, count):
    """Add up `sum_squared_errors` and numbers of pixels where the mask [l, v, k, u] is true."""
    for l in range(a.shape[0]):
        for v in range(a.shape[1]):
            for k in range(a.shape[2]):
                for u in range(a.shape[3]):
                    if mask[l, v, k, u]:
                        count[v, u] += 1
                        for c in range(3):
                            d = np.float64(a[l, v, k, u, c]) - np.float64(b[l, v, k, u, c])
                            total[v, u] += d * d
