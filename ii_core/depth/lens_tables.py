"""Lenses that see a point of each layer, and the pixels under them: tables for the kernels of depth from focus."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..camera.camera import IICamera
from ..picture.view import view_positions
from .layers import Floats, virtual_viewpoint

Table = tuple[NDArray[np.int32], Floats]
# The robust method: lenses in each direction, at most; a step to no lens.
RINGS, NOWHERE = 7, 1 << 24


def whole_pixel_steps(shift: Floats, ei: int) -> NDArray[np.int64]:
    """Steps to lenses in which the points of each layer fall on whole pixels, as nearly as lenses stand.

    Where a picture has detail finer than its pixels, a value between two pixels is that of neither: only whole
    pixels can be compared. So the farther a layer, the farther the lenses.

    Parameters
    ----------
    shift : ndarray of float64, (layers,)
        Pixels that a point moves in its elementary image from one lens to the next.
    ei : int
        The side of the elementary image, in pixels.

    Returns
    -------
    ndarray of int64, (layers, 2·n + 1)
        To the left, 0, to the right; n is up to RINGS, fewer for small elementary images. A lens that stands for
        two of them counts once: the other step leads nowhere.
    """
    half = max((ei - 1) // 2, min(ei - 1, 1))
    pixels = np.unique(np.rint(np.linspace(1, half, RINGS))) if half else np.empty(0)
    steps = np.maximum(np.rint(pixels / np.abs(shift[:, None])), 1).astype(np.int64)
    again = np.zeros(steps.shape, bool)
    again[:, 1:] = steps[:, 1:] == steps[:, :-1]
    steps[again] = NOWHERE
    return np.concatenate([-steps[:, ::-1], np.zeros((len(shift), 1), np.int64), steps], axis=1)


def star(middle_x: int, middle_y: int) -> NDArray[np.int64]:
    """Columns of two tables of steps, (n, 2): in eight directions from their middles, which come last."""
    rings = max(middle_x, middle_y)
    found = [
        (middle_x + i * r, middle_y + j * r)
        for r in range(1, rings + 1)
        for i in (-1, 0, 1)
        for j in (-1, 0, 1)
        if (i or j) and abs(i) * r <= middle_x and abs(j) * r <= middle_y
    ]
    return np.array([*found, (middle_x, middle_y)])


def pixel_tables(
    camera: IICamera,
    layers_mm: Floats,
    across: NDArray[Any],
    down: NDArray[Any],
    *,
    erect: bool = False,
    nearest: bool = False,
    snap: bool = False,
) -> tuple[Table, Table]:
    """Which pixel under each neighbour sees the point of each layer that the virtual camera sees through a lens.

    Parameters
    ----------
    across, down : ndarray of int, (n,) or (layers, n)
        Neighbours' steps i to the right and j down.
    nearest : bool
        Take the pixel in whose square the line ends, instead of going between pixels.
    snap : bool
        Follow the ray of the very pixel that `q_depth` measures rather than the line through the lens centre.

    Returns
    -------
    cols : (ndarray of int32, ndarray of float64), (layers, n, K)
        The pixel left of where the line ends, −1 if the neighbour does not see the point, and the weight of the
        pixel right of it; with ``nearest`` the weight is 0.
    rows : likewise, (layers, n, L)
        The pixel above, and the weight of the one below.
    """
    (u, v) = camera.ei_pixels
    per_lens = pixels_per_lens(camera, layers_mm)
    x, y = view_positions(camera, virtual_viewpoint(camera), erect=erect)
    if snap:
        x, y = np.floor(x + 0.5), np.floor(y + 0.5)
    sign = -1.0 if erect else 1.0
    # Without vertical parallax one row of pixels, under whatever lens, sees one row of the scene.
    wide, high = (pitch / camera.pixel_pitch_mm for pitch in camera.lens_pitch_mm) if camera.packed else (u, v)
    vertical = sign * per_lens * high if camera.vertical_parallax else np.full_like(per_lens, -v)
    return _table(x, u, sign * per_lens * wide, across, nearest), _table(y, v, vertical, down, nearest)


def pixels_per_lens(camera: IICamera, layers_mm: Floats) -> Floats:
    """Return the shift of a point of each layer from lens to lens, in sides of the elementary image: Λ/z'.

    Where rays start at the lenses nothing is in focus before them: infinitely far off through all but the own lens.
    """
    beyond = np.asarray(layers_mm) - camera.origin_mm[2] - camera.gap_mm
    with np.errstate(divide="ignore"):
        return np.where((beyond > 0) | (camera.start_mm > 0), camera.gap_mm / beyond, np.inf)


def _table(position: Floats, ei: int, per_step: Floats, steps: NDArray[Any], nearest: bool) -> Table:
    """Along one axis: own lens's pixel position, EI side, pixels a step by layer → pixel by layer, step and lens."""
    lens = np.arange(position.size)
    step = np.atleast_2d(steps)[:, :, None]
    with np.errstate(invalid="ignore"):
        moved = np.where(step == 0, 0.0, step * per_step[:, None, None])
    inside = position - lens * ei + moved
    centre = np.floor(inside + 0.5)
    other = lens + step
    seen = (centre >= 0) & (centre < ei) & (other >= 0) & (other < position.size)
    if nearest:
        low, weight = centre, np.zeros(seen.shape)
    else:
        inside = np.where(seen, np.clip(inside, 0, ei - 1), 0.0)
        low = np.floor(inside)
        weight = inside - low
    return np.where(seen, other * ei + np.where(seen, low, 0), -1).astype(np.int32), weight
