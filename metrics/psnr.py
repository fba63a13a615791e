"""PSNR of a whole II-picture and of each viewing angle: one pass, sums per sub-image."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core import IICamera, IIPicture
from ii_core.component import light_field
from ii_core.jit import kernel


def q_global(reference: IIPicture, decoded: IIPicture) -> float:
    """PSNR of the whole picture, from the mean squared error pooled over all 3·M·N values.

    Parameters
    ----------
    reference, decoded : IIPicture
        Of the same structure and type. The peak is 255 for uint8, 65535 for uint16 and 1.0 for float32.

    Returns
    -------
    float
        dB; +inf for identical pictures.

    Raises
    ------
    ValueError
        If the pictures differ in structure or type, or hold a pixel that is not finite.

    References
    ----------
    Olsson 2008, (2.15)–(2.17).
    """
    total = _squared_errors(reference, decoded)
    return float(psnr(total.sum(), reference.pixels.size, reference.pixels.dtype))


def q_angle(reference: IIPicture, decoded: IIPicture) -> NDArray[np.float64]:
    """PSNR of each sub-image: quality over the viewing angle.

    Parameters
    ----------
    reference, decoded : IIPicture
        As for `q_global`.

    Returns
    -------
    ndarray of float64, (V, U)
        dB, pooled over the 3·K·L values of SI_{u,v}; +inf where it is identical. `angle_axes` has the angles.

    Raises
    ------
    ValueError
        As `q_global`.

    References
    ----------
    Olsson 2008, (2.18).
    """
    total = _squared_errors(reference, decoded)
    reference.check_regular()
    return psnr(total, reference.pixels.size // total.size, reference.pixels.dtype)


def mean_q_angle(reference: IIPicture, decoded: IIPicture) -> float:
    """Mean of the sub-images' PSNRs, dB: at least `q_global`, by whole dB where distortion varies with the angle."""
    return float(q_angle(reference, decoded).mean())


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


def check_finite(reference: IIPicture, decoded: IIPicture) -> None:
    """Raise ValueError naming the first pixel, in reading order, that is not finite."""
    for name, picture in (("reference", reference), ("decoded", decoded)):
        for n, row in enumerate(picture.pixels):  # row by row: no mask of the picture's size
            bad = np.flatnonzero(~np.isfinite(row).all(axis=1))
            if bad.size:
                raise ValueError(f"{name} pixel ({bad[0]}, {n}) is {row[bad[0]]}: finite values are needed")


def psnr(squared_error: Any, count: Any, dtype: np.dtype[Any]) -> NDArray[np.float64]:
    """20·log10(peak/√MSE) of summed squared errors over ``count`` values; NaN where nothing was counted."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return 10 * np.log10(peak(dtype) ** 2 * count / np.asarray(squared_error, dtype=np.float64))


def _squared_errors(reference: IIPicture, decoded: IIPicture) -> NDArray[np.float64]:
    """Sum of squared errors of each sub-image, (V, U)."""
    check_pair(reference, decoded)
    structure: Any = reference.lenses, reference.ei_pixels
    if not reference.regular:
        structure = reference.size, (1, 1)
    a, b = light_field(reference.pixels, *structure), light_field(decoded.pixels, *structure)
    out = np.zeros((a.shape[1], a.shape[3]))
    sum_squared_errors(a.reshape(*a.shape[:3], -1), b.reshape(*b.shape[:3], -1), np.empty(a.shape[3] * 3), out)
    if not math.isfinite(out.sum()):
        check_finite(reference, decoded)
    return out


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
