"""Quilt of views across the viewing zone, for Looking Glass displays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..base.checks import Pair, view_size, whole_pair
from ..formats.quilt import quilt_pixels
from ..picture.picture import IIPicture
from .look import display_views


def quilt(
    picture: IIPicture, tiles: Pair, *, size: Pair, depth_mm: float | None = None, cone: float = 1.0
) -> NDArray[np.uint8]:
    """Return views as tiles of one picture for Looking Glass displays, the leftmost at the bottom left.

    Parameters
    ----------
    tiles : (columns, rows)
    size : (width, height)
        Pixels of a tile.
    depth_mm : float, optional
        z of the scene plane that appears in the plane of the display.
    cone : float
        Share of the viewing zone that the views cover.

    Returns
    -------
    ndarray of uint8, (rows · height, columns · width, 3)
    """
    columns, rows = whole_pair("tiles", tiles)
    width, height = view_size("size", size, columns * rows)
    views = display_views(picture, columns * rows, size=(width, height), depth_mm=depth_mm, cone=cone)
    return quilt_pixels(views, (columns, rows))
