"""In-loop filter of a decoded view, by plane: symmetric and odd taps, of samples that are classed by activity.

After Wiener filters in video coding (Tsai et al. 2013, adaptive loop filter). A filter adds to a sample
``(Σ tap · difference + 128) >> 8``. Differences are those of two opposite neighbours' sum from twice the sample,
of two opposite neighbours (they move a plane by parts of a sample), in the second and third plane, of the first
plane's neighbours, and in the first plane those of neighbours from the sample, each limited: they smooth beside an
edge and leave the edge. All planes are filtered from the decoded ones before any filter.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ii_core.base.jit import lean_kernel, part_kernel, stage_kernel

from . import contexts as at
from .arithmetic import code_bit, code_number, code_raw
from .blocks import LIMIT
from .warp import clamped

# Six even pairs, two odd ones, and six even of the first plane; limited ones of itself, from version 13 on.
# `_differences` lists them.
TAPS, OWN = 14, 8
GROUPS = np.array([0, 0, 1, 1, 1, 1, 2, 2, 3, 3, 3, 3, 3, 3])  # of contexts, by tap
CLASSES = 8
COUNTS = 0, 1, 4, 8  # classes of a filter, by its mode; 0: not filtered
BORDER = 2
MOST_TAP = 127
BINS = 4096
BIN_SHIFT = 3


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
def code_filter(coder, filters, view, same, limited):
    """Write or read the filters of a view; bit p of ``same`` says that of plane p is the one coded last.

    ``limited`` says whether the first plane has limited differences.
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
            count, length = 1 if several == 0 else 2 << several, TAPS if p or limited else OWN
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


@stage_kernel
def _differences(planes, p, y, x, limit, found):
    """found[:TAPS] = differences of a sample's neighbours; y and x count from the border."""
    for half in range(2 if p else 1):
        plane, first = planes[0 if half else p], OWN * half
        above, row, below = plane[y - 1], plane[y], plane[y + 1]
        twice = 2 * np.int32(row[x])
        found[first] = np.int32(row[x - 1]) + row[x + 1] - twice
        found[first + 1] = np.int32(above[x]) + below[x] - twice
        found[first + 2] = np.int32(above[x - 1]) + below[x + 1] - twice
        found[first + 3] = np.int32(above[x + 1]) + below[x - 1] - twice
        found[first + 4] = np.int32(row[x - 2]) + row[x + 2] - twice
        found[first + 5] = np.int32(plane[y - 2, x]) + plane[y + 2, x] - twice
        if not half:
            found[6] = np.int32(row[x + 1]) - row[x - 1]
            found[7] = np.int32(below[x]) - above[x]
            if p == 0:
                own, outer = row[x], plane[y - 2]
                found[8] = _limited(row[x - 1], own, limit) + _limited(row[x + 1], own, limit)
                found[9] = _limited(above[x], own, limit) + _limited(below[x], own, limit)
                found[10] = _limited(above[x - 1], own, limit) + _limited(below[x + 1], own, limit)
                found[11] = _limited(above[x + 1], own, limit) + _limited(below[x - 1], own, limit)
                found[12] = _limited(row[x - 2], own, limit) + _limited(row[x + 2], own, limit)
                found[13] = _limited(outer[x], own, limit) + _limited(plane[y + 2, x], own, limit)


@stage_kernel
def _limited(other, own, limit):
    """Difference of two samples, of the limit's magnitude at most."""
    return min(max(np.int32(np.int32(other) - own), -limit), limit)


@part_kernel
def prepare_view(views, view, planes, activity, classes, bins):
    """Fill planes with a view and its border, and classes (H, W), by eighths of the samples in order of activity.

    Activity is the sum of |second differences| along rows and columns of the first plane over 5×5 samples.
    """
    height, width = classes.shape
    for p in range(3):
        for y in range(height + 2 * BORDER):
            row = views[view, p, clamped(y - BORDER, height)]
            for x in range(width + 2 * BORDER):
                planes[p, y, x] = row[clamped(x - BORDER, width)]
    for y in range(height):
        above, row, below = planes[0, y + 1], planes[0, y + 2], planes[0, y + 3]
        for x in range(width):
            twice = 2 * np.int32(row[x + 2])
            across = abs(np.int32(row[x + 1]) + row[x + 3] - twice)
            activity[0, y, x] = across + abs(np.int32(above[x + 2]) + below[x + 2] - twice)
    for y in range(height):
        for x in range(width):
            total = np.int32(0)
            for i in range(-2, 3):
                total += activity[0, y, clamped(x + i, width)]
            activity[1, y, x] = total
    for i in range(BINS):
        bins[i] = 0
    for y in range(height):
        for x in range(width):
            total = np.int32(0)
            for i in range(-2, 3):
                total += activity[1, clamped(y + i, height), x]
            place = min(total >> BIN_SHIFT, BINS - 1)
            activity[0, y, x] = place
            bins[place] += 1
    below = np.int64(0)
    for i in range(BINS):  # of each bin its class
        count = np.int64(bins[i])
        bins[i] = min(CLASSES * below // (height * width), CLASSES - 1)
        below += count
    for y in range(height):
        for x in range(width):
            classes[y, x] = bins[activity[0, y, x]]


@lean_kernel
def filter_view(views, view, filters, limit, planes, activity, classes, bins):
    """Filter a decoded view.

    Parameters
    ----------
    views : ndarray of int16, (J, 3, H, W)
    view : int
    filters : Filters
    limit : int32
        Of limited differences; with 0 they are 0.
    planes : ndarray of int16, (3, H + 4, W + 4)
        Memory, as all that follows.
    activity : ndarray of int32, (2, H, W)
    classes : ndarray of uint8, (H, W)
    bins : ndarray of int32, (BINS + TAPS,)
    """
    height, width = classes.shape
    prepare_view(views, view, planes, activity, classes, bins)
    found = bins[BINS:]
    for p in range(3):
        mode = filters.modes[view, p]
        if mode:
            taps = filters.taps[view, p]
            shift = 3 if mode == 1 else 3 - mode
            for y in range(height):
                for x in range(width):
                    _differences(planes, p, y + BORDER, x + BORDER, limit, found)
                    own, total = taps[classes[y, x] >> shift], np.int32(128)
                    for i in range(TAPS):
                        total += np.int32(own[i]) * found[i]
                    value = np.int32(planes[p, y + BORDER, x + BORDER]) + (total >> 8)
                    views[view, p, y, x] = min(max(value, -LIMIT), LIMIT)


def memory(height: int, width: int) -> tuple[Any, ...]:
    """Return memory for `filter_view`."""
    return (
        np.zeros((3, height + 2 * BORDER, width + 2 * BORDER), np.int16),
        np.zeros((2, height, width), np.int32),
        np.zeros((height, width), np.uint8),
        np.zeros(BINS + TAPS, np.int32),
    )
