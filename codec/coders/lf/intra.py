"""Intra prediction of a block from decoded samples above and to the left: flat, smooth, or a direction."""

from __future__ import annotations

import numpy as np

from ii_core.base.jit import part_kernel, stage_kernel

from .transform import LARGEST, sides, size_of

FLAT, SMOOTH, DIRECTIONS = 0, 1, 34
MODES = 2 + DIRECTIONS
FROM_LEFT = 2 + DIRECTIONS // 2  # the first direction from the left
# From version 14 on two more beside each direction: MODES + 2 · (its place among them), and one more.
ALL_MODES = MODES + 2 * DIRECTIONS
BESIDE, STEEPEST = 3, 64  # how far from it, in 2^-6 of a sample a row, and the most that a direction turns
# How far up or down the other side a direction meets it, in 2^-6 of a sample, by the slope's magnitude and the place;
# of the 34 directions in eighths, rounded down.
_PLACES = np.arange(1, LARGEST + 1)
BEYOND = np.stack(
    [
        4096 * _PLACES // max(slope, 1) if slope % 8 else 512 * _PLACES // max(slope, 8) * 8
        for slope in range(STEEPEST + 1)
    ]
)
# From version 9 on, by block size (4, 8, 16, 32): least slopes of directions that go on from a smoothed border. The
# border draws flat, smooth and straight blocks towards it: its weight halves after 2^(fade - 1) samples.
LEAST_SLOPES = 99, 7, 2, 1
# By mode, for contexts of coefficients.
TURNS = np.array([1] * 2 + [2] * 5 + [3] * 7 + [4] * 5 + [2] * 5 + [5] * 7 + [4] * 5)
# Directions 0–16 go on from the row above by (m − 8) / 8 of a sample a row; 17–33 likewise from the column left.


@stage_kernel
def coarse(mode):
    """The mode itself, or the one of the 34 directions that it is beside."""
    return mode if mode < MODES else 2 + ((mode - MODES) >> 1)


@stage_kernel
def _slope_of(mode):
    """How far a direction turns from straight in a row, in 2^-6 of a sample."""
    slope = 8 * ((coarse(mode) - 2) % (DIRECTIONS // 2) - 8)
    if mode >= MODES:
        slope += BESIDE if (mode - MODES) & 1 else -BESIDE
    return min(max(slope, -STEEPEST), STEEPEST)


@stage_kernel
def turn_class(mode):
    """Class of an intra mode: 1 without a direction, 3 near straight down, 5 near straight across, 2, 4 else."""
    return np.int64(TURNS[coarse(mode)])


@part_kernel
def fill_border(views, at, plane, blocks, done, y0, x0, shape, border, smoothed):
    """border[0] = the corner and h + w samples above, border[1] = the corner and h + w to the left.

    ``blocks[done]`` says by 4×4 samples what is decoded. What is not there takes the value before it. border[2:] is
    the same, ``smoothed`` by (1, 2, 1) / 4, if blocks are larger than 4×4.
    """
    height, width = views.shape[2:]
    h, w = sides(shape)
    both = h + w
    above, left = y0 > 0, x0 > 0
    for i in range(both):
        x, y = x0 + i, y0 + i
        if above:
            if x < width and blocks[done, (y0 - 1) >> 2, x >> 2]:
                border[0, i + 1] = views[at, plane, y0 - 1, x]
            else:
                border[0, i + 1] = border[0, i]
        if left:
            if y < height and blocks[done, y >> 2, (x0 - 1) >> 2]:
                border[1, i + 1] = views[at, plane, y, x0 - 1]
            else:
                border[1, i + 1] = border[1, i]
    if not above:
        for i in range(both):
            border[0, i + 1] = border[1, 1] if left else 0
    if not left:
        for i in range(both):
            border[1, i + 1] = border[0, 1] if above else 0
    corner = views[at, plane, y0 - 1, x0 - 1] if above and left else (border[0, 1] if above else border[1, 1])
    border[0, 0] = border[1, 0] = corner
    if smoothed and size_of(shape) > 2:
        for side in range(2):
            row, into = border[side], border[2 + side]
            into[0] = (border[0, 1] + 2 * corner + border[1, 1] + 2) >> 2
            for i in range(1, both):
                into[i] = (row[i - 1] + 2 * row[i] + row[i + 1] + 2) >> 2
            into[both] = row[both]


@part_kernel
def predict_along(border, mode, shape, square, smoothed):
    """square[:h, :w] = the prediction by a direction; if that comes from the left, lying: rows are columns."""
    from_left = coarse(mode) >= FROM_LEFT
    (h, w), log, fade = sides(shape), size_of(shape), (shape[0] + shape[1] - 2) >> 2
    slope = _slope_of(mode)
    first = 2 if smoothed and abs(slope) >= 8 * LEAST_SLOPES[log - 2] else 0
    side, other = border[first + (1 if from_left else 0)], border[first + (0 if from_left else 1)]
    reach, length = (w, h) if from_left else (h, w)
    for along in range(reach):  # the distance from the border
        row, shift = square[along], (along + 1) * slope
        across = 0
        while across < length and 64 * (across + 1) + shift < 0:  # beyond the corner
            at = max(0, 64 * (along + 1) - BEYOND[-slope, across])
            i, part = at >> 6, at & 63
            row[across] = (other[i] * (64 - part) + other[i + 1] * part + 32) >> 6
            across += 1
        start, part = 1 + (shift >> 6), np.int32(shift & 63)
        rest = np.int32(64 - part)
        for i in range(across, length):
            one, two = side[np.uint64(start + i)], side[np.uint64(start + i + 1)]
            both = np.int32(np.int32(one * rest) + np.int32(two * part))
            row[np.uint64(i)] = np.int32(both + np.int32(32)) >> np.int32(6)
    if smoothed and slope == 0:
        _draw_straight(other, square, reach, length, fade)


@part_kernel
def predict_intra(border, mode, shape, out, plane, smoothed):
    """out[plane, :h, :w] = the prediction; from version 9 on, ``smoothed``."""
    square, (h, w), log = out[plane], sides(shape), size_of(shape)
    fade = (shape[0] + shape[1] - 2) >> 2
    if mode == FLAT:
        value = _flat(border, h, w)
        for y in range(h):
            row = square[y]
            for x in range(w):
                row[x] = value
    elif mode == SMOOTH:
        first = 2 if smoothed and log > 2 else 0
        side, other = border[first], border[first + 1]
        # Means across have one weight for all, means down another: whole numbers if the longer side is the unit.
        longer = max(shape[0], shape[1])
        tall, wide, halvings = np.int32(longer - shape[0]), np.int32(longer - shape[1]), np.int32(longer + 1)
        right, below = side[w + 1], other[h + 1]
        for y in range(h):
            row, left = square[y], other[y + 1]
            up, down = np.int32(h - 1 - y), np.int32((y + 1) * below)
            for x in range(w):
                level = np.int32(np.int32(w - 1 - x) * left) + np.int32(np.int32(x + 1) * right)
                slope = np.int32(np.int32(up * side[x + 1]) + down)
                both = np.int32(np.int32(level) << wide) + np.int32(slope << tall)
                row[x] = np.int32(both + np.int32(1 << longer)) >> halvings
    else:
        predict_along(border, mode, shape, square, smoothed)
        if coarse(mode) >= FROM_LEFT:
            _transpose(square, max(h, w))
    if smoothed and mode <= SMOOTH:
        _draw_to_border(border, square, h, w, fade)


@stage_kernel
def _weight(distance, fade):
    """Of a border's sample, in 2^-6."""
    return np.int32(32) >> np.int32(2 * distance >> fade)


@stage_kernel
def _draw_to_border(border, square, h, w, fade):
    """Move samples near the border towards it (Said et al. 2016, position dependent intra prediction)."""
    reach = 3 << fade
    for y in range(h):
        row, left = square[y], np.int32(border[1, y + 1])
        down = _weight(y, fade) if y < reach else np.int32(0)
        for x in range(w if y < reach else min(w, reach)):
            across = _weight(x, fade) if x < reach else np.int32(0)
            near = np.int32(across * left) + np.int32(down * border[0, x + 1])
            row[x] = np.int32(near + np.int32((64 - across - down) * row[x]) + 32) >> 6


@stage_kernel
def _draw_straight(other, square, reach, length, fade):
    """Add to samples that repeat one side what the other side differs from the corner, the less the further."""
    for y in range(reach):
        row, more = square[y], np.int32(other[y + 1] - other[0])
        for x in range(min(length, 3 << fade)):
            row[x] += np.int32(_weight(x, fade) * more + 32) >> 6


@stage_kernel
def _flat(border, h, w):
    """Mean of the longer side of the border, or of both."""
    total, count = np.int32(0), 0
    if w >= h:
        for i in range(1, w + 1):
            total += border[0, i]
        count += w
    if h >= w:
        for i in range(1, h + 1):
            total += border[1, i]
        count += h
    halvings = 0
    while 1 << halvings < count:
        halvings += 1
    return np.int32(np.int32(total + np.int32(count >> 1)) >> np.int32(halvings))


@stage_kernel
def _transpose(square, n):
    for y in range(1, n):
        for x in range(y):
            square[y, x], square[x, y] = square[x, y], square[y, x]


assert np.iinfo(np.int32).max > 64 * 64 * (1 << 14)  # the largest sum above
