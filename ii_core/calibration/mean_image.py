"""Centres of micro-images by least squares against their mean, sampled more finely than pixels.

A disc of light on pixels has a highest smoothed point that depends on where in a pixel the disc lies: by 0.15 px if
its rim is near the end of the smoothing kernel. If the pitch is nearly a whole number of pixels and rows run nearly
along pixels, that error changes slowly over the picture, and looks like another pitch or a drift. The rim itself,
fitted with a weight that falls off smoothly, depends on it less: the worst centres of 47 cameras were 0.049 px off
before and 0.012 px after (2026-11-23).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..base.extras import Lazy
from ..base.jit import exact_stage_kernel, kernel
from .peaks import Floats, Vectors

ndimage = Lazy("scipy.ndimage")

CELLS = 8  # of the mean in a pixel, at the most
WIDEST = 256  # cells of the mean a side of a lens: coarser cells for wide lenses
# σ of the Gauss kernel that joins places in a pixel which no lens has. Of 47 cameras, among them the 32 of 12 000
# whose places change most slowly, the worst centres were 0.11 px off with 0.15 px, 0.027 with 0.4, 0.012 with 0.5 and
# 0.015 with 0.7 (2026-11-23).
BLUR_PX = 0.5
# Pixels on the border of two lenses get light of both. Their weight rises from little to 1 within a pixel; with
# all weights 1, the worst centres were 0.09 px off. It is not 0, since micro-images without gaps change nowhere else.
TAPER_PX, BORDER_WEIGHT = 1.0, 0.02
LEAST = 2_000_000  # pixels that the mean is made of, if there are as many
STEPS = 5
LONGEST_PX = 0.5  # of a step
SETTLED_PX = 1e-4  # a step less than this is the last
Bools = NDArray[np.bool_]


class MeanImage:
    """Mean micro-image, symmetric about its centre, and its least squares fit to single ones.

    Parameters
    ----------
    grey : ndarray of float32, (N, M)
    places, heights : ndarray, (n, 2) and (n,)
        Centres of the micro-images averaged, and light there.
    neighbours : (ndarray, ndarray)
        Vectors to the neighbour in the row and to one in the next row.
    """

    def __init__(self, grey: NDArray[np.float32], places: Floats, heights: Floats, neighbours: Vectors) -> None:
        a, b = neighbours
        vectors = np.array([a, b, a + b, a - b])
        lengths = np.hypot(*vectors.T)
        self.grey = np.ascontiguousarray(grey)
        self.sides = np.column_stack([vectors / lengths[:, None], lengths / 2])
        self.reach = math.ceil(float(np.hypot(*a) + np.hypot(*b)) / 2)
        nearest = float(lengths.min())
        self.fine = max(1, min(CELLS, int(WIDEST / nearest)))
        side = 2 * (self.reach + 2) * self.fine + 1
        step = max(1, int(len(places) * nearest**2 / LEAST))
        total, count = np.zeros((side, side)), np.zeros((side, side))
        heights = heights[::step].astype(np.float64)
        _add(self.grey, places[::step], heights, self.sides, self.reach, self.fine, total, count)
        total, count = (
            ndimage.gaussian_filter(t + t[::-1, ::-1], BLUR_PX * self.fine, mode="constant") for t in (total, count)
        )
        mean = np.where(count > 1e-4, total / np.maximum(count, 1e-12), np.nan)
        slope_y, slope_x = np.gradient(mean)
        self.tables = np.stack([mean, -slope_x * self.fine, -slope_y * self.fine], axis=-1)

    def near(self, places: Floats, reach: float) -> tuple[Floats, Bools]:
        """Return centres (n, 2) within ``reach`` of places, and whether there is one."""
        found, good = places.copy(), np.zeros(len(places), np.bool_)
        _fit(self.grey, self.tables, self.sides, self.reach, self.fine, found, good)
        return found, good & (np.hypot(*(found - places).T) <= reach)


@exact_stage_kernel
def _margin(x, y, sides):
    """Return how far within a lens an offset lies; negative outside."""
    margin = math.inf
    for i in range(sides.shape[0]):
        margin = min(margin, sides[i, 2] - abs(x * sides[i, 0] + y * sides[i, 1]))
    return margin


@kernel
def _add(grey, places, heights, sides, reach, fine, total, count):
    """Add micro-images, each divided by its height, to cells finer than pixels."""
    half = total.shape[0] // 2
    for i in range(places.shape[0]):
        col, row = math.floor(places[i, 0]), math.floor(places[i, 1])
        for n in range(max(row - reach, 0), min(row + reach + 1, grey.shape[0])):
            y = n + 0.5 - places[i, 1]
            for m in range(max(col - reach, 0), min(col + reach + 1, grey.shape[1])):
                x = m + 0.5 - places[i, 0]
                if _margin(x, y, sides) < 0:
                    continue
                u, v = x * fine + half, y * fine + half
                p, q = math.floor(u), math.floor(v)
                u, v = u - p, v - q
                value = grey[n, m] / heights[i]
                for j in range(2):
                    for k in range(2):
                        share = (u if k else 1 - u) * (v if j else 1 - v)
                        total[q + j, p + k] += share * value
                        count[q + j, p + k] += share


@kernel
def _fit(grey, tables, sides, reach, fine, found, good):
    """Fit brightness and shift of the mean to each micro-image: Gauss–Newton steps from its place."""
    half = tables.shape[0] // 2
    for i in range(found.shape[0]):
        for _ in range(STEPS):
            g00 = g01 = g02 = g11 = g12 = g22 = h0 = h1 = h2 = 0.0
            col, row = math.floor(found[i, 0]), math.floor(found[i, 1])
            for n in range(max(row - reach, 0), min(row + reach + 1, grey.shape[0])):
                y = n + 0.5 - found[i, 1]
                for m in range(max(col - reach, 0), min(col + reach + 1, grey.shape[1])):
                    x = m + 0.5 - found[i, 0]
                    margin = _margin(x, y, sides)
                    if margin <= 0:
                        continue
                    share = min(margin / TAPER_PX, 1.0)
                    share = share * share * (3 - 2 * share)
                    weight = BORDER_WEIGHT + (1 - BORDER_WEIGHT) * share
                    u, v = x * fine + half, y * fine + half
                    p, q = math.floor(u), math.floor(v)
                    u, v = u - p, v - q
                    t = (1 - v) * ((1 - u) * tables[q, p, 0] + u * tables[q, p + 1, 0]) + v * (
                        (1 - u) * tables[q + 1, p, 0] + u * tables[q + 1, p + 1, 0]
                    )
                    tx = (1 - v) * ((1 - u) * tables[q, p, 1] + u * tables[q, p + 1, 1]) + v * (
                        (1 - u) * tables[q + 1, p, 1] + u * tables[q + 1, p + 1, 1]
                    )
                    ty = (1 - v) * ((1 - u) * tables[q, p, 2] + u * tables[q, p + 1, 2]) + v * (
                        (1 - u) * tables[q + 1, p, 2] + u * tables[q + 1, p + 1, 2]
                    )
                    if math.isnan(t + tx + ty):
                        continue
                    value = grey[n, m]
                    g00 += weight * t * t
                    g01 += weight * t * tx
                    g02 += weight * t * ty
                    g11 += weight * tx * tx
                    g12 += weight * tx * ty
                    g22 += weight * ty * ty
                    h0 += weight * t * value
                    h1 += weight * tx * value
                    h2 += weight * ty * value
            good[i] = False
            if not g00 > 0 or not h0 > 0:
                break
            # The rest of the normal equations, after elimination of the brightness.
            b11, b12, b22 = g11 - g01 * g01 / g00, g12 - g01 * g02 / g00, g22 - g02 * g02 / g00
            r1, r2 = h1 - g01 * h0 / g00, h2 - g02 * h0 / g00
            det = b11 * b22 - b12 * b12
            if not det > 1e-6 * (b11 + b22) ** 2 or not b11 + b22 > 1e-6 * g00:
                break
            right, down = (b22 * r1 - b12 * r2) / det, (b11 * r2 - b12 * r1) / det
            bright = (h0 - g01 * right - g02 * down) / g00
            if not bright > 0:
                break
            right, down = right / bright, down / bright
            length = math.hypot(right, down)
            if length > LONGEST_PX:
                right, down = right * LONGEST_PX / length, down * LONGEST_PX / length
            found[i, 0] += right
            found[i, 1] += down
            good[i] = True
            if length < SETTLED_PX:
                break
