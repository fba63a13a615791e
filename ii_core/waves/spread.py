"""Point-spread functions as maps beside L and D: one for every ray, of defocus, aberration and diffraction.

Three widths make the spread of a ray: the disk of geometric defocus, that of spherical aberration, and the first dark
ring of Airy's pattern. The field of a round lens with these widths gives the intensity. It blurs a picture rendered
through points, in linear light. A display is the same with the eye in place of the scene: by reciprocity the light of
a pixel spreads towards the eye as the eye's point would spread over the pixels.

References
----------
Goodman, Introduction to Fourier Optics, §4.4.2 and §6.4: Airy's pattern and its transfer function; Welford,
Aberrations of Optical Systems, §7.2: transverse aberration.
"""

from __future__ import annotations

import math
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.checks import checked, instance, length, number, numbers, place
from ..base.colour import linear, srgb
from ..base.extras import Lazy
from ..base.jit import exact_kernel
from ..base.parallel import over_rows
from ..camera.camera import IICamera
from ..camera.optics import Lenslet, SphericalLenslet
from ..picture.picture import IIPicture, peak
from .pupil import traced_spread
from .wave import WAVELENGTHS_NM

special = Lazy("scipy.special")
FIRST_ZERO = 1.2196698912665045  # of Airy's pattern, in λΛ/δL
RING_SAMPLES = 2.6  # across a first ring: twice the highest frequency, 1.22 over it, and a margin
ACROSS = 16  # samples of the field across a pupil's radius, at least
SAMPLES = 512  # of a transfer by rays, across
STEPS = 16  # of widths: 1/32 pixel where they are small, 6 % where they are large
NODES, TURNS, ROWS = 64, 12.0, 64  # Gauss's nodes, for so many turns of the phase; frequencies at once
MOST_FREQUENCY = 100.0  # periods a pixel: beyond, a spot of rays passes next to nothing, and little of it counts
LEAST_RING = 0.1  # pixels: narrower rings need no field, but many samples of it
ENERGY = 0.999  # of a kernel's light, within its reach
LEVELS = 1 << 16  # steps of a width: sinh(LEVELS/2/STEPS) pixels is beyond every length


class SpreadMaps(NamedTuple):
    """Point-spread function of every ray, on the pixel plane.

    Attributes
    ----------
    defocus_mm : ndarray of float32, (N, M)
        Diameter of the disk of geometric defocus.
    airy_mm : ndarray of float32, (N, M, 3)
        Radius of the first dark ring for red, green and blue.
    pixel_pitch_mm : float
    aberration_mm : ndarray of float32, (N, M), optional
        Diameter of the disk of third-order spherical aberration, where rays near the axis focus: 16·W₀₄₀·Λ/δL, W₀₄₀
        the wavefront's error at the rim. Negative where rays of the rim miss to the other side than by defocus. An
        ideal lens has none.
    """

    defocus_mm: NDArray[np.float32]
    airy_mm: NDArray[np.float32]
    pixel_pitch_mm: float
    aberration_mm: NDArray[np.float32] | None = None


@checked(camera=instance(IICamera), depth_mm=numbers, focal_mm=number, wavelengths_nm=numbers)
def spread_maps(
    camera: IICamera,
    depth_mm: ArrayLike = math.inf,
    *,
    focal_mm: float | None = None,
    wavelengths_nm: ArrayLike = WAVELENGTHS_NM,
) -> SpreadMaps:
    """Return the point-spread function of every ray of a camera, or of every pixel of a display.

    Parameters
    ----------
    camera : IICamera
        Of a regular structure. Its lenses are round, of the smaller pitch or of their own aperture.
    depth_mm : float or array_like, (N, M)
        z in camera coordinates of what each ray meets, as `raytrace_ii.render` gives it; or of the eye before a
        display. NaN, where nothing is hit, is infinity.
    focal_mm : float, optional
        f of ideal lenses in place of the camera's. If not given, spherical lenslets are traced, ideal ones have
        their own f, and others Λ, which focuses at infinity.
    wavelengths_nm : three floats
        Of red, green and blue.

    Returns
    -------
    SpreadMaps
        An oblique ray at the angle θ has a ring 1/cos²θ as wide, the mean along and across its slant.

    Raises
    ------
    ValueError
        If the structure is not regular, a depth is that of the lens plane or inside the lens, the map has another
        size, or a length is not positive.
    """
    if not camera.regular:
        raise ValueError("camera is not regular: run `raytrace-ii regular`")
    waves = place("wavelengths_nm", wavelengths_nm, 3, 1e15)
    if min(waves) < 1e-3:
        raise ValueError(f"wavelengths_nm are {waves}: three of at least 0.001 nm are needed")
    width, height = camera.pixels
    z = np.asarray(depth_mm, np.float64)
    if z.shape not in ((), (height, width)):
        raise ValueError(f"depth_mm is {z.shape}: one number or a map of {(height, width)} is needed")
    distance = np.abs(np.where(np.isnan(z), np.inf, z) - camera.origin_mm[2] - camera.gap_mm)
    if not distance.all():
        raise ValueError("depth_mm holds that of the lens plane: a point before or behind it is needed")
    lens = camera.lens_model
    focal, aperture = camera.gap_mm, min(camera.lens_pitch_mm)
    if isinstance(lens, Lenslet | SphericalLenslet):
        aperture = lens.aperture_mm or aperture
    if isinstance(lens, Lenslet):
        focal = float(np.mean(lens.focal_mm))
    focal = focal if focal_mm is None else length("focal_mm", focal_mm)
    disk, aberration = (1 - camera.gap_mm * (1 / focal - 1 / distance)) * aperture, None
    if isinstance(lens, SphericalLenslet) and focal_mm is None:
        disk, traced = traced_spread(camera, lens, aperture, distance)
        aberration = np.where(disk < 0, -traced, traced).astype(np.float32)
    _, direction = camera.rays()
    flat = direction[..., 2] ** 2 / np.square(direction).sum(axis=-1)
    ring = FIRST_ZERO * np.array(waves) * 1e-6 * camera.gap_mm / aperture
    return SpreadMaps(
        np.broadcast_to(np.abs(disk), (height, width)).astype(np.float32),
        (ring / flat[..., None]).astype(np.float32),
        camera.pixel_pitch_mm,
        aberration,
    )


@checked(picture=instance(IIPicture), maps=instance(SpreadMaps))
def spread_picture(picture: IIPicture, maps: SpreadMaps) -> IIPicture:
    """Return the picture with the light of every pixel spread by its point-spread function.

    Light stays under its lens: a function that is cut at the border of the elementary image keeps its light, and what
    falls farther away fills the image evenly. Widths are rounded to steps of 1/32 pixel, or 6 % where that is more.

    Parameters
    ----------
    picture : IIPicture
        Rendered through points. Integers are sRGB, floats linear light.
    maps : SpreadMaps
        Of the same size.

    Raises
    ------
    ValueError
        If the structure is not regular or the sizes differ.
    """
    picture.check_regular()
    if maps.defocus_mm.shape != picture.pixels.shape[:2]:
        raise ValueError(f"maps are {maps.defocus_mm.shape}, the picture {picture.pixels.shape[:2]}: equal is needed")
    (u, v), pixels = picture.ei_pixels, picture.pixels
    out = np.empty_like(pixels)
    for c in range(3):
        found, level = np.unique(_codes(maps, c), return_inverse=True)
        table = [_kernel(*_widths(code), max(u, v)) for code in found.tolist()]
        reach = np.array([_reach(kernel) for kernel in table])
        held = np.array([kernel.sum() for kernel in table])
        light = pixels[..., c] if pixels.dtype.kind == "f" else linear(pixels[..., c] / peak(pixels.dtype))
        done = np.zeros(pixels.shape[:2])
        work = (light.astype(np.float64), level.reshape(pixels.shape[:2]), np.stack(table), held, reach, u, v, done)
        over_rows(partial(scatter, *work), pixels.shape[0], step=v)
        if pixels.dtype.kind != "f":
            done = np.rint(np.clip(srgb(done), 0, 1) * peak(pixels.dtype))
        out[..., c] = done
    return picture.with_pixels(out)


def _codes(maps: SpreadMaps, colour: int) -> NDArray[np.int64]:
    """The widths of every ray in steps of `STEPS`, as one number: disk, ring and aberration."""
    widths = [maps.defocus_mm, maps.airy_mm[..., colour]]
    if maps.aberration_mm is not None:
        widths.append(maps.aberration_mm)
    steps = [np.rint(STEPS * np.arcsinh(2 * w.astype(np.float64) / maps.pixel_pitch_mm)) for w in widths]
    code = (steps[0] * LEVELS + steps[1]) * LEVELS
    return np.asarray(code + (steps[2] if len(steps) > 2 else 0) + LEVELS // 2, np.int64)


def _widths(code: int) -> tuple[float, float, float]:
    """Disk, ring and aberration in pixels of a number of `_codes`."""
    rest, aberration = divmod(code, LEVELS)
    disk, ring = (math.sinh(step / STEPS) / 2 for step in divmod(rest, LEVELS))
    return disk, ring, math.sinh((aberration - LEVELS // 2) / STEPS) / 2


def _kernel(disk: float, ring: float, aberration: float, side: int) -> NDArray[np.float64]:
    """Share of a square pixel's light on the pixels around it, (2·side + 1,)²; widths in pixels.

    The rest of the light falls beyond. The pixel of the source and the receiving one are a factor sinc² each way:
    their triangle has a kink, which samples of a pixel miss.
    """
    wide = _extent(disk, aberration)
    if wide >= 3 * side or ring >= 4 * side:  # it covers the elementary image from any of its pixels
        return np.zeros((2 * side + 1, 2 * side + 1))
    near = min(side, math.ceil(wide / 2 + 16 * ring) + 2)  # beyond 16 rings there is 1 % of the light
    f, transfer, rest = (_by_wave if ring >= LEAST_RING else _by_rays)(3 * near, disk, ring, aberration)
    places = np.arange(-near, near + 1)[:, None]
    both = np.where(f == 0, 1, 2)  # frequencies below 0 are alike
    waves = np.cos(2 * math.pi * f * places) * np.sinc(f) ** 2 * f[1] * both
    whole = waves.sum(axis=1)
    omitted = (places == 0) * (places.T == 0) - np.outer(whole, whole)  # of the frequencies above those sampled
    return np.pad(np.maximum(waves @ transfer @ waves.T + rest * omitted, 0), side - near)


def _extent(disk: float, aberration: float) -> float:
    """Diameter that no ray leaves: at the rim, or where the two turn."""
    turn = -disk / (3 * aberration) if aberration else 0.0
    return max(abs(disk + aberration), 2 / 3 * disk * math.sqrt(turn) if 0 < turn < 1 else 0.0)


def _by_wave(period: int, disk: float, ring: float, aberration: float) -> tuple[NDArray[Any], NDArray[Any], float]:
    """Transfer of a round lens out of focus: the spectrum of its field's intensity.

    Returns frequencies from 0 on in periods a pixel, (n,), the transfer of each pair, (n, n), and that of all
    higher ones.
    """
    period = max(period, math.ceil(2 * ACROSS * ring / FIRST_ZERO))
    count = period * math.ceil(RING_SAMPLES / ring)
    f = np.fft.fftfreq(count, period / count)
    pupil = np.hypot(f[:, None], f) * 2 * ring / FIRST_ZERO  # 1 at its rim
    rim = np.clip((1 - pupil) / (f[1] * 2 * ring / FIRST_ZERO) + 0.5, 0, 1)
    # the slope of this phase at the rim sends a ray to the rim of the disk
    phase = 0.25 * math.pi * FIRST_ZERO / ring * (disk + aberration / 2 * pupil**2) * pupil**2
    transfer = np.fft.fft2(np.abs(np.fft.ifft2(rim * np.exp(1j * phase))) ** 2).real * (count**2 / rim.sum())
    transfer = transfer[: (count + 1) // 2, : (count + 1) // 2]
    f = f[: (count + 1) // 2]
    transfer[0, 0] = 1  # samples on the rim carry the right amplitude but, squared, too little light
    return f, transfer, 0.0


def _by_rays(period: int, disk: float, ring: float, aberration: float) -> tuple[NDArray[Any], NDArray[Any], float]:
    """Transfer of a spot of rays folded with Airy's pattern, where that is narrower than a pixel; as `_by_wave`."""
    fine = max(4, SAMPLES // period)  # samples a pixel
    f = np.arange((fine * period + 1) // 2) / period
    radius = np.hypot(f[:, None], f)
    table = np.linspace(0, radius.max(), 16 + math.ceil(16 * radius.max() * max(1, _extent(disk, aberration))))
    higher = abs(f).max() / (np.arange(64) + 0.5) * 64  # evenly in 1/f, as sinc² falls
    return (
        f,
        np.interp(radius, table, _ray_transfer(table, disk, ring, aberration)),
        _ray_transfer(higher, disk, ring, aberration).mean(),
    )


def _ray_transfer(f: NDArray[Any], disk: float, ring: float, aberration: float) -> NDArray[np.float64]:
    """Product of the transfers of a spot of rays and of Airy's pattern."""
    cut = np.clip(f * ring / FIRST_ZERO, 0, 1)  # the lens passes no frequency beyond δL/λΛ
    passed = (np.arccos(cut) - cut * np.sqrt(1 - cut * cut)) * 2 / math.pi
    if aberration:
        return passed * _spot(f, disk, aberration)
    v = math.pi * disk * f
    return np.asarray(passed * np.where(v == 0, 1.0, 2 * special.j1(v) / np.where(v == 0, 1.0, v)))


def _spot(f: NDArray[Any], disk: float, aberration: float) -> NDArray[np.float64]:
    """Transfer of the spot of rays, ∫ J₀(2πf·ε) dρ² with ε = (disk·ρ + aberration·ρ³)/2 from the middle."""
    (nodes, weights), j0 = _gauss(), special.j0
    out = np.empty(f.size)
    for some in range(0, f.size, ROWS):
        part = f[some : some + ROWS]
        fastest = min(part.max(), MOST_FREQUENCY) * (disk + 3 * abs(aberration)) / 2  # turns from middle to rim
        pieces = 1 + math.ceil(fastest / TURNS)
        rho = ((np.arange(pieces)[:, None] + (nodes + 1) / 2) / pieces).ravel()
        way = math.pi * (disk + aberration * rho * rho) * rho
        out[some : some + ROWS] = j0(part[:, None] * way) @ (np.tile(weights / pieces, pieces) * rho)
    return out


@cache
def _gauss() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Gauss's nodes and weights from −1 to 1."""
    return np.polynomial.legendre.leggauss(NODES)


def _reach(kernel: NDArray[Any]) -> int:
    """Pixels to each side that hold `ENERGY` of a kernel."""
    side = len(kernel) // 2
    held = (kernel[side - r : side + r + 1, side - r : side + r + 1].sum() for r in range(side + 1))
    return next((r for r, energy in enumerate(held) if energy >= ENERGY * kernel.sum()), side)


@exact_kernel
def scatter(light, level, table, held, reach, u, v, out, first, last):
    """Add the light of each pixel to those around it under its lens.

    The kernel is cut there and keeps its light, ``held``: at the border, neighbouring lenses give what they take.
    The rest fell far away and is spread evenly. Rows from ``first`` to ``last`` are whole elementary images.
    """
    side = table.shape[1] // 2
    for top in range(first, last, v):
        for left in range(0, light.shape[1], u):
            beyond = 0.0
            for n in range(top, top + v):
                for m in range(left, left + u):
                    t = level[n, m]
                    r = reach[t]
                    a, b, c, d = max(n - r, top), min(n + r + 1, top + v), max(m - r, left), min(m + r + 1, left + u)
                    total = 0.0
                    for i in range(a, b):
                        for j in range(c, d):
                            total += table[t, i - n + side, j - m + side]
                    share = light[n, m] * held[t] / total if total > 0.0 else 0.0
                    for i in range(a, b):
                        for j in range(c, d):
                            out[i, j] += share * table[t, i - n + side, j - m + side]
                    beyond += light[n, m] * (1.0 - held[t])
            for i in range(top, top + v):
                for j in range(left, left + u):
                    out[i, j] += beyond / (u * v)
