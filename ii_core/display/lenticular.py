"""Interlaced picture for a panel under slanted cylindrical lenses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..base.checks import Pair, checked, instance, number, view_size, whole, whole_pair, within
from ..picture.picture import IIPicture
from .look import display_views

MOST, MOST_ALONG = 1e9, 1 << 16  # pixels


@checked(picture=instance(IIPicture), size=whole_pair, views=whole, depth_mm=number, cone=number)
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
    """Return views interlaced for a panel under slanted cylindrical lenses, subpixel by subpixel.

    Red lies a third of a pixel left of green, and blue a third right. A subpixel at column x and row y has the
    position t under its lens. The rightmost view lies at the left end of a lens::

        t = (x + slope · y − centre_px) / pitch_px  mod 1,   view = views − 1 − ⌊t · views⌋

    Parameters
    ----------
    size : (width, height)
        Pixels of the panel.
    pitch_px : float
        Lens pitch along a row, in pixels.
    slope : float
        Shift of the lenses to the left from one row to the next one below, in pixels.
    centre_px : float
        Column of a border between two lenses in the top row; pixel centres are whole numbers.
    views : int
        Number of views; more than 3 · pitch_px have no effect.

    Returns
    -------
    ndarray of uint8, (height, width, 3)

    Raises
    ------
    ValueError
        If a parameter is out of range.
    """
    width, height = view_size("size", size)
    if max(width, height) > MOST_ALONG:
        raise ValueError(f"size is {width}×{height}: at most {MOST_ALONG} a side is needed")
    within("pitch_px", pitch_px, 1e-3, MOST)
    within("slope", slope, -MOST, MOST)
    within("centre_px", centre_px, -MOST, MOST)
    y, x, channel = np.ogrid[:height, :width, :3]
    t = ((x + (channel - 1) / 3 + slope * y - centre_px) / pitch_px) % 1.0
    number = (
        views - 1 - np.minimum((t * views + 1e-6).astype(np.int32), views - 1)
    )  # rounds ties alike on all platforms
    out = np.empty((height, width, 3), np.uint8)
    made = display_views(picture, views, size=(width, height), depth_mm=depth_mm, cone=cone)
    for i, view in enumerate(made):
        np.copyto(out, view, where=number == i)
    return out
