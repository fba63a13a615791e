"""Lens grid of a picture: centres of micro-images, and the straight, turned or sheared lattice fitted to them.

In the fit, lens (k, l) has its centre at c + (k + ½·(l mod 2))·a + l·b, the half only in a hexagonal lattice, with
a along the rows and b from row to row; six numbers in all. 14 more, quadratic and cubic terms over the picture
(`lattice.Drift`), are fitted with them, and left out if they explain no more than noise would.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.extras import Lazy
from ..camera.lattice import DRIFT_TERMS, Drift, Lattice, axes_of, drift_terms
from .mean_image import MeanImage
from .peaks import FEWEST, SMOOTH, Floats, NoLenses, Summits, Vectors, lattice_vectors, middle_of_one

ndimage = Lazy("scipy.ndimage")

SKEW = 0.12  # of a pitch: how far rows may lean, or half a pitch may be missed
REACH = 0.3  # of the pitch: a centre farther from its place is that of something else
LOOSE, LOOSE_YET = 0.05, 0.13  # of the pitch, median miss of centres: more, in the end or before, is no grid
BAD_SIGMAS = 3.5  # beyond this many robust standard deviations a centre is thrown out
BORDER = 0.93  # of the light of the middle: borders of micro-images are darker
DARK = 0.3  # of the light of the lenses around: less, and the lens is dark
# Pixels, and three times its own error: less is not fitted. With 0.02 one of 47 straight cameras drifted, 2026-11-23.
NOTED_DRIFT = 0.03
ENOUGH = 50  # centres for a drift: five times the terms of a cubic
GROWTH, GROWTH_DRIFTING = 2.0, 1.5  # of the circle of centres from step to step; a drift is extrapolated less far
MARGIN_DRIFTING = 4  # lenses sought beyond the straight grid's range
PASSES = 2  # of the mean micro-image: a third left the worst errors of 47 pictures, 2026-11-23
SATURATED = 0.7  # of the lenses: more leave too few
INSIDE = 0.45  # of the pitch, how far the picture must reach beyond a lens's centre for the lens to count
Bools = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class LensGrid:
    """A lens grid and how well it fits.

    Attributes
    ----------
    lattice : Lattice
        Of the lenses that lie in the picture, see `lens_grid`.
    places : ndarray, (n, 2)
        Centres of the lattice's lenses whose centre was sought, x and y in pixels.
    found : ndarray, (n, 2)
        Centres in the picture; of no meaning where not ``used``.
    used : ndarray of bool, (n,)
        False for centres that are dark or saturated, were not found or lie off the grid.
    dark, saturated : ndarray of bool, (n,)
    turn_deg, shear : float
        See `IICamera`.
    drift_px : float
        Greatest shift of the centres used off the straight grid; 0 if there is none beyond its error.
    straight_rms_px : float
        Root mean square distance of the centres used from the best straight grid.
    """

    lattice: Lattice
    places: Floats
    found: Floats
    used: Bools
    dark: Bools
    saturated: Bools
    turn_deg: float
    shear: float
    drift_px: float
    straight_rms_px: float

    @property
    def residuals(self) -> Floats:
        """Found less fitted centres of the lenses used, (n, 2) pixels."""
        return (self.found - self.places)[self.used]

    @property
    def rms_px(self) -> float:
        """Root mean square distance of the centres used from the grid's."""
        return float(np.sqrt(np.mean(np.sum(self.residuals**2, axis=1))))


@dataclass(frozen=True)
class _Affine:
    """c, a and b as rows (3, 2), whether odd rows stand half a pitch aside, and the drift off this grid."""

    rows: Floats
    hexagonal: bool
    drift: Drift | None = None

    def indices(self, k: Floats, l: Floats) -> Floats:
        half = 0.5 * (l % 2) if self.hexagonal else 0.0
        return np.stack([np.ones(len(k)), k + half, l], axis=1)

    def straight(self, k: Floats, l: Floats) -> Floats:
        return self.indices(k, l) @ self.rows

    def places(self, k: Floats, l: Floats) -> Floats:
        places = self.straight(k, l)
        return places if self.drift is None else places + np.stack(self.drift.at(*places.T), axis=1)

    @property
    def pitch(self) -> tuple[float, float]:
        """Along the rows, and from row to row at right angles to them."""
        a, b = self.rows[1:]
        across = math.hypot(*a)
        return across, float(a[0] * b[1] - a[1] * b[0]) / across

    @property
    def nearest_px(self) -> float:
        """Distance of neighbours."""
        across, down = self.pitch
        return min(across, math.hypot(across / 2, down) if self.hexagonal else down)


def lens_grid(grey: NDArray[np.float32], lattice: str | None = None, clipped: Bools | None = None) -> LensGrid:
    """The lens grid of a picture.

    First its two shortest periods, then centres from the middle outwards, in growing circles, each fitted before the
    next is sought, with a drift if there is one. Then all again, with slow changes of light divided out, which would
    pull every centre to the brighter side. At last the mean micro-image is fitted to each: see `MeanImage`.

    Parameters
    ----------
    grey : ndarray of float32, (N, M)
        Brightest in the middle of each micro-image.
    lattice : {"rectangular", "hexagonal"}, optional
        Found if not given.
    clipped : ndarray of bool, (N, M), optional
        Pixels at the end of the sensor's scale. The flat light of saturated lenses would become a slope when slow
        changes are divided out: they are left out.

    Returns
    -------
    LensGrid
        Its lattice has the most rows and columns of lenses of which every one lies in the picture.

    Raises
    ------
    NoLenses
        If there is no grid.
    """
    vectors = lattice_vectors(grey)
    fit = _named(vectors, lattice)
    sigma = SMOOTH * fit.nearest_px
    fit = replace(fit, rows=np.vstack([middle_of_one(grey, vectors, sigma), fit.rows[1:]]))
    height, width = grey.shape
    summits, radius = Summits(grey, sigma), 3.0 * max(fit.pitch)
    while True:
        k, l = _around(fit, (width, height), radius)
        fit, _, _ = _followed(fit, summits, k, l, (width, height))
        if radius > math.hypot(width, height) / 2:
            break
        radius *= GROWTH if fit.drift is None else GROWTH_DRIFTING
    k, l = _around(fit, (width, height), radius)
    places = fit.places(k, l)
    saturated = np.zeros(len(k), bool)
    if clipped is not None and clipped.any():
        saturated = ndimage.maximum_filter(clipped, max(1, int(fit.nearest_px / 2)))[_pixels(places)]
    if saturated.mean() > SATURATED:
        raise NoLenses(
            f"no lenses are found: {int(saturated.sum())} of {len(k)} micro-images have pixels at the picture's "
            "greatest value, the end of the sensor's scale: a shorter exposure is needed"
        )
    heights, dark = summits.at(places), np.zeros(len(k), bool)
    level = _Level(places[~saturated], heights[~saturated], (width, height)) if not saturated.all() else None
    if level is not None and level.positive:
        dark = heights < DARK * level.at(places)
        grey = grey / level.picture()
        summits = Summits(grey, sigma)
    left_out = dark | saturated
    fit, found, used = _followed(fit, summits, k, l, (width, height), left_out, LOOSE)
    _check_borders(fit, summits, k, l)
    for _ in range(PASSES):
        places, (a, b) = fit.places(k, l)[used], fit.rows[1:]
        mean = MeanImage(grey, places, summits.at(places), (a, b - 0.5 * a if fit.hexagonal else b))
        fit, found, used = _followed(fit, mean, k, l, (width, height), left_out, LOOSE)
    places = fit.places(k, l)
    off = np.hypot(*(places - fit.straight(k, l))[used].T)
    straight = _least_squares(replace(fit, drift=None), k, l, found, used)
    miss = ((found - straight.places(k, l))[used] ** 2).sum(axis=1)
    return _result(
        fit, (width, height), float(off.max()), float(np.sqrt(miss.mean())),
        places=places, found=found, used=used, dark=dark, saturated=saturated,
    )  # fmt: skip


def _named(vectors: Vectors, lattice: str | None) -> _Affine:
    """Rows and columns by the two shortest periods: rows are those that run most nearly across."""
    v, w = vectors
    candidates: list[tuple[bool, bool, float, _Affine]] = []
    for a, other, shortest in ((v, w, True), (w, v, True), (v - w, v, False), (v + w, v, False)):
        a = a if a[0] >= 0 else -a
        other = other if a[0] * other[1] - a[1] * other[0] > 0 else -other
        share = float(other @ a / (a @ a))
        for hexagonal in (False, True):
            along = share - 0.5 if hexagonal else share
            lean = along - round(along)
            fit = _Affine(np.vstack([[0, 0], a, other - (share - lean) * a]), hexagonal)
            across, down = fit.pitch
            kind = "hexagonal" if hexagonal else "rectangular"
            if abs(lean) * across <= SKEW * down and lattice in (None, kind) and (hexagonal or shortest):
                # A hexagonal lattice has two descriptions, of which the other has rows √3 times as long, too near.
                squeezed = hexagonal and not 0.5 < down / across < 1.5
                candidates.append((hexagonal, squeezed, abs(math.atan2(a[1], a[0])), fit))
    if not candidates:
        raise NoLenses(
            f"no lenses are found: the picture repeats by ({v[0]:.1f}, {v[1]:.1f}) and ({w[0]:.1f}, {w[1]:.1f}) px, "
            f"which is no {lattice or 'rectangular or hexagonal'} grid"
        )
    return min(candidates, key=lambda c: c[:3])[3]


def _around(fit: _Affine, size: tuple[int, int], radius: float) -> tuple[Floats, Floats]:
    """Lenses (k, l) whose centres lie in the picture and within a radius of its middle."""
    middle = np.array(size) / 2
    corners = np.array([[0, 0], [size[0], 0], [0, size[1]], size], np.float64)
    corners = middle + np.clip(corners - middle, -radius, radius)
    kl = np.linalg.solve(fit.rows[1:].T, (corners - fit.rows[0]).T)
    more = 1 if fit.drift is None else MARGIN_DRIFTING
    low, high = np.floor(kl.min(axis=1)) - more, np.ceil(kl.max(axis=1)) + more
    k, l = (g.ravel() for g in np.meshgrid(np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1)))
    place = fit.places(k, l)
    margin = 0.5 * min(fit.pitch)
    inside = (place > margin).all(axis=1) & (place < np.array(size) - margin).all(axis=1)
    inside &= np.hypot(*(place - middle).T) <= radius
    return k[inside], l[inside]


def _followed(
    fit: _Affine,
    centres: Summits | MeanImage,
    k: Floats,
    l: Floats,
    size: tuple[int, int],
    left_out: Bools | None = None,
    loose: float = LOOSE_YET,
) -> tuple[_Affine, Floats, Bools]:
    """Fit grid and drift together, and the straight grid alone if the drift explains no more than noise.

    A straight grid judged before its drift would refuse grids in perspective.
    """
    straight = replace(fit, drift=None)
    if len(k) < ENOUGH:
        return _fitted(straight, centres, k, l, left_out, loose)
    drifting = fit if fit.drift is not None else replace(fit, drift=_no_drift(size))
    try:
        bent, found, used = _fitted(drifting, centres, k, l, left_out, loose)
    except NoLenses:
        if fit.drift is not None:
            raise
        return _fitted(straight, centres, k, l, left_out, loose)
    straight = _least_squares(straight, k, l, found, used)
    if _drifts(bent.places(k, l)[used], (found - straight.places(k, l))[used]):
        return bent, found, used
    return _fitted(straight, centres, k, l, left_out, loose)


def _fitted(
    fit: _Affine,
    summits: Summits | MeanImage,
    k: Floats,
    l: Floats,
    left_out: Bools | None = None,
    loose: float = LOOSE_YET,
) -> tuple[_Affine, Floats, Bools]:
    """The grid through the centres near its places, with a drift if it has one, the centres, and those used."""
    found, good = summits.near(fit.places(k, l), REACH * fit.nearest_px)
    if left_out is not None:
        good &= ~left_out
    for _ in range(10):
        if good.sum() < FEWEST * 2:
            raise NoLenses(f"no lenses are found: {int(good.sum())} of {len(k)} centres are where a grid has them")
        fit = _least_squares(fit, k, l, found, good)
        miss = np.hypot(*(found - fit.places(k, l)).T)
        typical = float(np.median(miss[good])) / 1.1774  # of a Rayleigh distribution: one axis's σ
        keep = good & (miss <= max(BAD_SIGMAS * typical * math.sqrt(2), 1e-3))
        if (keep == good).all():
            break
        good = keep
    if typical * 1.1774 > loose * fit.nearest_px or good.sum() < 0.3 * len(k):
        raise NoLenses(
            f"no lenses are found: half of the centres lie {typical * 1.1774:.2f} px or more off the best grid of "
            f"{fit.pitch[0]:.1f}×{fit.pitch[1]:.1f} px, {'drifting' if fit.drift else 'straight'}, and "
            f"{int(good.sum())} of {len(k)} are near it: at most {loose * fit.nearest_px:.2f} px and at least "
            f"{math.ceil(0.3 * len(k))} are needed"
        )
    return fit, found, good


def _least_squares(fit: _Affine, k: Floats, l: Floats, found: Floats, good: Bools) -> _Affine:
    """Fit the straight grid to centres, and with it the drift, with its terms at the grid of the step before."""
    indices = fit.indices(k, l)[good]
    if fit.drift is None:
        return replace(fit, rows=_solved(indices, found[good]))
    (x0, y0), reach = fit.drift.middle, fit.drift.reach
    for _ in range(3):
        x, y = (indices @ fit.rows).T
        columns = np.column_stack([indices, *drift_terms((x - x0) / reach, (y - y0) / reach)])
        factors = _solved(columns, found[good])
        right, down = (tuple(map(float, axis)) for axis in factors[3:].T)
        fit = replace(fit, rows=factors[:3], drift=fit.drift._replace(right=right, down=down))
    return fit


def _solved(columns: Floats, values: Floats) -> Floats:
    """Return least squares factors by normal equations: of 1500 centres in 1 ms, `lstsq` in 68 ms on busy cores."""
    scale = np.maximum(np.sqrt((columns**2).sum(axis=0)), 1e-30)
    scaled = columns / scale
    factors, *_ = np.linalg.lstsq(scaled.T @ scaled, scaled.T @ values, rcond=None)
    return np.asarray(factors / (scale if values.ndim == 1 else scale[:, None]), np.float64)


def _no_drift(size: tuple[int, int]) -> Drift:
    zero = (0.0,) * len(DRIFT_TERMS)
    return Drift(middle=(size[0] / 2, size[1] / 2), reach=size[0] / 2, right=zero, down=zero)


def _drifts(places: Floats, residuals: Floats) -> bool:
    """Return whether a cubic explains residuals of the straight grid beyond what noise alone would give it."""
    low, high = places.min(axis=0), places.max(axis=0)
    x, y = (2 * (places - low) / np.maximum(high - low, 1) - 1).T
    terms = np.stack([x**i * y**j for i in range(4) for j in range(4 - i)], axis=1)
    if len(places) < ENOUGH:
        return False
    weights = _solved(terms, residuals)
    smooth = terms @ weights
    noise = math.sqrt(terms.shape[1] / len(places)) * float((residuals - smooth).std())
    return bool(np.sqrt((smooth**2).mean()) > max(NOTED_DRIFT / 2, 3 * noise))


def _check_borders(fit: _Affine, summits: Summits, k: Floats, l: Floats) -> None:
    """Raise NoLenses unless micro-images are darker somewhere halfway to a neighbour than in the middle, by mean."""
    places, (a, b) = fit.places(k, l), fit.rows[1:]
    middle, between = (
        float(np.mean(summits.at(places))),
        min(float(np.mean(summits.at(places + step))) for step in (a / 2, b / 2, (a + b) / 2)),
    )
    if not between < BORDER * middle:
        raise NoLenses(
            f"no lenses are found: what repeats every {fit.pitch[0]:.1f}×{fit.pitch[1]:.1f} px has no dark borders, "
            f"{between / middle:.2f} of the light of the middle: give a white image"
        )


def _pixels(places: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows and columns of the pixels in which places lie."""
    return np.floor(places[:, 1]).astype(np.int64), np.floor(places[:, 0]).astype(np.int64)


class _Level:
    """Fit the light of lenses over the picture: a polynomial of the fourth degree, robust to dark lenses."""

    def __init__(self, places: Floats, heights: Floats, size: tuple[int, int]) -> None:
        self.size = size
        self.degree = 4 if len(places) > 400 else 2
        terms = self._terms(places)
        kept = np.abs(heights - np.median(heights)) <= 0.5 * abs(np.median(heights))
        self.positive = bool(np.median(heights) > 0)
        for _ in range(6):
            self.weights = _solved(terms[kept], heights[kept])
            miss = np.abs(heights - terms @ self.weights)
            kept = miss <= 3 * 1.4826 * np.median(miss[kept]) + 1e-9 * np.median(heights)
        self.positive &= bool((terms @ self.weights > 0.02 * np.median(heights)).all())

    def _terms(self, places: Floats) -> Floats:
        x, y = (2 * places[:, axis] / self.size[axis] - 1 for axis in (0, 1))
        return np.stack([x**i * y**j for i in range(self.degree + 1) for j in range(self.degree + 1 - i)], axis=1)

    def at(self, places: Floats) -> Floats:
        return self._terms(places) @ self.weights

    def picture(self) -> NDArray[np.float32]:
        """At all pixels, (N, M); not less than a fiftieth of its greatest value."""
        width, height = self.size
        x, y = (2 * (np.arange(n) + 0.5) / n - 1 for n in (width, height))
        table = np.zeros((self.degree + 1, self.degree + 1))
        table[tuple(np.array([(j, i) for i in range(self.degree + 1) for j in range(self.degree + 1 - i)]).T)] = (
            self.weights
        )
        level = (np.vander(y, self.degree + 1, increasing=True) @ table) @ np.vander(
            x, self.degree + 1, increasing=True
        ).T
        return np.maximum(level, 0.02 * level.max()).astype(np.float32)


def _result(
    fit: _Affine, size: tuple[int, int], drift_px: float, straight_rms_px: float, **centres: NDArray[Any]
) -> LensGrid:
    options = [fit]
    if fit.hexagonal:  # an odd row first: half a pitch to the right of it is then a lens of the next
        c, a, b = fit.rows
        options.append(replace(fit, rows=np.vstack([c + 0.5 * a + b, a, b])))
    fits = [(option, _range(option, size)) for option in options]
    best, (k0, k1, l0, l1) = max(fits, key=lambda f: (f[1][1] - f[1][0] + 1) * (f[1][3] - f[1][2] + 1))
    lenses = (k1 - k0 + 1, l1 - l0 + 1)
    if min(lenses) < 2:
        raise NoLenses(f"only {lenses[0]}×{lenses[1]} lenses lie wholly in the picture: at least 2×2 are needed")
    a, b = best.rows[1:]
    (across, down), turn = best.pitch, math.atan2(-a[1], a[0])
    shear = float(a @ b) / across / down
    axes = axes_of(math.degrees(turn), shear)
    first = best.rows[0] + k0 * a + l0 * b
    # The middle of the array, about which axes turn, is half of all pitches from half a pitch before the first lens.
    middle = first + (lenses[0] - 1) / 2 * a + (lenses[1] - 1) / 2 * b
    origin = float(middle[0] - lenses[0] * across / 2), float(middle[1] - lenses[1] * down / 2)
    lattice = Lattice(lenses, (across, down), origin, best.hexagonal, axes, best.drift)
    return LensGrid(
        lattice=lattice, turn_deg=math.degrees(turn), shear=shear, drift_px=drift_px, straight_rms_px=straight_rms_px,
        **centres,
    )  # fmt: skip


def _range(fit: _Affine, size: tuple[int, int]) -> tuple[int, int, int, int]:
    """First and last column and row, rows from an even one on, of the most lenses that all lie in the picture."""
    corners = np.array([[0, 0], [size[0], 0], [0, size[1]], size], np.float64)
    kl = np.linalg.solve(fit.rows[1:].T, (corners - fit.rows[0]).T)
    more = 0 if fit.drift is None else MARGIN_DRIFTING
    low, high = np.floor(kl.min(axis=1)).astype(int) - more, np.ceil(kl.max(axis=1)).astype(int) + more
    margin = INSIDE * np.array(fit.pitch)
    k, l = np.meshgrid(np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1))
    place = fit.places(k.ravel().astype(float), l.ravel().astype(float)).reshape(*k.shape, 2)
    inside = np.all((place >= margin) & (place <= np.array(size) - margin), axis=2)
    k0, k1, l0, l1 = 0, k.shape[1], 0, k.shape[0]  # half open
    while k1 - k0 > 1 and l1 - l0 > 1:
        sides = {
            "left": inside[l0:l1, k0].mean(),
            "right": inside[l0:l1, k1 - 1].mean(),
            "top": inside[l0, k0:k1].mean(),
            "bottom": inside[l1 - 1, k0:k1].mean(),
        }
        worst = min(sides, key=lambda side: sides[side])
        if sides[worst] == 1:
            break
        k0, k1 = k0 + (worst == "left"), k1 - (worst == "right")
        l0, l1 = l0 + (worst == "top"), l1 - (worst == "bottom")
    if fit.hexagonal and (l0 + low[1]) % 2:
        l0 += 1
    return int(k0 + low[0]), int(k1 - 1 + low[0]), int(l0 + low[1]), int(l1 - 1 + low[1])
