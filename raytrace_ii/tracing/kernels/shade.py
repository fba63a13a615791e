"""Shading of one generation of rays, stage by stage over blocks."""

from __future__ import annotations

import math

import numpy as np

from ii_core.base.jit import late_kernel, part_kernel
from ii_core.base.jit import lean_kernel as kernel

from . import lanes as at
from .addresses import address_of, call, value_at
from .appearance import scatter, take_materials
from .attributes import flat_normals, gather, place, settle, smooth_normals, up_to_smooth
from .lanes import BLOCK, slot
from .light import cast, in_cone, towards_light
from .sky import background_colour
from .vectors import interpolate, put


@kernel
def shade(generation, stages):
    """Shade one generation of rays.

    Adds background, emitted and ambient light to ``radiance``; writes shadow rays with the light they would let
    through, and, if there is a stage for it, reflected and refracted rays; none weaker than ``passage.least``. Fog
    lies outside bodies, and before the sky not at all.
    """
    here, n = address_of(generation), generation.hits.faces.shape[0]
    lights, lit = generation.surroundings.lights, generation.lit
    single, double = generation.work.single, generation.work.double
    for first in range(0, n, BLOCK):
        lanes = gather(first, generation.hits, generation.rays, generation.surfaces, generation.work)
        if lanes > 0:
            if not generation.passage.placed:
                settle(single)
            place(single, double)
            if generation.surfaces.normals.shape[0] > 0:
                smooth_normals(single, double)
                up_to_smooth(single, double)
            else:
                flat_normals(double)
            if stages.footprints:
                call(stages.footprints, here, first, lanes, 0)
            if stages.attenuate:
                call(stages.attenuate, here, first, lanes, 0)
            if take_materials(lanes, generation.surfaces, generation.work):
                call(stages.look_closely, here, first, lanes, 0)
            scatter(generation.surroundings.ambient, double)
            for light in range(lights.shape[0]):
                towards_light(lights, light, single, double)
                in_cone(lights, light, double)
                start = light * n + lit[light]
                lit[light] += cast(
                    lanes, lights, light, generation.rays, generation.shadows, start, generation.work,
                    generation.counts,
                )  # fmt: skip
        if stages.sky_image:
            call(stages.sky_image, here, first, lanes, 0)
        add_light(first, stages.sky_image == 0, generation)
        if stages.record:
            call(stages.record, here, first, lanes, 0)
        if stages.spawn and lanes > 0:
            call(stages.spawn, here, first, lanes, 0)


@part_kernel
def add_light(first, gradient, generation):
    """Add light of the sky's gradient, of fog, and that given off or scattered from all around."""
    rays, radiance, background = generation.rays, generation.radiance, generation.surroundings.background
    double, whole, foggy = generation.work.double, generation.work.whole, generation.surroundings.fog.shape[0] > 0
    for j in range(min(BLOCK, generation.hits.faces.shape[0] - first)):
        i, k = np.uint64(first + j), whole[at.LANE + j]
        pixel = np.uint64(rays.pixels[i])
        if k >= 0:
            for c in range(3):
                if foggy:
                    radiance[pixel, c] += double[slot(at.F0 + c * BLOCK, k)]
                radiance[pixel, c] += double[slot(at.E0 + c * BLOCK, k)]
        elif gradient:
            b0, b1, b2 = background_colour(background, float(rays.directions[i, 1]))
            radiance[pixel, 0] += float(rays.weights[i, 0]) * b0
            radiance[pixel, 1] += float(rays.weights[i, 1]) * b1
            radiance[pixel, 2] += float(rays.weights[i, 2]) * b2


@late_kernel
def record(generation, first, lanes, _):
    """Note of each ray what support images want."""
    g = value_at(generation)
    hits, rays, surfaces, recorded = g.hits, g.rays, g.surfaces, g.recorded
    single, double, whole, eye, axis = g.work.single, g.work.double, g.work.whole, recorded.eye, recorded.axis
    for i in range(first, min(first + BLOCK, hits.faces.shape[0])):
        f, k, pixel = hits.faces[i], whole[at.LANE + i - first], rays.pixels[i]
        if recorded.ray_length.shape[0] > 0:
            recorded.ray_length[pixel] = single[at.DISTANCE + k] if f >= 0 else math.nan
        if recorded.object_id.shape[0] > 0:
            recorded.object_id[pixel] = surfaces.object_of_face[f] if f >= 0 else -1
        if recorded.normal.shape[0] > 0:
            for c in range(3):
                recorded.normal[pixel, c] = surfaces.faces[f, c] if f >= 0 else 0.0
        if recorded.depth.shape[0] > 0:
            if f >= 0:
                x, y, z = interpolate(surfaces.corners, f, float(single[at.U + k]), float(single[at.V + k]))
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
