"""Columns of the tables that all kernels read, kinds of rows, and limits of light."""

from __future__ import annotations

import numpy as np

# A weight this small cannot move a colour by half a step of 8 bits, not even on sRGB's steep foot, of light up to 1.
LEAST_WEIGHT = 0.5 / 255 / 12.92
FAR = np.float32(1e30)  # how far a shadow ray to a directional light reaches, in its own lengths
# What is counted.
(
    REFLECTION, REFRACTION, WEAK_SHADOW, WEAK_REFLECTION, WEAK_REFRACTION, PASSED, SHADOW, SHADOW_PACKETS, UNTESTED,
    EMBREE_TICKS, TICKS, COUNTS,
) = range(12)  # fmt: skip
IMAGE, CHECKER, NOISE, VERTEX, STRIPES = 0, 1, 2, 3, 4  # kinds of texture
REPEAT, MIRROR, CLAMP = 0, 1, 2  # how an image goes on beyond its border
POINT, DIRECTIONAL, SPOT = 0, 1, 2  # kinds of light

# Columns of the table of faces, float32: corners, unit normal and lift, body; then, unless all are flat and without
# textures, normals of the corners and their (u, v), whose third coordinates stand where room is left.
CORNERS, FACE, BODY, FLAT_COLUMNS, NORMALS, COORDINATES, ALL_COLUMNS = 0, 9, 13, 16, 16, 25, 32
THIRD = [14, 15, 31]
# Columns of the table of materials, a row a body; colours have three. The first `LANED` are brought to lanes as they
# stand, see lanes.py.
COLOUR, MIRROR_SHARE, EMISSION, LOCAL, SPECULAR, SHININESS, LEAST_HALF = 0, 3, 6, 9, 10, 11, 12
ROUGHNESS, METALLIC, EXTRAS, LANED = 13, 14, 15, 16
TRANSMISSION, ABSORPTION, IOR, PRIORITY, TEXTURE, CUTOFF, NORMAL_MAP, NORMAL_SCALE = 16, 19, 22, 25, 26, 27, 28, 29
GLOSS_MAP, EMISSION_MAP, ALPHA_BLEND, IMAGES = 30, 31, 32, 33
MATERIAL_COLUMNS = 34
# Of the table of lights: kind, place or direction, then
LIGHT_COLOUR, CONE_AXIS, CONE_SCALE, CONE_OFFSET = 4, 7, 10, 11
# Of the background: colours of horizon, zenith and nadir, the gradient's steepness, then
SKY_IMAGE, SKY_TURN, SKY_INTENSITY = 10, 11, 12
# Of the table of textures, besides what each kind has: how many coarser levels of an image follow it.
LEVELS, IMAGE_COLUMNS = 8, 16
