"""Where lens centres lie on the pixel array, and which lens a pixel is under. All in units of pixels.

Positions are measured from the array's top left corner, to the right and down; pixel (m, n) has its centre at
(m + ½, n + ½). Only +, −, × and ÷ are used, and distances are compared to a millionth of a pixel, so that a pixel on
the border of two lenses goes to the same one on every platform.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .jit import kernel

LATTICES = ("rectangular", "hexagonal")


class Lattice(NamedTuple):
    """K×L lens centres at ((k + ½)·pitch + origin); in a hexagonal array odd rows stand half a pitch to the right."""

    lenses: tuple[int, int]
    pitch: tuple[float, float]
    origin: tuple[float, float]
    hexagonal: bool

    def centres(self, k: NDArray[Any], l: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """x and y of the centres of lenses (k, l) (3.16)."""
        x = (k + 0.5) * self.pitch[0] + self.origin[0]
        if self.hexagonal:
            x = x + 0.5 * self.pitch[0] * (l % 2)
        return x, (l + 0.5) * self.pitch[1] + self.origin[1]

    def nearest(self, m: NDArray[Any], n: NDArray[Any]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Lens (k, l) nearest to the centres of pixels (3.19); (m, n) broadcast, and so may k and l.

        A pixel halfway between two lenses belongs to the one further right or, in another row, further up.
        """
        if not self.hexagonal:
            return tuple(
                np.clip(np.floor((i + 0.5 - origin) / pitch), 0, count - 1).astype(np.int64)
                for i, origin, pitch, count in zip((m, n), self.origin, self.pitch, self.lenses, strict=True)
            )  # type: ignore[return-value]
        m, n = np.broadcast_arrays(m, n)
        k, l = np.empty(m.size, np.int64), np.empty(m.size, np.int64)
        # No lens further off in y than half a row and the longest way in x can be the nearest.
        reach = math.ceil(self.pitch[0] / self.pitch[1]) + 1
        nearest_hexagonal(m.ravel(), n.ravel(), self.lenses, self.pitch, self.origin, reach, k, l)
        return k.reshape(m.shape), l.reshape(m.shape)


@kernel
def nearest_hexagonal(m, n, lenses, pitch, origin, reach, out_k, out_l):
    """Nearest lens of an array whose odd rows stand half a pitch to the right, by distance."""
    for i in range(m.shape[0]):
        x, y = m[i] + 0.5 - origin[0], n[i] + 0.5 - origin[1]
        row = min(max(math.floor(y / pitch[1]), 0), lenses[1] - 1)
        best = math.inf
        for l in range(max(row - reach, 0), min(row + reach, lenses[1] - 1) + 1):
            shifted = x - 0.5 * pitch[0] * (l % 2)
            k = min(max(math.floor(shifted / pitch[0]), 0), lenses[0] - 1)
            dx, dy = shifted - (k + 0.5) * pitch[0], y - (l + 0.5) * pitch[1]
            distance = math.floor((dx * dx + dy * dy) * 1e6 + 0.5)
            if distance < best:
                best = distance
                out_k[i], out_l[i] = k, l
