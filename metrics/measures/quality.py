"""Results of measures: quality per viewing angle, per view, per depth layer."""

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
        NaN for sub-images without a pixel that counts. ``np.asarray(quality)`` returns the values, too.
    u_deg, v_deg : ndarray of float64, (U,) and (V,), or None
        Directions of the columns and rows, see `angle_axes`; None for pictures without a camera.
    """

    values: NDArray[np.float64]
    u_deg: NDArray[np.float64] | None = None
    v_deg: NDArray[np.float64] | None = None

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self.values, dtype=dtype, copy=copy)

    @property
    def mean(self) -> float:
        """Arithmetic mean over sub-images with a value; NaN if there are none."""
        return float(self._known.mean()) if self._known.size else math.nan

    @property
    def worst(self) -> float:
        """Quality of the worst sub-image; NaN if none has a value."""
        return float(self._known.min()) if self._known.size else math.nan

    @property
    def best(self) -> float:
        """Quality of the best sub-image; NaN if none has a value."""
        return float(self._known.max()) if self._known.size else math.nan

    @property
    def worst_view(self) -> tuple[int, int] | None:
        """(u, v) of the worst sub-image, the first of equals in reading order; None if none has a value."""
        if not self._known.size:
            return None
        v, u = np.unravel_index(np.nanargmin(self.values), self.values.shape)
        return int(u), int(v)

    @property
    def step(self) -> float:
        """Root mean square change from one sub-image to the next along the serpentine path; NaN for a single one."""
        path = self.values.copy()
        path[1::2] = path[1::2, ::-1]
        before, after = path.ravel()[:-1], path.ravel()[1:]
        changes = np.subtract(
            after, before, where=before != after, out=np.zeros(before.shape)
        )  # +inf twice is no change
        return float(np.sqrt(np.mean(np.square(changes)))) if changes.size else math.nan

    @property
    def _known(self) -> NDArray[np.float64]:
        return self.values[~np.isnan(self.values)]


@dataclass(frozen=True, eq=False)
class ViewQuality:
    """Mean SSIM and PSNR of each view image.

    Attributes
    ----------
    values : dict of str to float
        MSSIM by view name; NaN if no window is entirely valid.
    psnr : dict of str to float
        dB over R, G and B of the valid pixels; +inf if they are identical, NaN if there are none.
    pooled_psnr : float
        PSNR of the errors pooled over all views, dB.
    """

    values: dict[str, float]
    psnr: dict[str, float]
    pooled_psnr: float

    @property
    def mean(self) -> float:
        """Arithmetic mean of MSSIM over views with a value."""
        return _mean(self.values)

    @property
    def mean_psnr(self) -> float:
        """Arithmetic mean of PSNR over views with a value, dB; at least ``pooled_psnr``."""
        return _mean(self.psnr)

    @property
    def worst(self) -> float:
        """MSSIM of the worst view."""
        return min(_known(self.values).values(), default=math.nan)

    @property
    def worst_view(self) -> str | None:
        """Name of the worst view by MSSIM, the first of equals; None if none has a value."""
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
        dB over the pixels of the layer; NaN without pixels, +inf if they are identical.
    counts : ndarray of int64, (layers,)
        Number of view pixels in each layer.
    outside : int
        Number of view pixels nearer or farther than all layers; they are left out. It is 0 for estimated depth, which
        is that of a layer or missing. With the default layers only depths at or behind the pixel array are outside.
    source : str
        Source of depth: ``given``, or ``focus`` with the method, as in ``focus (dissertation)``.
    layer : ndarray of int64, (L', K)
        Layer of each pixel of the virtual camera's view, −1 without a layer. L' is L without the rows of lenses that
        the camera does not see.
    error : ndarray of float64, (L', K)
        RMS error over R, G and B of each of these pixels, relative to the peak.
    missing : int
        Number of view pixels without a depth: no hit, or equal costs in all layers.
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
        """Return the error at the pixels of one layer, NaN at all others, (L', K)."""
        if not 0 <= layer < self.values.size:
            raise ValueError(f"layer is {layer}: 0 to {self.values.size - 1} are needed")
        return np.where(self.layer == layer, self.error, np.nan)

    @property
    def outside_share(self) -> float:
        """``outside`` over the number of view pixels with a depth; NaN without any."""
        hit = self.outside + int(self.counts.sum())
        return self.outside / hit if hit else float("nan")

    @property
    def min(self) -> float:
        """PSNR of the worst layer with pixels; NaN without any."""
        return float(np.min(self._held)) if self._held.size else float("nan")

    @property
    def mean(self) -> float:
        """Arithmetic mean over layers with pixels; +inf if one of them is identical, NaN without any."""
        return float(np.mean(self._held)) if self._held.size else float("nan")

    @property
    def max(self) -> float:
        """PSNR of the best layer with pixels; NaN without any."""
        return float(np.max(self._held)) if self._held.size else float("nan")

    @property
    def _held(self) -> NDArray[np.float64]:
        return self.values[self.counts > 0]


def told_outside(share: float) -> str:
    """Return a sentence with the share of view pixels outside all layers."""
    return "no view pixel has a depth" if np.isnan(share) else f"{share:.1%} of view pixels outside all layers"
