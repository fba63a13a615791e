"""Camera rays: origins and directions."""

from __future__ import annotations

import math

import numpy as np

from ii_core.base.jit import lane_kernel, lane_stage
from ii_core.base.jit import lean_kernel as kernel

from . import lanes as at
from .lanes import BLOCK, add_rows
from .vectors import put

_ONE = np.float32(1)
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


@kernel
def fill_start_tables(x, y, z, rotation, shift, columns, rows):
    """What columns and rows of `IICamera.separable_rays` give to the origins and directions of their rays.

    A row of ``columns`` (w, 8) and one of ``rows`` (h, 8) add up to a ray: origin, and direction of any length.
    """
    for table, rays, axis in ((columns, x, 0), (rows, y, 1)):
        for i in range(rays.shape[0]):
            for c in range(3):
                place, way = rotation[c, axis] * rays[i, 0], rotation[c, axis] * rays[i, 1]
                if axis == 1:
                    place, way = place + rotation[c, 2] * z[0] + shift[c], way + rotation[c, 2] * z[1]
                table[i, c], table[i, 3 + c] = place, way


@lane_stage
def start_lanes(first, lanes, start, work):
    """Start a packet of rays that carry all light from a `Start`; lanes to spare have the last one."""
    single, double, whole, ray = work.single, work.double, work.whole, at.RAY
    for k in range(BLOCK):
        i = np.uint64(first + min(k, lanes - 1))
        whole[at.TABLE_ROW + k] = start.left + start.columns[i]
        whole[at.FACE + k] = start.top + start.rows[i]
    tables, rows = (start.column_rays, start.row_rays), (np.int64(at.TABLE_ROW), np.int64(at.FACE))
    add_rows(tables, whole, rows, double, np.int64(at.RAY))
    if start.within.shape[0] > 0:
        right, down = ray + 6 * BLOCK, ray + 7 * BLOCK
        for k in range(BLOCK):
            i = np.uint64(2 * (first + min(k, lanes - 1)))
            double[right + k], double[down + k] = start.within[i] - 0.5, start.within[i + np.uint64(1)] - 0.5
        for c in range(6):
            of_column, of_row, coordinate = start.steps[c], start.steps[8 + c], ray + c * BLOCK
            for k in range(BLOCK):
                double[coordinate + k] += double[right + k] * of_column + double[down + k] * of_row
    for k in range(3 * BLOCK):
        single[at.START + k] = double[at.RAY + k]
        single[at.W0 + k] = _ONE
    for k in range(BLOCK):
        x, y, z = double[ray + 3 * BLOCK + k], double[ray + 4 * BLOCK + k], double[ray + 5 * BLOCK + k]
        inverse = 1.0 / math.sqrt(x * x + y * y + z * z)
        single[at.DX + k], single[at.DY + k], single[at.DZ + k] = x * inverse, y * inverse, z * inverse


@lane_kernel
def start_separable_rays(start, work, out_origins, out_directions):
    """As `start_lanes` for all rays, into arrays."""
    n, single = start.rows.shape[0], work.single
    for first in range(0, n, BLOCK):
        lanes = min(BLOCK, n - first)
        start_lanes(first, lanes, start, work)
        for k in range(lanes):
            i = np.uint64(first + k)
            put(out_origins, i, single[at.START + k], single[at.START + BLOCK + k], single[at.START + 2 * BLOCK + k])
            put(out_directions, i, single[at.DX + k], single[at.DY + k], single[at.DZ + k])
