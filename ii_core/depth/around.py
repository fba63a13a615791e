"""Views around one whose disparity is estimated, in the form of the kernels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.colour import srgb
from ..camera.camera import Pair
from ..picture.component import sub_images
from ..picture.disparity import rows_per_column
from ..picture.picture import IIPicture
from .disparity_kernels import Views

DIRECTIONS = ((0, -1), (0, 1), (-1, 0), (1, 0), (-1, -1), (1, 1), (-1, 1), (1, -1))
ON_A_LINE = 4  # views of a half-line whose differences are costs
CODES = 257.0  # 16-bit codes in one of 8 bits


def views_around(picture: IIPicture, view: Pair) -> Views:
    """Return all views as 16-bit sRGB planes, the reference first, with their steps and half-lines.

    A point of disparity D at pixel x of the reference is at x − p·D in the view whose step is p. Steps down are in
    the pixels of steps across: times `rows_per_column`.

    Parameters
    ----------
    view : (u, v)
        The reference, counted from the left and the top of `sub_images`.
    """
    stack = sub_images(picture)  # (V, U, L, K, 3)
    rows, cols, height, width, _ = stack.shape
    order = sorted(np.ndindex(rows, cols), key=lambda at: at != (view[1], view[0]))
    pixels = np.empty((rows * cols, 3, height, width), np.uint16)
    for n, at in enumerate(order):
        pixels[n] = codes16(stack[at]).transpose(2, 0, 1)
    steps = np.array(order, np.float32) - np.array([view[1], view[0]], np.float32)
    if picture.erect:
        steps = -steps
    lines = half_lines(steps)
    steps[:, 0] *= rows_per_column(picture.camera)
    return Views(pixels, steps, lines)


def codes16(pixels: NDArray[Any]) -> NDArray[np.uint16]:
    """Return 16-bit sRGB of pixels: 8 bits times 257; linear floats are clipped."""
    if pixels.dtype == np.uint8:
        return pixels.astype(np.uint16) * np.uint16(CODES)
    if pixels.dtype == np.uint16:
        return pixels
    return np.rint(65535 * srgb(np.clip(pixels, 0, 1))).astype(np.uint16)


def half_lines(steps: NDArray[np.float32]) -> NDArray[np.int64]:
    """Return the half-line of each view, in eight directions from the reference; −1 for none.

    At most `ON_A_LINE` views of a half-line count: every one of up to that many, else at growing distances, so that
    one is near enough for large disparities and one far enough for small ones.
    """
    found = np.full(len(steps), -1, np.int64)
    far = np.abs(steps).max(axis=1)
    for line, (down, across) in enumerate(DIRECTIONS):
        on = np.flatnonzero((far > 0) & (steps == far[:, None] * np.array([down, across])).all(axis=1))
        on = on[np.argsort(far[on])]
        wanted = np.unique(np.rint(np.geomspace(1, max(on.size, 1), ON_A_LINE)).astype(int)) - 1
        if on.size <= ON_A_LINE:
            wanted = np.arange(on.size)
        found[on[wanted[: on.size]]] = line
    return found


def halved(views: Views) -> Views:
    """Return views of half the width and height: means of 2×2 pixels; a last odd row or column is left out."""
    n, _, height, width = views.pixels.shape
    h, w = height // 2, width // 2
    small = np.empty((n, 3, h, w), np.uint16)
    for k in range(n):
        blocks = views.pixels[k, :, : 2 * h, : 2 * w].reshape(3, h, 2, w, 2)
        small[k] = (blocks.sum(axis=(2, 4), dtype=np.uint32) + 2) // 4
    return views._replace(pixels=small)
