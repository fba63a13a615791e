"""Encoder's choice of loop filters: least squares by plane and class, and whether their bits pay."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ii_core.base.jit import lane_kernel, lane_part, lane_stage
from ii_core.base.references import by_reference

from . import contexts as at
from .arithmetic import Arithmetic, bit_costs
from .loop_filter import (
    CLASSES,
    COUNTS,
    MOST_TAP,
    TAPS,
    Filters,
    classify,
    find_differences,
    memory,
    with_border,
)

UNIT = 256  # of taps
PRECISIONS = 4  # that are tried: multiples of 1, 2, 4 and 8
HEAD, LEAST_BITS = 4.0, 1.4  # bits of a new filter beside its taps, and of a tap that is expected
GROUP = 128  # samples of a class whose products are added at once
exact_sums = partial(lane_stage, fastmath={"reassoc"})  # of whole numbers below 2^53: the same in any order


@by_reference
class Moments(NamedTuple):
    """Sums over a decoded view, by plane and class.

    Parameters
    ----------
    products : ndarray of float64, (3, CLASSES, TAPS, TAPS)
        Of differences.
    missed : ndarray of float64, (3, CLASSES, TAPS)
        Of differences and the original less the decoded sample.
    counts : ndarray of float64, (CLASSES,)
    """

    products: NDArray[np.float64]
    missed: NDArray[np.float64]
    counts: NDArray[np.float64]


class Found(NamedTuple):
    """Best new filters of a view.

    Parameters
    ----------
    moments : Moments
    modes : list of int
    taps : ndarray of int64, (3, CLASSES, TAPS)
    gains : list of float
        Squared error that they save, less the worth of their bits.
    """

    moments: Moments
    modes: list[int]
    taps: NDArray[np.int64]
    gains: list[float]


@lane_kernel
def _add_moments(views, view, original, limit, guess, planes, activity, classes, bins, found, moments, waiting):
    """Add the sums of a view; of products those with an earlier difference or itself."""
    height, width = classes.shape
    with_border(views, view, planes)
    classify(planes, activity, classes, bins)
    products, missed, counts = moments
    for p in range(3):
        counts[:] = 0
        for y in range(height):
            find_differences(planes, p, y, limit, guess, found)
            errors, own, decoded = found[TAPS], original[p, y], views[view, p, y]
            for x in range(width):
                errors[x] = np.int32(own[x]) - np.int32(decoded[x])
            for x in range(width):
                k = np.int64(classes[y, x])
                place = np.int64(counts[k]) % GROUP
                counts[k] += 1
                for i in range(TAPS + 1):
                    waiting[k, i, place] = found[i, x]
                if place == GROUP - 1:
                    _add_group(waiting[k], products[p, k], missed[p, k])
        for one in range(CLASSES):  # the rest of its samples
            for i in range(TAPS + 1):
                for none in range(np.int64(counts[one]) % GROUP, GROUP):
                    waiting[one, i, none] = 0
            _add_group(waiting[one], products[p, one], missed[p, one])


@lane_part
def _add_group(waiting, products, missed):
    """Add the sums of a class' waiting samples, (TAPS + 1, GROUP): differences, and what the decoded samples miss."""
    for i in range(TAPS):
        one = waiting[i]
        for j in range(i + 1):
            products[i, j] += _product(one, waiting[j])
        missed[i] += _product(one, waiting[TAPS])


@exact_sums
def _product(one, other):
    total = np.float64(0)
    for i in range(GROUP):
        total += one[np.uint64(i)] * other[np.uint64(i)]
    return total


def search_filters(
    views: NDArray[np.int16],
    view: int,
    original: NDArray[np.int16],
    limit: np.int32,
    guess: NDArray[np.int32],
    weight: float,
) -> Found:
    """Return the best new filters of a decoded view; ``weight`` is the squared error that a bit is worth."""
    moments = Moments(np.zeros((3, CLASSES, TAPS, TAPS)), np.zeros((3, CLASSES, TAPS)), np.zeros(CLASSES))
    waiting = np.zeros((CLASSES, TAPS + 1, GROUP))
    _add_moments(views, view, original, limit, guess, *memory(*views.shape[2:]), moments, waiting)
    moments.products[:] += np.tril(moments.products, -1).swapaxes(2, 3)
    modes, taps, gains = [], np.zeros((3, CLASSES, TAPS), np.int64), []
    for p in range(3):
        best: Best = (0.0, 0, taps[p])
        # Eight classes gain most before their bits: where they gain nothing, other modes are not tried.
        for mode in range(len(COUNTS) - 1, 0, -1):
            best, hopeless = _better_of(moments, p, mode, weight, best)
            if hopeless:
                break
        gains.append(best[0])
        modes.append(best[1])
        taps[p, : len(best[2])] = best[2]
    return Found(moments, modes, taps, gains)


Best = tuple[float, int, NDArray[np.int64]]  # gain less the bits' worth, mode, taps


def _better_of(moments: Moments, p: int, mode: int, weight: float, best: Best) -> tuple[Best, bool]:
    """Return the best filter so far or of a mode, and whether no filter of the mode or of fewer classes can gain."""
    products, missed = _merged(moments, p, mode)
    counts = moments.counts.reshape(COUNTS[mode], -1).sum(axis=1)
    ridge = np.eye(products.shape[1]) * (1 + counts[:, None, None])
    real = UNIT * np.linalg.solve(products + ridge, missed[..., None])[..., 0]
    most = _gain(products, missed, real)
    if most - weight * (HEAD + LEAST_BITS * real.size) <= best[0]:
        return best, most <= weight * (HEAD + LEAST_BITS * real.shape[1])
    for shift in range(PRECISIONS):
        limit = MOST_TAP >> shift
        multiples = np.clip(np.rint(real / (1 << shift)), -limit, limit).astype(np.int64)
        size = np.abs(np.diff(multiples, axis=0, prepend=0))
        bits = HEAD + float((2 * np.floor(np.log2(size + 2)) - 2 + LEAST_BITS + (size > 0)).sum())
        taps = multiples << shift
        gain = _gain(products, missed, taps) - weight * bits
        if gain > best[0]:
            best = gain, mode, taps
    return best, False


def _merged(moments: Moments, p: int, mode: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    count = COUNTS[mode]
    products = moments.products[p].reshape(count, -1, TAPS, TAPS).sum(axis=1)
    return products, moments.missed[p].reshape(count, -1, TAPS).sum(axis=1)


def _gain(
    products: NDArray[np.float64], missed: NDArray[np.float64], taps: NDArray[np.floating | np.integer]
) -> float:
    """Return the squared error that taps save, but for rounding."""
    real = taps / UNIT
    return float((2 * missed * real - real * np.einsum("kij,kj->ki", products, real)).sum())


def choose_filters(coder: Arithmetic, filters: Filters, view: int, found: Found, weight: float) -> int:
    """Set the filters of a view: none, those coded last, or new ones; return as bits which are those coded last."""
    same = 0
    for p in range(3):
        off, on = weight * bit_costs(coder.contexts[[at.FILTERED + 3 * p + filters.before[p]]])[0]
        new, again = weight * bit_costs(coder.contexts[[at.FILTER_SAME + p]])[0]
        latest = int(filters.latest[p])
        gains = [-off, found.gains[p] - on - (new if latest >= 0 else 0) if found.modes[p] else -np.inf, -np.inf]
        if latest >= 0:
            mode = int(filters.modes[latest, p])
            products, missed = _merged(found.moments, p, mode)
            gains[2] = _gain(products, missed, filters.taps[latest, p, : COUNTS[mode]]) - on - again
        way = int(np.argmax(gains))
        same |= (way == 2) << p
        filters.modes[view, p] = (0, found.modes[p], 1)[way]
        if way == 1:
            filters.taps[view, p] = found.taps[p]
    return same
