"""Wave optics of one lenslet, and point-spread functions of pixels.

Scalar fields in one or two dimensions; a field in one dimension is that of a slit with a cylinder lens, which is also
each axis of a square lens near the axis. Lengths in mm, intensities in shares of the light through the lens.

References
----------
Goodman, Introduction to Fourier Optics, §3.10 and §4.4; Matsushima and Shimobaba 2009, (20): the band limit.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.checks import (
    MOST_MM,
    array,
    checked,
    instance,
    length,
    number,
    numbers_in_a_row,
    place,
    whole_from,
    within,
)
from ..base.colour import linear, srgb
from ..base.extras import Lazy
from ..camera.camera import IICamera
from ..picture.picture import IIPicture

ndimage, special = Lazy("scipy.ndimage"), Lazy("scipy.special")
WAVELENGTHS_NM = (610.0, 550.0, 465.0)  # of sRGB's primaries, by dominant wavelength to 5 nm
SAMPLES = 6.0  # for each period of the fastest phase
ACROSS = 64  # samples across a lens, at least: small, slow ones have hardly any phase
WINDOW = {1: 40.0, 2: 24.0}  # of a field, in λΛ/δL beyond lens and blur; round lenses need the square of it
MOST = {1: 1 << 20, 2: 1 << 12}  # samples across a field, by its dimensions
ENERGY = 0.9  # of a point-spread function, within what counts as its width
Floats = NDArray[np.float64]


@checked(step_mm=number, wavelength_mm=number, distance_mm=number)
def angular_spectrum(
    field: NDArray[Any], step_mm: float, wavelength_mm: float, distance_mm: float
) -> NDArray[np.complex128]:
    """Propagate a scalar field to a parallel plane.

    Parameters
    ----------
    field : ndarray of complex, (n,) or (n, m)
        Samples at intervals of ``step_mm``. It is zero beyond them.
    wavelength_mm, distance_mm : float

    Returns
    -------
    ndarray of complex
        The field at the distance. Frequencies that would come round the periodic window are left out.

    Raises
    ------
    ValueError
        If a length is not positive, or the field has no or more than two dimensions.
    """
    step, wavelength = length("step_mm", step_mm), length("wavelength_mm", wavelength_mm)
    distance = length("distance_mm", distance_mm)
    try:
        field = np.asarray(field, np.complex128)
    except (TypeError, ValueError, OverflowError) as error:
        raise TypeError(f"field is no array of numbers: {error}") from None
    if field.ndim not in (1, 2) or not field.size:
        raise ValueError(f"field is {field.shape}: samples in one or two dimensions are needed")
    squared, inside = np.zeros(()), np.ones((), bool)
    for axis, count in enumerate(field.shape):
        frequency = np.fft.fftfreq(count, step).reshape([-1 if a == axis else 1 for a in range(field.ndim)])
        limit = 1 / (wavelength * math.hypot(2 * distance / (count * step), 1))
        squared, inside = squared + frequency**2, inside & (abs(frequency) <= limit)
    along = np.sqrt(np.maximum(1 / wavelength**2 - squared, 0))
    turned = np.exp(2j * math.pi * distance * along) * (inside & (squared < 1 / wavelength**2))
    return np.fft.ifftn(np.fft.fftn(field) * turned)


@checked(width_mm=number, gap_mm=number, wavelength_nm=number, dimensions=whole_from(1, 2))
def lens_spread(
    width_mm: float,
    gap_mm: float,
    wavelength_nm: float,
    *,
    focal_mm: float | None = None,
    depth_mm: float = math.inf,
    spherical_mm: float = 0.0,
    dimensions: int = 1,
) -> tuple[Floats, Floats]:
    """Intensity that a point on the axis of a lens leaves on the pixel plane, by the wave.

    The lens turns a plane wave into the sphere about its focus; the source is a sphere about the point.

    Parameters
    ----------
    width_mm : float
        Of the slit, or diameter of the round lens in two dimensions.
    gap_mm : float
        Λ, from the lens to the pixel plane.
    wavelength_nm : float
    focal_mm : float, optional
        f; Λ if not given.
    depth_mm : float
        From the lens to the point.
    spherical_mm : float
        W₀₄₀: third-order spherical aberration of the wavefront at the rim. Positive if rays of the rim cross the axis
        before the focus, as behind a single lens of glass.
    dimensions : {1, 2}
        A slit, or a round lens.

    Returns
    -------
    x : ndarray, (n,)
        Places on the pixel plane from the axis, mm.
    intensity : ndarray, (n,) or (n, n)
        Share of the light through the lens. The outer rings, 1–2 % of the light, lie beyond ``x``.

    Raises
    ------
    ValueError
        If a length is not positive or the field would need more samples across than `MOST`: round lenses of a Fresnel
        number below 0.1, or of some 100 and more.
    """
    width, gap, wavelength = length("width_mm", width_mm), length("gap_mm", gap_mm), _mm(wavelength_nm)
    focal = gap if focal_mm is None else length("focal_mm", focal_mm)
    depth_mm = _depth(depth_mm)
    error = within("spherical_mm", spherical_mm, -width, width)
    blur = abs(defocus_mm(width, gap, focal_mm=focal, depth_mm=depth_mm)) + 16 * abs(error) * gap / width
    slope = 8 * abs(error) / width  # of the phases of lens, source and aberration at the rim
    slope += sum(width / 2 / math.hypot(width / 2, one) for one in (min(gap, focal, depth_mm), gap))
    step = min(wavelength / slope / SAMPLES * 2, width / ACROSS)
    window = 2 * (width + blur) + WINDOW[dimensions] * wavelength * gap / width
    count = 1 << math.ceil(math.log2(window / step))
    if count > MOST[dimensions]:
        raise ValueError(
            f"a lens {width:g} mm wide and {gap:g} mm from the pixels needs a field of {count} samples across, "
            f"{MOST[dimensions]} are computed: one of a Fresnel number δL²/4λΛ nearer to 1 is needed"
        )
    x: Floats = (np.arange(count) - count // 2) * np.float64(step)
    squared = x * x if dimensions == 1 else x[:, None] ** 2 + x * x
    phase = -(np.sqrt(squared + focal**2) - focal)
    if math.isfinite(depth_mm):
        phase += np.sqrt(squared + depth_mm**2) - depth_mm
    phase -= error * (4 * squared / width**2) ** 2
    # a sample on the rim counts by the share of it within
    rim = np.clip((width / 2 - np.sqrt(squared)) / step + 0.5, 0, 1)
    field = angular_spectrum(rim * np.exp(2j * math.pi / wavelength * phase), step, wavelength, gap)
    # by the lens's own light: samples on the rim carry the right amplitude but, squared, too little light
    cell = step / width if dimensions == 1 else 4 / math.pi * (step / width) ** 2
    return x, np.asarray(np.abs(field) ** 2 * cell, np.float64)


@checked(width_mm=number, gap_mm=number)
def defocus_mm(width_mm: float, gap_mm: float, *, focal_mm: float | None = None, depth_mm: float = math.inf) -> float:
    """Width of a point's image by rays: δL·(1 − Λ/z'), 1/z' = 1/f − 1/z; negative if it is in focus behind Λ."""
    width, gap = length("width_mm", width_mm), length("gap_mm", gap_mm)
    vergence = 1 / (gap if focal_mm is None else length("focal_mm", focal_mm)) - 1 / _depth(depth_mm)
    return width * (gap * vergence - 1)


@checked(x=array, width_mm=number, gap_mm=number, wavelength_nm=number, dimensions=whole_from(1, 2))
def diffraction_limit(
    x: NDArray[Any], width_mm: float, gap_mm: float, wavelength_nm: float, dimensions: int = 1
) -> Floats:
    """Intensity in focus by closed form, 1 on the axis: sinc² of a slit, Airy's pattern of a round lens.

    By the sine of the angle, v = π·δL·sin θ/λ: sin²v/v², or (2·J₁(v)/v)².
    """
    x = np.asarray(x, np.float64)
    v = math.pi * length("width_mm", width_mm) / _mm(wavelength_nm) * x / np.hypot(x, length("gap_mm", gap_mm))
    safe = np.where(v == 0, 1.0, v)
    return np.where(v == 0, 1.0, (np.sin(safe) / safe if dimensions == 1 else 2 * special.j1(safe) / safe) ** 2)


def model_spread(
    x: NDArray[Any],
    width_mm: float,
    gap_mm: float,
    wavelength_nm: float,
    *,
    focal_mm: float | None = None,
    depth_mm: float = math.inf,
) -> Floats:
    """The model of a slit's point-spread function: the box of `defocus_mm` folded with `diffraction_limit`.

    Parameters
    ----------
    x : ndarray, (n,)
        Evenly spaced places about the axis, mm; other parameters as `lens_spread`.

    Returns
    -------
    ndarray, (n,)
        Of sum 1.
    """
    x = _places(x)
    step = length("x: step", x[1] - x[0])
    blur = abs(defocus_mm(width_mm, gap_mm, focal_mm=focal_mm, depth_mm=depth_mm))
    if blur / step > MOST[1]:
        raise ValueError(
            f"x has a step of {step:g} mm, the disk of defocus is {blur:g} mm wide: a wider step is needed"
        )
    limit = diffraction_limit(x, width_mm, gap_mm, wavelength_nm)
    # the box has the width of the blur to a fraction of a sample
    reach = math.ceil(blur / 2 / step) + 1
    box = np.clip((blur / 2 - abs(np.arange(-reach, reach + 1) * step)) / step + 0.5, 0, 1)
    folded = np.convolve(limit, box / box.sum(), mode="same") if blur > 0 else limit
    return folded / folded.sum()


@checked(pixel_mm=number, reach=whole_from(0, MOST[2]))
def pixel_kernel(x: NDArray[Any], intensity: NDArray[Any], pixel_mm: float, reach: int) -> Floats:
    """Light of a pixel-wide stripe on the pixels beside it, (2·reach + 1,), the stripe's own in the middle.

    The spread is averaged over the stripe and over the pixel: over a triangle of twice the pixel's width. The kernel
    has the sum 1: what lies beyond its reach is shared out.

    Raises
    ------
    ValueError
        If the pixel is not positive, or places and intensities are not as many finite numbers.
    """
    x = _places(x)
    intensity = _intensity(x, intensity)
    offsets = np.arange(-reach, reach + 1) * length("pixel_mm", pixel_mm)
    # by the triangle's transform, sinc²: the triangle itself has a kink that samples miss
    step = (x[-1] - x[0]) / (len(x) - 1)
    f = np.fft.rfftfreq(len(x), step)
    light = np.fft.rfft(intensity) * np.sinc(f * pixel_mm) ** 2
    light[1:] *= 2  # frequencies below 0
    kernel = (np.exp(2j * math.pi * f * (offsets[:, None] - x[0])) @ light).real
    kernel[abs(offsets - x.mean()) > len(x) * step / 2] = 0  # no light is known there
    return kernel / kernel.sum()


def spread_width(x: NDArray[Any], intensity: NDArray[Any]) -> float:
    """Width, mm, about the axis that holds `ENERGY` of a point-spread function."""
    x = _places(x)
    intensity = _intensity(x, intensity)
    order = np.argsort(abs(x), kind="stable")
    last = int(np.searchsorted(np.cumsum(intensity[order]), ENERGY))
    return 2 * float(abs(x[order[min(last, len(x) - 1)]]))


@checked(picture=instance(IIPicture), camera=instance(IICamera))
def lens_blurred(
    picture: IIPicture,
    camera: IICamera,
    *,
    depth_mm: float = math.inf,
    wavelengths_nm: tuple[float, float, float] = WAVELENGTHS_NM,
) -> IIPicture:
    """The picture with each elementary image blurred by its lens, as the wave does, in linear light.

    Parameters
    ----------
    picture : IIPicture
        Rendered through points, one ray or a mean over each pixel.
    camera : IICamera
        Whose lens pitch, pixel pitch and gap count; a square lens focused at infinity. It may be of another scale.
    depth_mm : float
        From the lens to the scene: everything is blurred as a point there.
    wavelengths_nm : three floats
        Of red, green and blue.

    Raises
    ------
    ValueError
        If the structures do not match, a wavelength is not positive, or the spread is wider than an elementary image.
    """
    picture.check_regular()
    if camera.ei_pixels != picture.ei_pixels:
        raise ValueError(
            f"camera has {camera.ei_pixels} pixels a lens, the picture {picture.ei_pixels}: the same is needed"
        )
    waves = place("wavelengths_nm", wavelengths_nm, 3, 1e15)
    if min(waves) < 1e-3:
        raise ValueError(f"wavelengths_nm are {waves}: three of at least 0.001 nm are needed")
    (k, l), (u, v) = picture.lenses, picture.ei_pixels
    kernels = []
    for wavelength in waves:
        for width, size in zip(camera.lens_pitch_mm, (u, v), strict=True):
            x, spread = lens_spread(width, camera.gap_mm, wavelength, depth_mm=depth_mm)
            wide = spread_width(x, spread) / camera.pixel_pitch_mm
            if wide > size:
                raise ValueError(
                    f"point-spread function at {wavelength:g} nm is {wide:.1f} pixels wide, an elementary image "
                    f"{size}: a wider lens, a smaller gap or a larger depth_mm is needed"
                )
            kernels.append(pixel_kernel(x, spread, camera.pixel_pitch_mm, size))
    out = np.empty_like(picture.pixels)
    for row in range(l):  # a row of lenses at a time
        block = picture.pixels[row * v : (row + 1) * v].reshape(v, k, u, 3)
        light = block if block.dtype.kind == "f" else linear(block / np.iinfo(block.dtype).max)
        done = np.empty(light.shape)
        for c in range(3):
            across = ndimage.correlate1d(light[..., c], kernels[2 * c], axis=2, mode="nearest")
            done[..., c] = ndimage.correlate1d(across, kernels[2 * c + 1], axis=0, mode="nearest")
        if block.dtype.kind != "f":
            done = np.rint(np.clip(srgb(done), 0, 1) * np.iinfo(block.dtype).max)
        out[row * v : (row + 1) * v] = done.reshape(v, k * u, 3).astype(out.dtype)
    return picture.with_pixels(out)


def _mm(wavelength_nm: float) -> float:
    return within("wavelength_nm", wavelength_nm, 1e-3, 1e15) * 1e-6


def _depth(depth_mm: float) -> float:
    """Return the distance to a point; infinity beyond the range of lengths."""
    depth = number("depth_mm", depth_mm)
    if not depth > 0:
        raise ValueError(f"depth_mm is {depth:g}: a positive distance, or infinity, is needed")
    return math.inf if depth > MOST_MM else length("depth_mm", depth)


def _places(x: Any) -> Floats:
    """Return places on the pixel plane as floats."""
    numbers_in_a_row("x", x)
    places = np.asarray(x, np.float64)
    if len(places) < 2 or not np.isfinite(places).all():
        raise ValueError(f"x has {len(places)} places: at least two finite numbers are needed")
    return places


def _intensity(x: Floats, intensity: Any) -> Floats:
    """Return the light at places as floats."""
    numbers_in_a_row("intensity", intensity)
    light = np.asarray(intensity, np.float64)
    if light.shape != x.shape or not np.isfinite(light).all():
        raise ValueError(f"intensity is {light.shape}, x {x.shape}: a finite number for every place is needed")
    return light
