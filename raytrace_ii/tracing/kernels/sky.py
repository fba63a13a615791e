"""Background colour of rays without a hit."""

from __future__ import annotations

import math

import numpy as np

from ii_core.base.jit import lane_stage, late_kernel, part_kernel

from . import lanes as at
from .addresses import value_at
from .lanes import BLOCK
from .tables import SKY_IMAGE, SKY_INTENSITY, SKY_TURN
from .textures import filtered

_ZERO, _ONE = np.float32(0), np.float32(1)


@lane_stage
def add_background(background, single):
    """Add the colour of the sky to all lanes without a hit."""
    for c in range(3):
        horizon, zenith, nadir = np.float32(background[c]), np.float32(background[3 + c]), np.float32(background[6 + c])
        for k in range(BLOCK):
            dy = single[at.DY + k]
            t = min(abs(dy) * np.float32(background[9]), _ONE)
            light = horizon + t * ((zenith if dy > _ZERO else nadir) - horizon)
            missed = single[at.HIT + k] == _ZERO
            single[at.L0 + c * BLOCK + k] += single[at.W0 + c * BLOCK + k] * light if missed else _ZERO


@late_kernel
def add_sky_image(generation, first, lanes, _):
    """Add the light of an equirectangular image around the scene to all lanes without a hit."""
    g = value_at(generation)
    single = g.work.single
    for k in range(lanes):
        if single[at.HIT + k] == _ZERO:
            dx, dy, dz = float(single[at.DX + k]), float(single[at.DY + k]), float(single[at.DZ + k])
            red, green, blue = _sky_image(g.surroundings.background, g.surfaces, dx, dy, dz, g.passage.spread)
            single[at.L0 + k] += single[at.W0 + k] * red
            single[at.L1 + k] += single[at.W1 + k] * green
            single[at.L2 + k] += single[at.W2 + k] * blue


@part_kernel
def _sky_image(background, surfaces, dx, dy, dz, spread):
    """Colour for a unit direction."""
    textures, texels, row = surfaces.textures, surfaces.texels, int(background[SKY_IMAGE])
    half = 0.5 / textures[row, 3]  # of a texel: the top row does not run into the bottom one
    u = 0.5 + math.atan2(np.float64(dx), np.float64(dz)) / (2.0 * math.pi) - background[SKY_TURN]
    v = 0.5 + math.asin(min(max(np.float64(dy), -1.0), 1.0)) / math.pi
    v = min(max(v, half), 1.0 - half)
    across = spread / (2.0 * math.pi * max(math.sqrt(dx * dx + dz * dz), spread, 1e-9))
    r, g, b = filtered(textures, row, texels, u, v, across, 0.0, 0.0, spread / math.pi)
    return background[SKY_INTENSITY] * r, background[SKY_INTENSITY] * g, background[SKY_INTENSITY] * b
