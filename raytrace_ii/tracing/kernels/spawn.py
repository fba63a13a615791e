"""Secondary rays: passed, refracted and reflected."""

from __future__ import annotations

import math

import numpy as np

from ii_core.base.jit import late_kernel, part_kernel, stage_kernel

from . import lanes as at
from .addresses import value_at
from .glossy import LOW, R2_ACROSS, R2_AROUND, glossy_direction, mix_bits
from .media import cross, disperses, fresnel, media_at, refractive_index
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
from .vectors import behind, put, three, three_doubles

_ZERO = np.float32(0)


@late_kernel
def reflect(generation, first, lanes, _):
    """Write the rays over smooth mirrors, for scenes without rough ones and without anything seen through."""
    g = value_at(generation)
    for k in range(lanes):
        if g.work.single[at.HIT + k] == _ZERO:
            continue
        m0, m1, m2 = _mirrored(k, g.work.single)
        if max(m0, m1, m2) >= g.passage.least:
            _reflect(k, first + k, m0, m1, m2, g.rays, g.passage, g.following, g.work, g.counts)
        else:
            g.counts[WEAK_REFLECTION] += max(m0, m1, m2) > 0.0


@late_kernel
def spawn(generation, first, lanes, _):
    """Write the rays that the hits of a block send on, over mirrors and through what is clear.

    Those that go through stand before all that are mirrored, which run apart from them: the order in which a pixel's
    light is added depends on no block.
    """
    g = value_at(generation)
    rays, passage, following, work, counts = g.rays, g.passage, g.following, g.work, g.counts
    for k in range(lanes):
        if work.single[at.HIT + k] == _ZERO:
            continue
        i, body = first + k, work.whole[at.BODY + k]
        m0, m1, m2 = _mirrored(k, work.single)
        if g.surfaces.materials[body, EXTRAS] > 0.0:
            if g.surfaces.materials[body, ALPHA_BLEND] > 0.0:
                _pass_through(k, i, rays, g.surfaces, passage, following, work, counts)
            if work.single[at.CLEAR + k] > 0.0:
                m0, m1, m2 = _refract(
                    k, i, m0, m1, m2, rays, g.surfaces.materials, passage, following, work, counts
                )  # fmt: skip
        if max(m0, m1, m2) < passage.least:
            counts[WEAK_REFLECTION] += max(m0, m1, m2) > 0.0
        elif work.single[at.ROUGH + k] > 0.0:
            _reflect_over_lobe(k, i, m0, m1, m2, rays, passage, following, work, counts)
        else:
            _reflect(k, i, m0, m1, m2, rays, passage, following, work, counts)


@stage_kernel
def _mirrored(k, single):
    """Weights of the light that one lane mirrors."""
    return (
        single[at.W0 + k] * single[at.K0 + k],
        single[at.W1 + k] * single[at.K1 + k],
        single[at.W2 + k] * single[at.K2 + k],
    )


@stage_kernel
def _send(k, i, kind, ox, oy, oz, dx, dy, dz, w0, w1, w2, rays, passage, following, work, counts):
    """Write a ray that a lane sends on, with the pixel, bodies around it and place in lobes of the ray before.

    Returns
    -------
    int
        Its row.
    """
    row = passage.mirrored + counts[kind] if kind == REFLECTION else counts[REFRACTION] + counts[PASSED]
    put(following.origins, row, ox, oy, oz)
    put(following.directions, row, dx, dy, dz)
    put(following.weights, row, w0, w1, w2)
    if following.widths.shape[0] > 0:
        following.widths[row] = work.single[at.WIDTH + k]
    following.pixels[row] = rays.pixels[i]
    for j in range(rays.inside.shape[1]):
        following.inside[row, j] = rays.inside[i, j]
    if following.keys.shape[0] > 0:
        following.keys[row] = rays.keys[i]
    counts[kind] += 1
    return row


@part_kernel
def _pass_through(k, i, rays, surfaces, passage, following, work, counts):
    """The ray that sees through a blended surface."""
    single = work.single
    b0, b1, b2 = three(single, at.B0, k)
    if max(b0, b1, b2) < passage.least:
        return
    x, y, z = behind(
        surfaces, work.whole[at.FACE + k], single[at.U + k], single[at.V + k],
        single[at.ENTERING + k] > 0.0,
    )  # fmt: skip
    dx, dy, dz = three_doubles(single, at.DX, k)
    _send(k, i, PASSED, x, y, z, dx, dy, dz, b0, b1, b2, rays, passage, following, work, counts)


@stage_kernel
def _refract(k, i, m0, m1, m2, rays, materials, passage, following, work, counts):
    """The rays through a face of glass, one a channel where it disperses, by Fresnel's formulas.

    Returns
    -------
    m0, m1, m2 : float
        Weights of the mirrored light, with what the face reflects.
    """
    single, whole = work.single, work.whole
    body, entering = whole[at.BODY + k], single[at.ENTERING + k] > 0.0
    (nx, ny, nz), metallic = three_doubles(single, at.NX, k), single[at.METAL + k]
    before, after = media_at(rays.inside, i, materials, body, entering)
    ex, ey, ez = three_doubles(work.single, at.DX, k)
    gx, gy, gz = three_doubles(single, at.GX, k)
    lift = np.float64(work.single[at.LIFT + k])
    cosine = -(ex * nx + ey * ny + ez * nz)
    splits = disperses(materials, before) or disperses(materials, after)
    for c in range(3 if splits else 1):
        t0 = single[at.W0 + k] * materials[body, TRANSMISSION]
        t1 = single[at.W1 + k] * materials[body, TRANSMISSION + 1]
        t2 = single[at.W2 + k] * materials[body, TRANSMISSION + 2]
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
        if tx * gx + ty * gy + tz * gz < 0.0:  # a bent normal must not send it back out
            x, y, z = (
                single[at.PX + k] - lift * gx, single[at.PY + k] - lift * gy, single[at.PZ + k] - lift * gz,
            )  # fmt: skip
            row = _send(k, i, REFRACTION, x, y, z, tx, ty, tz, t0, t1, t2, rays, passage, following, work, counts)
            cross(following.inside, row, body, entering)
    return m0, m1, m2


@part_kernel
def _reflect_over_lobe(k, i, m0, m1, m2, rays, passage, following, work, counts):
    """The rays over the lobe of a rough mirror."""
    single = work.single
    rough, key = np.float64(single[at.ROUGH + k]), rays.keys[i]
    dx, dy, dz = three_doubles(single, at.DX, k)
    nx, ny, nz = three_doubles(single, at.NX, k)
    gx, gy, gz = three_doubles(single, at.GX, k)
    ox, oy, oz = three_doubles(single, at.OX, k)
    many = min(max(math.ceil(passage.lobe_rays * max(m0, m1, m2)), 1), passage.lobe_rays)
    for j in range(many):
        across, around = _in_lobe(key, j * passage.lobe_stride)
        rx, ry, rz, share = glossy_direction(rough * rough, across, around, dx, dy, dz, nx, ny, nz)
        if share == 0.0:  # into the surface
            counts[WEAK_REFLECTION] += 1
            continue
        share /= many
        along = rx * gx + ry * gy + rz * gz
        if along <= 0.0:  # out of the face that it would go into
            rx, ry, rz = rx - 2.0 * along * gx, ry - 2.0 * along * gy, rz - 2.0 * along * gz
        row = _send(
            k, i, REFLECTION, ox, oy, oz, rx, ry, rz, share * m0, share * m1, share * m2, rays, passage, following,
            work, counts,
        )  # fmt: skip
        following.keys[row] = mix_bits(key + np.uint64(j))


@stage_kernel
def _reflect(k, i, m0, m1, m2, rays, passage, following, work, counts):
    """The ray over a smooth mirror."""
    single = work.single
    dx, dy, dz = three_doubles(work.single, at.DX, k)
    nx, ny, nz = three_doubles(single, at.NX, k)
    gx, gy, gz = three_doubles(single, at.GX, k)
    ox, oy, oz = three_doubles(single, at.OX, k)
    twice = 2.0 * (dx * nx + dy * ny + dz * nz)
    rx, ry, rz = dx - twice * nx, dy - twice * ny, dz - twice * nz
    if rx * gx + ry * gy + rz * gz <= 0.0:  # nor may a bent normal send a reflection into the face
        twice = 2.0 * (dx * gx + dy * gy + dz * gz)
        rx, ry, rz = dx - twice * gx, dy - twice * gy, dz - twice * gz
    _send(k, i, REFLECTION, ox, oy, oz, rx, ry, rz, m0, m1, m2, rays, passage, following, work, counts)


@stage_kernel
def _in_lobe(key, step):
    """A place in [0, 1)²: the key's own, ``step`` places on along the R2 sequence (Roberts 2018)."""
    step = np.uint64(step)
    a = ((key & LOW) + step * R2_ACROSS) & LOW
    b = ((key >> np.uint64(32)) + step * R2_AROUND) & LOW
    return a * (1.0 / 4294967296.0), b * (1.0 / 4294967296.0)
