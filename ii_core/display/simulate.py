"""Simulation of an integral-imaging display, lens by lens."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.checks import view_size
from ..camera.camera import IICamera, Pair
from ..picture.picture import IIPicture, codes8
from ..picture.view import camera_of, lens_array_mm, view_positions


def display_simulation(
    picture: IIPicture, viewpoint_mm: ArrayLike, *, size: Pair, fill: float = 1.0
) -> NDArray[np.uint8]:
    """Return the display as an eye sees it: every lens is a patch of one colour, in perspective.

    The eye looks at the middle of the lens array, which fills its picture. A lens shows the pixel on the line from
    the eye through the lens centre (4.1). In side viewing zones this is a pixel of a neighbouring lens.

    Parameters
    ----------
    viewpoint_mm : array_like, (3,)
        Camera coordinates, in front of the lens plane.
    size : (width, height)
        Pixels of the eye's picture.
    fill : float
        Diameter of a lens over the pitch: 1 means adjacent square lenses, less means discs in a black mask.

    Returns
    -------
    ndarray of uint8, (height, width, 3)
        Black beside the display.
    """
    picture.check_regular()
    camera = camera_of(picture)
    width, height = view_size("size", size)
    if not 0 < fill <= 1:
        raise ValueError(f"fill is {fill}: a share from 0 to 1 is needed")
    x, y = view_positions(camera, viewpoint_mm, erect=picture.erect)
    spot = _spots(camera, np.asarray(viewpoint_mm, np.float64) - camera.origin_mm, (width, height))
    (k, l), pitch = picture.lenses, camera.lens_pitch_mm
    wide, high = lens_array_mm(camera)
    across = (spot[..., 0] + wide / 2) / pitch[0]
    down = (high / 2 - spot[..., 1]) / pitch[1]
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
    """Return the ends of lines of sight on the lens plane, (height, width, 2); NaN if they miss it."""
    middle = np.array([0.0, 0.0, camera.gap_mm])
    ahead = (middle - eye) / np.linalg.norm(middle - eye)
    right = np.cross([0.0, 1.0, 0.0], ahead)
    right /= np.linalg.norm(right)
    up = np.cross(ahead, right)
    wide, high = lens_array_mm(camera)
    corners = np.array([[x, y, camera.gap_mm] for x in (-1, 1) for y in (-1, 1)]) * [wide / 2, high / 2, 1] - eye
    tangents = np.abs(np.stack([corners @ right, corners @ up]) / (corners @ ahead))
    scale = max(tangents[0].max() / size[0], tangents[1].max() / size[1]) * 2
    x = (np.arange(size[0]) + 0.5 - size[0] / 2) * scale
    y = (size[1] / 2 - np.arange(size[1]) - 0.5) * scale
    rays = ahead + x[None, :, None] * right + y[:, None, None] * up
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (camera.gap_mm - eye[2]) / rays[..., 2]
    spots = eye[:2] + along[..., None] * rays[..., :2]
    return np.where((rays[..., 2] > 0)[..., None], spots, np.nan)
