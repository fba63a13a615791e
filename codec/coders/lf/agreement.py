"""Agreement of a synthesis' sources about the disparity of a sample.

A sum over five samples needs differences that its neighbours need as well. They are computed for `SPAN` samples of a
row at a time and kept for a few rows and disparities.

Functions that are not inlined take the few arrays that they need: a whole `Synthesis` is 150 words on the stack.
"""

from __future__ import annotations

import numpy as np

from ii_core.base.jit import part_kernel, stage_kernel

from .kinds import DIFFERENT
from .state import UNKNOWN
from .warp import LATTICE, clamped, led

MATCHED = 4  # sources that take part in matching
TRUNCATED = 40 * 8  # eighths of a code: a larger difference tells no more
LONELY = 22 * 8  # cost of a sample that only one source sees
AGREED = np.array([64, 32, 16, 10, 8], np.int64)  # added to a disagreement, by how many sources agree
LEAST_AGREED = 8
LOG_SPAN = 3
SPAN = 1 << LOG_SPAN  # samples of a row whose differences are computed together
ROWS, SLOTS = 4, 32  # rows and disparities that are kept


@stage_kernel
def between(plane, y, x, py, px):
    """A plane at (y, x), between samples bilinearly by sixteenths, times 256."""
    height, width = plane.shape
    if 0 <= x < width - 1 and 0 <= y < height - 1:
        x0, x1, y0, y1 = x, x + 1, y, y + 1
    else:
        x0, x1, y0, y1 = clamped(x, width), clamped(x + 1, width), clamped(y, height), clamped(y + 1, height)
    left, right = np.uint64(x0), np.uint64(x1)
    above, below = plane[np.uint64(y0)], plane[np.uint64(y1)]
    upper = np.int64(above[left]) * (16 - px) + np.int64(above[right]) * px
    lower = np.int64(below[left]) * (16 - px) + np.int64(below[right]) * px
    return upper * (16 - py) + lower * py


@stage_kernel
def hashed(d):
    """Bits in which disparities nearby differ."""
    return (d * 40503) >> 8


@stage_kernel
def _sees(at_x, at_y, width, height):
    """Whether a position in units of 2^-8 lies in a view, or within half a sample of it."""
    return -128 <= at_x <= 256 * width - 128 and -128 <= at_y <= 256 * height - 128


@stage_kernel
def _least(values, seen, count):
    """The least sum of differences of one of ``seen`` values from the others, a mean of three; more for less seen."""
    if seen < 2:
        return np.int64(LONELY)
    least = np.int64(1 << 40)
    for a in range(seen):
        differs = np.int64(0)
        for b in range(seen):
            differs += min(abs(values[a] - values[b]), TRUNCATED)
        least = min(least, differs)
    return (least // 3 if seen == 4 else (least >> 1 if seen == 3 else least)) + (count - seen) * 16


@part_kernel
def _difference(views, sources, y, x, d, values):
    """Return the difference of the sources at a sample for a disparity, in eighths of a code."""
    height, width = views.shape[2:]
    count, seen = min(sources.shape[0], MATCHED), 0
    for r in range(count):
        dy, dx = led(sources, r, d, y, x, (height, width))
        at_x, at_y = 256 * x + dx, 256 * y + dy
        if _sees(at_x, at_y, width, height):
            plane = views[np.uint64(sources[r, 0]), 0]
            values[np.uint64(seen)] = between(plane, at_y >> 8, at_x >> 8, (at_y >> 4) & 15, (at_x >> 4) & 15) >> 8
            seen += 1
    return _least(values, seen, count)


@stage_kernel
def _truncated(a, b):
    return np.int32(min(np.int32(abs(np.int32(a - b))), np.int32(TRUNCATED)))


@stage_kernel
def _take_span(plane, y, x0, dy, dx, row):
    """row[:] = a source's samples for `SPAN` samples from (y, x0) on, moved by (dy, dx).

    Return bits of those that it does not see.
    """
    height, width = plane.shape
    ix, iy, px, py = x0 + (dx >> 8), y + (dy >> 8), (dx >> 4) & 15, (dy >> 4) & 15
    if ix >= 0 and iy >= 0 and ix + SPAN < width and iy + 1 < height:
        a, b = np.int32((16 - px) * (16 - py)), np.int32(px * (16 - py))
        c, e = np.int32((16 - px) * py), np.int32(px * py)
        upper, lower = plane[np.uint64(iy), ix : ix + SPAN + 1], plane[np.uint64(iy + 1), ix : ix + SPAN + 1]
        for j in range(SPAN):
            total = np.int32(a * upper[j] + b * upper[j + 1] + c * lower[j] + e * lower[j + 1])
            row[j] = total >> np.int32(8)
        return 0
    unseen = 0
    for j in range(SPAN):
        if _sees(256 * (x0 + j) + dx, 256 * y + dy, width, height):
            row[j] = between(plane, iy, ix + j, py, px) >> 8
        else:
            unseen |= 1 << j
    return unseen


@part_kernel
def _fill_span(views, sources, span, scratch, y, x0, d, into):
    """into[:SPAN] = differences of the samples from (y, x0) on."""
    width, values, unseen = views.shape[3], scratch[0], scratch[1]
    if sources.shape[0] < MATCHED or x0 + SPAN > width:
        for j in range(min(SPAN, width - x0)):
            into[j] = _difference(views, sources, y, x0 + j, d, values)
        return
    some = np.int64(0)  # bits of samples that not every source sees
    for r in range(MATCHED):
        plane = views[np.uint64(sources[r, 0]), 0]
        dy, dx = led(sources, r, d, y, x0, plane.shape)
        unseen[r] = _take_span(plane, y, x0, dy, dx, span[r])
        some |= unseen[r]
    first, second, third, fourth = span[0], span[1], span[2], span[3]
    for j in range(SPAN):
        ab, ac = _truncated(first[j], second[j]), _truncated(first[j], third[j])
        ad, bc = _truncated(first[j], fourth[j]), _truncated(second[j], third[j])
        bd, cd = _truncated(second[j], fourth[j]), _truncated(third[j], fourth[j])
        one = min(np.int32(ab + ac + ad), np.int32(ab + bc + bd))
        other = min(np.int32(ac + bc + cd), np.int32(ad + bd + cd))
        # A third, rounded down: exact below 2^16.
        into[j] = np.int32(np.int32(min(one, other)) * np.int32(21846)) >> np.int32(16)
    if some:
        for j in range(SPAN):
            if (some >> j) & 1:
                seen = 0
                for r in range(MATCHED):
                    if not (unseen[r] >> j) & 1:
                        values[np.uint64(seen)] = span[r, j]
                        seen += 1
                into[j] = _least(values, seen, np.int64(MATCHED))


@stage_kernel
def _span(s, y, across, d):
    """Row of ``s.kept`` that holds the differences of a span of a row, computed here if they are not kept."""
    spans = (s.counts.shape[1] + SPAN - 1) >> LOG_SPAN
    mark = (y << 16) | (d & 0xFFFF)
    place = np.uint64((((y & (ROWS - 1)) * spans + across) * SLOTS) | (hashed(d) & (SLOTS - 1)))
    if s.marks[place] != mark:
        s.marks[place] = mark
        _fill_span(s.views, s.sources, s.span, s.scratch, y, across * SPAN, d, s.kept[place])
    return place


@stage_kernel
def _beside(s, y, x, d):
    """`_difference`, kept from samples nearby."""
    height, width = s.counts.shape
    if y < 0 or x < 0 or y >= height or x >= width:
        return _difference(s.views, s.sources, y, x, d, s.scratch[0])
    return np.int64(s.kept[_span(s, y, x >> LOG_SPAN, d), np.uint64(x & (SPAN - 1))])


@stage_kernel
def disagreement(s, y, x, d, enough):
    """Return the difference of the sources around a sample for a disparity, in eighths of a code.

    A sum that is known to reach ``enough`` is not finished.
    """
    most, at = 6 * (enough - LEAST_AGREED), x & (SPAN - 1)
    own = _span(s, y, x >> LOG_SPAN, d)
    total = 2 * np.int64(s.kept[own, np.uint64(at)])
    if total >= most:
        return enough
    within = at < SPAN - 1 and x + 1 < s.counts.shape[1]
    right = np.int64(s.kept[own, np.uint64(at + 1)]) if within else _beside(s, y, x + 1, d)
    left = np.int64(s.kept[own, np.uint64(at - 1)]) if at > 0 else _beside(s, y, x - 1, d)
    total += right + left
    if total >= most:
        return enough
    total += _beside(s, y + 1, x, d)
    if total >= most:
        return enough
    total += _beside(s, y - 1, x, d)
    if total >= most:
        return enough
    agreeing = 0
    for r in range(min(s.sources.shape[0], MATCHED)):
        if agrees(s, r, y, x, d):
            agreeing += 1
    return total // 6 + AGREED[np.uint64(agreeing)]


@stage_kernel
def agrees(s, r, y, x, d):
    """Whether a source's own disparity says that it sees the same."""
    height, width = s.counts.shape
    across, down = s.sources[r, 1], s.sources[r, 2]
    dy, dx = led(s.sources, r, d, y, x, (height, width))
    i, j = x + ((dx + 128) >> 8), y + ((dy + 128) >> 8)
    if i < 0 or j < 0 or i >= width or j >= height:
        return False
    other = np.int64(s.disparities[np.uint64(s.sources[r, 0]), np.uint64(j), np.uint64(i)])
    return other != UNKNOWN and abs(other - d) * max(abs(across), abs(down)) < DIFFERENT << LATTICE


assert AGREED.min() == LEAST_AGREED and 3 * TRUNCATED < 1 << 15
