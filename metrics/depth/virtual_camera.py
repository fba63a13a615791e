"""Virtual camera of Q_depth: the pixel under each lens that it sees."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core import IICamera, IIPicture
from ii_core.view import camera_of, view_positions

from .layers import virtual_viewpoint


def virtual_camera_pixels(camera: IICamera, *, erect: bool = False) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return row and column of the one pixel under each lens that the virtual camera sees.

    Returns
    -------
    n, m : ndarray of int
        Broadcast to (L, K), less the rows whose line ends off the pixel array (only an array higher than wide
        has such rows).
    """
    n, m, _ = seen_pixels(camera, erect)
    return n, m


def view_of(picture: IIPicture) -> NDArray[Any]:
    """Return what the virtual camera sees: one pixel of the picture through each lens, (L', K, 3)."""
    n, m = virtual_camera_pixels(camera_of(picture), erect=picture.erect)
    return picture.pixels[n, m]


def seen_pixels(camera: IICamera, erect: bool) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """As `virtual_camera_pixels`, and the rows of lenses that are left."""
    x, y = view_positions(camera, virtual_viewpoint(camera), erect=erect)
    m, n = (np.floor(position + 0.5).astype(np.int64) for position in (x, y))
    kept = np.flatnonzero((n >= 0) & (n < camera.pixels[1]))
    return n[kept, None], m[None, :], kept
