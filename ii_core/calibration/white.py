"""Correction of vignetting by a white image, without its noise and without amplified dark borders.

A white image shows how much light every pixel gets of an even scene. Two noises must not enter the picture with it:

- Its own. Each of its pixels is averaged with those at the same place under the eight lenses around, each lens's
  light brought to the middle one's: a third of the noise is left. Places between pixels are interpolated by cubic
  splines.
- That of pixels which hardly get light, between micro-images. Instead of 1/w they are multiplied by
  w·(1 + ε²)/(w² + ε²), w their share of the light of the brightest place and ε = 0.1: at most by 5, and the less the
  darker they are. Where w = 0.3 the picture stays 10 % too dark, where w = 0.5, 3 %.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.extras import Lazy
from ..camera.lattice import Lattice
from ..picture.regular import owners
from .peaks import SMOOTH, Summits

ndimage = Lazy("scipy.ndimage")

FLOOR = 0.1  # ε
DIM = 0.3  # of the typical lens's light: lenses with less say nothing about their neighbours
Image = NDArray[np.float32]


def gain(white: NDArray[Any], lattice: Lattice) -> Image:
    """Factors, (N, M), that divide the vignetting out; 1 at the brightest places.

    Parameters
    ----------
    white : ndarray, (N, M)
        Grey, dark frame taken off.
    lattice : Lattice
        Of its lenses.

    Raises
    ------
    ValueError
        If the white image is dark.
    """
    smooth = averaged(np.asarray(white, np.float32), lattice)
    brightest = float(np.percentile(smooth, 99.5))
    if not brightest > 0:
        raise ValueError("the white image is dark: nothing can be divided by it")
    w = np.maximum(smooth / np.float32(brightest), 0)
    return (w * (1 + FLOOR**2) / (w * w + FLOOR**2)).astype(np.float32)


def averaged(white: Image, lattice: Lattice) -> Image:
    """Mean of each pixel and its likes under the lenses around, brought to the light of its own lens."""
    height, width = white.shape
    owner = owners(lattice, (width, height))
    inside = owner >= 0
    k, l = (g.ravel() for g in np.meshgrid(*(np.arange(n) for n in lattice.lenses)))
    light = Summits(white, SMOOTH * min(lattice.pitch)).at(np.stack(lattice.centres(k, l), axis=1))
    dim = light < DIM * np.median(light)
    level = np.where(inside, light[owner], 1).astype(np.float32)
    usable = inside & ~dim[owner]
    share = np.where(usable, white / np.maximum(level, 1e-12), 0).astype(np.float32)
    surface = ndimage.spline_filter(share, order=3, output=np.float32)
    weight = usable.astype(np.float32)
    total, counted = share.copy(), weight.copy()
    for i, j in ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, -1), (1, -1), (-1, 1)):
        half = 0.5 if lattice.hexagonal and j else 0.0
        right, down = lattice.offsets((i + half) * lattice.pitch[0], j * lattice.pitch[1])
        moved = ndimage.shift(surface, (-down, -right), order=3, prefilter=False, mode="constant")
        there = ndimage.shift(weight, (-down, -right), order=1, mode="constant") > 0.999
        total += np.where(there, moved, 0)
        counted += there
    mean = np.where(counted > 0, total / np.maximum(counted, 1), 1)
    return (np.where(inside, mean * level, white)).astype(np.float32)
