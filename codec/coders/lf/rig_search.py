"""Encoder's estimate of where the views of a light field really are.

All views are registered to the middle one: its disparity by cells of 4×4 samples, and each view's entry of `rig`, are
improved in turns by least squares of the differences of luma (Lucas and Kanade), weighted for outliers by Cauchy's
function.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ii_core.base.jit import array_kernel

from . import rig
from .ranges import FAR, MARGIN, UNIT, Lattice, Views, cell_errors, offsets, over_squares
from .rig import FIELDS, PLACE_UNIT, SHIFT_UNIT
from .stream import UPRIGHT

# Turns on views that are smoothed so many times by (1, 2, 1) / 4 across and down.
TURNS, SMOOTHINGS = 4, (6, 2, 1)
SAMPLES = 1 << 23  # of all views that are compared, about: those of every so many-th row and column
OUTLYING = 1.5  # times the median of the differences: half as much weight
MOST_STEP = 48 / 256  # of a cell's disparity in a turn, in samples
PRIOR = 0.02  # squared samples by which positions of cameras are held, against shifts
OVERLAPPING = 0.25  # of a view's shorter side: no thing lies farther beside itself in any two views
WORTH = 0.93  # views are moved if differences fall to this part
_UNITS = np.array([PLACE_UNIT / UPRIGHT] * 2 + [SHIFT_UNIT / 256] * 6)


def departures(
    view: Views, grid: tuple[int, int], lattice: Lattice, limits: tuple[int, int]
) -> NDArray[np.int64] | None:
    """Return the table of entries, (J, `FIELDS`) as in `rig`; None if views fit about as well on the lattice."""
    farthest = max(grid) // 2 * max(-limits[0], limits[1]) / 256
    if max(-limits[0], limits[1]) - MARGIN < FAR or farthest > OVERLAPPING * min(view(0, 0).shape[1:]):
        return None
    registration = _Registration(view, grid, lattice, limits)
    before = registration.alone()
    found = registration.together()
    return found if found.any() and registration.misfit(found) < WORTH * before else None


class _Registration:
    """Views on their way to their places."""

    def __init__(self, view: Views, grid: tuple[int, int], lattice: Lattice, limits: tuple[int, int]) -> None:
        rows, cols = grid
        self.middle = rows // 2 * cols + cols // 2
        places = [divmod(at, cols) for at in range(rows * cols)]
        self.luma = np.stack([view(*place)[0] for place in places]).astype(np.float32)
        self.views: NDArray[np.float32] = self.luma
        middle = places[self.middle]
        self.leads = offsets(middle, places, lattice, grid)[:, 1:] / UPRIGHT
        first, last = limits[0] // UNIT, -(-limits[1] // UNIT)
        errors = over_squares(cell_errors(view, grid, middle, lattice, (first, last)))
        self.start = (first + errors.argmin(axis=0)) * (UNIT / 256)
        self.disparity = self.start
        self.every = max(1, min(4, round((self.luma.size / SAMPLES) ** 0.5)))
        self.entries = np.zeros((len(places), FIELDS))

    def alone(self) -> float:
        """Improve disparity alone; return the misfit."""
        for count in SMOOTHINGS:
            self._smooth(count)
            for _ in range(TURNS):
                self._turn(False)
        self.first = self.scales
        return self.misfit(np.zeros(self.entries.shape, np.int64))

    def together(self) -> NDArray[np.int64]:
        """Improve disparity and entries; return these in whole units."""
        self.disparity = self.start
        for count in SMOOTHINGS:
            self._smooth(count)
            for _ in range(TURNS):
                self._turn(True)
        found: NDArray[np.int64] = np.rint(self.entries / _UNITS).astype(np.int64)
        return np.clip(found, -rig.MOST, rig.MOST)

    def misfit(self, entries: NDArray[np.int64]) -> float:
        """Return the sum of differences, each at most thrice those of outliers."""
        total = 0.0
        for at in range(len(self.views)):
            if at != self.middle:
                errors = self._register(at, entries[at] * _UNITS)[0]
                total += float(np.minimum(np.abs(errors), 3 * self.first[at]).sum())
        return total

    def _turn(self, moving: bool) -> None:
        tops, bottoms = (np.zeros(self.disparity.shape) for _ in range(2))
        for at in range(len(self.views)):
            if at != self.middle:
                _, squares, side, top, bottom = self._register(at, self.entries[at])
                if moving:
                    damped = squares + np.diag(1e-3 * np.diag(squares) + 1e-6)
                    damped[(0, 1), (0, 1)] += PRIOR * np.diag(squares)[2:4]
                    side[:2] -= PRIOR * np.diag(squares)[2:4] * self.entries[at, :2]
                    self.entries[at] += np.linalg.solve(damped, side)
                tops += top
                bottoms += bottom
        step = over_squares(tops[None])[0] / (over_squares(bottoms[None])[0] * 1.02 + 1e-6)
        self.disparity = self.disparity + np.clip(step, -MOST_STEP, MOST_STEP)
        if moving:
            self._settle()

    def _settle(self) -> None:
        """Give to disparity what it can explain alone: a factor of it, and a plane that is added to it."""
        leads = self.leads.ravel()
        for fields in ((0, 1), (2, 3), (4, 6), (5, 7)):
            share = leads @ self.entries[:, fields].ravel() / (leads @ leads)
            self.entries[:, fields] -= share * self.leads
            if fields == (0, 1):
                self.disparity = self.disparity * (1 + share)
            else:
                self.disparity = self.disparity + share * self._along(fields)

    def _along(self, fields: tuple[int, int]) -> NDArray[np.float64] | float:
        """Return by what growth is multiplied, at each cell; 1 for shifts."""
        height, width = self.luma.shape[1:]
        rows, cols = (4 * np.arange(side // 4) + 1.5 for side in (height, width))
        if fields == (4, 6):
            return (2 * cols - width)[None, :] / max(height, width)
        return (2 * rows - height)[:, None] / max(height, width) if fields == (5, 7) else 1.0

    def _register(self, at: int, entry: NDArray[np.float64]) -> tuple[NDArray, ...]:
        return _registered(
            self.views[self.middle], self.views[at], self.disparity, self.leads[at], entry, self.every, self._scale(at)
        )

    def _scale(self, at: int) -> float:
        return self.scales[at]

    def _smooth(self, count: int) -> None:
        self.views = _smoothed(self.luma, count)
        self.scales = np.ones(len(self.views))
        for at in range(len(self.views)):
            errors = self._register(at, self.entries[at])[0]
            self.scales[at] = OUTLYING * float(np.median(np.abs(errors))) + 4.0


def _smoothed(views: NDArray[np.float32], count: int) -> NDArray[np.float32]:
    for _ in range(count):
        for axis in (1, 2):
            sides = [(0, 0), (int(axis == 1),) * 2, (int(axis == 2),) * 2]
            padded, n = np.pad(views, sides, mode="edge"), views.shape[axis]
            views = (padded.take(range(n), axis) + 2 * views + padded.take(range(2, n + 2), axis)) / 4
    return views


@array_kernel
def _registered(middle, other, disparity, lead, entry, every, scale):
    """Return differences of samples, normal equations of the view's entry, and of each cell's disparity."""
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
            weight = 1 / (1 + (error / scale) ** 2)
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
    return errors[:number], squares, right, tops, bottoms
