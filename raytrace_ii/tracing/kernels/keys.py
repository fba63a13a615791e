"""Keys of pixels and lobes: hash of 64 bits and steps of the R2 sequence.

A key holds a place in [0, 1)², two fractions of 2³². The kernels that make keys and those that read them must agree.
"""

from __future__ import annotations

import numpy as np

from ii_core.base.jit import inline_kernel

# numba makes 64 bits of a sum of two 32-bit numbers: fractions of 32 bits stand in 64-bit words, cut by `LOW`.
LOW = np.uint64(0xFFFFFFFF)
# 1/g and 1/g² of g³ = g + 1 as fractions of 2³² (Roberts 2018).
R2_ACROSS, R2_AROUND = np.uint64(3242174889), np.uint64(2447445414)


@inline_kernel
def mix_bits(h):
    """splitmix64's finaliser (Steele, Lea, Flood 2014)."""
    h = h + np.uint64(0x9E3779B97F4A7C15)
    h = (h ^ (h >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    h = (h ^ (h >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return h ^ (h >> np.uint64(31))
