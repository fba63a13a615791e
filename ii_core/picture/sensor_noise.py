"""Sensor noise: monochromatic, normal, reproducible for any division into blocks of rows."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base import checks
from ..base.jit import kernel
from ..base.parallel import over_rows
from .picture import IIPicture, peak


@checks.checked(picture=checks.instance(IIPicture), sigma=checks.number, seed=checks.whole)
def add_sensor_noise(picture: IIPicture, sigma: float = 1.0, seed: int = 0) -> IIPicture:
    """Return the picture with monochromatic sensor noise: one N(0, σ) sample per pixel, added to R, G and B.

    Parameters
    ----------
    sigma : float
        Standard deviation in 8-bit code values, for every pixel type.
    seed : int
        Equal seeds give equal noise.

    References
    ----------
    Olsson 2008, §5.7.1.
    """
    if not 0 <= sigma < np.inf:
        raise ValueError(f"noise sigma is {sigma}: at least 0 is needed")
    if seed < 0:
        raise ValueError(f"seed is {seed}: at least 0 is needed")
    source = picture.pixels
    if sigma == 0:
        return picture
    noisy = np.empty_like(source)

    def fill(first: int, last: int) -> None:
        noisy[first:last] = noisy_rows(source[first:last], first, sigma, seed)

    over_rows(fill, source.shape[0], step=NOISE_ROWS)
    return picture.with_pixels(noisy)


def noisy_rows(rows: NDArray[Any], top: int, sigma: float, seed: int) -> NDArray[Any]:
    """Return rows from ``top``, a multiple of `NOISE_ROWS`, with their sensor noise."""
    noisy = np.empty_like(rows)
    top_code = peak(rows.dtype)
    for i in range(0, len(rows), NOISE_ROWS):
        block = rows[i : i + NOISE_ROWS]
        sample = np.random.default_rng((seed, top + i)).standard_normal(block.shape[:2], dtype=np.float32)
        sample *= np.float32(sigma * top_code / 255)
        if rows.dtype.kind == "f":
            np.add(block, sample[..., None], out=noisy[i : i + NOISE_ROWS])
        else:
            add_code_noise(block, sample, top_code, noisy[i : i + NOISE_ROWS])
    return noisy


NOISE_ROWS = 64  # rows of one generator: the noise does not depend on the number of threads


@kernel
def add_code_noise(source, noise, peak, out):
    """Add rounded noise to R, G and B alike, clipped to [0, peak]."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            step = np.rint(noise[i, j])
            for c in range(3):
                out[i, j, c] = min(max(source[i, j, c] + step, 0.0), peak)
