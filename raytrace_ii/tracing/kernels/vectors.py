"""Vector helpers of all stages."""

from __future__ import annotations

import math

import numpy as np

from ii_core.base.jit import part_kernel, stage_kernel

from .lanes import BLOCK


@stage_kernel
def put(rows, i, x, y, z):
    rows[i, 0], rows[i, 1], rows[i, 2] = x, y, z


@stage_kernel
def interpolate(values, f, u, v):
    w = 1.0 - u - v
    return (
        w * values[f, 0, 0] + u * values[f, 1, 0] + v * values[f, 2, 0],
        w * values[f, 0, 1] + u * values[f, 1, 1] + v * values[f, 2, 1],
        w * values[f, 0, 2] + u * values[f, 1, 2] + v * values[f, 2, 2],
    )


@stage_kernel
def edge(corners, f, k):
    return (
        np.float64(corners[f, k, 0]) - corners[f, 0, 0],
        np.float64(corners[f, k, 1]) - corners[f, 0, 1],
        np.float64(corners[f, k, 2]) - corners[f, 0, 2],
    )


@stage_kernel
def pull_by(lift, one, ax, ay, az, bx, by, bz):
    """Share of the way to the middle of a face that is about as long as its lift, by its lift and two edges."""
    cx, cy, cz = bx - ax, by - ay, bz - az
    longest = max(ax * ax + ay * ay + az * az, max(bx * bx + by * by + bz * bz, cx * cx + cy * cy + cz * cz))
    return min(lift / math.sqrt(longest if longest > 0 else one), one / 4)


@stage_kernel
def start_point(corners, faces, f, u, v):
    """The hit point drawn a hair towards the middle of its face, for rays to start from.

    On an edge it would lie in the neighbouring face too, which a ray from there cannot meet: light would come in
    at the corners of a closed room.
    """
    u, v = float(u), float(v)
    ax, ay, az = edge(corners, f, 1)
    bx, by, bz = edge(corners, f, 2)
    pull = pull_by(float(faces[f, 3]), 1.0, ax, ay, az, bx, by, bz)
    return interpolate(corners, f, u + pull * (1.0 / 3.0 - u), v + pull * (1.0 / 3.0 - v))


@part_kernel
def behind(surfaces, f, u, v, entering):
    """A place just behind a face, seen along a ray that enters or leaves by it."""
    faces = surfaces.faces
    px, py, pz = start_point(surfaces.corners, faces, f, u, v)
    lift = -faces[f, 3] if entering else faces[f, 3]
    return px + lift * faces[f, 0], py + lift * faces[f, 1], pz + lift * faces[f, 2]


@stage_kernel
def put_behind(out, i, surfaces, f, u, v, entering):
    x, y, z = behind(surfaces, f, u, v, entering)
    put(out, i, x, y, z)


@stage_kernel
def three(values, first, k):
    """Three quantities of a lane that follow each other."""
    return values[first + k], values[first + BLOCK + k], values[first + 2 * BLOCK + k]


@stage_kernel
def three_of_row(rows, i):
    return rows[i, 0], rows[i, 1], rows[i, 2]


@stage_kernel
def three_doubles(values, first, k):
    """As `three`, of float32 to float64."""
    return (
        np.float64(values[first + k]),
        np.float64(values[first + BLOCK + k]),
        np.float64(values[first + 2 * BLOCK + k]),
    )
