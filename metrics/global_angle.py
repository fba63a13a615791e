"""PSNR of a whole II-picture and of each viewing angle: one pass, sums per sub-image."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ii_core import IICamera, IIPicture
from ii_core.component import light_field
from ii_core.jit import kernel


def q_global(reference: IIPicture, decoded: IIPicture, *, mask: ArrayLike | None = None) -> float:
    """PSNR of the whole picture, from the mean squared error pooled over all 3·M·N values.

    Parameters
    ----------
    reference, decoded : IIPicture
        Of the same structure and type. The peak is 255 for uint8, 65535 for uint16 and 1.0 for float32.
    mask : array_like of bool, (N, M), optional
        Which pixels count: those that a lens owns, where a structure was made regular. All, if not given.

    Returns
    -------
    float
        dB; +inf for identical pictures, NaN if no pixel counts.

    Raises
    ------
    ValueError
        If the pictures differ in structure or type, or hold a pixel that counts and is not finite, or if the mask is
        of another shape or type.

    References
    ----------
    Olsson 2008, (2.15)–(2.17).
    """
    total, count = _squared_errors(reference, decoded, mask)
    return float(psnr(total.sum(), 3 * count.sum(), reference.pixels.dtype))


def q_angle(reference: IIPicture, decoded: IIPicture, *, mask: ArrayLike | None = None) -> NDArray[np.float64]:
    """PSNR of each sub-image: quality over the viewing angle.

    Parameters
    ----------
    reference, decoded, mask
        As for `q_global`.

    Returns
    -------
    ndarray of float64, (V, U)
        dB, pooled over the 3·K·L values of SI_{u,v}, or those of them that count; +inf where it is identical, NaN
        where none counts. `angle_axes` has the angles.

    Raises
    ------
    ValueError
        As `q_global`.

    References
    ----------
    Olsson 2008, (2.18).
    """
    total, count = _squared_errors(reference, decoded, mask)
    reference.check_regular()
    return psnr(total, 3 * count, reference.pixels.dtype)


def mean_q_angle(reference: IIPicture, decoded: IIPicture, *, mask: ArrayLike | None = None) -> float:
    """Mean of the sub-images' PSNRs, dB: at least `q_global`, by whole dB where distortion varies with the angle.

    `q_global` is the PSNR of the errors pooled over all sub-images; +inf here if one sub-image is identical. Without
    those of which no pixel counts.
    """
    values = q_angle(reference, decoded, mask=mask)
    counted = values[~np.isnan(values)]
    return float(counted.mean()) if counted.size else math.nan


def angle_axes(camera: IICamera, *, erect: bool = False) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """In which direction the rays of each column u and row v of an elementary image go.

    A ray runs along D = lens − pixel: a pixel to the right of its lens's centre looks left, one below it looks
    up. Angles therefore fall from left to right and rise from top to bottom; with erect images the reverse.

    Parameters
    ----------
    camera : IICamera
    erect : bool
        For a picture of upright elementary images.

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


def peak(dtype: np.dtype[Any]) -> float:
    """The largest code value of a picture of this type."""
    return 1.0 if dtype.kind == "f" else float(np.iinfo(dtype).max)


def check_pair(reference: IIPicture, decoded: IIPicture) -> None:
    """Raise ValueError unless both are II-pictures of the same structure and type."""
    for name, picture in (("reference", reference), ("decoded", decoded)):
        if not isinstance(picture, IIPicture):
            raise ValueError(f"{name} is a {type(picture).__name__}: an IIPicture is needed")
    reference.check_same_structure(decoded)


def check_finite(reference: IIPicture, decoded: IIPicture, mask: ArrayLike | None = None) -> None:
    """Raise ValueError naming the first pixel, in reading order, that counts and is not finite."""
    counts = None if mask is None else np.asarray(mask)
    for name, picture in (("reference", reference), ("decoded", decoded)):
        for n, row in enumerate(picture.pixels):  # row by row: no mask of the picture's size
            bad = np.flatnonzero(~np.isfinite(row).all(axis=1) & (True if counts is None else counts[n]))
            if bad.size:
                raise ValueError(f"{name} pixel ({bad[0]}, {n}) is {row[bad[0]]}: finite values are needed")


def psnr(squared_error: Any, count: Any, dtype: np.dtype[Any]) -> NDArray[np.float64]:
    """20·log10(peak/√MSE) of summed squared errors over ``count`` values; NaN where nothing was counted."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return 10 * np.log10(peak(dtype) ** 2 * count / np.asarray(squared_error, dtype=np.float64))


def check_mask(mask: ArrayLike, picture: IIPicture) -> NDArray[np.bool_]:
    """The mask as an array; ValueError unless it is one of bool for every pixel of the picture."""
    given = np.asarray(mask)
    if given.dtype != bool or given.shape != picture.pixels.shape[:2]:
        raise ValueError(
            f"mask is {given.dtype} of shape {given.shape}: bool of shape {picture.pixels.shape[:2]} is needed"
        )
    return given


def _squared_errors(
    reference: IIPicture, decoded: IIPicture, mask: ArrayLike | None
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Sum of squared errors of each sub-image and the pixels it is over, (V, U) both."""
    check_pair(reference, decoded)
    structure: Any = reference.lenses, reference.ei_pixels
    if not reference.regular:
        structure = reference.size, (1, 1)
    a, b = light_field(reference.pixels, *structure), light_field(decoded.pixels, *structure)
    l, v, k, u, _ = a.shape
    total, count = np.zeros((v, u)), np.full((v, u), l * k)
    if mask is None:
        sum_squared_errors(a.reshape(l, v, k, -1), b.reshape(l, v, k, -1), np.empty(3 * u), total)
    else:
        counts = np.ascontiguousarray(check_mask(mask, reference)).reshape(l, v, k, u)
        count[:] = 0
        sum_masked_errors(a, b, counts, total, count)
    if not math.isfinite(total.sum()):
        check_finite(reference, decoded, mask)
    return total, count


# Not parallel: studies measure from several threads at once, which not every numba threading layer survives, and
# one thread already runs at memory speed. Sums of whole numbers below 2^53 are exact in float64.
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
    """As `sum_squared_errors` where the mask [l, v, k, u] says so, and over how many pixels that is."""
    for l in range(a.shape[0]):
        for v in range(a.shape[1]):
            for k in range(a.shape[2]):
                for u in range(a.shape[3]):
                    if mask[l, v, k, u]:
                        count[v, u] += 1
                        for c in range(3):
                            d = np.float64(a[l, v, k, u, c]) - np.float64(b[l, v, k, u, c])
                            total[v, u] += d * d
