"""Structural similarity with a Gaussian window, where the whole window fits."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

WINDOW, SIGMA = 11, 1.5  # pixels
C1, C2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2  # for values of 0…255

Floats = NDArray[np.float64]
_taps = np.exp(-0.5 * ((np.arange(WINDOW) - WINDOW // 2) / SIGMA) ** 2)
WEIGHTS = _taps / _taps.sum()


def ssim_terms(a: NDArray[Any], b: NDArray[Any]) -> tuple[Floats, Floats]:
    """Return the luminance term and the contrast–structure term of SSIM; their product is SSIM.

    Parameters
    ----------
    a, b : ndarray, (H, W)
        Values on a scale of 0…255; at least `WINDOW` rows and columns.

    Returns
    -------
    luminance, contrast : ndarray, (H − 10, W − 10)

    References
    ----------
    Wang et al. 2004, with the weights and without the sample covariance, as their program.
    """
    ma, mb = _mean(a), _mean(b)
    va, vb, both = _mean(a * a) - ma * ma, _mean(b * b) - mb * mb, _mean(a * b) - ma * mb
    return (2 * ma * mb + C1) / (ma * ma + mb * mb + C1), (2 * both + C2) / (va + vb + C2)


def _mean(x: NDArray[Any]) -> Floats:
    """Return the weighted mean of every whole window."""
    rows, cols = (size - WINDOW + 1 for size in x.shape)
    down = sum(weight * x[i : i + rows] for i, weight in enumerate(WEIGHTS))
    return np.asarray(sum(weight * down[:, i : i + cols] for i, weight in enumerate(WEIGHTS)))
