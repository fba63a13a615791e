"""Disparity between neighbouring views and depth, for cameras whose views are taken from one plane.

A point h beyond the lens plane moves by −δP·h / (Λ·δL·(1 + h/d)) view pixels a step between views, d the distance at
which viewing zones meet, infinite if they are parallel. It is positive before the lens plane and negative behind it:
the sign of the HCI benchmark.

Disparity is that across. Where lenses stand closer down than across, as hexagonal ones do, a point moves by more
view pixels down than across: see `rows_per_column`.

Lenses before the array image the scene to both sides of the lens plane: h is then that of the paraxial image.
"""

from __future__ import annotations

from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import checks
from ..camera.camera import IICamera


def _measures(camera: IICamera) -> tuple[float, float]:
    """Return δP/(Λ·δL), in view pixels a step and mm, and 1/d."""
    step = camera.pixel_pitch_mm / (camera.gap_mm * camera.lens_pitch_mm[0])
    return step, 0.0 if camera.viewer_mm is None else 1 / camera.viewer_mm


def rows_per_column(camera: IICamera | None) -> float:
    """Return the rows of a view by which a point moves from view to view down, over the columns of those across."""
    return 1.0 if camera is None else camera.lens_pitch_mm[0] / camera.lens_pitch_mm[1]


def _relayed(camera: IICamera, z_mm: Any, *, back: bool) -> Any:
    """Return depths in the scene as the array sees them through the lenses in front, or ``back``; mm from the pixels.

    NaN before and inf back where no point of the scene is: the pixel side of the last vertex.
    """
    if not camera.front:
        return z_mm
    matrix = reduce(np.matmul, [element.relay() for element in reversed(camera.front)])
    end = camera.front[-1].end_mm
    (a, b), (c, d) = matrix if back else np.linalg.inv(matrix)
    with np.errstate(divide="ignore", invalid="ignore"):
        seen = np.where(np.isinf(z_mm), np.divide(a, c), (a * z_mm + b) / (c * z_mm + d))
        if back:
            return np.where(seen <= end, np.inf, seen)
        return np.where(z_mm <= end, np.nan, seen)


@checks.checked(camera=checks.instance(IICamera), z_mm=checks.numbers)
def disparity_of_depth(camera: IICamera, z_mm: ArrayLike) -> NDArray[np.float64]:
    """Return the disparity of points, view pixels a step between views.

    Parameters
    ----------
    camera : IICamera
    z_mm : array_like
        Depth in camera coordinates, NaN where there is none.

    Returns
    -------
    ndarray of float64
        NaN of points on the pixel side of a lens before the array.
    """
    step, meeting = _measures(camera)
    z = np.asarray(z_mm, np.float64) - camera.origin_mm[2]
    h: Any = _relayed(camera, z, back=False) - camera.gap_mm
    with np.errstate(divide="ignore"):
        return np.asarray(-step / (1 / h + meeting))  # also of infinity


@checks.checked(camera=checks.instance(IICamera), disparity=checks.numbers)
def depth_of_disparity(camera: IICamera, disparity: ArrayLike) -> NDArray[np.float64]:
    """Return the depth z in camera coordinates, mm, of points of a disparity; infinite where no depth has it.

    The inverse of `disparity_of_depth`.
    """
    step, meeting = _measures(camera)
    d: Any = np.asarray(disparity, np.float64)
    slope = step + d * meeting
    with np.errstate(divide="ignore", invalid="ignore"):
        h = np.where(slope > 0, -d / slope, np.where(np.isnan(d), np.nan, np.inf))
    return np.asarray(_relayed(camera, h + camera.gap_mm, back=True) + camera.origin_mm[2])
