"""Direct light of lamps: unshadowed radiance, shadow rays, and the unblocked share."""

from __future__ import annotations

import math

import numpy as np

from ii_core.base.jit import lane_stage as stage_kernel
from ii_core.base.jit import lean_kernel as kernel

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
    SHADOW,
    SPOT,
    WEAK_SHADOW,
)  # fmt: skip
from .vectors import three

_TO_LAMP = np.float32(0.9999)  # how far a shadow ray reaches towards a lamp, in its own lengths
_ZERO, _ONE, _LEAST = np.float32(0), np.float32(1), np.float32(LEAST_WEIGHT)


@stage_kernel
def towards_light(lights, light, single):
    """Directions to one light, cosines to it, 0 where it is behind the surface, and of the half-way vectors."""
    far = lights[light, 0] == DIRECTIONAL
    sx, sy, sz = np.float32(lights[light, 1]), np.float32(lights[light, 2]), np.float32(lights[light, 3])
    if far:
        for k in range(BLOCK):
            single[at.LX + k], single[at.LY + k], single[at.LZ + k], single[at.CONE + k] = -sx, -sy, -sz, _ONE
    else:
        for k in range(BLOCK):
            lx, ly, lz = sx - single[at.OX + k], sy - single[at.OY + k], sz - single[at.OZ + k]
            single[at.LX + k], single[at.LY + k], single[at.LZ + k] = lx, ly, lz
            single[at.CONE + k] = _ONE / math.sqrt(lx * lx + ly * ly + lz * lz)
    for k in range(BLOCK):
        lx, ly, lz, norm = single[at.LX + k], single[at.LY + k], single[at.LZ + k], single[at.CONE + k]
        nx, ny, nz = three(single, at.NX, k)
        cosine = (nx * lx + ny * ly + nz * lz) * norm
        above = single[at.GX + k] * lx + single[at.GY + k] * ly + single[at.GZ + k] * lz > _ZERO
        lit = (
            (cosine > _ZERO)
            & (above | (single[at.SMOOTH + k] > _ZERO))
            & ((single[at.SCATTERED + k] > _ZERO) | (single[at.GLOSS + k] > _ZERO))
            & (single[at.HIT + k] > _ZERO)
        )
        single[at.COSINE + k] = cosine if lit else _ZERO
        hx, hy, hz = lx * norm - single[at.DX + k], ly * norm - single[at.DY + k], lz * norm - single[at.DZ + k]
        half, square, least = nx * hx + ny * hy + nz * hz, hx * hx + hy * hy + hz * hz, single[at.HALF_FROM + k]
        # too weak to see, as nearly everywhere: told without a power
        seen = lit & (half > _ZERO) & (half * half > least * least * square) & (single[at.GLOSS + k] > _ZERO)
        single[at.HALF + k] = half / math.sqrt(square if square > _ZERO else _ONE) if seen else _ZERO


@stage_kernel
def in_cone(lights, light, single):
    """Share of a spot light in each direction: 1 in its inner cone, 0 outside the outer one; of other lights 1."""
    if lights[light, 0] != SPOT:
        for k in range(BLOCK):
            single[at.CONE + k] = _ONE
        return
    ax, ay, az = lights[light, CONE_AXIS], lights[light, CONE_AXIS + 1], lights[light, CONE_AXIS + 2]
    for k in range(BLOCK):
        cosine = -(single[at.LX + k] * ax + single[at.LY + k] * ay + single[at.LZ + k] * az) * single[at.CONE + k]
        share = min(max(cosine * lights[light, CONE_SCALE] + lights[light, CONE_OFFSET], 0.0), 1.0)
        single[at.CONE + k] = share * share


@stage_kernel
def weigh(lights, light, single, counts):
    """Light that the shadow rays to one light would let through, none too weak to be seen.

    Returns
    -------
    int
        How many shadow rays there are.
    """
    shining = 0
    for k in range(BLOCK):
        single[at.SHINE + k] = _ZERO
        shining += single[at.HALF + k] > _ZERO
    if shining > 0:
        for k in range(BLOCK):
            if single[at.HALF + k] > _ZERO:
                single[at.SHINE + k] = single[at.GLOSS + k] * single[at.HALF + k] ** single[at.EXPONENT + k]
    l0, l1, l2 = (
        np.float32(lights[light, LIGHT_COLOUR]), np.float32(lights[light, LIGHT_COLOUR + 1]),
        np.float32(lights[light, LIGHT_COLOUR + 2]),
    )  # fmt: skip
    wanted, weak = 0, 0
    for k in range(BLOCK):
        cosine, shine, cone = single[at.COSINE + k], single[at.SHINE + k], single[at.CONE + k]
        c0 = (single[at.R0 + k] * cosine + single[at.W0 + k] * shine) * cone * l0
        c1 = (single[at.R1 + k] * cosine + single[at.W1 + k] * shine) * cone * l1
        c2 = (single[at.R2 + k] * cosine + single[at.W2 + k] * shine) * cone * l2
        single[at.C0 + k], single[at.C1 + k], single[at.C2 + k] = c0, c1, c2
        faces, seen = cosine > _ZERO, max(c0, max(c1, c2)) >= _LEAST
        single[at.WANTED + k] = _ONE if faces & seen else _ZERO
        wanted += faces & seen
        weak += faces & (not seen)
    counts[SHADOW] += wanted
    counts[WEAK_SHADOW] += weak
    return wanted


@stage_kernel
def lift_rays(lights, light, single):
    """Start shadow rays on the smooth surface: at (OX …) + (AX …), to a lamp by so much less; and end them there."""
    far = lights[light, 0] == DIRECTIONAL
    share, reach = _ZERO if far else _ONE, FAR if far else _TO_LAMP
    for k in range(3 * BLOCK):
        single[at.LX + k] -= share * single[at.AX + k]
    for k in range(BLOCK):
        single[at.REACH + k] = reach


@stage_kernel
def keep_rays(lanes, first, rays, shadows, row, single):
    """Write the shadow rays of a packet from row ``row`` on, for those that follow them through clear bodies.

    Returns
    -------
    int
        How many there are.
    """
    start = row
    for k in range(lanes):
        if single[at.WANTED + k] == _ZERO:
            continue
        i, to = np.uint64(first + k), np.uint64(row)
        for c in range(3):
            shadows.origins[to, c] = single[slot(at.OX + c * BLOCK, k)] + single[slot(at.AX + c * BLOCK, k)]
            shadows.directions[to, c] = single[slot(at.LX + c * BLOCK, k)]
            shadows.colours[to, c] = single[slot(at.C0 + c * BLOCK, k)]
        shadows.reach[to] = single[slot(at.REACH, k)]
        shadows.pixels[to] = rays.pixels[i]
        for j in range(rays.inside.shape[1]):
            shadows.inside[to, j] = rays.inside[i, j]
        row += 1
    return row - start


@stage_kernel
def set_aside(first, lanes, rays, single):
    """Keep a copy of ``WANTED``, from which those shadow rays go that start within a body."""
    for k in range(BLOCK):
        single[at.LEFT + k] = single[at.WANTED + k]
    if rays.inside.shape[1] > 0:
        for k in range(lanes):
            within = rays.inside[np.uint64(first + k), 0] >= 0
            single[at.WANTED + k] = _ZERO if within else single[at.WANTED + k]


@stage_kernel
def take_left(single):
    """Want those shadow rays that were set aside and are not done."""
    for k in range(BLOCK):
        single[at.WANTED + k] = single[at.LEFT + k] - single[at.WANTED + k]


@stage_kernel
def add_free(single):
    """Add the light of one light that arrives."""
    for k in range(BLOCK):
        free = single[at.WANTED + k] > _ZERO
        single[at.L0 + k] += single[at.C0 + k] if free else _ZERO
        single[at.L1 + k] += single[at.C1 + k] if free else _ZERO
        single[at.L2 + k] += single[at.C2 + k] if free else _ZERO


@kernel
def add_unblocked(blocked, colours, pixels, radiance):
    """Add the light of every shadow ray that arrived."""
    for i in range(blocked.shape[0]):
        if blocked[i] != 0:
            pixel = np.uint64(pixels[i])
            for c in range(3):
                radiance[pixel, c] += colours[i, c]


@stage_kernel
def move(rays, i, to):
    """Move a shadow ray to another row."""
    for c in range(3):
        rays.origins[to, c], rays.directions[to, c] = rays.origins[i, c], rays.directions[i, c]
        rays.colours[to, c] = rays.colours[i, c]
    rays.reach[to], rays.pixels[to] = rays.reach[i], rays.pixels[i]
    for j in range(rays.inside.shape[1]):
        rays.inside[to, j] = rays.inside[i, j]


@kernel
def keep_unblocked(blocked, rays):
    """Pack the shadow rays that nothing opaque stops to the front; return how many there are."""
    kept = 0
    for i in range(blocked.shape[0]):
        if blocked[i] != 0:
            move(rays, i, kept)
            kept += 1
    return kept
