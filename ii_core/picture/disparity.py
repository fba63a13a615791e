"""Disparity between neighbouring views and depth, for cameras whose views are taken from one plane.

A point h beyond the lens plane moves by −δP·h / (Λ·δL·(1 + h/d)) view pixels a step between views, d the distance at
which viewing zones meet, infinite if they are parallel. It is positive before the lens plane and negative behind it:
the sign of the HCI benchmark.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import checks
from ..camera.camera import IICamera


def _measures(camera: IICamera) -> tuple[float, float]:
    """Return δP/(Λ·δL), in view pixels a step and mm, and 1/d."""
    if camera.front:
        raise ValueError("a lens before the array bends rays: disparity does not follow from depth")
    step = camera.pixel_pitch_mm / (camera.gap_mm * camera.lens_pitch_mm[0])
    return step, 0.0 if camera.viewer_mm is None else 1 / camera.viewer_mm


@checks.checked(camera=checks.instance(IICamera), z_mm=checks.numbers)
def disparity_of_depth(camera: IICamera, z_mm: ArrayLike) -> NDArray[np.float64]:
    """Return the disparity of points, view pixels a step between views.

    Parameters
    ----------
    camera : IICamera
    z_mm : array_like
        Depth in camera coordinates, NaN where there is none.

    Raises
    ------
    ValueError
        If an element stands in front of the lenses.
    """
    step, meeting = _measures(camera)
    h: Any = np.asarray(z_mm, np.float64) - camera.origin_mm[2] - camera.gap_mm
    with np.errstate(divide="ignore"):
        return np.asarray(-h * step / (1 + h * meeting))


@checks.checked(camera=checks.instance(IICamera), disparity=checks.numbers)
def depth_of_disparity(camera: IICamera, disparity: ArrayLike) -> NDArray[np.float64]:
    """Return the depth z in camera coordinates, mm, of points of a disparity; infinite where no depth has it.

    The inverse of `disparity_of_depth`; parameters and errors are like those.
    """
    step, meeting = _measures(camera)
    d: Any = np.asarray(disparity, np.float64)
    slope = step + d * meeting
    with np.errstate(divide="ignore", invalid="ignore"):
        h = np.where(slope > 0, -d / slope, np.where(np.isnan(d), np.nan, np.inf))
    return np.asarray(h + camera.origin_mm[2] + camera.gap_mm)
