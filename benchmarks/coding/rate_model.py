"""Rate–distortion model of light fields after Ramanathan and Girod: Gaussian views of given spectrum and coherence.

Views are zero-mean Gaussian processes of the same power spectrum. Between two views m and n steps apart along rows
and columns of the grid, the coherence at a frequency is α·β^(m+n). The views' covariance at that frequency then has
closed eigenvalues, and a coder that transforms across views and within them reaches the rate of reverse water-filling
over eigenvalues and frequencies.

- β = 1 is the model of Ramanathan and Girod: disparity is compensated, and each view keeps a part 1 − α of its own
  (occlusion, noise, aliasing, disparity error).
- α = 1 is a Markov chain across the grid: views that move apart without compensation.

References
----------
Ramanathan and Girod, "Rate-distortion analysis for light field coding and streaming", Signal Processing: Image
Communication 21 (2006). Berger, "Rate distortion theory" (1971), section 4.5.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
PEAK = 255.0


def view_gains(alpha: ArrayLike, beta: ArrayLike, grid: tuple[int, int]) -> Array:
    """Return eigenvalues of the views' covariance in units of the spectrum of one view.

    Parameters
    ----------
    alpha, beta : array_like, (...)
        Coherence α·β^distance, both 0–1.
    grid : (int, int)
        Rows and columns of views.

    Returns
    -------
    ndarray, (..., rows · columns)
        Their mean is 1.
    """
    alpha, beta = np.broadcast_arrays(np.asarray(alpha, np.float64), np.asarray(beta, np.float64))
    rows, cols = (_chain(beta, count) for count in grid)
    shared = (rows[..., :, None] * cols[..., None, :]).reshape(*alpha.shape, -1)
    gains: Array = (1 - alpha)[..., None] + alpha[..., None] * shared
    return np.maximum(gains, 0)


def _chain(beta: Array, count: int) -> Array:
    """Eigenvalues of the matrix β^|i − j|."""
    place = np.arange(count)
    found: Array = np.linalg.eigvalsh(beta[..., None, None] ** np.abs(place[:, None] - place))
    return found


def jitter_coherence(sigma: float, frequency: ArrayLike) -> Array:
    """Return the coherence between a picture and its copy displaced by a Gaussian error.

    Parameters
    ----------
    sigma : float
        Standard deviation of the error, in samples.
    frequency : array_like
        In radians a sample, along the direction of the error.
    """
    found: Array = np.exp(-0.5 * (sigma * np.asarray(frequency, np.float64)) ** 2)
    return found


def fitted(near: ArrayLike, far: ArrayLike, steps: int) -> tuple[Array, Array]:
    """Return α and β of the coherence at one step and at more; β = 1 if it does not fall.

    Parameters
    ----------
    near, far : array_like
        Coherence, 0–1, at one step and at ``steps`` steps.
    steps : int
        2 or more.
    """
    near, far = np.asarray(near, np.float64), np.asarray(far, np.float64)
    ratio = np.divide(far, near, out=np.zeros_like(near), where=near > 0)
    beta = np.clip(ratio, 0, 1) ** (1 / (steps - 1))
    alpha = np.divide(near, beta, out=near.copy(), where=beta > 0)
    # A coherence of no more than α = 1 allows: the chain then explains all of the fall.
    return np.minimum(alpha, 1), np.where(alpha > 1, near, beta)


def rate_and_distortion(spectra: ArrayLike, weights: ArrayLike, theta: float) -> tuple[float, float]:
    """Bits and squared error a sample by reverse water-filling.

    Parameters
    ----------
    spectra : array_like, (...)
        Variances of independent Gaussian components.
    weights : array_like
        Share of each in a sample, of a shape that ``spectra`` broadcasts to; the sum over all is 1.
    theta : float
        The water level: squared error of the components that are coded.
    """
    spectra = np.asarray(spectra, np.float64)
    weights = np.broadcast_to(np.asarray(weights, np.float64), spectra.shape)
    bits = 0.5 * np.log2(np.maximum(spectra, theta) / theta)
    return float((weights * bits).sum()), float((weights * np.minimum(spectra, theta)).sum())


def rate_at(spectra: ArrayLike, weights: ArrayLike, psnr: float, planes: int = 3) -> float:
    """Bits a pixel at a PSNR in dB of 8-bit pixels of so many planes; ``weights`` have the sum ``planes``."""
    wanted = planes * PEAK**2 / 10 ** (psnr / 10)
    low, high = -40.0, 40.0  # binary logarithm of the water level
    for _ in range(60):
        middle = (low + high) / 2
        if rate_and_distortion(spectra, weights, 2**middle)[1] > wanted:
            high = middle
        else:
            low = middle
    return rate_and_distortion(spectra, weights, 2**low)[0]


def markov_spectrum(correlation: float, count: int) -> Array:
    """Power spectrum of a separable first-order process of unit variance at count × count frequencies."""
    place = 2 * np.pi * np.arange(count) / count
    line = (1 - correlation**2) / (1 - 2 * correlation * np.cos(place) + correlation**2)
    found: Array = line[:, None] * line
    return found


class CrossSpectra:
    """Power and cross spectra of windowed blocks, averaged over blocks of each class.

    Parameters
    ----------
    block : int
        Samples a side.
    """

    def __init__(self, block: int) -> None:
        self.block = block
        window = np.hanning(block + 1)[:-1]
        window = window[:, None] * window
        self.window = window / np.sqrt(np.mean(window**2))

    def blocks(self, planes: NDArray[Any]) -> NDArray[np.complex128]:
        """Return transforms (blocks, P, block, block) of half-overlapping blocks of planes (P, H, W)."""
        size, step = self.block, self.block // 2
        cut = np.lib.stride_tricks.sliding_window_view(planes, (size, size), axis=(1, 2))[:, ::step, ::step]
        cut = cut.reshape(len(planes), -1, size, size).swapaxes(0, 1)
        found: NDArray[np.complex128] = np.fft.fft2(cut * self.window) / size
        return found

    def coherence(self, one: NDArray[np.complex128], other: NDArray[np.complex128]) -> Array:
        """Return the magnitude of coherence (P, block, block) over the first axis of transforms."""
        cross = np.abs((one.conj() * other).mean(axis=0))
        powers = (np.abs(one) ** 2).mean(axis=0) * (np.abs(other) ** 2).mean(axis=0)
        found: Array = np.divide(cross, np.sqrt(powers), out=np.zeros_like(cross), where=powers > 0)
        return np.minimum(found, 1)

    def frequencies(self) -> Array:
        """Return angular frequencies of the transforms along one side, in radians a sample."""
        found: Array = 2 * np.pi * np.fft.fftfreq(self.block)
        return found
