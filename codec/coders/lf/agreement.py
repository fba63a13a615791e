"""Agreement of a synthesis' sources about the disparity of a sample.

A sum over five samples needs differences that its neighbours need as well. They are computed for `SPAN` samples of a
row at a time and kept for a few rows and disparities.
"""

from __future__ import annotations

import numpy as np

from .blocks import DIFFERENT, UNKNOWN
from .jit import inner, lean
from .warp import clamped

MATCHED = 4  # sources that take part in matching
TRUNCATED = 40 * 8  # eighths of a code: a larger difference tells no more
LONELY = 22 * 8  # cost of a sample that only one source sees
AGREED = np.array([64, 32, 16, 10, 8], np.int64)  # added to a disagreement, by how many sources agree
LEAST_AGREED = 8
SPAN = 8  # samples of a row whose differences are computed together
ROWS, SLOTS = 4, 8  # rows and disparities that are kept


@inner
def between(plane, y, x, py, px):
    """A plane at (y, x), between samples bilinearly by sixteenths, times 256."""
    height, width = plane.shape
    if 0 <= x < width - 1 and 0 <= y < height - 1:
        x0, x1, y0, y1 = x, x + 1, y, y + 1
    else:
        x0, x1, y0, y1 = clamped(x, width), clamped(x + 1, width), clamped(y, height), clamped(y + 1, height)
    upper = np.int64(plane[y0, x0]) * (16 - px) + np.int64(plane[y0, x1]) * px
    lower = np.int64(plane[y1, x0]) * (16 - px) + np.int64(plane[y1, x1]) * px
    return upper * (16 - py) + lower * py


@lean
def _difference(s, y, x, d):
    """Return the difference of the sources at a sample for a disparity, in eighths of a code."""
    height, width = s.counts.shape
    count = min(s.sources.shape[0], MATCHED)
    seen, values = 0, s.scratch[0]
    for r in range(count):
        at_x, at_y = 256 * x + d * s.sources[r, 1], 256 * y + d * s.sources[r, 2]
        if -128 <= at_x <= 256 * width - 128 and -128 <= at_y <= 256 * height - 128:
            part_y, part_x = (at_y >> 4) & 15, (at_x >> 4) & 15
            values[seen] = between(s.views[s.sources[r, 0], 0], at_y >> 8, at_x >> 8, part_y, part_x) >> 8
            seen += 1
    if seen < 2:
        return np.int64(LONELY)
    least = np.int64(1 << 40)
    for a in range(seen):
        differs = np.int64(0)
        for b in range(seen):
            differs += min(abs(values[a] - values[b]), TRUNCATED)
        least = min(least, differs)
    return (least // 3 if seen == 4 else (least >> 1 if seen == 3 else least)) + (count - seen) * 16


@inner
def _truncated(a, b):
    return np.int32(min(np.int32(abs(np.int32(a - b))), np.int32(TRUNCATED)))


@lean
def _fill_span(s, y, x0, d, into):
    """into[:SPAN] = differences of the samples from (y, x0) on."""
    height, width = s.counts.shape
    plain = s.sources.shape[0] >= MATCHED and x0 + SPAN <= width
    if plain:
        for r in range(MATCHED):
            dx, dy = d * s.sources[r, 1], d * s.sources[r, 2]
            ix, iy = x0 + (dx >> 8), y + (dy >> 8)
            if ix < 0 or iy < 0 or ix + SPAN >= width or iy + 1 >= height:
                plain = False
                break
            px, py = (dx >> 4) & 15, (dy >> 4) & 15
            a, b = np.int32((16 - px) * (16 - py)), np.int32(px * (16 - py))
            c, e = np.int32((16 - px) * py), np.int32(px * py)
            upper = s.views[s.sources[r, 0], 0, iy, ix : ix + SPAN + 1]
            lower = s.views[s.sources[r, 0], 0, iy + 1, ix : ix + SPAN + 1]
            row = s.span[r]
            for j in range(SPAN):
                total = np.int32(a * upper[j] + b * upper[j + 1] + c * lower[j] + e * lower[j + 1])
                row[j] = total >> np.int32(8)
    if not plain:
        for j in range(min(SPAN, width - x0)):
            into[j] = _difference(s, y, x0 + j, d)
        return
    first, second, third, fourth = s.span[0], s.span[1], s.span[2], s.span[3]
    for j in range(SPAN):
        ab, ac = _truncated(first[j], second[j]), _truncated(first[j], third[j])
        ad, bc = _truncated(first[j], fourth[j]), _truncated(second[j], third[j])
        bd, cd = _truncated(second[j], fourth[j]), _truncated(third[j], fourth[j])
        one = min(np.int32(ab + ac + ad), np.int32(ab + bc + bd))
        other = min(np.int32(ac + bc + cd), np.int32(ad + bd + cd))
        # A third, rounded down: exact below 2^16.
        into[j] = np.int32(np.int32(min(one, other)) * np.int32(21846)) >> np.int32(16)


@inner
def _kept(s, y, x, d):
    """`_difference`, kept from samples nearby."""
    height, width = s.counts.shape
    if y < 0 or x < 0 or y >= height or x >= width:
        return _difference(s, y, x, d)
    row, across, slot, mark = y & (ROWS - 1), x // SPAN, ((d * 40503) >> 8) & (SLOTS - 1), (y << 16) | (d & 0xFFFF)
    if s.marks[row, across, slot] != mark:
        s.marks[row, across, slot] = mark
        _fill_span(s, y, across * SPAN, d, s.kept[row, across, slot])
    return np.int64(s.kept[row, across, slot, x & (SPAN - 1)])


@lean
def disagreement(s, y, x, d, enough):
    """Return the difference of the sources around a sample for a disparity, in eighths of a code.

    A sum that is known to reach ``enough`` is not finished.
    """
    total, most = 2 * _kept(s, y, x, d), 6 * (enough - LEAST_AGREED)
    for place in range(1, 5):
        if total >= most:
            return enough
        j = y + (1 if place == 3 else (-1 if place == 4 else 0))
        i = x + (1 if place == 1 else (-1 if place == 2 else 0))
        total += _kept(s, j, i, d)
    if total >= most:
        return enough
    agreeing = 0
    for r in range(min(s.sources.shape[0], MATCHED)):
        if agrees(s, r, y, x, d):
            agreeing += 1
    return total // 6 + AGREED[agreeing]


@inner
def agrees(s, r, y, x, d):
    """Whether a source's own disparity says that it sees the same."""
    height, width = s.counts.shape
    across, down = s.sources[r, 1], s.sources[r, 2]
    i, j = x + ((d * across + 128) >> 8), y + ((d * down + 128) >> 8)
    if i < 0 or j < 0 or i >= width or j >= height:
        return False
    other = np.int64(s.disparities[s.sources[r, 0], j, i])
    return other != UNKNOWN and abs(other - d) * max(abs(across), abs(down)) < DIFFERENT


assert AGREED.min() == LEAST_AGREED and 3 * TRUNCATED < 1 << 15
