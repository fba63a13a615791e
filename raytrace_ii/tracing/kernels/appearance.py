"""Appearance of a surface at a hit: attenuation on the path, blending, normal maps, textures, material shares."""

from __future__ import annotations

import math

import numpy as np

from ii_core.jit import part_kernel, stage_kernel

from . import lanes as at
from .glossy import highlight
from .lanes import BLOCK
from .media import clearness, enter, medium_of
from .noise import fractal_lanes
from .tables import (
    ABSORPTION,
    ALPHA_BLEND,
    EMISSION_MAP,
    EXTRAS,
    GLOSS_MAP,
    IMAGE,
    LANED,
    MATERIAL_COLUMNS,
    NOISE,
    NORMAL_MAP,
    NORMAL_SCALE,
    TEXTURE,
)
from .textures import filtered, noise_colour, share_there, texture_colour
from .vectors import edge, interpolate, three

_COLUMNS, _EXTRAS = np.uint64(MATERIAL_COLUMNS), np.uint64(EXTRAS)


@stage_kernel
def attenuate(lanes, rays, surfaces, fog, work):
    """Dim rays on their way through bodies (Beer–Lambert), or through fog outside of them, which adds its light.

    A ray that meets an open body from behind has run inside: that is noted in ``inside``.
    """
    double, whole, materials = work.double, work.whole, surfaces.materials
    if rays.inside.shape[1] == 0 and fog.shape[0] == 0:
        return
    for k in range(lanes):
        i, body, t = whole[at.ROW + k], whole[at.BODY + k], np.float64(work.single[at.DISTANCE + k])
        medium = -1
        if rays.inside.shape[1] > 0:
            if materials[body, EXTRAS] > 0.0 and double[at.ENTERING + k] < 0.0 and clearness(materials, body) > 0.0:
                enter(rays.inside, i, body)
            medium = medium_of(rays.inside, i, materials, -1)
        if fog.shape[0] > 0:
            double[at.F0 + k], double[at.F1 + k], double[at.F2 + k] = 0.0, 0.0, 0.0
        if medium >= 0:
            double[at.W0 + k] *= math.exp(-materials[medium, ABSORPTION] * t)
            double[at.W1 + k] *= math.exp(-materials[medium, ABSORPTION + 1] * t)
            double[at.W2 + k] *= math.exp(-materials[medium, ABSORPTION + 2] * t)
        elif fog.shape[0] > 0:
            through = math.exp(-fog[3] * t)
            double[at.F0 + k] = double[at.W0 + k] * (1.0 - through) * fog[0]
            double[at.F1 + k] = double[at.W1 + k] * (1.0 - through) * fog[1]
            double[at.F2 + k] = double[at.W2 + k] * (1.0 - through) * fog[2]
            double[at.W0 + k] *= through
            double[at.W1 + k] *= through
            double[at.W2 + k] *= through


@stage_kernel
def look(lanes, surfaces, surroundings, passage, filtering, work):
    """Shares of scattered, mirrored and transmitted light, highlights, and light given off, of all lanes.

    Bodies without anything of ``EXTRAS`` need their row of the table alone.
    """
    double, whole, materials = work.double, work.whole, surfaces.flat_materials
    textured, noisy, same = False, np.int64(0), True  # no literal: another signature
    for k in range(lanes):
        same &= whole[at.BODY + k] == whole[at.BODY]
    if same:
        row = np.uint64(whole[at.BODY]) * _COLUMNS
        for c in range(LANED):
            value = materials[row + np.uint64(c)]
            for k in range(BLOCK):
                double[at.R0 + c * BLOCK + k] = value
    else:
        for k in range(lanes):
            row = np.uint64(whole[at.BODY + k]) * _COLUMNS
            for c in range(LANED):
                double[at.R0 + c * BLOCK + k] = materials[row + np.uint64(c)]
    for k in range(lanes):
        if materials[np.uint64(whole[at.BODY + k]) * _COLUMNS + _EXTRAS] > 0.0:
            if not textured:
                textured = True
                for j in range(3 * BLOCK):
                    double[at.T0 + j] = 1.0
            noisy += _look_closely(k, surfaces, passage, filtering, work, noisy)
    if noisy > 0:
        _colour_by_noise(noisy, surfaces, work)
    for k in range(BLOCK):
        local = double[at.SCATTERED + k]
        r, g, b = local * double[at.R0 + k], local * double[at.R1 + k], local * double[at.R2 + k]
        double[at.R0 + k], double[at.R1 + k], double[at.R2 + k] = r, g, b
    if textured:
        for k in range(3 * BLOCK):
            double[at.R0 + k] *= double[at.T0 + k]
    a0, a1, a2 = surroundings.ambient[0], surroundings.ambient[1], surroundings.ambient[2]
    for k in range(BLOCK):
        w0, w1, w2 = double[at.W0 + k], double[at.W1 + k], double[at.W2 + k]
        r, g, b = w0 * double[at.R0 + k], w1 * double[at.R1 + k], w2 * double[at.R2 + k]
        double[at.R0 + k], double[at.R1 + k], double[at.R2 + k] = r, g, b
        double[at.E0 + k] = w0 * double[at.E0 + k] + r * a0
        double[at.E1 + k] = w1 * double[at.E1 + k] + g * a1
        double[at.E2 + k] = w2 * double[at.E2 + k] + b * a2


@stage_kernel
def _look_closely(k, surfaces, passage, filtering, work, noisy):
    """One lane of a body that has maps, a texture, metal, or parts that are seen through.

    Returns
    -------
    int
        1 if the lane's colour is that of a noise yet to come, else 0.
    """
    single, double, whole, materials = work.single, work.double, work.whole, surfaces.materials
    textures, texels, coordinates = surfaces.textures, surfaces.texels, surfaces.coordinates
    f, body, u, v = whole[at.FACE + k], whole[at.BODY + k], single[at.U + k], single[at.V + k]
    au, av, bu, bv = 0.0, 0.0, 0.0, 0.0
    if filtering:
        au, av, bu, bv = double[at.AU + k], double[at.AV + k], double[at.BU + k], double[at.BV + k]
    clear = clearness(materials, body)
    double[at.B0 + k], double[at.B1 + k], double[at.B2 + k] = 0.0, 0.0, 0.0
    if passage.spawn and materials[body, ALPHA_BLEND] > 0.0:
        # seen through to the share that is not there; the last generation takes it as there
        there = share_there(coordinates, textures, surfaces.alphas, materials, body, f, u, v, au, av, bu, bv)
        for c in range(3):
            double[at.B0 + c * BLOCK + k] = (1.0 - there) * double[at.W0 + c * BLOCK + k]
            double[at.W0 + c * BLOCK + k] *= there
    if materials[body, NORMAL_MAP] >= 0:
        _map_normal(k, surfaces, work, au, av, bu, bv)
    if materials[body, EMISSION_MAP] >= 0:
        s0, s1, _ = interpolate(coordinates, f, u, v)
        t0, t1, t2 = filtered(textures, int(materials[body, EMISSION_MAP]), texels, s0, s1, au, av, bu, bv)
        double[at.E0 + k] *= t0
        double[at.E1 + k] *= t1
        double[at.E2 + k] *= t2
    local, metallic, rough = double[at.SCATTERED + k], double[at.METAL + k], double[at.ROUGH + k]
    t0, t1, t2, noise = 1.0, 1.0, 1.0, 0
    if materials[body, TEXTURE] >= 0 and (local > 0.0 or metallic > 0.0):
        s0, s1, s2 = interpolate(coordinates, f, u, v)
        row = int(materials[body, TEXTURE])
        if filtering and textures[row, 0] == IMAGE and double[at.WIDTH + k] > 0.0:
            t0, t1, t2 = filtered(textures, row, texels, s0, s1, au, av, bu, bv)
        elif textures[row, 0] == NOISE and metallic == 0.0:
            noise = 1
            whole[at.NOISY + noisy] = k
            packed = int(textures[row, 10])
            whole[at.OCTAVES + noisy], whole[at.SEED + noisy] = packed % 16, packed // 16
            double[at.SX + noisy] = s0 * textures[row, 1]
            double[at.SY + noisy] = s1 * textures[row, 2]
            double[at.SZ + noisy] = s2 * textures[row, 3]
        else:
            t0, t1, t2 = texture_colour(textures, row, texels, s0, s1, s2)
        double[at.T0 + k], double[at.T1 + k], double[at.T2 + k] = t0, t1, t2
    if metallic > 0.0 or materials[body, GLOSS_MAP] >= 0:
        if materials[body, GLOSS_MAP] >= 0:
            s0, s1, _ = interpolate(coordinates, f, u, v)
            row = int(materials[body, GLOSS_MAP])
            _, s1, s2 = filtered(textures, row, texels, s0, s1, au, av, bu, bv)
            rough, metallic = rough * s1, metallic * s2
        local, clear = (1.0 - metallic) * local, (1.0 - metallic) * clear
        k0 = (1.0 - metallic) * double[at.K0 + k] + metallic * materials[body, 0] * t0
        k1 = (1.0 - metallic) * double[at.K1 + k] + metallic * materials[body, 1] * t1
        k2 = (1.0 - metallic) * double[at.K2 + k] + metallic * materials[body, 2] * t2
        double[at.K0 + k], double[at.K1 + k], double[at.K2 + k] = k0, k1, k2
        if double[at.GLOSS + k] > 0.0 and materials[body, GLOSS_MAP] >= 0:
            strength, double[at.EXPONENT + k] = highlight((k0 + k1 + k2) / 3.0, rough)
            double[at.GLOSS + k] *= strength
            double[at.HALF_FROM + k] = 0.0
        double[at.SCATTERED + k], double[at.METAL + k], double[at.ROUGH + k] = local, metallic, rough
    double[at.CLEAR + k] = clear
    return noise


@stage_kernel
def _colour_by_noise(many, surfaces, work):
    """Colours of the lanes whose texture is noise."""
    double, whole = work.double, work.whole
    for k in range(many, BLOCK):  # lanes to spare: far places would overflow
        whole[at.OCTAVES + k], double[at.SX + k], double[at.SY + k], double[at.SZ + k] = 0, 0.0, 0.0, 0.0
    fractal_lanes(many, whole, double)
    for j in range(many):
        k = whole[at.NOISY + j]
        row = int(surfaces.materials[whole[at.BODY + k], TEXTURE])
        double[at.T0 + k], double[at.T1 + k], double[at.T2 + k] = noise_colour(
            surfaces.textures, row, double[at.TOTAL + j]
        )


@part_kernel
def _map_normal(k, surfaces, work, au, av, bu, bv):
    """Tilt a shading normal by a normal map; leave it where that would turn it away from the viewer.

    Tangents are those of the face's own (u, v), made square to the shading normal; not MikkTSpace's, which are
    averaged over a mesh's corners.
    """
    single, double, coordinates = work.single, work.double, surfaces.coordinates
    f, body = work.whole[at.FACE + k], work.whole[at.BODY + k]
    nx, ny, nz = three(double, at.NX, k)
    scale = surfaces.materials[body, NORMAL_SCALE]
    s, t, _ = interpolate(coordinates, f, single[at.U + k], single[at.V + k])
    row = int(surfaces.materials[body, NORMAL_MAP])
    x, y, z = filtered(surfaces.textures, row, surfaces.texels, s, t, au, av, bu, bv)
    x, y, z = scale * (2.0 * x - 1.0), scale * (2.0 * y - 1.0), 2.0 * z - 1.0
    u1, v1 = coordinates[f, 1, 0] - coordinates[f, 0, 0], coordinates[f, 1, 1] - coordinates[f, 0, 1]
    u2, v2 = coordinates[f, 2, 0] - coordinates[f, 0, 0], coordinates[f, 2, 1] - coordinates[f, 0, 1]
    turn = float(u1) * v2 - float(u2) * v1
    if turn == 0.0 or x * x + y * y < 1e-12:
        return
    side = double[at.ENTERING + k] * (1.0 if turn > 0.0 else -1.0)
    ax, ay, az = edge(surfaces.corners, f, 1)
    bx, by, bz = edge(surfaces.corners, f, 2)
    # where u grows, and where v grows, up to a positive factor and the side
    tx, ty, tz = _square(v2 * ax - v1 * bx, v2 * ay - v1 * by, v2 * az - v1 * bz, nx, ny, nz)
    bx, by, bz = _square(u1 * bx - u2 * ax, u1 * by - u2 * ay, u1 * bz - u2 * az, nx, ny, nz)
    bx, by, bz = _square(bx, by, bz, tx, ty, tz)
    mx = side * (x * tx + y * bx) + z * nx
    my = side * (x * ty + y * by) + z * ny
    mz = side * (x * tz + y * bz) + z * nz
    length = math.sqrt(mx * mx + my * my + mz * mz)
    if length == 0.0 or mx * single[at.DX + k] + my * single[at.DY + k] + mz * single[at.DZ + k] >= 0.0:
        return
    double[at.NX + k], double[at.NY + k], double[at.NZ + k] = mx / length, my / length, mz / length


@part_kernel
def _square(x, y, z, nx, ny, nz):
    """The part of a vector square to a unit vector, as a unit vector; zero if there is none."""
    along = x * nx + y * ny + z * nz
    x, y, z = x - along * nx, y - along * ny, z - along * nz
    length = math.sqrt(x * x + y * y + z * z)
    return (x / length, y / length, z / length) if length > 0.0 else (0.0, 0.0, 0.0)
