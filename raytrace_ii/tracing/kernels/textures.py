"""Textures: patterns, and images read at a point or filtered over a footprint."""

from __future__ import annotations

import math

import numpy as np

from ii_core.base.colour import LINEAR
from ii_core.base.jit import inline_kernel, part_kernel, stage_kernel

from .tables import ALPHA_BLEND, CHECKER, CUTOFF, IMAGE, LEVELS, MIRROR, REPEAT, TEXTURE, VERTEX
from .texels import mixed
from .vectors import interpolate

MOST_TAPS = 8  # along the longer axis of a filtered ellipse
SHARPER = 0.5  # levels finer than the filter's width: bilinear reading of a level widens it again
_LINEAR = LINEAR.astype(np.float64)  # float32's values: a bilinear reading converts twelve of them else
_1, _2, _3, _4 = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(4)


@part_kernel
def pattern_colour(table, row, x, y, z):
    """Linear colour of a texture that is neither image nor noise at a texture coordinate."""
    kind = table[row, 0]
    if kind == VERTEX:
        return x, y, z
    if kind == CHECKER:
        # A face often lies just on a cell's border: decided here, not by rounding noise.
        odd = (
            math.floor(x * table[row, 1] + 1e-6)
            + math.floor(y * table[row, 2] + 1e-6)
            + math.floor(z * table[row, 3] + 1e-6)
        ) % 2
        t = 1.0 if odd else 0.0
    else:
        s = x * table[row, 1] + y * table[row, 2] + z * table[row, 3]
        if table[row, 10] > 0.0:
            away = abs(s - 2.0 * math.floor(0.5 * s) - 0.5)  # from the middle of a stripe of the first colour
            inner = 0.5 - abs(away - 1.0)  # how far inside the second colour, in widths
            t = min(max(0.5 + inner / table[row, 10], 0.0), 1.0)
        else:
            t = 1.0 if math.floor(s + 1e-6) % 2 else 0.0
    return _between(table, row, t)


@stage_kernel
def noise_colour(table, row, total):
    """Linear colour of a texture of noise from the sum of its octaves."""
    return _between(table, row, min(max(0.5 + table[row, 11] * total, 0.0), 1.0))


@inline_kernel
def _between(table, row, t):
    return (
        table[row, 4] + t * (table[row, 7] - table[row, 4]),
        table[row, 5] + t * (table[row, 8] - table[row, 5]),
        table[row, 6] + t * (table[row, 9] - table[row, 6]),
    )


@stage_kernel
def _image(level, wraps, texels, x, y):
    """Colour of an image's level at a place folded into the image, bilinear."""
    a, b, c, d, fx, fy = _texels_at(level, wraps, x, y)
    w00, w10, w01, w11 = (1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy
    pixels, codes = texels
    if level[3]:
        a, b, c, d = a * _4, b * _4, c * _4, d * _4
        k, m, n, o = codes[a], codes[b], codes[c], codes[d]
        red = w00 * _LINEAR[k] + w10 * _LINEAR[m] + w01 * _LINEAR[n] + w11 * _LINEAR[o]
        k, m, n, o = codes[a + _1], codes[b + _1], codes[c + _1], codes[d + _1]
        green = w00 * _LINEAR[k] + w10 * _LINEAR[m] + w01 * _LINEAR[n] + w11 * _LINEAR[o]
        k, m, n, o = codes[a + _2], codes[b + _2], codes[c + _2], codes[d + _2]
        blue = w00 * _LINEAR[k] + w10 * _LINEAR[m] + w01 * _LINEAR[n] + w11 * _LINEAR[o]
    else:
        red, green, blue = mixed(pixels, (a * _3, b * _3, c * _3, d * _3), (w00, w10, w01, w11))
    return red, green, blue


@stage_kernel
def footprint(ax, ay, az, bx, by, bz, u1, v1, u2, v2, width, dx, dy, dz, gx, gy, gz):
    """How far a ray's cross-section of some width reaches over (u, v): across the plane of incidence, and in it.

    A disc across the ray is an ellipse on the face (Heckbert 1986), longer by 1/cos in the plane of incidence. a and
    b are two edges of the face, along which (u, v) grows by (u1, v1) and (u2, v2); d is the ray's direction and g the
    face's normal. Without a branch, for vectors.
    """
    mx, my, mz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    square = mx * mx + my * my + mz * mz
    px, py, pz = gy * dz - gz * dy, gz * dx - gx * dz, gx * dy - gy * dx
    sine = math.sqrt(px * px + py * py + pz * pz)
    straight = sine < 1e-6
    edge = math.sqrt(ax * ax + ay * ay + az * az)
    px, py, pz = ax if straight else px, ay if straight else py, az if straight else pz
    sine = edge if straight else sine
    sine = sine if sine > 0.0 else 1.0
    px, py, pz = px / sine, py / sine, pz / sine
    qx, qy, qz = gy * pz - gz * py, gz * px - gx * pz, gx * py - gy * px
    longer = width / max(abs(dx * gx + dy * gy + dz * gz), 1e-3)
    area = square if square > 0.0 else 1.0
    width, longer = width if square > 0.0 else 0.0, longer if square > 0.0 else 0.0
    # of a vector p in the face: p = i·a + j·b, i = (p × b)·m/m², j = (a × p)·m/m²
    i = ((py * bz - pz * by) * mx + (pz * bx - px * bz) * my + (px * by - py * bx) * mz) * width / area
    j = ((ay * pz - az * py) * mx + (az * px - ax * pz) * my + (ax * py - ay * px) * mz) * width / area
    k = ((qy * bz - qz * by) * mx + (qz * bx - qx * bz) * my + (qx * by - qy * bx) * mz) * longer / area
    l = ((ay * qz - az * qy) * mx + (az * qx - ax * qz) * my + (ax * qy - ay * qx) * mz) * longer / area
    return i * u1 + j * u2, i * v1 + j * v2, k * u1 + l * u2, k * v1 + l * v2


@part_kernel
def filter_taps(table, row, au, av, bu, bv):
    """Number of taps, level of each, and the way over (u, v) that they lie along: the longer of two diameters.

    The level fits the shorter diameter, or the distance of the taps where there would be too many.
    """
    width, height = table[row, 2], table[row, 3]
    a, b = (au * width) ** 2 + (av * height) ** 2, (bu * width) ** 2 + (bv * height) ** 2
    if max(a, b) <= 1.0:
        return 1, 0.0, bu, bv
    a, b = math.sqrt(a), math.sqrt(b)
    if a > b:
        a, b, bu, bv = b, a, au, av
    taps = int(min(max(math.ceil(b / max(a, 1.0)), 1.0), MOST_TAPS))
    level = math.log2(max(a, b / taps, 1.0)) - SHARPER
    return taps, min(max(level, 0.0), table[row, LEVELS]), bu, bv


@inline_kernel
def _levels(table, row, level):
    """The levels above and below, and how far it is to the second; the first twice where it is none."""
    near = int(level)
    part = level - near
    return _level(table, row + near), _level(table, row + near + (1 if part > 0.0 else 0)), part


@inline_kernel
def _level(table, row):
    """A level's first texel, width, height, and whether it is of codes."""
    return int(table[row, 1]), int(table[row, 2]), int(table[row, 3]), table[row, 5] != 0.0


@inline_kernel
def _wraps(table, row):
    """How an image and its levels go on across and down."""
    return int(table[row, 6]), int(table[row, 7])


@part_kernel
def filtered(table, row, texels, u, v, au, av, bu, bv):
    """Colour of an image over an ellipse about (u, v) of two diameters: means of its pyramid (Williams 1983)."""
    taps, level, bu, bv = filter_taps(table, row, au, av, bu, bv)
    near, far, part = _levels(table, row, level)
    wraps = _wraps(table, row)
    red, green, blue = 0.0, 0.0, 0.0
    for tap in range(taps):
        s = (tap + 0.5) / taps - 0.5
        x, y = _folded(u + s * bu, wraps[0]), 1.0 - _folded(v + s * bv, wraps[1])
        r, g, b = _image(near, wraps, texels, x, y)
        if part > 0.0:
            r1, g1, b1 = _image(far, wraps, texels, x, y)
            r, g, b = r + part * (r1 - r), g + part * (g1 - g), b + part * (b1 - b)
        red, green, blue = red + r, green + g, blue + b
    return red / taps, green / taps, blue / taps


@stage_kernel
def _texels_at(level, wraps, x, y):
    """The four texels about a place folded into the image, from its upper left corner in widths and heights.

    Left and right above, left and right below, and how far it is to right and down.
    """
    first, width, height, _ = level
    across, down = wraps
    x, y = x * width - 0.5, y * height - 0.5
    i, j = np.floor(x), np.floor(y)
    i0, i1 = _wrap(int(i), width, across)
    j0, j1 = _wrap(int(j), height, down)
    a, b = first + j0 * width, first + j1 * width
    return np.uint64(a + i0), np.uint64(a + i1), np.uint64(b + i0), np.uint64(b + i1), x - i, y - j


@inline_kernel
def _wrap(i, n, wrap):
    """Texel i and the next one, for i from −1 on; without a division."""
    if wrap == REPEAT:
        return i if i >= 0 else n - 1, i + 1 if 0 < i + 1 < n else 0
    return max(i, 0), min(i + 1, n - 1)


@inline_kernel
def _folded(t, wrap):
    """A texture coordinate taken into the image, [0, 1]."""
    if wrap == REPEAT:
        return t - np.floor(t)
    if wrap == MIRROR:
        return abs(t - 2.0 * np.floor(0.5 * t + 0.5))  # from the nearest even number
    return min(max(t, 0.0), 1.0)


@stage_kernel
def is_cut_out(coordinates, textures, alphas, materials, body, f, u, v):
    """Whether the texture's alpha leaves no surface at a place of a face."""
    if materials[body, CUTOFF] == 0.0:
        return False
    x, y, _ = interpolate(coordinates, f, u, v)
    return _alpha(textures, int(materials[body, TEXTURE]), alphas, x, y) < materials[body, CUTOFF]


@part_kernel
def share_there(coordinates, textures, alphas, materials, body, f, u, v, au, av, bu, bv):
    """The share of a blended surface that is there: its factor times the texture's alpha, where it has one."""
    share, row = materials[body, ALPHA_BLEND], int(materials[body, TEXTURE])
    if row >= 0 and textures[row, 0] == IMAGE and textures[row, 4] >= 0.0:
        x, y, _ = interpolate(coordinates, f, u, v)
        taps, level, bu, bv = filter_taps(textures, row, au, av, bu, bv)
        total = 0.0
        near = int(level)
        part = level - near
        for tap in range(taps):
            s = (tap + 0.5) / taps - 0.5
            here = _alpha(textures, row + near, alphas, x + s * bu, y + s * bv)
            if part > 0.0:
                here += part * (_alpha(textures, row + near + 1, alphas, x + s * bu, y + s * bv) - here)
            total += here
        share *= total / taps
    return share


@part_kernel
def _alpha(textures, row, alphas, x, y):
    """Alpha of an image at (u, v), bilinear."""
    wraps = _wraps(textures, row)
    x, y = _folded(x, wraps[0]), 1.0 - _folded(y, wraps[1])
    a, b, c, d, fx, fy = _texels_at(_level(textures, row), wraps, x, y)
    first = np.uint64(int(textures[row, 4]) - int(textures[row, 1]))  # wraps round as an index does
    upper = (1 - fx) * alphas[first + a] + fx * alphas[first + b]
    lower = (1 - fx) * alphas[first + c] + fx * alphas[first + d]
    return (1 - fy) * upper + fy * lower
