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

from .tables import BODY, FACE, NORMALS

UNITS = 1024  # of a pixel's side
DONE, OPEN = 0, 2  # what becomes of a pixel
GROUPS, ANGLES = 4, 16  # surfaces in a pixel, angles of the lines that part two
PICKS = 3  # samples of a surface whose light is found
# Share of a step of colour by which a pixel is wrong that an edge of this step crosses unseen, root mean square.
MISSED = 0.3
SAME_WAY = np.float32(0.94)  # least cosine between normals of one surface
BEHIND = 2.0  # pixels to the plane of a surface, from which on it is another one
OF_COUNTS = 0.25  # standard error of a share by samples, for one sample; it falls by their 3/4th power
THINNEST = 0.002  # of a pixel, on either side of lines
UNLIKE = 1.5  # how much more than the error wanted colours of one surface beside each other may cause
BESIDE = 0.25  # of a pixel: samples so near to a side tell of the pixel beyond
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


class Seen(NamedTuple):
    """Rays through places of pixels in the scene's frame, and what they hit, a row each."""

    origins: NDArray[np.float32]
    directions: NDArray[np.float32]
    faces: NDArray[np.int32]
    u: NDArray[np.float32]
    v: NDArray[np.float32]
    distances: NDArray[np.float32]


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


@inline_kernel
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


@kernel
def aim(locations, directions, places, rotation, shift, origins, out):
    """Rays (p·n, 3) through places (p, n, 2) of pixels, in the scene's frame and of length 1.

    They are even between those (p, 3, 3) through the centre, the middle of the right side and that of the lower one.
    """
    count = places.shape[1]
    for i in range(places.shape[0]):
        for j in range(count):
            a, b, row = 2.0 * places[i, j, 0] - 1.0, 2.0 * places[i, j, 1] - 1.0, i * count + j
            square = 0.0
            for c in range(3):
                place, way = shift[c], 0.0
                for k in range(3):
                    l, d = locations[i, 0, k], directions[i, 0, k]
                    place += rotation[c, k] * (l + a * (locations[i, 1, k] - l) + b * (locations[i, 2, k] - l))
                    way += rotation[c, k] * (d + a * (directions[i, 1, k] - d) + b * (directions[i, 2, k] - d))
                origins[row, c], out[row, c] = place, way
                square += way * way
            inverse = 1.0 / math.sqrt(square) if square > 0.0 else 0.0
            for c in range(3):
                out[row, c] *= inverse


@kernel
def part(seen, places, rows, columns, smooth, by_body, width, spread, surface, groups, many):
    """Part the samples of pixels into up to `GROUPS` surfaces.

    ``surface`` (`GROUPS`, 7) is room for body, normal and place of a surface. ``groups`` (p, n) are the surfaces of
    samples, that of the first is 0; ``many`` (p,) how many there are, one more if too many. Pixels are ``width`` wide where their rays start and grow by ``spread`` a mm.
    """
    count = places.shape[1]
    for i in range(places.shape[0]):
        found, too_many = 0, False
        for j in range(count):
            row = i * count + j
            f, body, x, y, z, px, py, pz = seen.faces[row], -1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            reach = 0.0
            if f >= 0:
                at, u, v, reach = f * columns, float(seen.u[row]), float(seen.v[row]), float(seen.distances[row])
                body = int(rows[at + BODY])
                x, y, z = float(rows[at + FACE]), float(rows[at + FACE + 1]), float(rows[at + FACE + 2])
                if smooth and (rows[at + NORMALS] != 0 or rows[at + NORMALS + 1] != 0 or rows[at + NORMALS + 2] != 0):
                    w = 1.0 - u - v
                    at += NORMALS
                    x = w * rows[at] + u * rows[at + 3] + v * rows[at + 6]
                    y = w * rows[at + 1] + u * rows[at + 4] + v * rows[at + 7]
                    z = w * rows[at + 2] + u * rows[at + 5] + v * rows[at + 8]
                    length = math.sqrt(x * x + y * y + z * z)
                    x, y, z = x / length, y / length, z / length
                px = seen.origins[row, 0] + reach * seen.directions[row, 0]
                py = seen.origins[row, 1] + reach * seen.directions[row, 1]
                pz = seen.origins[row, 2] + reach * seen.directions[row, 2]
            mine, away = -1, BEHIND * (width + spread * reach)
            for g in range(found):
                if mine < 0 and int(surface[g, 0]) == body:
                    nx, ny, nz = surface[g, 1], surface[g, 2], surface[g, 3]
                    off = nx * (px - surface[g, 4]) + ny * (py - surface[g, 5]) + nz * (pz - surface[g, 6])
                    if body < 0 or by_body or (nx * x + ny * y + nz * z >= SAME_WAY and abs(off) <= away):
                        mine = g
            if mine < 0:
                if found == GROUPS:
                    too_many, mine = True, GROUPS - 1
                else:
                    mine = found
                    surface[mine, 0], surface[mine, 1], surface[mine, 2], surface[mine, 3] = body, x, y, z
                    surface[mine, 4], surface[mine, 5], surface[mine, 6] = px, py, pz
                    found += 1
            groups[i, j] = mine
        many[i] = found + too_many


@kernel
def pick(places, groups, many, known, picks):
    """Choose samples (p, `GROUPS`, `PICKS`) of surfaces that are not yet ``known``, as far apart as may be; −1 if none.

    The first is that in the middle of the surface; of the first surface it is the pixel's centre, sample 0.
    """
    for i in range(places.shape[0]):
        for g in range(GROUPS):
            for k in range(PICKS):
                picks[i, g, k] = -1
        for g in range(known[i], min(many[i], GROUPS)):
            x, y, count = 0.0, 0.0, 0
            for j in range(places.shape[1]):
                if groups[i, j] == g:
                    x, y, count = x + places[i, j, 0], y + places[i, j, 1], count + 1
            x, y = x / count, y / count
            for k in range(min(PICKS, count)):
                best, most = -1, -1.0
                for j in range(places.shape[1]):
                    if groups[i, j] == g:
                        if k == 0:
                            far = 4.0 - _square(places, i, j, x, y) + (4.0 if g == 0 and j == 0 else 0.0)
                        else:
                            far = math.inf
                            for before in range(k):
                                other = picks[i, g, before]
                                far = min(far, _square(places, i, j, places[i, other, 0], places[i, other, 1]))
                        if far > most:
                            best, most = j, far
                picks[i, g, k] = best


@inline_kernel
def _square(places, i, j, x, y):
    dx, dy = places[i, j, 0] - x, places[i, j, 1] - y
    return dx * dx + dy * dy


@kernel
def take_light(which, group, light, code, total, codes, low, high, count):
    """Add light and codes of picked samples to their surfaces (p, `GROUPS`, 3), and note the span of the codes."""
    for j in range(which.shape[0]):
        i, g = which[j], group[j]
        n = count[i, g]
        for c in range(3):
            total[i, g, c] = (total[i, g, c] * n + light[j, c]) / (n + 1)
            codes[i, g, c] = (codes[i, g, c] * n + code[j, c]) / (n + 1)
            low[i, g, c] = min(low[i, g, c], code[j, c]) if n > 0 else code[j, c]
            high[i, g, c] = max(high[i, g, c], code[j, c]) if n > 0 else code[j, c]
        count[i, g] = n + 1


@inline_kernel
def _below(nx, ny, t):
    """Share of the unit square around 0 in which nx·x + ny·y < t."""
    a, b = max(abs(nx), abs(ny)), min(abs(nx), abs(ny))
    s, half, flat = abs(t), (a + b) / 2.0, (a - b) / 2.0
    rest = max(half - s, 0.0)
    more = s / a if s <= flat else 0.5 - rest * rest / (2.0 * a * max(b, 1e-12))
    return 0.5 + (more if t > 0.0 else -more)


@kernel
def fit(places, groups, many, weights, turn, room, shares, errors, strip):
    """Find the shares of surfaces (p, `GROUPS`) in pixels and their standard error, from places of samples.

    Two surfaces that a straight line parts share the pixel by the mean of all lines that do; any others by the
    ``weights`` (p, n) of their samples. Of lines, ``turn`` (p, 2) are the middle of their angles and how far they
    go, before and afterwards, and ``strip`` (p, 6) is what all lines are in, see `strips`: half its thickness is 0
    where none is. ``room`` (4, `ANGLES`) is for sums of the lines of one angle.
    """
    count = places.shape[1]
    for i in range(places.shape[0]):
        for g in range(GROUPS):
            shares[i, g] = 0.0
        for j in range(count):
            shares[i, groups[i, j]] += weights[i, j]
        strip[i, 5] = 0.0
        missed = 0.0
        for g in range(GROUPS):
            missed = max(missed, 4.0 * shares[i, g] * (1.0 - shares[i, g]))
        errors[i] = OF_COUNTS * count ** -0.75 if many[i] > 1 else 0.0
        if many[i] != 2:
            continue
        middle, wide = turn[i, 0], turn[i, 1]
        total, mean, square, best, most = 0.0, 0.0, 0.0, -1, 0.0
        for k in range(ANGLES):
            angle = middle + wide * ((2 * k + 1.0) / ANGLES - 1.0)
            nx, ny = math.cos(angle), math.sin(angle)
            low0, high0, low1, high1 = math.inf, -math.inf, math.inf, -math.inf
            for j in range(count):
                along = nx * (places[i, j, 0] - 0.5) + ny * (places[i, j, 1] - 0.5)
                if groups[i, j] == 0:
                    low0, high0 = min(low0, along), max(high0, along)
                else:
                    low1, high1 = min(low1, along), max(high1, along)
            half = (abs(nx) + abs(ny)) / 2.0
            turned = low0 >= high1
            low, high = (high1, low0) if turned else (high0, low1)
            low, high = max(low, -half), min(high, half)
            room[0, k], room[1, k], room[2, k], room[3, k] = nx, ny, low, high
            weight = high - low
            if weight > 0.0:
                share = _below(nx, ny, (low + high) / 2.0)
                share = 1.0 - share if turned else share
                total, mean = total + weight, mean + weight * share
                square += weight * (share * share + weight * weight / 12.0)
                if weight > most:
                    best, most = k, weight
        if best < 0:
            continue
        mean /= total
        shares[i, 0], shares[i, 1] = mean, 1.0 - mean
        errors[i] = math.sqrt(max(square / total - mean * mean, 0.0))
        _around(room, best, strip[i])
        farthest = 0.5
        for k in range(ANGLES):
            if room[3, k] > room[2, k]:
                farthest = max(farthest, abs(k - best) + 1.0)
        turn[i, 0] = middle + wide * ((2 * best + 1.0) / ANGLES - 1.0)
        turn[i, 1] = min(wide * 2.0 * farthest / ANGLES, wide)


@inline_kernel
def _around(room, best, strip):
    """The strip around all lines of `fit`, along that of the best angle."""
    nx, ny = room[0, best], room[1, best]
    t = (room[2, best] + room[3, best]) / 2.0
    swap = abs(nx) > abs(ny)
    a, b = (ny, nx) if swap else (nx, ny)
    slope, height, away = -a / b, t / b, 0.0
    for k in range(ANGLES):
        if room[3, k] > room[2, k]:
            p, q = (room[1, k], room[0, k]) if swap else (room[0, k], room[1, k])
            q = q if abs(q) > 1e-3 else 1e-3
            for end in range(4):
                along, t = (0.5 if end % 2 else -0.5), room[2 + end // 2, k]
                away = max(away, abs((t - p * along) / q - height - slope * along))
    strip[0], strip[1], strip[2] = 1.0 if swap else 0.0, 0.0, 1.0
    strip[3], strip[4], strip[5] = height + 0.5 - 0.5 * slope, slope, min(away, 1.0) + THINNEST


@kernel
def into_strips(strip, places, old, weights):
    """Move new places (p, m, 2), the last of ``weights`` (p, n), into strips; before them stand ``old`` (p, n − m, 2).

    Those that stand beside the strip have what it leaves of the pixel.
    """
    first, count = old.shape[1], places.shape[1]
    for i in range(places.shape[0]):
        axis, area, outside = int(strip[i, 0]), 0.0, 0
        for j in range(count):
            along = places[i, j, axis]
            low, high = _across(strip[i], along)
            weights[i, first + j] = (high - low) / count
            area += weights[i, first + j]
            places[i, j, 1 - axis] = low + (high - low) * places[i, j, 1 - axis]
        for j in range(first):
            low, high = _across(strip[i], old[i, j, axis])
            beside = not (low <= old[i, j, 1 - axis] <= high)
            weights[i, j] = 1.0 if beside else 0.0
            outside += beside
        for j in range(first + count):
            if j < first:
                weights[i, j] *= (1.0 - area) / max(outside, 1)
            elif outside == 0:
                weights[i, j] /= max(area, 1e-12)


@inline_kernel
def _step(codes, i, a, b):
    c = codes
    return max(abs(c[i, a, 0] - c[i, b, 0]), max(abs(c[i, a, 1] - c[i, b, 1]), abs(c[i, a, 2] - c[i, b, 2])))


@kernel
def contrast(many, codes, errors):
    """Turn errors of shares into errors of codes (p, `GROUPS`, 3), by the largest step between surfaces."""
    for i in range(many.shape[0]):
        most = np.float32(0)
        for a in range(1, min(many[i], GROUPS)):
            for b in range(a):
                most = max(most, _step(codes, i, a, b))
        errors[i] *= most


@kernel
def mix(pixels, places, groups, many, bodies, shares, light, codes, low, high, points, error, lens, sums, verdict, wanted):
    """Mix the light (p, `GROUPS`, 3) of surfaces by their shares.

    A pixel stays `OPEN` with too many surfaces, or if the codes of one's samples go from ``low`` to ``high`` values
    that are too far apart. Pixels are ``wanted`` beside which a surface is seen that their centres do not show.
    """
    height, width = lens.shape
    for i in range(pixels.shape[0]):
        pixel = pixels[i]
        y, x = pixel // width, pixel % width
        good = many[i] <= GROUPS
        for g in range(min(many[i], GROUPS)):
            span = np.float32(0)
            for c in range(3):
                span = max(span, high[i, g, c] - low[i, g, c])
            good &= span * MISSED * shares[i, g] <= UNLIKE * error
        verdict[i] = DONE if good else OPEN
        for c in range(3):
            total = 0.0
            for g in range(min(many[i], GROUPS)):
                total += shares[i, g] * light[i, g, c]
            sums[pixel, c] = total
        for j in range(places.shape[1]):
            g = groups[i, j]
            for side in range(4):
                b, a = y + (side == 2) - (side == 0), x + (side == 1) - (side == 3)
                if not (0 <= b < height and 0 <= a < width and lens[b, a] == lens[y, x]):
                    continue
                place = places[i, j, 0 if side % 2 else 1]
                near = place < BESIDE if side == 0 or side == 3 else place > 1.0 - BESIDE
                q = b * width + a
                if near and points.body[q] != bodies[i, g]:
                    step = np.float32(0)
                    for c in range(3):
                        step = max(step, abs(points.code[q, c] - codes[i, g, c]))
                    if step * MISSED > error:
                        wanted[q] = True
