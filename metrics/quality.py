"""Qualities that the measures return: per viewing angle, per view, per depth layer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class AngleQuality:
    """Quality of each sub-image, over the viewing angle.

    Attributes
    ----------
    values : ndarray of float64, (V, U)
        NaN where no pixel of the sub-image counts. ``np.asarray`` of the quality gives them too.
    u_deg, v_deg : ndarray of float64, (U,) and (V,), or None
        Directions of the columns and rows, see `angle_axes`; None of a picture without a camera.
    """

    values: NDArray[np.float64]
    u_deg: NDArray[np.float64] | None = None
    v_deg: NDArray[np.float64] | None = None

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self.values, dtype=dtype, copy=copy)

    @property
    def mean(self) -> float:
        """Arithmetic mean over the sub-images that have a value; NaN if none has."""
        return float(self._known.mean()) if self._known.size else math.nan

    @property
    def worst(self) -> float:
        """Of the worst sub-image: what a viewer who moves will meet."""
        return float(self._known.min()) if self._known.size else math.nan

    @property
    def best(self) -> float:
        """Of the best sub-image."""
        return float(self._known.max()) if self._known.size else math.nan

    @property
    def worst_view(self) -> tuple[int, int] | None:
        """(u, v) of the worst sub-image, the first in reading order; None if none has a value."""
        if not self._known.size:
            return None
        v, u = np.unravel_index(np.nanargmin(self.values), self.values.shape)
        return int(u), int(v)

    @property
    def _known(self) -> NDArray[np.float64]:
        return self.values[~np.isnan(self.values)]


@dataclass(frozen=True, eq=False)
class ViewQuality:
    """Mean SSIM and PSNR of each view image.

    Attributes
    ----------
    values : dict of str to float
        MSSIM by view name; NaN where no window is valid throughout.
    psnr : dict of str to float
        dB over the valid pixels' R, G and B; +inf where they are identical, NaN where there are none.
    pooled_psnr : float
        Of the errors of all views together, dB.
    """

    values: dict[str, float]
    psnr: dict[str, float]
    pooled_psnr: float

    @property
    def mean(self) -> float:
        """Arithmetic mean of MSSIM over the views that have one."""
        return _mean(self.values)

    @property
    def mean_psnr(self) -> float:
        """Arithmetic mean of PSNR over the views that have one, dB; at least ``pooled_psnr``."""
        return _mean(self.psnr)

    @property
    def worst(self) -> float:
        """MSSIM of the worst view."""
        return min(_known(self.values).values(), default=math.nan)

    @property
    def worst_view(self) -> str | None:
        """Name of the worst view by MSSIM, the first of equals; None if none has one."""
        known = _known(self.values)
        return min(known, key=known.__getitem__) if known else None


def _known(values: dict[str, float]) -> dict[str, float]:
    return {name: value for name, value in values.items() if not math.isnan(value)}


def _mean(values: dict[str, float]) -> float:
    known = _known(values).values()
    return sum(known) / len(known) if known else math.nan


@dataclass(frozen=True, eq=False)
class DepthQuality:
    """PSNR of each depth layer.

    Attributes
    ----------
    depth_mm : ndarray of float64, (layers,)
        z of each layer in camera coordinates.
    values : ndarray of float64, (layers,)
        dB over the layer's own pixels; NaN where it has none, +inf where they are identical.
    counts : ndarray of int64, (layers,)
        View pixels in each layer.
    outside : int
        View pixels that hit something nearer or farther than all layers; they count nowhere. 0 if the depth is
        estimated: it is always that of a layer, or none. 0 with the default layers too, but for depths at the pixel
        array or behind it.
    source : str
        Where depth came from: ``given``, or ``focus`` with the method, as in ``focus (dissertation)``.
    layer : ndarray of int64, (L', K)
        Layer of each pixel that the virtual camera sees, −1 where it has none; L' is L, less the rows of lenses
        that the camera does not see.
    error : ndarray of float64, (L', K)
        Root of the mean over R, G and B of the squared error at each of these pixels, in shares of the peak.
    missing : int
        View pixels without a depth: nothing is hit, or nothing tells the layers apart.
    """

    depth_mm: NDArray[np.float64]
    values: NDArray[np.float64]
    counts: NDArray[np.int64]
    outside: int
    source: str
    layer: NDArray[np.int64]
    error: NDArray[np.float64]
    missing: int = 0

    def error_map(self, layer: int) -> NDArray[np.float64]:
        """The error at the pixels of one layer, NaN at all others, (L', K)."""
        if not 0 <= layer < self.values.size:
            raise ValueError(f"layer is {layer}: 0 to {self.values.size - 1} are needed")
        return np.where(self.layer == layer, self.error, np.nan)

    @property
    def outside_share(self) -> float:
        """Share of ``outside`` in the view pixels that have a depth; NaN if none has."""
        hit = self.outside + int(self.counts.sum())
        return self.outside / hit if hit else float("nan")

    @property
    def min(self) -> float:
        """Of the layers that have pixels; NaN if none has."""
        return float(np.min(self._held)) if self._held.size else float("nan")

    @property
    def mean(self) -> float:
        """Of the layers that have pixels, each weighing the same; +inf if one of them is identical."""
        return float(np.mean(self._held)) if self._held.size else float("nan")

    @property
    def max(self) -> float:
        """Of the layers that have pixels; NaN if none has."""
        return float(np.max(self._held)) if self._held.size else float("nan")

    @property
    def _held(self) -> NDArray[np.float64]:
        return self.values[self.counts > 0]


def told_outside(share: float) -> str:
    """The share of view pixels in no layer, in words."""
    return "no view pixel has a depth" if np.isnan(share) else f"{share:.1%} of view pixels outside all layers"
