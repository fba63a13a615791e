"""Quilt of views across the viewing zone, for Looking Glass displays."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..base.checks import Pair, number, view_size, whole_pair
from ..formats.quilt import quilt_pixels
from ..picture.picture import IIPicture
from ..picture.view import camera_of
from .look import display_views, zone_half_deg


def quilt(
    picture: IIPicture,
    tiles: Pair,
    *,
    size: Pair,
    aspect: float | None = None,
    whole: bool = False,
    depth_mm: float | None = None,
    cone: float = 1.0,
) -> NDArray[np.uint8]:
    """Return views as tiles of one picture for Looking Glass displays, the leftmost at the bottom left.

    Parameters
    ----------
    tiles : (columns, rows)
    size : (width, height)
        Pixels of a tile.
    aspect : float, optional
        Width over height of the display, to which it stretches a tile; that of the tile's pixels if not given.
    whole : bool
        Show the whole lens array between black borders. Otherwise its sides, or its top and bottom, are cut off, so
        that it fills the display.
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
    shares = shown_shares(picture, width / height if aspect is None else aspect, whole=whole)
    views = display_views(picture, columns * rows, size=(width, height), depth_mm=depth_mm, cone=cone, shares=shares)
    return quilt_pixels(views, (columns, rows))


def shown_shares(picture: IIPicture, aspect: float, *, whole: bool = False) -> tuple[float, float]:
    """Return the shares of the lens array's width and height that fill a display of an aspect.

    One is 1; the other is below 1 where the array is cut, above where borders are black.
    """
    if not (math.isfinite(number("aspect", aspect)) and aspect > 0):
        raise ValueError(f"aspect is {aspect}: a positive number, width over height, is needed")
    (k, l), pitch = picture.lenses, camera_of(picture).lens_pitch_mm
    narrower = aspect * l * pitch[1] / (k * pitch[0])  # the display's aspect over that of the array
    return (1.0, 1 / narrower) if (narrower > 1) != whole else (narrower, 1.0)


def cone_share(picture: IIPicture, cone_deg: float) -> float:
    """Return the share of the viewing zone that covers an angle; 1 if the zone is narrower."""
    return min(1.0, cone_deg / 2 / zone_half_deg(picture))
