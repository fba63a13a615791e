"""Glossy reflection by a GGX surface: keys of places in its lobe, sampled directions and the highlight.

A key of a pixel or lobe, a hash of 64 bits, holds a place in [0, 1)², two fractions of 2³².
"""

from __future__ import annotations

import math

import numpy as np

from ii_core.base.jit import lean_kernel as kernel
from ii_core.base.jit import part_kernel, stage_kernel

# numba makes 64 bits of a sum of two 32-bit numbers: fractions of 32 bits stand in 64-bit words, cut by `LOW`.
LOW = np.uint64(0xFFFFFFFF)
# 1/g and 1/g² of g³ = g + 1 as fractions of 2³² (Roberts 2018).
R2_ACROSS, R2_AROUND = np.uint64(3242174889), np.uint64(2447445414)


@stage_kernel
def mix_bits(h):
    """splitmix64's finaliser (Steele, Lea, Flood 2014)."""
    h = h + np.uint64(0x9E3779B97F4A7C15)
    h = (h ^ (h >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    h = (h ^ (h >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return h ^ (h >> np.uint64(31))


@kernel
def lobe_keys(seed, m, n, columns, first, count, out):
    """Keys of places in [0, 1)² in the lobes of rough mirrors, as rows of ``out``: samples of pixels (m, n).

    Each 32 bits are a fraction. The samples of a pixel follow the R2 sequence (Roberts 2018), which spreads any
    number of places evenly, from a start by a hash of seed and pixel.
    """
    for i in range(m.shape[0]):
        pixel = np.uint64(n[i]) * np.uint64(columns) + np.uint64(m[i])
        own = mix_bits(mix_bits(np.uint64(seed) ^ mix_bits(pixel)) + np.uint64(2))
        for j in range(count):
            step = np.uint64(first + j)
            across = ((own & LOW) + step * R2_ACROSS) & LOW
            around = ((own >> np.uint64(32)) + step * R2_AROUND) & LOW
            out[i * count + j] = (around << np.uint64(32)) | across


@part_kernel
def glossy_direction(alpha, across, around, dx, dy, dz, nx, ny, nz):
    """Reflect a direction at a facet of a GGX surface, one of those seen from there, and how much of it gets away.

    Facets are sampled in proportion to their visible area by spherical caps (Dupuy and Benyoub 2023); the share is
    G2/G1 of Smith's height-correlated shadowing (Heitz 2014), 0 for a direction into the surface. Its mean is the
    single-scattering albedo.

    Parameters
    ----------
    alpha : float
        GGX's width, above 0: the square of the roughness.
    across, around : float
        A place in [0, 1)².
    """
    cosine = -(dx * nx + dy * ny + dz * nz)
    # the surface's frame: z its normal, x away from which the ray comes
    tx, ty, tz = -dx - cosine * nx, -dy - cosine * ny, -dz - cosine * nz
    sine = math.sqrt(tx * tx + ty * ty + tz * tz)
    if sine < 1e-6:
        if abs(nx) < 0.8:
            tx, ty, tz = 1.0 - nx * nx, -nx * ny, -nx * nz
        else:
            tx, ty, tz = -ny * nx, 1.0 - ny * ny, -ny * nz
        length = math.sqrt(tx * tx + ty * ty + tz * tz)
        sine = 0.0
    else:
        length = sine
    tx, ty, tz = tx / length, ty / length, tz / length
    bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
    # stretched to a sphere: a cap of it, shifted, holds the facets that are seen
    vx, vz = alpha * sine, cosine
    length = math.sqrt(vx * vx + vz * vz)
    vx, vz = vx / length, vz / length
    hz = (1.0 - across) * (1.0 + vz) - vz
    radius = math.sqrt(max(1.0 - hz * hz, 0.0))
    angle = 2.0 * math.pi * around
    hx, hy, hz = alpha * (radius * math.cos(angle) + vx), alpha * radius * math.sin(angle), hz + vz
    length = math.sqrt(hx * hx + hy * hy + hz * hz)
    hx, hy, hz = hx / length, hy / length, hz / length
    twice = 2.0 * (sine * hx + cosine * hz)
    rx, ry, rz = twice * hx - sine, twice * hy, twice * hz - cosine
    if rz <= 0.0:
        return nx, ny, nz, 0.0
    seen = _smith(alpha, cosine)
    share = (1.0 + seen) / (1.0 + seen + _smith(alpha, rz))
    return rx * tx + ry * bx + rz * nx, rx * ty + ry * by + rz * ny, rx * tz + ry * bz + rz * nz, share


@stage_kernel
def _smith(alpha, cosine):
    """Smith's Λ of a GGX surface."""
    return 0.5 * (math.sqrt(1.0 + alpha * alpha * (1.0 / (cosine * cosine) - 1.0)) - 1.0)


@kernel
def highlight(f0, roughness):
    """Strength and exponent of the Blinn–Phong highlight of a microfacet surface.

    Its width is that of a lobe of α = roughness² (Karis 2013), its strength normalised D/4 seen head on, at most 1.
    """
    shininess = max(2.0 / max(roughness, 0.05) ** 4 - 2.0, 1.0)
    return min(f0 * (1.0 - roughness) * (shininess + 2.0) / 8.0, 1.0), shininess
