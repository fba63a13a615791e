"""Pictures focused by shifting and adding views: a plane, a tilted plane, everything; any pupil."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import checks
from ..base.colour import linear
from ..base.parallel import over_rows
from ..camera.camera import Pair
from ..picture.component import sub_images
from ..picture.disparity import disparity_of_depth, rows_per_column
from ..picture.picture import IIPicture, peak
from ..picture.view import camera_of
from .gather_kernels import add_view

PUPILS = ("square", "circle", "hexagon", "ring")
SAMPLES = 16  # of a view's side, that decide which share of it lies in a pupil


@checks.checked(
    picture=checks.instance(IIPicture),
    disparity=checks.numbers,
    weights=checks.numbers,
    view=checks.indices,
    bokeh=checks.number,
    limit=checks.number,
    workers=checks.whole_from(1, 1024),
)
def focused(
    picture: IIPicture,
    disparity: ArrayLike,
    *,
    weights: ArrayLike | None = None,
    view: Pair | None = None,
    bokeh: float = 1.0,
    limit: float | None = None,
    workers: int | None = None,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the weighted mean of all views, each moved so that points of a disparity meet, in linear light.

    Parameters
    ----------
    picture : IIPicture
        Regular.
    disparity : float or array_like, (L, K)
        What is in focus, pixels a step between views: a number for a plane, a map for any surface.
    weights : array_like, (V, U), optional
        The pupil: not negative, not all zero; all views alike by default.
    view : (u, v), optional
        The view whose pixels stay in place; the middle one by default.
    bokeh : float
        Light is averaged as its power, from 1 to 16: above 1 bright points count more.
    limit : float, optional
        Views whose linear light differs by more count less, such as those in which a point is hidden.
    workers : int, optional

    Returns
    -------
    light : ndarray of float32, (L, K, 3)
        Linear light; NaN where no view of the pupil sees the pixel's point.
    seen : ndarray of float32, (L, K)
        Share of the pupil that sees it, less than 1 towards the borders.

    Notes
    -----
    Between pixels views are interpolated by Catmull–Rom cubics. At whole disparities it is the mean of pixels.
    """
    picture.check_regular()
    (k, l), (u, v) = picture.lenses, picture.ei_pixels
    at = (u // 2, v // 2) if view is None else view
    if not (0 <= at[0] < u and 0 <= at[1] < v):
        raise ValueError(f"view is {at[0]},{at[1]}: columns 0–{u - 1} and rows 0–{v - 1} are there")
    pupil = np.ones((v, u)) if weights is None else np.asarray(weights, np.float64)
    if pupil.shape != (v, u) or not (np.isfinite(pupil) & (pupil >= 0)).all() or not pupil.any():
        raise ValueError(f"weights are of shape {pupil.shape}: {v}×{u} numbers, not negative, not all 0, are needed")
    checks.within("bokeh", bokeh, 1, 16)
    if limit is not None and not limit > 0:
        raise ValueError(f"limit is {limit:g}: a positive one is needed")
    given = np.asarray(disparity, np.float64)
    if given.shape not in ((), (l, k)):
        raise ValueError(f"disparity is of shape {given.shape}: a number, or a map of {(l, k)}, is needed")
    if given.ndim == 0 and not np.isfinite(given):
        raise ValueError(f"disparity is {given}: a finite number is needed")
    shift = np.ascontiguousarray(np.broadcast_to(given, (l, k)))
    stack, sign, tall = sub_images(picture), -1.0 if picture.erect else 1.0, rows_per_column(picture.camera)
    total, mass = np.zeros((l, k, 3)), np.zeros((l, k))
    own = _light(stack[at[1], at[0]], bokeh)
    for j, i in zip(*np.nonzero(pupil), strict=True):
        steps = sign * tall * (j - at[1]), sign * (i - at[0]), pupil[j, i], math.inf if limit is None else limit
        image = _light(stack[j, i], bokeh)

        def add(first: int, last: int, image: Any = image, steps: Any = steps) -> None:
            add_view(image, own, *steps, shift, total, mass, first, last)

        over_rows(add, l, workers=workers)
    with np.errstate(invalid="ignore", divide="ignore"):
        light = total / mass[..., None]
        if bokeh != 1:
            light = np.maximum(light, 0) ** (1 / bokeh)
    return light.astype(np.float32), (mass / pupil.sum()).astype(np.float32)


def _light(pixels: NDArray[Any], power: float) -> NDArray[np.float32]:
    """Return linear light of pixels to a power."""
    if pixels.dtype.kind == "f":
        light = pixels
    else:
        top = int(peak(pixels.dtype))
        light = linear(np.arange(top + 1) / top).astype(np.float32)[pixels]
    return np.ascontiguousarray(light if power == 1 else np.maximum(light, 0) ** power, np.float32)


@checks.checked(
    picture=checks.instance(IIPicture), depth_mm=checks.number, right_deg=checks.number, up_deg=checks.number
)
def plane_disparity(
    picture: IIPicture, depth_mm: float, *, right_deg: float = 0.0, up_deg: float = 0.0, view: Pair | None = None
) -> NDArray[np.float64]:
    """Return the disparity of a plane at each pixel of a view, (L, K).

    Parameters
    ----------
    picture : IIPicture
        With its camera.
    depth_mm : float
        z where the plane meets the axis.
    right_deg, up_deg : float
        Its tilt: how much farther it is to the right and upwards, from −89 to 89°.
    view : (u, v), optional
        The middle one by default.

    Returns
    -------
    ndarray of float64, (L, K)
        NaN where the plane is not before the camera.
    """
    camera = camera_of(picture)
    u, v = picture.ei_pixels
    at = (u // 2, v // 2) if view is None else view
    slope = [math.tan(math.radians(checks.within(name, angle, -89, 89, "angle", "°")))
             for name, angle in (("right_deg", right_deg), ("up_deg", up_deg))]  # fmt: skip
    checks.within("depth_mm", depth_mm, -checks.MOST_MM, checks.MOST_MM, "depth", " mm")
    z = np.empty((picture.lenses[1], picture.lenses[0]))
    for l in range(len(z)):
        row = l * v + at[1]
        start, way = (ray[0, at[0] :: u] for ray in camera.rays(rows=slice(row, row + 1)))
        ahead = way[:, 2] - slope[0] * way[:, 0] - slope[1] * way[:, 1]
        behind = depth_mm + slope[0] * start[:, 0] + slope[1] * start[:, 1] - start[:, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            share = behind / ahead
            z[l] = np.where((share >= 0) & np.isfinite(share), start[:, 2] + share * way[:, 2], np.nan)
    return disparity_of_depth(camera, z)


@checks.checked(views=checks.indices, shape=checks.text, size=checks.number)
def pupil_weights(views: Pair, shape: str = "circle", size: float = 1.0) -> NDArray[np.float64]:
    """Return the share of each view in a pupil, (V, U).

    Parameters
    ----------
    views : (U, V)
    shape : {"square", "circle", "hexagon", "ring"}
        A ring is a circle without its inner half.
    size : float
        Diameter over the side of all views, above 0 to 2; the middle view counts at least.
    """
    if shape not in PUPILS:
        raise ValueError(f"unknown shape {shape!r}: known are {', '.join(PUPILS)}")
    if not 0 < size <= 2:
        raise ValueError(f"size is {size:g}: above 0 to 2 is needed")
    u, v = views
    if u < 1 or v < 1:
        raise ValueError(f"views are {u}×{v}: at least 1×1 is needed")
    x = ((np.arange(u * SAMPLES) + 0.5) / SAMPLES - u / 2) / (u / 2 * size)
    y = ((np.arange(v * SAMPLES) + 0.5) / SAMPLES - v / 2) / (v / 2 * size)
    xx, yy = np.meshgrid(x if u > 1 else 0 * x, y if v > 1 else 0 * y)
    far = {
        "square": np.maximum(abs(xx), abs(yy)),
        "circle": np.hypot(xx, yy),
        "ring": np.hypot(xx, yy),
        "hexagon": np.maximum(abs(yy) / math.cos(math.pi / 6), abs(xx) + abs(yy) / math.sqrt(3)),
    }[shape]
    inside = (far <= 1) & ((far >= 0.5) if shape == "ring" else True)
    weights = inside.reshape(v, SAMPLES, u, SAMPLES).mean(axis=(1, 3))
    if not weights.any():
        weights[v // 2, u // 2] = 1.0
    return np.asarray(weights)
