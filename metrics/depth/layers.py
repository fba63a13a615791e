"""Depth layers, and the point from which they are seen."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ii_core import IICamera

LAYERS = 250
Floats = NDArray[np.float64]


def linear_layers(camera: IICamera, count: int = LAYERS) -> Floats:
    """Layers at z = d·f from the pixel array, d = 1 … count, with f = Λ in the pinhole approximation, mm."""
    if count < 1:
        raise ValueError(f"{count} layers: at least 1 is needed")
    return np.arange(1.0, count + 1) * camera.gap_mm + camera.origin_mm[2]


def virtual_viewpoint(camera: IICamera) -> Floats:
    """V, (0, 0, Λ − K·Λ) before the middle of the array, in camera coordinates."""
    return np.array([0.0, 0.0, camera.gap_mm * (1 - camera.lenses[0])]) + camera.origin_mm


def logarithmic_layers(near_mm: float, far_mm: float, count: int = LAYERS) -> Floats:
    """Layers from near to far in equal ratios, mm."""
    if not 0 < near_mm < far_mm < math.inf:
        raise ValueError(f"layers from {near_mm} to {far_mm} mm: 0 < near < far is needed")
    if count < 1:
        raise ValueError(f"{count} layers: at least 1 is needed")
    return np.geomspace(near_mm, far_mm, count)


def check_layers(layers_mm: ArrayLike | None, camera: IICamera) -> Floats:
    """The default layers, or those given; ValueError unless they are one or more positive depths that increase."""
    if layers_mm is None:
        return linear_layers(camera)
    layers = np.asarray(layers_mm, dtype=np.float64)
    if layers.ndim != 1 or not layers.size:
        raise ValueError(f"layers_mm is of shape {layers.shape}: a list of depths is needed")
    if not (np.isfinite(layers).all() and layers[0] > 0 and (np.diff(layers) > 0).all()):
        raise ValueError("layers_mm must be finite, positive and increase")
    return layers


def nearest_layer(z: Floats, layers_mm: Floats, gap_mm: float) -> NDArray[np.int64]:
    """Row of the nearest layer for each depth, −1 beyond the outer ones by more than half a layer, and for NaN.

    A depth halfway between two layers belongs to the farther one. A single layer reaches as far as one of the
    default layers would, half a gap each way.
    """
    if layers_mm.size == 1:
        edges = layers_mm[0] + gap_mm * np.array([-0.5, 0.5])
    else:
        inner = (layers_mm[1:] + layers_mm[:-1]) / 2
        edges = np.concatenate([[2 * layers_mm[0] - inner[0]], inner, [2 * layers_mm[-1] - inner[-1]]])
    row = np.searchsorted(edges, z, side="right") - 1
    return np.where(np.isnan(z) | (row >= layers_mm.size), -1, row)
