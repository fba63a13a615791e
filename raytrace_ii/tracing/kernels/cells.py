"""Pixels as cells between their corners: told apart by surface and colour, and cut by the chord of an edge.

A cell whose corners and centre agree has their mean colour. If they fall into two groups, the places where its sides
pass from one to the other are found by bisection, and the chord between them shares the cell out to both groups.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ii_core.base.jit import inline_kernel
from ii_core.base.jit import lean_kernel as kernel

from .looks import GROUPS

UNITS = 1024  # of a pixel's side
DONE, OPEN = 0, 2  # what becomes of a pixel
# Share of a step of colour by which a pixel is wrong that an edge of this step crosses unseen, root mean square.
MISSED = 0.3
SAME_WAY = np.float32(0.94)  # least cosine between normals of one surface
UNLIKE = 1.5  # how much more than the error wanted colours of one surface beside each other may cause
HALF_DIAGONAL = 0.75  # of a pixel, with something to spare
WIDER, SPARE = 1.02, 0.01  # how much wider than rods strips around them are, times and in pixels
MOST_STRIP = 0.5  # of a pixel
LIKE = 0.4  # of a step, among the pixels around one
MOST_GROUPS = 3  # of surfaces and colours around a pixel of a tile without fine structure


class Points(NamedTuple):
    """What is known of points of pixels, a row each: linear light, its 8-bit codes, body and normal of shading."""

    light: NDArray[np.float32]
    code: NDArray[np.float32]
    body: NDArray[np.int32]
    normal: NDArray[np.float32]


class Places(NamedTuple):
    """Places within pixels: number of the pixel, and units from its left top corner, right and down."""

    pixel: NDArray[np.int32]
    x: NDArray[np.float32]
    y: NDArray[np.float32]


@kernel
def encode(light, curve, code):
    """Codes of linear light by a curve of even steps."""
    last = curve.shape[0] - 1
    for i in range(light.shape[0]):
        for c in range(3):
            at = min(max(np.float64(light[i, c]), 0.0), 1.0) * last
            j = min(int(at), last - 1)
            code[i, c] = curve[j] + (at - j) * (curve[j + 1] - curve[j])


@kernel
def count_rays(pixels, rays):
    """Count a ray for each pixel named."""
    for i in range(pixels.shape[0]):
        rays[pixels[i]] += 1


@inline_kernel
def _apart(points, i, j):
    """Largest difference between the codes of two points."""
    c = points.code
    return max(abs(c[i, 0] - c[j, 0]), max(abs(c[i, 1] - c[j, 1]), abs(c[i, 2] - c[j, 2])))


@inline_kernel
def _along(points, i, j):
    n = points.normal
    return n[i, 0] * n[j, 0] + n[i, 1] * n[j, 1] + n[i, 2] * n[j, 2]


@inline_kernel
def _one_surface(points, i, j):
    return points.body[i] == points.body[j] and (points.body[i] < 0 or _along(points, i, j) >= SAME_WAY)


@kernel
def doubtful(points, lens, own, error, steps, uneven):
    """Steps of colour, in codes, of the own pixels that may not be what is seen at their centres; 0 of others.

    To a neighbour of another surface the whole step counts; on one surface, what a straight run of colours leaves:
    pixels are ``uneven`` by that alone. At the border of a lens it is the step to the neighbour on the other side.
    """
    height, width = lens.shape
    for y in range(height):
        for x in range(width):
            i = y * width + x
            most, bent = np.float32(0), np.float32(0)
            if own[i]:
                for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
                    one, other = _beside(lens, y, x, -dy, -dx), _beside(lens, y, x, dy, dx)
                    first, second = one >= 0, other >= 0
                    first, second = first and _one_surface(points, i, one), second and _one_surface(points, i, other)
                    if first and second:
                        bent = max(bent, _bend(points, one, i, other))
                    else:
                        if first:
                            bent = max(bent, _run(points, lens, i, one, _beside(lens, y, x, -2 * dy, -2 * dx)))
                        elif one >= 0:
                            most = max(most, _apart(points, i, one))
                        if second:
                            bent = max(bent, _run(points, lens, i, other, _beside(lens, y, x, 2 * dy, 2 * dx)))
                        elif other >= 0:
                            most = max(most, _apart(points, i, other))
            uneven[i] = bent * MISSED > error
            most = max(most, bent)
            steps[i] = most if most * MISSED > error else np.float32(0)


@inline_kernel
def _beside(lens, y, x, dy, dx):
    """A pixel under the same lens so far away; −1 if there is none."""
    height, width = lens.shape
    b, a = y + dy, x + dx
    return b * width + a if 0 <= b < height and 0 <= a < width and lens[b, a] == lens[y, x] else -1


@inline_kernel
def _bend(points, one, i, other):
    bend = np.float32(0)
    for c in range(3):
        bend = max(bend, abs(points.code[one, c] - 2 * points.code[i, c] + points.code[other, c]))
    return bend


@inline_kernel
def _run(points, lens, i, one, after):
    """The step to a neighbour on one side, or what a straight run of colours beyond it leaves."""
    step = _apart(points, i, one)
    if after >= 0 and _one_surface(points, one, after):
        step = min(step, _bend(points, i, one, after))
    return step


@kernel
def crowded(points, lens, steps, out):
    """Tell around which doubtful pixels more than `MOST_GROUPS` surfaces and colours meet."""
    height, width = lens.shape
    for y in range(height):
        for x in range(width):
            i = y * width + x
            out[i] = False
            if steps[i] == 0:
                continue
            second, third, many = i, i, 1
            for b in range(max(y - 1, 0), min(y + 2, height)):
                for a in range(max(x - 1, 0), min(x + 2, width)):
                    j = b * width + a
                    known = lens[b, a] != lens[y, x] or many > MOST_GROUPS
                    known = known or _like(points, j, i, steps[i]) or _like(points, j, second, steps[i])
                    if not known and not _like(points, j, third, steps[i]):
                        second, third, many = third, j, many + 1
            out[i] = many > MOST_GROUPS


@kernel
def roughness(points, lens, steps, out):
    """Mean square of the steps of colour, in codes, from pixel to pixel among each one and the eight around it.

    ``steps`` (n, 2) is room for those to the right and down; −1 where another lens begins.
    """
    height, width = lens.shape
    for y in range(height):
        for x in range(width):
            i = y * width + x
            right = x + 1 < width and lens[y, x + 1] == lens[y, x]
            down = y + 1 < height and lens[y + 1, x] == lens[y, x]
            steps[i, 0] = _apart(points, i, i + 1) ** 2 if right else np.float32(-1)
            steps[i, 1] = _apart(points, i, i + width) ** 2 if down else np.float32(-1)
    for y in range(height):
        for x in range(width):
            total, many = np.float32(0), 0
            for b in range(max(y - 1, 0), min(y + 2, height)):
                for a in range(max(x - 1, 0), min(x + 2, width)):
                    j = b * width + a
                    if lens[b, a] != lens[y, x]:
                        continue
                    if a <= x and steps[j, 0] >= 0:
                        total, many = total + steps[j, 0], many + 1
                    if b <= y and steps[j, 1] >= 0:
                        total, many = total + steps[j, 1], many + 1
            out[y * width + x] = total / max(many, 1)


@kernel
def beyond(lens, own, steps, places):
    """Middles of those sides of calm own pixels behind which another lens begins; return how many there are."""
    height, width = lens.shape
    made = 0
    for y in range(height):
        for x in range(width):
            if not own[y * width + x] or steps[y * width + x] > 0:
                continue
            for side in range(4):
                b, a = y + (side == 2) - (side == 0), x + (side == 1) - (side == 3)
                if not (0 <= b < height and 0 <= a < width and lens[b, a] == lens[y, x]):
                    places.pixel[made] = y * width + x
                    places.x[made], places.y[made] = (1 + a - x) * UNITS // 2, (1 + b - y) * UNITS // 2
                    made += 1
    return made


@kernel
def boxes(locations, directions, far, low, scale, out):
    """Numbers of those of 32³ boxes from ``low`` on in which rays end, neighbours beside each other (Morton)."""
    for i in range(far.shape[0]):
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        way, number = far[i] / length if length > 0.0 else 0.0, 0
        for axis in range(3):
            at = (locations[i, axis] + way * directions[i, axis] - low[axis]) * scale[axis]
            step = int(min(max(at, 0.0), 31.0))
            for bit in range(5):
                number |= (step >> bit & 1) << (3 * bit + axis)
        out[i] = number


@inline_kernel
def _like(points, i, j, step):
    return _one_surface(points, i, j) and _apart(points, i, j) <= LIKE * step


@kernel
def nearest_around(reach, lens, out):
    """Shortest ray of each pixel and its eight neighbours under one lens; NaN where none hits."""
    height, width = lens.shape
    for y in range(height):
        for x in range(width):
            least = math.inf
            for b in range(max(y - 1, 0), min(y + 2, height)):
                for a in range(max(x - 1, 0), min(x + 2, width)):
                    if lens[b, a] == lens[y, x] and reach[b * width + a] < least:
                        least = reach[b * width + a]
            out[y * width + x] = least if least < math.inf else math.nan


@inline_kernel
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
    """Tell which rods (two ends, radius) may be seen in pixels, by rays through their centres.

    ``one`` is a rod's number if it is the only one, −1 without any, −2 with several. Pixels are ``width`` wide where
    their rays start and grow by ``spread`` a mm.
    """
    for i in range(locations.shape[0]):
        found = -1
        lx, ly, lz = locations[i, 0], locations[i, 1], locations[i, 2]
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        scale = 1.0 / length if length > 0.0 else 0.0
        dx, dy, dz = dx * scale, dy * scale, dz * scale
        for b in range(rods.shape[0]):
            if _touches(
                rods[b, 0] - lx, rods[b, 1] - ly, rods[b, 2] - lz, rods[b, 3] - rods[b, 0], rods[b, 4] - rods[b, 1],
                rods[b, 5] - rods[b, 2], rods[b, 6], dx, dy, dz, width, spread,
            ):  # fmt: skip
                found = b if found == -1 else -2
        one[i] = found


@inline_kernel
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


@inline_kernel
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


@kernel
def mix(pixels, told, light, codes, low, high, points, error, lens, sums, verdict, wanted):
    """Mix the light (p, `GROUPS`, 3) of surfaces by their shares; return the sum of the squares of errors, in codes.

    A pixel stays `OPEN` with too many surfaces, or if the codes of one's samples go from ``low`` to ``high`` values
    that are too far apart. Pixels are ``wanted`` beside which a surface is seen that their centres do not show.
    """
    height, width = lens.shape
    squares = 0.0
    for i in range(pixels.shape[0]):
        pixel, many, most = pixels[i], min(told.many[i], GROUPS), np.float32(0)
        y, x, good = pixel // width, pixel % width, told.many[i] <= GROUPS
        for g in range(many):
            for c in range(3):
                span = high[i, g, c] - low[i, g, c]
                good &= span * MISSED * told.shares[i, g] <= UNLIKE * error
                for before in range(g):
                    most = max(most, abs(codes[i, g, c] - codes[i, before, c]))
        verdict[i] = DONE if good else OPEN
        squares += (told.errors[i] * most) ** 2 if good else 0.0
        for c in range(3):
            total = 0.0
            for g in range(many):
                total += told.shares[i, g] * light[i, g, c]
            sums[pixel, c] = total
        for side in range(4):
            b, a = y + (side == 2) - (side == 0), x + (side == 1) - (side == 3)
            if 0 <= b < height and 0 <= a < width and lens[b, a] == lens[y, x]:
                q = b * width + a
                for g in range(many):
                    if told.near[i, side] >> g & 1 and points.body[q] != told.bodies[i, g]:
                        for c in range(3):
                            if abs(points.code[q, c] - codes[i, g, c]) * MISSED > error:
                                wanted[q] = True
    return squares
