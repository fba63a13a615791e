"""Rods, the axes of small and thin bodies: in which pixels they are seen, and places in the strips that have them."""

from __future__ import annotations

import math

from ii_core.base.jit import lean_kernel as kernel
from ii_core.base.jit import stage_kernel

HALF_DIAGONAL = 0.75  # of a pixel, with something to spare
WIDER, SPARE = 1.02, 0.01  # how much wider than rods strips around them are, times and in pixels
MOST_STRIP = 0.5  # of a pixel


@stage_kernel
def _touches(x, y, z, u, v, w, radius, dx, dy, dz, width, spread):
    """Whether a rod from x, y, z along u, v, w may be seen in the pixel around a unit direction from the origin."""
    turned = u * dx + v * dy + w * dz
    square = u * u + v * v + w * w - turned * turned
    nearest = (turned * (x * dx + y * dy + z * dz) - (u * x + v * y + w * z)) / max(square, 1e-12)
    s = min(max(nearest, 0.0), 1.0)  # the place along the rod
    x, y, z = x + s * u, y + s * v, z + s * w
    along = x * dx + y * dy + z * dz
    near = radius + HALF_DIAGONAL * (width + spread * along)
    return along > 0.0 and x * x + y * y + z * z - along * along <= near * near


@kernel
def touched(locations, directions, rods, width, spread, one):
    """Tell which rods (two ends, radius) may be seen in pixels, by rays of unit directions through their centres.

    ``one`` is a rod's number if it is the only one, −1 without any, −2 with several. Pixels are ``width`` wide where
    their rays start and grow by ``spread`` a mm.
    """
    for i in range(locations.shape[0]):
        found = -1
        lx, ly, lz = locations[i, 0], locations[i, 1], locations[i, 2]
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        for b in range(rods.shape[0]):
            if _touches(
                rods[b, 0] - lx, rods[b, 1] - ly, rods[b, 2] - lz, rods[b, 3] - rods[b, 0], rods[b, 4] - rods[b, 1],
                rods[b, 5] - rods[b, 2], rods[b, 6], dx, dy, dz, width, spread,
            ):  # fmt: skip
                found = b if found == -1 else -2
        one[i] = found


@stage_kernel
def _seen_at(rods, b, end, place, d, right, down):
    """Where an end of a rod is seen, in pixels from the centre right and down, and its way along the ray."""
    x, y, z = rods[b, end] - place[0], rods[b, end + 1] - place[1], rods[b, end + 2] - place[2]
    along = x * d[0] + y * d[1] + z * d[2]
    far = max(along, 1e-12)
    x, y, z = x / far - d[0], y / far - d[1], z / far - d[2]
    a, c = x * right[0] + y * right[1] + z * right[2], x * down[0] + y * down[1] + z * down[2]
    rr = right[0] * right[0] + right[1] * right[1] + right[2] * right[2]
    ss = down[0] * down[0] + down[1] * down[1] + down[2] * down[2]
    rs = right[0] * down[0] + right[1] * down[1] + right[2] * down[2]
    det = max(rr * ss - rs * rs, 1e-300)
    return (a * ss - c * rs) / det, (c * rr - a * rs) / det, along


@stage_kernel
def _turn(rods, b, d):
    """Cosine between a rod and a unit direction; 1 of a rod without length."""
    u, v, w = rods[b, 3] - rods[b, 0], rods[b, 4] - rods[b, 1], rods[b, 5] - rods[b, 2]
    length = math.sqrt(u * u + v * v + w * w)
    return (u * d[0] + v * d[1] + w * d[2]) / length if length > 0.0 else 1.0


@kernel
def strips(locations, directions, right, down, rods, one, strip):
    """Find the strips (n, 6) of pixels in which their only rods are seen, which have little of the pixel.

    A strip is its axis, 0 across and 1 down, least and most along it, height at 0, slope, and half the thickness: 0
    if nothing of the rod is in the pixel, −1 if it has much of the pixel, or its ends are not both ahead. ``right``
    and ``down`` are the steps of unit directions from pixel to pixel.
    """
    for i in range(locations.shape[0]):
        strip[i, 5] = -1.0
        b, r, s = one[i], right[i], down[i]
        ax, ay, near = _seen_at(rods, max(b, 0), 0, locations[i], directions[i], r, s)
        bx, by, far = _seen_at(rods, max(b, 0), 3, locations[i], directions[i], r, s)
        near = min(near, far)
        rr, ss = r[0] * r[0] + r[1] * r[1] + r[2] * r[2], s[0] * s[0] + s[1] * s[1] + s[2] * s[2]
        rs = r[0] * s[0] + r[1] * s[1] + r[2] * s[2]
        least = (rr + ss) / 2 - math.sqrt((rr - ss) * (rr - ss) / 4 + rs * rs)
        if b < 0 or near <= 0.0 or least <= 0.0:
            continue
        radius = WIDER * rods[b, 6] / (near * math.sqrt(least)) + SPARE
        swap = abs(by - ay) > abs(bx - ax)
        ax, ay, bx, by = (ay, ax, by, bx) if swap else (ax, ay, bx, by)
        slope = (by - ay) / (bx - ax) if abs(bx - ax) > 1e-9 else 0.0
        tilt = math.sqrt(1.0 + slope * slope)
        end = radius * (abs(_turn(rods, b, directions[i])) + abs(slope)) / tilt + SPARE  # a disc across the rod
        low, high = max(min(ax, bx) - end + 0.5, 0.0), min(max(ax, bx) + end + 0.5, 1.0)
        half, height = radius * tilt, ay + 0.5 - slope * (ax + 0.5)
        one_end, other = height + slope * low, height + slope * high
        seen = high > low and max(one_end, other) + half > 0.0 and min(one_end, other) - half < 1.0
        strip[i, 0], strip[i, 1], strip[i, 2] = 1.0 if swap else 0.0, low, high
        strip[i, 3], strip[i, 4] = height, slope
        strip[i, 5] = 0.0 if not seen else (half if (high - low) * 2.0 * half < MOST_STRIP else -1.0)


@stage_kernel
def _across(strip, along):
    middle = strip[3] + strip[4] * along
    return min(max(middle - strip[5], 0.0), 1.0), min(max(middle + strip[5], 0.0), 1.0)


@kernel
def strip_places(strip, places, shares):
    """Move the first half of the places (n, 2·count, 2) of pixels into their strips; ``shares`` (n, 2·count) of them.

    Those of the second half lie in the whole pixel: they count if they are not in the strip. The shares of a pixel
    are 1 together.
    """
    half = places.shape[1] // 2
    for i in range(strip.shape[0]):
        axis, low, high = int(strip[i, 0]), strip[i, 1], strip[i, 2]
        area, outside = 0.0, 0
        for j in range(half):
            along = low + (high - low) * places[i, j, axis]
            first, last = _across(strip[i], along)
            shares[i, j] = (high - low) * (last - first) / half
            area += shares[i, j]
            places[i, j, 1 - axis] = first + (last - first) * places[i, j, 1 - axis]
            places[i, j, axis] = along
        for j in range(half, 2 * half):
            first, last = _across(strip[i], places[i, j, axis])
            inside = low <= places[i, j, axis] <= high and first <= places[i, j, 1 - axis] <= last
            shares[i, j] = 0.0 if inside else 1.0
            outside += not inside
        for j in range(2 * half):
            if j >= half:
                shares[i, j] *= (1.0 - area) / max(outside, 1)
            elif outside == 0:
                shares[i, j] /= max(area, 1e-12)


@kernel
def add_shares(light, shares, pixels, sums):
    """Mix the light (n·count, 3) of places of pixels by their shares (n, count)."""
    count = shares.shape[1]
    for i in range(pixels.shape[0]):
        for c in range(3):
            total = 0.0
            for j in range(count):
                total += shares[i, j] * light[i * count + j, c]
            sums[pixels[i], c] = total
