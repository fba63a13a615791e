"""View synthesis at the decoder: disparity projected from decoded views, and their samples along it.

Every decoded view keeps a disparity for each sample. For a new view these are moved to where they lead (`project`).
Where several surfaces meet, the one is taken on which the references agree (`choose`), and their samples are blended
(`blend`). Once the view is decoded, its disparity is matched to its own samples (`refine`).

All is done in whole numbers: decoders differ in no bit. Disparity is in 2^-8 samples between neighbouring views.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .blocks import DIFFERENT, EXPLICIT, INDEX, KIND, UNKNOWN
from .jit import inner, kernel, lean
from .warp import FILTERS, TAPS, clamped

CANDIDATES = 8
MOST_SOURCES = 8
REMEMBERED = 4  # disparities of a sample
MATCHED = 4  # sources that take part in matching
TRUNCATED = 40 * 8  # eighths of a code: a larger difference tells no more
LONELY = 22 * 8  # cost of a sample that only one source sees
SMOOTH = 8  # cost of a step of disparity


def _falling(count, scale):
    """Weights 1 / (1 + (i / scale)²) in units of 2^-8."""
    return np.rint(256 / (1 + (np.arange(count) / scale) ** 2)).astype(np.int32)


OUTLYING = _falling(64, 6.0)  # by sum of three differences in 16 eighths of a code
# exp(-f² / (2·0.2²)) by squared distance to the nearest sample in units of 1/64
PHASE = np.rint(4096 * np.exp(-np.arange(65) / 64 / (2 * 0.2**2))).astype(np.int32)


class Synthesis(NamedTuple):
    """A view made of others.

    Parameters
    ----------
    views : ndarray of int16, (J, 3, H, W)
    disparities : ndarray of int16, (J, H, W)
        `UNKNOWN` where nothing is known.
    sources : ndarray of int64, (S, 3)
        Views to take from, the nearest first: index, how far in columns and in rows.
    candidates : ndarray of int16, (CANDIDATES, H, W)
    counts : ndarray of uint8, (H, W)
    made : ndarray of int16, (3, H, W)
    disparity : ndarray of int16, (H, W)
    doubt : ndarray of int16, (H / 4, W / 4)
        Mean difference of a source from the one most like the others.
    scratch : ndarray of int64, (8, MOST_SOURCES)
    memory : ndarray of int16, (H, W, REMEMBERED, 2)
        Disparities and how far the sources differ there.
    """

    views: Any
    disparities: Any
    sources: Any
    candidates: Any
    counts: Any
    made: Any
    disparity: Any
    doubt: Any
    scratch: Any
    memory: Any


def new_synthesis(views: Any, disparities: Any, sources: Any) -> Synthesis:
    """Memory for one view."""
    height, width = views.shape[2:]
    return Synthesis(
        views=views,
        disparities=disparities,
        sources=sources,
        candidates=np.zeros((CANDIDATES, height, width), np.int16),
        counts=np.zeros((height, width), np.uint8),
        made=np.zeros((3, height, width), np.int16),
        disparity=np.zeros((height, width), np.int16),
        doubt=np.zeros((height // 4, width // 4), np.int16),
        scratch=np.zeros((8, MOST_SOURCES), np.int64),
        memory=np.full((height, width, REMEMBERED, 2), UNKNOWN, np.int16),
    )


@inner
def _insert(s, y, x, d, apart):
    count = np.int64(s.counts[y, x])
    for i in range(count):
        if abs(s.candidates[i, y, x] - d) <= apart:
            return
    if count < CANDIDATES:
        s.candidates[count, y, x] = d
        s.counts[y, x] = count + 1


@lean
def project(s, apart):
    """Move the sources' disparities to where they lead in the view; nearly equal ones count as one."""
    height, width = s.counts.shape
    for y in range(height):
        for x in range(width):
            s.counts[y, x] = 0
    for r in range(s.sources.shape[0]):
        view, across, down = s.sources[r, 0], s.sources[r, 1], s.sources[r, 2]
        for y in range(height):
            for x in range(width):
                d = np.int64(s.disparities[view, y, x])
                if d == UNKNOWN:
                    continue
                to_x, to_y = x + ((128 - d * across) >> 8), y + ((128 - d * down) >> 8)
                if 0 <= to_x < width and 0 <= to_y < height:
                    _insert(s, to_y, to_x, d, apart)


@inner
def _between(views, view, p, y, x, py, px):
    """A plane at (y, x), between samples bilinearly by sixteenths, times 256."""
    height, width = views.shape[2:]
    x0, x1, y0, y1 = clamped(x, width), clamped(x + 1, width), clamped(y, height), clamped(y + 1, height)
    upper = np.int64(views[view, p, y0, x0]) * (16 - px) + np.int64(views[view, p, y0, x1]) * px
    lower = np.int64(views[view, p, y1, x0]) * (16 - px) + np.int64(views[view, p, y1, x1]) * px
    return upper * (16 - py) + lower * py


@lean
def _difference(s, y, x, d):
    """Return the difference of the sources at a sample for a disparity, in eighths of a code; see `_remembered`."""
    height, width = s.counts.shape
    count = min(s.sources.shape[0], MATCHED)
    seen = 0
    for r in range(count):
        at_x, at_y = 256 * x + d * s.sources[r, 1], 256 * y + d * s.sources[r, 2]
        if -128 <= at_x <= 256 * width - 128 and -128 <= at_y <= 256 * height - 128:
            part_y, part_x = (at_y >> 4) & 15, (at_x >> 4) & 15
            value = _between(s.views, s.sources[r, 0], 0, at_y >> 8, at_x >> 8, part_y, part_x)
            s.scratch[0, seen] = value >> 8
            seen += 1
    if seen < 2:
        return np.int64(LONELY)
    least = np.int64(1 << 40)
    for a in range(seen):
        differs = np.int64(0)
        for b in range(seen):
            differs += min(abs(s.scratch[0, a] - s.scratch[0, b]), TRUNCATED)
        least = min(least, differs)
    return least // (seen - 1) + (count - seen) * 16


@inner
def _remembered(s, y, x, d):
    """`_difference`, from memory if it has been found for this sample lately: five samples ask for the same."""
    height, width = s.counts.shape
    if y < 0 or x < 0 or y >= height or x >= width:
        return _difference(s, y, x, d)
    slot = (d ^ (d >> 2) ^ (d >> 5)) & (REMEMBERED - 1)
    if s.memory[y, x, slot, 0] != d:
        s.memory[y, x, slot, 0] = d
        s.memory[y, x, slot, 1] = _difference(s, y, x, d)
    return np.int64(s.memory[y, x, slot, 1])


@lean
def _disagreement(s, y, x, d, enough):
    """Return the difference of the sources around a sample for a disparity, in eighths of a code.

    A sum that is known to reach ``enough`` is not finished.
    """
    total = 2 * _remembered(s, y, x, d)
    for place in range(1, 5):
        if total >= 6 * enough:
            return enough
        j = y + (1 if place == 3 else (-1 if place == 4 else 0))
        i = x + (1 if place == 1 else (-1 if place == 2 else 0))
        total += _remembered(s, j, i, d)
    agreeing = 0
    for r in range(min(s.sources.shape[0], MATCHED)):
        if _agrees(s, r, y, x, d):
            agreeing += 1
    return total // 6 + (64 if agreeing == 0 else 32 // agreeing)


@inner
def _agrees(s, r, y, x, d):
    """Whether a source's own disparity says that it sees the same."""
    height, width = s.counts.shape
    across, down = s.sources[r, 1], s.sources[r, 2]
    i, j = x + ((d * across + 128) >> 8), y + ((d * down + 128) >> 8)
    if i < 0 or j < 0 or i >= width or j >= height:
        return False
    other = np.int64(s.disparities[s.sources[r, 0], j, i])
    return other != UNKNOWN and abs(other - d) * max(abs(across), abs(down)) < DIFFERENT


@lean
def choose(s, apart):
    """s.disparity = of the candidates around each sample the one on which the sources agree best."""
    height, width = s.counts.shape
    tried = s.scratch[1:3].size
    for y in range(height):
        for x in range(width):
            number = 0
            for j in range(max(y - 1, 0), min(y + 2, height)):
                for i in range(max(x - 1, 0), min(x + 2, width)):
                    for c in range(s.counts[j, i]):
                        d = np.int64(s.candidates[c, j, i])
                        new = True
                        for k in range(number):
                            if abs(s.scratch[1 + (k >> 3), k & 7] - d) <= apart:
                                new = False
                        if new and number < tried:
                            s.scratch[1 + (number >> 3), number & 7] = d
                            number += 1
            best, least = np.int64(UNKNOWN), np.int64(1 << 40)
            if number == 1:
                best = s.scratch[1, 0]
            else:
                for k in range(number):
                    d = s.scratch[1 + (k >> 3), k & 7]
                    cost = _disagreement(s, y, x, d, least)
                    if cost < least:
                        least, best = cost, d
            s.disparity[y, x] = best
    _fill(s.disparity)


@lean
def _fill(disparity):
    """Give samples without disparity that of the one to the left, above, right or below."""
    height, width = disparity.shape
    for y in range(height):
        for x in range(width):
            if disparity[y, x] == UNKNOWN and x > 0:
                disparity[y, x] = disparity[y, x - 1]
            if disparity[y, x] == UNKNOWN and y > 0:
                disparity[y, x] = disparity[y - 1, x]
    for y in range(height - 1, -1, -1):
        for x in range(width - 1, -1, -1):
            if disparity[y, x] == UNKNOWN and x + 1 < width:
                disparity[y, x] = disparity[y, x + 1]
            if disparity[y, x] == UNKNOWN and y + 1 < height:
                disparity[y, x] = disparity[y + 1, x]


@lean
def blend(s, nearest):
    """s.made = the sources' samples along s.disparity, those left out that see something else.

    With ``nearest`` the nearest samples are weighted by how near they are, else values are interpolated.
    """
    height, width = s.counts.shape
    count = s.sources.shape[0]
    for y in range(height >> 2):
        for x in range(width >> 2):
            s.doubt[y, x] = 0
    for y in range(height):
        for x in range(width):
            d = np.int64(s.disparity[y, x])
            if d == UNKNOWN:
                d = np.int64(0)
            most = np.int64(-1)
            for r in range(count):
                across, down = s.sources[r, 1], s.sources[r, 2]
                at_x, at_y = 256 * x + d * across, 256 * y + d * down
                inside = -128 <= at_x <= 256 * width - 128 and -128 <= at_y <= 256 * height - 128
                weight = np.int64(64 if _agrees(s, r, y, x, d) else 8) if inside else np.int64(1)
                if nearest:
                    i, j = (at_x + 128) >> 8, (at_y + 128) >> 8
                    fx, fy = at_x - (i << 8), at_y - (j << 8)
                    away = (fx * fx + fy * fy) >> 10
                    s.scratch[5, r] = min(away, 64)
                    i, j = clamped(i, width), clamped(j, height)
                    for p in range(3):
                        s.scratch[1 + p, r] = s.views[s.sources[r, 0], p, j, i]
                else:
                    weight = weight * 64 // (8 + across * across + down * down)
                    _interpolate(s, r, at_y, at_x)
                s.scratch[4, r] = weight
                if weight > most:
                    most = weight
            if nearest:
                closest = np.int64(64)
                for r in range(count):
                    if 2 * s.scratch[4, r] > most:
                        closest = min(closest, s.scratch[5, r])
                for r in range(count):
                    s.scratch[4, r] = s.scratch[4, r] * PHASE[max(s.scratch[5, r] - closest, 0)]
            s.doubt[y >> 2, x >> 2] += (_weighted(s, y, x, count) + 8) >> 4


@lean
def _six_taps(views, view, p, iy, ix, py, px):
    height, width = views.shape[2:]
    total = np.int64(0)
    inside = ix >= 2 and ix + 3 < width
    for k in range(TAPS):
        f = np.int64(FILTERS[py, k])
        if f:
            j = clamped(iy + k - 2, height)
            row = np.int64(0)
            if inside:
                for m in range(TAPS):
                    row += np.int64(FILTERS[px, m]) * np.int64(views[view, p, j, ix + m - 2])
            else:
                for m in range(TAPS):
                    row += np.int64(FILTERS[px, m]) * np.int64(views[view, p, j, clamped(ix + m - 2, width)])
            total += f * row
    return (total + 2048) >> 12


@inner
def _interpolate(s, r, at_y, at_x):
    """s.scratch[1:4, r] = the three planes at a position."""
    view = s.sources[r, 0]
    iy, ix, py, px = at_y >> 8, at_x >> 8, (at_y >> 4) & 15, (at_x >> 4) & 15
    for p in range(3):
        s.scratch[1 + p, r] = _six_taps(s.views, view, p, iy, ix, py, px)


@inner
def _weighted(s, y, x, count):
    """The mean by weights, which fall with the distance from the source in best agreement with the others.

    Return the mean difference from that source.
    """
    best, least = 0, 1 << 60
    for a in range(count):
        total = -160 * s.scratch[4, a]
        for b in range(count):
            differs = abs(s.scratch[1, a] - s.scratch[1, b])
            differs += abs(s.scratch[2, a] - s.scratch[2, b]) + abs(s.scratch[3, a] - s.scratch[3, b])
            total += min(differs, TRUNCATED) * s.scratch[4, b]
        if total < least:
            least, best = total, a
    sum0 = sum1 = sum2 = sum_ = all_ = spread = np.int64(0)
    for b in range(count):
        differs = abs(s.scratch[1, best] - s.scratch[1, b])
        differs += abs(s.scratch[2, best] - s.scratch[2, b]) + abs(s.scratch[3, best] - s.scratch[3, b])
        weight = s.scratch[4, b] * OUTLYING[min(differs >> 4, 63)]
        sum_ += weight
        all_ += s.scratch[4, b]
        spread += min(differs, TRUNCATED) * s.scratch[4, b]
        sum0 += weight * s.scratch[1, b]
        sum1 += weight * s.scratch[2, b]
        sum2 += weight * s.scratch[3, b]
    if sum_ == 0:
        for p in range(3):
            s.made[p, y, x] = s.scratch[1 + p, best]
        return np.int64(0)
    half = sum_ >> 1
    s.made[0, y, x] = (sum0 + half) // sum_
    s.made[1, y, x] = (sum1 + half) // sum_
    s.made[2, y, x] = (sum2 + half) // sum_
    return spread // all_


@lean
def _mismatch(s, at, y, x, d):
    """Return the difference of the best two sources from the decoded view around a sample, in eighths of a code."""
    height, width = s.counts.shape
    count = min(s.sources.shape[0], MATCHED)
    least, second = 1 << 40, 1 << 40
    for r in range(count):
        total = 0
        dx, dy = d * s.sources[r, 1], d * s.sources[r, 2]
        ix, iy, px, py = dx >> 8, dy >> 8, (dx >> 4) & 15, (dy >> 4) & 15
        if x + ix < -1 or y + iy < -1 or x + ix > width or y + iy > height:
            total = 9 * LONELY
        else:
            for j in range(max(y - 1, 0), min(y + 2, height)):
                for i in range(max(x - 1, 0), min(x + 2, width)):
                    value = _between(s.views, s.sources[r, 0], 0, j + iy, i + ix, py, px) >> 8
                    total += min(abs(value - np.int64(s.views[at, 0, j, i])), TRUNCATED)
        if total < least:
            least, second = total, least
        elif total < second:
            second = total
    return least + second if count > 1 else 2 * least


@lean
def start(s, at, blocks, unit, synthesised):
    """s.disparities[at] = that of the explicit blocks, and of the synthesis elsewhere."""
    height, width = s.counts.shape
    for y in range(height):
        for x in range(width):
            if blocks[KIND, y >> 2, x >> 2] == EXPLICIT:
                d = np.int64(blocks[INDEX, y >> 2, x >> 2]) * unit
                s.disparities[at, y, x] = min(max(d, -32767), 32767)
            elif synthesised:
                s.disparities[at, y, x] = s.disparity[y, x]
            else:
                s.disparities[at, y, x] = UNKNOWN


@lean
def refine(s, at, backward):
    """Let each sample take over a neighbour's disparity that fits the decoded view better."""
    height, width = s.counts.shape
    step = -1 if backward else 1
    for a in range(height):
        y = height - 1 - a if backward else a
        for b in range(width):
            x = width - 1 - b if backward else b
            own = np.int64(s.disparities[at, y, x])
            one = np.int64(s.disparities[at, y, x - step]) if 0 <= x - step < width else own
            two = np.int64(s.disparities[at, y - step, x]) if 0 <= y - step < height else own
            if one == own and two == own:
                continue
            best, least = own, 1 << 40
            if own != UNKNOWN:
                least = _mismatch(s, at, y, x, own) + _roughness(own, one, two)
            if one != UNKNOWN and one != own:
                cost = _mismatch(s, at, y, x, one) + _roughness(one, one, two)
                if cost < least:
                    least, best = cost, one
            if two != UNKNOWN and two != own and two != one:
                cost = _mismatch(s, at, y, x, two) + _roughness(two, one, two)
                if cost < least:
                    least, best = cost, two
            s.disparities[at, y, x] = best


@inner
def _roughness(d, one, two):
    return 9 * SMOOTH * ((1 if d != one else 0) + (1 if d != two else 0))


@kernel
def synthesise(s, apart):
    """Disparity of a view from its sources'; return whether any is known."""
    project(s, apart)
    choose(s, apart)
    return s.disparity[0, 0] != UNKNOWN
