"""Periods and centres of micro-images in a grey picture, in pixels from its top left corner.

A micro-image is bright in the middle and darker at its border, as the rim of a main lens makes it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..base.extras import Lazy

ndimage = Lazy("scipy.ndimage")

LEAST_PITCH = 4.0  # pixels from lens to lens: under it, a micro-image has no centre to speak of
FEWEST = 5  # lenses a side
CROP = 2048  # pixels a side, in the middle, whose spectrum is taken
CLEAR = 0.06  # autocorrelation, less than which is noise; what repeats by chance does not fit a grid
NEARLY = 0.6  # of the highest peak of the autocorrelation: lower ones are no period of their own
SMOOTH = 0.2  # of the pitch, σ of the Gauss kernel that makes one peak of a micro-image
STEP = 0.4  # σ, from the centre to the samples round it: with 0.6 they met the light of saturated neighbours
KERNEL = 2.5  # σ, where the kernel ends: half a pitch, short of the neighbours' light
Floats = NDArray[np.float64]
Vectors = tuple[Floats, Floats]


class NoLenses(ValueError):
    """A picture in which no lens grid is found."""


def lattice_vectors(grey: NDArray[np.float32]) -> Vectors:
    """The two shortest periods (x, y) of a picture, by the autocorrelation of its middle.

    Periods longer than a fifth of it are left out, the scene with them.

    Raises
    ------
    NoLenses
        If the picture is too small, or does not repeat in two directions.
    """
    height, width = grey.shape
    if min(height, width) < FEWEST * LEAST_PITCH:
        raise NoLenses(
            f"the picture has {width}×{height} px: at least {FEWEST}×{FEWEST} lenses of {LEAST_PITCH:g} px are needed"
        )
    rows, cols = min(height, CROP), min(width, CROP)
    top, left = (height - rows) // 2, (width - cols) // 2
    part = grey[top : top + rows, left : left + cols].astype(np.float64)
    window = np.hanning(rows)[:, None] * np.hanning(cols)
    spectrum = np.abs(np.fft.rfft2((part - part.mean()) * window)) ** 2
    longest = min(rows, cols) / FEWEST
    frequency = np.hypot(np.fft.fftfreq(rows)[:, None], np.fft.rfftfreq(cols)[None])
    spectrum[frequency < 0.9 / longest] = 0
    # Peaks of a pixel's width would lose half their height between samples. As wide as a lens, the middle one hides
    # those of the neighbours if a few lenses are very bright: the power of slopes is narrower.
    spectrum *= frequency**2 * np.exp(-2 * (np.pi * frequency) ** 2)
    correlation = np.fft.irfft2(spectrum, s=(rows, cols))
    if not correlation[0, 0] > 0:
        raise NoLenses("no lenses are found: the picture is even")
    correlation = np.fft.fftshift(correlation / correlation[0, 0])
    return _shortest(correlation, longest)


def _shortest(correlation: Floats, longest: float) -> Vectors:
    """The two shortest of the strong peaks round the middle of an autocorrelation."""
    reach = int(longest) + 2
    y0, x0 = (n // 2 for n in correlation.shape)
    near = correlation[y0 - reach : y0 + reach + 1, x0 - reach : x0 + reach + 1]
    summit = near == ndimage.maximum_filter(near, 3)
    summit[[0, -1]] = summit[:, [0, -1]] = False
    row, col = np.nonzero(summit)
    distance = np.hypot(row - reach, col - reach)
    far = (distance > 0.9 * LEAST_PITCH) & (distance <= longest)
    row, col, distance = row[far], col[far], distance[far]
    heights = near[row, col]
    best = float(heights.max(initial=0.0))
    if best < CLEAR:
        raise NoLenses(
            f"no lenses are found: the picture repeats nowhere, its autocorrelation is {best:.2g} at the most where "
            f"{CLEAR:g} is needed"
        )
    strong = np.flatnonzero(heights > NEARLY * best)
    strong = strong[np.argsort(distance[strong], kind="stable")]
    found = [_summit(near, int(row[i]), int(col[i])) - reach for i in strong]
    first = found[0]
    for second in found[1:]:
        cross = abs(first[0] * second[1] - first[1] * second[0])
        if cross > 0.4 * np.hypot(*first) * np.hypot(*second):
            periods = _reduced(first, second)
            if all(_dips(near, reach, period) for period in periods):
                return _surer(near, reach, periods[0]), _surer(near, reach, periods[1])
            break
    raise NoLenses("no lenses are found: the picture repeats in one direction alone")


def _surer(near: Floats, reach: int, period: Floats) -> Floats:
    """A period by the peaks at two and three times it, farther from the middle one, whose slope moves the first."""
    for times in (2, 3):
        col, row = np.rint(times * period).astype(int) + reach
        half = max(1, int(0.3 * np.hypot(*period)))
        if min(col, row) <= half or max(col, row) >= 2 * reach - half:
            break
        part = near[row - half : row + half + 1, col - half : col + half + 1]
        down, right = np.unravel_index(np.argmax(part), part.shape)
        row, col = row - half + int(down), col - half + int(right)
        period = (_summit(near, row, col) - reach) / times
    return period


def _dips(near: Floats, reach: int, period: Floats) -> bool:
    """Whether the autocorrelation is lower half a period farther on: along a stripe it stays as it is."""
    value = ndimage.map_coordinates(near, np.outer(period[::-1], (1.0, 1.5)) + reach, order=1, mode="nearest")
    return bool(value[0] - value[1] > CLEAR / 2)


def _reduced(v: Floats, w: Floats) -> Vectors:
    """The two shortest vectors of the lattice that two span (Gauss, Lagrange)."""
    while True:
        if w @ w < v @ v:
            v, w = w, v
        times = round(float(v @ w / (v @ v)))
        if not times:
            return v, w
        w = w - times * v


def _summit(surface: Floats, row: int, col: int) -> Floats:
    """(x, y) of the top of the parabola through a highest sample and its neighbours."""
    place = []
    for low, mid, high in (surface[row, col - 1 : col + 2], surface[row - 1 : row + 2, col]):
        bend = low - 2 * mid + high
        place.append(0.5 * (low - high) / bend if bend < 0 else 0.0)
    return np.array([col + place[0], row + place[1]])


def middle_of_one(grey: NDArray[np.float32], vectors: Vectors, sigma: float) -> Floats:
    """(x, y) of the centre of one micro-image near the middle: the highest place of the mean of many cells."""
    a, b = vectors
    height, width = grey.shape
    steps = np.arange(-6, 7)
    i, j = (g.ravel() for g in np.meshgrid(steps, steps))
    shift = i[:, None] * a + j[:, None] * b
    half = int(np.ceil(np.hypot(*a) + np.hypot(*b))) // 2 + 2 + int(2 * sigma)
    y, x = np.mgrid[-half : half + 1, -half : half + 1]
    total, count = np.zeros(x.shape), np.zeros(x.shape)
    for dx, dy in shift:
        cols, rows = x + (width / 2 + dx), y + (height / 2 + dy)  # as sample indices
        inside = (cols >= 0) & (cols <= width - 1) & (rows >= 0) & (rows <= height - 1)
        value = ndimage.map_coordinates(grey, [rows, cols], order=1, mode="nearest")
        total += np.where(inside, value, 0)
        count += inside
    mean = ndimage.gaussian_filter(total / np.maximum(count, 1), sigma, mode="nearest")
    # Not at the frame of this window, which cuts peaks and lacks half their neighbours; a whole cell lies inside.
    edge = max(1, int(2 * sigma))
    summit = (mean == ndimage.maximum_filter(mean, 3))[edge:-edge, edge:-edge]
    inner = np.where(summit, mean[edge:-edge, edge:-edge], -np.inf)
    row, col = np.unravel_index(np.argmax(inner), inner.shape)
    top = _summit(mean, int(row) + edge, int(col) + edge)
    return top - half + np.array([width / 2, height / 2]) + 0.5


class Summits:
    """Centres of micro-images near given places: highest points of the smoothed grey.

    Parameters
    ----------
    grey : ndarray of float32, (N, M)
    sigma : float
        Of the Gauss kernel, pixels. Where a micro-image has a centre of symmetry, that is where it peaks.
    """

    def __init__(self, grey: NDArray[np.float32], sigma: float) -> None:
        self.sigma = sigma
        from scipy.signal import oaconvolve  # a second to import

        half = int(np.ceil(KERNEL * sigma))
        y, x = np.mgrid[-half : half + 1, -half : half + 1] / (KERNEL * sigma)
        kernel = np.maximum(1 - x * x - y * y, 0) ** 2
        padded = np.pad(grey, half, mode="edge")
        smooth = oaconvolve(padded, (kernel / kernel.sum()).astype(np.float32), mode="valid")
        self.surface = ndimage.spline_filter(smooth, order=3, output=np.float32, mode="nearest")

    def at(self, places: Floats) -> Floats:
        """Values at places (n, 2)."""
        coordinates = [places[:, 1] - 0.5, places[:, 0] - 0.5]
        return ndimage.map_coordinates(self.surface, coordinates, order=3, prefilter=False, mode="nearest")

    def near(self, places: Floats, reach: float) -> tuple[Floats, NDArray[np.bool_]]:
        """Highest points (n, 2) within ``reach`` of places, and whether there is one.

        Newton's method on the parabola through nine samples round the place: it ends where they balance, which
        symmetry makes the centre, however the peak is shaped.
        """
        h = max(0.5, STEP * self.sigma)
        found, good = places.copy(), np.ones(len(places), bool)
        for _ in range(6):
            f = {
                (i, j): self.at(found + h * np.array([i, j])) for i in (-1, 0, 1) for j in (-1, 0, 1)
            }  # (right, down)
            gx = sum(f[1, j] - f[-1, j] for j in (-1, 0, 1)) / (6 * h)
            gy = sum(f[i, 1] - f[i, -1] for i in (-1, 0, 1)) / (6 * h)
            xx = sum(f[1, j] - 2 * f[0, j] + f[-1, j] for j in (-1, 0, 1)) / (3 * h * h)
            yy = sum(f[i, 1] - 2 * f[i, 0] + f[i, -1] for i in (-1, 0, 1)) / (3 * h * h)
            xy = (f[1, 1] - f[1, -1] - f[-1, 1] + f[-1, -1]) / (4 * h * h)
            bend = xx * yy - xy * xy
            good = (bend > 0) & (xx < 0)
            safe = np.where(good, bend, 1.0)
            step = np.stack([(xy * gy - yy * gx) / safe, (xy * gx - xx * gy) / safe], axis=1)
            length = np.hypot(*step.T)
            step *= np.minimum(1, h / np.maximum(length, 1e-30))[:, None]
            found += np.where(good[:, None], step, 0)
            if length[good].max(initial=0.0) < 1e-4:
                break
        return found, good & (np.hypot(*(found - places).T) <= reach)
