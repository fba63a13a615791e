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
ODD = 0.4  # of the expected value
MOST_DEFECTS = 1e-3  # of all pixels
CROSS = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], bool)
DIM = 0.3  # of the typical lens's light: lenses with less say nothing about their neighbours
Image = NDArray[np.float32]


def gain(smooth: Image) -> Image:
    """Factors, (N, M), that divide the vignetting out; 1 at the brightest places.

    Parameters
    ----------
    smooth : ndarray, (N, M)
        White image without noise, see `averaged`.

    Raises
    ------
    ValueError
        If the white image is dark.
    """
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


def defects(white: Image, smooth: Image) -> NDArray[np.bool_]:
    """Pixels, (N, M), whose value in the white image is far from those at the same place under other lenses.

    A defect differs from the light expected half a pixel around, since borders of micro-images are steep, by more
    than `ODD` and by ten standard deviations of the noise, which grows with the root of the light. Where that holds
    for more pixels than sensors have defects, borders are steeper than lenses are regular: a whole pixel counts.

    Parameters
    ----------
    white, smooth : ndarray, (N, M)
        White image, and the same without noise, see `averaged`.
    """
    least = np.float32(FLOOR * np.percentile(smooth, 99.5))
    low, high = (f(smooth, footprint=CROSS) for f in (ndimage.minimum_filter, ndimage.maximum_filter))
    sigma = np.float32(1.4826 * np.median(np.abs(white - smooth) / np.sqrt(np.maximum(smooth, least))))
    for reach in (np.float32(0.5), np.float32(1.0)):
        below = np.maximum(smooth + reach * (low - smooth), 0)
        above = np.maximum(smooth + reach * (high - smooth), least)
        noise = 10 * sigma * np.sqrt(above)
        bad = (white < np.minimum((1 - ODD) * below, below - noise)) | (
            white > np.maximum((1 + ODD) * above, above + noise)
        )
        if bad.mean() < MOST_DEFECTS:
            break
    return np.asarray(bad)


def repaired(frame: NDArray[Any], bad: NDArray[np.bool_], owner: NDArray[Any], step: int) -> NDArray[Any]:
    """Return a frame, (N, M) or (N, M, 3), whose bad pixels are the mean of good neighbours of the same lens.

    Parameters
    ----------
    step : int
        Distance of neighbours of the same colour: 2 behind a mosaic, else 1.
    """
    out = frame.copy()
    rows, cols = np.nonzero(bad)
    total, count = np.zeros((len(rows), *frame.shape[2:])), np.zeros(len(rows))
    for down, right in ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)):
        row, col = rows + step * down, cols + step * right
        inside = (row >= 0) & (row < frame.shape[0]) & (col >= 0) & (col < frame.shape[1])
        row, col = np.where(inside, row, rows), np.where(inside, col, cols)
        good = inside & ~bad[row, col] & (owner[row, col] == owner[rows, cols])
        total[good] += frame[row[good], col[good]]
        count += good
    some = count > 0
    mean = total[some] / (count[some] if frame.ndim == 2 else count[some, None])
    out[rows[some], cols[some]] = np.rint(mean) if frame.dtype.kind in "ui" else mean
    return out
