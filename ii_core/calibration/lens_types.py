"""Types of lenses in multi-focus arrays, from the detail under each lens."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.extras import Lazy
from .grid import LensGrid

ndimage, special = Lazy("scipy.ndimage"), Lazy("scipy.special")

EXPLAINED = 0.25  # of the variation from lens to lens, that types must explain to be there
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
        Share of the variation of detail from lens to lens that the pattern explains, in [0, 1].
    detail : tuple of float
        Mean of each type's logarithm of detail less that of all, type 0 first.
    """

    pattern: str
    explained: float
    detail: tuple[float, ...]

    def describe(self) -> str:
        """One line."""
        if self.pattern == "one":
            return f"one, as far as detail tells (the best pattern explains {self.explained:.0%} of its variation)"
        return f"{len(self.detail)}, pattern {self.pattern}, {self.explained:.0%} of the variation of detail"


def lens_types(grey: NDArray[np.float32], grid: LensGrid) -> LensTypes:
    """Whether the detail of micro-images, the size of their second derivatives, repeats with a pattern of lenses.

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
    smooth = _local_mean(detail, ok, lattice.lenses)
    detail = detail - smooth
    best: tuple[str, float, float, tuple[float, ...]] = ("one", 0.0, 1.0, (0.0,))
    for name, count, classes in _patterns(k, l, lattice.hexagonal):
        groups = [detail[ok & (classes == c)] for c in range(count)]
        if min(len(g) for g in groups) < 8:
            continue
        all_ = np.concatenate(groups)
        between = sum(len(g) * (g.mean() - all_.mean()) ** 2 for g in groups)
        share = float(between / max(((all_ - all_.mean()) ** 2).sum(), 1e-30))
        rest = (1 - share) / (len(all_) - count)
        chance = float(special.fdtrc(count - 1, len(all_) - count, share / (count - 1) / rest)) if rest > 0 else 0.0
        if share - 0.02 * count > best[1]:  # of two that explain as much, the simpler
            best = (name, share, chance, tuple(float(g.mean() - all_.mean()) for g in groups))
    name, share, chance, means = best
    if share < EXPLAINED or not chance < CHANCE:
        return LensTypes("one", share, (0.0,))
    return LensTypes(name, share, means)


def _local_mean(values: NDArray[np.float64], ok: NDArray[np.bool_], lenses: tuple[int, int]) -> NDArray[np.float64]:
    """Mean over 7×7 lenses: the scene's own changes of detail."""
    grid, weight = (a.reshape(lenses[::-1]).astype(np.float64) for a in (np.where(ok, values, 0), ok))
    mean = ndimage.uniform_filter(grid, 7) / np.maximum(ndimage.uniform_filter(weight, 7), 1e-9)
    return np.asarray(mean.ravel())


def _patterns(k: Classes, l: Classes, hexagonal: bool) -> list[tuple[str, int, Classes]]:
    patterns = []
    for name, rows in MATRICES.items():
        if name != "one" and (hexagonal or name != "3"):
            matrix = np.array(rows)
            patterns.append((name, int(matrix.max()) + 1, matrix[l % matrix.shape[0], k % matrix.shape[1]]))
    return patterns
