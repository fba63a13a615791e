"""Shading of one generation of rays, stage by stage over blocks."""

from __future__ import annotations

import math

import numpy as np

from ii_core.jit import lean_kernel as kernel
from ii_core.jit import part_kernel, stage_kernel

from . import lanes as at
from .appearance import attenuate, look
from .attributes import flat_normals, footprints, gather, place, smooth_normals, up_to_smooth
from .lanes import BLOCK
from .light import cast, in_cone, towards_light
from .sky import sky_colour
from .spawn import spawn_rays
from .vectors import interpolate, put


@kernel
def shade(
    hits, rays, surfaces, surroundings, passage, recorded, radiance, shadows, following, counts, lit, work
):  # fmt: skip
    """Shade one generation of rays.

    Adds background, emitted and ambient light to ``radiance``; writes shadow rays with the light they would let
    through, n rows for each light, and, if ``passage.spawn``, reflected and refracted rays; none weaker than
    ``passage.least``. Fog lies outside bodies, and before the sky not at all.

    Returns
    -------
    spawned : int
        How many rows of ``following`` were filled; ``lit`` is how many of each light's shadow rays.
    """
    n, spawned = hits.faces.shape[0], np.int64(0)  # a literal would be another signature of all that takes it
    lights, single, double = surroundings.lights, work.single, work.double
    filtering = passage.first_width != 0.0 or passage.spread != 0.0
    for first in range(0, n, BLOCK):
        lanes = gather(first, hits, rays, surfaces, work)
        if lanes > 0:
            place(single, double)
            if surfaces.normals.shape[0] > 0:
                smooth_normals(single, double)
                up_to_smooth(single, double)
            else:
                flat_normals(double)
            if filtering:
                footprints(lanes, rays, surfaces, passage, work)
            attenuate(lanes, rays, surfaces, surroundings.fog, work)
            look(lanes, surfaces, surroundings, passage, filtering, work)
            for light in range(lights.shape[0]):
                towards_light(lights, light, single, double)
                in_cone(lights, light, double)
                lit[light] += cast(lanes, lights, light, rays, shadows, light * n + lit[light], work, counts)
        _add_light(first, n, rays, surfaces, surroundings, passage, radiance, work)
        if recorded.wanted:
            _record(first, n, hits, rays, surfaces, recorded, work)
        if passage.spawn and lanes > 0:
            spawned = spawn_rays(lanes, rays, surfaces, passage, following, spawned, work, counts)
    return spawned


@stage_kernel
def _add_light(first, n, rays, surfaces, surroundings, passage, radiance, work):
    """Add light of the sky, of fog, and that given off or scattered from all around, in the order of the rays."""
    double, whole = work.double, work.whole
    foggy = surroundings.fog.shape[0] > 0
    for j in range(min(BLOCK, n - first)):
        i, k = np.uint64(first + j), whole[at.LANE + j]
        pixel = np.uint64(rays.pixels[i])
        if k < 0:
            b0, b1, b2 = sky_colour(
                surroundings.background, surfaces.textures, surfaces.texels, float(rays.directions[i, 0]),
                float(rays.directions[i, 1]), float(rays.directions[i, 2]), passage.spread,
            )  # fmt: skip
            radiance[pixel, 0] += float(rays.weights[i, 0]) * b0
            radiance[pixel, 1] += float(rays.weights[i, 1]) * b1
            radiance[pixel, 2] += float(rays.weights[i, 2]) * b2
            continue
        for c in range(3):
            if foggy:
                radiance[pixel, c] += double[at.F0 + c * BLOCK + k]
            radiance[pixel, c] += double[at.E0 + c * BLOCK + k]


@part_kernel
def _record(first, n, hits, rays, surfaces, recorded, work):
    """Note of each ray what support images want."""
    double, whole, eye, axis = work.double, work.whole, recorded.eye, recorded.axis
    for i in range(first, min(first + BLOCK, n)):
        f, k, pixel = hits.faces[i], whole[at.LANE + i - first], rays.pixels[i]
        if recorded.ray_length.shape[0] > 0:
            recorded.ray_length[pixel] = hits.distances[i] if f >= 0 else math.nan
        if recorded.object_id.shape[0] > 0:
            recorded.object_id[pixel] = surfaces.object_of_face[f] if f >= 0 else -1
        if recorded.normal.shape[0] > 0:
            for c in range(3):
                recorded.normal[pixel, c] = surfaces.faces[f, c] if f >= 0 else 0.0
        if recorded.depth.shape[0] > 0:
            if f >= 0:
                x, y, z = interpolate(surfaces.corners, f, float(hits.u[i]), float(hits.v[i]))
                recorded.depth[pixel] = (x - eye[0]) * axis[0] + (y - eye[1]) * axis[1] + (z - eye[2]) * axis[2]
            else:
                recorded.depth[pixel] = math.nan
        if recorded.shading_normal.shape[0] > 0:
            if f >= 0:
                side = double[at.ENTERING + k]
                put(
                    recorded.shading_normal,
                    pixel,
                    side * double[at.NX + k],
                    side * double[at.NY + k],
                    side * double[at.NZ + k],
                )
            else:
                put(recorded.shading_normal, pixel, 0.0, 0.0, 0.0)
