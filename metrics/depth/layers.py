"""Depth layers, and the point from which they are seen."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ii_core import IICamera, checks

LAYERS = 250
ALIKE = 1e-6  # depths that differ by less than this share of them differ by the rounding of a float32 map
Floats = NDArray[np.float64]


@checks.checked(camera=checks.instance(IICamera), count=checks.whole)
def linear_layers(camera: IICamera, count: int = LAYERS) -> Floats:
    """Layers at z = d·f from the pixel array, d = 1 … count, with f = Λ in the pinhole approximation, mm.

    The dissertation's layers. They end at count·Λ, 46 mm in `setup1` and 366 mm at its scale 8.
    """
    if count < 1:
        raise ValueError(f"count is {count} layers: at least 1 is needed")
    return np.arange(1.0, count + 1) * camera.gap_mm + camera.origin_mm[2]


def virtual_viewpoint(camera: IICamera) -> Floats:
    """V, (0, 0, Λ − K·Λ) before the middle of the array, in camera coordinates."""
    return np.array([0.0, 0.0, camera.gap_mm * (1 - camera.lenses[0])]) + camera.origin_mm


@checks.checked(near_mm=checks.number, far_mm=checks.number, count=checks.whole)
def logarithmic_layers(near_mm: float, far_mm: float, count: int = LAYERS) -> Floats:
    """Layers from near to far in equal ratios, mm."""
    if not 0 < near_mm < far_mm < math.inf:
        raise ValueError(f"near_mm is {near_mm}, far_mm {far_mm}: 0 < near < far is needed")
    if count < 1:
        raise ValueError(f"count is {count} layers: at least 1 is needed")
    return np.geomspace(near_mm, far_mm, count)


@checks.checked(camera=checks.instance(IICamera), depth_mm=checks.numbers, count=checks.whole)
def covering_layers(camera: IICamera, depth_mm: ArrayLike | None = None, count: int = LAYERS) -> Floats:
    """Layers in equal ratios over all depths of a picture, mm; `q_depth`'s and `depth_from_focus`'s default.

    Parameters
    ----------
    camera : IICamera
    depth_mm : array_like, optional
        Scene z in camera coordinates, NaN where nothing is hit. Layers run from its least to its greatest value
        in front of the pixel array. All values alike give one layer.
        If it is not given, or holds no such value, layers run over the depths that disparity can tell: from
        3Λ, where a point moves half an elementary image from one lens to the next and no neighbour sees it nearer,
        to (M + 1)Λ, where it moves one pixel over the whole array of M pixels.
    count : int
        Number of layers. Distances from the pixel array grow by one ratio from layer to layer.

    Returns
    -------
    ndarray of float64, (count,) or (1,)
    """
    z = np.asarray([] if depth_mm is None else depth_mm, np.float64) - camera.origin_mm[2]
    z = z[np.isfinite(z) & (z > 0)]
    near, far = (z.min(), z.max()) if z.size else (3 * camera.gap_mm, (camera.pixels[0] + 1) * camera.gap_mm)
    if not far > near * (1 + ALIKE):
        return np.array([near + camera.origin_mm[2]])
    return logarithmic_layers(near, far, count) + camera.origin_mm[2]


def logarithmic(layers_mm: Floats) -> bool:
    """Whether layers grow by one ratio, over more than a factor of ten: a chart of them has a logarithmic axis."""
    z = np.asarray(layers_mm)
    return bool(z.size > 2 and z[0] > 0 and z[-1] / z[0] > 10 and np.ptp(np.diff(np.log(z))) < 1e-6)


def check_layers(layers_mm: ArrayLike | None, camera: IICamera, depth_mm: ArrayLike | None = None) -> Floats:
    """The layers given, or those that cover; ValueError unless they are one or more positive depths that increase."""
    if layers_mm is None:
        return covering_layers(camera, depth_mm)
    layers = np.asarray(layers_mm, dtype=np.float64)
    if layers.ndim != 1 or not layers.size:
        raise ValueError(f"layers_mm is of shape {layers.shape}: a list of depths is needed")
    if not (np.isfinite(layers).all() and layers[0] > 0 and (np.diff(layers) > 0).all()):
        raise ValueError("layers_mm must be finite, positive and increase")
    return layers


def nearest_layer(z: Floats, layers_mm: Floats, gap_mm: float) -> NDArray[np.int64]:
    """Row of the nearest layer for each depth, −1 beyond the outer ones by more than half a layer, and for NaN.

    A depth halfway between two layers belongs to the farther one. A single layer reaches as far as one of the
    dissertation's layers would, half a gap each way.
    """
    if layers_mm.size == 1:
        edges = layers_mm[0] + gap_mm * np.array([-0.5, 0.5])
    else:
        inner = (layers_mm[1:] + layers_mm[:-1]) / 2
        edges = np.concatenate([[2 * layers_mm[0] - inner[0]], inner, [2 * layers_mm[-1] - inner[-1]]])
    row = np.searchsorted(edges, z, side="right") - 1
    return np.where(np.isnan(z) | (row >= layers_mm.size), -1, row)
