"""Virtual camera of Q_depth: the pixel under each lens that it sees."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..camera.camera import IICamera
from ..picture.picture import IIPicture
from ..picture.view import camera_of, view_positions
from .layers import virtual_viewpoint


def virtual_camera_pixels(camera: IICamera, *, erect: bool = False) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return row and column of the pixel under each lens that the virtual camera sees.

    Returns
    -------
    n, m : ndarray of int
        They broadcast to (L, K), without the rows of lenses whose line misses the pixel array. Only arrays higher
        than wide have such rows.
    """
    n, m, _ = seen_pixels(camera, erect)
    return n, m


def view_of(picture: IIPicture) -> NDArray[Any]:
    """Return the view of the virtual camera: one pixel of the picture per lens, (L', K, 3)."""
    n, m = virtual_camera_pixels(camera_of(picture), erect=picture.erect)
    return picture.pixels[n, m]


def seen_pixels(camera: IICamera, erect: bool) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return `virtual_camera_pixels` and the indices of the remaining lens rows."""
    x, y = view_positions(camera, virtual_viewpoint(camera), erect=erect)
    m, n = (np.floor(position + 0.5).astype(np.int64) for position in (x, y))
    kept = np.flatnonzero((n >= 0) & (n < camera.pixels[1]))
    return n[kept, None], m[None, :], kept
