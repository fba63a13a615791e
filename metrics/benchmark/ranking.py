"""Ranking of results of the benchmark.

Coders are ranked by the number of targets that they meet, then by their mean quality at these targets. Bjøntegaard
differences refer to the profile's anchor, if its result is among those ranked.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ii_core.base.files import one_line

from ..measures.measure import measure_of
from ..rates.rd import bd_rate
from .profile import Profile

Result = Mapping[str, Any]


def check_comparable(profile: Profile, results: Sequence[tuple[str, Result]]) -> None:
    """Raise ValueError unless all results are of the profile and of the same pictures, each coder once.

    Parameters
    ----------
    results : sequence of (str, Result)
        File names and results.
    """
    if not results:
        raise ValueError("no result: at least one file is needed")
    first, hashes = results[0][0], _hashes(results[0][1])
    seen: dict[str, str] = {}
    for name, result in results:
        of = result["profile"]
        if (of["name"], of["version"], of["sha256"]) != (profile.name, profile.version, profile.digest):
            raise ValueError(
                f"{name} is of profile {one_line(of['name'])} version {of['version']}, {of['sha256'][:12]}: "
                f"{profile.name} version {profile.version}, {profile.digest[:12]}, is needed"
            )
        if _hashes(result) != hashes:
            raise ValueError(f"{name} has other pictures than {first}: results of the same pixels are ranked")
        for row in result["pictures"]:
            if [point["target_bpp"] for point in row["points"]] != list(profile.rates_bpp):
                raise ValueError(f"{name}: {row['name']} is not measured at the rates of the profile")
            if not all(isinstance(point.get(profile.rank_by), float) for point in row["points"]):
                raise ValueError(f"{name}: {row['name']} has no {profile.rank_by} at every rate: a number is needed")
        if result["coder"] in seen:
            raise ValueError(
                f"{name} and {seen[result['coder']]} are both of {result['coder']}: one of them is needed"
            )
        seen[result["coder"]] = name


def _hashes(result: Result) -> list[tuple[str, str]]:
    return [(row["name"], row["sha256"]) for row in result["pictures"]]


def ranked(profile: Profile, results: Sequence[Result]) -> list[dict[str, Any]]:
    """Return a row per result, the best first.

    Returns
    -------
    list of dict
        ``coder``, ``met`` and ``targets`` (numbers), ``quality`` (mean of the measure of the ranking over the targets
        met), ``means`` (of every measure over them), ``differences`` (Bjøntegaard rates in % by measure and picture),
        ``bd_rate`` (their mean by the measure of the ranking; NaN without an anchor), ``compared`` (pictures that it
        is the mean of), ``result``.
    """
    anchor = next((result for result in results if result["coder"] == profile.anchor), None)
    better = 1 if measure_of(profile.rank_by).higher_is_better else -1
    rows = []
    for result in results:
        points = [point for row in result["pictures"] for point in row["points"]]
        met = [point for point in points if point["reached"]]
        means = {name: _mean([point[name] for point in met if name in point]) for name in profile.measures}
        differences = {name: _differences(name, anchor, result) for name in profile.measures}
        own = differences[profile.rank_by]
        rows.append(
            {
                "coder": result["coder"],
                "met": len(met),
                "targets": len(points),
                "quality": means[profile.rank_by],
                "means": means,
                "differences": differences,
                "bd_rate": _mean(list(own.values())),
                "compared": len(own),
                "result": result,
            }
        )

    def order(row: Mapping[str, Any]) -> tuple[float, float, str]:
        return -row["met"], -better * row["quality"] if row["met"] else 0.0, row["coder"]

    return sorted(rows, key=order)


def worst(differences: Mapping[str, float]) -> tuple[str, float] | None:
    """Return the picture of the largest Bjøntegaard rate, and the rate; None if there is none."""
    return max(differences.items(), key=lambda item: item[1]) if differences else None


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if values else math.nan


def _differences(measure: str, anchor: Result | None, result: Result) -> dict[str, float]:
    """Return the Bjøntegaard rates by a measure of all pictures for which they are defined."""
    found: dict[str, float] = {}
    for one, other in zip(anchor["pictures"] if anchor else (), result["pictures"], strict=False):
        curves = [_curve(row, measure) for row in (one, other)]
        try:
            found[other["name"]] = bd_rate(*curves[0], *curves[1])
        except ValueError:  # too few points, curves that hardly overlap, or quality that falls
            continue
    return found


def _curve(row: Mapping[str, Any], measure: str) -> tuple[list[float], list[float]]:
    points = sorted({(p["bpp"], p[measure]) for p in row["points"] if math.isfinite(p.get(measure, math.nan))})
    return [bpp for bpp, _ in points], [value for _, value in points]
