"""Conversion of hexagonal, non-integer or shifted structures to regular ones, where M = K·U and N = L·V.

A lens owns the pixels whose centres lie in its cell. The cell is the set of points nearer to this lens than to any
other lens of the infinite lattice: a rectangle, or a hexagon that reaches half a pitch to the left and right.
`Lattice.nearest` resolves ties, as for the camera's rays. A pixel in the cell of a lens beyond the array has no
owner.

`smallest_rectangle` copies pixels unchanged; `resampled` interpolates. Both take 4 bytes per pixel for a map of
owners.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base import checks
from ..base.jit import exact_stage_kernel, kernel
from ..base.parallel import over_rows
from ..camera.camera import MOST_PIXELS, IICamera, Pair, whole_pair
from ..camera.lattice import Lattice
from .picture import IIPicture, picture_order

Ints = NDArray[np.int32]
Mask = NDArray[np.bool_]
BLOCK = 64  # rows of pixels in one call of numpy: bounds its temporary arrays


class Grid(NamedTuple):
    """Points at which lenses' cells are resampled, in pixels."""

    x: Any  # (L, K) centres of the lenses
    y: Any
    dx: Any  # (V, U) places from them
    dy: Any
    inside: Any  # (V, U) whether a place lies in the cell


@checks.checked(picture=checks.instance(IIPicture))
def smallest_rectangle(picture: IIPicture) -> tuple[IIPicture, Mask]:
    """Return a regular picture of the smallest rectangle of pixels around each lens that holds all pixels it owns.

    All rectangles have one size. No pixel changes its value, and `from_smallest_rectangle` inverts the conversion. A
    regular picture is returned unchanged.

    Parameters
    ----------
    picture : IIPicture
        With its camera; a regular picture needs none.

    Returns
    -------
    picture : IIPicture
        Lenses (K, L) of (U, V) pixels. Its camera is the picture's, with `packed` pixels of a straight array. Three
        things are lost: lens centres move to the centres of their rectangles, by less than a pixel along each axis
        (more at the edge of the sensor); odd rows of a hexagonal array lie half a pitch too far left; positions of a
        turned or sheared array are straightened, directions are not.
    owned : ndarray of bool, (L·V, K·U)
        False for pixels of neighbouring lenses, and for pixels beyond the sensor, which are black.

    References
    ----------
    Sgouros et al., cited in Olsson 2008, §2.3.3: the smallest rectangle around a hexagonal elementary image.
    """
    if picture.regular:
        return picture, np.ones(picture.pixels.shape[:2], np.bool_)
    camera = _camera(picture)
    owner = owners(camera.lens_lattice, camera.pixels)
    left, top, (u, v) = _rectangles(camera.lens_lattice, owner)
    (k, l), source = camera.lenses, np.ascontiguousarray(picture.pixels)
    pixels, owned = np.zeros((l, v, k, u, 3), source.dtype), np.zeros((l, v, k, u), np.bool_)
    over_rows(lambda first, last: cut_rectangles(source, owner, left, top, first, last, pixels, owned), l)
    made = _regular_camera(camera, (u, v), camera.pixel_pitch_mm)
    return IIPicture(pixels.reshape(l * v, k * u, 3), (k, l), (u, v), made, picture.erect), owned.reshape(
        l * v, k * u
    )


@checks.checked(picture=checks.instance(IIPicture), camera=checks.instance(IICamera))
def from_smallest_rectangle(picture: IIPicture, camera: IICamera) -> tuple[IIPicture, Mask]:
    """Invert `smallest_rectangle`.

    Parameters
    ----------
    picture : IIPicture
        Regular, from `smallest_rectangle`; it may have been coded.
    camera : IICamera
        Camera of the original picture.

    Returns
    -------
    picture : IIPicture
        In the camera's structure. Pixels without an owner are 0; all others have their original position.
    owned : ndarray of bool, (N, M)
        False for pixels without an owner.

    Raises
    ------
    ValueError
        If the camera's smallest rectangles differ from the picture's elementary images.
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
    source = picture_order(picture.pixels, picture.lenses, picture.ei_pixels)
    pixels = np.zeros((height, width, 3), source.dtype)
    over_rows(lambda first, last: put_back(source, owner, left, top, first, last, pixels), height)
    return IIPicture(pixels, (k, l), camera.ei_pixels, camera, picture.erect), owner >= 0


@checks.checked(picture=checks.instance(IIPicture), ei_pixels=checks.whole_pair, deshift=checks.flag)
def resampled(picture: IIPicture, ei_pixels: Pair | None = None, *, deshift: bool = False) -> tuple[IIPicture, Mask]:
    """Return a regular picture with every lens's cell resampled on a grid of U×V points centred on the lens.

    The grid spans one pitch across and, within a point, one down. It is turned and sheared as the array is, so that
    the regular picture's frame is the array's own. Interpolation is bilinear over those of the four surrounding
    pixels that the lens owns. Its error is of second order if the lens owns all four, and of first order along the
    border of the cell. Pixels of neighbouring lenses have no influence.

    Parameters
    ----------
    picture : IIPicture
        With its camera; a regular picture needs none.
    ei_pixels : (U, V), optional
        If not given, points are as far apart down as across: the lens pitch is rounded across to U pixels, and down
        to steps of p/U, where p is the pitch across. A regular picture of this size is returned unchanged.
    deshift : bool
        Remove the zigzag of half a lens that the shifted odd rows of a hexagonal array give view images. Each lens of
        an odd row becomes the mean of itself and its left neighbour, direction by direction. These rows lose detail
        of the size of a lens.

    Returns
    -------
    picture : IIPicture
        Its camera keeps lens pitch and gap. The pixel pitch becomes δP·p/U; pixels are `packed` unless they fill the
        pitch down, too. With ``ei_pixels`` given, the grid spans the pitch down exactly, and the scene is stretched
        vertically by V·p_x/(U·p_y), since pixels are square; depth does not change.
    valid : ndarray of bool, (L·V, K·U)
        False for points beyond the sensor, outside the lens's cell (the corners of the grid lie outside a hexagonal
        cell), without an owned pixel around them, or for which ``deshift`` lacks one of the two lenses. Such points
        have the value of the nearest pixel, or 0.

    Raises
    ------
    ValueError
        If ``ei_pixels`` are not two whole numbers of at least 1.
    """
    lattice = _lattice(picture)
    u, v = whole_pair("ei_pixels", ei_pixels) if ei_pixels is not None else _nearest_whole(lattice.pitch)
    step = lattice.pitch[0] / u
    down = step if ei_pixels is None else lattice.pitch[1] / v
    if picture.regular and (u, v) == picture.ei_pixels:
        return picture, np.ones(picture.pixels.shape[:2], np.bool_)
    (k, l), source = picture.lenses, np.ascontiguousarray(picture.pixels)
    if k * u * l * v > MOST_PIXELS:
        raise ValueError(f"ei_pixels is {u}×{v}, a picture of {k * u}×{l * v} pixels: at most {MOST_PIXELS} are made")
    dx, dy = (np.arange(u) - (u - 1) / 2) * step, (np.arange(v) - (v - 1) / 2) * down
    inside = _in_cell(lattice, dx, dy)
    # copies of one layout: the kernel is compiled for each
    dx, dy = (np.broadcast_to(a, (v, u)).copy() for a in lattice.offsets(dx[None, :], dy[:, None]))
    x, y = (np.broadcast_to(a, (l, k)).copy() for a in lattice.centres(np.arange(k)[None, :], np.arange(l)[:, None]))
    owner = owners(lattice, picture.size)
    pixels, valid = np.zeros((l, v, k, u, 3), source.dtype), np.zeros((l, v, k, u), np.bool_)
    whole = source.dtype.kind != "f"
    grid = Grid(x, y, dx, dy, inside)
    over_rows(lambda a, b: resample_cells(source, owner, grid, whole, a, b, pixels, valid), l)
    if deshift and lattice.hexagonal:
        average_odd_rows(pixels, valid, whole)
    camera = picture.camera and _regular_camera(picture.camera, (u, v), picture.camera.pixel_pitch_mm * step)
    if camera and ei_pixels is not None:
        camera = replace(camera, lens_pitch_mm=None, packed=False)  # type: ignore[arg-type]
    regular = IIPicture(pixels.reshape(l * v, k * u, 3), (k, l), (u, v), camera, picture.erect)
    return regular, valid.reshape(l * v, k * u)


def owners(lattice: Lattice, pixels: Pair) -> Ints:
    """Return the lens that owns each pixel, (N, M): l·K + k, or −1 without an owner."""
    (width, height), (across, down) = pixels, lattice.lenses
    # Lenses of a frame around the array own the pixels outside all cells. Two rows above keep the parity of rows.
    (right, below), (x, y) = lattice.pitch, lattice.origin
    framed = lattice._replace(lenses=(across + 2, down + 4), origin=(x - right, y - 2 * below))
    out = np.empty((height, width), np.int32)
    columns = np.arange(width)[None, :]

    def find(first: int, last: int) -> None:
        for top in range(first, last, BLOCK):
            rows = slice(top, min(top + BLOCK, last))
            k, l = framed.nearest(columns, np.arange(rows.start, rows.stop)[:, None])
            k, l = k - 1, l - 2
            out[rows] = np.where((k >= 0) & (k < across) & (l >= 0) & (l < down), l * across + k, -1)

    over_rows(find, height)
    return out


def _camera(picture: IIPicture) -> IICamera:
    assert picture.camera is not None  # a picture without one is regular
    return picture.camera


def _lattice(picture: IIPicture) -> Lattice:
    if picture.camera is not None:
        return picture.camera.lens_lattice
    return Lattice(picture.lenses, picture.ei_pixels, (0.0, 0.0), False)


def _nearest_whole(pitch: tuple[float, float]) -> Pair:
    across = max(1, int(pitch[0] + 0.5))
    return across, max(1, int(pitch[1] * across / pitch[0] + 0.5))


def _rectangles(lattice: Lattice, owner: Ints) -> tuple[Ints, Ints, Pair]:
    """Return the first column and row of each lens's rectangle, (L, K), and their common size in pixels."""
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
        # Centred on the lens as far as its pixels allow. A lens without pixels may lie far outside.
        fitted = np.clip(middle, high[axis].astype(np.int64) + 1 - extent, low[axis])
        limit = (width, height)[axis]
        corners.append(np.where(used, fitted, np.clip(middle, -extent, limit)).astype(np.int32))
        size.append(extent)
    return corners[0], corners[1], (size[0], size[1])


def _in_cell(lattice: Lattice, dx: NDArray[Any], dy: NDArray[Any]) -> Mask:
    """Return whether offsets of at most half a pitch from a lens centre lie in its cell, (V, U)."""
    (p, q), grid = lattice.pitch, (dy.size, dx.size)
    if not lattice.hexagonal:
        return np.ones(grid, np.bool_)
    # Bisector to the nearest lenses of the next rows; all others are farther away.
    return abs(dx)[None, :] * p + 2 * abs(dy)[:, None] * q <= p * p / 4 + q * q


def _regular_camera(camera: IICamera, ei_pixels: Pair, pixel_mm: float) -> IICamera:
    """Return the camera of a picture of elementary images of this size and pitch of pixels, side by side."""
    (u, v), (k, l) = ei_pixels, camera.lenses
    x, y = camera.lens_offset_mm
    made = replace(
        camera,
        pixels=(k * u, l * v),
        pixel_pitch_mm=pixel_mm,
        lattice="rectangular",
        lens_offset_mm=(0.0, 0.0),
        lens_turn_deg=0.0,
        lens_shear=0.0,
        lens_drift_mm=None,
        origin_mm=(camera.origin_mm[0] + x, camera.origin_mm[1] + y, camera.origin_mm[2]),
    )
    return made if made.regular and made.ei_pixels == ei_pixels else replace(made, packed=True)


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
    """out[l, v, k, u] = pixel (u, v) of the rectangle of lens (k, l), for l from first to last."""
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
    """out[n, m] = the pixel of its owner's rectangle, for n from first to last."""
    across = left.shape[1]
    for n in range(first, last):
        for m in range(owner.shape[1]):
            lens = owner[n, m]
            if lens >= 0:
                l, k = lens // across, lens % across
                for c in range(3):
                    out[n, m, c] = source[l, n - top[l, k], k, m - left[l, k], c]


@kernel
def resample_cells(source, owner, grid, whole, first, last, out, valid):
    """out[l, v, k, u] = the value at the lens centre (x, y)[l, k] + (dx, dy)[v, u], for l from first to last."""
    height, width = owner.shape
    for l in range(first, last):
        for v in range(grid.dy.shape[0]):
            for k in range(grid.x.shape[1]):
                for u in range(grid.dx.shape[1]):
                    px, py = grid.x[l, k] + grid.dx[v, u], grid.y[l, k] + grid.dy[v, u]
                    if not (0 <= px <= width and 0 <= py <= height):
                        continue
                    total, red, green, blue = _owned_sum(source, owner, l * grid.x.shape[1] + k, px, py)
                    if total > 1e-9:  # otherwise the owned pixels are at least a pixel away, within rounding
                        valid[l, v, k, u] = grid.inside[v, u]
                        red, green, blue = red / total, green / total, blue / total
                    else:
                        n, m = min(np.int64(py), height - 1), min(np.int64(px), width - 1)
                        red, green, blue = 1.0 * source[n, m, 0], 1.0 * source[n, m, 1], 1.0 * source[n, m, 2]
                    if whole:
                        red, green, blue = np.rint(red), np.rint(green), np.rint(blue)
                    out[l, v, k, u, 0], out[l, v, k, u, 1], out[l, v, k, u, 2] = red, green, blue


@exact_stage_kernel
def _owned_sum(source, owner, lens, px, py):
    """Return the bilinear weights of the four pixels around a place that a lens owns, and their weighted colours."""
    height, width = owner.shape
    row, column = np.int64(np.floor(py - 0.5)), np.int64(np.floor(px - 0.5))
    down, right = py - 0.5 - row, px - 0.5 - column
    total, red, green, blue = 0.0, 0.0, 0.0, 0.0
    for n in range(row, row + 2):
        for m in range(column, column + 2):
            if n < 0 or n >= height or m < 0 or m >= width:
                continue
            weight = (down if n > row else 1 - down) * (right if m > column else 1 - right)
            if weight > 0 and owner[n, m] == lens:
                total += weight
                red += weight * source[n, m, 0]
                green += weight * source[n, m, 1]
                blue += weight * source[n, m, 2]
    return total, red, green, blue


@kernel
def average_odd_rows(pixels, valid, whole):
    """Replace each lens of odd rows by the mean of itself and its left neighbour, or by the valid one of the two."""
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
