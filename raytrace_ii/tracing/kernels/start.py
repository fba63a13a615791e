"""Camera rays: origins and directions."""

from __future__ import annotations

import math

import numpy as np

from ii_core.base.jit import inline_kernel, lane_stage
from ii_core.base.jit import lean_kernel as kernel

from . import lanes as at
from .lanes import BLOCK
from .vectors import put

_LEAST, _MOST = 1e-150, 1e150  # between them squares and their sums neither vanish nor overflow


@kernel
def start_rays(
    locations, directions, shares, order, rotation, shift,
    out_origins, out_directions, out_weights, out_pixels, out_inside,
):  # fmt: skip
    """Place and normalise the camera rays that carry light, packed to the front.

    ``shares`` is the share of light of every ray, empty if all carry all; ``order`` names the rays in the order in
    which they are to stand, empty if as they come.

    Returns
    -------
    count, bad : int
        How many rays there are, and the index of the first unusable one, or −1.
    """
    count, bad = 0, -1
    for row in range(locations.shape[0]):
        i = order[row] if order.shape[0] > 0 else row
        share = shares[i] if shares.shape[0] > 0 else 1.0
        if share == 0.0:
            continue
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        if not (0.0 < length < math.inf and 0.0 < share < math.inf) and bad < 0:
            bad = i
        inverse = 1.0 / length if length > 0.0 else 0.0
        x, y, z = locations[i, 0], locations[i, 1], locations[i, 2]
        for c in range(3):
            r0, r1, r2 = rotation[c, 0], rotation[c, 1], rotation[c, 2]
            place = r0 * x + r1 * y + r2 * z + shift[c]
            if not math.isfinite(place) and bad < 0:
                bad = i
            out_origins[count, c] = place
            out_directions[count, c] = (r0 * dx + r1 * dy + r2 * dz) * inverse
            out_weights[count, c] = share
        out_pixels[count] = row
        for k in range(out_inside.shape[1]):
            out_inside[count, k] = -1
        count += 1
    return count, bad


@kernel
def usable(x, y, z):
    """Whether all rays of `IICamera.separable_rays` are usable for sure: told of rows and columns, not of rays."""
    sure = (_LEAST < abs(z[1]) < _MOST) & (abs(z[0]) < _MOST)
    for rays in (x, y):
        for k in range(rays.shape[0]):
            sure &= (abs(rays[k, 0]) < _MOST) & (abs(rays[k, 1]) < _MOST)
    return sure


@inline_kernel
def _separable_ray(start, column, row):
    """Origin and direction of the ray of a pixel, from `IICamera.separable_rays`."""
    r, s, lz, dz = start.rotation, start.shift, start.z[0], start.z[1]
    lx, dx, ly, dy = start.x[column, 0], start.x[column, 1], start.y[row, 0], start.y[row, 1]
    inverse = 1.0 / math.sqrt(dx * dx + dy * dy + dz * dz)
    return (
        r[0, 0] * lx + r[0, 1] * ly + r[0, 2] * lz + s[0],
        r[1, 0] * lx + r[1, 1] * ly + r[1, 2] * lz + s[1],
        r[2, 0] * lx + r[2, 1] * ly + r[2, 2] * lz + s[2],
        (r[0, 0] * dx + r[0, 1] * dy + r[0, 2] * dz) * inverse,
        (r[1, 0] * dx + r[1, 1] * dy + r[1, 2] * dz) * inverse,
        (r[2, 0] * dx + r[2, 1] * dy + r[2, 2] * dz) * inverse,
    )


@lane_stage
def start_lanes(first, lanes, start, single):
    """Start a packet of rays of `IICamera.separable_rays` that carry all light; lanes to spare have the last one."""
    for k in range(BLOCK):
        i = np.uint64(first + min(k, lanes - 1))
        x, y, z, dx, dy, dz = _separable_ray(start, np.uint64(start.columns[i]), np.uint64(start.rows[i]))
        o, d = at.START + k, at.DX + k
        single[o], single[o + BLOCK], single[o + 2 * BLOCK] = x, y, z
        single[d], single[d + BLOCK], single[d + 2 * BLOCK] = dx, dy, dz
    for k in range(3 * BLOCK):
        single[at.W0 + k] = np.float32(1)


@kernel
def start_separable_rays(start, out_origins, out_directions):
    """As `start_lanes` for all rays, into arrays."""
    for ray in range(start.rows.shape[0]):
        i = np.uint64(ray)  # unsigned: numba need not look for negative indices
        x, y, z, dx, dy, dz = _separable_ray(start, np.uint64(start.columns[i]), np.uint64(start.rows[i]))
        put(out_origins, i, x, y, z)
        put(out_directions, i, dx, dy, dz)
