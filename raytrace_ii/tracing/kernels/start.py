"""Camera rays: origins and directions."""

from __future__ import annotations

import math

import numpy as np

from ii_core.base.jit import lean_kernel as kernel

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
def start_separable_rays(x, y, z, rows, columns, rotation, shift, out_origins, out_directions):
    """As `start_rays` for a block of pixels whose rays all carry all light, from `IICamera.separable_rays`.

    ``rows`` and ``columns`` name the pixels in the order in which their rays are to stand.

    Returns
    -------
    bool
        Whether all rays are usable for sure: told of rows and columns, not of rays.
    """
    r00, r01, r02 = rotation[0, 0], rotation[0, 1], rotation[0, 2]
    r10, r11, r12 = rotation[1, 0], rotation[1, 1], rotation[1, 2]
    r20, r21, r22 = rotation[2, 0], rotation[2, 1], rotation[2, 2]
    s0, s1, s2 = shift[0], shift[1], shift[2]
    lz, dz = z[0], z[1]
    sure = (_LEAST < abs(dz) < _MOST) & (abs(lz) < _MOST)
    for rays in (x, y):
        for k in range(rays.shape[0]):
            sure &= (abs(rays[k, 0]) < _MOST) & (abs(rays[k, 1]) < _MOST)
    for ray in range(rows.shape[0]):
        i = np.uint64(ray)  # unsigned: numba need not look for negative indices
        column, row = np.uint64(columns[i]), np.uint64(rows[i])
        lx, dx = x[column, 0], x[column, 1]
        ly, dy = y[row, 0], y[row, 1]
        inverse = 1.0 / math.sqrt(dx * dx + dy * dy + dz * dz)
        out_origins[i, 0] = r00 * lx + r01 * ly + r02 * lz + s0
        out_origins[i, 1] = r10 * lx + r11 * ly + r12 * lz + s1
        out_origins[i, 2] = r20 * lx + r21 * ly + r22 * lz + s2
        out_directions[i, 0] = (r00 * dx + r01 * dy + r02 * dz) * inverse
        out_directions[i, 1] = (r10 * dx + r11 * dy + r12 * dz) * inverse
        out_directions[i, 2] = (r20 * dx + r21 * dy + r22 * dz) * inverse
    return sure
