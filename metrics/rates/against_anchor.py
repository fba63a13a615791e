"""Differences between the schemes of a study and an anchor: gain, BD-rate, difference at equal rate."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ii_core.base import checks

from ..measures.measure import Measure, measure_of
from .points import are_studies, check_measured, is_study
from .rd import UndefinedDifference, bd_psnr, bd_rate

Points = list[tuple[float, float]]
NEARLY = 1.25  # a target missed by a smaller factor counts, if points on both sides of it are known
VALUES = ("gain", "bd_rate_percent", "bd_quality")


def anchor_of(study: Mapping[str, Any], anchor: str | None = None) -> str:
    """Return the anchor: the given one, else that of the study, else its first scheme."""
    kept = study.get("anchor")
    return anchor or (kept if isinstance(kept, str) else study["points"][0]["scheme"])


@checks.checked(study=is_study, anchor=checks.text, measure=checks.text)
def differences(
    study: Mapping[str, Any], *, anchor: str | None = None, measure: str = "q_global"
) -> dict[str, dict[str, Any]]:
    """Return how every scheme of a study differs from the anchor.

    Parameters
    ----------
    study : dict
        From `read_study`.
    anchor : str, optional
        A scheme. That of the study, or else its first scheme, if not given.
    measure : str
        Which quality, of those that the study has.

    Returns
    -------
    dict of str to dict
        By scheme, without the anchor: ``gain``, the mean difference in quality over the target rates that both reach,
        or miss by less than a quarter with points on both sides, between which quality is interpolated linearly over
        the logarithm of the rate; ``rates``, their number; ``bd_rate_percent``, see `bd_rate`, of quality that grows
        where lower is better, too; ``bd_quality``, see `bd_psnr`. An undefined value is None, and ``why`` holds the
        reason in a few words.

    Raises
    ------
    ValueError
        If the study has no points or not the measure.
    """
    points, kind = study["points"], measure_of(measure)
    if not points:
        raise ValueError("the study has no points")
    check_measured(points, measure)
    anchor = anchor_of(study, anchor)
    made = {}
    for scheme in dict.fromkeys(point["scheme"] for point in points):
        if scheme != anchor:
            made[scheme] = _difference(points, anchor, scheme, kind)
    return made


def _difference(points: Sequence[Mapping[str, Any]], anchor: str, scheme: str, kind: Measure) -> dict[str, Any]:
    if not any(point["scheme"] == anchor for point in points):
        return {**dict.fromkeys(VALUES), "rates": 0, "why": dict.fromkeys(VALUES, f"no {anchor}")}
    gains = _gains(points, anchor, scheme, kind.name)
    a, b = (operating_points(points, name, kind.name) for name in (anchor, scheme))
    why: dict[str, str] = {} if gains else {"gain": "no common rate"}

    def value(name: str, function: Callable[..., float], a: Points, b: Points) -> float | None:
        try:
            if a and b:
                return function(*zip(*a, strict=True), *zip(*b, strict=True))
            why[name] = "no points"
        except UndefinedDifference as error:
            why[name] = error.short
        return None

    return {
        "gain": sum(gains) / len(gains) if gains else None,
        "rates": len(gains),
        "bd_rate_percent": value("bd_rate_percent", bd_rate, _growing(a, kind), _growing(b, kind)),
        "bd_quality": value("bd_quality", bd_psnr, a, b),
        "why": why,
    }


def operating_points(points: Sequence[Mapping[str, Any]], scheme: str, measure: str = "q_global") -> Points:
    """The different (bpp, quality) of a scheme by rate, without infinite and missing qualities.

    A point beside its target is as true an operating point as any; the same one given for several targets counts
    once.
    """
    return sorted({(p["bpp"], p[measure]) for p in points if p["scheme"] == scheme and math.isfinite(p[measure])})


def _growing(points: Points, measure: Measure) -> Points:
    """Points whose quality grows with rate, as `bd_rate` needs it: negated where lower is better."""
    return points if measure.higher_is_better else [(rate, -quality) for rate, quality in points]


def _gains(points: Sequence[Mapping[str, Any]], anchor: str, scheme: str, measure: str) -> list[float]:
    """Differences in quality at the target rates that both reach, or nearly reach."""
    reached: dict[str, dict[float, float]] = {anchor: {}, scheme: {}}
    for point in points:
        if point["scheme"] in reached:
            quality = point[measure] if point["reached"] else _interpolated(point, points, measure)
            reached[point["scheme"]][point["target_bpp"]] = quality
    both = reached[scheme].keys() & reached[anchor].keys()
    return [gain for target in both if math.isfinite(gain := reached[scheme][target] - reached[anchor][target])]


def _interpolated(missed: Mapping[str, Any], points: Sequence[Mapping[str, Any]], measure: str) -> float:
    """Return the quality at a missed target between the points around it; NaN if that is impossible."""
    target = missed["target_bpp"]
    if abs(math.log(missed["bpp"] / target)) > math.log(NEARLY):
        return math.nan
    found = operating_points(points, missed["scheme"], measure)
    under = max((point for point in found if point[0] <= target), default=None)
    over = min((point for point in found if point[0] > target), default=None)
    if under is None or over is None:
        return math.nan
    share = math.log(target / under[0]) / math.log(over[0] / under[0])
    return under[1] + share * (over[1] - under[1])


@checks.checked(studies=are_studies, anchor=checks.text, measure=checks.text)
def mean_differences(
    studies: Sequence[Mapping[str, Any]], *, anchor: str | None = None, measure: str = "q_global"
) -> dict[str, dict[str, Any]]:
    """Return the means of `differences` over several pictures.

    Parameters
    ----------
    studies : sequence of dict
        From `read_study`, one a picture, with the same schemes.
    anchor, measure
        As for `differences`.

    Returns
    -------
    dict of str to dict
        By scheme: each value's arithmetic mean over the pictures that have it, None if none has; ``pictures``, their
        number by value; ``each``, what `differences` gives, by picture.
    """
    each = {study["picture"]["name"]: differences(study, anchor=anchor, measure=measure) for study in studies}
    made = {}
    for scheme in dict.fromkeys(scheme for found in each.values() for scheme in found):
        of_pictures = {name: found[scheme] for name, found in each.items() if scheme in found}
        known = {
            value: [found[value] for found in of_pictures.values() if found[value] is not None] for value in VALUES
        }
        means = {value: sum(numbers) / len(numbers) if numbers else None for value, numbers in known.items()}
        counts = {value: len(numbers) for value, numbers in known.items()}
        made[scheme] = {**means, "pictures": counts, "each": of_pictures}
    return made
