"""How well the sources of a synthesis agree about the disparity of a sample, with each other and with a decoded view.

16 samples of a row are compared together for a disparity, in vectors with those beside them, and kept. Numbers are
whole, or multiples of 2^-8, and have at most 24 bits: float32 holds them exactly.

Functions that are not inlined take the few arrays that they need: a whole `Synthesis` is 150 words on the stack.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ii_core.base.jit import lane_part, lane_stage, part_kernel, stage_kernel
from ii_core.base.references import by_reference

from .kinds import DIFFERENT
from .state import UNKNOWN, zeros
from .transform import LARGEST
from .warp import LATTICE, UNSHIFTED, clamped, led

MATCHED = 4  # sources that take part in matching
TRUNCATED = 40 * 8  # eighths of a code: a larger difference tells no more
LONELY = 22 * 8  # cost of a sample that only one source sees
AGREED = np.array([64, 32, 16, 10, 8], np.int64)  # added to a disagreement, by how many sources agree
LOG_SPAN = 4
SPAN = 1 << LOG_SPAN  # samples of a row whose disagreement is computed together
BESIDE = 8  # and how many more are compared to either side, to fill vectors
LANES = SPAN + 2 * BESIDE
SLOTS = 256  # disparities for which it is kept
MARGIN = LANES + 1  # where a source lies further beside the view, all it has there is its border

# Places in the work memory. For each of three rows: samples of the sources, whether they see them, how far these are
# apart. Then how many sources agree, and how far the disparity of each may be from one with which it agrees.
_SEEN, _APART, _ROW = MATCHED * LANES, 2 * MATCHED * LANES, (2 * MATCHED + 1) * LANES
_AGREEING, _REACH = 3 * _ROW, 3 * _ROW + SPAN
WORK = _REACH + MATCHED
_ZERO, _ONE, _TWO, _THREE, _FOUR, _SIXTEEN = (np.float32(k) for k in (0, 1, 2, 3, 4, 16))
_HALF, _THIRD, _SIXTH, _UNIT = (np.float32(k) for k in (1 / 2, 1 / 3, 1 / 6, 1 / 256))
_MOST, _ALONE, _FAR = np.float32(TRUNCATED), np.float32(LONELY), np.float32(1 << 14)
_NINE_ALONE = np.float32(9 * LONELY)
_NOTHING = np.float32(UNKNOWN)
_BY_NONE, _BY_ONE, _BY_TWO, _BY_THREE, _BY_ALL = (np.float32(k) for k in AGREED)


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


@by_reference
class Matching(NamedTuple):
    """Memory for a comparison of sources.

    Parameters
    ----------
    wide : ndarray of int16, (MATCHED + 1, H, W + 2 MARGIN)
        First planes of the sources, and of the view itself, with margins.
    told : ndarray of int16, (MATCHED, H, W + 2 MARGIN)
        Disparities of the sources.
    work : ndarray of float32, (WORK,)
    seen : ndarray of int64, (3, MATCHED, 2)
        Which samples a source sees, by row.
    kept : ndarray of int16, (SLOTS, SPAN)
        What was found for samples of a row, by disparity.
    marks : ndarray of int64, (SLOTS,)
        Which samples, and which disparity.
    """

    wide: Any
    told: Any
    work: Any
    seen: Any
    kept: Any
    marks: Any


def new_matching(height: int, width: int, told: bool = True) -> Matching:
    """Memory for one view; ``told``: for what the sources' disparities tell, too."""
    return Matching(
        wide=zeros((MATCHED + 1, height, width + 2 * MARGIN))[0],
        told=zeros((MATCHED if told else 0, height, width + 2 * MARGIN))[0],
        work=np.zeros(WORK, np.float32),
        seen=np.zeros((3, MATCHED, 2), np.int64),
        kept=np.zeros((SLOTS, SPAN), np.int16),
        marks=np.full(SLOTS, -1),
    )


@lane_part
def widen(into, plane, repeated):
    """into[:, MARGIN:] = a plane; before and after it `MARGIN` samples: its border ``repeated``, or `UNKNOWN`."""
    height, width = plane.shape
    for y in range(height):
        row, middle, before, beyond = plane[y], into[y, MARGIN:], into[y], into[y, MARGIN + width :]
        for x in range(width):
            middle[x] = row[x]
        first = row[0] if repeated else np.int16(UNKNOWN)
        last = row[np.uint64(width - 1)] if repeated else np.int16(UNKNOWN)
        for x in range(MARGIN):
            before[x], beyond[x] = first, last


@lane_part
def forget(m):
    """Nothing is kept."""
    for k in range(SLOTS):
        m.marks[k] = -1


@lane_part
def prepare(m, views, disparities, sources):
    """Fill m.wide and m.told, and how far disparities reach."""
    forget(m)
    for r in range(min(sources.shape[0], MATCHED)):
        view = np.uint64(sources[r, 0])
        m.work[_REACH + r] = np.float32(reach(sources, r))
        widen(m.wide[r], views[view, 0], True)
        widen(m.told[r], disparities[view], False)


@lane_stage
def _rows(wide, iy, ix):
    """Four rows of a plane with margins, from (iy - 1, ix) on."""
    height, first = wide.shape[0], min(max(ix, -MARGIN), wide.shape[1] - 2 * MARGIN) + MARGIN
    one, two = wide[np.uint64(clamped(iy - 1, height)), first:], wide[np.uint64(clamped(iy, height)), first:]
    three, four = wide[np.uint64(clamped(iy + 1, height)), first:], wide[np.uint64(clamped(iy + 2, height)), first:]
    return one, two, three, four


@lane_stage
def _weights(py, px):
    """Weights of two samples across, in sixteenths, and down."""
    return np.float32(16 - px), np.float32(px), _UNIT * np.float32(16 - py), _UNIT * np.float32(py)


@lane_stage
def _three_between(one, two, three, four, j, a, b, c, e):
    """Samples below each other between those of four rows, bilinearly, rounded down."""
    upper = a * np.float32(two[j]) + b * np.float32(two[j + 1])
    lower = a * np.float32(three[j]) + b * np.float32(three[j + 1])
    above = np.floor(c * (a * np.float32(one[j]) + b * np.float32(one[j + 1])) + e * upper)
    below = np.floor(c * lower + e * (a * np.float32(four[j]) + b * np.float32(four[j + 1])))
    return above, np.floor(c * upper + e * lower), below


@lane_stage
def _take(wide, iy, ix, py, px, work, at):
    """work[at : at + LANES] = samples of a source from (iy - 1, ix) on, between its own by so many sixteenths.

    Those of the next two rows follow `_ROW` and 2 `_ROW` places on.
    """
    (one, two, three, four), (a, b, c, e) = _rows(wide, iy, ix), _weights(py, px)
    for j in range(LANES):
        above, middle, below = _three_between(one, two, three, four, j, a, b, c, e)
        work[at + j], work[at + _ROW + j], work[at + 2 * _ROW + j] = above, middle, below


@lane_stage
def _see(first, last, work, to):
    """work[to : to + LANES] = 1 for those from the first to before the last, else 0."""
    for j in range(LANES):
        work[to + j] = (_ONE if j >= first else _ZERO) * (_ONE if j < last else _ZERO)


@lane_stage
def _truncated(a, b):
    apart = a - b
    apart = apart if apart > _ZERO else -apart
    return apart if apart < _MOST else _MOST


@lane_stage
def _lesser(a, b):
    return a if a < b else b


@lane_stage
def _compare(work, row):
    """Compare samples that all sources see: the least sum of three differences from one of the four, as a mean."""
    for j in range(LANES):
        a, b, c, e = work[row + j], work[row + LANES + j], work[row + 2 * LANES + j], work[row + 3 * LANES + j]
        ab, ac, ae = _truncated(a, b), _truncated(a, c), _truncated(a, e)
        bc, be, ce = _truncated(b, c), _truncated(b, e), _truncated(c, e)
        least = _lesser(_lesser(ab + ac + ae, ab + bc + be), _lesser(ac + bc + ce, ae + be + ce))
        work[row + _APART + j] = np.floor((least + _HALF) * _THIRD)


@lane_stage
def _compare_seen(work, row):
    """Compare them as `_least` does where some sources may not see them."""
    for j in range(LANES):
        a, b, c, e = work[row + j], work[row + LANES + j], work[row + 2 * LANES + j], work[row + 3 * LANES + j]
        by_a, by_b = work[row + _SEEN + j], work[row + _SEEN + LANES + j]
        by_c, by_e = work[row + _SEEN + 2 * LANES + j], work[row + _SEEN + 3 * LANES + j]
        ab, ac, ae = _truncated(a, b), _truncated(a, c), _truncated(a, e)
        bc, be, ce = _truncated(b, c), _truncated(b, e), _truncated(c, e)
        one = ab * by_b + ac * by_c + ae * by_e + _FAR * (_ONE - by_a)
        two = ab * by_a + bc * by_c + be * by_e + _FAR * (_ONE - by_b)
        three = ac * by_a + bc * by_b + ce * by_e + _FAR * (_ONE - by_c)
        four = ae * by_a + be * by_b + ce * by_c + _FAR * (_ONE - by_e)
        least, seen = _lesser(_lesser(one, two), _lesser(three, four)) + _HALF, by_a + by_b + by_c + by_e
        mean = np.floor(least * _THIRD if seen > _THREE else (least * _HALF if seen > _TWO else least))
        work[row + _APART + j] = mean + _SIXTEEN * (_FOUR - seen) if seen > _ONE else _ALONE


@lane_stage
def _count_agreeing(told, r, iy, ix, d, work):
    """Count a source whose own disparity says that it sees the same: what `_agrees` tells, for `SPAN` samples."""
    height, width = told.shape[0], told.shape[1] - 2 * MARGIN
    if iy < 0 or iy >= height:
        return
    most, own = work[_REACH + r], np.float32(d)
    first = min(max(ix, -MARGIN), width) + MARGIN
    row = told[np.uint64(iy), first:]
    for j in range(SPAN):
        other = np.float32(row[j])
        apart = other - own
        apart = apart if apart > _ZERO else -apart
        work[_AGREEING + j] += (_ONE if apart <= most else _ZERO) * (_ONE if other > _NOTHING else _ZERO)


@lane_part
def _fill(m, views, sources, values, y, x0, d, into):
    """into[:SPAN] = disagreement about a disparity of the samples from (y, x0) on."""
    work, shape, x = m.work, views.shape[2:], x0 - BESIDE
    height, width = shape
    every = True
    for j in range(SPAN):
        work[_AGREEING + j] = _ZERO
    for r in range(MATCHED):
        dy, dx = led(sources, r, d, y, x0, shape)
        _count_agreeing(m.told[r], r, y + ((dy + 128) >> 8), x0 + ((dx + 128) >> 8), d, work)
        _take(m.wide[r], y + (dy >> 8), x + (dx >> 8), (dy >> 4) & 15, (dx >> 4) & 15, work, r * LANES)
        first, last = -x - ((dx + 128) >> 8), width - x - ((dx + 127) >> 8)
        every = every and first < BESIDE and last > BESIDE + SPAN
        for k in range(3):
            below = 256 * (y + k - 1) + dy
            outside = below < -128 or below > 256 * height - 128
            m.seen[k, r, 0], m.seen[k, r, 1] = first, first if outside else last
            every = every and not outside
    for k in range(3):
        if every:
            _compare(work, k * _ROW)
        else:
            for r in range(MATCHED):
                _see(m.seen[k, r, 0], m.seen[k, r, 1], work, k * _ROW + _SEEN + r * LANES)
            _compare_seen(work, k * _ROW)
    if sources.shape[1] > UNSHIFTED:  # those beside the samples may be in another square, with other shifts
        at = _ROW + _APART + BESIDE
        work[at - 1] = np.float32(_difference(views, sources, y, x0 - 1, d, values))
        work[at + SPAN] = np.float32(_difference(views, sources, y, x0 + SPAN, d, values))
    _add_up(work, into)


@lane_stage
def _add_up(work, into):
    """into[:] = a sixth of the sum of a sample and those around, its own twice; and more, the fewer sources agree."""
    for j in range(SPAN):
        at = _APART + BESIDE + j
        around = work[at] + work[2 * _ROW + at] + work[_ROW + at - 1] + work[_ROW + at + 1]
        total, by = around + _TWO * work[_ROW + at], work[_AGREEING + j]
        few = _BY_TWO if by > _ONE else (_BY_ONE if by > _ZERO else _BY_NONE)
        more = _BY_ALL if by > _THREE else (_BY_THREE if by > _TWO else few)
        into[j] = np.int16(np.floor((total + _HALF) * _SIXTH) + more)


@part_kernel
def _one(views, disparities, sources, values, y, x, d):
    """The disagreement about a sample alone: where sources are fewer, or shifts change from row to row."""
    total = 2 * _difference(views, sources, y, x, d, values)
    total += _difference(views, sources, y, x - 1, d, values) + _difference(views, sources, y, x + 1, d, values)
    total += _difference(views, sources, y - 1, x, d, values) + _difference(views, sources, y + 1, x, d, values)
    agreeing = 0
    for r in range(min(sources.shape[0], MATCHED)):
        if _agrees(disparities, sources, r, y, x, d):
            agreeing += 1
    return total // 6 + AGREED[np.uint64(agreeing)]


@stage_kernel
def _place(m, width, y, x, d):
    """Row of m.kept for the span of a sample and a disparity, and whether it holds them already; it is marked so."""
    mark = ((y * width + (x >> LOG_SPAN)) << 16) | (d & 0xFFFF)
    place = np.uint64(hashed(d) & (SLOTS - 1))
    held = m.marks[place] == mark
    m.marks[place] = mark
    return place, held


@stage_kernel
def disagreement(s, m, y, x, d):
    """Return the difference of the sources around a sample for a disparity, in eighths of a code."""
    width, first = s.counts.shape[1], x & -SPAN
    place, held = _place(m, width, y, x, d)
    if not held:
        at_border = (y & (LARGEST - 1)) in (0, LARGEST - 1)  # of a square of shifts
        if s.sources.shape[0] < MATCHED or (s.sources.shape[1] > UNSHIFTED and at_border):
            for i in range(first, min(first + SPAN, width)):
                cost = _one(s.views, s.disparities, s.sources, s.scratch[0], y, i, d)
                m.kept[place, np.uint64(i - first)] = cost
        else:
            _fill(m, s.views, s.sources, s.scratch[0], y, first, d, m.kept[place])
    return np.int64(m.kept[place, np.uint64(x - first)])


@lane_stage
def _take_apart(wide, iy, ix, py, px, work, rows):
    """work[_APART :] = sums of differences of a source's samples from the view's own, over three rows.

    The own samples are in the second place of each row; ``rows``: 1, or 0 for a row beyond the view.
    """
    (one, two, three, four), (a, b, c, e), (upper, lower) = _rows(wide, iy, ix), _weights(py, px), rows
    for j in range(LANES):
        above, middle, below = _three_between(one, two, three, four, j, a, b, c, e)
        apart = _truncated(middle, work[_ROW + LANES + j]) + upper * _truncated(above, work[LANES + j])
        work[_APART + j] = apart + lower * _truncated(below, work[2 * _ROW + LANES + j])


@lane_part
def _fill_mismatch(m, sources, y, x0, d, into):
    """into[:SPAN] = `mismatch` of the samples from (y, x0) on.

    In the first row's places: a source's samples, the view's own, and the least two sums of sources so far.
    """
    work, x, count = m.work, x0 - BESIDE, min(sources.shape[0], MATCHED)
    height, width = m.wide.shape[1], m.wide.shape[2] - 2 * MARGIN
    rows, least, second = (_ONE if y > 0 else _ZERO, _ONE if y + 1 < height else _ZERO), 2 * LANES, 3 * LANES
    _take(m.wide[MATCHED], y, x, np.int64(0), np.int64(0), work, LANES)
    for j in range(SPAN):
        work[least + j] = work[second + j] = _FAR
    for r in range(count):
        dy, dx = led(sources, r, d, y, x0, (height, width))
        iy, ix = y + (dy >> 8), x + (dx >> 8)
        _take_apart(m.wide[r], iy, ix, (dy >> 4) & 15, (dx >> 4) & 15, work, rows)
        if x0 == 0 or x0 + SPAN >= width:
            _see(-x, width - x, work, _SEEN)
            for j in range(LANES):
                work[_APART + j] *= work[_SEEN + j]
        beside, first, last = iy < -1 or iy > height, -1 - ix - BESIDE, width + 1 - ix - BESIDE
        for j in range(SPAN):
            at = _APART + BESIDE + j
            total = work[at - 1] + work[at] + work[at + 1]
            total = _NINE_ALONE if beside or j < first or j >= last else total
            one, two = work[least + j], work[second + j]
            work[second + j] = _lesser(two, total if total > one else one)
            work[least + j] = _lesser(one, total)
    for j in range(SPAN):
        other = work[second + j] if count > 1 else work[least + j]
        into[j] = np.int16(work[least + j] + other)


@stage_kernel
def mismatch(s, m, y, x, d):
    """Return the difference of the best two sources from the decoded view around a sample, in eighths of a code."""
    first = x & -SPAN
    place, held = _place(m, s.counts.shape[1], y, x, d)
    if not held:
        _fill_mismatch(m, s.sources, y, first, d, m.kept[place])
    return np.int64(m.kept[place, np.uint64(x - first)])


@stage_kernel
def _agrees(disparities, sources, r, y, x, d):
    """Whether a source's own disparity says that it sees the same."""
    height, width = disparities.shape[1:]
    dy, dx = led(sources, r, d, y, x, (height, width))
    i, j = x + ((dx + 128) >> 8), y + ((dy + 128) >> 8)
    if i < 0 or j < 0 or i >= width or j >= height:
        return False
    other = np.int64(disparities[np.uint64(sources[r, 0]), np.uint64(j), np.uint64(i)])
    return other != UNKNOWN and abs(other - d) <= reach(sources, r)


@stage_kernel
def reach(sources, r):
    """How far the disparity of a source may be from one with which it agrees."""
    return ((DIFFERENT << LATTICE) - 1) // max(abs(sources[r, 1]), abs(sources[r, 2]), 1)


assert 3 * TRUNCATED + AGREED.max() < 1 << 15
