"""Whole-number cosine and sine transforms of 4 to 32 samples a side.

The rows of a matrix are those of the orthonormal DCT-II or DST-VII in units of 2^-10. A kind of transform is the sum
of `SINE_DOWN` and `SINE_ACROSS`, or 0: cosines both ways. Every product and sum fits 32 bits for differences of
pictures; of damaged streams the sums wrap, the same way everywhere.
"""

from __future__ import annotations

import numpy as np

from ii_core.base.jit import part_kernel, stage_kernel

LARGEST = 32
_SIZES = 6  # by their binary logarithm
SINE_DOWN, SINE_ACROSS = 1, 2


def _matrices():
    found = np.zeros((2, _SIZES, LARGEST, LARGEST), np.int32)
    for log in range(2, _SIZES):
        n = 1 << log
        k, i = np.mgrid[:n, :n]
        rows = np.sqrt(2 / n) * np.cos(np.pi * (2 * i + 1) * k / (2 * n))
        rows[0] /= np.sqrt(2)
        found[0, log, :n, :n] = np.rint(1024 * rows)
        sines = 2 / np.sqrt(2 * n + 1) * np.sin(np.pi * (2 * k + 1) * (i + 1) / (2 * n + 1))
        found[1, log, :n, :n] = np.rint(1024 * sines)
    return found


def _scans():
    """Places y·32 + x by rising y + x, up and down in turn."""
    found = np.zeros((_SIZES, _SIZES, LARGEST * LARGEST), np.uint16)
    for down in range(2, _SIZES):
        for across in range(2, _SIZES):
            y, x = (places.ravel() for places in np.mgrid[: 1 << down, : 1 << across])
            order = np.lexsort((np.where((x + y) % 2, y, x), x + y))
            found[down, across, : y.size] = (y * LARGEST + x)[order]
    return found


MATRICES = _matrices()
TRANSPOSED = np.ascontiguousarray(MATRICES.swapaxes(2, 3))
SCANS = _scans()


@stage_kernel
def sides(shape):
    """Height and width of a block of a shape: their binary logarithms."""
    return 1 << shape[0], 1 << shape[1]


@stage_kernel
def size_of(shape):
    """Binary logarithm of the side of a square of the same area, rounded down: the class of size of contexts."""
    return (shape[0] + shape[1]) >> 1


@stage_kernel
def _product(left, right, rows, terms, n, rounding, shift, out):
    """out[:rows, :n] = left[:rows, :terms] · right[:terms, :n] / 2^shift, rounded."""
    for i in range(rows):
        weights, into = left[i], out[i]
        if n == 4:  # sums of a short row stay in registers
            a = b = c = d = np.int32(rounding)
            for k in range(terms):
                weight, row = weights[k], right[k]
                a, b = np.int32(a + np.int32(weight * row[0])), np.int32(b + np.int32(weight * row[1]))
                c, d = np.int32(c + np.int32(weight * row[2])), np.int32(d + np.int32(weight * row[3]))
            into[0], into[1], into[2], into[3] = a >> shift, b >> shift, c >> shift, d >> shift
        else:
            for j in range(n):
                into[j] = rounding
            for k in range(terms):
                weight, row = weights[k], right[k]
                for j in range(n):
                    into[j] = np.int32(into[j] + np.int32(weight * row[j]))
            for j in range(n):
                into[j] = into[j] >> shift


@part_kernel
def forward(block, shape, half, out, kind):
    """out[:h, :w] = the transform of block[:h, :w]; all (32, 32) of int32."""
    h, w = sides(shape)
    _product(MATRICES[kind & SINE_DOWN, shape[0]], block, h, h, w, 128, 8, half)
    _product(half, TRANSPOSED[kind >> 1, shape[1]], h, w, w, 2048, 12, out)


@part_kernel
def inverse(coefficients, shape, rows, cols, half, out, kind):
    """out[:h, :w] = the inverse transform of coefficients that are zero but for the first rows and columns."""
    h, w = sides(shape)
    _product(coefficients, MATRICES[kind >> 1, shape[1]], rows, cols, w, 32, 6, half)
    _product(TRANSPOSED[kind & SINE_DOWN, shape[0]], half, h, rows, w, 8192, 14, out)
