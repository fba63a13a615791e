"""Passage of rays through transparent, hidden and cut-out faces."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ii_core.base.jit import lean_kernel as kernel
from ii_core.base.jit import stage_kernel

from .light import move
from .media import cross, enter, fresnel, leave, media_at, medium_of, refractive_index, transmits
from .tables import ABSORPTION, ALPHA_BLEND, FAR, LEAST_WEIGHT, TRANSMISSION
from .textures import is_cut_out, share_there
from .vectors import put, put_behind


class Crossing(NamedTuple):
    """The next face on the way of a shadow ray.

    ``free`` is the share of the light that a blended surface leaves free, ``solid`` says that the rest goes nowhere,
    ``clear`` that it goes through. At a face that is cut out all goes on.
    """

    face: Any
    body: Any
    entering: bool
    solid: bool
    clear: bool
    free: float


@kernel
def pass_faces(found, rows, hits, directions, inside, surfaces, onward):
    """Let rays pass the faces that are not there: cut out by alpha, or hidden in a body of higher priority.

    ``found`` are hits of the rays ``rows``, or of all if it is of no length; they are entered in the table ``hits``,
    from the ray's start. Rays that pass go into ``onward``.

    Returns
    -------
    int
        How many rays pass.
    """
    count = 0
    for j in range(found.faces.shape[0]):
        i = j
        if rows.shape[0] > 0:
            i = rows[j]
            hits.faces[i], hits.u[i], hits.v[i] = found.faces[j], found.u[j], found.v[j]
            hits.distances[i] += found.distances[j]
        f = hits.faces[i]
        if f < 0:
            continue
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        entering = surfaces.faces[f, 0] * dx + surfaces.faces[f, 1] * dy + surfaces.faces[f, 2] * dz < 0.0
        if _passes(surfaces, f, hits.u[i], hits.v[i], inside, i, entering):
            put_behind(onward.origins, count, surfaces, f, hits.u[i], hits.v[i], entering)
            put(onward.directions, count, dx, dy, dz)
            onward.rows[count] = i
            count += 1
    return count


@stage_kernel
def _passes(surfaces, f, u, v, inside, i, entering):
    """Return whether a face is not there; note the body whose hidden face a ray passes."""
    body = surfaces.object_of_face[f]
    if is_cut_out(surfaces, body, f, u, v):
        return True
    if not transmits(surfaces.materials, body):
        return False
    before, after = media_at(inside, i, surfaces.materials, body, entering)
    if before != after:
        return False
    cross(inside, i, body, entering)
    return True


@kernel
def pass_clear_face(hits, rays, surfaces, first_clear, radiance):
    """Take shadow rays through the next transmissive or cut-out face: coloured shadows.

    A ray that met no face arrives and its light is added; the others are dimmed by Fresnel, colour and absorption,
    moved behind the face and kept, packed to the front. Light goes straight on: no caustics. Its angle in each body
    is that of Snell's law all the same, from the straight ray's angle to the face in air: parallel faces take what
    they would take of the bent ray.

    Returns
    -------
    int
        How many rays were kept.
    """
    kept = 0
    for i in range(hits.faces.shape[0]):
        dx, dy, dz = (
            np.float64(rays.directions[i, 0]), np.float64(rays.directions[i, 1]), np.float64(rays.directions[i, 2]),
        )  # fmt: skip
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        met = hits.faces[i] >= 0
        at = Crossing(-1, -1, False, False, False, 0.0)
        if met:
            at = _crossing(surfaces, hits.faces[i] + first_clear, hits.u[i], hits.v[i], dx, dy, dz)
        if at.solid and at.free == 0.0:
            continue
        if at.clear and not at.entering:
            enter(rays.inside, i, at.body)
        way = min(float(hits.distances[i]), rays.reach[i]) if met else rays.reach[i]
        _absorb(rays.colours, i, surfaces.materials, medium_of(rays.inside, i, surfaces.materials, -1), way, length)
        if not met:
            for c in range(3):
                radiance[rays.pixels[i], c] += rays.colours[i, c]
            continue
        if _dim(rays.colours, i, surfaces, at, rays.inside, dx, dy, dz, length) >= LEAST_WEIGHT:
            move(rays, i, kept)
            if at.clear:
                cross(rays.inside, kept, at.body, at.entering)
            put_behind(rays.origins, kept, surfaces, at.face, hits.u[i], hits.v[i], at.entering)
            # A point light's direction ends at the light: what is left of it, as a share of the same direction.
            rays.reach[kept] = rays.reach[kept] - hits.distances[i] if rays.reach[kept] < FAR else FAR
            kept += 1
    return kept


@stage_kernel
def _crossing(surfaces, f, u, v, dx, dy, dz):
    """Return what a shadow ray meets at a place of a face."""
    body = np.int64(surfaces.object_of_face[f])
    entering = surfaces.faces[f, 0] * dx + surfaces.faces[f, 1] * dy + surfaces.faces[f, 2] * dz < 0.0
    there = not is_cut_out(surfaces, body, f, u, v)
    free = 0.0
    if there and surfaces.materials[body, ALPHA_BLEND] > 0.0:
        free = 1.0 - share_there(surfaces, body, f, u, v, 0.0, 0.0, 0.0, 0.0)
    clear = there and transmits(surfaces.materials, body)
    return Crossing(f, body, entering, there and not clear, clear, free)


@stage_kernel
def _absorb(colours, i, materials, medium, way, length):
    """Dim a ray by the medium of its way, in lengths of its direction."""
    if medium >= 0 and way < FAR:
        for c in range(3):
            colours[i, c] *= math.exp(-materials[medium, ABSORPTION + c] * way * length)


@stage_kernel
def _dim(colours, i, surfaces, at, inside, dx, dy, dz, length):
    """Dim a ray by the face that it crosses; return its strongest colour."""
    materials = surfaces.materials
    strongest = 0.0
    before, after = -1, -1
    if at.clear:
        before, after = media_at(inside, i, materials, at.body, at.entering)
    for c in range(3):
        through = 0.0 if at.solid else 1.0
        if before != after:
            through = materials[at.body, TRANSMISSION + c] * (
                1.0 - _straight_reflectance(materials, before, after, c, surfaces.faces, at.face, dx, dy, dz, length)
            )
        colours[i, c] *= at.free + (1.0 - at.free) * through
        strongest = max(strongest, colours[i, c])
    return strongest


@stage_kernel
def _straight_reflectance(materials, before, after, c, faces, f, dx, dy, dz, length):
    """Return the Fresnel reflectance of a face for light that passes unrefracted, at its angle in air."""
    cosine = (faces[f, 0] * dx + faces[f, 1] * dy + faces[f, 2] * dz) / length
    n1, n2 = refractive_index(materials, before, c), refractive_index(materials, after, c)
    within = 1.0 - (1.0 - cosine * cosine) / (n1 * n1)
    return fresnel(math.sqrt(within), n1 / n2)[0] if within > 0.0 else 1.0


@kernel
def start_inside(origins, bounds, first_body, out_rows, out_candidates):
    """Rays that start within the bounds (B, 2, 3) of bodies, and these bodies, −1 after the last.

    Returns
    -------
    int
        How many rays there are.
    """
    count = 0
    for i in range(origins.shape[0]):
        x, y, z = origins[i, 0], origins[i, 1], origins[i, 2]
        found = 0
        for b in range(bounds.shape[0]):
            if (
                bounds[b, 0, 0] <= x <= bounds[b, 1, 0]
                and bounds[b, 0, 1] <= y <= bounds[b, 1, 1]
                and bounds[b, 0, 2] <= z <= bounds[b, 1, 2]
                and found < out_candidates.shape[1]
            ):
                out_candidates[count, found] = first_body + b
                found += 1
        if found:
            for j in range(found, out_candidates.shape[1]):
                out_candidates[count, j] = -1
            out_rows[count] = i
            count += 1
    return count


@kernel
def tell_inside(hits, rows, candidates, origins, directions, inside, surfaces, first_clear):
    """Tell by the first face of each candidate along a ray whether it starts inside: there the ray leaves the body.

    Rays with candidates left are moved behind the face and kept, packed to the front. A body left later was
    entered earlier: it stands before the others in ``inside``.

    Returns
    -------
    int
        How many rays were kept.
    """
    kept = 0
    for i in range(hits.faces.shape[0]):
        if hits.faces[i] < 0:
            continue
        f = hits.faces[i] + first_clear
        body, faces = surfaces.object_of_face[f], surfaces.faces
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        entering = faces[f, 0] * dx + faces[f, 1] * dy + faces[f, 2] * dz < 0.0
        row, was = rows[i], candidates.shape[1]
        for j in range(candidates.shape[1]):
            candidates[kept, j] = candidates[i, j]
            if candidates[kept, j] == body:
                was = j
        if was < candidates.shape[1]:
            leave(candidates, kept, body)
            if not entering:
                for j in range(inside.shape[1] - 1, 0, -1):
                    inside[row, j] = inside[row, j - 1]
                inside[row, 0] = body
        if candidates[kept, 0] < 0:
            continue
        rows[kept] = row
        put_behind(origins, kept, surfaces, f, hits.u[i], hits.v[i], entering)
        put(directions, kept, dx, dy, dz)
        kept += 1
    return kept
