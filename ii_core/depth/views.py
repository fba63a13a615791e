"""Depth from views whose viewing zones meet: disparity of both signs.

A field of converged cameras has points on both sides of its lens plane, and most disparities are below a pixel a
view. Then a point is seen under few lenses, and by many pixels under each. So views are compared, not lenses: whole
steps from view to view, interpolated between the pixels of a view. The kernels are those of `focus`; they get the
views side by side, in which neighbouring pixels of a view are neighbours.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..camera.camera import IICamera
from ..picture.disparity import disparity_of_depth, rows_per_column
from ..picture.picture import IIPicture
from .layers import Floats
from .lens_tables import Table


def views_side_by_side(picture: IIPicture) -> NDArray[np.generic]:
    """Return the pixels of a regular picture as a mosaic of its views: view (v, u) at row v·L, column u·K."""
    height, width = picture.pixels.shape[:2]
    return picture.light_field.transpose(2, 0, 3, 1, 4).reshape(height, width, 3)


def view_tables(
    camera: IICamera,
    layers_mm: Floats,
    across: NDArray[np.int64],
    down: NDArray[np.int64],
    *,
    erect: bool = False,
    nearest: bool = False,
) -> tuple[Table, Table]:
    """Return the pixels of `views_side_by_side` that see the point of each layer at every pixel of the middle view.

    A point of disparity D at pixel x of the middle view is at x − p·D in the view p steps to the right.

    Parameters
    ----------
    across, down : ndarray of int, (n,)
        Steps p from the middle view to the right and down.
    nearest : bool
        Take the nearest pixel of a view, instead of interpolating.

    Returns
    -------
    cols, rows : (ndarray of int32, ndarray of float64), (layers, n, K) and (layers, n, L)
        As those of `pixel_tables`.
    """
    (k, l), (u, v) = camera.lenses, camera.ei_pixels
    disparity = disparity_of_depth(camera, layers_mm)
    sign = -1 if erect else 1
    return (
        _view_table(k, u, sign * across, across, disparity, nearest),
        _view_table(l, v, sign * down, down, disparity * rows_per_column(camera), nearest),
    )


def _view_table(
    side: int, views: int, order: NDArray[np.int64], steps: NDArray[np.int64], disparity: Floats, nearest: bool
) -> Table:
    """Along one axis: pixel of the mosaic by layer, step and pixel of the middle view."""
    view = (views // 2 + order)[None, :, None]
    # Rounded: a whole disparity must name whole pixels, also at the border.
    place = np.round(np.arange(side) - disparity[:, None, None] * steps[:, None], 9)
    if nearest:
        place = np.floor(place + 0.5)
    seen = (view >= 0) & (view < views) & (place >= 0) & (place <= side - 1)
    low = np.floor(np.where(seen, place, 0))
    return np.where(seen, view * side + low, -1).astype(np.int32), np.where(seen, place - low, 0.0)


def view_steps(views: int, rings: int) -> NDArray[np.int64]:
    """Return steps from the middle view to at most that many views on each side, (2·n + 1,)."""
    half = (views - 1) // 2
    steps = np.unique(np.rint(np.linspace(1, half, rings))).astype(np.int64) if half else np.empty(0, np.int64)
    return np.concatenate([-steps[::-1], [0], steps])


def near_and_far(views: tuple[int, int]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the views of B and R of the dissertation's method: 3×3 in the middle, and 5×5 over all views."""
    halves = [(count - 1) // 2 for count in views]
    near = [np.arange(-min(1, half // 2), min(1, half // 2) + 1) for half in halves]
    far = [np.unique(np.rint(np.linspace(-half, half, 5))) for half in halves]
    b, r = (np.stack(np.meshgrid(*spread), axis=-1).reshape(-1, 2).astype(np.int64) for spread in (near, far))
    return b, r


def place_of(camera: IICamera, layers_mm: Floats) -> Floats:
    """Return the position of layers for `pass_on`: minus the disparity in pixels a view, which grows with depth.

    One pixel a view then weighs as much as a change of depth by the factor e does in the method by lenses.
    """
    return -disparity_of_depth(camera, layers_mm)
