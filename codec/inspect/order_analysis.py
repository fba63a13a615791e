"""Correlation and residual energy of consecutive frames, for orders of component images.

A frame PVS_j is the vector of all its R, G and B values. Sums run over the picture line by line, without a copy. The
sum of a pair of component images is computed once for all orders in which the two are consecutive.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core import IIPicture
from ii_core.base.jit import kernel
from ii_core.picture.component import KINDS

from ..checks import check_type, texts
from ..frames import layout
from ..order import ORDERS, selection_order

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class OrderAnalysis:
    """Consecutive frames of one kind of component image in one order.

    Parameters
    ----------
    kind, order : str
    samples : int
        R, G and B values in a frame, 3·S·T.
    correlation : ndarray, (J − 1,)
        c_j (5.3); NaN if one of the frames is constant.
    residual : ndarray, (J − 1,)
        e_j, the Frobenius norm of the difference to the frame before (5.7), in the picture's code values.
    """

    kind: str
    order: str
    samples: int
    correlation: Floats = field(repr=False)
    residual: Floats = field(repr=False)

    @property
    def undefined(self) -> int:
        """Number of c_j that are NaN."""
        return int(np.isnan(self.correlation).sum())

    @property
    def mean(self) -> float:
        """Mean of the c_j that are not NaN (5.4); NaN without any."""
        defined = self.correlation[~np.isnan(self.correlation)]
        return float(defined.mean()) if defined.size else np.nan

    @property
    def sigma(self) -> float:
        """Sample standard deviation of c_j (5.5); NaN for fewer than two."""
        defined = self.correlation[~np.isnan(self.correlation)]
        return float(defined.std(ddof=1)) if defined.size > 1 else np.nan

    @property
    def energy(self) -> float:
        """e, the mean of e_j² (5.6); NaN for a single frame."""
        return float((self.residual**2).mean()) if self.residual.size else np.nan

    def to_json(self) -> dict[str, Any]:
        """Return the numbers as plain values; ``energy_per_sample`` is e/(3·S·T), comparable over sizes of frames."""
        return {
            "kind": self.kind,
            "order": self.order,
            "frames": len(self.residual) + 1,
            "samples": self.samples,
            "correlation_mean": self.mean,
            "correlation_sigma": self.sigma,
            "undefined": self.undefined,
            "energy": self.energy,
            "energy_per_sample": self.energy / self.samples,
        }


def analyse_orders(
    picture: IIPicture, *, kinds: Sequence[str] = KINDS, orders: Sequence[str] = tuple(ORDERS)
) -> list[OrderAnalysis]:
    """Compute correlation and residual energy of consecutive frames, for kinds of component images and orders.

    Parameters
    ----------
    picture : IIPicture
        Of regular structure and any pixel type.
    kinds : sequence of {"ei", "si", "ri"}
    orders : sequence of str
        See `codec.order.selection_order`.

    Raises
    ------
    TypeError
        If an argument is of the wrong type.
    ValueError
        If a kind or an order is unknown, or the structure is not regular.

    References
    ----------
    Olsson 2008, (5.3)–(5.7), §5.5.2.
    """
    check_type("picture", picture, IIPicture, "an IIPicture")
    kinds, orders = texts("kinds", kinds), texts("orders", orders)
    picture.check_regular()
    flat = np.ascontiguousarray(picture.pixels).reshape(-1, 3)
    middle = float(np.rint(np.mean(picture.pixels[:: max(1, picture.size[1] // 64)], dtype=np.float64)))
    found = []
    for kind in kinds:
        shape = layout(picture.lenses, picture.ei_pixels, kind)
        permutations = {order: selection_order(order, shape.rows, shape.cols) for order in orders}
        row, col = np.divmod(np.arange(shape.frames), shape.cols)
        origins = row * shape.step_row + col * shape.step_col
        # Sums of a and a², minimum and maximum of every frame; sums of a·b of every pair. `middle` is subtracted
        # first: this avoids cancellation for bright frames that differ little.
        frames = np.zeros((shape.frames, 4))
        frames[:, 2], frames[:, 3] = np.inf, -np.inf
        steps = shape.step_y, shape.step_x, shape.height, shape.width
        frame_sums(flat, origins, *steps, middle, frames)
        keys = {order: _pair_keys(p) for order, p in permutations.items()}
        pairs = np.unique(np.concatenate([*keys.values(), np.empty(0, np.int64)]))
        a, b = np.divmod(pairs, shape.frames)
        products = np.zeros(len(pairs))
        pair_sums(flat, origins[a], origins[b], *steps, middle, products)
        for order, key in keys.items():
            c, e = _statistics(frames, key, products[np.searchsorted(pairs, key)], 3 * shape.height * shape.width)
            samples = 3 * shape.height * shape.width
            found.append(OrderAnalysis(kind=kind, order=order, samples=samples, correlation=c, residual=e))
    return found


def _pair_keys(permutation: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return one number per pair of consecutive frames, independent of their order."""
    a, b = permutation[:-1], permutation[1:]
    return np.minimum(a, b) * len(permutation) + np.maximum(a, b)


def _statistics(frames: Floats, key: NDArray[np.int64], product: Floats, samples: int) -> tuple[Floats, Floats]:
    """Return c_j and e_j from the sums."""
    a, b = np.divmod(key, len(frames))
    spread = frames[:, 1] - frames[:, 0] ** 2 / samples  # Σ(a − mean)²
    spread[frames[:, 2] == frames[:, 3]] = np.nan
    covariance = product - frames[a, 0] * frames[b, 0] / samples
    with np.errstate(invalid="ignore"):
        c = np.clip(covariance / np.sqrt(spread[a] * spread[b]), -1, 1)
    return c, np.sqrt(np.maximum(frames[a, 1] + frames[b, 1] - 2 * product, 0))


# Kernels process a line of all frames before the next line: frames are interleaved, and a picture line stays in
# cache.
@kernel
def frame_sums(pixels, origins, step_y, step_x, height, width, middle, out):
    """out[j] = Σa, Σa², min, max of frame j over all three colours."""
    for y in range(height):
        for j in range(origins.size):
            p = origins[j] + y * step_y
            first, second, low, high = 0.0, 0.0, out[j, 2], out[j, 3]
            for _ in range(width):
                for c in range(3):
                    a = np.float64(pixels[p, c]) - middle
                    first += a
                    second += a * a
                    low = min(low, a)
                    high = max(high, a)
                p += step_x
            out[j, 0] += first
            out[j, 1] += second
            out[j, 2] = low
            out[j, 3] = high


@kernel
def pair_sums(pixels, origins_a, origins_b, step_y, step_x, height, width, middle, out):
    """out[i] = Σa·b of a pair of frames over all three colours."""
    for y in range(height):
        for i in range(origins_a.size):
            p, q = origins_a[i] + y * step_y, origins_b[i] + y * step_y
            total = 0.0
            for _ in range(width):
                for c in range(3):
                    total += (np.float64(pixels[p, c]) - middle) * (np.float64(pixels[q, c]) - middle)
                p += step_x
                q += step_x
            out[i] += total
