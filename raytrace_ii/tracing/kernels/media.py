"""Nested media: the list of bodies that contain a ray, by priority, refractive indices and reflectance."""

from __future__ import annotations

import math

import numpy as np

from ii_core.base.jit import part_kernel, stage_kernel

from .tables import IOR, PRIORITY, TRANSMISSION


@stage_kernel
def medium_of(inside, i, materials, without):
    """The body of highest priority that a ray is in, of equal ones the first entered; −1 for none.

    ``without`` is left out once.
    """
    best = -1
    for k in range(inside.shape[1]):
        body = inside[i, k]
        if body < 0:
            break
        if body == without:
            without = -1
        elif best < 0 or materials[body, PRIORITY] > materials[best, PRIORITY]:
            best = body
    return best


@stage_kernel
def media_at(inside, i, materials, body, entering):
    """What is before and behind a face of a body; the same if another body hides the face (Schmidt, Budge 2002)."""
    if entering:
        before = medium_of(inside, i, materials, -1)
        hidden = before >= 0 and materials[before, PRIORITY] >= materials[body, PRIORITY]
        return before, before if hidden else body
    after = medium_of(inside, i, materials, body)
    before = medium_of(inside, i, materials, -1)
    for k in range(inside.shape[1]):
        if inside[i, k] == body:
            return before, after
    # not known to be inside: an open body
    return body if after < 0 or materials[body, PRIORITY] > materials[after, PRIORITY] else after, after


@part_kernel
def enter(inside, i, body):
    """Note that a ray is in a body, if it is not noted yet; a full list forgets."""
    for k in range(inside.shape[1]):
        if inside[i, k] == body:
            return
        if inside[i, k] < 0:
            inside[i, k] = body
            return


@part_kernel
def leave(inside, i, body):
    """Take a body out of a list, once."""
    last, found = inside.shape[1] - 1, False
    for k in range(inside.shape[1]):
        found = found or inside[i, k] == body
        if found:
            inside[i, k] = inside[i, k + 1] if k < last else -1


@part_kernel
def cross(inside, i, body, entering):
    if entering:
        enter(inside, i, body)
    else:
        leave(inside, i, body)


@stage_kernel
def refractive_index(materials, body, c):
    """Index of refraction of a body for a channel, 1 outside of all."""
    return np.float64(materials[body, IOR + c]) if body >= 0 else 1.0


@stage_kernel
def disperses(materials, body):
    return body >= 0 and (
        materials[body, IOR] != materials[body, IOR + 1] or materials[body, IOR] != materials[body, IOR + 2]
    )


@stage_kernel
def clearness(materials, body):
    """The largest share of a colour that a body lets through."""
    return max(materials[body, TRANSMISSION], materials[body, TRANSMISSION + 1], materials[body, TRANSMISSION + 2])


@stage_kernel
def transmits(materials, body):
    return (
        max(materials[body, TRANSMISSION], materials[body, TRANSMISSION + 1], materials[body, TRANSMISSION + 2]) > 0.0
    )


@part_kernel
def fresnel(cosine, ratio):
    """Unpolarised reflectance of a dielectric face, and the cosine behind it.

    ``ratio`` is n1/n2. Total internal reflection gives (1, 0).
    """
    sine2 = ratio * ratio * (1.0 - cosine * cosine)
    if sine2 >= 1.0:
        return 1.0, 0.0
    behind = math.sqrt(1.0 - sine2)
    s = (ratio * cosine - behind) / (ratio * cosine + behind)
    p = (ratio * behind - cosine) / (ratio * behind + cosine)
    return 0.5 * (s * s + p * p), behind
