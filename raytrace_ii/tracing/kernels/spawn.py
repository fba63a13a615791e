"""Secondary rays: passed, refracted and reflected."""

from __future__ import annotations

import math

import numpy as np

from ii_core.jit import inline_kernel, part_kernel, stage_kernel

from . import lanes as at
from .fresnel import fresnel
from .glossy import glossy_direction
from .media import cross, disperses, media_at, refractive_index
from .tables import (
    ALPHA_BLEND,
    EXTRAS,
    PASSED,
    REFLECTION,
    REFRACTION,
    TRANSMISSION,
    WEAK_REFLECTION,
    WEAK_REFRACTION,
)  # fmt: skip
from .vectors import mix_bits, put, put_behind, three

# Steps of the R2 sequence, 1/g and 1/g² of g³ = g + 1, as fractions of 2³².
_LOW, _R2_ACROSS, _R2_AROUND = np.uint64(0xFFFFFFFF), np.uint64(3242174889), np.uint64(2447445414)


@stage_kernel
def spawn_rays(lanes, rays, surfaces, passage, following, spawned, work, counts):
    """Write the rays that the hits of a block send on, from row ``spawned`` of ``following`` on.

    Returns
    -------
    int
        How many rows are filled.
    """
    double, whole, materials = work.double, work.whole, surfaces.materials
    for k in range(lanes):
        body = whole[at.BODY + k]
        m0, m1, m2 = (
            double[at.W0 + k] * double[at.K0 + k],
            double[at.W1 + k] * double[at.K1 + k],
            double[at.W2 + k] * double[at.K2 + k],
        )
        if materials[body, EXTRAS] > 0.0:
            if materials[body, ALPHA_BLEND] > 0.0:
                spawned = _pass_through(k, rays, surfaces, passage, following, spawned, work, counts)
            if double[at.CLEAR + k] > 0.0:
                spawned, m0, m1, m2 = _refract(
                    k, m0, m1, m2, rays, surfaces, passage, following, spawned, work, counts
                )
        most = max(m0, m1, m2)
        if most < passage.least:
            counts[WEAK_REFLECTION] += most > 0.0
        elif double[at.ROUGH + k] > 0.0:
            spawned = _reflect_over_lobe(k, m0, m1, m2, rays, passage, following, spawned, work, counts)
        else:
            spawned = _reflect(k, m0, m1, m2, rays, following, spawned, work, counts)
    return spawned


@part_kernel
def _pass_through(k, rays, surfaces, passage, following, spawned, work, counts):
    """The ray that sees through a blended surface."""
    single, double = work.single, work.double
    if max(double[at.B0 + k], double[at.B1 + k], double[at.B2 + k]) < passage.least:
        return spawned
    put_behind(
        following.origins, spawned, surfaces.corners, surfaces.faces, work.whole[at.FACE + k], single[at.U + k],
        single[at.V + k], double[at.ENTERING + k] > 0.0,
    )  # fmt: skip
    put(following.directions, spawned, single[at.DX + k], single[at.DY + k], single[at.DZ + k])
    put(following.weights, spawned, double[at.B0 + k], double[at.B1 + k], double[at.B2 + k])
    _hand_on(following, spawned, rays, work, k)
    counts[PASSED] += 1
    return spawned + 1


@part_kernel
def _refract(k, m0, m1, m2, rays, surfaces, passage, following, spawned, work, counts):
    """The rays through a face of glass, one a channel where it disperses, by Fresnel's formulas.

    Returns
    -------
    spawned : int
    m0, m1, m2 : float
        Weights of the mirrored light, with what the face reflects.
    """
    double, whole, materials = work.double, work.whole, surfaces.materials
    i, body, entering = whole[at.ROW + k], whole[at.BODY + k], double[at.ENTERING + k] > 0.0
    nx, ny, nz, metallic = double[at.NX + k], double[at.NY + k], double[at.NZ + k], double[at.METAL + k]
    before, after = media_at(rays.inside, i, materials, body, entering)
    ex, ey, ez = (
        np.float64(work.single[at.DX + k]),
        np.float64(work.single[at.DY + k]),
        np.float64(work.single[at.DZ + k]),
    )
    cosine = -(ex * nx + ey * ny + ez * nz)
    splits = disperses(materials, before) or disperses(materials, after)
    for c in range(3 if splits else 1):
        t0 = double[at.W0 + k] * materials[body, TRANSMISSION]
        t1 = double[at.W1 + k] * materials[body, TRANSMISSION + 1]
        t2 = double[at.W2 + k] * materials[body, TRANSMISSION + 2]
        if metallic > 0.0:
            t0, t1, t2 = (1.0 - metallic) * t0, (1.0 - metallic) * t1, (1.0 - metallic) * t2
        if splits:  # one channel alone
            t0, t1, t2 = t0 if c == 0 else 0.0, t1 if c == 1 else 0.0, t2 if c == 2 else 0.0
        ratio = refractive_index(materials, before, c) / refractive_index(materials, after, c)
        reflected, cosine_t = fresnel(cosine, ratio)
        m0, m1, m2 = m0 + reflected * t0, m1 + reflected * t1, m2 + reflected * t2
        t0, t1, t2 = (1 - reflected) * t0, (1 - reflected) * t1, (1 - reflected) * t2
        if max(t0, t1, t2) < passage.least:
            counts[WEAK_REFRACTION] += max(t0, t1, t2) > 0.0
            continue
        along = ratio * cosine - cosine_t
        tx, ty, tz = ratio * ex + along * nx, ratio * ey + along * ny, ratio * ez + along * nz
        gx, gy, gz, lift = (
            double[at.GX + k],
            double[at.GY + k],
            double[at.GZ + k],
            np.float64(work.single[at.LIFT + k]),
        )
        if tx * gx + ty * gy + tz * gz < 0.0:  # a bent normal must not send it back out
            put(
                following.origins, spawned, double[at.PX + k] - lift * gx, double[at.PY + k] - lift * gy,
                double[at.PZ + k] - lift * gz,
            )  # fmt: skip
            put(following.directions, spawned, tx, ty, tz)
            put(following.weights, spawned, t0, t1, t2)
            _hand_on(following, spawned, rays, work, k)
            cross(following.inside, spawned, body, entering)
            counts[REFRACTION] += 1
            spawned += 1
    return spawned, m0, m1, m2


@part_kernel
def _reflect_over_lobe(k, m0, m1, m2, rays, passage, following, spawned, work, counts):
    """The rays over the lobe of a rough mirror."""
    single, double = work.single, work.double
    rough, key = double[at.ROUGH + k], rays.keys[work.whole[at.ROW + k]]
    gx, gy, gz = three(double, at.GX, k)
    many = min(max(math.ceil(passage.lobe_rays * max(m0, m1, m2)), 1), passage.lobe_rays)
    for j in range(many):
        across, around = _in_lobe(key, j * passage.lobe_stride)
        rx, ry, rz, share = glossy_direction(
            rough * rough, across, around, np.float64(single[at.DX + k]), np.float64(single[at.DY + k]),
            np.float64(single[at.DZ + k]), double[at.NX + k], double[at.NY + k], double[at.NZ + k],
        )  # fmt: skip
        share /= many
        if share * max(m0, m1, m2) * many < passage.least:
            counts[WEAK_REFLECTION] += 1
            continue
        along = rx * gx + ry * gy + rz * gz
        if along <= 0.0:  # out of the face that it would go into
            rx, ry, rz = rx - 2.0 * along * gx, ry - 2.0 * along * gy, rz - 2.0 * along * gz
        put(following.origins, spawned, double[at.OX + k], double[at.OY + k], double[at.OZ + k])
        put(following.directions, spawned, rx, ry, rz)
        put(following.weights, spawned, share * m0, share * m1, share * m2)
        _hand_on(following, spawned, rays, work, k)
        following.keys[spawned] = mix_bits(key + np.uint64(j))
        counts[REFLECTION] += 1
        spawned += 1
    return spawned


@stage_kernel
def _reflect(k, m0, m1, m2, rays, following, spawned, work, counts):
    """The ray over a smooth mirror."""
    double = work.double
    dx, dy, dz = (
        np.float64(work.single[at.DX + k]),
        np.float64(work.single[at.DY + k]),
        np.float64(work.single[at.DZ + k]),
    )
    nx, ny, nz = three(double, at.NX, k)
    gx, gy, gz = three(double, at.GX, k)
    twice = 2.0 * (dx * nx + dy * ny + dz * nz)
    rx, ry, rz = dx - twice * nx, dy - twice * ny, dz - twice * nz
    if rx * gx + ry * gy + rz * gz <= 0.0:  # nor may a bent normal send a reflection into the face
        twice = 2.0 * (dx * gx + dy * gy + dz * gz)
        rx, ry, rz = dx - twice * gx, dy - twice * gy, dz - twice * gz
    put(following.origins, spawned, double[at.OX + k], double[at.OY + k], double[at.OZ + k])
    put(following.directions, spawned, rx, ry, rz)
    put(following.weights, spawned, m0, m1, m2)
    _hand_on(following, spawned, rays, work, k)
    counts[REFLECTION] += 1
    return spawned + 1


@stage_kernel
def _hand_on(following, spawned, rays, work, k):
    """Give a spawned ray its pixel, the bodies that it runs in, its place in lobes and its width."""
    i = work.whole[at.ROW + k]
    if following.widths.shape[0] > 0:
        following.widths[spawned] = work.double[at.WIDTH + k]
    following.pixels[spawned] = rays.pixels[i]
    for j in range(rays.inside.shape[1]):
        following.inside[spawned, j] = rays.inside[i, j]
    if following.keys.shape[0] > 0:
        following.keys[spawned] = rays.keys[i]


@inline_kernel
def _in_lobe(key, step):
    """A place in [0, 1)²: the key's own, ``step`` places on along the R2 sequence (Roberts 2018)."""
    step = np.uint64(step)
    a = ((key & _LOW) + step * _R2_ACROSS) & _LOW
    b = ((key >> np.uint64(32)) + step * _R2_AROUND) & _LOW
    return a * (1.0 / 4294967296.0), b * (1.0 / 4294967296.0)
