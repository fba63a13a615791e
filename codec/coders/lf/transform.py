"""Whole-number cosine transforms of 4 to 32 samples a side.

The rows of a matrix are those of the orthonormal DCT-II in units of 2^-10. Every product and sum fits 32 bits for
differences of pictures; of damaged streams the sums wrap, the same way everywhere.
"""

from __future__ import annotations

import numpy as np

from .jit import lean

LARGEST = 32
_SIZES = 6  # by their binary logarithm


def _matrices():
    found = np.zeros((_SIZES, LARGEST, LARGEST), np.int32)
    for log in range(2, _SIZES):
        n = 1 << log
        k, i = np.mgrid[:n, :n]
        rows = np.sqrt(2 / n) * np.cos(np.pi * (2 * i + 1) * k / (2 * n))
        rows[0] /= np.sqrt(2)
        found[log, :n, :n] = np.rint(1024 * rows)
    return found


def _scans():
    """Places y·32 + x by rising y + x, up and down in turn."""
    found = np.zeros((_SIZES, LARGEST * LARGEST), np.int32)
    for log in range(2, _SIZES):
        n = 1 << log
        places = sorted((y + x, y if (x + y) % 2 else x, y * LARGEST + x) for y in range(n) for x in range(n))
        found[log, : n * n] = [place for _, _, place in places]
    return found


MATRICES = _matrices()
TRANSPOSED = np.ascontiguousarray(MATRICES.swapaxes(1, 2))
SCANS = _scans()


@lean
def forward(block, log, half, out):
    """out[:n, :n] = the transform of block[:n, :n]; all (32, 32) of int32."""
    n = 1 << log
    for i in range(n):
        for j in range(n):
            half[i, j] = 0
        for k in range(n):
            m = MATRICES[log, i, k]
            for j in range(n):
                half[i, j] = np.int32(half[i, j] + np.int32(m * block[k, j]))
        for j in range(n):
            half[i, j] = np.int32(half[i, j] + 128) >> 8
    for i in range(n):
        for j in range(n):
            out[i, j] = 0
        for k in range(n):
            value = half[i, k]
            for j in range(n):
                out[i, j] = np.int32(out[i, j] + np.int32(value * TRANSPOSED[log, k, j]))
        for j in range(n):
            out[i, j] = np.int32(out[i, j] + 2048) >> 12


@lean
def inverse(coefficients, log, rows, cols, half, out):
    """out[:n, :n] = the inverse transform of coefficients that are zero but for the first rows and columns."""
    n = 1 << log
    for i in range(rows):
        for j in range(n):
            half[i, j] = 0
        for k in range(cols):
            value = coefficients[i, k]
            for j in range(n):
                half[i, j] = np.int32(half[i, j] + np.int32(value * MATRICES[log, k, j]))
        for j in range(n):
            half[i, j] = np.int32(half[i, j] + 32) >> 6
    for i in range(n):
        for j in range(n):
            out[i, j] = 0
        for k in range(rows):
            m = MATRICES[log, k, i]
            for j in range(n):
                out[i, j] = np.int32(out[i, j] + np.int32(m * half[k, j]))
        for j in range(n):
            out[i, j] = np.int32(out[i, j] + 8192) >> 14
