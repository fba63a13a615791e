"""The way of a packet of rays: start, hit, attributes, appearance, lights, radiance, all in the first cache."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np

from ii_core.base.jit import lane_kernel as kernel
from ii_core.base.jit import lane_stage as stage_kernel
from ii_core.base.jit import late_kernel

from . import lanes as at
from .addresses import address_of, call, ticks, value_at
from .appearance import scatter, take_materials
from .attributes import (
    flat_normals,
    place,
    settle,
    smooth_normals,
    take_faces,
    take_hits,
    take_rays,
    up_to_smooth,
)
from .columns import NUMBERS, TOLD, tell
from .lanes import BLOCK
from .light import add_free, in_cone, keep_rays, lift_rays, set_aside, take_left, towards_light, weigh
from .packets import nearest_of_lanes, occluded_of_lanes
from .sky import add_background
from .start import start_lanes
from .tables import EMBREE_TICKS, SHADOW, SHADOW_PACKETS, TICKS, UNTESTED
from .vectors import interpolate, put

_ZERO, _TIMED = np.float32(0), np.int64(8 * BLOCK - 1)  # every eighth packet is timed
# After so many rays, shadow packets that have fewer lanes than this share are filled up with those of other packets:
# as arrays, later. So are 79 % of the lanes of *Hairdo*, 93 of *Cuboid*, 96 of *Apples* (full `setup1`, 2026-11-25).
_TRIED, _SPARSE = 4096, 0.85
_FEW = 10  # a packet with fewer unknown shadow rays goes through arrays, which fill packets up


@cache
def way_kernel(width: int) -> Any:
    """The kernel that traces and shades rays, for a CPU on which Embree's packets have so many."""

    @kernel
    def follow(generation, stages):
        """Trace and shade one generation of rays.

        Adds background, emitted and ambient light and that of lamps to ``radiance``; writes, if there is a stage for
        it, reflected and refracted rays; none weaker than ``passage.least``. Shadow rays that may pass through clear
        bodies, or that Embree cannot be called for, are written to ``shadows``. Fog lies outside bodies, and before
        the sky not at all.
        """
        g, wide, ahead = generation, np.int64(width), _ZERO
        here, n = address_of(generation), g.rays.pixels.shape[0]
        single, whole = g.work.single, g.work.whole
        found, later = g.hits.faces.shape[0] > 0, g.passage.later
        g.counts[UNTESTED] = g.tools.occluded.packet == 0
        for first in range(0, n, BLOCK):
            lanes, timed = min(BLOCK, n - first), first & _TIMED == 0
            start = ticks() if timed else 0
            if g.start.rows.shape[0] > 0:
                start_lanes(first, lanes, g.start, g.work)
            else:
                take_rays(first, lanes, g.rays, single)
            if found:
                take_hits(first, lanes, g.hits, single, whole)
            else:
                before = ticks() if timed else 0
                ahead = nearest_of_lanes(g.tools, g.first_of_same, ahead, lanes, g.work, wide)
                g.counts[EMBREE_TICKS] += ticks() - before if timed else 0
            hits = take_faces(g.surfaces, single, whole)
            for k in range(3 * BLOCK):
                single[at.L0 + k] = _ZERO
            if hits > 0:
                appear(g, here, stages, first, lanes)
                light_up(g, first, lanes, timed, later, wide)
            if hits < lanes:
                if stages.sky_image:
                    call(stages.sky_image, here, first, lanes, 0)
                else:
                    add_background(g.surroundings.background, single)
            for k in range(lanes):
                pixel = np.uint64(g.rays.pixels[first + k])
                g.radiance[pixel, 0] += single[at.L0 + k]
                g.radiance[pixel, 1] += single[at.L1 + k]
                g.radiance[pixel, 2] += single[at.L2 + k]
            if stages.record:
                call(stages.record, here, first, lanes, 0)
            if stages.spawn and hits > 0:
                call(stages.spawn, here, first, lanes, 0)
            g.counts[TICKS] += ticks() - start if timed else 0
            if first == _TRIED and not later and g.counts[SHADOW] < _SPARSE * BLOCK * g.counts[SHADOW_PACKETS]:
                later, g.counts[UNTESTED] = True, 1

    return follow


@stage_kernel
def appear(g, here, stages, first, lanes):
    """Place the hits of a packet, and give them normals and colours."""
    single = g.work.single
    if not g.passage.placed:
        settle(single)
    place(single)
    if g.surfaces.smooth:
        smooth_normals(single)
        up_to_smooth(single)
    else:
        flat_normals(single)
    if stages.footprints:
        call(stages.footprints, here, first, lanes, 0)
    if stages.attenuate:
        call(stages.attenuate, here, first, lanes, 0)
    if take_materials(g.surfaces, g.work):
        call(stages.look_closely, here, first, lanes, 0)
    scatter(g.surroundings.ambient, single)
    if g.surroundings.fog.shape[0] > 0:
        for k in range(3 * BLOCK):
            single[at.L0 + k] += single[at.F0 + k]


@stage_kernel
def light_up(g, first, lanes, timed, later, wide):
    """Add the light of all lamps that reaches the hits of a packet, or write the rays that tell."""
    single, lights = g.work.single, g.surroundings.lights
    for light in range(lights.shape[0]):
        towards_light(lights, light, single)
        in_cone(lights, light, single)
        if weigh(lights, light, single, g.counts) == 0:
            continue
        g.counts[SHADOW_PACKETS] += 1
        few = False
        if g.columns.size > 0 and g.columns.turns[NUMBERS * light + TOLD] > _ZERO:
            unknown = tell_light(g, light, first, lanes)
            if unknown == 0:
                continue
            few = (unknown < _FEW) & (not later)
        lift_rays(lights, light, single)
        if g.counts[UNTESTED] == 0 and not few:
            before = ticks() if timed else 0
            calls, clear = g.tools.occluded, later and g.tools.clear.packet != 0
            for test in range(1 + clear):  # one call of a part that is inlined: two would be compiled
                if test == 1:
                    calls = g.tools.clear
                    set_aside(first, lanes, g.rays, single)
                occluded_of_lanes(g.tools, calls, g.work, wide)
            if clear:
                add_free(single)
                take_left(single)
            g.counts[EMBREE_TICKS] += ticks() - before if timed else 0
        if later or few:
            row = light * g.rays.pixels.shape[0] + g.lit[light]
            g.lit[light] += keep_rays(lanes, first, g.rays, g.shadows, row, single)
        else:
            add_free(single)


@stage_kernel
def tell_light(g, light, first, lanes):
    """Add the light of one lamp where it is known to arrive; want the unknown rays alone, and return how many.

    Rays that start in a body are dimmed there: they are unknown.
    """
    single, inside = g.work.single, 0
    if g.rays.inside.shape[1] > 0:
        for k in range(lanes):
            inside += g.rays.inside[np.uint64(first + k), 0] >= 0
    if inside > 0:
        return BLOCK
    unknown = tell(g.columns, light, single)
    add_free(single)
    for k in range(BLOCK):
        single[at.WANTED + k] = single[at.LEFT + k]
    return unknown


@late_kernel
def record(generation, first, lanes, _):
    """Note of each ray what support images want."""
    g = value_at(generation)
    surfaces, recorded = g.surfaces, g.recorded
    single, whole, eye, axis = g.work.single, g.work.whole, recorded.eye, recorded.axis
    for k in range(lanes):
        f, pixel = whole[at.FACE + k], g.rays.pixels[first + k]
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
            side = single[at.ENTERING + k] if f >= 0 else _ZERO
            put(
                recorded.shading_normal, pixel,
                side * single[at.NX + k], side * single[at.NY + k], side * single[at.NZ + k],
            )  # fmt: skip
