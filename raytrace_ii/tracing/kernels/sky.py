"""Background colour of rays without a hit."""

from __future__ import annotations

import math

import numpy as np

from ii_core.base.jit import late_kernel, part_kernel

from .addresses import value_at
from .lanes import BLOCK
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


@late_kernel
def add_sky_image(generation, first, lanes, _):
    """Add the light of an equirectangular image around the scene, of all rays of a block that miss."""
    g = value_at(generation)
    rays, radiance = g.rays, g.radiance
    for i in range(first, min(first + BLOCK, g.hits.faces.shape[0])):
        if g.hits.faces[i] < 0:
            dx, dy, dz = float(rays.directions[i, 0]), float(rays.directions[i, 1]), float(rays.directions[i, 2])
            red, green, blue = _sky_image(g.surroundings.background, g.surfaces, dx, dy, dz, g.passage.spread)
            pixel = rays.pixels[i]
            radiance[pixel, 0] += float(rays.weights[i, 0]) * red
            radiance[pixel, 1] += float(rays.weights[i, 1]) * green
            radiance[pixel, 2] += float(rays.weights[i, 2]) * blue


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
