"""Textures: patterns, places in images, and their alpha; colours of images are read in `images`."""

from __future__ import annotations

import math

import numpy as np

from ii_core.base.jit import part_kernel, stage_kernel

from .lanes import bits_of, single_of
from .tables import ALPHA_BLEND, CHECKER, CUTOFF, IMAGE, LEVELS, MIRROR, REPEAT, TEXTURE, VERTEX
from .vectors import interpolate

MOST_TAPS = np.float32(8)  # along the longer axis of a filtered ellipse
SHARPER = np.float32(0.5)  # levels finer than the filter's width: bilinear reading of a level widens it again
_ZERO, _HALF, _ONE = np.float32(0), np.float32(0.5), np.float32(1)
_MANTISSA, _EXPONENT_0, _23, _127 = np.int32(0x7FFFFF), np.int32(0x3F800000), np.int32(23), np.int32(127)
# of the logarithm: 2/ln 2 · 1/(2k + 1)
_C0, _C1, _C2, _C3, _C4, _C5 = (np.float32(2 / math.log(2) / k) for k in (1, 3, 5, 7, 9, 11))
_PER_OCTAVE, _LEAST_EXPONENT = np.float32(1 / math.log(2)), np.float32(-126)
_E2, _E3, _E4, _E5, _E6 = (np.float32(1 / math.factorial(k)) for k in (2, 3, 4, 5, 6))


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


@stage_kernel
def _between(table, row, t):
    return (
        table[row, 4] + t * (table[row, 7] - table[row, 4]),
        table[row, 5] + t * (table[row, 8] - table[row, 5]),
        table[row, 6] + t * (table[row, 9] - table[row, 6]),
    )


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


@stage_kernel
def filter_taps(width, height, levels, au, av, bu, bv):
    """Number of taps, level of each, and the way over (u, v) that they lie along: the longer of two diameters.

    The level fits the shorter diameter, or the distance of the taps where there would be too many; an image has so
    many coarser ``levels``. Without a branch, for vectors.
    """
    au_wide, av_high, bu_wide, bv_high = au * width, av * height, bu * width, bv * height
    first, second = au_wide * au_wide + av_high * av_high, bu_wide * bu_wide + bv_high * bv_high
    longer = first > second
    bu, bv = au if longer else bu, av if longer else bv
    a, b = math.sqrt(second if longer else first), math.sqrt(first if longer else second)
    taps = min(max(np.ceil(b / (a if a > _ONE else _ONE)), _ONE), MOST_TAPS)
    apart = b / taps
    apart = a if a > apart else apart
    level = logarithm(apart if apart > _ONE else _ONE) - SHARPER
    return taps, min(max(level, _ZERO), levels), bu, bv


@stage_kernel
def logarithm(x):
    """Logarithm to base 2 of a float32 from 1 on: exponent, and a series in the mantissa, for vectors."""
    number = bits_of(x)
    mantissa = single_of(np.int32((number & _MANTISSA) | _EXPONENT_0))
    t = (mantissa - _ONE) / (mantissa + _ONE)
    q = t * t
    series = _C0 + q * (_C1 + q * (_C2 + q * (_C3 + q * (_C4 + q * _C5))))
    return np.float32(np.int32(number >> _23) - _127) + t * series


@stage_kernel
def exponential(x):
    """e^x of a float32 up to 0: exponent, and a series of the rest, for vectors; below 2⁻¹²⁶ that."""
    y = max(x * _PER_OCTAVE, _LEAST_EXPONENT)
    n = np.floor(y + _HALF)
    t = (y - n) / _PER_OCTAVE
    series = _ONE + t * (_ONE + t * (_E2 + t * (_E3 + t * (_E4 + t * (_E5 + t * _E6)))))
    return series * single_of(np.int32((np.int32(n) + _127) << _23))


@stage_kernel
def texels_about(x, y, width, height, repeats_across, repeats_down):
    """The texels about a place folded into an image, from its upper left corner in widths and heights.

    Columns left and right, rows above and below, and how far it is to right and down; for vectors.
    """
    x, y, last, lowest = x * width - _HALF, y * height - _HALF, width - _ONE, height - _ONE
    i, j = np.floor(x), np.floor(y)
    i0 = (last if repeats_across else _ZERO) if i < _ZERO else i
    i1 = (_ZERO if repeats_across else last) if i >= last else i + _ONE
    j0 = (lowest if repeats_down else _ZERO) if j < _ZERO else j
    j1 = (_ZERO if repeats_down else lowest) if j >= lowest else j + _ONE
    return i0, i1, j0, j1, x - i, y - j


@stage_kernel
def folded(t, wrap):
    """A texture coordinate taken into the image, [0, 1]; for vectors."""
    mirrored = abs(t - 2.0 * np.floor(0.5 * t + 0.5))  # from the nearest even number
    return t - np.floor(t) if wrap == REPEAT else (mirrored if wrap == MIRROR else min(max(t, 0.0), 1.0))


@stage_kernel
def is_cut_out(surfaces, body, f, u, v):
    """Whether the texture's alpha leaves no surface at a place of a face."""
    cutoff = surfaces.materials[body, CUTOFF]
    if cutoff == 0.0:
        return False
    x, y, _ = interpolate(surfaces.coordinates, f, u, v)
    return alpha(surfaces.textures, int(surfaces.materials[body, TEXTURE]), surfaces.alphas, x, y) < cutoff


@part_kernel
def share_there(surfaces, body, f, u, v, au, av, bu, bv):
    """The share of a blended surface that is there: its factor times the texture's alpha, where it has one."""
    textures, alphas = surfaces.textures, surfaces.alphas
    share, row = surfaces.materials[body, ALPHA_BLEND], int(surfaces.materials[body, TEXTURE])
    if row >= 0 and textures[row, 0] == IMAGE and textures[row, 4] >= 0.0:
        x, y, _ = interpolate(surfaces.coordinates, f, u, v)
        taps, level, bu, bv = filter_taps(
            np.float32(textures[row, 2]), np.float32(textures[row, 3]), np.float32(textures[row, LEVELS]),
            np.float32(au), np.float32(av), np.float32(bu), np.float32(bv),
        )  # fmt: skip
        total = 0.0
        near = int(level)
        part = level - near
        for tap in range(int(taps)):
            s = (tap + 0.5) / taps - 0.5
            here = alpha(textures, row + near, alphas, x + s * bu, y + s * bv)
            if part > 0.0:
                here += part * (alpha(textures, row + near + 1, alphas, x + s * bu, y + s * bv) - here)
            total += here
        share *= total / taps
    return share


@part_kernel
def alpha(textures, row, alphas, x, y):
    """Alpha of an image at (u, v), bilinear."""
    across, down, width = textures[row, 6], textures[row, 7], textures[row, 2]
    x, y = folded(x, across), 1.0 - folded(y, down)
    i0, i1, j0, j1, fx, fy = texels_about(x, y, width, textures[row, 3], across == REPEAT, down == REPEAT)
    first = textures[row, 4]
    above, below = first + j0 * width, first + j1 * width
    upper = (1 - fx) * alphas[np.uint64(above + i0)] + fx * alphas[np.uint64(above + i1)]
    lower = (1 - fx) * alphas[np.uint64(below + i0)] + fx * alphas[np.uint64(below + i1)]
    return (1 - fy) * upper + fy * lower
