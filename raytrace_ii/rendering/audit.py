"""Audit of a picture: a seeded share of its pixels is rendered again in full, and the differences are measured."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core.base.colour import srgb

WRONG_CODES = 2  # 8-bit codes; a pixel with a larger difference in a channel is wrong
FULL_SAMPLES = 256
FULL_DEPTH = 12


@dataclass(frozen=True)
class Audit:
    """Measured differences between audited pixels and the same pixels in full, in codes of 8 bits.

    They are a sample of the picture's differences and no bound of them.

    Parameters
    ----------
    pixels : int
        Number of audited pixels.
    wrong : int
        Pixels with a difference of more than 2 codes in a channel.
    worst : float
        Largest difference.
    squares : float
        Sum of squared differences over pixels and channels.
    """

    pixels: int = 0
    wrong: int = 0
    worst: float = 0.0
    squares: float = 0.0

    def __add__(self, other: Audit) -> Audit:
        return Audit(
            self.pixels + other.pixels, self.wrong + other.wrong, max(self.worst, other.worst),
            self.squares + other.squares,
        )  # fmt: skip

    @property
    def psnr_db(self) -> float:
        """PSNR over the audited pixels; infinite without a difference, NaN without pixels."""
        if not self.pixels:
            return math.nan
        return 10 * math.log10(3 * self.pixels * 255**2 / self.squares) if self.squares else math.inf

    @property
    def about(self) -> str:
        """Result in one line."""
        if not self.pixels:
            return "no pixel audited: a larger share is needed"
        return (
            f"measured at {self.pixels} pixels: {self.wrong} wrong by more than {WRONG_CODES} codes, "
            f"{self.psnr_db:.1f} dB, worst {self.worst:.1f} codes"
        )


def chosen(seed: int, share: float, columns: int, rows: slice, cols: slice) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return columns and rows of the audited pixels of a tile; those of a picture do not depend on its tiles."""
    n, m = np.mgrid[rows, cols]
    pixels = (n * columns + m).astype(np.uint64)
    picked = _hash(_hash(pixels) ^ np.uint64(seed)) * 2.0**-64 < share
    return m[picked], n[picked]


def compared(pixels: NDArray[Any], full: NDArray[Any]) -> Audit:
    """Return the differences of pixels (n, 3) of any type of picture."""
    off = np.abs(codes(pixels) - codes(full))
    wrong = int((off > WRONG_CODES).any(axis=1).sum())
    return Audit(len(off), wrong, float(off.max(initial=0.0)), float((off**2).sum()))


def codes(pixels: NDArray[Any]) -> NDArray[np.float64]:
    """Return pixels in codes of 8-bit sRGB, not rounded."""
    if pixels.dtype.kind == "f":
        return np.asarray(255 * srgb(pixels.astype(np.float64).clip(0, 1)))
    return pixels * (255 / np.iinfo(pixels.dtype).max)


def _hash(x: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """splitmix64 (Steele, Lea, Flood 2014), with another start than that of samples."""
    x = x + np.uint64(0x6A09E667F3BCC909)
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))
