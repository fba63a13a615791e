"""Attributes of hits, computed for all lanes of a block: position, flat and smooth normal, footprint."""

from __future__ import annotations

import math

import numpy as np

from ii_core.base.jit import exact_stage_kernel, late_kernel, stage_kernel

from . import lanes as at
from .addresses import value_at
from .lanes import BLOCK, slot
from .packets import place_hit
from .tables import IMAGES
from .textures import footprint
from .vectors import three, three_doubles

_5, _9 = np.uint64(5), np.uint64(9)


@stage_kernel
def gather(first, hits, rays, surfaces, work):
    """Bring the hits of a block of rays to lanes.

    Returns
    -------
    lanes : int
        How many of the rays hit something.
    """
    single, whole = work.single, work.whole
    corners, faces, normals = surfaces.flat_corners, surfaces.flat_faces, surfaces.flat_normals
    last = min(first + BLOCK, hits.faces.shape[0])
    smooth = normals.shape[0] > 0
    lanes = 0
    for k in range(last - first):
        i = np.uint64(first + k)
        face = hits.faces[i]
        whole[at.LANE + k] = lanes if face >= 0 else -1
        if face < 0:
            continue
        f = np.uint64(face)  # unsigned indices into one dimension: numba need not look for negative ones
        whole[slot(at.ROW, lanes)], whole[slot(at.FACE, lanes)] = first + k, face
        whole[slot(at.BODY, lanes)] = surfaces.object_of_face[f]
        single[slot(at.U, lanes)], single[slot(at.V, lanes)] = hits.u[i], hits.v[i]
        single[slot(at.DISTANCE, lanes)] = hits.distances[i]
        for c in range(3):
            single[slot(at.START + c * BLOCK, lanes)] = rays.origins[i, c]
            single[slot(at.DX + c * BLOCK, lanes)] = rays.directions[i, c]
            single[slot(at.WEIGHT + c * BLOCK, lanes)] = rays.weights[i, c]
        for c in range(5):
            single[slot(at.FACE_NORMAL + c * BLOCK, lanes)] = faces[f * _5 + np.uint64(c)]
        for c in range(9):
            single[slot(at.CORNER + c * BLOCK, lanes)] = corners[f * _9 + np.uint64(c)]
        if smooth:
            for c in range(9):
                single[slot(at.NORMAL + c * BLOCK, lanes)] = normals[f * _9 + np.uint64(c)]
        lanes += 1
    return lanes


@exact_stage_kernel
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
def place(single, double):
    """Hit points, normals on the ray's side, places to start from, and weights."""
    for k in range(BLOCK):
        u, v, pull = np.float64(single[at.U + k]), np.float64(single[at.V + k]), np.float64(single[at.PULL + k])
        u, v = u + pull * (1.0 / 3.0 - u), v + pull * (1.0 / 3.0 - v)
        w = 1.0 - u - v
        c = at.CORNER + k
        px = w * single[c] + u * single[c + 3 * BLOCK] + v * single[c + 6 * BLOCK]
        py = w * single[c + BLOCK] + u * single[c + 4 * BLOCK] + v * single[c + 7 * BLOCK]
        pz = w * single[c + 2 * BLOCK] + u * single[c + 5 * BLOCK] + v * single[c + 8 * BLOCK]
        g = at.FACE_NORMAL + k
        gx, gy, gz = np.float64(single[g]), np.float64(single[g + BLOCK]), np.float64(single[g + 2 * BLOCK])
        lift = np.float64(single[at.LIFT + k])
        entering = gx * single[at.DX + k] + gy * single[at.DY + k] + gz * single[at.DZ + k] < 0.0
        side = 1.0 if entering else -1.0
        gx, gy, gz = side * gx, side * gy, side * gz
        double[at.PX + k], double[at.PY + k], double[at.PZ + k] = px, py, pz
        double[at.GX + k], double[at.GY + k], double[at.GZ + k] = gx, gy, gz
        double[at.OX + k], double[at.OY + k], double[at.OZ + k] = px + lift * gx, py + lift * gy, pz + lift * gz
        double[at.ENTERING + k] = side
        double[at.W0 + k] = single[at.WEIGHT + k]
        double[at.W1 + k] = single[at.WEIGHT + BLOCK + k]
        double[at.W2 + k] = single[at.WEIGHT + 2 * BLOCK + k]


@stage_kernel
def flat_normals(double):
    """Shade by the normals of the faces."""
    for k in range(BLOCK):
        double[at.NX + k], double[at.NY + k], double[at.NZ + k] = (
            double[at.GX + k],
            double[at.GY + k],
            double[at.GZ + k],
        )
        double[at.SMOOTH + k] = 0.0
        double[at.AX + k], double[at.AY + k], double[at.AZ + k] = 0.0, 0.0, 0.0


@stage_kernel
def smooth_normals(single, double):
    """Interpolated vertex normals on the ray's side, or the face's own where there is none or it faces away."""
    for k in range(BLOCK):
        u, v = np.float64(single[at.U + k]), np.float64(single[at.V + k])
        w = 1.0 - u - v
        n = at.NORMAL + k
        x = w * single[n] + u * single[n + 3 * BLOCK] + v * single[n + 6 * BLOCK]
        y = w * single[n + BLOCK] + u * single[n + 4 * BLOCK] + v * single[n + 7 * BLOCK]
        z = w * single[n + 2 * BLOCK] + u * single[n + 5 * BLOCK] + v * single[n + 8 * BLOCK]
        gx, gy, gz = three(double, at.GX, k)
        length = math.sqrt(x * x + y * y + z * z)
        inverse = 1.0 / (length if length > 0.0 else 1.0)
        inverse = -inverse if x * gx + y * gy + z * gz < 0.0 else inverse
        x, y, z = x * inverse, y * inverse, z * inverse
        away = (length == 0.0) | (x * single[at.DX + k] + y * single[at.DY + k] + z * single[at.DZ + k] >= 0.0)
        double[at.NX + k] = gx if away else x
        double[at.NY + k] = gy if away else y
        double[at.NZ + k] = gz if away else z
        smooth = (single[n] != 0.0) | (single[n + BLOCK] != 0.0) | (single[n + 2 * BLOCK] != 0.0)
        double[at.SMOOTH + k] = 1.0 if smooth else 0.0


@stage_kernel
def up_to_smooth(single, double):
    """The way from a place in a face up to the smooth surface that the face stands for (Hanika 2021).

    The mean of the ways onto the tangent planes of the corners, where these lie above. A shadow ray from the face
    itself is stopped by the neighbouring faces wherever light grazes: a dark band with teeth.
    """
    for k in range(BLOCK):
        px, py, pz = three(double, at.PX, k)
        gx, gy, gz = three(double, at.GX, k)
        u, v = np.float64(single[at.U + k]), np.float64(single[at.V + k])
        x, y, z = 0.0, 0.0, 0.0
        for c in range(3):
            share = 1.0 - u - v if c == 0 else (u if c == 1 else v)
            n, p = at.NORMAL + 3 * c * BLOCK + k, at.CORNER + 3 * c * BLOCK + k
            nx, ny, nz = np.float64(single[n]), np.float64(single[n + BLOCK]), np.float64(single[n + 2 * BLOCK])
            side = -1.0 if nx * gx + ny * gy + nz * gz < 0.0 else 1.0  # of a face seen from behind
            above = (px - single[p]) * nx + (py - single[p + BLOCK]) * ny + (pz - single[p + 2 * BLOCK]) * nz
            up = share * side * min(side * above, 0.0)
            x, y, z = x - up * nx, y - up * ny, z - up * nz
        smooth = double[at.SMOOTH + k] > 0.0
        double[at.AX + k], double[at.AY + k], double[at.AZ + k] = (
            x if smooth else 0.0, y if smooth else 0.0, z if smooth else 0.0,
        )  # fmt: skip


@late_kernel
def footprints(generation, first, lanes, _):
    """How far a ray's width reaches over the (u, v) of the images of its body."""
    g = value_at(generation)
    rays, surfaces, passage = g.rays, g.surfaces, g.passage
    single, double, whole = g.work.single, g.work.double, g.work.whole
    own = rays.widths.shape[0] > 0
    any_image = False
    for k in range(lanes):
        f = whole[at.FACE + k]
        start = np.float64(rays.widths[whole[at.ROW + k]]) if own else passage.first_width
        double[at.WIDTH + k] = abs(start + passage.spread * np.float64(single[at.DISTANCE + k]))
        if surfaces.materials[whole[at.BODY + k], IMAGES] > 0.0:
            any_image = True
            for c in range(6):
                single[at.COORDINATE + c * BLOCK + k] = surfaces.coordinates[f, c // 2, c % 2]
    if not any_image:
        return
    for k in range(BLOCK):
        c, t = at.CORNER + k, at.COORDINATE + k
        x, y, z = np.float64(single[c]), np.float64(single[c + BLOCK]), np.float64(single[c + 2 * BLOCK])
        u, v = single[t], single[t + BLOCK]
        dx, dy, dz = three_doubles(single, at.DX, k)
        gx, gy, gz = three_doubles(single, at.FACE_NORMAL, k)
        au, av, bu, bv = footprint(
            single[c + 3 * BLOCK] - x, single[c + 4 * BLOCK] - y, single[c + 5 * BLOCK] - z,
            single[c + 6 * BLOCK] - x, single[c + 7 * BLOCK] - y, single[c + 8 * BLOCK] - z,
            single[t + 2 * BLOCK] - u, single[t + 3 * BLOCK] - v,
            single[t + 4 * BLOCK] - u, single[t + 5 * BLOCK] - v,
            double[at.WIDTH + k], dx, dy, dz, gx, gy, gz,
        )  # fmt: skip
        double[at.AU + k], double[at.AV + k], double[at.BU + k], double[at.BV + k] = au, av, bu, bv
