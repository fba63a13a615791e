"""Focused views of a display: any viewpoint, size and focus depth; paths of viewpoints."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.checks import view_size
from ..base.jit import kernel
from ..camera.camera import IICamera, Pair
from ..picture.picture import IIPicture, codes8
from ..picture.view import camera_of, five_viewpoints, view_positions, widening

MOST_FRAMES = 3000  # longest film: two minutes at 25 frames per second


def focused_view(
    picture: IIPicture,
    viewpoint_mm: ArrayLike,
    *,
    size: Pair | None = None,
    depth_mm: float | None = None,
    aperture_px: float = 1.0,
    shares: tuple[float, float] = (1.0, 1.0),
) -> NDArray[np.uint8]:
    """Return the view of the lens array from a viewpoint, at any size, focused on one plane.

    Parameters
    ----------
    viewpoint_mm : array_like, (3,)
        Camera coordinates, in front of the lens plane.
    size : (width, height), optional
        Pixels of the view; one per lens if not given.
    depth_mm : float, optional
        z of the plane in focus; the lens plane if not given, for which ``aperture_px`` 1 gives `view_image`.
    aperture_px : float
        Radius of the aperture in pixels under a lens. 1, the minimum, interpolates linearly between neighbouring
        views; larger apertures blur other planes.
    shares : (across, down)
        Shares of the lens array, around its centre, that the view covers. Beyond the array it is black.

    Returns
    -------
    ndarray of uint8, (height, width, 3)
        sRGB; black if the line misses the pixel array.

    Raises
    ------
    ValueError
        If the picture has no camera or is not regular, or a parameter is out of range.
    """
    picture.check_regular()
    camera = camera_of(picture)
    (k, l), (u, v) = picture.lenses, picture.ei_pixels
    width, height = view_size("size", (k, l) if size is None else size)
    if not aperture_px >= 1:
        raise ValueError(f"aperture is {aperture_px} px: at least 1 is needed")
    x, y = view_positions(camera, viewpoint_mm, erect=picture.erect)
    # Positions are linear over lenses, also between two lenses.
    lens_x, lens_y = (
        ((np.arange(n) + 0.5) * share + (1 - share) * n / 2) * lenses / n - 0.5
        for n, lenses, share in zip((width, height), (k, l), shares, strict=True)
    )
    pixel_x, pixel_y = _line(x, u, lens_x), _line(y, v, lens_y)
    shift = _shifts(camera, picture.erect, depth_mm)
    out = np.zeros((height, width, 3), np.uint8)
    field = picture.with_pixels(codes8(picture.pixels)).light_field
    radius = np.minimum(aperture_px, np.maximum(1.0, np.array([u, v]) / 2))
    look(field, lens_x, lens_y, pixel_x, pixel_y, shift, radius, out)
    return out


def _line(positions: NDArray[np.float64], ei: int, lens: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the pixel under any lens coordinate, from the `view_positions` of whole lenses."""
    under = positions - np.arange(len(positions)) * ei
    slope = under[1] - under[0] if len(under) > 1 else 0.0
    return under[0] + slope * lens


def _shifts(camera: IICamera, erect: bool, depth_mm: float | None) -> NDArray[np.float64]:
    """Return the shift of a point from one view to the next, in lenses, across and down."""
    if depth_mm is None:
        return np.zeros(2)
    if not math.isfinite(depth_mm):
        raise ValueError(f"depth is {depth_mm} mm: a finite number is needed")
    per_mm = (-1 if erect else 1) * camera.pixel_pitch_mm / camera.gap_mm
    beyond = depth_mm - camera.origin_mm[2] - camera.gap_mm
    shift = per_mm * beyond / widening(camera, beyond) / np.array(camera.lens_pitch_mm)
    return shift * [1, camera.vertical_parallax]


@kernel
def held(shift, lens, lenses):
    """Return the focus at a position on the array, lenses per pixel, bounded by the distance to the border."""
    room = max(0.0, min(lens + 0.5, lenses - 0.5 - lens))
    return min(max(shift, -room), room)


@kernel
def look(field, lens_x, lens_y, pixel_x, pixel_y, shift, radius, out):
    """Average the pixels within the aperture, each under the lens that sees the same point of the plane in focus.

    The focus falls to 0 towards the border of the array, so that no lens beyond it is needed.
    """
    rows, columns, ei_v, ei_u, _ = field.shape
    for row in range(out.shape[0]):
        zone_v = math.floor((pixel_y[row] + 0.5) / ei_v)  # 0, or a neighbouring elementary image
        v = min(max(pixel_y[row] - zone_v * ei_v, 0.0), ei_v - 1.0)
        shift_v = held(shift[1], lens_y[row] + zone_v, rows)
        for column in range(out.shape[1]):
            zone_u = math.floor((pixel_x[column] + 0.5) / ei_u)
            u = min(max(pixel_x[column] - zone_u * ei_u, 0.0), ei_u - 1.0)
            shift_u = held(shift[0], lens_x[column] + zone_u, columns)
            red, green, blue, total = 0.0, 0.0, 0.0, 0.0
            for j in range(max(0, math.ceil(v - radius[1])), min(ei_v - 1, math.floor(v + radius[1])) + 1):
                weight_v = 1.0 - abs(j - v) / radius[1]
                y = lens_y[row] + zone_v + shift_v * (j - v)
                if weight_v <= 0.0 or y < -0.5 or y > rows - 0.5:
                    continue
                y0, ty = min(max(math.floor(y), 0), rows - 1), y - math.floor(y)
                y1 = min(max(math.floor(y) + 1, 0), rows - 1)
                for i in range(max(0, math.ceil(u - radius[0])), min(ei_u - 1, math.floor(u + radius[0])) + 1):
                    weight = weight_v * (1.0 - abs(i - u) / radius[0])
                    x = lens_x[column] + zone_u + shift_u * (i - u)
                    if weight <= 0.0 or x < -0.5 or x > columns - 0.5:
                        continue
                    x0, tx = min(max(math.floor(x), 0), columns - 1), x - math.floor(x)
                    x1 = min(max(math.floor(x) + 1, 0), columns - 1)
                    a, b = weight * (1.0 - ty) * (1.0 - tx), weight * (1.0 - ty) * tx
                    c, d = weight * ty * (1.0 - tx), weight * ty * tx
                    p, q, r, s = field[y0, x0, j, i], field[y0, x1, j, i], field[y1, x0, j, i], field[y1, x1, j, i]
                    red += a * p[0] + b * q[0] + c * r[0] + d * s[0]
                    green += a * p[1] + b * q[1] + c * r[1] + d * s[1]
                    blue += a * p[2] + b * q[2] + c * r[2] + d * s[2]
                    total += weight
            if total > 0.0:
                out[row, column, 0] = int(red / total + 0.5)
                out[row, column, 1] = int(green / total + 0.5)
                out[row, column, 2] = int(blue / total + 0.5)


def viewpoints_across(picture: IIPicture, count: int, *, cone: float = 1.0) -> NDArray[np.float64]:
    """Return viewpoints from left to right across the share ``cone`` of the viewing zone, (count, 3)."""
    if count < 1 or not 0 < cone <= 1:
        raise ValueError(f"{count} viewpoints in {cone} of the zone: at least 1 in a share from 0 to 1 are needed")
    return np.array([_turned(picture, t * cone, 0.0) for t in np.linspace(-1, 1, count) * (count > 1)])


def viewpoints_around(picture: IIPicture, count: int, *, cone: float = 0.9) -> NDArray[np.float64]:
    """Return viewpoints along an ellipse in the viewing zone, for a closed loop, (count, 3).

    Raises
    ------
    ValueError
        If ``count`` is less than 1 or more than `MOST_FRAMES`, or ``cone`` is not in (0, 1].
    """
    if count > MOST_FRAMES:
        raise ValueError(f"{count} frames: at most {MOST_FRAMES} are made")
    if count < 1 or not 0 < cone <= 1:
        raise ValueError(f"{count} viewpoints in {cone} of the zone: at least 1 in a share from 0 to 1 are needed")
    angles = 2 * math.pi * np.arange(count) / count
    return np.array([_turned(picture, cone * math.cos(a), cone * math.sin(a)) for a in angles])


def _half_angles(picture: IIPicture) -> tuple[float, float]:
    """Half angles of the viewing zone, across and down, radians."""
    camera = camera_of(picture)
    views, plane = five_viewpoints(camera), camera.origin_mm[2] + camera.gap_mm
    phi, theta = (
        math.atan2(abs(views[name][axis] - camera.origin_mm[axis]), plane - views[name][2])
        for name, axis in (("left", 0), ("up", 1))
    )
    return phi, theta


def zone_half_deg(picture: IIPicture) -> float:
    """Return half the angle of the viewing zone across, degrees."""
    return math.degrees(_half_angles(picture)[0])


def _turned(picture: IIPicture, x: float, y: float) -> NDArray[np.float64]:
    """Return the viewpoint at shares x and y of the zone's half angles, at the distance of `five_viewpoints`."""
    camera = camera_of(picture)
    plane = camera.origin_mm[2] + camera.gap_mm
    distance = plane - five_viewpoints(camera)["front"][2]
    phi, theta = _half_angles(picture)
    sx, sy = math.sin(x * phi), math.sin(y * theta)
    return np.array([*camera.origin_mm[:2], plane]) + distance * np.array(
        [sx, sy, -math.sqrt(max(0.01, 1 - sx * sx - sy * sy))]
    )


def display_views(
    picture: IIPicture,
    count: int,
    *,
    size: Pair,
    depth_mm: float | None = None,
    cone: float = 1.0,
    shares: tuple[float, float] = (1.0, 1.0),
) -> Iterator[NDArray[np.uint8]]:
    """Yield views from left to right for a multi-view display; parameters as for `focused_view`."""
    for place in viewpoints_across(picture, count, cone=cone):
        yield focused_view(picture, place, size=size, depth_mm=depth_mm, shares=shares)
