"""View images, refocused images, and conversion to upright elementary images."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import checks
from ..camera.camera import IICamera
from .component import picture_pixels, sub_images
from .picture import IIPicture

FARTHEST_MM = 1e15  # of a viewpoint, far beyond every camera: all of its lines are parallel


@checks.checked(picture=checks.instance(IIPicture), viewpoint_mm=checks.numbers, interpolation=checks.text)
def view_image(
    picture: IIPicture, viewpoint_mm: ArrayLike, *, interpolation: str = "linear"
) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Return the view image from a viewpoint: one pixel through each lens.

    Parameters
    ----------
    picture : IIPicture
        With its camera.
    viewpoint_mm : array_like, (3,)
        Camera coordinates; viewers of a display are at z < 0.
    interpolation : {"linear", "nearest"}
        Interpolation between pixels of one elementary image, never across its border.

    Returns
    -------
    pixels : ndarray, (L, K, 3)
        Of the picture's pixel type; 0 if not valid.
    valid : ndarray of bool, (L, K)
        False if the line misses the pixel array.

    Raises
    ------
    ValueError
        If the picture has no camera, the viewpoint is not three finite numbers in front of the lens plane, or
        the interpolation is unknown.

    References
    ----------
    Olsson 2008, (4.1), (4.2), with the offset in pixels and the sign that follows from D = lens − pixel.
    """
    if interpolation not in ("linear", "nearest"):
        raise ValueError(f"unknown interpolation {interpolation!r}: known are linear, nearest")
    picture.check_regular()
    (width, height), (u, v) = picture.size, picture.ei_pixels
    x, y = view_positions(camera_of(picture), viewpoint_mm, erect=picture.erect)
    x, y = x.clip(-1, width), y.clip(-1, height)  # pixels beyond the array are never read
    m, n = np.floor(x + 0.5).astype(np.int64), np.floor(y + 0.5).astype(np.int64)
    valid = ((n >= 0) & (n < height))[:, None] & ((m >= 0) & (m < width))[None, :]
    m, n = m.clip(0, width - 1), n.clip(0, height - 1)
    if interpolation == "nearest":
        pixels = picture.pixels[n[:, None], m[None, :]]
    else:
        left, right, across = _between(x, m, u)
        above, below, down = _between(y, n, v)
        p = picture.pixels
        top = _mix(p[above[:, None], left], p[above[:, None], right], across[None, :, None])
        bottom = _mix(p[below[:, None], left], p[below[:, None], right], across[None, :, None])
        value = _mix(top, bottom, down[:, None, None])
        pixels = value.astype(p.dtype) if p.dtype.kind == "f" else np.rint(value).astype(p.dtype)
    pixels[~valid] = 0
    return pixels, valid


@checks.checked(camera=checks.instance(IICamera), viewpoint_mm=checks.numbers)
def view_positions(
    camera: IICamera, viewpoint_mm: ArrayLike, *, erect: bool = False
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the ends on the pixel array of the lines from a viewpoint through the lens centres, in pixels.

    Returns
    -------
    x, y : ndarray, (K,) and (L,)
        Pixel column for each lens column, pixel row for each lens row; whole numbers are pixel centres. Beyond the
        border of an elementary image they continue into its neighbour: the side viewing zone.
    """
    e = np.array(checks.place("viewpoint_mm", viewpoint_mm, 3, FARTHEST_MM))
    plane = camera.origin_mm[2] + camera.gap_mm
    if not e[2] < plane:
        raise ValueError(
            f"viewpoint z {e[2]:g} mm is not before the lens plane at {plane:g} mm: z < {plane:g} is needed"
        )
    e = e - camera.origin_mm
    (k, l), (u, v) = camera.lenses, camera.ei_pixels
    sign = -1.0 if erect else 1.0
    (width, height), (pitch_x, pitch_y), down = lens_array_mm(camera), camera.lens_pitch_mm, camera.vertical_parallax
    lens_x = (np.arange(k) + 0.5) * pitch_x - width / 2
    lens_y = height / 2 - (np.arange(l) + 0.5) * pitch_y
    to_pixels = sign * camera.gap_mm / ((camera.gap_mm - e[2]) * camera.pixel_pitch_mm)
    x = np.arange(k) * u + (u - 1) / 2 - (lens_x - e[0]) * to_pixels
    y = np.arange(l) * v + (v - 1) / 2 + (lens_y - e[1]) * to_pixels * down
    aside = pixels_aside(camera, sign)
    return x + lens_x * aside, y - lens_y * aside * down


def pixels_aside(camera: IICamera, sign: float) -> float:
    """Return how far elementary images stand beside their lenses, if zones meet: pixels by mm of a lens's place.

    ``sign`` is −1 for erect elementary images.
    """
    return 0.0 if camera.viewer_mm is None else sign * camera.gap_mm / (camera.viewer_mm * camera.pixel_pitch_mm)


def lens_array_mm(camera: IICamera) -> tuple[float, float]:
    """Width and height of the lens array of a regular structure."""
    if camera.viewer_mm is None:
        return camera.size_mm
    across, down = camera.lens_pitch_mm
    return camera.lenses[0] * across, camera.lenses[1] * down


@checks.checked(camera=checks.instance(IICamera))
def five_viewpoints(camera: IICamera) -> dict[str, NDArray[np.float64]]:
    """Return the viewpoints front, up, down, left and right, from which every lens shows its own elementary image.

    Their distance is that at which viewing zones meet, or else three times the nearest distance of the viewing zone.
    The rotations about the centre of the display are the largest within the viewing zone, less half a pixel.

    References
    ----------
    Olsson 2008, §4.3.2, with r, φ and θ from the viewing zone.
    """
    (width, height), (pitch_x, pitch_y) = lens_array_mm(camera), camera.ei_pitch_mm
    gap, meeting = camera.gap_mm, 0.0 if camera.viewer_mm is None else 1 / camera.viewer_mm
    tan_x, tan_y = pitch_x / 2 / gap, pitch_y / 2 / gap
    r = camera.viewer_mm or 3 * max(width / 2 / tan_x, height / 2 / tan_y * camera.vertical_parallax)
    # A lens at the far edge, W/2, sees its own EI while (W/2 + r·sin φ) / (r·cos φ) ≤ tan + W/2d.
    inside_x = tan_x - 0.5 * camera.pixel_pitch_mm / gap + width / 2 * meeting
    inside_y = tan_y - 0.5 * camera.pixel_pitch_mm / gap + height / 2 * meeting
    phi = max(0.0, _rotation(inside_x, width / 2 / r))
    theta = max(0.0, _rotation(inside_y, height / 2 / r))

    def at(x: float, y: float, angle: float) -> NDArray[np.float64]:
        place = np.array([x * r * math.sin(angle), y * r * math.sin(angle), gap - r * math.cos(angle)])
        return place + camera.origin_mm

    return {
        "front": at(0, 0, 0.0),
        "up": at(0, 1, theta),
        "down": at(0, -1, theta),
        "left": at(-1, 0, phi),
        "right": at(1, 0, phi),
    }


@checks.checked(camera=checks.instance(IICamera), across=checks.whole)
def projection_camera(camera: IICamera, across: int) -> tuple[IICamera, NDArray[np.float64]]:
    """Return a 2-D pinhole camera that sees the scene through the whole display, and its pose.

    Its pinhole is the nearest point from which every lens shows its own elementary image. Its picture is that of the
    virtual camera of (4.5), at any resolution.

    Parameters
    ----------
    camera : IICamera
    across : int
        Pixels across; rows follow from the aspect of the display.

    Returns
    -------
    pinhole : IICamera
        Of one lens. Its picture is upside down; `orthoscopic` turns it.
    pose : ndarray, (4, 4)
        From the pinhole camera's frame to the II-camera's.
    """
    if across < 1:
        raise ValueError(f"across is {across}: at least 1 pixel is needed")
    (width, height), gap = camera.size_mm, camera.lenses[0] * camera.gap_mm
    pinhole = IICamera(
        name="projection",
        pixels=(across, max(1, round(across * height / width))),
        lenses=(1, 1),
        pixel_pitch_mm=width / across,
        gap_mm=gap,
    )
    pose = stand_back(pinhole, camera.gap_mm)
    pose[:3, 3] += camera.origin_mm
    return pinhole, pose


@checks.checked(camera=checks.instance(IICamera), plane_mm=checks.number)
def stand_back(camera: IICamera, plane_mm: float = 0.0) -> NDArray[np.float64]:
    """Return the pose in which the plane z = ``plane_mm`` exactly fills the picture of a camera of one lens."""
    checks.within("plane_mm", plane_mm, -checks.MOST_MM, checks.MOST_MM, unit=" mm")
    pose = np.eye(4)
    pose[2, 3] = plane_mm - 2 * camera.gap_mm
    return pose


def _rotation(tangent: float, half_over_r: float) -> float:
    """Return the angle φ with tangent·cos φ − sin φ = half_over_r."""
    return math.acos(min(1.0, half_over_r / math.hypot(1, tangent))) - math.atan2(1, tangent)


@checks.checked(picture=checks.instance(IIPicture), depth_mm=checks.number)
def refocus(picture: IIPicture, depth_mm: float) -> NDArray[np.float32]:
    """Return the scene focused on one plane, by shifting and adding sub-images.

    Parameters
    ----------
    depth_mm : float
        z of the plane in camera coordinates, beyond where rays start: the lens plane, unless the camera has a
        ``start_mm``.

    Returns
    -------
    ndarray of float32, (L, K, 3)
        In code values. A pixel is the mean over the sub-images that cover it.
    """
    camera = camera_of(picture)
    start = camera.origin_mm[2] + camera.gap_mm - camera.start_mm
    if not start <= checks.within("depth_mm", depth_mm, -checks.MOST_MM, checks.MOST_MM, "depth", " mm"):
        where = f"where rays start, {start:g} mm" if camera.start_mm else f"the lens plane at {start:g} mm"
        raise ValueError(f"depth_mm {depth_mm:g} is not beyond {where}")
    stack = sub_images(picture)
    v_count, u_count, rows, cols, _ = stack.shape
    sign = -1.0 if picture.erect else 1.0
    beyond = depth_mm - camera.origin_mm[2] - camera.gap_mm
    per_step = sign * camera.pixel_pitch_mm * beyond / camera.gap_mm / widening(camera, beyond)
    total, weight = np.zeros((rows, cols, 3)), np.zeros((rows, cols, 1))
    pitch_x, pitch_y = camera.lens_pitch_mm
    for v in range(v_count):
        i0, i1, di, in_y = _shifted(rows, (v - (v_count - 1) / 2) * per_step / pitch_y)
        for u in range(u_count):
            j0, j1, dj, in_x = _shifted(cols, (u - (u_count - 1) / 2) * per_step / pitch_x)
            si = stack[v, u]
            value = _mix(_mix(si[i0][:, j0], si[i0][:, j1], dj), _mix(si[i1][:, j0], si[i1][:, j1], dj), di[:, None])
            seen = (in_y[:, None] & in_x[None, :])[..., None]
            total += np.where(seen, value, 0.0)
            weight += seen
    return (total / np.maximum(weight, 1)).astype(np.float32)


@checks.checked(picture=checks.instance(IIPicture))
def orthoscopic(picture: IIPicture) -> IIPicture:
    """Rotate every elementary image by 180°: pseudoscopic to orthoscopic and back."""
    picture.check_regular()
    return IIPicture(turned_pixels(picture), picture.lenses, picture.ei_pixels, picture.camera, not picture.erect)


def turned_pixels(picture: IIPicture) -> NDArray[Any]:
    """Return the pixels with every elementary image rotated by 180°, (N, M, 3)."""
    return picture_pixels(picture.light_field[:, :, ::-1, ::-1], "ei")


def widening(camera: IICamera, beyond_mm: float) -> float:
    """Return the sampling distance of a sub-image at a plane over that in the lens plane; 1 if zones are parallel."""
    return 1.0 if camera.viewer_mm is None else 1 + beyond_mm / camera.viewer_mm


def camera_of(picture: IIPicture) -> IICamera:
    """Return the picture's camera.

    Raises
    ------
    ValueError
        If it has none.
    """
    if picture.camera is None:
        raise ValueError("the picture has no camera: ii_core.with_assumed_camera gives it one of a viewing angle")
    return picture.camera


def _between(position, nearest, size):
    """Return the two pixels around a position, inside its elementary image, and the weight of the second."""
    first = nearest // size * size
    inside = np.clip(position - first, 0, size - 1)
    low = np.minimum(np.floor(inside).astype(np.int64), max(size - 2, 0))
    high = np.minimum(low + 1, size - 1)
    return first + low, first + high, inside - low


def _shifted(count, shift):
    """Return indices and weights that sample a row of ``count`` pixels at index + shift, and which are inside."""
    position = np.arange(count) + shift
    inside = (position >= 0) & (position <= count - 1)
    low = np.clip(np.floor(position).astype(np.int64), 0, count - 1)
    high = np.minimum(low + 1, count - 1)
    return low, high, (position - low)[:, None], inside


def _mix(a, b, weight):
    return a * (1.0 - weight) + b * weight
