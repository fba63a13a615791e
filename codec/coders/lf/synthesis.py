"""View synthesis at the decoder: disparity projected from decoded views, and their samples along it.

Every decoded view keeps a disparity for each sample. For a new view these are moved to where they lead (`project`).
Where several surfaces meet, the one is taken on which the references agree (`choose`), and their samples are blended
(`blend`). Once the view is decoded, its disparity is matched to its own samples (`refine`).

All is done in whole numbers: decoders differ in no bit. Disparity is in 2^-8 samples between neighbouring views.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ii_core.base.jit import lane_kernel, lane_part, lane_stage, lean_kernel, part_kernel, stage_kernel

from .agreement import MATCHED, TRUNCATED, disagreement, forget, hashed, mismatch, prepare, reach, widen
from .state import EXPLICIT, INDEX, KIND, UNKNOWN, zeros
from .transform import LARGEST
from .warp import BEFORE, FILTERS, LATTICE, TAPS, clamped, led, weighed

CANDIDATES = 8
MOST_SOURCES = 8
RUN = LARGEST  # samples of a row that are blended together: all within a square, for squares have shifts
VECTOR = 16  # samples of a row that are interpolated together
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
    candidates : ndarray of int16, (H, W, CANDIDATES)
    counts : ndarray of uint8, (H, W)
    made : ndarray of int16, (3, H, W)
    disparity : ndarray of int16, (H, W)
    doubt : ndarray of int16, (H / 4, W / 4)
        Mean difference of a source from the one most like the others.
    scratch : ndarray of int64, (10, MOST_SOURCES)
    tried : ndarray of int64, (16,)
    taken : ndarray of int32, (MOST_SOURCES + 1, 3, RUN + VECTOR)
        Samples of the sources for those that are blended together, the last of the source most like the others,
    weights, totals : ndarray of int32, (MOST_SOURCES, RUN)
        their weights, and how far each is from the others,
    found : ndarray of int32, (4, RUN)
        which is most like the others, its distances, and sums of weights,
    blended : ndarray of float64, (3, RUN)
        and sums of samples.
    near : ndarray of int64, (MOST_SOURCES,)
        Squared distance from the nearest sample of each source, in units of 1/64.
    sums : ndarray of int32, (2 VECTOR + TAPS,)
    met : ndarray of int64, (MET,)
        Samples and disparities that were looked at,
    fresh : ndarray of int64, (9 * CANDIDATES + 1,)
        and disparities of a sample that were not.
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
    taken: Any
    weights: Any
    totals: Any
    found: Any
    blended: Any
    near: Any
    sums: Any
    met: Any
    fresh: Any


def new_synthesis(views: Any, disparities: Any, sources: Any) -> Synthesis:
    """Memory for one view."""
    height, width = views.shape[2:]
    return Synthesis(
        views=views,
        disparities=disparities,
        sources=sources,
        candidates=zeros((height, width, CANDIDATES))[0],
        counts=zeros((height, width), np.uint8)[0],
        made=zeros((3, height, width))[0],
        disparity=zeros((height, width))[0],
        doubt=np.zeros((height // 4, width // 4), np.int16),
        scratch=np.zeros((10, MOST_SOURCES), np.int64),
        tried=np.zeros(16, np.int64),
        taken=np.zeros((MOST_SOURCES + 1, 3, RUN + VECTOR), np.int32),
        weights=np.zeros((MOST_SOURCES, RUN), np.int32),
        totals=np.zeros((MOST_SOURCES, RUN), np.int32),
        found=np.zeros((4, RUN), np.int32),
        blended=np.zeros((3, RUN)),
        near=np.zeros(MOST_SOURCES, np.int64),
        sums=np.zeros(2 * VECTOR + TAPS, np.int32),
        met=np.full(MET, -1),
        fresh=np.zeros(9 * CANDIDATES + 1, np.int64),
    )


def chosen(s: Synthesis) -> Synthesis:
    """Return it without the room that only the choice of disparity takes, most of all."""
    return s._replace(candidates=s.candidates[:0].copy())


@stage_kernel
def _insert(s, y, x, d, apart):
    count = np.int64(s.counts[y, x])
    for i in range(count):
        if abs(s.candidates[np.uint64(y), np.uint64(x), np.uint64(i)] - d) <= apart:
            return
    if count < CANDIDATES:
        s.candidates[np.uint64(y), np.uint64(x), np.uint64(count)] = d
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
def choose(s, m, apart):
    """s.disparity = of the candidates around each sample the one on which the sources agree best."""
    height, width = s.counts.shape
    for y in range(height):
        for x in range(width):
            number = _try_around(s, y, x, apart)
            best = _best_tried(s, m, y, x, number) if number > 1 else (s.tried[0] if number else np.int64(UNKNOWN))
            s.disparity[y, x] = best
    _fill(s.disparity)


@stage_kernel
def _try_around(s, y, x, apart):
    """s.tried = different candidates around a sample; return their number.

    Each is written to the end of the list, which grows if it is new: branches would be hard to foresee.
    """
    height, width = s.counts.shape
    tried, number, found = s.tried, 0, 0
    for j in range(max(y - 1, 0), min(y + 2, height)):
        for i in range(max(x - 1, 0), min(x + 2, width)):
            for c in range(s.counts[np.uint64(j), np.uint64(i)]):
                d = np.int64(s.candidates[np.uint64(j), np.uint64(i), np.uint64(c)])
                mark, place = ((y * width + x) << 16) | (d & 0xFFFF), np.uint64(hashed(d) & (MET - 1))
                s.fresh[np.uint64(found)] = d
                found += 1 if s.met[place] != mark else 0
                s.met[place] = mark
    for c in range(found):
        d, new = s.fresh[np.uint64(c)], True
        for k in range(number):
            if abs(tried[k] - d) <= apart:
                new = False
                break
        if new and number < tried.size:
            tried[np.uint64(number)] = d
            number += 1
    return number


@stage_kernel
def _best_tried(s, m, y, x, number):
    """Of the first disparities tried, the one on which the sources agree best, and the first of equals."""
    best, least = np.int64(0), np.int64(1 << 40)
    for k in range(number):
        d = s.tried[np.uint64(k)]
        cost = disagreement(s, m, y, x, d)
        if cost < least:
            best, least = d, cost
    return best


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


@lane_kernel
def blend(s, nearest, every):
    """s.made = the sources' samples along s.disparity, those left out that see something else.

    With ``nearest`` the nearest samples are weighted by how near they are, else values are interpolated. Only every
    so many-th row is made.
    """
    height, width = s.counts.shape
    count = s.sources.shape[0]
    _weigh_sources(s, nearest)
    for y in range(height >> 2):
        for x in range(width >> 2):
            s.doubt[y, x] = 0
    for y in range(0, height, every):
        for first in range(0, width, RUN):
            x, last = first, min(first + RUN, width)
            while x < last:
                end = x + 1
                while end < last and s.disparity[y, end] == s.disparity[y, x]:
                    end += 1
                d = np.int64(s.disparity[y, x])
                _take_run(s, y, x, end - x, np.int64(0) if d == UNKNOWN else d, nearest, x - first)
                x = end
            _most_alike(s, count, last - first)
            _add_weighted(s, count, last - first)
            _store_run(s, y, first, last - first)


@stage_kernel
def _weigh_sources(s, nearest):
    """s.scratch[6:9] = weights of a source that agrees, does not, and does not see the sample; [9] = its `reach`."""
    for r in range(s.sources.shape[0]):
        s.scratch[9, r] = reach(s.sources, r)
        squared = s.sources[r, 1] * s.sources[r, 1] + s.sources[r, 2] * s.sources[r, 2]
        far = 8 + (squared >> 2 * LATTICE)
        for kind, weight in enumerate((64, 8, 1)):
            s.scratch[6 + kind, r] = weight if nearest else weight * 64 // far


@part_kernel
def _take_run(s, y, x, length, d, nearest, place):
    """Fill taken and weights of all sources, from ``place`` on, for samples that follow each other in a disparity."""
    height, width = s.counts.shape
    count = s.sources.shape[0]
    for r in range(count):
        view = s.sources[r, 0]
        dy, dx = led(s.sources, r, d, y, x, s.counts.shape)
        agreeing, other, unseen = s.scratch[6, r], s.scratch[7, r], s.scratch[8, r]
        i, j = x + ((dx + 128) >> 8), y + ((dy + 128) >> 8)
        told, known = s.disparities[view, np.uint64(clamped(j, height))], 0 <= j < height
        inside, most = -128 <= 256 * y + dy <= 256 * height - 128, s.scratch[9, r]
        for k in range(length):
            at, weight = 256 * (x + k) + dx, unseen
            if inside and -128 <= at <= 256 * width - 128:
                weight = other
                if known and 0 <= i + k < width:
                    own = np.int64(told[np.uint64(i + k)])
                    weight = agreeing if own != UNKNOWN and abs(own - d) <= most else other
            s.weights[r, np.uint64(place + k)] = weight
        if nearest:
            fx, fy = ((dx + 128) & 255) - 128, ((dy + 128) & 255) - 128
            s.near[r] = min((fx * fx + fy * fy) >> 10, 64)
            for p in range(3):
                row = s.views[view, p, clamped(j, height)]
                for k in range(length):
                    s.taken[r, p, np.uint64(place + k)] = row[np.uint64(clamped(i + k, width))]
        else:
            ix, iy, px, py = x + (dx >> 8), y + (dy >> 8), (dx >> 4) & 15, (dy >> 4) & 15
            _six_taps_run(s.views[view], iy, ix, py, px, length, s.sums, s.taken[r], place)
    if nearest:
        for k in range(place, place + length):
            most, closest = np.int64(-1), np.int64(64)
            for r in range(count):
                most = max(most, np.int64(s.weights[r, k]))
            for r in range(count):
                if 2 * np.int64(s.weights[r, k]) > most:
                    closest = min(closest, s.near[r])
            for r in range(count):
                s.weights[r, k] *= PHASE[max(s.near[r] - closest, 0)]


@lane_part
def _six_taps_run(planes, iy, ix, py, px, count, sums, out, place):
    """out[:, place : place + count] = samples of a view's planes that follow each other.

    By six taps down, into ``sums``, then across. Beyond its border a plane goes on with the border's samples. Places
    of ``out`` beyond the last are written, too.
    """
    width = planes.shape[2]
    a, b, c = FILTERS[px, 0], FILTERS[px, 1], FILTERS[px, 2]
    d, e, f = FILTERS[px, 3], FILTERS[px, 4], FILTERS[px, 5]
    for first in range(0, count, VECTOR - TAPS + 1):
        start, columns = ix - BEFORE + first, min(count - first, VECTOR - TAPS + 1) + TAPS - 1
        inside = start >= 0 and start + columns <= width and width >= VECTOR
        left = min(start, width - VECTOR) if inside else start
        for p in range(3):
            taken, into = sums[start - left :], out[p, place + first :]
            _six_rows(planes[p], iy - BEFORE, left, py, columns, inside, sums)
            if px:
                for j in range(VECTOR):
                    far, near, middle = taken[j], taken[j + 1], taken[j + 2]
                    total = weighed(far, near, middle, taken[j + 3], taken[j + 4], taken[j + 5], a, b, c, d, e, f)
                    into[j] = np.int32(total + np.int32(2048)) >> np.int32(12)
            else:
                for j in range(VECTOR):
                    into[j] = np.int32(taken[j + BEFORE] + np.int32(32)) >> np.int32(6)


@lane_stage
def _six_rows(plane, top, left, phase, columns, inside, sums):
    """sums[:columns] = weighted sums of six rows; not ``inside``: where the plane may have ended."""
    height, width = plane.shape
    one, two = plane[np.uint64(clamped(top, height))], plane[np.uint64(clamped(top + 1, height))]
    three, four = plane[np.uint64(clamped(top + 2, height))], plane[np.uint64(clamped(top + 3, height))]
    five, six = plane[np.uint64(clamped(top + 4, height))], plane[np.uint64(clamped(top + 5, height))]
    a, b, c = FILTERS[phase, 0], FILTERS[phase, 1], FILTERS[phase, 2]
    d, e, f = FILTERS[phase, 3], FILTERS[phase, 4], FILTERS[phase, 5]
    if inside:
        one, two, three, four, five, six = one[left:], two[left:], three[left:], four[left:], five[left:], six[left:]
        for j in range(VECTOR):
            sums[j] = weighed(one[j], two[j], three[j], four[j], five[j], six[j], a, b, c, d, e, f)
    else:
        for j in range(columns):
            x = np.uint64(clamped(left + j, width))
            sums[j] = weighed(one[x], two[x], three[x], four[x], five[x], six[x], a, b, c, d, e, f)


@stage_kernel
def _apart(one, other, k):
    """Difference of two sources' samples."""
    differs = np.int32(abs(np.int32(one[0, k] - other[0, k]))) + np.int32(abs(np.int32(one[1, k] - other[1, k])))
    return np.int32(differs + np.int32(abs(np.int32(one[2, k] - other[2, k]))))


@part_kernel
def _most_alike(s, count, length):
    """s.found[0] = the source in best agreement with the others by weight, for each of a run; the first of equals."""
    best, least = s.found[0], s.found[1]
    for a in range(count):
        total, weights = s.totals[a], s.weights[a]
        for k in range(length):
            total[k] = np.int32(-160) * weights[k]
        for b in range(a):
            one, other, others, theirs = s.taken[a], s.taken[b], s.totals[b], s.weights[b]
            for k in range(length):
                differs = np.int32(min(_apart(one, other, k), np.int32(TRUNCATED)))
                total[k] += np.int32(differs * theirs[k])
                others[k] += np.int32(differs * weights[k])
    for k in range(length):
        best[k], least[k] = 0, s.totals[0, k]
    for a in range(1, count):
        total = s.totals[a]
        for k in range(length):
            better = total[k] < least[k]
            best[k] = np.int32(a) if better else best[k]
            least[k] = total[k] if better else least[k]


@part_kernel
def _add_weighted(s, count, length):
    """Sums by weights, which fall with the distance from the source found: weights, samples, and that distance."""
    best, spread, falling, every = s.found[0], s.found[1], s.found[2], s.found[3]
    chosen, first, second, third = s.taken[MOST_SOURCES], s.blended[0], s.blended[1], s.blended[2]
    for k in range(length):
        spread[k] = falling[k] = every[k] = 0
        first[k] = second[k] = third[k] = 0
        of = np.uint64(best[k])
        chosen[0, k], chosen[1, k], chosen[2, k] = s.taken[of, 0, k], s.taken[of, 1, k], s.taken[of, 2, k]
    for b in range(count):
        one, weights = s.taken[b], s.weights[b]
        for k in range(length):
            differs = _apart(chosen, one, k)
            weight = np.int32(weights[k] * OUTLYING[np.uint64(min(differs >> 4, 63))])
            spread[k] += np.int32(np.int32(min(differs, np.int32(TRUNCATED))) * weights[k])
            falling[k] += weight
            every[k] += weights[k]
            share = np.float64(weight)
            first[k] += share * np.float64(one[0, k])
            second[k] += share * np.float64(one[1, k])
            third[k] += share * np.float64(one[2, k])


@part_kernel
def _store_run(s, y, first, count):
    """s.made = the quotients of sums, by floating point: exact, as numbers have 52 bits at most; s.doubt."""
    spread, falling, every = s.found[1], s.found[2], s.found[3]
    for p in range(3):
        made, sums, chosen = s.made[p, y], s.blended[p], s.taken[MOST_SOURCES, p]
        for k in range(count):
            half, weights = np.float64(falling[k] >> 1), np.float64(max(falling[k], 1))
            made[np.uint64(first + k)] = np.int64(np.floor((sums[k] + half) / weights)) if falling[k] else chosen[k]
    for k in range(count):
        apart = np.int64(np.floor(np.float64(spread[k]) / np.float64(max(every[k], 1)))) if falling[k] else 0
        s.doubt[y >> 2, np.uint64((first + k) >> 2)] += (apart + 8) >> 4


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


@lane_kernel
def refine(s, m, at):
    """Let each sample take over a neighbour's disparity that fits the decoded view better, forward and backward."""
    forget(m)
    for r in range(min(s.sources.shape[0], MATCHED)):
        widen(m.wide[r], s.views[s.sources[r, 0], 0], True)
    widen(m.wide[MATCHED], s.views[at, 0], True)
    for backward in range(2):
        _pass_on(s, m, at, backward)


@part_kernel
def _pass_on(s, m, at, backward):
    """Let samples take over the disparity of the one before them, or above or below."""
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
                cost = mismatch(s, m, y, x, d) + _roughness(d, one, two)
                if cost < least:
                    least, best = cost, d
            s.disparities[at, y, x] = best


@stage_kernel
def _roughness(d, one, two):
    return 9 * SMOOTH * ((1 if d != one else 0) + (1 if d != two else 0))


@lane_kernel
def synthesise(s, m, apart):
    """Disparity of a view from its sources'; return whether any is known."""
    project(s, apart)
    prepare(m, s.views, s.disparities, s.sources)
    choose(s, m, apart)
    return s.disparity[0, 0] != UNKNOWN
