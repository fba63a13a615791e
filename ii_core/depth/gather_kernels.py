"""Kernels that gather views: shift and add, and rays looked up by depth."""

from __future__ import annotations

import numpy as np

from ..base.jit import lean_kernel, stage_kernel
from .disparity_kernels import _cubic


@stage_kernel
def _pixel(image, c, y, x):
    """Return the cubic interpolation of channel ``c`` at (y, x) inside the image; the border is continued."""
    height, width = image.shape[:2]
    j, i = int(y), int(x)
    a0, a1, a2, a3 = _cubic(np.float32(y - j))
    b0, b1, b2, b3 = _cubic(np.float32(x - i))
    i0, i2, i3 = max(i - 1, 0), min(i + 1, width - 1), min(i + 2, width - 1)
    j0, j2, j3 = max(j - 1, 0), min(j + 1, height - 1), min(j + 2, height - 1)
    return (
        a0 * (b0 * image[j0, i0, c] + b1 * image[j0, i, c] + b2 * image[j0, i2, c] + b3 * image[j0, i3, c])
        + a1 * (b0 * image[j, i0, c] + b1 * image[j, i, c] + b2 * image[j, i2, c] + b3 * image[j, i3, c])
        + a2 * (b0 * image[j2, i0, c] + b1 * image[j2, i, c] + b2 * image[j2, i2, c] + b3 * image[j2, i3, c])
        + a3 * (b0 * image[j3, i0, c] + b1 * image[j3, i, c] + b2 * image[j3, i2, c] + b3 * image[j3, i3, c])
    )


@lean_kernel
def add_view(image, own, down, across, weight, limit, disparity, total, mass, first, last):
    """Add a view, moved by its step times the disparity of each pixel, to ``total``, and its weight to ``mass``.

    Where its colour differs from ``own`` by much more than ``limit`` the weight is less; infinite: never.
    """
    height, width = disparity.shape
    for y in range(first, last):
        for x in range(width):
            sy, sx = y - disparity[y, x] * down, x - disparity[y, x] * across
            if not (0 <= sy <= height - 1 and 0 <= sx <= width - 1):
                continue
            r, g, b = _pixel(image, 0, sy, sx), _pixel(image, 1, sy, sx), _pixel(image, 2, sy, sx)
            w = weight
            if limit < np.inf:
                e = (r - own[y, x, 0]) ** 2 + (g - own[y, x, 1]) ** 2 + (b - own[y, x, 2]) ** 2
                w /= (1.0 + e / (limit * limit)) ** 2
            total[y, x, 0] += w * r
            total[y, x, 1] += w * g
            total[y, x, 2] += w * b
            mass[y, x] += w
