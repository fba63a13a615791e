"""Pixels as cells between their corners: told apart by surface and colour, and cut by the chord of an edge.

A cell whose corners and centre agree has their mean colour. If they fall into two groups, the places where its sides
pass from one to the other are found by bisection, and the chord between them shares the cell out to both groups.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ii_core.base.jit import lean_kernel as kernel
from ii_core.base.jit import stage_kernel

UNITS = 1024  # of a pixel's side: edges are found on whole ones
DONE, CUT, OPEN = 0, 1, 2  # what becomes of a cell
FIRST, SECOND, NEITHER = 0, 1, 2  # groups of points
# Share of a step of colour by which a pixel is wrong that an edge of this step crosses unseen, root mean square.
MISSED = 0.3
SAME_WAY = np.float32(0.94)  # least cosine between normals of one surface
WITHIN = 1.5  # how much more than pixels' centres the colours of one group of a cell may differ
OWN = 0.3  # of the step between two colours: how far a point of one may be from it
LEAST_AWAY = 0.02  # pixels beside a chord at which it is checked
OF_CENTRE = 0.43  # weight of the centre of a cell, with which cells err least of edges of all angles
LIKE = 0.4  # the same among the pixels around one
MOST_GROUPS = 3  # of surfaces and colours around a pixel that is looked at as a cell


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


class Sides(NamedTuple):
    """Sides of cells on which an edge is looked for: pixel, which of its sides, points at the left or upper end and
    at the other, what is left of the way between them in units, and whether a third group was met."""

    pixel: NDArray[np.int32]
    side: NDArray[np.int32]
    ends: NDArray[np.int32]
    low: NDArray[np.int32]
    high: NDArray[np.int32]
    bad: NDArray[np.bool_]


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


@stage_kernel
def _apart(points, i, j):
    """Largest difference between the codes of two points."""
    c = points.code
    return max(abs(c[i, 0] - c[j, 0]), max(abs(c[i, 1] - c[j, 1]), abs(c[i, 2] - c[j, 2])))


@stage_kernel
def _along(points, i, j):
    n = points.normal
    return n[i, 0] * n[j, 0] + n[i, 1] * n[j, 1] + n[i, 2] * n[j, 2]


@stage_kernel
def _one_surface(points, i, j):
    return points.body[i] == points.body[j] and (points.body[i] < 0 or _along(points, i, j) >= SAME_WAY)


@kernel
def doubtful(points, lens, own, error, steps):
    """Steps of colour, in codes, of the own pixels that may not be what is seen at their centres; 0 of others.

    To a neighbour of another surface the whole step counts; on one surface, what a straight run of colours leaves.
    At the border of a lens it is the step to the neighbour on the other side.
    """
    height, width = lens.shape
    for y in range(height):
        for x in range(width):
            i = y * width + x
            most = np.float32(0)
            if own[i]:
                for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
                    one, other = -1, -1
                    if 0 <= y - dy and 0 <= x - dx < width and lens[y - dy, x - dx] == lens[y, x]:
                        one = (y - dy) * width + x - dx
                    if y + dy < height and 0 <= x + dx < width and lens[y + dy, x + dx] == lens[y, x]:
                        other = (y + dy) * width + x + dx
                    if one >= 0 and other >= 0 and _one_surface(points, i, one) and _one_surface(points, i, other):
                        for c in range(3):
                            bend = points.code[one, c] - 2 * points.code[i, c] + points.code[other, c]
                            most = max(most, abs(bend))
                    else:
                        most = max(most, _apart(points, i, one) if one >= 0 else np.float32(0))
                        most = max(most, _apart(points, i, other) if other >= 0 else np.float32(0))
            steps[i] = most if most * MISSED > error else np.float32(0)


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
    """Numbers of those of 32³ boxes from ``low`` on in which rays end, neighbours beside each other (Morton).

    Directions are unit vectors.
    """
    for i in range(far.shape[0]):
        number = 0
        for axis in range(3):
            at = (locations[i, axis] + far[i] * directions[i, axis] - low[axis]) * scale[axis]
            step = int(min(max(at, 0.0), 31.0))
            for bit in range(5):
                number |= (step >> bit & 1) << (3 * bit + axis)
        out[i] = number


@stage_kernel
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


@stage_kernel
def _right_down(corner):
    """A corner's place, in pixels right and down; corners and sides run around from the left top, side 0 on top."""
    return int(corner == 1 or corner == 2), int(corner >= 2)


@kernel
def open_pixels(pixels, lens, corner_of, points, plain, error, next_point, corners, places, known_places):
    """Give pixels their corners, which pixels under one lens share.

    ``corner_of`` (pixels, 4) are the points at corners, in the row of the first pixel of those that share them; −1
    where there is none yet. A corner between four pixels whose centres look alike within ``error``, on a body that is
    ``plain``, has their mean: such points stand from ``next_point`` on, at ``known_places``. Those after them have
    ``places`` to look at.

    Returns
    -------
    alike, new : int
        How many points of either kind there are.
    """
    height, width = lens.shape
    alike = 0
    for i in range(pixels.shape[0]):
        pixel = pixels[i]
        y, x = pixel // width, pixel % width
        for k in range(4):
            right, down = _right_down(k)
            top, left = y + down - 1, x + right - 1
            owner, slot, found = pixel, k, 0
            for other in range(3, -1, -1):
                b, a = top + other // 2, left + other % 2
                if 0 <= b < height and 0 <= a < width and lens[b, a] == lens[y, x]:
                    owner, found = b * width + a, found + 1
                    slot = (0 if a > left else 1) if b > top else (3 if a > left else 2)
            alone = found == 4 and corner_of[owner, slot] < 0 and plain[points.body[pixel]]
            if alone and _four_alike(points, top * width + left, width, error):
                _mean_point(points, top * width + left, width, next_point + alike)
                corner_of[owner, slot] = next_point + alike
                at = known_places
                at.pixel[alike], at.x[alike], at.y[alike] = pixel, right * UNITS, down * UNITS
                alike += 1
            known = corner_of[owner, slot]
            corners[i, k] = known if known >= 0 else -2 - 4 * owner - slot  # to be looked at
    new = 0
    for i in range(pixels.shape[0]):
        for k in range(4):
            if corners[i, k] < 0:
                owner, slot = (-2 - corners[i, k]) // 4, (-2 - corners[i, k]) % 4
                if corner_of[owner, slot] < 0:
                    right, down = _right_down(k)
                    corner_of[owner, slot] = next_point + alike + new
                    places.pixel[new], places.x[new], places.y[new] = pixels[i], right * UNITS, down * UNITS
                    new += 1
                corners[i, k] = corner_of[owner, slot]
    return alike, new


@stage_kernel
def _four_alike(points, first, width, error):
    """Whether four centres around a corner are on one surface and of one colour."""
    good = True
    for other in range(1, 4):
        j = first + other % 2 + other // 2 * width
        good &= _one_surface(points, first, j)
        for before in range(other):
            good &= _apart(points, j, first + before % 2 + before // 2 * width) * MISSED <= error
    return good


@stage_kernel
def _mean_point(points, first, width, row):
    points.body[row] = points.body[first]
    for c in range(3):
        points.normal[row, c], light, code = points.normal[first, c], np.float32(0), np.float32(0)
        for other in range(4):
            j = first + other % 2 + other // 2 * width
            light, code = light + points.light[j, c], code + points.code[j, c]
        points.light[row, c], points.code[row, c] = light * np.float32(0.25), code * np.float32(0.25)


@stage_kernel
def _group(points, i, a, b, surfaces, step):
    """To which of two points a third belongs: by surface if they are on two, else by colour."""
    found = NEITHER
    if surfaces and points.body[a] != points.body[b]:
        found = FIRST if points.body[i] == points.body[a] else found
        found = SECOND if points.body[i] == points.body[b] else found
    elif points.body[i] == points.body[a] and surfaces:
        one, other = _along(points, i, a), _along(points, i, b)
        if max(one, other) >= SAME_WAY:
            found = FIRST if one >= other else SECOND
    elif points.body[i] == points.body[a]:
        off, away = _apart(points, i, a), _apart(points, i, b)
        if min(off, away) <= OWN * step:
            found = FIRST if off <= away else SECOND
    return found


@kernel
def judge(pixels, corners, points, error, lens, sums, verdict, groups, steps, wanted):
    """Decide what becomes of each cell; ``sums`` are the light of those done.

    ``groups`` are the corners, as bits, in the second group of a cell to cut. ``steps`` are those of cells not done.
    Pixels beyond a side that an edge crosses are ``wanted``. The ``sums`` of other cells are the estimate that errs
    least at an edge, NaN on one surface, whose pattern may be in step with the pixels.
    """
    height, width = lens.shape
    q, light = points.code, points.light
    for i in range(pixels.shape[0]):
        pixel = np.int64(pixels[i])
        p0, p1, p2, p3 = (
            np.int64(corners[i, 0]),
            np.int64(corners[i, 1]),
            np.int64(corners[i, 2]),
            np.int64(corners[i, 3]),
        )
        k = p0, p1, p2, p3
        surfaces = _one_surface(points, p1, p0) and _one_surface(points, p2, p0) and _one_surface(points, p3, p0)
        surfaces &= _one_surface(points, pixel, p0)
        most, wrong = np.float32(0), np.float32(0)
        for c in range(3):
            low = min(min(q[p0, c], q[p1, c]), min(min(q[p2, c], q[p3, c]), q[pixel, c]))
            high = max(max(q[p0, c], q[p1, c]), max(max(q[p2, c], q[p3, c]), q[pixel, c]))
            most = max(most, high - low)
            mean = np.float32(0.25) * (q[p0, c] + q[p1, c] + q[p2, c] + q[p3, c])
            saddle = np.float32(0.5) * abs(q[p0, c] + q[p2, c] - q[p1, c] - q[p3, c])
            wrong = max(wrong, max(saddle, 2 * abs(q[pixel, c] - mean)))
        if (wrong if surfaces else most) * MISSED <= error:
            verdict[i] = DONE
            for c in range(3):  # exact to the second order
                mean = 0.25 * (float(light[p0, c]) + float(light[p1, c]) + float(light[p2, c]) + float(light[p3, c]))
                sums[pixel, c] = (mean + 2.0 * light[pixel, c]) / 3.0
            continue
        for c in range(3):
            four = float(light[p0, c]) + float(light[p1, c]) + float(light[p2, c]) + float(light[p3, c])
            sums[pixel, c] = math.nan if surfaces else (1.0 - OF_CENTRE) / 4.0 * four + OF_CENTRE * light[pixel, c]
        first, second = p0, p0
        if surfaces:  # the two colours farthest apart
            far = np.float32(0)
            for a in range(4):
                for b in range(a + 1):
                    other = k[b] if b < a else pixel
                    step = _apart(points, k[a], other)
                    if step > far:
                        far, first, second = step, k[a], other
        else:
            for a in range(4):
                other = k[a + 1] if a < 3 else pixel
                if second == p0 and not _one_surface(points, other, p0):
                    second = other
        bits, good = 0, True
        for a in range(4):
            group = _group(points, k[a], first, second, not surfaces, most)
            good &= group != NEITHER
            bits |= (1 << a) if group == SECOND else 0
        centre = _group(points, pixel, first, second, not surfaces, most)
        good &= centre != NEITHER
        for a in range(4):
            for b in range(a + 1):
                alike = (bits >> a & 1) == ((bits >> b & 1) if b < a else centre)
                if alike and _apart(points, k[a], k[b] if b < a else pixel) * MISSED > WITHIN * error:
                    good = False
        one_edge = bits != 0 and bits != 5 and bits != 10 and bits != 15
        verdict[i], groups[i], steps[i] = CUT if good and one_edge else OPEN, bits, most
        y, x = pixel // width, pixel % width
        for side in range(4):
            b, a = y + (side == 2) - (side == 0), x + (side == 1) - (side == 3)
            beside = 0 <= b < height and 0 <= a < width and lens[b, a] == lens[y, x]
            if beside and _apart(points, k[side], k[(side + 1) % 4]) * MISSED > error:
                wanted[b * width + a] = True


@stage_kernel
def _differs(points, i, j, error):
    return points.body[i] != points.body[j] and _apart(points, i, j) * MISSED > error


@kernel
def corners_of_open(corners, verdict, first, wanted):
    """Tell which points, from ``first`` on, are corners of cells that stay open."""
    for i in range(corners.shape[0]):
        for k in range(4):
            if verdict[i] == OPEN and 0 <= corners[i, k] - first < wanted.shape[0]:
                wanted[corners[i, k] - first] = True


@kernel
def mark_around(places, lens, wanted):
    """Mark the pixels around corners."""
    width = lens.shape[1]
    for i in range(places.pixel.shape[0]):
        y, x = places.pixel[i] // width, places.pixel[i] % width
        down, right = int(places.y[i] > 0), int(places.x[i] > 0)
        _mark(lens, y + down - 1, y + down, x + right - 1, x + right, lens[y, x], wanted)


@kernel
def find_thin(pixels, corners, points, error, lens, thin):
    """Mark pixels around places of a body that no place beside them has: centres among corners, and the other way."""
    height, width = lens.shape
    for i in range(pixels.shape[0]):
        y, x = pixels[i] // width, pixels[i] % width
        alone = True
        for k in range(4):
            right, down = _right_down(k)
            alone &= _differs(points, np.int64(pixels[i]), np.int64(corners[i, k]), error)
            corner_alone = True
            for around in range(4):
                b, a = y + down - 1 + around // 2, x + right - 1 + around % 2
                if 0 <= b < height and 0 <= a < width and lens[b, a] == lens[y, x]:
                    corner_alone &= _differs(points, np.int64(corners[i, k]), b * width + a, error)
            if corner_alone:
                _mark(lens, y + down - 1, y + down, x + right - 1, x + right, lens[y, x], thin)
        if alone:
            _mark(lens, y - 1, y + 1, x - 1, x + 1, lens[y, x], thin)


@stage_kernel
def _mark(lens, top, bottom, left, right, of, out):
    height, width = lens.shape
    for b in range(max(top, 0), min(bottom + 1, height)):
        for a in range(max(left, 0), min(right + 1, width)):
            if lens[b, a] == of:
                out[b * width + a] = True


@kernel
def follow(pixels, codes, points, error, lens, wanted):
    """Mark the pixels around those whose mean is not the light of their centre."""
    width = lens.shape[1]
    for i in range(pixels.shape[0]):
        apart, y, x = np.float32(0), pixels[i] // width, pixels[i] % width
        for c in range(3):
            apart = max(apart, abs(codes[i, c] - points.code[pixels[i], c]))
        if apart > error:
            _mark(lens, y - 1, y + 1, x - 1, x + 1, lens[y, x], wanted)


@kernel
def gather_sides(pixels, corners, groups, lens, side_of, sides, of_cell):
    """Note the sides of cells that pass from one group to the other, each once; ``of_cell`` are those of each cell.

    ``side_of`` (pixels, 4) is −1 everywhere.

    Returns
    -------
    int
        How many there are.
    """
    width = lens.shape[1]
    made = 0
    for i in range(pixels.shape[0]):
        pixel = pixels[i]
        y, x = pixel // width, pixel % width
        for side in range(4):
            after = (side + 1) % 4
            of_cell[i, side] = -1
            if (groups[i] >> side & 1) == (groups[i] >> after & 1):
                continue
            owner, slot = pixel, side
            if side == 0 and y > 0 and lens[y - 1, x] == lens[y, x]:
                owner, slot = pixel - width, 2
            elif side == 3 and x > 0 and lens[y, x - 1] == lens[y, x]:
                owner, slot = pixel - 1, 1
            if side_of[owner, slot] < 0:
                side_of[owner, slot] = made
                sides.pixel[made], sides.side[made] = pixel, side
                sides.ends[made, 0] = corners[i, side if side < 2 else after]
                sides.ends[made, 1] = corners[i, after if side < 2 else side]
                sides.low[made], sides.high[made], sides.bad[made] = 0, UNITS, False
                made += 1
            of_cell[i, side] = side_of[owner, slot]
    return made


@kernel
def probe_sides(sides, points, error, bodies, which, places):
    """Places halfway along what is left of those sides whose crossing is not yet known well enough.

    Returns
    -------
    seen, shaded : int
        How many there are; ``which`` are their sides. For those in front the body alone tells, if ``bodies``; the
        others stand at the back.
    """
    front, back = 0, sides.pixel.shape[0]
    for i in range(sides.pixel.shape[0]):
        left = sides.high[i] - sides.low[i]
        one, other = np.int64(sides.ends[i, 0]), np.int64(sides.ends[i, 1])
        # two crossings, each anywhere in what is left: a standard error of 0.2 of it
        if sides.bad[i] or left <= 1 or 0.2 / UNITS * left * _apart(points, one, other) <= 0.6 * error:
            continue
        row = back - 1
        if bodies and points.body[one] != points.body[other]:
            row = front
            front += 1
        else:
            back -= 1
        which[row], places.pixel[row] = i, sides.pixel[i]
        at, side = (sides.low[i] + sides.high[i]) // 2, sides.side[i]
        places.x[row] = at if side == 0 or side == 2 else (UNITS if side == 1 else 0)
        places.y[row] = at if side == 1 or side == 3 else (UNITS if side == 2 else 0)
    return front, sides.pixel.shape[0] - back


@kernel
def narrow_sides(sides, which, first, points):
    """Take what the places of `probe_sides` show, points from ``first`` on, to their sides."""
    for j in range(which.shape[0]):
        i = which[j]
        one, other = np.int64(sides.ends[i, 0]), np.int64(sides.ends[i, 1])
        step = _apart(points, one, other)
        group = _group(points, first + j, one, other, not _one_surface(points, one, other), step)
        at = (sides.low[i] + sides.high[i]) // 2
        if group == FIRST:
            sides.low[i] = at
        elif group == SECOND:
            sides.high[i] = at
        else:
            sides.bad[i] = True


@stage_kernel
def _ends_of_groups(points, corners, i, bits):
    """A corner of each group, and the largest step between corners."""
    first, second, step = np.int64(corners[i, 0]), np.int64(corners[i, 0]), np.float32(0)
    for a in range(4):
        corner = np.int64(corners[i, a])
        if (bits >> a & 1) == 0:
            first = corner
        else:
            second = corner
        for b in range(a):
            step = max(step, _apart(points, corner, np.int64(corners[i, b])))
    return first, second, step


@kernel
def chords(pixels, corners, groups, of_cell, sides, points, error, verdict, shares, places):
    """Cut cells by the chord between the crossings of their sides; two places beside its middle are to be looked at.

    ``shares`` are the parts of the first groups. A cell is `OPEN` if a side is bad, or its centre is on the other
    side than its group.
    """
    for i in range(pixels.shape[0]):
        bits = groups[i]
        ax, ay, bx, by, met, bad = 0.0, 0.0, 0.0, 0.0, 0, False
        twice, x0, y0, lastx, lasty, begun = 0.0, 0.0, 0.0, 0.0, 0.0, False
        for turn in range(8):  # corners of the first group and crossings, around: twice the area between them
            side = turn // 2
            right, down = _right_down(side)
            px, py, counts = float(right), float(down), (bits >> side & 1) == 0
            if turn % 2:
                s = of_cell[i, side]
                counts = s >= 0
                if counts:
                    bad |= sides.bad[s]
                    t = (sides.low[s] + sides.high[s]) / (2.0 * UNITS)
                    px, py = (t if side == 0 or side == 2 else px), (t if side == 1 or side == 3 else py)
                    ax, ay = (px, py) if met == 0 else (ax, ay)
                    bx, by = (px, py) if met == 1 else (bx, by)
                    met += 1
            if counts:
                if begun:
                    twice += lastx * py - px * lasty
                else:
                    x0, y0, begun = px, py, True
                lastx, lasty = px, py
        shares[i] = abs(twice + lastx * y0 - x0 * lasty) / 2.0
        first, second, step = _ends_of_groups(points, corners, i, bits)
        mx, my = (ax + bx) / 2.0, (ay + by) / 2.0
        length = max(math.sqrt((bx - ax) * (bx - ax) + (by - ay) * (by - ay)), 1e-9)
        nx, ny = (by - ay) / length, (ax - bx) / length
        far0, far1 = 0.0, 0.0  # across the chord, to the farthest corner of either group
        for a in range(4):
            right, down = _right_down(a)
            across = (right - mx) * nx + (down - my) * ny
            if (bits >> a & 1) == 0:
                far0 = across if abs(across) > abs(far0) else far0
            else:
                far1 = across if abs(across) > abs(far1) else far1
        away = min(max(2.0 * error / max(float(step), 1.0), LEAST_AWAY), 0.2)
        for k in range(2):
            far = far0 if k == 0 else far1
            off = min(away, 0.6 * abs(far)) * (1.0 if far >= 0.0 else -1.0)
            places.pixel[2 * i + k] = pixels[i]
            places.x[2 * i + k] = UNITS * min(max(mx + off * nx, 0.0), 1.0)
            places.y[2 * i + k] = UNITS * min(max(my + off * ny, 0.0), 1.0)
        across = (0.5 - mx) * nx + (0.5 - my) * ny
        if abs(across) > away:
            surfaces = not _one_surface(points, first, second)
            expected = FIRST if (across > 0.0) == (far0 > 0.0) else SECOND
            bad |= _group(points, np.int64(pixels[i]), first, second, surfaces, step) != expected
        verdict[i] = OPEN if bad else CUT


@kernel
def confirm(pixels, corners, groups, shares, beside, points, error, verdict, sums):
    """Find the light of cells cut; `OPEN` those at whose places of `chords` points, from ``beside`` on, disagree."""
    light = points.light
    for i in range(pixels.shape[0]):
        bits, one, other = groups[i], beside + 2 * i, beside + 2 * i + 1
        first, second, step = _ends_of_groups(points, corners, i, bits)
        surfaces = not _one_surface(points, first, second)
        good = _group(points, one, first, second, surfaces, step) == FIRST
        good &= _group(points, other, first, second, surfaces, step) == SECOND
        good &= _apart(points, one, first) * MISSED * shares[i] <= WITHIN * error
        good &= _apart(points, other, second) * MISSED * (1.0 - shares[i]) <= WITHIN * error
        if not good:
            verdict[i] = OPEN
            continue
        for c in range(3):
            mine, others, many = 0.0, 0.0, 0
            for a in range(4):
                if (bits >> a & 1) == 0:
                    mine, many = mine + light[corners[i, a], c], many + 1
                else:
                    others += light[corners[i, a], c]
            mine, others = 0.5 * (mine / many + light[one, c]), 0.5 * (others / (4 - many) + light[other, c])
            sums[pixels[i], c] = shares[i] * mine + (1.0 - shares[i]) * others
