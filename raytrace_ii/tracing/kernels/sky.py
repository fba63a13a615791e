"""Background colour of rays without a hit."""

from __future__ import annotations

import math

import numpy as np

from ii_core.jit import inline_kernel, part_kernel

from .tables import SKY_IMAGE, SKY_INTENSITY, SKY_TURN
from .textures import filtered


@part_kernel
def background_colour(background, dy):
    """Colour of the sky for a unit direction with the upward component ``dy``."""
    t = min(abs(dy) * background[9], 1.0)
    pole = 3 if dy > 0.0 else 6
    return (
        background[0] + t * (background[pole] - background[0]),
        background[1] + t * (background[pole + 1] - background[1]),
        background[2] + t * (background[pole + 2] - background[2]),
    )


@inline_kernel
def sky_colour(background, textures, texels, dx, dy, dz, spread):
    """Colour of the surroundings for a unit direction: of the equirectangular image, or of the gradient."""
    if background[SKY_IMAGE] >= 0.0:
        return _sky_image(background, textures, texels, dx, dy, dz, spread)
    return background_colour(background, dy)


@part_kernel
def _sky_image(background, textures, texels, dx, dy, dz, spread):
    row = int(background[SKY_IMAGE])
    half = 0.5 / textures[row, 3]  # of a texel: the top row does not run into the bottom one
    u = 0.5 + math.atan2(np.float64(dx), np.float64(dz)) / (2.0 * math.pi) - background[SKY_TURN]
    v = 0.5 + math.asin(min(max(np.float64(dy), -1.0), 1.0)) / math.pi
    v = min(max(v, half), 1.0 - half)
    across = spread / (2.0 * math.pi * max(math.sqrt(dx * dx + dz * dz), spread, 1e-9))
    r, g, b = filtered(textures, row, texels, u, v, across, 0.0, 0.0, spread / math.pi)
    return background[SKY_INTENSITY] * r, background[SKY_INTENSITY] * g, background[SKY_INTENSITY] * b
