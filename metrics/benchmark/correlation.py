"""Rank correlation of measures: how alike two measures order coders."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..measures.measure import measure_of
from .profile import Profile

LEAST_CODERS = 3


def rank_correlations(profile: Profile, results: Sequence[Mapping[str, Any]]) -> dict[tuple[str, str], float]:
    """Return Spearman's rank correlation of each two measures, the mean over pictures and targets.

    Coders are compared at a target that all of them meet. NaN if no such target orders them by both measures.

    Returns
    -------
    dict
        Empty with fewer than three coders.
    """
    if len(results) < LEAST_CODERS:
        return {}
    found: dict[tuple[str, str], list[float]] = {}
    for pictures in zip(*(result["pictures"] for result in results), strict=True):
        for points in zip(*(picture["points"] for picture in pictures), strict=True):
            if not all(point["reached"] for point in points):
                continue
            ranks = {name: _ranks([point.get(name, math.nan) for point in points], name) for name in profile.measures}
            for one in profile.measures:
                for other in profile.measures:
                    found.setdefault((one, other), []).append(_correlation(ranks[one], ranks[other]))
    every = [(one, other) for one in profile.measures for other in profile.measures]
    return {pair: _mean(found.get(pair, [])) for pair in every}


def _ranks(values: Sequence[float], name: str) -> NDArray[np.float64]:
    """Return ranks from the worst on; equal values share their mean rank. NaN if a value is missing."""
    signed = np.array(values, float) * (1 if measure_of(name).higher_is_better else -1)
    if np.isnan(signed).any():
        return np.full(len(signed), np.nan)
    below, same = (signed[:, None] > signed).sum(axis=1), (signed[:, None] == signed).sum(axis=1)
    return np.asarray(below + (same - 1) / 2, float)


def _correlation(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    a, b = a - a.mean(), b - b.mean()
    scale = math.sqrt(float(a @ a) * float(b @ b))
    return float(a @ b) / scale if scale > 0 else math.nan


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if not math.isnan(value)]
    return float(np.mean(known)) if known else math.nan
