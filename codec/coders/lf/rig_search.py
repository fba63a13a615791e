"""Encoder's estimate of how far the views of a light field depart from their places on the lattice (`rig`).

All views are registered to the middle one. The disparity of its cells of 4×4 samples and the entries of the views are
improved in turns by least squares of differences of luma (Lucas and Kanade 1981), weighted against outliers by
Cauchy's function.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ii_core.base.jit import array_kernel

from .ranges import FAR, MARGIN, UNIT, Lattice, Views, beside, cell_errors, offsets, over_squares
from .rig import FIELDS, MOST, PLACE_UNIT, SHIFT_UNIT
from .stream import UPRIGHT

# Turns with views that are smoothed so many times by (1, 2, 1) / 4 across and down.
TURNS, SMOOTHINGS = 4, (6, 2, 1)
# Times, and samples of a view, from which on every second row and column tell as much as all.
SMOOTH, LARGE = 2, 1 << 14
SAMPLES, MOST_APART = 1 << 21, 4  # of all views that are compared, about: of every so many-th row and column, at most
OUTLYING, LEAST_OUTLYING = 1.5, 4.0  # times the median of differences, and added: a difference with half the weight
MOST_MOVE = 48 / 256  # of a cell's disparity in a turn, in samples
# Of an entry and of disparity, the part of their curvature by which steps are damped.
DAMPING, DAMPING_OF_CELLS = 1e-3, 0.02
# Where disparity hardly varies, a camera beside its place and a shifted picture look alike: places are held as if
# there were so much disparity more, in squared samples.
HELD = 0.02
OVERLAPPING = 0.25  # of a view's shorter side: disparity from the middle to the outermost view must not lead farther
# A table is written if differences fall to this part, and not looked for further if smoothed views stay above that.
WORTH, HOPELESS = 0.93, 0.975
ERRORS, CELLS, ENTRIES = range(3)  # what a registration tells, each beside those before it
_UNITS = np.array([PLACE_UNIT / UPRIGHT] * 2 + [SHIFT_UNIT / 256] * 6)


def departures(
    view: Views, grid: tuple[int, int], lattice: Lattice, limits: tuple[int, int]
) -> NDArray[np.int64] | None:
    """Return the entries of all views, (J, `FIELDS`); None if views fit about as well without.

    Parameters
    ----------
    view : callable
        Planes (3, H, W) of the view at (row, column).
    grid : (int, int)
        Rows and columns of views.
    lattice : (int, int, int)
        As in the header.
    limits : (int, int)
        Least and greatest disparity, in 2^-8 samples.
    """
    reach = max(-limits[0], limits[1]) - MARGIN
    if reach < FAR or max(grid) // 2 * reach > OVERLAPPING * 256 * min(view(0, 0).shape[1:]):
        return None
    registration = _Registration(view, grid, lattice, limits)
    none = np.zeros((grid[0] * grid[1], FIELDS))
    alone, moved = (_Fit(registration.start, none.copy(), moving) for moving in (False, True))
    for count in SMOOTHINGS:
        registration.smooth(count)
        registration.improve(alone)
        registration.improve(moved)
        before, entries = registration.misfit(alone, alone), moved.whole()
        after = registration.misfit(replace(moved, entries=entries * _UNITS), alone)
        if not entries.any() or after > HOPELESS * before:
            return None
    return entries if after < WORTH * before else None


@dataclass
class _Fit:
    """Disparity of cells and entries of views, which are 0 unless they are ``moving``."""

    disparity: NDArray[np.float64]
    entries: NDArray[np.float64]
    moving: bool
    scales: NDArray[np.float64] = field(init=False)  # of views: differences that have half the weight

    def __post_init__(self) -> None:
        self.scales = np.ones(len(self.entries))

    def whole(self) -> NDArray[np.int64]:
        """Return the entries in whole units."""
        found: NDArray[np.int64] = np.rint(self.entries / _UNITS).astype(np.int64)
        return np.clip(found, -MOST, MOST)


class _Registration:
    """Views and their differences from the middle one."""

    def __init__(self, view: Views, grid: tuple[int, int], lattice: Lattice, limits: tuple[int, int]) -> None:
        places = [divmod(at, grid[1]) for at in range(grid[0] * grid[1])]
        self.middle = grid[0] // 2 * grid[1] + grid[1] // 2
        self.others = [at for at in range(len(places)) if at != self.middle]
        self.luma = np.stack([view(*place)[0] for place in places])
        self.views = np.empty(self.luma.shape, np.float32)
        self.leads = offsets(places[self.middle], places, lattice, grid)[:, 1:] / UPRIGHT
        first, last = limits[0] // UNIT, -(-limits[1] // UNIT)
        errors = over_squares(cell_errors(view, grid, places[self.middle], lattice, (first, last)))
        self.start = (first + errors.argmin(axis=0)) * (UNIT / 256)
        self.apart = min(max(1, round((self.luma.size / SAMPLES) ** 0.5)), MOST_APART)
        self.every = self.apart

    def smooth(self, count: int) -> None:
        """Smooth the views so many times, and choose how many rows and columns are compared."""
        coarse = count >= SMOOTH and self.luma[0].size >= LARGE
        self.every = max(2, self.apart) if coarse else self.apart
        for at, luma in enumerate(self.luma):  # one by one: temporary arrays are as large as a view
            self.views[at] = _smoothed(luma.astype(np.float32), count)

    def misfit(self, fit: _Fit, limiting: _Fit) -> float:
        """Return the sum of differences, which count up to three times the scale of their view in another fit."""
        total = 0.0
        for at in self.others:
            differences = self._register(at, fit, ERRORS)[0]
            total += float(np.minimum(np.abs(differences), 3 * limiting.scales[at]).sum())
        return total

    def improve(self, fit: _Fit) -> None:
        """Take some turns."""
        for at in self.others:
            differences = self._register(at, fit, ERRORS)[0]
            fit.scales[at] = OUTLYING * float(np.median(np.abs(differences))) + LEAST_OUTLYING
        for _ in range(TURNS):
            self._turn(fit)

    def _turn(self, fit: _Fit) -> None:
        """Take a step of the cells' disparity, and of the entries if these are moving."""
        tops, bottoms = (np.zeros(fit.disparity.shape) for _ in range(2))
        for at in self.others:
            _, squares, side, top, bottom = self._register(at, fit, ENTRIES if fit.moving else CELLS)
            tops, bottoms = tops + top, bottoms + bottom
            if fit.moving:
                held = HELD * np.diag(squares)[2:4]
                side[:2] -= held * fit.entries[at, :2]
                squares += np.diag(DAMPING * np.diag(squares) + 1e-6)
                squares[(0, 1), (0, 1)] += held
                fit.entries[at] += np.linalg.solve(squares, side)
        step = over_squares(tops[None])[0] / ((1 + DAMPING_OF_CELLS) * over_squares(bottoms[None])[0] + 1e-6)
        fit.disparity = fit.disparity + np.clip(step, -MOST_MOVE, MOST_MOVE)
        if fit.moving:
            self._settle(fit)

    def _settle(self, fit: _Fit) -> None:
        """Give to disparity what it can explain alone: a factor of it, a constant, and slopes across and down."""
        height, width = self.luma.shape[1:]
        rows, cols = ((8 * np.arange(side // 4) + 3 - side) / max(height, width) for side in (height, width))
        for fields, by in (([0, 1], fit.disparity), ([2, 3], 1.0), ([4, 6], cols), ([5, 7], rows[:, None])):
            share = (self.leads * fit.entries[:, fields]).sum() / (self.leads**2).sum()
            fit.entries[:, fields] -= share * self.leads
            fit.disparity = fit.disparity + share * by

    def _register(self, at: int, fit: _Fit, told: int) -> tuple[NDArray[np.float64], ...]:
        middle, other, lead = self.views[self.middle], self.views[at], self.leads[at]
        found: tuple[NDArray[np.float64], ...] = _registered(
            middle, other, fit.disparity, lead, fit.entries[at], self.every, fit.scales[at], told
        )
        return found


def _smoothed(luma: NDArray[np.float32], count: int) -> NDArray[np.float32]:
    for _ in range(count):
        for axis in (0, 1):
            before, after = beside(luma, axis)
            luma = np.float32(0.25) * (before + 2 * luma + after)
    return luma


@array_kernel
def _registered(middle, other, disparity, lead, entry, every, scale, told):
    """Return differences of samples, normal equations of the view's entry, and of each cell's disparity, if told."""
    height, width = middle.shape
    side = max(height, width)
    errors = np.zeros(((height + every - 1) // every) * ((width + every - 1) // every), np.float32)
    squares, right, row = np.zeros((8, 8)), np.zeros(8), np.zeros(8)
    tops, bottoms = np.zeros(disparity.shape), np.zeros(disparity.shape)
    number = 0
    across, down = lead[0] + entry[0], lead[1] + entry[1]
    for y in range(0, height, every):
        v = (2 * y - height) / side
        for x in range(0, width, every):
            u, d = (2 * x - width) / side, disparity[y >> 2, x >> 2]
            at_x = x + d * across + entry[2] + entry[4] * u + entry[5] * v
            at_y = y + d * down + entry[3] + entry[6] * u + entry[7] * v
            i, j = int(np.floor(at_x)), int(np.floor(at_y))
            if i < 0 or j < 0 or i + 1 >= width or j + 1 >= height:
                continue
            fx, fy = at_x - i, at_y - j
            a, b, c, e = other[j, i], other[j, i + 1], other[j + 1, i], other[j + 1, i + 1]
            upper, lower = a + fx * (b - a), c + fx * (e - c)
            gx, gy = (1 - fy) * (b - a) + fy * (e - c), lower - upper
            error = middle[y, x] - (upper + fy * (lower - upper))
            errors[number] = error
            number += 1
            if told == ERRORS:
                continue
            weight = 1 / (1 + (error / scale) ** 2)
            if told == ENTRIES:
                row[0], row[1], row[2], row[3] = gx * d, gy * d, gx, gy
                row[4], row[5], row[6], row[7] = gx * u, gx * v, gy * u, gy * v
                for k in range(8):
                    right[k] += weight * row[k] * error
                    for m in range(k + 1):
                        squares[k, m] += weight * row[k] * row[m]
            along = gx * across + gy * down
            tops[y >> 2, x >> 2] += weight * along * error
            bottoms[y >> 2, x >> 2] += weight * along * along
    for k in range(8):
        for m in range(k):
            squares[m, k] = squares[k, m]
    return errors[: max(number, 1)], squares, right, tops, bottoms
