"""Pictures of hexagonal, non-integer or shifted structures brought to a regular one, where M = K·U and N = L·V.

A lens owns the pixels whose centres lie in its cell: all points nearer to it than to any other lens of an endless
array of the same kind. In a rectangular array that is half a pitch to each side; in a hexagonal one a hexagon, half a
pitch to the left and right. `Lattice.nearest` decides, ties included, as it does for the camera's rays. Pixels that
only a lens beyond the array's edge would own, such as those left of the first lens of a hexagonal array's odd rows,
belong to none.

Both ways here take a map of owners, 4 bytes a pixel, beside the picture and the result.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import checks
from .camera import IICamera, Pair, whole_pair
from .component import light_field
from .jit import kernel
from .lattice import Lattice
from .optics import FrontElement, Lens, Lenslet, LensModel, Pinhole, SphericalLenslet
from .picture import IIPicture

Ints = NDArray[np.int32]
Mask = NDArray[np.bool_]
BLOCK = 64  # rows of pixels whose owners are sought at a time


@checks.checked(picture=checks.instance(IIPicture))
def smallest_rectangle(picture: IIPicture) -> tuple[IIPicture, Mask]:
    """Around each lens the smallest rectangle of whole pixels, of one size for all, that holds all pixels it owns.

    No pixel changes its value, and `from_smallest_rectangle` puts each back where it was. A regular picture is
    returned as it is.

    Parameters
    ----------
    picture : IIPicture
        With its camera, unless it is regular.

    Returns
    -------
    picture : IIPicture
        Lenses (K, L) of (U, V) pixels. Its camera has pixel pitch δP·p/U and gap Λ·p/U, p the lens pitch in pixels
        across, which gives every ray its own direction and every lens its place, but for three things. The lens
        centre is taken to be the rectangle's, from which it is off by less than a pixel each way (more where the
        sensor cuts the cell). Pixels being square, lens places down are stretched by V·p_x/(U·p_y) about the middle.
        Odd rows of a hexagonal array are drawn half a pitch too far left. Spherical lenslets become thin ones.
    owned : ndarray of bool, (L·V, K·U)
        False for pixels of neighbours and, black, those beyond the sensor.

    References
    ----------
    Sgouros et al. as told in Olsson 2008, §2.3.3: the least rectangle round a hexagonal elementary image.
    """
    if picture.regular:
        return picture, np.ones(picture.pixels.shape[:2], np.bool_)
    camera = _camera(picture)
    owner = owners(camera.lens_lattice, camera.pixels)
    left, top, (u, v) = _rectangles(camera.lens_lattice, owner)
    (k, l), source = camera.lenses, np.ascontiguousarray(picture.pixels)
    pixels, owned = np.zeros((l, v, k, u, 3), source.dtype), np.zeros((l, v, k, u), np.bool_)
    _over_rows(l, lambda first, last: cut_rectangles(source, owner, left, top, first, last, pixels, owned))
    regular = IIPicture(
        pixels.reshape(l * v, k * u, 3), (k, l), (u, v), _regular_camera(camera, (u, v), shrink=True), picture.erect
    )
    return regular, owned.reshape(l * v, k * u)


@checks.checked(picture=checks.instance(IIPicture), camera=checks.instance(IICamera))
def from_smallest_rectangle(picture: IIPicture, camera: IICamera) -> tuple[IIPicture, Mask]:
    """The inverse of `smallest_rectangle`.

    Parameters
    ----------
    picture : IIPicture
        Regular, as `smallest_rectangle` made it; perhaps coded in between.
    camera : IICamera
        Of the picture that it was made from.

    Returns
    -------
    picture : IIPicture
        In the camera's structure. Every pixel that a lens owns is what it was; the others are 0.
    owned : ndarray of bool, (N, M)
        False for pixels that no lens owns.

    Raises
    ------
    ValueError
        If the camera's smallest rectangles are not the picture's elementary images.
    """
    if camera.regular:
        back = IIPicture(picture.pixels, picture.lenses, picture.ei_pixels, camera, picture.erect)
        return back, np.ones(back.pixels.shape[:2], np.bool_)
    picture.check_regular()
    owner = owners(camera.lens_lattice, camera.pixels)
    left, top, (u, v) = _rectangles(camera.lens_lattice, owner)
    (k, l), (width, height) = camera.lenses, camera.pixels
    if (picture.lenses, picture.ei_pixels) != ((k, l), (u, v)):
        raise ValueError(
            f"the camera's smallest rectangles are {k}×{l} of {u}×{v} px, the picture has "
            f"{picture.lenses[0]}×{picture.lenses[1]} of {picture.ei_pixels[0]}×{picture.ei_pixels[1]}"
        )
    source = light_field(picture.pixels, picture.lenses, picture.ei_pixels)
    pixels = np.zeros((height, width, 3), source.dtype)
    _over_rows(height, lambda first, last: put_back(source, owner, left, top, first, last, pixels))
    return IIPicture(pixels, (k, l), camera.ei_pixels, camera, picture.erect), owner >= 0


@checks.checked(picture=checks.instance(IIPicture), ei_pixels=checks.whole_pair)
def resampled(picture: IIPicture, ei_pixels: Pair | None = None, *, deshift: bool = False) -> tuple[IIPicture, Mask]:
    """Every lens's own cell sampled anew on a grid of U×V points that is centred on the lens.

    The grid fills one pitch across and down. A value is the mean, with bilinear weights, of those of the four pixels
    around a point that the lens owns: its error is of second order where it owns all four, of first order, the
    slope over at most a pixel, along the cell's border; neighbours, where directions jump, never leak in.

    Parameters
    ----------
    picture : IIPicture
        With its camera, unless it is regular.
    ei_pixels : (U, V), optional
        The whole numbers nearest to the lens pitch in pixels if not given. A regular picture that has these is
        returned as it is.
    deshift : bool
        Odd rows of a hexagonal array stand half a pitch to the right of even ones, which gives a view image a zigzag
        of half a lens. If true, each lens of an odd row is replaced by the mean of the two at whose middle it should
        stand, direction by direction. The zigzag goes, and so does detail as fine as a lens in these rows.

    Returns
    -------
    picture : IIPicture
        Its camera keeps lens pitch and gap; the pixel pitch becomes δP·p/U, p the lens pitch in pixels across. Where
        p_x/U and p_y/V differ, the scene is stretched downwards by V·p_x/(U·p_y), depth unchanged: pixels are square.
    valid : ndarray of bool, (L·V, K·U)
        False for points beyond the sensor, out of the lens's cell (a hexagonal cell has no corners where the
        grid has), under a lens that owns no pixel near, and those for which ``deshift`` lacks one of two lenses. They
        hold the nearest that is there, or 0.

    Raises
    ------
    ValueError
        If ``ei_pixels`` are not two whole numbers of at least 1.
    """
    lattice = _lattice(picture)
    u, v = whole_pair("ei_pixels", ei_pixels) if ei_pixels is not None else _nearest_whole(lattice.pitch)
    if picture.regular and (u, v) == picture.ei_pixels:
        return picture, np.ones(picture.pixels.shape[:2], np.bool_)
    (k, l), source = picture.lenses, np.ascontiguousarray(picture.pixels)
    dx = (np.arange(u) - (u - 1) / 2) * (lattice.pitch[0] / u)
    dy = (np.arange(v) - (v - 1) / 2) * (lattice.pitch[1] / v)
    inside = _in_cell(lattice, dx, dy)
    x, y = lattice.centres(np.arange(k)[None, :], np.arange(l)[:, None])
    x, y = np.broadcast_to(x, (l, k)), np.broadcast_to(y, (l, k))
    owner = owners(lattice, picture.size)
    pixels, valid = np.zeros((l, v, k, u, 3), source.dtype), np.zeros((l, v, k, u), np.bool_)
    whole = source.dtype.kind != "f"
    _over_rows(l, lambda a, b: resample_cells(source, owner, x, y, dx, dy, inside, whole, a, b, pixels, valid))
    if deshift and lattice.hexagonal:
        average_odd_rows(pixels, valid, whole)
    camera = _regular_camera(picture.camera, (u, v), shrink=False) if picture.camera is not None else None
    regular = IIPicture(pixels.reshape(l * v, k * u, 3), (k, l), (u, v), camera, picture.erect)
    return regular, valid.reshape(l * v, k * u)


def owners(lattice: Lattice, pixels: Pair) -> Ints:
    """Which lens owns each pixel, (N, M): l·K + k, or −1 if none."""
    (width, height), (across, down) = pixels, lattice.lenses
    # Pixels outside of all cells are those nearest to a lens of a frame round the array; two rows keep odd rows odd.
    (right, below), (x, y) = lattice.pitch, lattice.origin
    framed = lattice._replace(lenses=(across + 2, down + 4), origin=(x - right, y - 2 * below))
    out = np.empty((height, width), np.int32)
    columns = np.arange(width)[None, :]

    def block(rows: slice) -> None:
        k, l = framed.nearest(columns, np.arange(rows.start, rows.stop)[:, None])
        k, l = k - 1, l - 2
        out[rows] = np.where((k >= 0) & (k < across) & (l >= 0) & (l < down), l * across + k, -1)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(block, _blocks(height)))
    return out


def _blocks(height: int) -> list[slice]:
    return [slice(top, min(top + BLOCK, height)) for top in range(0, height, BLOCK)]


def _over_rows(count: int, work: Callable[[int, int], Any]) -> None:
    """Do the work for rows from, to, a share for each core."""
    cores = min(os.cpu_count() or 1, count)
    bounds = [count * i // cores for i in range(cores + 1)]
    with ThreadPoolExecutor(cores) as pool:
        list(pool.map(work, bounds[:-1], bounds[1:]))


def _camera(picture: IIPicture) -> IICamera:
    assert picture.camera is not None  # a picture without one is regular
    return picture.camera


def _lattice(picture: IIPicture) -> Lattice:
    if picture.camera is not None:
        return picture.camera.lens_lattice
    return Lattice(picture.lenses, picture.ei_pixels, (0.0, 0.0), False)


def _nearest_whole(pitch: tuple[float, float]) -> Pair:
    across, down = (max(1, int(p + 0.5)) for p in pitch)
    return across, down


def _rectangles(lattice: Lattice, owner: Ints) -> tuple[Ints, Ints, Pair]:
    """First column and row of each lens's rectangle, (L, K), and the size of all, in pixels."""
    (across, down), (height, width) = lattice.lenses, owner.shape
    low = np.full((2, down, across), np.iinfo(np.int32).max, np.int32)
    high = np.full((2, down, across), -1, np.int32)
    find_bounds(owner, low.reshape(2, -1), high.reshape(2, -1))
    k, l = np.arange(across)[None, :], np.arange(down)[:, None]
    corners, size = [], []
    for axis, centre in enumerate(lattice.centres(k, l)):
        used = high[axis] >= 0
        extent = int((high[axis] - low[axis])[used].max()) + 1 if used.any() else 1
        middle = np.broadcast_to(np.floor(centre - extent / 2 + 0.5), (down, across))
        # As near to the lens's centre as the pixels it owns allow; a lens that owns none may stand far outside.
        fitted = np.clip(middle, high[axis].astype(np.int64) + 1 - extent, low[axis])
        limit = (width, height)[axis]
        corners.append(np.where(used, fitted, np.clip(middle, -extent, limit)).astype(np.int32))
        size.append(extent)
    return corners[0], corners[1], (size[0], size[1])


def _in_cell(lattice: Lattice, dx: NDArray[Any], dy: NDArray[Any]) -> Mask:
    """Which offsets of at most half a pitch from a lens centre lie in its cell, (V, U)."""
    (p, q), grid = lattice.pitch, (dy.size, dx.size)
    if not lattice.hexagonal:
        return np.ones(grid, np.bool_)
    # Nearer than the lenses half a pitch aside in the next rows; others are too far off to matter here.
    return abs(dx)[None, :] * p + 2 * abs(dy)[:, None] * q <= p * p / 4 + q * q


def _regular_camera(camera: IICamera, ei_pixels: Pair, *, shrink: bool) -> IICamera:
    """The camera of the regular picture: lenses in their places; directions kept by a shorter gap if pixels were."""
    (u, v), (k, l) = ei_pixels, camera.lenses
    ratio = camera.lens_lattice.pitch[0] / u
    gap = camera.gap_mm * ratio if shrink else camera.gap_mm
    forward = camera.gap_mm - gap  # so that the lens plane stays
    shift = (*camera.lens_offset_mm, forward)
    origin = tuple(a + b for a, b in zip(camera.origin_mm, shift, strict=True))
    return IICamera(
        name=camera.name,
        pixels=(k * u, l * v),
        lenses=(k, l),
        pixel_pitch_mm=camera.pixel_pitch_mm * ratio,
        gap_mm=gap,
        origin_mm=origin,  # type: ignore[arg-type]
        optics=(_same_focus(camera, gap), *(_nearer(element, forward) for element in camera.front)),
    )


def _same_focus(camera: IICamera, gap: float) -> LensModel:
    """The lens model that focuses behind another gap where the camera's does."""
    model = camera.lens_model
    if isinstance(model, SphericalLenslet) and model.ior == 1:  # bends nothing
        return Pinhole()
    if isinstance(model, SphericalLenslet):  # the stretched cell may be too large for the sphere
        model = Lenslet(focal_mm=model.radius_mm / (model.ior - 1), aperture_mm=model.aperture_mm)
    if not isinstance(model, Lenslet) or gap == camera.gap_mm:
        return model
    power = 1 / np.atleast_2d(np.asarray(model.focal_mm, np.float64)) + (1 / gap - 1 / camera.gap_mm)
    if not (power > 0).all():  # would have to diverge
        return Pinhole()
    rows = tuple(tuple(float(f) for f in row) for row in 1 / power)
    return replace(model, focal_mm=rows if isinstance(model.focal_mm, tuple) else rows[0][0])


def _nearer(element: FrontElement, by_mm: float) -> FrontElement:
    return replace(element, z_mm=element.z_mm - by_mm) if isinstance(element, Lens) else element


@kernel
def find_bounds(owner, low, high):
    """First and last column (index 0) and row (1) of each lens's pixels."""
    for n in range(owner.shape[0]):
        for m in range(owner.shape[1]):
            lens = owner[n, m]
            if lens >= 0:
                low[0, lens], high[0, lens] = min(low[0, lens], m), max(high[0, lens], m)
                low[1, lens], high[1, lens] = min(low[1, lens], n), max(high[1, lens], n)


@kernel
def cut_rectangles(source, owner, left, top, first, last, out, owned):
    """out[l, v, k, u] = the pixel of lens (k, l)'s rectangle, for l from first to last."""
    height, width = owner.shape
    across = left.shape[1]
    for l in range(first, last):
        for v in range(out.shape[1]):
            for k in range(across):
                n = top[l, k] + v
                if 0 <= n < height:
                    for u in range(out.shape[3]):
                        m = left[l, k] + u
                        if 0 <= m < width:
                            owned[l, v, k, u] = owner[n, m] == l * across + k
                            for c in range(3):
                                out[l, v, k, u, c] = source[n, m, c]


@kernel
def put_back(source, owner, left, top, first, last, out):
    """out[n, m] = its own lens's pixel, for n from first to last."""
    across = left.shape[1]
    for n in range(first, last):
        for m in range(owner.shape[1]):
            lens = owner[n, m]
            if lens >= 0:
                l, k = lens // across, lens % across
                for c in range(3):
                    out[n, m, c] = source[l, n - top[l, k], k, m - left[l, k], c]


@kernel
def resample_cells(source, owner, x, y, dx, dy, inside, whole, first, last, out, valid):
    """out[l, v, k, u] = the value at the lens centre (x, y)[l, k] + (dx[u], dy[v]), for l from first to last."""
    height, width = owner.shape
    across = x.shape[1]
    for l in range(first, last):
        for v in range(dy.size):
            for k in range(across):
                lens, py = l * across + k, y[l, k] + dy[v]
                row = np.int64(np.floor(py - 0.5))
                down = py - 0.5 - row
                for u in range(dx.size):
                    px = x[l, k] + dx[u]
                    if not (0 <= px <= width and 0 <= py <= height):
                        continue
                    column = np.int64(np.floor(px - 0.5))
                    right = px - 0.5 - column
                    total, red, green, blue = 0.0, 0.0, 0.0, 0.0
                    for n in (row, row + 1):
                        for m in (column, column + 1):
                            if n < 0 or n >= height or m < 0 or m >= width:
                                continue
                            weight = (down if n > row else 1 - down) * (right if m > column else 1 - right)
                            if weight > 0 and owner[n, m] == lens:
                                total += weight
                                red += weight * source[n, m, 0]
                                green += weight * source[n, m, 1]
                                blue += weight * source[n, m, 2]
                    if total > 1e-9:  # else the lens's own pixels lie a pixel away or more, but for rounding
                        valid[l, v, k, u] = inside[v, u]
                        red, green, blue = red / total, green / total, blue / total
                    else:
                        n, m = min(np.int64(py), height - 1), min(np.int64(px), width - 1)
                        red, green, blue = 1.0 * source[n, m, 0], 1.0 * source[n, m, 1], 1.0 * source[n, m, 2]
                    if whole:
                        red, green, blue = np.rint(red), np.rint(green), np.rint(blue)
                    out[l, v, k, u, 0], out[l, v, k, u, 1], out[l, v, k, u, 2] = red, green, blue


@kernel
def average_odd_rows(pixels, valid, whole):
    """Each lens of odd rows becomes the mean of itself and the one to its left, or the valid one of the two."""
    for l in range(1, pixels.shape[0], 2):
        for v in range(pixels.shape[1]):
            for k in range(pixels.shape[2] - 1, -1, -1):
                for u in range(pixels.shape[3]):
                    here = valid[l, v, k, u]
                    left = k > 0 and valid[l, v, k - 1, u]
                    valid[l, v, k, u] = here and left
                    if left:
                        for c in range(3):
                            mean = 1.0 * pixels[l, v, k - 1, u, c]
                            if here:
                                mean = 0.5 * (mean + pixels[l, v, k, u, c])
                            pixels[l, v, k, u, c] = np.rint(mean) if whole else mean
