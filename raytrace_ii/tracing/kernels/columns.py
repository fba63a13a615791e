"""What a lamp lights, and what it does not, told without rays by columns along its light.

All rays to a lamp that start in one column of a lattice stay in it: parallel columns of a directional light, pyramids
of any other. A place has coordinates u, v in columns and a height h towards the lamp. All three are projective, so
that h is linear in u and v on a face.

Faces that meet at edges, one on either side of each as the lamp sees them, are a sheet. An edge at which a sheet ends
or folds is a rim. Where one sheet lies above all else in a column and has no rim there, its points are lit, and what
lies below is in its shadow. Of such a column a height between both is kept. All others are left to Embree.
"""

from __future__ import annotations

import math

import numpy as np

from ii_core.base.jit import lane_stage, stage_kernel
from ii_core.base.jit import lean_kernel as kernel

from . import lanes as at
from .lanes import BLOCK, bits_of

MARGIN = 0.25  # columns: how far beside its hit a ray may start
NEAR = 1e-9  # columns: rounding of float64, at which both faces of an edge count
STEEP = 0.7  # cosine between faces below which a valley is a rim: rays from a smooth surface start off its faces
# Of a lamp: rows of the matrix for u, v, weight and h; slack of heights; 1 if there are columns.
MATRIX, SLACK, TOLD, NUMBERS = 0, 16, 17, 18
U, V, H, OF_FACE = 0, 3, 6, 9  # coordinates of a face's corners
LEAST, MOST, BELOW, OF_SHEET = range(4)  # heights of the uppermost sheet of a column, and the greatest of all else
_MANY = 99  # layers at the middle of a column: unknown
_ALONE, _CROWDED = -1, -2  # edges that no other face shares, or more than one
_ZERO, _ONE, _NOWHERE = np.float32(0), np.float32(1), np.float32(math.inf)


@stage_kernel
def _same(corners, i, j):
    return (corners[i] == corners[j]) & (corners[i + 1] == corners[j + 1]) & (corners[i + 2] == corners[j + 2])


@stage_kernel
def _mixed(corners, i):
    """Bits that equal corners share."""
    mixed = np.uint64(0)
    for c in range(3):
        own = np.uint64(np.uint32(bits_of(corners[i + c] + _ZERO)))  # −0 is 0
        mixed = (mixed ^ own) * np.uint64(0x9E3779B97F4A7C15)
        mixed ^= mixed >> np.uint64(29)
    return mixed


@kernel
def find_mates(corners, table, mates):
    """Fill ``mates``: of edge 3 f + k, from corner k of face f on, that of the one other face that has it, or < 0.

    ``table`` has −1 in a power of two of places, at least twice as many as there are edges.
    """
    mask = np.uint64(table.shape[0] - 1)
    mates[:] = _ALONE
    for e in range(mates.shape[0]):
        i, j = 3 * e, 3 * (e + 1 if e % 3 < 2 else e - 2)
        place = (_mixed(corners, i) + _mixed(corners, j)) & mask
        while True:
            other = table[place]
            if other < 0:
                table[place] = e
                break
            p, q = 3 * other, 3 * (other + 1 if other % 3 < 2 else other - 2)
            if (_same(corners, i, p) & _same(corners, j, q)) | (_same(corners, i, q) & _same(corners, j, p)):
                if mates[other] == _ALONE:
                    mates[other], mates[e] = e, other
                else:
                    if mates[other] >= 0:
                        mates[mates[other]] = _CROWDED
                    mates[other] = mates[e] = _CROWDED
                break
            place = (place + np.uint64(1)) & mask


@stage_kernel
def _project(turn, corners, f, s):
    """Fill ``s`` (OF_FACE,): u, v and h of the corners of a face."""
    for k in range(3):
        i = 9 * f + 3 * k
        x, y, z = np.float64(corners[i]), np.float64(corners[i + 1]), np.float64(corners[i + 2])
        w = 1.0 / (turn[8] * x + turn[9] * y + turn[10] * z + turn[11])
        s[U + k] = (turn[0] * x + turn[1] * y + turn[2] * z + turn[3]) * w
        s[V + k] = (turn[4] * x + turn[5] * y + turn[6] * z + turn[7]) * w
        s[H + k] = (turn[12] * x + turn[13] * y + turn[14] * z + turn[15]) * w


@kernel
def find_extents(turn, corners, most, s, extents):
    """Fill ``extents`` (3, 2): least and greatest u, v and h, each of faces that extend less than ``most``."""
    for axis in range(3):
        extents[axis, 0], extents[axis, 1] = math.inf, -math.inf
    for f in range(corners.shape[0] // 9):
        _project(turn, corners, f, s)
        for axis in range(3):
            a, b, c = s[3 * axis], s[3 * axis + 1], s[3 * axis + 2]
            low, high = min(a, b, c), max(a, b, c)
            if high - low < most[axis]:
                extents[axis, 0], extents[axis, 1] = min(extents[axis, 0], low), max(extents[axis, 1], high)


@stage_kernel
def is_rim(s, r, normals, mates, e):
    """Whether a sheet ends, folds, or has a steep valley at an edge of face s, on whose other side is face r."""
    other = mates[e]
    if other < 0:
        return True
    f, k, g = e // 3, e % 3, other // 3
    j, i, m = (k + 1) % 3, (k + 2) % 3, (other % 3 + 2) % 3
    # the edge, and from its start the third corners of both faces
    x, y, z = s[U + j] - s[U + k], s[V + j] - s[V + k], s[H + j] - s[H + k]
    a, b, c = s[U + i] - s[U + k], s[V + i] - s[V + k], s[H + i] - s[H + k]
    p, q, h = r[U + m] - s[U + k], r[V + m] - s[V + k], r[H + m] - s[H + k]
    own, its = x * b - y * a, x * q - y * p
    if own * its >= 0.0:
        return True
    alike = normals[f, 0] * normals[g, 0] + normals[f, 1] * normals[g, 1] + normals[f, 2] * normals[g, 2]
    above = (own * h - (x * c - z * a) * q + (y * c - z * b) * p) * own
    return (abs(alike) < STEEP) & (above > 0.0)


@stage_kernel
def _column(x, last):
    """The column of a coordinate: those at the ends of the lattice go on without end."""
    return np.int64(min(max(math.floor(x), 0.0), last))


@kernel
def draw_rims(turn, corners, normals, mates, size, work, rims):
    """Fill ``rims``: the greatest height of a rim in each column, by row and column."""
    last, s, r = size - 1, work[0], work[1]
    for e in range(mates.shape[0]):
        if e % 3 == 0:
            _project(turn, corners, e // 3, s)
        if (mates[e] >= 0) & (mates[e] < e):
            continue
        if mates[e] >= 0:
            _project(turn, corners, mates[e] // 3, r)
        if not is_rim(s, r, normals, mates, e):
            continue
        k = e % 3
        j = (k + 1) % 3
        if s[V + k] > s[V + j]:
            k, j = j, k
        u, v, h = s[U + k], s[V + k], s[H + k]
        across, down, up = s[U + j] - u, s[V + j] - v, s[H + j] - h
        for row in range(_column(v - MARGIN, last), _column(v + down + MARGIN, last) + 1):
            start = 0.0 if (row == 0) | (down == 0.0) else min(max((row - MARGIN - v) / down, 0.0), 1.0)
            end = 1.0 if (row == last) | (down == 0.0) else min(max((row + 1 + MARGIN - v) / down, 0.0), 1.0)
            a, b = u + start * across, u + end * across
            top = np.float32(h + max(start * up, end * up))
            for t in range(_column(min(a, b) - MARGIN, last), _column(max(a, b) + MARGIN, last) + 1):
                rims[row * size + t] = max(rims[row * size + t], top)


@stage_kernel
def _reach(s, low, high):
    """Least and greatest u of a face between two lines of equal v."""
    least, most = math.inf, -math.inf
    for k in range(3):
        j = k + 1 if k < 2 else 0
        a, b, p, q = s[V + k], s[V + j], s[U + k], s[U + j]
        if (a >= low) & (a <= high):
            least, most = min(least, p), max(most, p)
        if (a - low) * (b - low) < 0.0:
            u = p + (q - p) * ((low - a) / (b - a))
            least, most = min(least, u), max(most, u)
        if (a - high) * (b - high) < 0.0:
            u = p + (q - p) * ((high - a) / (b - a))
            least, most = min(least, u), max(most, u)
    return least, most


@stage_kernel
def _enter(sheets, layers, t, low, high, covers, slack):
    """Enter heights of a face in a column: to the uppermost sheet if it comes near, else above or below it."""
    if low > sheets[t, MOST] + slack:
        sheets[t, BELOW] = max(sheets[t, MOST], sheets[t, BELOW])
        sheets[t, LEAST], sheets[t, MOST], layers[t] = low, high, covers
    elif high < sheets[t, LEAST] - slack:
        sheets[t, BELOW] = max(sheets[t, BELOW], high)
    else:
        sheets[t, LEAST], sheets[t, MOST] = min(low, sheets[t, LEAST]), max(high, sheets[t, MOST])
        layers[t] = min(layers[t] + covers, _MANY)
    if sheets[t, BELOW] > sheets[t, LEAST] - slack:
        layers[t] = _MANY


@kernel
def draw_sheets(turn, corners, size, slack, s, sheets, layers):
    """Fill ``sheets`` (columns, OF_SHEET), and of the uppermost one the ``layers`` at the middles of columns."""
    last = size - 1
    for f in range(corners.shape[0] // 9):
        _project(turn, corners, f, s)
        a, b, c, d = s[U + 1] - s[U], s[V + 1] - s[V], s[U + 2] - s[U], s[V + 2] - s[V]
        area, p, q = a * d - b * c, s[H + 1] - s[H], s[H + 2] - s[H]
        sloped = abs(area) > 1e-9 * (a * a + b * b + c * c + d * d)
        inverse = 1.0 / area if sloped else 0.0
        across, down = (p * d - q * b) * inverse, (q * a - p * c) * inverse
        lowest, highest = s[H] + min(p, q, 0.0), s[H] + max(p, q, 0.0)
        half = (abs(across) + abs(down)) * (0.5 + MARGIN)
        top, bottom = s[V] + min(b, d, 0.0), s[V] + max(b, d, 0.0)
        for row in range(_column(top - MARGIN, last), _column(bottom + MARGIN, last) + 1):
            low = top if row == 0 else max(row - MARGIN, top)
            high = bottom if row == last else min(row + 1 + MARGIN, bottom)
            v = row + 0.5
            least, most = _reach(s, low, high)
            left, right = _reach(s, v, v)  # middles of columns that the face covers; on an edge both faces do
            for column in range(_column(least - MARGIN, last), _column(most + MARGIN, last) + 1):
                u, h, i = column + 0.5, lowest, highest
                if sloped & (row > 0) & (row < last) & (column > 0) & (column < last):
                    middle = s[H] + across * (u - s[U]) + down * (v - s[V])
                    h, i = max(middle - half, lowest), min(middle + half, highest)
                covers = (u >= left - NEAR) & (u <= right + NEAR)
                _enter(sheets, layers, row * size + column, h, i, covers, slack)


@kernel
def tell_columns(sheets, layers, rims, slack, known):
    """Fill ``known``: a height below the uppermost sheet and above all else; NaN where that is no lone sheet."""
    for t in range(known.shape[0]):
        clean = (layers[t] == 1) & (rims[t] < sheets[t, LEAST] - slack)
        middle = 0.5 * (sheets[t, LEAST] + sheets[t, BELOW])
        known[t] = np.float32(max(sheets[t, LEAST] - 4.0 * slack, middle)) if clean else math.nan


@lane_stage
def tell(columns, light, single):
    """Leave in ``WANTED`` those shadow rays of a packet to one light that arrive, in ``LEFT`` the unknown ones.

    Returns
    -------
    int
        How many are unknown.
    """
    t, size, i = columns.turns, np.float32(columns.size), NUMBERS * light
    a0, a1, a2, a3 = t[i], t[i + 1], t[i + 2], t[i + 3]
    b0, b1, b2, b3 = t[i + 4], t[i + 5], t[i + 6], t[i + 7]
    c0, c1, c2, c3 = t[i + 8], t[i + 9], t[i + 10], t[i + 11]
    d0, d1, d2, d3 = t[i + 12], t[i + 13], t[i + 14], t[i + 15]
    slack, most, margin = np.float32(0.5) * t[i + SLACK], size - _ONE, np.float32(0.9 * MARGIN)
    first, solid = np.int64(light * columns.size * columns.size), columns.solid
    for k in range(BLOCK):
        x, y, z = single[at.OX + k], single[at.OY + k], single[at.OZ + k]
        w = _ONE / (c0 * x + c1 * y + c2 * z + c3)
        u, v = (a0 * x + a1 * y + a2 * z + a3) * w, (b0 * x + b1 * y + b2 * z + b3) * w
        h = (d0 * x + d1 * y + d2 * z + d3) * w
        above = (
            single[at.GX + k] * single[at.LX + k] + single[at.GY + k] * single[at.LY + k]
            + single[at.GZ + k] * single[at.LZ + k]
        )  # fmt: skip
        x, y, z = single[at.AX + k], single[at.AY + k], single[at.AZ + k]  # on the way up to the smooth surface
        turned = c0 * x + c1 * y + c2 * z
        aside = max(abs(a0 * x + a1 * y + a2 * z - u * turned), abs(b0 * x + b1 * y + b2 * z - v * turned)) * w
        up = (d0 * x + d1 * y + d2 * z - h * turned) * w
        within = (aside < margin) & (w > _ZERO)
        single[at.X + k] = h if within & (up >= -slack) & (above > _ZERO) else -_NOWHERE
        single[at.Y + k] = h + max(up, _ZERO) if within & solid else _NOWHERE
        u, v = min(max(u, _ZERO), most), min(max(v, _ZERO), most)
        single[at.SHARE + k] = np.float32(np.int32(v)) * size + np.float32(np.int32(u))
    for k in range(BLOCK):
        single[at.SHARE + k] = columns.known[np.uint64(first + np.int64(single[at.SHARE + k]))]
    unknown = 0
    for k in range(BLOCK):
        wanted = single[at.WANTED + k] > _ZERO
        lit, dark = single[at.X + k] > single[at.SHARE + k], single[at.Y + k] < single[at.SHARE + k]
        single[at.LEFT + k] = _ONE if wanted & (not lit) & (not dark) else _ZERO
        unknown += wanted & (not lit) & (not dark)
        single[at.WANTED + k] = _ONE if wanted & lit else _ZERO
    return unknown
