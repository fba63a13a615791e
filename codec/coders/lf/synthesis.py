"""View synthesis at the decoder: disparity projected from decoded views, and their samples along it.

Every decoded view keeps a disparity for each sample. For a new view these are moved to where they lead (`project`).
Where several surfaces meet, the one is taken on which the references agree (`choose`), and their samples are blended
(`blend`). Once the view is decoded, its disparity is matched to its own samples (`refine`).

All is done in whole numbers: decoders differ in no bit. Disparity is in 2^-8 samples between neighbouring views.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ii_core.base.jit import array_kernel, lean_kernel, part_kernel, stage_kernel

from .agreement import LONELY, MATCHED, ROWS, SLOTS, SPAN, TRUNCATED, agrees, disagreement, hashed
from .state import EXPLICIT, INDEX, KIND, UNKNOWN, zeros
from .transform import LARGEST
from .warp import BEFORE, FILTERS, LATTICE, TAPS, UNSHIFTED, clamped, filtered, led

CANDIDATES = 8
MOST_SOURCES = 8
RUN = 32  # samples of a row that are blended together, if their disparity is the same
MET = 64  # disparities around a sample that are known to have been looked at
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
        Views to take from, the nearest first: index, how far in columns and in rows, in 2^-10 of a view.
    candidates : ndarray of int16, (CANDIDATES, H, W)
    counts : ndarray of uint8, (H, W)
    made : ndarray of int16, (3, H, W)
    disparity : ndarray of int16, (H, W)
    doubt : ndarray of int16, (H / 4, W / 4)
        Mean difference of a source from the one most like the others.
    scratch : ndarray of int64, (10, MOST_SOURCES)
    tried : ndarray of int64, (16,)
    span : ndarray of int32, (MATCHED, SPAN)
    kept : ndarray of int16, (ROWS · W / SPAN · SLOTS, SPAN)
        How far the sources differ, by row, position and disparity.
    marks : ndarray of int64, (ROWS · W / SPAN · SLOTS,)
        Row and disparity of what is kept.
    taken : ndarray of int32, (MOST_SOURCES, 3, RUN)
        Samples of the sources for a run of samples of one disparity.
    sums : ndarray of int32, (RUN + TAPS - 1,)
    met : ndarray of int64, (MET,)
        Samples and disparities that were looked at.
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
    tried: Any
    span: Any
    kept: Any
    marks: Any
    taken: Any
    sums: Any
    met: Any


def new_synthesis(views: Any, disparities: Any, sources: Any) -> Synthesis:
    """Memory for one view."""
    height, width = views.shape[2:]
    return Synthesis(
        views=views,
        disparities=disparities,
        sources=sources,
        candidates=zeros((CANDIDATES, height, width))[0],
        counts=zeros((height, width), np.uint8)[0],
        made=zeros((3, height, width))[0],
        disparity=zeros((height, width))[0],
        doubt=np.zeros((height // 4, width // 4), np.int16),
        scratch=np.zeros((10, MOST_SOURCES), np.int64),
        tried=np.zeros(16, np.int64),
        span=np.zeros((MATCHED, SPAN), np.int32),
        kept=np.zeros((ROWS * -(-width // SPAN) * SLOTS, SPAN), np.int16),
        marks=np.full(ROWS * -(-width // SPAN) * SLOTS, -1),
        taken=np.zeros((MOST_SOURCES, 3, RUN), np.int32),
        sums=np.zeros(RUN + TAPS - 1, np.int32),
        met=np.full(MET, -1),
    )


def chosen(s: Synthesis) -> Synthesis:
    """Return it without the room that only the choice of disparity takes, half of all."""
    return s._replace(candidates=s.candidates[:0].copy(), kept=s.kept[:0].copy(), marks=s.marks[:0].copy())


@stage_kernel
def _insert(s, y, x, d, apart):
    count = np.int64(s.counts[y, x])
    for i in range(count):
        if abs(s.candidates[i, y, x] - d) <= apart:
            return
    if count < CANDIDATES:
        s.candidates[count, y, x] = d
        s.counts[y, x] = count + 1


@part_kernel
def project(s, apart):
    """Move the sources' disparities to where they lead in the view; nearly equal ones count as one."""
    height, width = s.counts.shape
    for y in range(height):
        for x in range(width):
            s.counts[y, x] = 0
    for r in range(s.sources.shape[0]):
        view = s.sources[r, 0]
        for y in range(height):
            for x in range(width):
                d = np.int64(s.disparities[view, y, x])
                if d == UNKNOWN:
                    continue
                dy, dx = led(s.sources, r, d, y, x, (height, width))
                to_x, to_y = x + ((128 - dx) >> 8), y + ((128 - dy) >> 8)
                if 0 <= to_x < width and 0 <= to_y < height:
                    _insert(s, to_y, to_x, d, apart)


@part_kernel
def choose(s, apart):
    """s.disparity = of the candidates around each sample the one on which the sources agree best."""
    height, width = s.counts.shape
    tried = s.tried
    for y in range(height):
        for x in range(width):
            number = 0
            for j in range(max(y - 1, 0), min(y + 2, height)):
                for i in range(max(x - 1, 0), min(x + 2, width)):
                    for c in range(s.counts[np.uint64(j), np.uint64(i)]):
                        d = np.int64(s.candidates[np.uint64(c), np.uint64(j), np.uint64(i)])
                        mark, place = ((y * width + x) << 16) | (d & 0xFFFF), np.uint64(hashed(d) & (MET - 1))
                        if s.met[place] == mark:
                            continue
                        s.met[place], new = mark, True
                        for k in range(number):
                            if abs(tried[k] - d) <= apart:
                                new = False
                                break
                        if new and number < tried.size:
                            tried[np.uint64(number)] = d
                            number += 1
            best, least = np.int64(UNKNOWN), np.int64(1 << 40)
            if number == 1:
                best = tried[0]
            else:
                for k in range(number):
                    cost = disagreement(s, y, x, tried[k], least)
                    if cost < least:
                        least, best = cost, tried[k]
            s.disparity[y, x] = best
    _fill(s.disparity)


@part_kernel
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


@lean_kernel
def blend(s, nearest, every):
    """s.made = the sources' samples along s.disparity, those left out that see something else.

    With ``nearest`` the nearest samples are weighted by how near they are, else values are interpolated. Only every
    so many-th row is made.
    """
    height, width = s.counts.shape
    count = s.sources.shape[0]
    _weigh_sources(s, nearest)
    # A run is within a square, if squares have shifts.
    squares = 1 if s.sources.shape[1] > UNSHIFTED else 0
    for y in range(height >> 2):
        for x in range(width >> 2):
            s.doubt[y, x] = 0
    for y in range(0, height, every):
        x = start = end = 0
        while x < width:
            d = np.int64(s.disparity[y, x])
            if x == end and not nearest:
                end = x + 1
                while end < width and end - x < RUN and s.disparity[y, end] == s.disparity[y, x]:
                    if squares and end % LARGEST == 0:
                        break
                    end += 1
                start = x
                _interpolate(s, y, x, end - x, np.int64(0) if d == UNKNOWN else d, count)
            if d == UNKNOWN:
                d = np.int64(0)
            most = np.int64(-1)
            for r in range(count):
                most = max(most, _take(s, r, y, x, d, nearest, x - start))
            if nearest:
                _prefer_nearest(s, count, most)
            s.doubt[y >> 2, x >> 2] += (_weighted(s, y, x, count) + 8) >> 4
            x += 1


@stage_kernel
def _weigh_sources(s, nearest):
    """s.scratch[6:9] = weights of each source where it agrees, does not, and does not see the sample."""
    for r in range(s.sources.shape[0]):
        squared = s.sources[r, 1] * s.sources[r, 1] + s.sources[r, 2] * s.sources[r, 2]
        far = 8 + (squared >> 2 * LATTICE)
        for kind, weight in enumerate((64, 8, 1)):
            s.scratch[6 + kind, r] = weight if nearest else weight * 64 // far


@stage_kernel
def _take(s, r, y, x, d, nearest, place):
    """s.scratch[1:6, r] = sample, weight and distance of a source along a disparity; return the weight.

    ``place`` is that of the sample in the run that `_interpolate` has made.
    """
    height, width = s.counts.shape
    dy, dx = led(s.sources, r, d, y, x, (height, width))
    at_x, at_y = 256 * x + dx, 256 * y + dy
    inside = -128 <= at_x <= 256 * width - 128 and -128 <= at_y <= 256 * height - 128
    weight = s.scratch[(6 if agrees(s, r, y, x, d) else 7) if inside else 8, r]
    if nearest:
        i, j = (at_x + 128) >> 8, (at_y + 128) >> 8
        fx, fy = at_x - (i << 8), at_y - (j << 8)
        s.scratch[5, r] = min((fx * fx + fy * fy) >> 10, 64)
        i, j = clamped(i, width), clamped(j, height)
        for p in range(3):
            s.scratch[1 + p, r] = s.views[s.sources[r, 0], p, j, i]
    else:
        for p in range(3):
            s.scratch[1 + p, r] = s.taken[r, p, place]
    s.scratch[4, r] = weight
    return weight


@stage_kernel
def _prefer_nearest(s, count, most):
    """Lower the weights of samples farther from the place than the nearest of a source that sees it."""
    closest = np.int64(64)
    for r in range(count):
        if 2 * s.scratch[4, r] > most:
            closest = min(closest, s.scratch[5, r])
    for r in range(count):
        s.scratch[4, r] = s.scratch[4, r] * PHASE[max(s.scratch[5, r] - closest, 0)]


@part_kernel
def _six_taps_run(plane, iy, ix, py, px, count, sums, out):
    """out[:count] = samples of a plane that follow each other, by six taps down, into ``sums``, then across.

    Beyond its border the plane goes on with the border's samples.
    """
    height, width = plane.shape
    length = (count + 3) & -4
    columns = length + TAPS - 1
    within = ix >= BEFORE and ix - BEFORE + columns <= width
    for j in range(columns):
        sums[j] = 0
    for k in range(TAPS):
        g = FILTERS[py, k]
        if g:
            row = plane[np.uint64(clamped(iy + k - BEFORE, height))]
            if within:
                taken = row[ix - BEFORE : ix - BEFORE + columns]
                for j in range(columns):
                    sums[j] = np.int32(sums[j] + np.int32(g * np.int32(taken[j])))
            else:
                for j in range(columns):
                    sums[j] += g * row[np.uint64(clamped(ix + j - BEFORE, width))]
    a, b, c, d, e, f = FILTERS[px, 0], FILTERS[px, 1], FILTERS[px, 2], FILTERS[px, 3], FILTERS[px, 4], FILTERS[px, 5]
    for at in range(0, length, 4):
        t, four = sums[at : at + TAPS + 3], out[at : at + 4]
        m, n = filtered(t, 0, a, b, c, d, e, f), filtered(t, 1, a, b, c, d, e, f)
        o, p = filtered(t, 2, a, b, c, d, e, f), filtered(t, 3, a, b, c, d, e, f)
        four[0], four[1], four[2], four[3] = (m + 2048) >> 12, (n + 2048) >> 12, (o + 2048) >> 12, (p + 2048) >> 12


@stage_kernel
def _interpolate(s, y, x, length, d, count):
    """s.taken[:count, :, :length] = samples of the sources along a disparity."""
    for r in range(count):
        dy, dx = led(s.sources, r, d, y, x, s.counts.shape)
        ix, iy, px, py = x + (dx >> 8), y + (dy >> 8), (dx >> 4) & 15, (dy >> 4) & 15
        for p in range(3):
            _six_taps_run(s.views[s.sources[r, 0], p], iy, ix, py, px, length, s.sums, s.taken[r, p])


@stage_kernel
def _quotient(a, b):
    """a // b by a division of floating point, which is exact while a has at most 52 bits, and four times as fast."""
    return np.int64(np.floor(np.float64(a) / np.float64(b)))


@stage_kernel
def _apart(s, a, b):
    """Difference of two sources' samples."""
    differs = abs(s.scratch[1, a] - s.scratch[1, b])
    return differs + abs(s.scratch[2, a] - s.scratch[2, b]) + abs(s.scratch[3, a] - s.scratch[3, b])


@stage_kernel
def _weighted(s, y, x, count):
    """The mean by weights, which fall with the distance from the source in best agreement with the others.

    Return the mean difference from that source.
    """
    totals, weights = s.scratch[9], s.scratch[4]
    for a in range(count):
        totals[a] = -160 * weights[a]
        for b in range(a):
            differs = min(_apart(s, a, b), TRUNCATED)
            totals[a] += differs * weights[b]
            totals[b] += differs * weights[a]
    best = 0
    for a in range(1, count):
        if totals[a] < totals[best]:
            best = a
    sum0 = sum1 = sum2 = sum_ = all_ = spread = np.int64(0)
    for b in range(count):
        differs = _apart(s, best, b)
        weight = weights[b] * OUTLYING[min(differs >> 4, 63)]
        sum_ += weight
        all_ += weights[b]
        spread += min(differs, TRUNCATED) * weights[b]
        sum0 += weight * s.scratch[1, b]
        sum1 += weight * s.scratch[2, b]
        sum2 += weight * s.scratch[3, b]
    if sum_ == 0:
        for p in range(3):
            s.made[p, y, x] = s.scratch[1 + p, best]
        return np.int64(0)
    half = sum_ >> 1
    s.made[0, y, x] = _quotient(sum0 + half, sum_)
    s.made[1, y, x] = _quotient(sum1 + half, sum_)
    s.made[2, y, x] = _quotient(sum2 + half, sum_)
    return _quotient(spread, all_)


@stage_kernel
def _mismatch(s, at, y, x, d):
    """Return the difference of the best two sources from the decoded view around a sample, in eighths of a code."""
    height, width = s.counts.shape
    count = min(s.sources.shape[0], MATCHED)
    least: Any = np.int64(1 << 40)
    second: Any = np.int64(1 << 40)
    within = 0 < x < width - 1 and 0 < y < height - 1
    for r in range(count):
        total = np.int64(0)
        dy, dx = led(s.sources, r, d, y, x, (height, width))
        ix, iy, px, py = dx >> 8, dy >> 8, (dx >> 4) & 15, (dy >> 4) & 15
        own, other = s.views[at, 0], s.views[s.sources[r, 0], 0]
        if x + ix < -1 or y + iy < -1 or x + ix > width or y + iy > height:
            total = np.int64(9 * LONELY)
        elif within and 0 < x + ix < width - 2 and 0 < y + iy < height - 2:
            a, b, c, e = (16 - px) * (16 - py), px * (16 - py), (16 - px) * py, px * py
            for j in range(3):
                mine = own[y + j - 1, x - 1 : x + 2]
                upper = other[y + iy + j - 1, x + ix - 1 : x + ix + 3]
                lower = other[y + iy + j, x + ix - 1 : x + ix + 3]
                for i in range(3):
                    value = (a * upper[i] + b * upper[i + 1] + c * lower[i] + e * lower[i + 1]) >> 8
                    total += min(abs(value - np.int64(mine[i])), TRUNCATED)
                if total >= second:
                    break
        else:
            for j in range(max(y - 1, 0), min(y + 2, height)):
                mine = own[np.uint64(j)]
                upper = other[np.uint64(clamped(j + iy, height))]
                lower = other[np.uint64(clamped(j + iy + 1, height))]
                for i in range(max(x - 1, 0), min(x + 2, width)):
                    left, right = np.uint64(clamped(i + ix, width)), np.uint64(clamped(i + ix + 1, width))
                    above = np.int64(upper[left]) * (16 - px) + np.int64(upper[right]) * px
                    below = np.int64(lower[left]) * (16 - px) + np.int64(lower[right]) * px
                    value = (above * (16 - py) + below * py) >> 8
                    total += min(abs(value - np.int64(mine[np.uint64(i)])), TRUNCATED)
                if total >= second:
                    break
        if total < least:
            least, second = total, least
        elif total < second:
            second = total
    return least + second if count > 1 else 2 * least


@lean_kernel
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


@lean_kernel
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
            best, least = own, np.int64(1 << 40)
            for k in range(3):
                d = own if k == 0 else (one if k == 1 else two)
                if d == UNKNOWN or (k > 0 and d == own) or (k == 2 and d == one):
                    continue
                cost = _mismatch(s, at, y, x, d) + _roughness(d, one, two)
                if cost < least:
                    least, best = cost, d
            s.disparities[at, y, x] = best


@stage_kernel
def _roughness(d, one, two):
    return 9 * SMOOTH * ((1 if d != one else 0) + (1 if d != two else 0))


@array_kernel
def synthesise(s, apart):
    """Disparity of a view from its sources'; return whether any is known."""
    project(s, apart)
    choose(s, apart)
    return s.disparity[0, 0] != UNKNOWN
