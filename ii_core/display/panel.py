"""II-pictures for other displays: views of any size and focus, quilts, lenticular interlacing, and how an
integral-imaging display itself looks to somebody before it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..camera import IICamera, Pair, positive, whole_pair
from ..jit import kernel
from ..picture import IIPicture, codes8
from ..view import camera_of, five_viewpoints, view_positions

ASSUMED_ANGLE_DEG = 20.0


def with_assumed_camera(picture: IIPicture) -> IIPicture:
    """The picture, with a camera of 1 mm pixels that sees 20° if it has none: enough to look at it from aside."""
    if picture.camera is not None:
        return picture
    gap = picture.ei_pixels[0] / 2 / math.tan(math.radians(ASSUMED_ANGLE_DEG / 2))
    camera = IICamera(pixels=picture.size, lenses=picture.lenses, pixel_pitch_mm=1.0, gap_mm=gap, name="assumed")
    return replace(picture, camera=camera)


def focused_view(
    picture: IIPicture,
    viewpoint_mm: ArrayLike,
    *,
    size: Pair | None = None,
    depth_mm: float | None = None,
    aperture_px: float = 1.0,
) -> NDArray[np.uint8]:
    """What a viewer sees of the whole lens array, at any size, focused on one plane.

    Parameters
    ----------
    viewpoint_mm : array_like, (3,)
        Camera coordinates, before the lens plane.
    size : (width, height), optional
        Pixels, stretched over the array; one a lens if not given.
    depth_mm : float, optional
        z of the plane on which neighbouring views are laid over each other; the lens plane if not given, and then
        with ``aperture_px`` 1 this is `view_image`.
    aperture_px : float
        Radius of the aperture in pixels under a lens, at least 1: that interpolates linearly between neighbouring
        views; more blurs what is off the plane.

    Returns
    -------
    ndarray of uint8, (height, width, 3)
        sRGB; black where the line leaves the pixel array.

    Raises
    ------
    ValueError
        If the picture has no camera or is not regular, or a parameter is out of range.
    """
    picture.check_regular()
    camera = camera_of(picture)
    (k, l), (u, v) = picture.lenses, picture.ei_pixels
    width, height = whole_pair("size", (k, l) if size is None else size)
    if not aperture_px >= 1:
        raise ValueError(f"aperture is {aperture_px} px: at least 1 is needed")
    x, y = view_positions(camera, viewpoint_mm, erect=picture.erect)
    # Positions are straight lines over the lenses: at those between two lenses, between their positions.
    across, down = (np.arange(n) + 0.5 for n in (width, height))
    lens_x, lens_y = across * k / width - 0.5, down * l / height - 0.5
    pixel_x, pixel_y = _line(x, u, lens_x), _line(y, v, lens_y)
    shift = _shifts(camera, picture.erect, depth_mm)
    out = np.zeros((height, width, 3), np.uint8)
    field = codes8(picture.pixels).reshape(l, v, k, u, 3)
    radius = np.minimum(aperture_px, np.maximum(1.0, np.array([u, v]) / 2))
    look(field, lens_x, lens_y, pixel_x, pixel_y, shift, radius, out)
    return out


def _line(positions: NDArray[np.float64], ei: int, lens: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixel under the lens at any lens coordinate, from `view_positions` of whole lenses."""
    under = positions - np.arange(len(positions)) * ei
    slope = under[1] - under[0] if len(under) > 1 else 0.0
    return under[0] + slope * lens


def _shifts(camera: IICamera, erect: bool, depth_mm: float | None) -> NDArray[np.float64]:
    """Lenses from a point's place in one view to its place in the next, across and down."""
    if depth_mm is None:
        return np.zeros(2)
    if not math.isfinite(depth_mm):
        raise ValueError(f"depth is {depth_mm} mm: a finite number is needed")
    per_mm = (-1 if erect else 1) * camera.pixel_pitch_mm / camera.gap_mm
    shift = per_mm * (depth_mm - camera.origin_mm[2] - camera.gap_mm) / np.array(camera.lens_pitch_mm)
    return shift * [1, camera.lens_model.vertical_parallax]


@kernel
def held(shift, lens, lenses):
    """Focus, in lenses a pixel, of a place on the array: no more than there are lenses to the border."""
    room = max(0.0, min(lens + 0.5, lenses - 0.5 - lens))
    return min(max(shift, -room), room)


@kernel
def look(field, lens_x, lens_y, pixel_x, pixel_y, shift, radius, out):
    """All pixels within the aperture, each under the lens that sees the same point of the plane in focus.

    Towards the array's border the focus goes back to 0, so that the lens of the next pixel is never beyond it.
    """
    rows, ei_v, columns, ei_u, _ = field.shape
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
                    p, q, r, s = field[y0, j, x0, i], field[y0, j, x1, i], field[y1, j, x0, i], field[y1, j, x1, i]
                    red += a * p[0] + b * q[0] + c * r[0] + d * s[0]
                    green += a * p[1] + b * q[1] + c * r[1] + d * s[1]
                    blue += a * p[2] + b * q[2] + c * r[2] + d * s[2]
                    total += weight
            if total > 0.0:
                out[row, column, 0] = int(red / total + 0.5)
                out[row, column, 1] = int(green / total + 0.5)
                out[row, column, 2] = int(blue / total + 0.5)


def viewpoints_across(picture: IIPicture, count: int, *, cone: float = 1.0) -> NDArray[np.float64]:
    """Viewpoints from left to right through the viewing zone, or the share ``cone`` of it, (count, 3)."""
    if count < 1 or not 0 < cone <= 1:
        raise ValueError(f"{count} viewpoints in {cone} of the zone: at least 1 in a share from 0 to 1 are needed")
    return np.array([_turned(picture, t * cone, 0.0) for t in np.linspace(-1, 1, count) * (count > 1)])


def viewpoints_around(picture: IIPicture, count: int, *, cone: float = 0.9) -> NDArray[np.float64]:
    """Viewpoints along an ellipse in the viewing zone, for a loop without an end, (count, 3)."""
    if count < 1 or not 0 < cone <= 1:
        raise ValueError(f"{count} viewpoints in {cone} of the zone: at least 1 in a share from 0 to 1 are needed")
    angles = 2 * math.pi * np.arange(count) / count
    return np.array([_turned(picture, cone * math.cos(a), cone * math.sin(a)) for a in angles])


def _turned(picture: IIPicture, x: float, y: float) -> NDArray[np.float64]:
    """The place at shares x and y of the viewing zone's half angles, at the distance of `five_viewpoints`."""
    camera = camera_of(picture)
    views, plane = five_viewpoints(camera), camera.origin_mm[2] + camera.gap_mm
    distance = plane - views["front"][2]
    phi, theta = (
        math.atan2(abs(views[name][axis] - camera.origin_mm[axis]), plane - views[name][2])
        for name, axis in (("left", 0), ("up", 1))
    )
    sx, sy = math.sin(x * phi), math.sin(y * theta)
    return np.array([*camera.origin_mm[:2], plane]) + distance * np.array(
        [sx, sy, -math.sqrt(max(0.01, 1 - sx * sx - sy * sy))]
    )


def display_views(
    picture: IIPicture, count: int, *, size: Pair, depth_mm: float | None = None, cone: float = 1.0
) -> Iterator[NDArray[np.uint8]]:
    """Views from left to right for a multi-view display; parameters as `focused_view`, which see."""
    for place in viewpoints_across(picture, count, cone=cone):
        yield focused_view(picture, place, size=size, depth_mm=depth_mm)


def quilt(
    picture: IIPicture, tiles: Pair, *, size: Pair, depth_mm: float | None = None, cone: float = 1.0
) -> NDArray[np.uint8]:
    """Views as tiles of one picture, as Looking Glass displays take them: the leftmost at the bottom left.

    Parameters
    ----------
    tiles : (columns, rows)
    size : (width, height)
        Of a tile, in pixels.
    depth_mm : float, optional
        The plane that appears in the display's own plane.
    cone : float
        Share of the viewing zone that the views span.

    Returns
    -------
    ndarray of uint8, (rows · height, columns · width, 3)
    """
    columns, rows = whole_pair("tiles", tiles)
    width, height = whole_pair("size", size)
    out = np.empty((rows, height, columns, width, 3), np.uint8)
    views = display_views(picture, columns * rows, size=(width, height), depth_mm=depth_mm, cone=cone)
    for number, view in enumerate(views):
        out[rows - 1 - number // columns, :, number % columns] = view
    return out.reshape(rows * height, columns * width, 3)


def lenticular(
    picture: IIPicture,
    *,
    size: Pair,
    pitch_px: float,
    slope: float = 0.0,
    centre_px: float = 0.0,
    views: int = 48,
    depth_mm: float | None = None,
    cone: float = 1.0,
) -> NDArray[np.uint8]:
    """Views interlaced for a panel under slanted cylindrical lenses: every subpixel has a view of its own.

    A subpixel at column x and row y, red a third of a pixel left of green and blue a third right, lies at the share
    t of its lens; behind a lens the rightmost view lies on the left::

        t = (x + slope · y − centre_px) / pitch_px  mod 1,   view = views − 1 − ⌊t · views⌋

    Parameters
    ----------
    size : (width, height)
        Of the panel, in pixels.
    pitch_px : float
        From lens to lens along a row, in pixels.
    slope : float
        Pixels by which the lenses lean to the left from one row to the one below.
    centre_px : float
        Column, in the top row, of a border between two lenses; pixel centres are at whole numbers.
    views : int
        How many are made; more than 3 · pitch_px are not told apart.

    Returns
    -------
    ndarray of uint8, (height, width, 3)

    Raises
    ------
    ValueError
        If a parameter is out of range.
    """
    width, height = whole_pair("size", size)
    positive("pitch_px", pitch_px)
    if not (math.isfinite(slope) and math.isfinite(centre_px)):
        raise ValueError(f"slope {slope}, centre {centre_px}: finite numbers are needed")
    y, x, channel = np.ogrid[:height, :width, :3]
    t = ((x + (channel - 1) / 3 + slope * y - centre_px) / pitch_px) % 1.0
    number = views - 1 - np.minimum((t * views + 1e-6).astype(np.int32), views - 1)  # ties go one way everywhere
    out = np.empty((height, width, 3), np.uint8)
    made = display_views(picture, views, size=(width, height), depth_mm=depth_mm, cone=cone)
    for i, view in enumerate(made):
        np.copyto(out, view, where=number == i)
    return out


def display_simulation(
    picture: IIPicture, viewpoint_mm: ArrayLike, *, size: Pair, fill: float = 1.0
) -> NDArray[np.uint8]:
    """How the display looks to an eye: every lens a patch of one colour, seen in perspective.

    The eye looks at the middle of the lens array, which just fits its picture. A lens shows the pixel on the line
    from the eye through the lens's centre (4.1); from far aside those are its neighbour's: the side viewing zones.

    Parameters
    ----------
    viewpoint_mm : array_like, (3,)
        Camera coordinates, before the lens plane.
    size : (width, height)
        Of the eye's picture, in pixels.
    fill : float
        Diameter of a lens as a share of the pitch: 1 is square lenses side by side, less are discs in a black mask.

    Returns
    -------
    ndarray of uint8, (height, width, 3)
        Black beside the display.
    """
    picture.check_regular()
    camera = camera_of(picture)
    width, height = whole_pair("size", size)
    if not 0 < fill <= 1:
        raise ValueError(f"fill is {fill}: a share from 0 to 1 is needed")
    x, y = view_positions(camera, viewpoint_mm, erect=picture.erect)
    spot = _spots(camera, np.asarray(viewpoint_mm, np.float64) - camera.origin_mm, (width, height))
    (k, l), pitch = picture.lenses, camera.lens_pitch_mm
    across = (spot[..., 0] + camera.size_mm[0] / 2) / pitch[0]
    down = (camera.size_mm[1] / 2 - spot[..., 1]) / pitch[1]
    with np.errstate(invalid="ignore"):
        inside = (across >= 0) & (across < k) & (down >= 0) & (down < l)
    column, row = (np.where(inside, n, 0).astype(np.int64) for n in (across, down))
    m, n = np.floor(x + 0.5).astype(np.int64)[column], np.floor(y + 0.5).astype(np.int64)[row]
    (w, h), pixels = picture.size, codes8(picture.pixels)
    seen = inside & (m >= 0) & (m < w) & (n >= 0) & (n < h)
    if fill < 1:
        seen &= np.hypot(across - column - 0.5, down - row - 0.5) <= fill / 2
    return np.where(seen[..., None], pixels[n.clip(0, h - 1), m.clip(0, w - 1)], 0).astype(np.uint8)


def _spots(camera: IICamera, eye: NDArray[np.float64], size: Pair) -> NDArray[np.float64]:
    """Where on the lens plane the lines of sight of an eye's pixels end, (height, width, 2), NaN if they do not."""
    middle = np.array([0.0, 0.0, camera.gap_mm])
    ahead = (middle - eye) / np.linalg.norm(middle - eye)
    right = np.cross([0.0, 1.0, 0.0], ahead)
    right /= np.linalg.norm(right)
    up = np.cross(ahead, right)
    corners = np.array([[x, y, camera.gap_mm] for x in (-1, 1) for y in (-1, 1)]) * [
        camera.size_mm[0] / 2, camera.size_mm[1] / 2, 1,
    ] - eye  # fmt: skip
    tangents = np.abs(np.stack([corners @ right, corners @ up]) / (corners @ ahead))
    scale = max(tangents[0].max() / size[0], tangents[1].max() / size[1]) * 2
    x = (np.arange(size[0]) + 0.5 - size[0] / 2) * scale
    y = (size[1] / 2 - np.arange(size[1]) - 0.5) * scale
    rays = ahead + x[None, :, None] * right + y[:, None, None] * up
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (camera.gap_mm - eye[2]) / rays[..., 2]
    spots = eye[:2] + along[..., None] * rays[..., :2]
    return np.where((rays[..., 2] > 0)[..., None], spots, np.nan)
