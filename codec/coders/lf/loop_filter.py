"""In-loop filter of a decoded view, by plane: symmetric and odd taps, of samples that are classed by activity.

After Wiener filters in video coding (Tsai et al. 2013, adaptive loop filter). A filter adds to a sample
``(Σ tap · difference + 128) >> 8``. Differences are those of two opposite neighbours' sum from twice the sample,
of two opposite neighbours (they move a plane by parts of a sample), in the second and third plane, of the first
plane's neighbours, and in the first plane those of neighbours from the sample, each limited: they smooth beside an
edge and leave the edge; and what a `learnt` network guesses. All planes are filtered from the decoded ones before any
filter.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ii_core.base.jit import lane_kernel, lane_part, lane_stage, lean_kernel, part_kernel
from ii_core.base.references import by_reference

from . import contexts as at
from .arithmetic import code_bit, code_number, code_raw
from .state import LIMIT
from .warp import clamped

# Six even pairs, two odd ones, and six even of the first plane: if it is filtered itself, limited ones, from version
# 13 on, and from version 15 on what a network guesses. `find_differences` lists them.
TAPS, OWN, COMMON = 15, 8, 14
GROUPS = np.array([0, 0, 1, 1, 1, 1, 2, 2, 3, 3, 3, 3, 3, 3, 3])  # of contexts, by tap
CLASSES = 8
COUNTS = 0, 1, 4, 8  # classes of a filter, by its mode; 0: not filtered
BORDER = 2
MOST_TAP = 127
BINS = 4096
BIN_SHIFT = 3
ONE, TWO, THREE, FOUR = (np.uint64(i) for i in range(1, 5))


@by_reference
class Filters(NamedTuple):
    """Filters of all views.

    Parameters
    ----------
    modes : ndarray of int8, (J, 3)
        By view and plane, index into `COUNTS`.
    taps : ndarray of int8, (J, 3, CLASSES, TAPS)
        In 2^-8.
    latest : ndarray of int64, (3,)
        The view whose filter of a plane was coded last; -1 for none.
    before : ndarray of int64, (3,)
        1 if the view coded before was not filtered in a plane, 2 if it was; 0 for none.
    """

    modes: Any
    taps: Any
    latest: Any
    before: Any


def new_filters(views: int) -> Filters:
    """No view is filtered."""
    return Filters(
        modes=np.zeros((views, 3), np.int8),
        taps=np.zeros((views, 3, CLASSES, TAPS), np.int8),
        latest=np.full(3, -1),
        before=np.zeros(3, np.int64),
    )


@lean_kernel
def code_filter(coder, filters, view, same, own):
    """Write or read the filters of a view; bit p of ``same`` says that of plane p is the one coded last.

    ``own`` is the number of the first plane's taps.
    """
    modes, taps = filters.modes, filters.taps
    for p in range(3):
        latest = filters.latest[p]
        mode = np.int64(modes[view, p])
        on = code_bit(coder, at.FILTERED + 3 * p + filters.before[p], 1 if mode else 0)
        filters.before[p] = 1 + on
        if not on:
            modes[view, p] = 0
        elif latest >= 0 and code_bit(coder, np.int64(at.FILTER_SAME + p), (same >> p) & 1):
            modes[view, p] = modes[latest, p]
            for k in range(CLASSES):
                for i in range(TAPS):
                    taps[view, p, k, i] = taps[latest, p, k, i]
        else:
            several = code_bit(coder, np.int64(at.FILTER_CLASSES + 2 * p), 1 if mode > 1 else 0)
            if several:
                several += code_bit(coder, np.int64(at.FILTER_CLASSES + 2 * p + 1), 1 if mode > 2 else 0)
            modes[view, p] = 1 + several
            count, length = 1 if several == 0 else 2 << several, COMMON if p else own
            _code_taps(coder, taps[view, p], 1 if p else 0, count, length)
            filters.latest[p] = view


@part_kernel
def _code_taps(coder, taps, plane, count, length):
    """Write or read taps: the shift of all, and multiples of its power, as differences from the class before."""
    shift, ones = 0, np.int64(0)
    for k in range(count):
        for i in range(TAPS):
            ones |= np.int64(taps[k, i])
    while shift < 3 and ones and not (ones >> shift) & 1:
        shift += 1
    shift = 2 * code_raw(coder, shift >> 1) + code_raw(coder, shift & 1)
    for k in range(count):
        for i in range(length):
            context = at.TAP + (plane * 4 + GROUPS[i]) * 12
            expected = np.int64(taps[k - 1, i]) >> shift if k else np.int64(0)
            value = (np.int64(taps[k, i]) >> shift) - expected
            size = code_number(coder, context, np.int64(12), np.int64(1), abs(value))
            if size and code_raw(coder, 1 if value < 0 else 0):
                size = -size
            taps[k, i] = min(max((expected + size) << shift, -MOST_TAP), MOST_TAP)


@lane_stage
def find_differences(planes, p, y, limit, guess, found):
    """found[:TAPS, :W] = differences of a row's samples from their neighbours; planes are (3, H + 4, W + 4).

    ``guess`` (H, W) is twice what the first plane lacks; without rows it is 0.
    """
    plane = planes[p]
    outer, above, row, below, last = plane[y], plane[y + 1], plane[y + 2], plane[y + 3], plane[y + 4]
    _find_even(outer, above, row, below, last, found)
    for i in range(found.shape[1]):
        x = np.uint64(i)
        found[6, x] = np.int32(row[x + THREE]) - np.int32(row[x + ONE])
        found[7, x] = np.int32(below[x + TWO]) - np.int32(above[x + TWO])
    if p:
        plane = planes[0]
        _find_even(plane[y], plane[y + 1], plane[y + 2], plane[y + 3], plane[y + 4], found[OWN:])
    else:
        for i in range(found.shape[1]):
            x = np.uint64(i)
            own = np.int32(row[x + TWO])
            found[8, x] = _limited(row[x + ONE], own, limit) + _limited(row[x + THREE], own, limit)
            found[9, x] = _limited(above[x + TWO], own, limit) + _limited(below[x + TWO], own, limit)
            found[10, x] = _limited(above[x + ONE], own, limit) + _limited(below[x + THREE], own, limit)
            found[11, x] = _limited(above[x + THREE], own, limit) + _limited(below[x + ONE], own, limit)
            found[12, x] = _limited(row[x], own, limit) + _limited(row[x + FOUR], own, limit)
            found[13, x] = _limited(outer[x + TWO], own, limit) + _limited(last[x + TWO], own, limit)
    if p == 0 and len(guess):
        row = guess[y]
        for i in range(found.shape[1]):
            found[COMMON, np.uint64(i)] = row[np.uint64(i)]
    else:
        for i in range(found.shape[1]):
            found[COMMON, np.uint64(i)] = 0


@lane_stage
def _find_even(outer, above, row, below, last, found):
    """found[:6] = even differences of a row's samples, from it and two rows to either side."""
    for i in range(found.shape[1]):
        x = np.uint64(i)
        twice = np.int32(2 * np.int32(row[x + TWO]))
        found[0, x] = np.int32(np.int32(row[x + ONE]) + np.int32(row[x + THREE])) - twice
        found[1, x] = np.int32(np.int32(above[x + TWO]) + np.int32(below[x + TWO])) - twice
        found[2, x] = np.int32(np.int32(above[x + ONE]) + np.int32(below[x + THREE])) - twice
        found[3, x] = np.int32(np.int32(above[x + THREE]) + np.int32(below[x + ONE])) - twice
        found[4, x] = np.int32(np.int32(row[x]) + np.int32(row[x + FOUR])) - twice
        found[5, x] = np.int32(np.int32(outer[x + TWO]) + np.int32(last[x + TWO])) - twice


@lane_stage
def _limited(other, own, limit):
    """Difference of two samples, of the limit's magnitude at most."""
    return min(max(np.int32(np.int32(other) - own), np.int32(-limit)), limit)


@lane_part
def with_border(views, view, planes):
    """planes (3, H + 4, W + 4) = a view and its border, which repeats its samples."""
    height, width = views.shape[2:]
    for p in range(3):
        for y in range(height + 2 * BORDER):
            row, into = views[view, p, clamped(y - BORDER, height)], planes[p, y]
            for i in range(width):
                into[np.uint64(i) + TWO] = row[np.uint64(i)]
            for i in range(BORDER):
                into[i], into[width + BORDER + i] = row[0], row[width - 1]


@lane_part
def classify(planes, activity, classes, bins):
    """classes = by eighths of the samples in order of activity.

    Activity is the sum of |second differences| along rows and columns of the first plane over 5×5 samples.
    """
    height, width = classes.shape
    _measure_activity(planes, activity)
    for i in range(BINS):
        bins[i] = 0
    for y in range(height):
        for x in range(width):
            bins[activity[0, y, x]] += 1
    below = np.int64(0)
    for i in range(BINS):  # of each bin its class
        count = np.int64(bins[i])
        bins[i] = min(CLASSES * below // (height * width), CLASSES - 1)
        below += count
    for y in range(height):
        for x in range(width):
            classes[y, x] = bins[activity[0, y, x]]


@lane_stage
def _measure_activity(planes, activity):
    """activity[0, :H, :W] = bins of activity; rows of sums along rows lie in activity[1]."""
    height, width = activity.shape[1] - 2 * BORDER, activity.shape[2] - 2 * BORDER
    for y in range(height):
        above, row, below, into = planes[0, y + 1], planes[0, y + 2], planes[0, y + 3], activity[0, y]
        for i in range(width):
            x = np.uint64(i)
            twice = np.int32(2 * np.int32(row[x + TWO]))
            across = np.int32(np.int32(row[x + ONE]) + np.int32(row[x + THREE])) - twice
            down = np.int32(np.int32(above[x + TWO]) + np.int32(below[x + TWO])) - twice
            into[x + TWO] = abs(np.int32(across)) + abs(np.int32(down))
        for i in range(BORDER):
            into[i], into[width + BORDER + i] = into[BORDER], into[width + BORDER - 1]
    for y in range(height + 2 * BORDER):
        row, into = activity[0, min(max(y - BORDER, 0), height - 1)], activity[1, y]
        for i in range(width):
            x = np.uint64(i)
            into[x] = row[x] + row[x + ONE] + row[x + TWO] + row[x + THREE] + row[x + FOUR]
    for y in range(height):
        into, outer, above, row = activity[0, y], activity[1, y], activity[1, y + 1], activity[1, y + 2]
        below, last = activity[1, y + 3], activity[1, y + 4]
        for i in range(width):
            x = np.uint64(i)
            total = np.int32(outer[x] + above[x] + row[x] + below[x] + last[x])
            into[x] = min(total >> np.int32(BIN_SHIFT), np.int32(BINS - 1))


@lane_stage
def _add_by_class(classes, taps, k, shift, row, total):
    """Add a tap times a row of differences: comparisons are faster than a table."""
    t0, t1 = np.int32(taps[0, k]), np.int32(taps[1 >> shift, k])
    t2, t3 = np.int32(taps[2 >> shift, k]), np.int32(taps[3 >> shift, k])
    t4, t5 = np.int32(taps[4 >> shift, k]), np.int32(taps[5 >> shift, k])
    t6, t7 = np.int32(taps[6 >> shift, k]), np.int32(taps[7 >> shift, k])
    for i in range(len(total)):
        x = np.uint64(i)
        own = np.int32(classes[x])
        low = (t1 if own & 1 else t0) if own < 2 else (t3 if own & 1 else t2)
        high = (t5 if own & 1 else t4) if own < 6 else (t7 if own & 1 else t6)
        total[x] += np.int32((low if own < 4 else high) * row[x])


@lane_kernel
def filter_view(views, view, filters, limit, guess, planes, activity, classes, bins, found):
    """Filter a decoded view.

    Parameters
    ----------
    views : ndarray of int16, (J, 3, H, W)
    view : int
    filters : Filters
    limit : int32
        Of limited differences; with 0 they are 0.
    guess : ndarray of int32, (H, W) or (0, 0)
        Twice what the first plane lacks, by `learnt`.
    planes : ndarray of int16, (3, H + 4, W + 4)
        Memory, as all that follows.
    activity : ndarray of int32, (2, H + 4, W + 4)
    classes : ndarray of uint8, (H, W)
    bins : ndarray of int32, (BINS,)
    found : ndarray of int32, (TAPS + 1, W)
    """
    height, width = classes.shape
    modes = filters.modes[view]
    with_border(views, view, planes)
    if max(modes[0], modes[1], modes[2]) > 1:
        classify(planes, activity, classes, bins)
    total = found[TAPS]
    for p in range(3):
        mode = modes[p]
        if mode:
            taps = filters.taps[view, p]
            shift = np.uint8(3 if mode == 1 else 3 - mode)
            for y in range(height):
                find_differences(planes, p, y, limit, guess, found)
                for i in range(width):
                    total[np.uint64(i)] = 128
                for k in range(TAPS):
                    row, tap = found[k], np.int32(taps[0, k])
                    if mode == 1:
                        for i in range(width):
                            x = np.uint64(i)
                            total[x] += np.int32(tap * row[x])
                    else:
                        _add_by_class(classes[y], taps, k, shift, row, total)
                row, into = planes[p, y + BORDER], views[view, p, y]
                for i in range(width):
                    x = np.uint64(i)
                    value = np.int32(np.int32(row[x + TWO]) + (total[x] >> np.int32(8)))
                    into[x] = min(max(value, np.int32(-LIMIT)), np.int32(LIMIT))


def memory(height: int, width: int) -> tuple[Any, ...]:
    """Return memory for `filter_view`."""
    return (
        np.zeros((3, height + 2 * BORDER, width + 2 * BORDER), np.int16),
        np.zeros((2, height + 2 * BORDER, width + 2 * BORDER), np.int32),
        np.zeros((height, width), np.uint8),
        np.zeros(BINS, np.int32),
        np.zeros((TAPS + 1, width), np.int32),
    )
