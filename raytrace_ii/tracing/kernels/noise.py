"""Gradient noise, and terrain made of it."""

from __future__ import annotations

import math

import numpy as np

from ii_core.base.jit import inner_kernel, stage_kernel
from ii_core.base.jit import lean_kernel as kernel

from . import lanes as at

# Odd multipliers of the noise lattice's hash.
_PX, _PY, _PZ, _SEED, _GOLDEN = 73856093, 19349663, 83492791, 2654435761, np.uint64(0x1E3779B97F4A7C15)
_TOP = np.uint64(60)  # four bits are left


@inner_kernel
def gradient_noise(x, y, z, seed):
    """Perlin's improved gradient noise (2002) with hashed lattice gradients; about −1…1, 0 on the lattice."""
    fx, fy, fz = math.floor(x), math.floor(y), math.floor(z)
    x, y, z = x - fx, y - fy, z - fz
    u, v, w = _fade(x), _fade(y), _fade(z)
    i0, j0, k0 = np.int64(fx) * _PX + seed * _SEED, np.int64(fy) * _PY, np.int64(fz) * _PZ
    i1, j1, k1 = i0 + _PX, j0 + _PY, k0 + _PZ
    near = _lerp(
        v,
        _lerp(u, _slope(i0 ^ j0 ^ k0, x, y, z), _slope(i1 ^ j0 ^ k0, x - 1, y, z)),
        _lerp(u, _slope(i0 ^ j1 ^ k0, x, y - 1, z), _slope(i1 ^ j1 ^ k0, x - 1, y - 1, z)),
    )
    far = _lerp(
        v,
        _lerp(u, _slope(i0 ^ j0 ^ k1, x, y, z - 1), _slope(i1 ^ j0 ^ k1, x - 1, y, z - 1)),
        _lerp(u, _slope(i0 ^ j1 ^ k1, x, y - 1, z - 1), _slope(i1 ^ j1 ^ k1, x - 1, y - 1, z - 1)),
    )
    return _lerp(w, near, far)


@stage_kernel
def vectors(lanes):
    """So many lanes, up to whole vectors of eight."""
    return (lanes + 7) // 8 * 8


@stage_kernel
def fractal_lanes(many, whole, double):
    """Sums of octaves of gradient noise, each of half the size and strength, for many places: to ``TOTAL``.

    An octave of all in turn, in vectors.
    """
    most = 0
    for k in range(many):
        most = max(most, whole[at.OCTAVES + k])
    lanes = vectors(many)
    for k in range(lanes):
        double[at.TOTAL + k] = 0.0
        double[at.STRENGTH + k] = 1.0 if whole[at.OCTAVES + k] > 0 else 0.0
    for octave in range(most):
        for k in range(lanes):
            x, y, z, strength = double[at.SX + k], double[at.SY + k], double[at.SZ + k], double[at.STRENGTH + k]
            double[at.TOTAL + k] += strength * gradient_noise(x, y, z, whole[at.SEED + k] + octave)
            double[at.SX + k], double[at.SY + k], double[at.SZ + k] = 2.03 * x, 2.03 * y, 2.03 * z
            double[at.STRENGTH + k] = 0.5 * strength if octave + 1 < whole[at.OCTAVES + k] else 0.0


@kernel
def terrain(x, z, seed, octaves, rough, ridged, out):
    """Heights of a fractal surface over points (m, n), about −1…1, or 0…1 if folded into ridges (Musgrave 1998).

    Ridges are rough only where they are high already: valleys stay smooth.
    """
    for i in range(x.shape[0]):
        for j in range(x.shape[1]):
            total, strength, most, weight, scale = 0.0, 1.0, 0.0, 1.0, 1.0
            for octave in range(octaves):
                # between the lattice's planes: on one of them noise is 0 at every corner
                n = gradient_noise(x[i, j] * scale, 0.37 + octave, z[i, j] * scale, seed + octave)
                if ridged:
                    n = (1.0 - abs(n)) ** 2 * weight
                    weight = min(max(1.6 * n, 0.0), 1.0)
                    most += strength
                total += strength * n
                strength *= rough
                scale *= 2.03
            out[i, j] = total / most if ridged else total


@stage_kernel
def _fade(t):
    return t * t * t * (t * (t * 6 - 15) + 10)


@stage_kernel
def _lerp(t, a, b):
    return a + t * (b - a)


@stage_kernel
def _slope(cell, x, y, z):
    """Dot product with one of Perlin's sixteen gradients, chosen by a multiplicative hash.

    They point to the twelve edges of a cube, four of them twice: two coordinates with signs, picked without a branch
    or a table, which loops over many places would have to gather.
    """
    h = np.int64((np.uint64(cell) * _GOLDEN) >> _TOP)  # unsigned: numba takes it that signed products do not overflow
    late = h >= 14
    one, two = h & 1, h & 2
    first = y if ((h >= 8) & (h < 12)) | late else x
    second = y if (h < 4) | ((h >= 12) & (h < 14)) else z
    first = -first if (two if late else one) != 0 else first
    second = -second if (one if late else two) != 0 else second
    return first + second
