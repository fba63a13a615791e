"""Direct light of lamps: unshadowed radiance, shadow rays, and the unblocked share."""

from __future__ import annotations

import math

import numpy as np

from ii_core.base.jit import lean_kernel as kernel
from ii_core.base.jit import stage_kernel

from . import lanes as at
from .lanes import BLOCK, slot
from .tables import (
    CONE_AXIS,
    CONE_OFFSET,
    CONE_SCALE,
    DIRECTIONAL,
    FAR,
    LEAST_WEIGHT,
    LIGHT_COLOUR,
    SPOT,
    WEAK_SHADOW,
)  # fmt: skip
from .vectors import three

_TO_LAMP, _ONE = np.float32(0.9999), np.uint64(1)  # how far a shadow ray reaches towards a lamp, in its own lengths


@stage_kernel
def towards_light(lights, light, single, double):
    """Directions to one light, cosines to it, 0 where it is behind the surface, and of the half-way vectors."""
    far = lights[light, 0] == DIRECTIONAL
    sx, sy, sz = lights[light, 1], lights[light, 2], lights[light, 3]
    if far:
        for k in range(BLOCK):
            double[at.LX + k], double[at.LY + k], double[at.LZ + k], double[at.HALF + k] = -sx, -sy, -sz, 1.0
    else:
        for k in range(BLOCK):
            lx, ly, lz = sx - double[at.OX + k], sy - double[at.OY + k], sz - double[at.OZ + k]
            double[at.LX + k], double[at.LY + k], double[at.LZ + k] = lx, ly, lz
            double[at.HALF + k] = 1.0 / math.sqrt(lx * lx + ly * ly + lz * lz)
    for k in range(BLOCK):
        lx, ly, lz, norm = double[at.LX + k], double[at.LY + k], double[at.LZ + k], double[at.HALF + k]
        nx, ny, nz = three(double, at.NX, k)
        cosine = (nx * lx + ny * ly + nz * lz) * norm
        above = double[at.GX + k] * lx + double[at.GY + k] * ly + double[at.GZ + k] * lz > 0.0
        lit = (
            (cosine > 0.0)
            & (above | (double[at.SMOOTH + k] > 0.0))
            & ((double[at.SCATTERED + k] > 0.0) | (double[at.GLOSS + k] > 0.0))
        )
        double[at.COSINE + k] = cosine if lit else 0.0
        hx, hy, hz = lx * norm - single[at.DX + k], ly * norm - single[at.DY + k], lz * norm - single[at.DZ + k]
        half, square = nx * hx + ny * hy + nz * hz, hx * hx + hy * hy + hz * hz
        # too weak to see, as nearly everywhere: told without a power
        seen = (half > 0.0) & (half * half > double[at.HALF_FROM + k] ** 2 * square) & (double[at.GLOSS + k] > 0.0)
        double[at.HALF + k] = half / math.sqrt(square if square > 0.0 else 1.0) if seen else 0.0
        double[at.CONE + k] = norm


@stage_kernel
def in_cone(lights, light, double):
    """Share of a spot light in each direction: 1 in its inner cone, 0 outside the outer one; of other lights 1."""
    spot = lights[light, 0] == SPOT
    ax, ay, az = lights[light, CONE_AXIS], lights[light, CONE_AXIS + 1], lights[light, CONE_AXIS + 2]
    for k in range(BLOCK):
        cosine = -(double[at.LX + k] * ax + double[at.LY + k] * ay + double[at.LZ + k] * az) * double[at.CONE + k]
        share = min(max(cosine * lights[light, CONE_SCALE] + lights[light, CONE_OFFSET], 0.0), 1.0)
        double[at.CONE + k] = share * share if spot else 1.0


@stage_kernel
def cast(lanes, lights, light, rays, shadows, first, work, counts):
    """Write the shadow rays of a block to one light, from row ``first`` on; none too weak to be seen.

    Returns
    -------
    int
        How many there are.
    """
    double, whole = work.double, work.whole
    far = lights[light, 0] == DIRECTIONAL
    for k in range(lanes):
        if double[at.HALF + k] > 0.0 and double[at.COSINE + k] > 0.0:
            double[at.SHINE + k] = double[at.GLOSS + k] * double[at.HALF + k] ** double[at.EXPONENT + k]
        else:
            double[at.SHINE + k] = 0.0
    l0, l1, l2 = lights[light, LIGHT_COLOUR], lights[light, LIGHT_COLOUR + 1], lights[light, LIGHT_COLOUR + 2]
    for k in range(BLOCK):
        cosine, shine, cone = double[at.COSINE + k], double[at.SHINE + k], double[at.CONE + k]
        c0 = (double[at.R0 + k] * cosine + double[at.W0 + k] * shine) * cone * l0
        c1 = (double[at.R1 + k] * cosine + double[at.W1 + k] * shine) * cone * l1
        c2 = (double[at.R2 + k] * cosine + double[at.W2 + k] * shine) * cone * l2
        double[at.C0 + k], double[at.C1 + k], double[at.C2 + k] = c0, c1, c2
        double[at.STRONGEST + k] = max(c0, max(c1, c2))
    if not far:
        for k in range(3 * BLOCK):
            double[at.LX + k] -= double[at.AX + k]
    reach = FAR if far else _TO_LAMP
    row = np.uint64(first)
    for k in range(lanes):
        if double[at.COSINE + k] == 0.0:
            continue
        if double[at.STRONGEST + k] < LEAST_WEIGHT:
            counts[WEAK_SHADOW] += 1
            continue
        i = np.uint64(whole[at.ROW + k])
        for c in range(3):
            shadows.origins[row, c] = double[slot(at.OX + c * BLOCK, k)] + double[slot(at.AX + c * BLOCK, k)]
            shadows.directions[row, c] = double[slot(at.LX + c * BLOCK, k)]
            shadows.colours[row, c] = double[slot(at.C0 + c * BLOCK, k)]
        shadows.reach[row] = reach
        shadows.pixels[row] = rays.pixels[i]
        for j in range(rays.inside.shape[1]):
            shadows.inside[row, j] = rays.inside[i, j]
        row += _ONE
    return np.int64(row) - first


@kernel
def add_unblocked(blocked, colours, pixels, radiance):
    """Add the light of every shadow ray that arrived."""
    for i in range(blocked.shape[0]):
        if blocked[i] != 0:
            pixel = np.uint64(pixels[i])
            for c in range(3):
                radiance[pixel, c] += colours[i, c]


@kernel
def keep_unblocked(blocked, origins, directions, reach, colours, pixels, inside):
    """Pack the shadow rays that nothing opaque stops to the front.

    Returns
    -------
    int
        How many there are.
    """
    kept = 0
    for i in range(blocked.shape[0]):
        if blocked[i] != 0:
            for c in range(3):
                origins[kept, c], directions[kept, c] = origins[i, c], directions[i, c]
                colours[kept, c] = colours[i, c]
            reach[kept], pixels[kept] = reach[i], pixels[i]
            for j in range(inside.shape[1]):
                inside[kept, j] = inside[i, j]
            kept += 1
    return kept
