"""Background colour of rays without a hit."""

from __future__ import annotations

import math

import numpy as np

from ii_core.base.jit import lane_stage, late_lane_kernel

from . import lanes as at
from .addresses import value_at
from .images import read_images
from .lanes import BLOCK
from .tables import SKY_IMAGE, SKY_INTENSITY, SKY_TURN
from .vectors import three_doubles

_ZERO, _ONE = np.float32(0), np.float32(1)


@lane_stage
def add_background(background, single):
    """Add the colour of the sky to all lanes without a hit."""
    for c in range(3):
        horizon, steep = np.float32(background[c]), np.float32(background[9])
        zenith, nadir = np.float32(background[3 + c]), np.float32(background[6 + c])
        for k in range(BLOCK):
            dy = single[at.DY + k]
            light = horizon + min(abs(dy) * steep, _ONE) * ((zenith if dy > _ZERO else nadir) - horizon)
            missed = single[at.HIT + k] == _ZERO
            single[at.L0 + c * BLOCK + k] += single[at.W0 + c * BLOCK + k] * light if missed else _ZERO


@late_lane_kernel
def add_sky_image(generation, first, lanes, _):
    """Add the light of an equirectangular image around the scene to all lanes without a hit."""
    g = value_at(generation)
    background, textures, single, double, whole = (
        g.surroundings.background, g.surfaces.textures, g.work.single, g.work.double, g.work.whole,
    )  # fmt: skip
    row, strength, spread = int(background[SKY_IMAGE]), np.float32(background[SKY_INTENSITY]), g.passage.spread
    half = 0.5 / textures[row, 3]  # of a texel: the top row does not run into the bottom one
    for k in range(BLOCK):
        whole[at.IMAGE + k] = row if k < lanes and single[at.HIT + k] == _ZERO else -1
        dx, dy, dz = three_doubles(single, at.DX, k)
        double[at.SU + k] = 0.5 + math.atan2(dx, dz) / (2.0 * math.pi) - background[SKY_TURN]
        v = 0.5 + math.asin(min(max(dy, -1.0), 1.0)) / math.pi
        double[at.SV + k] = min(max(v, half), 1.0 - half)
        across = spread / (2.0 * math.pi * max(math.sqrt(dx * dx + dz * dz), spread, 1e-9))
        single[at.AU + k], single[at.AV + k], single[at.BU + k] = across, 0.0, 0.0
        single[at.BV + k] = spread / math.pi
    read_images(g.surfaces, g.work)
    for k in range(3 * BLOCK):
        missed = single[at.HIT + k % BLOCK] == _ZERO
        single[at.L0 + k] += single[at.W0 + k] * strength * single[at.Q0 + k] if missed else _ZERO
