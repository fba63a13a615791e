"""Types of lenses in multi-focus arrays, from the detail under each lens."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.extras import Lazy
from .grid import LensGrid

ndimage, special = Lazy("scipy.ndimage"), Lazy("scipy.special")

EXPLAINED = 0.25  # of the variation from lens to lens, that types must explain to be there
NEAR = 7  # lenses across and down, in which the same type has as much detail
CHANCE = 1e-6  # probability that an even array shows as much

Classes = NDArray[np.int64]
# Types of lenses by pattern, in rows that repeat over the array; of a hexagonal one no two neighbours are alike.
MATRICES: dict[str, tuple[tuple[int, ...], ...]] = {
    "one": ((0,),),
    "2×1": ((0, 1),),
    "1×2": ((0,), (1,)),
    "2×2": ((0, 1), (2, 3)),
    "3": ((0, 1, 2), (2, 0, 1)),
}


@dataclass(frozen=True)
class LensTypes:
    """A pattern of lens types.

    Attributes
    ----------
    pattern : str
        "one", or how types take turns: "2×1" (columns), "1×2" (rows), "2×2", "3" (of a hexagonal array, no two
        neighbours alike).
    explained : float
        Share of the variation of detail from lens to lens that lenses of the same type nearby explain, in [0, 1].
    detail : tuple of float
        Mean of each type's logarithm of detail less that of all, type 0 first.
    """

    pattern: str
    explained: float
    detail: tuple[float, ...]

    @property
    def rows(self) -> tuple[tuple[int, ...], ...]:
        """Types of the lenses, in rows that repeat over the array."""
        return MATRICES[self.pattern]

    def describe(self) -> str:
        """One line."""
        if self.pattern == "one":
            return f"one, as far as detail tells (the best pattern explains {self.explained:.0%} of its variation)"
        return f"{len(self.detail)}, pattern {self.pattern}, {self.explained:.0%} of the variation of detail"


def lens_types(grey: NDArray[np.float32], grid: LensGrid) -> LensTypes:
    """Whether the detail of micro-images, the size of their second derivatives, repeats with a pattern of lenses.

    Which type has most detail depends on depth: each lens is compared with those of its type nearby.

    Parameters
    ----------
    grey : ndarray, (N, M)
        The picture.
    grid : LensGrid
        Its lenses.
    """
    lattice = grid.lattice
    k, l = (g.ravel() for g in np.meshgrid(np.arange(lattice.lenses[0]), np.arange(lattice.lenses[1])))
    x, y = lattice.centres(k, l)
    half = max(1, int(0.25 * min(lattice.pitch)))
    edges = ndimage.uniform_filter(np.abs(ndimage.laplace(grey.astype(np.float32))), 2 * half + 1)
    level = ndimage.uniform_filter(np.abs(grey).astype(np.float32), 2 * half + 1)
    at = np.floor(y).astype(int).clip(0, grey.shape[0] - 1), np.floor(x).astype(int).clip(0, grey.shape[1] - 1)
    ok = level[at] > 0.1 * np.median(level[at])
    detail = np.log(np.maximum(edges[at], 1e-9) / np.maximum(level[at], 1e-9))
    detail = np.where(ok, detail - _nearby(detail, ok, lattice.lenses)[0], 0.0)
    best: tuple[str, float, float, tuple[float, ...]] = ("one", 0.0, 1.0, (0.0,))
    for name, count, classes in _patterns(k, l, lattice.hexagonal):
        groups = [ok & (classes == c) for c in range(count)]
        if min(int(group.sum()) for group in groups) < 8:
            continue
        expected, known = np.zeros(len(detail)), np.zeros(len(detail), bool)
        for group in groups:  # without the lens itself
            mean, others = _nearby(detail, group, lattice.lenses)
            here = group & (others > 1.5)
            expected[here] = (mean * others - detail)[here] / (others - 1)[here]
            known |= here
        left = int(known.sum()) - 2
        if left < 1 or not (expected[known].std() > 0 and detail[known].std() > 0):
            continue
        along = float(np.corrcoef(expected[known], detail[known])[0, 1])
        share = max(along, 0.0) ** 2
        chance = float(special.fdtrc(1, left, share / max(1 - share, 1e-12) * left))
        if share - 0.02 * count > best[1]:  # of two that explain as much, the simpler
            best = (name, share, chance, tuple(float(detail[group].mean()) for group in groups))
    name, share, chance, means = best
    if share < EXPLAINED or not chance < CHANCE:
        return LensTypes("one", share, (0.0,))
    return LensTypes(name, share, means)


def _nearby(
    values: NDArray[np.float64], ok: NDArray[np.bool_], lenses: tuple[int, int]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the mean of the lenses that are ok among 7×7, and their number: the scene changes slowly over them."""
    grid, weight = (a.reshape(lenses[::-1]).astype(np.float64) for a in (np.where(ok, values, 0), ok))
    total, count = (NEAR**2 * ndimage.uniform_filter(a, NEAR, mode="constant") for a in (grid, weight))
    return (total / np.maximum(count, 1e-9)).ravel(), count.ravel()


def _patterns(k: Classes, l: Classes, hexagonal: bool) -> list[tuple[str, int, Classes]]:
    patterns = []
    for name, rows in MATRICES.items():
        if name != "one" and (hexagonal or name != "3"):
            matrix = np.array(rows)
            patterns.append((name, int(matrix.max()) + 1, matrix[l % matrix.shape[0], k % matrix.shape[1]]))
    return patterns
