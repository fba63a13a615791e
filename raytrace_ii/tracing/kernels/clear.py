"""Passage of rays through transparent, hidden and cut-out faces."""

from __future__ import annotations

import math

import numpy as np

from ii_core.base.jit import lean_kernel as kernel
from ii_core.base.jit import stage_kernel

from .fresnel import fresnel
from .media import cross, enter, leave, media_at, medium_of, refractive_index, transmits
from .tables import ABSORPTION, ALPHA_BLEND, FAR, LEAST_WEIGHT, TRANSMISSION
from .textures import is_cut_out, share_there
from .vectors import put, put_behind


@kernel
def pass_faces(
    found, found_u, found_v, found_distances, rows, primitives, u, v, distances, directions, inside,
    corners, faces, coordinates, object_of_face, materials, textures, alphas,
    out_origins, out_directions, out_rows,
):  # fmt: skip
    """Let rays pass the faces that are not there: cut out by alpha, or hidden in a body of higher priority.

    ``found`` are hits of the rays ``rows``, or of all if it is of no length; they are entered in the table of hits
    ``primitives``, ``u``, ``v``, ``distances``, from the ray's start. Rays that pass go into the ``out_`` arrays.

    Returns
    -------
    int
        How many rays pass.
    """
    count = 0
    for j in range(found.shape[0]):
        i = j
        if rows.shape[0] > 0:
            i = rows[j]
            primitives[i], u[i], v[i] = found[j], found_u[j], found_v[j]
            distances[i] += found_distances[j]
        f = primitives[i]
        if f < 0:
            continue
        body = object_of_face[f]
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        entering = faces[f, 0] * dx + faces[f, 1] * dy + faces[f, 2] * dz < 0.0
        if not is_cut_out(coordinates, textures, alphas, materials, body, f, u[i], v[i]):
            if not transmits(materials, body):
                continue
            before, after = media_at(inside, i, materials, body, entering)
            if before != after:
                continue
            cross(inside, i, body, entering)
        put_behind(out_origins, count, corners, faces, f, u[i], v[i], entering)
        put(out_directions, count, dx, dy, dz)
        out_rows[count] = i
        count += 1
    return count


@kernel
def pass_clear_face(
    primitives, u, v, distances, origins, directions, reach, colours, pixels, inside,
    corners, faces, coordinates, object_of_face, materials, textures, alphas, first_clear, radiance,
):  # fmt: skip
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
    for i in range(primitives.shape[0]):
        dx, dy, dz = np.float64(directions[i, 0]), np.float64(directions[i, 1]), np.float64(directions[i, 2])
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        hit = primitives[i] >= 0
        f = primitives[i] + first_clear
        body = object_of_face[f] if hit else -1
        entering = hit and faces[f, 0] * dx + faces[f, 1] * dy + faces[f, 2] * dz < 0.0
        there = hit and not is_cut_out(coordinates, textures, alphas, materials, body, f, u[i], v[i])
        past = 0.0  # the share that the body leaves free
        if there and materials[body, ALPHA_BLEND] > 0.0:
            past = 1.0 - share_there(
                coordinates, textures, alphas, materials, body, f, u[i], v[i], 0.0, 0.0, 0.0, 0.0
            )
        clear = there and transmits(materials, body)
        if there and past == 0.0 and not clear:
            continue
        if clear and not entering:
            enter(inside, i, body)
        way = min(float(distances[i]), reach[i]) if hit else reach[i]
        medium = medium_of(inside, i, materials, -1)
        if medium >= 0 and way < FAR:
            for c in range(3):
                colours[i, c] *= math.exp(-materials[medium, ABSORPTION + c] * way * length)
        if not hit:
            for c in range(3):
                radiance[pixels[i], c] += colours[i, c]
            continue
        strongest = 0.0
        before, after = -1, -1
        if clear:
            before, after = media_at(inside, i, materials, body, entering)
        for c in range(3):
            through = 0.0 if there and not clear else 1.0
            if before != after:
                through = materials[body, TRANSMISSION + c] * (
                    1.0 - _straight_reflectance(materials, before, after, c, faces, f, dx, dy, dz, length)
                )
            colours[i, c] *= past + (1.0 - past) * through
            colours[kept, c] = colours[i, c]
            strongest = max(strongest, colours[kept, c])
        if strongest < LEAST_WEIGHT:
            continue
        for j in range(inside.shape[1]):
            inside[kept, j] = inside[i, j]
        if clear:
            cross(inside, kept, body, entering)
        put_behind(origins, kept, corners, faces, f, u[i], v[i], entering)
        put(directions, kept, dx, dy, dz)
        # A point light's direction ends at the light: what is left of it, as a share of the same direction.
        reach[kept] = reach[i] - distances[i] if reach[i] < FAR else FAR
        pixels[kept] = pixels[i]
        kept += 1
    return kept


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
def tell_inside(
    primitives, u, v, rows, candidates, origins, directions, inside, corners, faces, object_of_face, first_clear
):
    """Tell by the first face of each candidate along a ray whether it starts inside: there the ray leaves the body.

    Rays with candidates left are moved behind the face and kept, packed to the front. A body left later was
    entered earlier: it stands before the others in ``inside``.

    Returns
    -------
    int
        How many rays were kept.
    """
    kept = 0
    for i in range(primitives.shape[0]):
        if primitives[i] < 0:
            continue
        f = primitives[i] + first_clear
        body = object_of_face[f]
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
        put_behind(origins, kept, corners, faces, f, u[i], v[i], entering)
        put(directions, kept, dx, dy, dz)
        kept += 1
    return kept
