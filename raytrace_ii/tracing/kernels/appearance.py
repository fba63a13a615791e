"""Appearance of a surface at a hit: attenuation on the path, blending, normal maps, textures, material shares."""

from __future__ import annotations

import math

import numpy as np

from ii_core.base.jit import lane_stage, late_kernel, late_lane_kernel, part_kernel, stage_kernel

from . import lanes as at
from .addresses import value_at
from .glossy import highlight
from .images import read_images
from .lanes import BLOCK, slot, take_rows
from .media import clearness, enter, medium_of
from .noise import fractal_lanes, vectors
from .tables import (
    ABSORPTION,
    ALPHA_BLEND,
    EMISSION_MAP,
    EXTRAS,
    GLOSS_MAP,
    IMAGE,
    LANED,
    NOISE,
    NORMAL_MAP,
    NORMAL_SCALE,
    TEXTURE,
)
from .textures import exponential, noise_colour, pattern_colour, share_there
from .vectors import edge, three, three_doubles

_ZERO, _ONE = np.float32(0), np.float32(1)


@late_lane_kernel
def attenuate(generation, first, lanes, _):
    """Dim rays on their way through bodies (Beer–Lambert), or through fog outside of them, which adds its light.

    A ray that meets an open body from behind has run inside: that is noted in ``inside``.
    """
    g = value_at(generation)
    rays, fog, single, whole = g.rays, g.surroundings.fog, g.work.single, g.work.whole
    density, bodies = np.float32(fog[3]) if fog.shape[0] > 0 else _ZERO, False
    for k in range(BLOCK):
        foggy = density * single[at.HIT + k]
        single[at.Q0 + k], single[at.Q1 + k], single[at.Q2 + k] = foggy, foggy, foggy
        single[at.SHARE + k] = single[at.HIT + k]
    if rays.inside.shape[1] > 0:
        for k in range(lanes):
            if single[at.HIT + k] > _ZERO:
                bodies |= _take_medium(k, np.uint64(first + k), rays.inside, g.surfaces.materials, single, whole)
    if fog.shape[0] == 0 and not bodies:
        return
    for c in range(3):
        light = np.float32(fog[c]) if fog.shape[0] > 0 else _ZERO
        for k in range(BLOCK):
            way = single[at.DISTANCE + k]  # of a miss it may be anything
            through = exponential(-single[at.Q0 + c * BLOCK + k] * (way if single[at.HIT + k] > _ZERO else _ZERO))
            weight, foggy = single[at.W0 + c * BLOCK + k], single[at.SHARE + k] * light
            single[at.F0 + c * BLOCK + k] = weight * (_ONE - through) * foggy
            single[at.W0 + c * BLOCK + k] = weight * through


@stage_kernel
def _take_medium(k, i, inside, materials, single, whole):
    """Take what absorbs the light of one lane's ray from the body that it runs in; return whether there is one."""
    body = whole[at.BODY + k]
    if materials[body, EXTRAS] > 0.0 and single[at.ENTERING + k] < 0.0 and clearness(materials, body) > 0.0:
        enter(inside, i, body)
    medium = medium_of(inside, i, materials, -1)
    if medium >= 0:
        for c in range(3):
            single[at.Q0 + c * BLOCK + k] = materials[medium, ABSORPTION + c]
        single[at.SHARE + k] = _ZERO
    return medium >= 0


@lane_stage
def take_materials(surfaces, work):
    """Bring the materials of all lanes to them, without textures and whatever else is in ``EXTRAS``.

    Returns
    -------
    bool
        Whether a lane has any of it.
    """
    single = work.single
    take_rows(
        surfaces.looks, np.int64(LANED), np.int64(0), work.whole, np.int64(at.BODY), single, np.int64(at.R0)
    )  # fmt: skip
    extras = 0
    for k in range(BLOCK):
        extras += (single[at.EXTRA + k] > _ZERO) & (single[at.HIT + k] > _ZERO)  # whole numbers: sums in vectors
    for k in range(3 * BLOCK):
        single[at.T0 + k] = _ONE
    return extras > 0


@lane_stage
def scatter(ambient, single):
    """Colours of scattered light, as seen: weight times texture and material; start with light given off."""
    for c in range(3):
        a = np.float32(ambient[c])
        for k in range(c * BLOCK, (c + 1) * BLOCK):
            w, local, hit = single[at.W0 + k], single[at.SCATTERED + k - c * BLOCK], single[at.HIT + k - c * BLOCK]
            scattered = w * (local * single[at.R0 + k] * single[at.T0 + k])
            single[at.R0 + k] = scattered
            single[at.L0 + k] = w * single[at.E0 + k] + scattered * a if hit > _ZERO else _ZERO


@late_kernel
def paint(generation, first, lanes, _):
    """Textures of bodies that have patterns, and nothing else of ``EXTRAS``."""
    g = value_at(generation)
    for k in range(BLOCK):
        g.work.single[at.CLEAR + k] = _ZERO
    _take_patterns(lanes, g.surfaces, g.work)


@late_lane_kernel
def look_closely(generation, first, lanes, _):
    """Maps, textures, metal, and parts that are seen through."""
    g = value_at(generation)
    s, single, double, whole, materials = g.surfaces, g.work.single, g.work.double, g.work.whole, g.surfaces.materials
    blending = g.following.pixels.shape[0] > 0  # the last generation takes what is blended as there
    if g.passage.first_width == 0.0 and g.passage.spread == 0.0:
        for k in range(4 * BLOCK):
            single[at.AU + k] = _ZERO
    if s.maps.any:
        _place_on_images(single, double)
    for k in range(3 * BLOCK):
        single[at.B0 + k] = _ZERO
    if s.maps.blend and blending:
        for k in range(lanes):
            if _is_special(k, single) and materials[whole[at.BODY + k], ALPHA_BLEND] > 0.0:
                _blend(k, s, single, whole)
    if s.maps.normal and _choose_images(NORMAL_MAP, lanes, s, g.work):
        for k in range(lanes):
            if whole[at.IMAGE + k] >= 0:
                _map_normal(k, s, g.work)
    if s.maps.emission and _choose_images(EMISSION_MAP, lanes, s, g.work):
        for k in range(BLOCK):
            mapped = whole[at.IMAGE + k] >= 0
            single[at.E0 + k] *= single[at.Q0 + k] if mapped else _ONE
            single[at.E1 + k] *= single[at.Q1 + k] if mapped else _ONE
            single[at.E2 + k] *= single[at.Q2 + k] if mapped else _ONE
    _take_textures(lanes, s, g.work)
    mapped = s.maps.gloss and _choose_images(GLOSS_MAP, lanes, s, g.work)
    for k in range(lanes):
        if _is_special(k, single):
            body = whole[at.BODY + k]
            single[at.CLEAR + k] = clearness(materials, body)
            if single[at.METAL + k] > 0.0 or materials[body, GLOSS_MAP] >= 0:
                _gild(k, mapped and whole[at.IMAGE + k] >= 0, s, g.work)


@stage_kernel
def _is_special(k, single):
    return single[at.HIT + k] * single[at.EXTRA + k] > _ZERO


@lane_stage
def _place_on_images(single, double):
    """(u, v) of all hits on the images of their bodies."""
    for k in range(BLOCK):
        u, v, c = np.float64(single[at.U + k]), np.float64(single[at.V + k]), at.COORDINATE + k
        w = 1.0 - u - v
        double[at.SU + k] = w * single[c] + u * single[c + 2 * BLOCK] + v * single[c + 4 * BLOCK]
        double[at.SV + k] = w * single[c + BLOCK] + u * single[c + 3 * BLOCK] + v * single[c + 5 * BLOCK]


@lane_stage
def _choose_images(column, lanes, surfaces, work):
    """Read one kind of map of all lanes; return whether there is any."""
    whole, some = work.whole, False
    for k in range(BLOCK):
        row = -1
        if k < lanes and _is_special(k, work.single):
            row = int(surfaces.materials[np.uint64(whole[at.BODY + k]), column])
        whole[at.IMAGE + k] = row
        some |= row >= 0
    if some:
        read_images(surfaces, work)
    return some


@stage_kernel
def _blend(k, surfaces, single, whole):
    """Share a lane's weight out to a blended surface and to what is seen through it."""
    there = share_there(
        surfaces, whole[at.BODY + k], whole[at.FACE + k], single[at.U + k], single[at.V + k],
        single[at.AU + k], single[at.AV + k], single[at.BU + k], single[at.BV + k],
    )  # fmt: skip
    for c in range(3):
        single[at.B0 + c * BLOCK + k] = (1.0 - there) * single[at.W0 + c * BLOCK + k]
        single[at.W0 + c * BLOCK + k] *= there


@lane_stage
def _take_textures(lanes, surfaces, work):
    """Colours of the textures of all lanes."""
    single, whole = work.single, work.whole
    if _take_patterns(lanes, surfaces, work):
        read_images(surfaces, work)
        for k in range(BLOCK):
            if whole[at.IMAGE + k] >= 0:
                single[at.T0 + k], single[at.T1 + k], single[at.T2 + k] = (
                    single[at.Q0 + k], single[at.Q1 + k], single[at.Q2 + k],
                )  # fmt: skip


@stage_kernel
def _take_patterns(lanes, surfaces, work):
    """Colours of the patterns of all lanes; return whether any has an image, whose row comes to ``IMAGE``."""
    single, whole, noisy, some = work.single, work.whole, np.int64(0), False  # no literal: another signature
    for k in range(BLOCK):
        whole[at.IMAGE + k] = -1
    for k in range(lanes):
        coloured = single[at.SCATTERED + k] > _ZERO or single[at.METAL + k] > _ZERO
        if coloured and _is_special(k, single):
            row = int(surfaces.materials[np.uint64(whole[at.BODY + k]), TEXTURE])
            if row >= 0:
                if surfaces.textures[np.uint64(row), 0] == IMAGE:
                    whole[at.IMAGE + k], some = row, True
                else:
                    noisy += _take_pattern(k, row, surfaces, work, noisy)
    if noisy > 0:
        _colour_by_noise(noisy, surfaces, work)
    return some


@stage_kernel
def _place_on_pattern(k, single):
    """Texture coordinates of one hit, products in float32: patterns at borders of pixels depend on their rounding."""
    u, v, c = single[at.U + k], single[at.V + k], at.COORDINATE + k
    w = 1.0 - u - v
    return (
        w * single[c] + u * single[c + 2 * BLOCK] + v * single[c + 4 * BLOCK],
        w * single[c + BLOCK] + u * single[c + 3 * BLOCK] + v * single[c + 5 * BLOCK],
        w * single[at.THIRD_0 + k] + u * single[at.THIRD_1 + k] + v * single[at.THIRD_2 + k],
    )


@stage_kernel
def _take_pattern(k, row, surfaces, work, noisy):
    """Colour one lane by a pattern, or note the place where its noise is wanted as number ``noisy``: 1 then."""
    single, double, whole, table = work.single, work.double, work.whole, surfaces.textures
    x, y, z = _place_on_pattern(k, single)
    if table[row, 0] != NOISE:
        t0, t1, t2 = pattern_colour(table, row, x, y, z)
        single[at.T0 + k], single[at.T1 + k], single[at.T2 + k] = t0, t1, t2
        return 0
    whole[slot(at.NOISY, noisy)] = k
    packed = int(table[row, 10])
    whole[slot(at.OCTAVES, noisy)], whole[slot(at.SEED, noisy)] = packed & 15, packed >> 4
    double[slot(at.SX, noisy)] = x * table[row, 1]
    double[slot(at.SY, noisy)] = y * table[row, 2]
    double[slot(at.SZ, noisy)] = z * table[row, 3]
    return 1


@part_kernel
def _gild(k, mapped, surfaces, work):
    """Shares of light of one lane's metal, and highlight and roughness by its map, of which green and blue count."""
    single, body = work.single, work.whole[at.BODY + k]
    metallic, rough = float(single[at.METAL + k]), float(single[at.ROUGH + k])
    if mapped:
        rough, metallic = rough * single[at.Q1 + k], metallic * single[at.Q2 + k]
    for c in range(3):
        mirrored = metallic * surfaces.materials[body, c] * single[at.T0 + c * BLOCK + k]
        single[at.K0 + c * BLOCK + k] = (1.0 - metallic) * single[at.K0 + c * BLOCK + k] + mirrored
    if single[at.GLOSS + k] > 0.0 and mapped:
        k0, k1, k2 = three(single, at.K0, k)
        strength, single[at.EXPONENT + k] = highlight((k0 + k1 + k2) / 3.0, rough)
        single[at.GLOSS + k] *= strength
        single[at.HALF_FROM + k] = 0.0
    single[at.SCATTERED + k] *= 1.0 - metallic
    single[at.CLEAR + k] *= 1.0 - metallic
    single[at.METAL + k], single[at.ROUGH + k] = metallic, rough


@stage_kernel
def _colour_by_noise(many, surfaces, work):
    """Colours of the lanes whose texture is noise."""
    single, double, whole = work.single, work.double, work.whole
    for k in range(many, vectors(many)):  # lanes to spare: far places would overflow
        whole[at.OCTAVES + k], double[at.SX + k], double[at.SY + k], double[at.SZ + k] = 0, 0.0, 0.0, 0.0
    fractal_lanes(many, whole, double)
    for j in range(many):
        k = whole[at.NOISY + j]
        row = int(surfaces.materials[np.uint64(whole[slot(at.BODY, k)]), TEXTURE])
        single[slot(at.T0, k)], single[slot(at.T1, k)], single[slot(at.T2, k)] = noise_colour(
            surfaces.textures, row, double[at.TOTAL + j]
        )


@part_kernel
def _map_normal(k, surfaces, work):
    """Tilt a shading normal by a normal map; leave it where that would turn it away from the viewer.

    Tangents are those of the face's own (u, v), made square to the shading normal; not MikkTSpace's, which are
    averaged over a mesh's corners.
    """
    single, coordinates = work.single, surfaces.coordinates
    f, body = work.whole[at.FACE + k], work.whole[at.BODY + k]
    nx, ny, nz = three_doubles(single, at.NX, k)
    scale = surfaces.materials[body, NORMAL_SCALE]
    x, y, z = three_doubles(single, at.Q0, k)
    x, y, z = scale * (2.0 * x - 1.0), scale * (2.0 * y - 1.0), 2.0 * z - 1.0
    u1, v1 = coordinates[f, 1, 0] - coordinates[f, 0, 0], coordinates[f, 1, 1] - coordinates[f, 0, 1]
    u2, v2 = coordinates[f, 2, 0] - coordinates[f, 0, 0], coordinates[f, 2, 1] - coordinates[f, 0, 1]
    turn = float(u1) * v2 - float(u2) * v1
    if turn == 0.0 or x * x + y * y < 1e-12:
        return
    side = single[at.ENTERING + k] * (1.0 if turn > 0.0 else -1.0)
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
    single[at.NX + k], single[at.NY + k], single[at.NZ + k] = mx / length, my / length, mz / length


@part_kernel
def _square(x, y, z, nx, ny, nz):
    """The part of a vector square to a unit vector, as a unit vector; zero if there is none."""
    along = x * nx + y * ny + z * nz
    x, y, z = x - along * nx, y - along * ny, z - along * nz
    length = math.sqrt(x * x + y * y + z * z)
    return (x / length, y / length, z / length) if length > 0.0 else (0.0, 0.0, 0.0)
