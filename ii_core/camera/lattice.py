"""Lattice of lens centres on the pixel array, and the lens of each pixel; in units of pixels.

Positions are measured from the top left corner of the pixel array, right and down; pixel (m, n) has its centre at (m
+ ½, n + ½). Distances that differ by less than 1e-6 pixels are ties, and only +, −, × and ÷ are used. A pixel on the
border of two lenses therefore has the same owner on every platform.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.jit import kernel

LATTICES = ("rectangular", "hexagonal")
TIE = 1e-6  # pixels
Axes = tuple[float, float, float, float]
# Exponents (i, j) of the terms of a drift; constant and linear terms are offset, pitch, turn and shear.
DRIFT_TERMS = ((2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3))
STEEPEST = 0.2  # greatest drift between two neighbours, in shares of their distance
STEPS = 12  # of the inverse of a drift; each leaves at most a fifth of the error


class Drift(NamedTuple):
    """Smooth shift of lens centres off the straight grid: quadratic and cubic over the pixel array, in pixels.

    A centre at (x, y) of the straight grid is shifted by Σ aₜ·ξⁱ·ηʲ to the right and by Σ bₜ·ξⁱ·ηʲ down, with (i, j)
    of `DRIFT_TERMS`, ξ = (x − x₀)/r and η = (y − y₀)/r. ``middle`` is (x₀, y₀), ``reach`` is r.
    """

    middle: tuple[float, float]
    reach: float
    right: tuple[float, ...]
    down: tuple[float, ...]

    def at(self, x: Any, y: Any) -> tuple[Any, Any]:
        """Return the shift at places of the straight grid."""
        terms = drift_terms((x - self.middle[0]) / self.reach, (y - self.middle[1]) / self.reach)
        return (
            sum(a * term for a, term in zip(self.right, terms, strict=True)),
            sum(b * term for b, term in zip(self.down, terms, strict=True)),
        )

    def undone(self, x: Any, y: Any) -> tuple[Any, Any]:
        """Return the places of the straight grid whose shifted places are (x, y)."""
        straight = x, y
        for _ in range(STEPS):
            right, down = self.at(*straight)
            straight = x - right, y - down
        return straight


def drift_terms(xi: Any, eta: Any) -> list[Any]:
    """Return ξⁱ·ηʲ for all of `DRIFT_TERMS`."""
    xx, ee = xi * xi, eta * eta
    return [xx, xi * eta, ee, xx * xi, xx * eta, xi * ee, ee * eta]


class Lattice(NamedTuple):
    """K×L lens centres at (k + ½)·pitch + origin; odd rows of a hexagonal array are shifted half a pitch right.

    ``axes`` (xx, xy, yx, yy), None for a straight grid, turn and shear it about the middle of the array: what is
    (dx, dy) off the middle of the straight grid is (xx·dx + xy·dy, yx·dx + yy·dy) off it on the pixels. Cells are
    those of the straight grid, turned and sheared with it. ``axes`` have the determinant 1; see `axes_of`. ``drift``
    shifts the centres of the turned grid, and its cells with them.
    """

    lenses: tuple[int, int]
    pitch: tuple[float, float]
    origin: tuple[float, float]
    hexagonal: bool
    axes: Axes | None = None
    drift: Drift | None = None

    @property
    def middle(self) -> tuple[float, float]:
        """Middle of the array, about which it is turned."""
        (k, l), (p, q), (x, y) = self.lenses, self.pitch, self.origin
        return x + k * p / 2, y + l * q / 2

    def centres(self, k: NDArray[Any], l: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return x and y of the centres of lenses (k, l) (3.16)."""
        x = (k + 0.5) * self.pitch[0] + self.origin[0]
        if self.hexagonal:
            x = x + 0.5 * self.pitch[0] * (l % 2)
        y = (l + 0.5) * self.pitch[1] + self.origin[1]
        if self.axes is not None:
            dx, dy = self.offsets(x - self.middle[0], y - self.middle[1])
            x, y = dx + self.middle[0], dy + self.middle[1]
        if self.drift is None:
            return x, y
        right, down = self.drift.at(x, y)
        return x + right, y + down

    def offsets(self, dx: Any, dy: Any) -> tuple[Any, Any]:
        """Return the offset on the pixel array of an offset in the straight grid."""
        if self.axes is None:
            return dx, dy
        xx, xy, yx, yy = self.axes
        return xx * dx + xy * dy, yx * dx + yy * dy

    def straight(self, x: Any, y: Any) -> tuple[Any, Any]:
        """A place on the pixels in the straight grid; the inverse of the turn, the shear and the drift."""
        if self.drift is not None:
            x, y = self.drift.undone(x, y)
        if self.axes is None:
            return x, y
        xx, xy, yx, yy = self.axes
        dx, dy = x - self.middle[0], y - self.middle[1]
        return yy * dx - xy * dy + self.middle[0], xx * dy - yx * dx + self.middle[1]

    def nearest(self, m: NDArray[Any], n: NDArray[Any]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the lens (k, l) nearest to the centres of pixels (3.19); m and n broadcast, and so do k and l.

        A pixel halfway between two lenses belongs to the right one, or to the upper one if rows differ.
        """
        if self.axes is not None or self.drift is not None:
            x, y = self.straight(m + 0.5, n + 0.5)
            m, n = x - 0.5, y - 0.5
        if not self.hexagonal:
            right = np.floor((m + 0.5 - self.origin[0] + TIE) / self.pitch[0])
            up = np.ceil((n + 0.5 - self.origin[1] - TIE) / self.pitch[1]) - 1
            k, l = right.clip(0, self.lenses[0] - 1), up.clip(0, self.lenses[1] - 1)
            return k.astype(np.int64), l.astype(np.int64)
        m, n = np.broadcast_arrays(m, n)
        k, l = np.empty(m.size, np.int64), np.empty(m.size, np.int64)
        nearest_hexagonal(m.ravel(), n.ravel(), self.lenses, self.pitch, self.origin, k, l)
        return k.reshape(m.shape), l.reshape(m.shape)


def axes_of(turn_deg: float, shear: float) -> Axes | None:
    """``axes`` of a `Lattice`: the angle by which rows rise to the right, and how far each is shifted there.

    ``shear`` is that shift, of a row against the one above, in shares of their distance.
    """
    if turn_deg == 0 and shear == 0:
        return None
    cosine, sine = math.cos(math.radians(turn_deg)), math.sin(math.radians(turn_deg))
    return cosine, sine + shear * cosine, -sine, cosine - shear * sine


@kernel
def nearest_hexagonal(m, n, lenses, pitch, origin, out_k, out_l):
    """Find the nearest lens of each pixel in a hexagonal array.

    Lenses of all odd rows have the same x, and so have lenses of all even rows. The nearest lens is therefore in the
    nearest odd or the nearest even row: the pixel's own row or a neighbour.
    """
    for i in range(m.shape[0]):
        x, y = m[i] + 0.5 - origin[0], n[i] + 0.5 - origin[1]
        row = min(max(math.floor(y / pitch[1]), 0), lenses[1] - 1)
        best = math.inf
        for l in range(max(row - 1, 0), min(row + 1, lenses[1] - 1) + 1):
            shifted = x - 0.5 * pitch[0] * (l % 2)
            k = min(max(math.floor((shifted + TIE) / pitch[0]), 0), lenses[0] - 1)
            dx, dy = shifted - (k + 0.5) * pitch[0], y - (l + 0.5) * pitch[1]
            distance = dx * dx + dy * dy
            if distance < best - TIE:
                best = distance
                out_k[i], out_l[i] = k, l
