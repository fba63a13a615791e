"""Disparity of all views from that of one: moved, the nearest in front, holes filled by what lies behind."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..base import checks
from ..base.parallel import for_each
from ..camera.camera import Pair
from ..picture.disparity import rows_per_column
from ..picture.picture import IIPicture
from .disparity_kernels import move_to_view

Map = NDArray[np.float32]


@checks.checked(picture=checks.instance(IIPicture), disparity=checks.array, view=checks.indices)
def disparity_of_views(
    picture: IIPicture, disparity: NDArray[np.floating], view: Pair, *, filled: bool = True
) -> Map:
    """Return the disparity of all views from that of one, (V, U, L, K).

    A pixel of the view covers those pixels of another view within half a pixel; the larger disparity is in front.

    Parameters
    ----------
    picture : IIPicture
        Its structure and lens pitch count.
    disparity : ndarray, (L, K)
        Pixels a step between views; NaN where it is not known.
    view : (u, v)
        The view of ``disparity``.
    filled : bool
        Fill holes along rows by the lower of the disparities on both sides; else they are NaN.

    Raises
    ------
    ValueError
        If the disparity is of another size than a view.
    """
    picture.check_regular()
    (across, down), (u, v) = picture.lenses, picture.ei_pixels
    if disparity.shape != (down, across):
        raise ValueError(f"disparity is of shape {disparity.shape}: that of a view, {(down, across)}, is needed")
    if not (0 <= view[0] < u and 0 <= view[1] < v):
        raise ValueError(f"view is {view[0]},{view[1]}: columns 0–{u - 1} and rows 0–{v - 1} are there")
    known, sign = np.ascontiguousarray(disparity, np.float32), -1.0 if picture.erect else 1.0
    tall = rows_per_column(picture.camera)
    out = np.empty((v, u, down, across), np.float32)

    def move(at: Pair) -> None:
        step = sign * tall * (at[0] - view[1]), sign * (at[1] - view[0])
        move_to_view(known, np.float32(step[0]), np.float32(step[1]), filled, out[at])

    for_each(move, list(np.ndindex(v, u)))
    return out
