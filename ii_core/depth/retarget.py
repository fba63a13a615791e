"""A light field through another II-camera: rays of the target looked up in the source by depth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base import checks
from ..base.colour import srgb
from ..base.parallel import for_each, over_rows
from ..camera.camera import IICamera, Pair
from ..picture.component import sub_images
from ..picture.disparity import rows_per_column
from ..picture.picture import DTYPES, IIPicture, peak
from ..picture.view import camera_of
from .gather_kernels import look_up
from .refocus import _light

Progress = Callable[[int, int, str], Any]
SEEN, FILLED, OUTSIDE = 2, 1, 0  # codes of the mask
BAND = 16  # rows of target pixels at a time
WIDEST = 32  # greatest disparity that is told apart, in widths of a view
AFFINE = 1e-6  # largest deviation of rays from an affine camera, in pitches and pixels


@dataclass(frozen=True, eq=False)
class Retargeted:
    """A picture of another camera and where its pixels come from.

    Attributes
    ----------
    picture : IIPicture
    mask : ndarray of uint8, (N, M)
        2 where a view of the source sees the point, 1 where none does and what lies behind fills the hole, 0 where
        the ray lies outside the source: black.
    """

    picture: IIPicture
    mask: NDArray[np.uint8]

    @property
    def shares(self) -> tuple[float, float, float]:
        """Shares of pixels that are seen, filled and outside."""
        return tuple(float((self.mask == code).mean()) for code in (SEEN, FILLED, OUTSIDE))  # type: ignore[return-value]


class _Views(NamedTuple):
    """Views (V, U, L, K, 3) in linear light and what `look_up` needs of their disparity."""

    light: NDArray[np.float32]
    disparity: NDArray[np.float32]
    low: float
    high: float
    order: int
    tall: float  # `rows_per_column`


@checks.checked(
    picture=checks.instance(IIPicture),
    camera=checks.instance(IICamera),
    disparity=checks.array,
    samples=checks.whole_from(1, 16),
    refine=checks.flag,
    workers=checks.whole_from(1, 1024),
    progress=checks.callable_,
)
def retarget(
    picture: IIPicture,
    camera: IICamera,
    disparity: NDArray[np.floating],
    *,
    samples: int = 1,
    refine: bool = False,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Retargeted:
    """Return what another camera at the same place sees, from a picture and the disparity of all its views.

    A target ray lies between four views of the source. In each, the ray's points lie on a line; the nearest one
    that has the disparity of the view there is where the ray ends. Views that agree on the nearest point are mixed,
    the nearer ones more. If the point is hidden from all four, what lies behind its neighbours is taken.
    One row of views has no parallax down, nor then has what is made of it.

    Parameters
    ----------
    picture : IIPicture
        Source: regular, with a camera whose views are straight (ideal lenses before the array, vertical parallax or
        one row of views).
    camera : IICamera
        Target; any that has rays.
    disparity : ndarray, (V, U, L, K)
        Of all views of the source, pixels a step: `disparity_of_views`, or of a known depth. NaN counts as the
        farthest.
    samples : int
        Rays a side of a target pixel.
    refine : bool
        Halve the directions of the source first, see `_refined`: for a target of finer pixels, if a source pixel is
        the mean over its whole step of directions, as a render of many samples and a plenoptic camera have it.

    Raises
    ------
    ValueError
        If the source has no camera or none of straight views, or the disparity is of another shape.
    """
    source = camera_of(picture)
    picture.check_regular()
    (k, l), (u, v) = picture.lenses, picture.ei_pixels
    if disparity.shape != (v, u, l, k):
        raise ValueError(f"disparity is of shape {disparity.shape}: that of all views, {(v, u, l, k)}, is needed")
    inverse = _places(source, picture.erect)
    sign = -1.0 if picture.erect else 1.0
    known = np.ascontiguousarray(disparity, np.float32)
    finite = known[np.isfinite(known)]
    if not finite.size:
        raise ValueError("disparity is nowhere known")
    # Far points move without bound; one view's width of it loses 0.7 dB of the quilt of *Car* (2026-11-27).
    widest = float(WIDEST * max(k, l))
    low, high = (min(max(float(end), -widest), widest) for end in (finite.min(), finite.max()))
    known = np.clip(np.where(np.isfinite(known), known, np.float32(low)), low, high) * np.float32(sign)
    views = np.stack([[_light(view, 1.0) for view in row] for row in sub_images(picture)])
    least, most = sorted((sign * low, sign * high))
    seen = _Views(views, known, least, most, 1 if sign > 0 else -1, rows_per_column(source))
    halves = _refined(seen, workers, progress) if refine else None
    (u0, v0) = ((n > 1) / 2 for n in (u, v))  # the place of view 0 of the source among halves
    width, height = camera.pixels
    light, mask = np.zeros((height, width, 3), np.float32), np.zeros((height, width), np.uint8)
    offsets = (np.arange(samples) + 0.5) / samples

    def fill(first: int, last: int) -> None:
        total, refined = np.zeros((2, last - first, width, 3), np.float32)
        best, other = np.zeros((2, last - first, width), np.uint8)
        places = np.empty((last - first, width, 4))
        at = np.empty((last - first, width), np.float32)
        for sample in [(x, y) for y in offsets for x in offsets]:
            start, way = camera.rays(rows=slice(first, last), sample=sample)
            inverse(start, way, places)
            look_up(*seen, places, total, at, best, 0, last - first)
            if halves is not None:  # the mask is that of the source
                places[..., 2:] = 2 * places[..., 2:] + (u0, v0)
                look_up(*halves, places, refined, at, other, 0, last - first)
        if halves is not None:
            total = refined
        light[first:last] = total / samples**2
        mask[first:last] = best

    for top in range(0, height, BAND * 8):
        end = min(top + BAND * 8, height)

        def band(first: int, last: int, top: int = top) -> None:
            fill(top + first, top + last)

        over_rows(band, end - top, workers=workers)
        if progress is not None:
            progress(end, height, "rows")
    structure = camera.lenses, camera.ei_pixels
    made = IIPicture(_codes(light, picture.pixels.dtype), *structure, camera, camera.erect)
    return Retargeted(made, mask)


def _refined(seen: _Views, workers: int | None, progress: Progress | None) -> _Views:
    """Return twice as many views each way, each of half a step of directions.

    They are looked up by depth. What the mean of the parts of a pixel lacks to the pixel is added to each part.
    Apples to lenses of twice the pitch: 26.9 to 28.5 dB; a second round from neighbouring halves 29.1 (2026-11-25).
    """
    rows, cols, height, width = seen.disparity.shape
    down, across = (2 if n > 1 else 1 for n in (rows, cols))
    light = np.zeros((rows * down, cols * across, height, width, 3), np.float32)
    ended = np.zeros(light.shape[:-1], np.float32)

    def view(n: int) -> None:
        places = np.empty((height, width, 4))
        places[..., 0], places[..., 1] = np.arange(width), np.arange(height)[:, None]
        places[..., 3] = (n + 0.5) / down - 0.5
        for m in range(cols * across):
            places[..., 2] = (m + 0.5) / across - 0.5
            look_up(*seen, places, light[n, m], ended[n, m], np.zeros((height, width), np.uint8), 0, height)

    for done in range(rows):
        for_each(view, range(done * down, (done + 1) * down), workers=workers)
        if progress is not None:
            progress(done + 1, rows, "rows of views")
    parts = light.reshape(rows, down, cols, across, height, width, 3)
    parts += (seen.light - parts.mean(axis=(1, 3)))[:, None, :, None]
    np.clip(light, 0, None, out=light)
    ended /= 2
    return _Views(light, ended, float(ended.min()), float(ended.max()), seen.order, seen.tall)


def _codes(light: NDArray[np.float32], dtype: np.dtype[Any]) -> NDArray[Any]:
    assert dtype.name in DTYPES
    if dtype.kind == "f":
        return light
    return np.rint(srgb(np.clip(light, 0, 1)) * peak(dtype)).astype(dtype)


def _places(camera: IICamera, erect: bool) -> Callable[[NDArray[Any], NDArray[Any], NDArray[Any]], None]:
    """Return a function from rays to places (x, y, u, v) in the light field: fractional lenses and pixels under them.

    Where a ray meets the lens plane, and its slope, are affine in lens and pixel for views that are straight: the
    coefficients follow from three rays of the camera, and a fourth checks them.
    """
    plane = camera.origin_mm[2] + camera.gap_mm
    (k, l), (u, v) = camera.lenses, camera.ei_pixels
    if not camera.lens_model.vertical_parallax and v > 1:
        raise ValueError("the source has rows of pixels without vertical parallax: no source for retarget")

    def coordinates(start: NDArray[Any], way: NDArray[Any], axis: int) -> NDArray[Any]:
        with np.errstate(divide="ignore", invalid="ignore"):  # NaN where a rim blocks the ray: outside the source
            slope = way[..., axis] / way[..., 2]
        return np.stack([start[..., axis] + (plane - start[..., 2]) * slope, slope], axis=-1)

    def ray(lenses: Pair, pixels: Pair, axis: int) -> NDArray[Any]:
        row = lenses[1] * v + pixels[1]
        start, way = camera.rays(rows=slice(row, row + 1))
        col = lenses[0] * u + pixels[0]
        return coordinates(start[0, col], way[0, col], axis)

    def beside(at: Pair, axis: int, by: int) -> Pair:
        return (at[0] + by, at[1]) if axis == 0 else (at[0], at[1] + by)

    # Rays near the middle: a rim before the array may block others.
    lens, pixel, step = (k // 2, l // 2), (u // 2, v // 2), (max(k // 4, 1), max(l // 4, 1))
    matrices = []
    for axis in 0, 1:
        zero, across, under = ray(lens, pixel, axis), np.array([1.0, 0.0]), np.array([0.0, 1.0])
        if lens[axis]:
            across = (zero - ray(beside(lens, axis, -step[axis]), pixel, axis)) / step[axis]
        if pixel[axis]:
            under = zero - ray(lens, beside(pixel, axis, -1), axis)
        matrix = np.linalg.inv(np.stack([across, under], axis=1))
        other = min(lens[0] + step[0], k - 1), min(lens[1] + step[1], l - 1)
        near = max(pixel[0] - 1, 0), max(pixel[1] - 1, 0)
        far = matrix @ (ray(other, near, axis) - zero) - [other[axis] - lens[axis], near[axis] - pixel[axis]]
        if not (np.abs(far) < AFFINE * max(k, l, u, v)).all():
            raise ValueError("rays of the source are not those of straight views: no source for retarget")
        matrices.append((matrix, zero, (lens[axis], pixel[axis])))

    def places(start: NDArray[Any], way: NDArray[Any], out: NDArray[Any]) -> None:
        for axis, (matrix, zero, middle) in enumerate(matrices):
            found = (coordinates(start, way, axis) - zero) @ matrix.T + middle
            out[..., axis], out[..., axis + 2] = found[..., 0], found[..., 1]

    return places
