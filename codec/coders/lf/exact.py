"""Lossless coding: the error of the decoded view, sample by sample.

A sample is predicted by the view that the blocks give, corrected by a linear filter of what that view missed at
samples before: left, above, and in the colours coded already. The filter's weights follow the error (normalised
least mean squares). Colours are coded in the order green, red, blue. All is done in whole numbers.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ii_core.base.jit import array_kernel, lean_kernel, part_kernel
from ii_core.base.references import by_reference

from . import contexts as at
from .arithmetic import DECODING, code_bit, code_number, code_raw

ORDER = (1, 0, 2)
FEATURES = 15
UNARY = 12  # steps of a magnitude that have contexts of their own
CLASSES = 16
LEARNING = 8  # weights move by 2^-LEARNING of the least mean squares' full step
MOST_WEIGHT = 1 << 20
MOST_MISSED = 1 << 20


@by_reference
class Exact(NamedTuple):
    """State of the lossless coding of a view.

    Parameters
    ----------
    pixels : ndarray of uint8 or uint16, (H, W, 3)
    guess : ndarray of int32, (3, H, W)
        The view that the blocks give, by order of coding, in eighths of a code.
    missed : ndarray of int32, (3, H + 2, W + 4)
        Pixels less guess, in eighths of a code; two more rows above, two more columns on either side.
    weights : ndarray of int64, (3, FEATURES)
        Of the filters, in 2^-16. They go on from view to view.
    """

    pixels: Any
    guess: Any
    missed: Any
    weights: Any


def new_exact(height: int, width: int, dtype: Any) -> Exact:
    """Memory for one view after another. The filters begin with half of what the colour before missed."""
    weights = np.zeros((3, FEATURES), np.int64)
    weights[1:, 9] = 1 << 15
    return Exact(
        pixels=np.zeros((height, width, 3), dtype),
        guess=np.zeros((3, height, width), np.int32),
        missed=np.zeros((3, height + 2, width + 4), np.int32),
        weights=weights,
    )


@lean_kernel
def prepare(exact, views, view, axes, sixteen):
    """exact.guess = a decoded view in the picture's colours; exact.missed = 0."""
    height, width = exact.pixels.shape[:2]
    middle, shift, top = (1 << 15, 6, 65535) if sixteen else (1 << 7, 14, 255)
    for i in range(3):
        for y in range(height + 2):
            for x in range(width + 4):
                exact.missed[i, y, x] = 0
        for y in range(height):
            for x in range(width):
                total = np.int64(1 << (shift - 1))
                for p in range(3):
                    total += np.int64(axes[p, ORDER[i]]) * np.int64(views[view, p, y, x])
                exact.guess[i, y, x] = min(max((total >> shift) + 8 * middle, 0), 8 * top)


@part_kernel
def _features(missed, i, y, x, found):
    """Gather earlier errors; y and x count from the border of ``missed``. Return the sum of their magnitudes."""
    found[0], found[1] = missed[i, y, x - 1], missed[i, y - 1, x]
    found[2], found[3] = missed[i, y - 1, x - 1], missed[i, y - 1, x + 1]
    found[4], found[5] = missed[i, y, x - 2], missed[i, y - 2, x]
    found[6], found[7], found[8] = np.int64(0), np.int64(0), np.int64(0)
    found[9], found[10], found[11] = np.int64(0), np.int64(0), np.int64(0)
    found[12], found[13], found[14] = np.int64(0), np.int64(0), np.int64(0)
    if i > 0:
        found[9], found[10], found[11] = missed[i - 1, y, x], missed[i - 1, y, x - 1], missed[i - 1, y - 1, x]
        found[6], found[7] = missed[i - 1, y, x + 1], missed[i - 1, y - 1, x + 1]
    if i > 1:
        found[12], found[13], found[14] = missed[0, y, x], missed[0, y, x - 1], missed[0, y - 1, x]
        found[8] = missed[0, y, x + 1]


@part_kernel
def _code_magnitude(coder, first, size, scale):
    """A prefix of ones, each in its context, and ``scale`` bits of even odds; a long prefix ends in a number."""
    head = size >> scale
    found: Any = np.int64(0)
    while found < UNARY and code_bit(coder, first + found, 1 if head > found else 0):
        found += 1
    if found == UNARY:
        found += code_number(coder, np.int64(at.EXACT_REST), np.int64(16), np.int64(0), head - UNARY)
    for place in range(scale - 1, -1, -1):
        found = 2 * found + code_raw(coder, (size >> place) & 1)
    return found


@array_kernel
def code_exact(coder, exact):
    """Write the pixels of a view, or read them."""
    height, width = exact.pixels.shape[:2]
    top = 65535 if exact.pixels.itemsize == 2 else 255
    features = np.zeros(FEATURES, np.int64)
    missed = exact.missed
    for y in range(height):
        for x in range(width):
            for i in range(3):
                channel = ORDER[i]
                _features(missed, i, y + 2, x + 2, features)
                total, energy = np.int64(0), np.int64(0)
                for k in range(FEATURES):
                    total += exact.weights[i, k] * features[k]
                    energy += features[k] * features[k]
                correction: Any = min(max(total >> 16, -MOST_MISSED), MOST_MISSED)
                expected = np.int64(exact.guess[i, y, x]) + correction
                rounded: Any = min(max((expected + 4) >> 3, 0), top)
                # Left, above and their neighbours say how large an error is to be expected.
                activity = np.int64(0)
                for k in range(6):
                    activity += abs(features[k]) * (2 if k < 2 else 1)
                activity += 2 * (abs(features[9] - features[10]) + abs(features[9] - features[11])) if i else 0
                level: Any = np.int64(0)
                while level < 2 * CLASSES + 14 and activity >> 1 > (3 + (level & 1)) << (level >> 1):
                    level += 1
                scale = (level - CLASSES) >> 1 if level > CLASSES else np.int64(0)
                first = at.EXACT + (i * CLASSES + min(level, CLASSES - 1)) * (UNARY + 4)
                difference = np.int64(exact.pixels[y, x, channel]) - rounded
                zero = code_bit(coder, first, 1 if difference == 0 else 0)
                if zero:
                    difference = np.int64(0)
                else:
                    fraction = (expected + 4 - 8 * rounded) >> 1
                    side = first + 1 + (2 if fraction > 2 else (1 if fraction > 0 else 0))
                    negative = code_bit(coder, side, 1 if difference < 0 else 0)
                    size = 1 + _code_magnitude(coder, first + 4, abs(difference) - 1, scale)
                    difference = -size if negative else size
                if coder.state[DECODING]:
                    exact.pixels[y, x, channel] = min(max(rounded + difference, 0), top)
                value = 8 * np.int64(exact.pixels[y, x, channel]) - np.int64(exact.guess[i, y, x])
                missed[i, y + 2, x + 2] = value
                error = value - correction
                for k in range(FEATURES):
                    moved = (error * features[k] << (16 - LEARNING)) // (energy + 64)
                    weight = exact.weights[i, k] + moved
                    exact.weights[i, k] = min(max(weight, -MOST_WEIGHT), MOST_WEIGHT)
