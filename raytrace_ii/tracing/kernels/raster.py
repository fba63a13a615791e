"""Rasterisation of faces along parallel camera rays, row by row of the picture.

The rays of one place under all lenses are a view: parallel rays through an even lattice of lenses. A corner of a face
has coordinates (x, y) in lenses and s in lengths of a ray. In the views of column u it is seen in the lens
x − s·slope(u) − offset(u), and likewise down. The lenses of a row look along one plane in all views of a row v. The
plane cuts a face along a line; its ends are found once, and the lenses between them for 16 views together.

Ends that two faces share are computed by the same operations from the same corners, and lines are longer than their
faces by `SLACK` at both ends: no ray passes between the faces. The nearest face counts, of equally near ones the
first.
"""

from __future__ import annotations

import math

import numpy as np

from ii_core.base.jit import lane_kernel, lane_stage

from .lanes import BLOCK, single_of

SLACK = 1e-9  # lens pitches: far more than the rounding of float64, far less than that of Embree's float32 rays
GROUP = 16  # rows of lenses whose faces are listed together
# An entry of a list: the first and the last row of its group that may see a face, in four bits each, and the face.
ROW_BITS, ROW_MASK = 4, 15
MOST_FACES = 1 << 24
LENSES = 8  # lie together in a line of the buffer: the distances of the faces nearest in them, then which these are
CHUNK = 2 * LENSES
# A room for the views of 16 columns (or rows) of a lens: offset and slope; first and last lens of a line; distance of
# the line in lens 0, and its step from lens to lens.
OFFSET, SLOPE, FIRST, LAST, DISTANCE, STEP = range(0, 6 * BLOCK, BLOCK)
ROOM = 6 * BLOCK
_FAR, _MISS = np.float32(math.inf), np.int32(-1)


@lane_stage
def seen(corners, i, turn):
    """Coordinates x, y, s of a corner, the numbers from i on, by a matrix of three rows of four."""
    a = np.float64(corners[np.uint64(i)])
    b = np.float64(corners[np.uint64(i + 1)])
    c = np.float64(corners[np.uint64(i + 2)])
    x = turn[0] * a + turn[1] * b + turn[2] * c + turn[3]
    y = turn[4] * a + turn[5] * b + turn[6] * c + turn[7]
    s = turn[8] * a + turn[9] * b + turn[10] * c + turn[11]
    return x, y, s


@lane_stage
def lens_ranges(x0, s0, x1, s1, x2, s2, most, spread, room):
    """Set the first and last lens, up to ``most``, that may see a face in each view of a room; count those views.

    ``spread`` is how far offsets and slopes of a view's planes lie from its middle at most.
    """
    slack = SLACK + spread[0] + spread[1] * max(max(abs(s0), abs(s1)), abs(s2))
    for k in range(BLOCK):
        slope, offset = room[SLOPE + k], room[OFFSET + k]
        a, b, c = x0 - s0 * slope - offset, x1 - s1 * slope - offset, x2 - s2 * slope - offset
        room[FIRST + k] = np.ceil(max(min(min(a, b), c) - slack, 0.0))
        room[LAST + k] = np.floor(max(min(max(max(a, b), c) + slack, most), -1.0))
    count = 0
    for k in range(BLOCK):
        count += room[FIRST + k] <= room[LAST + k]
    return count


@lane_kernel
def list_faces(corners, first_of_same, turn, across, down, spread, lenses, places, entries, counts):
    """Count or list the faces that the rays of a group of rows of lenses may meet in each row of views.

    ``spread`` (2, 2) is that of `lens_ranges` across and down.
    ``places`` has the next place of each list in ``entries``, for each group and row of views, which moves on. With
    ``entries`` of no rows, faces are counted only. ``counts`` gets the rows of all entries, and the rays of one
    column of views that lie in a box around a face.
    """
    views = down.shape[0] // ROOM * BLOCK
    middle = across.shape[0] // ROOM // 2 * ROOM + BLOCK // 2 - 1
    for f in range(corners.shape[0] // 9):
        if first_of_same.shape[0] > 0 and first_of_same[f] != f:
            continue
        x0, y0, s0 = seen(corners, 9 * f, turn)
        x1, y1, s1 = seen(corners, 9 * f + 3, turn)
        x2, y2, s2 = seen(corners, 9 * f + 6, turn)
        found = 0
        for start in range(0, across.shape[0], ROOM):
            found += lens_ranges(x0, s0, x1, s1, x2, s2, lenses[0] - 1.0, spread[0], across[start : start + ROOM])
        if (found == 0) | (max(max(s0, s1), s2) < 0.0):
            continue
        wide = max(across[middle + LAST] - across[middle + FIRST] + 1.0, 0.0)
        for start in range(0, down.shape[0], ROOM):
            room = down[start : start + ROOM]
            if lens_ranges(y0, s0, y1, s1, y2, s2, lenses[1] - 1.0, spread[1], room) == 0:
                continue
            for k in range(BLOCK):
                first, last = np.int64(room[FIRST + k]), np.int64(room[LAST + k])
                if first > last:
                    continue
                counts[0] += last - first + 1
                counts[1] += (last - first + 1) * np.int64(wide)
                view = start // ROOM * BLOCK + k
                for group in range(first // GROUP, last // GROUP + 1):
                    list_ = group * views + view
                    place = places[list_]
                    places[list_] = place + 1
                    if entries.shape[0] > 0:
                        top, bottom = GROUP * group, GROUP * group + GROUP - 1
                        low, high = first - top if first > top else 0, (last if last < bottom else bottom) - top
                        entries[place] = ((f << ROW_BITS | high) << ROW_BITS) | low


@lane_stage
def cut(y, x0, y0, s0, x1, y1, s1, x2, y2, s2):
    """Ends (x, s) of the line in which a plane cuts a face: on the longest edge, and on one of the others.

    Corners are in the order of their y. An end is the same for all faces that share the edge, and a corner itself if
    the plane goes through it.
    """
    t = min(max((y - y0) / (y2 - y0), 0.0), 1.0)
    ax, a = (1.0 - t) * x0 + t * x2, (1.0 - t) * s0 + t * s2
    low = y < y1
    px, py, p = (x0, y0, s0) if low else (x1, y1, s1)
    qx, qy, q = (x1, y1, s1) if low else (x2, y2, s2)
    height = qy - py
    t = min(max((y - py) / (height if height > 0.0 else 1.0), 0.0), 1.0)
    return ax, a, (1.0 - t) * px + t * qx, (1.0 - t) * p + t * q


@lane_stage
def before_lenses(ax, a, bx, b):
    """The part of a line, of which one end lies before the lenses, that lies behind them, or on them."""
    t = a / (a - b)
    x = (1.0 - t) * ax + t * bx
    return (x, 0.0, bx, b) if a < 0.0 else (ax, a, x, 0.0)


@lane_stage
def line_ranges(ax, a, bx, b, most, room):
    """Set the lenses that see a line from (x, s) = (ax, a) to (bx, b), and its distances, in each view of a room.

    A line seen end-on has no lens: the faces beside it are there.
    """
    for k in range(BLOCK):
        slope, offset = room[SLOPE + k], room[OFFSET + k]
        i, j = ax - a * slope - offset, bx - b * slope - offset
        wide = j - i
        broad = abs(wide) > SLACK
        last = np.floor(max(min(max(i, j) + SLACK, most), -1.0))
        step = np.float64(np.float32(b - a) / np.float32(wide if broad else 1.0))
        room[FIRST + k] = np.ceil(max(min(i, j) - SLACK, 0.0))
        room[LAST + k] = last if broad else -1.0
        room[DISTANCE + k] = a - i * step
        room[STEP + k] = step


@lane_stage
def draw(a, b, face, room, chosen, line, stride, buffer):
    """Enter a face in the lenses of `line_ranges` that see nothing nearer."""
    count = 0
    for k in range(BLOCK):
        chosen[np.uint64(count)] = k
        count += room[FIRST + k] <= room[LAST + k]
    near, far, own = np.float32(min(a, b)), np.float32(max(a, b)), single_of(np.int32(face))
    for i in range(count):
        k = chosen[i]
        first, last = np.int64(room[np.uint64(FIRST + k)]), np.int64(room[np.uint64(LAST + k)])
        distance, step = room[np.uint64(DISTANCE + k)], room[np.uint64(STEP + k)]
        single_step = np.float32(step)
        lens = first & -LENSES
        place = np.uint64(line + k * stride + 2 * lens)
        while lens <= last:
            start = np.float32(distance + lens * step)
            low, high = np.float32(first - lens), np.float32(last - lens)
            for j in range(LENSES):
                lane = np.float32(np.int32(j))
                here = min(max(start + lane * single_step, near), far)
                distances, which = place + np.uint64(j), place + np.uint64(j + LENSES)
                before, its = buffer[distances], buffer[which]
                nearer = (here < before) & (lane >= low) & (lane <= high)
                buffer[distances] = here if nearer else before
                buffer[which] = own if nearer else its
            lens += LENSES
            place += np.uint64(CHUNK)


@lane_kernel
def draw_faces(corners, turn, entries, rows, top, view, room, lenses, chosen, line, lines, stride, buffer):
    """Enter faces in the lines of a buffer: one for each of some ``rows`` of lenses of a group, and each column.

    The group starts at row ``top``; ``view`` is offset and slope of the row of views. Lines are ``stride`` numbers
    long, and so many ``lines`` of them a row; those of the room start at ``line``.
    """
    for i in range(entries.shape[0]):
        entry = np.int64(entries[i])
        first, last = max(entry & ROW_MASK, rows[0]), min(entry >> ROW_BITS & ROW_MASK, rows[1] - 1)
        if first > last:
            continue
        f = entry >> 2 * ROW_BITS
        x0, y0, s0 = seen(corners, 9 * f, turn)
        x1, y1, s1 = seen(corners, 9 * f + 3, turn)
        x2, y2, s2 = seen(corners, 9 * f + 6, turn)
        y0, y1, y2 = y0 - s0 * view[1] - view[0], y1 - s1 * view[1] - view[0], y2 - s2 * view[1] - view[0]
        if y0 > y1:
            x0, y0, s0, x1, y1, s1 = x1, y1, s1, x0, y0, s0
        if y1 > y2:
            x1, y1, s1, x2, y2, s2 = x2, y2, s2, x1, y1, s1
        if y0 > y1:
            x0, y0, s0, x1, y1, s1 = x1, y1, s1, x0, y0, s0
        if y2 - y0 <= SLACK:  # seen edge-on
            continue
        first = max(first, np.int64(np.ceil(max(y0 - SLACK, 0.0))) - top)
        last = min(last, np.int64(np.floor(min(y2 + SLACK, top + last))) - top)
        for row in range(first, last + 1):
            ax, a, bx, b = cut(np.float64(top + row), x0, y0, s0, x1, y1, s1, x2, y2, s2)
            if max(a, b) < 0.0:
                continue
            if min(a, b) < 0.0:
                ax, a, bx, b = before_lenses(ax, a, bx, b)
            line_ranges(ax, a, bx, b, lenses - 1.0, room)
            draw(a, b, f, room, chosen, (row - rows[0]) * lines + line, stride, buffer)


@lane_kernel
def read_faces(buffer, bits, lenses, stride, columns, out):
    """Move the faces of a buffer to pixels ``out`` of rows of views, and empty it."""
    lines = stride * ((columns + BLOCK - 1) // BLOCK * BLOCK)
    for row in range(out.shape[0]):
        for first in range(0, lenses, LENSES):
            for u in range(columns):
                place = row * lines + u * stride + 2 * first
                for j in range(min(LENSES, lenses - first)):
                    out[row, (first + j) * columns + u] = bits[place + LENSES + j]
                for j in range(LENSES):
                    buffer[place + j] = _FAR
                    bits[place + LENSES + j] = _MISS
