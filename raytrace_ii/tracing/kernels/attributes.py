"""Attributes of hits, computed for all lanes of a packet: position, flat and smooth normal, footprint."""

from __future__ import annotations

import math

import numpy as np

from ii_core.base.jit import exact_lane_stage, late_lane_kernel
from ii_core.base.jit import lane_stage as stage_kernel

from . import lanes as at
from .addresses import value_at
from .lanes import BLOCK, take_rows
from .packets import place_hit
from .tables import ALL_COLUMNS, FLAT_COLUMNS, IMAGES
from .textures import footprint
from .vectors import pull_by, three, three_doubles, three_of_row

_ZERO, _ONE, _THIRD, _WIDE = np.float32(0), np.float32(1), np.float32(1 / 3), np.int64(FLAT_COLUMNS)


@stage_kernel
def take_rays(first, lanes, rays, single):
    """Bring a packet of rays to lanes; lanes to spare have the last one."""
    for k in range(BLOCK):
        i = np.uint64(first + min(k, lanes - 1))
        o, d, w = at.START + k, at.DX + k, at.W0 + k
        single[o], single[o + BLOCK], single[o + 2 * BLOCK] = three_of_row(rays.origins, i)
        single[d], single[d + BLOCK], single[d + 2 * BLOCK] = three_of_row(rays.directions, i)
        single[w], single[w + BLOCK], single[w + 2 * BLOCK] = three_of_row(rays.weights, i)


@stage_kernel
def take_hits(first, lanes, hits, single, whole):
    """Bring the hits of a packet, found before, to lanes."""
    for k in range(BLOCK):
        i = np.uint64(first + min(k, lanes - 1))
        whole[at.FACE + k] = np.int64(hits.faces[i]) if k < lanes else -1
        single[at.U + k], single[at.V + k], single[at.DISTANCE + k] = hits.u[i], hits.v[i], hits.distances[i]


@stage_kernel
def take_faces(surfaces, single, whole):
    """Bring what is known of the faces hit to lanes; of a miss, of the first face.

    Returns
    -------
    int
        How many rays hit something.
    """
    hits = 0
    for k in range(BLOCK):
        hit = whole[at.FACE + k] >= 0
        whole[at.TABLE_ROW + k] = whole[at.FACE + k] if hit else 0
        single[at.HIT + k] = _ONE if hit else _ZERO
        hits += hit
    if hits > 0:
        columns = np.int64(surfaces.columns)
        take_rows(surfaces.rows, columns, np.int64(0), whole, np.int64(at.TABLE_ROW), single, np.int64(at.CORNER))
        if columns == ALL_COLUMNS:
            take_rows(surfaces.rows, columns, _WIDE, whole, np.int64(at.TABLE_ROW), single, np.int64(at.NORMAL))
        for k in range(BLOCK):
            whole[at.BODY + k] = np.int64(single[at.FACE_BODY + k])
    return hits


@exact_lane_stage
def settle(single):
    """Put u, v and distance as `place_hit` gives them in place of Embree's."""
    for k in range(BLOCK):
        o, d, c = at.START + k, at.DX + k, at.CORNER + k
        u, v, t, sure = place_hit(
            single[o], single[o + BLOCK], single[o + 2 * BLOCK], single[d], single[d + BLOCK], single[d + 2 * BLOCK],
            single[c], single[c + BLOCK], single[c + 2 * BLOCK],
            single[c + 3 * BLOCK], single[c + 4 * BLOCK], single[c + 5 * BLOCK],
            single[c + 6 * BLOCK], single[c + 7 * BLOCK], single[c + 8 * BLOCK],
        )  # fmt: skip
        single[at.U + k] = u if sure else single[at.U + k]
        single[at.V + k] = v if sure else single[at.V + k]
        single[at.DISTANCE + k] = t if sure else single[at.DISTANCE + k]


@stage_kernel
def place(single):
    """Hit points, normals on the ray's side, and places to start from."""
    for k in range(BLOCK):
        u, v, lift, c = single[at.U + k], single[at.V + k], single[at.LIFT + k], at.CORNER + k
        pull = pull_by(
            lift, _ONE,
            single[c + 3 * BLOCK] - single[c], single[c + 4 * BLOCK] - single[c + BLOCK],
            single[c + 5 * BLOCK] - single[c + 2 * BLOCK],
            single[c + 6 * BLOCK] - single[c], single[c + 7 * BLOCK] - single[c + BLOCK],
            single[c + 8 * BLOCK] - single[c + 2 * BLOCK],
        )  # fmt: skip
        u, v = u + pull * (_THIRD - u), v + pull * (_THIRD - v)
        w = _ONE - u - v
        px = w * single[c] + u * single[c + 3 * BLOCK] + v * single[c + 6 * BLOCK]
        py = w * single[c + BLOCK] + u * single[c + 4 * BLOCK] + v * single[c + 7 * BLOCK]
        pz = w * single[c + 2 * BLOCK] + u * single[c + 5 * BLOCK] + v * single[c + 8 * BLOCK]
        gx, gy, gz = three(single, at.FACE_NORMAL, k)
        entering = gx * single[at.DX + k] + gy * single[at.DY + k] + gz * single[at.DZ + k] < _ZERO
        side = _ONE if entering else -_ONE
        gx, gy, gz = side * gx, side * gy, side * gz
        single[at.PX + k], single[at.PY + k], single[at.PZ + k] = px, py, pz
        single[at.GX + k], single[at.GY + k], single[at.GZ + k] = gx, gy, gz
        single[at.OX + k], single[at.OY + k], single[at.OZ + k] = px + lift * gx, py + lift * gy, pz + lift * gz
        single[at.ENTERING + k] = side


@stage_kernel
def flat_normals(single):
    """Shade by the normals of the faces."""
    for k in range(3 * BLOCK):
        single[at.NX + k] = single[at.GX + k]
        single[at.AX + k] = _ZERO
    for k in range(BLOCK):
        single[at.SMOOTH + k] = _ZERO


@stage_kernel
def smooth_normals(single):
    """Interpolated vertex normals on the ray's side, or the face's own where there is none or it faces away."""
    for k in range(BLOCK):
        u, v = single[at.U + k], single[at.V + k]
        w = _ONE - u - v
        n = at.NORMAL + k
        x = w * single[n] + u * single[n + 3 * BLOCK] + v * single[n + 6 * BLOCK]
        y = w * single[n + BLOCK] + u * single[n + 4 * BLOCK] + v * single[n + 7 * BLOCK]
        z = w * single[n + 2 * BLOCK] + u * single[n + 5 * BLOCK] + v * single[n + 8 * BLOCK]
        gx, gy, gz = three(single, at.GX, k)
        square = x * x + y * y + z * z
        inverse = _ONE / math.sqrt(square if square > _ZERO else _ONE)
        inverse = -inverse if x * gx + y * gy + z * gz < _ZERO else inverse
        x, y, z = x * inverse, y * inverse, z * inverse
        away = (square == _ZERO) | (x * single[at.DX + k] + y * single[at.DY + k] + z * single[at.DZ + k] >= _ZERO)
        single[at.NX + k] = gx if away else x
        single[at.NY + k] = gy if away else y
        single[at.NZ + k] = gz if away else z
        smooth = (single[n] != _ZERO) | (single[n + BLOCK] != _ZERO) | (single[n + 2 * BLOCK] != _ZERO)
        single[at.SMOOTH + k] = _ONE if smooth else _ZERO


@stage_kernel
def up_to_smooth(single):
    """The way from a place in a face up to the smooth surface that the face stands for (Hanika 2021).

    The mean of the ways onto the tangent planes of the corners, where these lie above. A shadow ray from the face
    itself is stopped by the neighbouring faces wherever light grazes: a dark band with teeth.
    """
    for k in range(BLOCK):
        px, py, pz = three(single, at.PX, k)
        gx, gy, gz = three(single, at.GX, k)
        u, v = single[at.U + k], single[at.V + k]
        x0, y0, z0 = _up(single, at.NORMAL + k, at.CORNER + k, _ONE - u - v, px, py, pz, gx, gy, gz)
        x1, y1, z1 = _up(single, at.NORMAL + 3 * BLOCK + k, at.CORNER + 3 * BLOCK + k, u, px, py, pz, gx, gy, gz)
        x2, y2, z2 = _up(single, at.NORMAL + 6 * BLOCK + k, at.CORNER + 6 * BLOCK + k, v, px, py, pz, gx, gy, gz)
        x, y, z, smooth = x0 + x1 + x2, y0 + y1 + y2, z0 + z1 + z2, single[at.SMOOTH + k] > _ZERO
        single[at.AX + k], single[at.AY + k], single[at.AZ + k] = (
            x if smooth else _ZERO, y if smooth else _ZERO, z if smooth else _ZERO,
        )  # fmt: skip


@stage_kernel
def _up(single, n, p, share, px, py, pz, gx, gy, gz):
    """A share of the way up onto the tangent plane of the corner ``p`` with the normal ``n``, if it lies above."""
    nx, ny, nz = single[n], single[n + BLOCK], single[n + 2 * BLOCK]
    side = -_ONE if nx * gx + ny * gy + nz * gz < _ZERO else _ONE  # of a face seen from behind
    above = (px - single[p]) * nx + (py - single[p + BLOCK]) * ny + (pz - single[p + 2 * BLOCK]) * nz
    up = -share * side * min(side * above, _ZERO)
    return up * nx, up * ny, up * nz


@late_lane_kernel
def footprints(generation, first, lanes, _):
    """How far a ray's width reaches over the (u, v) of the images of its body."""
    g = value_at(generation)
    rays, surfaces, passage = g.rays, g.surfaces, g.passage
    single, whole = g.work.single, g.work.whole
    own = rays.widths.shape[0] > 0
    any_image = False
    for k in range(lanes):
        start = np.float64(rays.widths[first + k]) if own else passage.first_width
        single[at.WIDTH + k] = abs(start + passage.spread * np.float64(single[at.DISTANCE + k]))
        any_image |= surfaces.materials[whole[at.BODY + k], IMAGES] > 0.0
    if not any_image:
        return
    for k in range(BLOCK):
        c, t = at.CORNER + k, at.COORDINATE + k
        x, y, z = three_doubles(single, at.CORNER, k)
        u, v = single[t], single[t + BLOCK]
        dx, dy, dz = three_doubles(single, at.DX, k)
        gx, gy, gz = three_doubles(single, at.FACE_NORMAL, k)
        au, av, bu, bv = footprint(
            single[c + 3 * BLOCK] - x, single[c + 4 * BLOCK] - y, single[c + 5 * BLOCK] - z,
            single[c + 6 * BLOCK] - x, single[c + 7 * BLOCK] - y, single[c + 8 * BLOCK] - z,
            single[t + 2 * BLOCK] - u, single[t + 3 * BLOCK] - v,
            single[t + 4 * BLOCK] - u, single[t + 5 * BLOCK] - v,
            np.float64(single[at.WIDTH + k]), dx, dy, dz, gx, gy, gz,
        )  # fmt: skip
        single[at.AU + k], single[at.AV + k], single[at.BU + k], single[at.BV + k] = au, av, bu, bv
