"""Depth layers, and the virtual camera of Q_depth: its viewpoint and the pixels that it sees."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import checks
from ..camera.camera import ASSUMED, IICamera
from ..picture.disparity import depth_of_disparity, disparity_of_depth
from ..picture.picture import IIPicture
from ..picture.view import camera_of, view_positions

LAYERS = 250
FIELD_SPAN, FARTHEST = 16.0, 100.0  # pixels; distances at which viewing zones meet
ALIKE = 1e-6  # relative tolerance of equal depths: rounding of a float32 map
Floats = NDArray[np.float64]


@checks.checked(camera=checks.instance(IICamera), count=checks.whole)
def linear_layers(camera: IICamera, count: int = LAYERS) -> Floats:
    """Return the dissertation's layers z = d·f, d = 1 … count, from the pixel array in mm; f = Λ for pinholes.

    They end at count·Λ: 46 mm in `setup1`, 366 mm at its scale 8.
    """
    if count < 1:
        raise ValueError(f"count is {count} layers: at least 1 is needed")
    return np.arange(1.0, count + 1) * camera.gap_mm + camera.origin_mm[2]


def virtual_viewpoint(camera: IICamera) -> Floats:
    """Return V = (0, 0, Λ − K·Λ), in front of the middle of the array, in camera coordinates.

    If viewing zones meet at a distance d, V = (0, 0, Λ − d), where every lens shows its own elementary image; before
    `packed` ones that are narrower than their lenses V stands farther off, so that they do, too.
    """
    wide = max(1.0, camera.lens_pitch_mm[0] / camera.ei_pitch_mm[0])
    distance = camera.viewer_mm or camera.gap_mm * camera.lenses[0] * wide
    return np.array([0.0, 0.0, camera.gap_mm - distance]) + camera.origin_mm


@checks.checked(near_mm=checks.number, far_mm=checks.number, count=checks.whole)
def logarithmic_layers(near_mm: float, far_mm: float, count: int = LAYERS) -> Floats:
    """Return layers from near to far in equal ratios, mm."""
    if not 0 < near_mm < far_mm < math.inf:
        raise ValueError(f"near_mm is {near_mm}, far_mm {far_mm}: 0 < near < far is needed")
    if count < 1:
        raise ValueError(f"count is {count} layers: at least 1 is needed")
    return np.geomspace(near_mm, far_mm, count)


@checks.checked(camera=checks.instance(IICamera), depth_mm=checks.numbers, count=checks.whole)
def covering_layers(camera: IICamera, depth_mm: ArrayLike | None = None, count: int = LAYERS) -> Floats:
    """Return layers in equal ratios over all depths of a picture, mm: the default of depth functions.

    Parameters
    ----------
    camera : IICamera
    depth_mm : array_like, optional
        Scene z in camera coordinates, NaN without a hit. Layers cover its range in front of the pixel array; equal
        values give one layer. Without depth, layers cover the depths that disparity distinguishes, from 3Λ to (M +
        1)Λ. At 3Λ the disparity between neighbouring lenses is half an elementary image; nearer points are in no
        other elementary image. At (M + 1)Λ the disparity is one pixel over all lenses of an array of M pixels.
    count : int
        Number of layers. Distances from the pixel array, or from where rays start if the camera has a ``start_mm``,
        grow by one ratio from layer to layer.

    Returns
    -------
    ndarray of float64, (count,) or (1,)
    """
    base = first_mm(camera)
    z = np.asarray([] if depth_mm is None else depth_mm, np.float64) - base
    z = z[np.isfinite(z) & (z > 0)]
    near, far = (z.min(), z.max()) if z.size else (3 * camera.gap_mm, (camera.pixels[0] + 1) * camera.gap_mm)
    if not far > near * (1 + ALIKE):
        return np.array([near + base])
    return logarithmic_layers(near, far, count) + base


@checks.checked(camera=checks.instance(IICamera), low=checks.number, high=checks.number, count=checks.whole)
def disparity_layers(camera: IICamera, low: float, high: float, count: int = LAYERS) -> Floats:
    """Return layers of equal steps in disparity, mm: of both signs if the camera sees both sides of its lens plane.

    Parameters
    ----------
    camera : IICamera
    low, high : float
        Disparities of the farthest and the nearest layer, view pixels a step between views.
    count : int

    Raises
    ------
    ValueError
        If ``low`` is not below ``high``, or no depth before the camera has one of the disparities.
    """
    if not low < high or count < 2:
        raise ValueError(f"low is {low}, high {high}, count {count}: low < high and at least 2 layers are needed")
    layers = depth_of_disparity(camera, np.linspace(high, low, count))
    if not (np.isfinite(layers).all() and layers[0] > first_mm(camera) and (np.diff(layers) > 0).all()):
        raise ValueError(f"no depth before the camera has a disparity from {low:g} to {high:g} px")
    return layers


@checks.checked(camera=checks.instance(IICamera), count=checks.whole)
def field_layers(camera: IICamera, count: int = LAYERS) -> Floats:
    """Return layers of equal steps in disparity, of both signs, for views whose viewing zones meet, mm.

    A point of the nearest layer moves by `FIELD_SPAN` pixels from the middle view to the outermost, and one of the
    farthest as much the other way, unless rays start, or infinity lies, between them.

    Raises
    ------
    ValueError
        If the viewing zones of the camera are parallel.
    """
    if camera.viewer_mm is None:
        raise ValueError("viewing zones are parallel: layers of disparity are for views that meet")
    span = FIELD_SPAN / max((max(camera.ei_pixels) - 1) // 2, 1)
    infinity = float(disparity_of_depth(camera, FARTHEST * (camera.viewer_mm + camera.gap_mm) + camera.origin_mm[2]))
    return disparity_layers(camera, max(-span, infinity), possible(camera, span)[1], count)


def logarithmic(layers_mm: Floats) -> bool:
    """Return whether layers have equal ratios and span more than a factor of ten, for a logarithmic axis."""
    z = np.asarray(layers_mm)
    return bool(z.size > 2 and z[0] > 0 and z[-1] / z[0] > 10 and np.ptp(np.diff(np.log(z))) < 1e-6)


def first_mm(camera: IICamera) -> float:
    """Return the z before which no layer lies: where rays start, or the pixel array if that is at the lenses."""
    return camera.origin_mm[2] + (camera.gap_mm - camera.start_mm if camera.start_mm else 0.0)


def possible(camera: IICamera | None, most: float) -> tuple[float, float]:
    """Return the disparities of depths before the camera, at most ``most`` px in size."""
    if camera is None or camera.name == ASSUMED or camera.both_sides:
        return -most, most
    if camera.front:
        return max(-most, float(disparity_of_depth(camera, np.inf))), most
    plane, start, meeting = camera.origin_mm[2] + camera.gap_mm, camera.start_mm, camera.viewer_mm or math.inf
    infinity = -most if meeting == math.inf else float(disparity_of_depth(camera, plane + FARTHEST * meeting))
    nearest = most if start >= meeting else float(disparity_of_depth(camera, plane - (1 - ALIKE) * start)) + 0.0
    return max(-most, infinity), min(most, nearest)


def check_layers(layers_mm: ArrayLike | None, camera: IICamera, depth_mm: ArrayLike | None = None) -> Floats:
    """Return the given layers, or by default `covering_layers`; of converged views without depth, `field_layers`.

    Raises
    ------
    ValueError
        If the layers are not beyond `first_mm`, finite and increasing.
    """
    if layers_mm is None and depth_mm is None and camera.viewer_mm is not None:
        return field_layers(camera)
    if layers_mm is None:
        return covering_layers(camera, depth_mm)
    layers = np.asarray(layers_mm, dtype=np.float64)
    if layers.ndim != 1 or not layers.size:
        raise ValueError(f"layers_mm is of shape {layers.shape}: a list of depths is needed")
    if not (np.isfinite(layers).all() and layers[0] > first_mm(camera) and (np.diff(layers) > 0).all()):
        where = "positive" if first_mm(camera) == 0 else f"beyond {first_mm(camera):g} mm"
        raise ValueError(f"layers_mm must be finite, {where} and increase")
    return layers


def nearest_layer(z: Floats, layers_mm: Floats, gap_mm: float) -> NDArray[np.int64]:
    """Return the index of the nearest layer of each depth; −1 for NaN and beyond the outer layers by half a layer.

    A depth halfway between two layers belongs to the farther one. A single layer is one gap thick, as the
    dissertation's layers are.
    """
    if layers_mm.size == 1:
        edges = layers_mm[0] + gap_mm * np.array([-0.5, 0.5])
    else:
        inner = (layers_mm[1:] + layers_mm[:-1]) / 2
        edges = np.concatenate([[2 * layers_mm[0] - inner[0]], inner, [2 * layers_mm[-1] - inner[-1]]])
    row = np.searchsorted(edges, z, side="right") - 1
    return np.where(np.isnan(z) | (row >= layers_mm.size), -1, row)


def virtual_camera_pixels(camera: IICamera, *, erect: bool = False) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return row and column of the pixel under each lens that the virtual camera sees.

    Returns
    -------
    n, m : ndarray of int
        They broadcast to (L, K), without the rows of lenses whose line misses the pixel array. Only arrays higher
        than wide have such rows.
    """
    n, m, _ = seen_pixels(camera, erect)
    return n, m


def view_of(picture: IIPicture) -> NDArray[Any]:
    """Return the view of the virtual camera: one pixel of the picture per lens, (L', K, 3)."""
    n, m = virtual_camera_pixels(camera_of(picture), erect=picture.erect)
    return picture.pixels[n, m]


def seen_pixels(camera: IICamera, erect: bool) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return `virtual_camera_pixels` and the indices of the remaining lens rows."""
    x, y = view_positions(camera, virtual_viewpoint(camera), erect=erect)
    m, n = (np.floor(position + 0.5).astype(np.int64) for position in (x, y))
    kept = np.flatnonzero((n >= 0) & (n < camera.pixels[1]))
    return n[kept, None], m[None, :], kept
