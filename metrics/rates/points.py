"""Points of a rate–distortion study: fields, checks, and their form in JSON."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ii_core.base import checks

from ..measures.measure import known_measures, measure_of

FIELDS = (
    "scheme",
    "options",
    "target_bpp",
    "bpp",
    "reached",
    "q_global",
    "encode_seconds",
    "decode_seconds",
    "nbytes",
)


def unspelt(point: Mapping[str, Any]) -> dict[str, Any]:
    """Return a point as `rate_distortion` gave it, from what `spelt` and JSON made of it."""
    point = dict(point)
    lossless = point.pop("lossless", False)
    numbers = ("bpp", "target_bpp", "encode_seconds", "decode_seconds")
    for name in (*measures_of([point]), *("q_depth",) * ("q_depth" in point), *set(numbers) & set(point)):
        point[name] = _read(name, point[name])
    if lossless:
        point["q_global"] = math.inf
    return point


def measures_of(points: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the names of the measures that every point has, in the order of their registration."""
    return [name for name in known_measures() if all(name in point for point in points)]


def check_measured(points: Sequence[Mapping[str, Any]], measure: str) -> None:
    """Raise ValueError unless the measure is registered and all points have it."""
    measure_of(measure)
    if measure not in measures_of(points):
        raise ValueError(f"the study has no {measure}: it has {', '.join(measures_of(points))}")


NEAR = 1.02  # rates within this factor count as equal


def limit_of(point: Mapping[str, Any], points: Sequence[Mapping[str, Any]]) -> str:
    """Return whether a missed rate is the "floor" or the "ceiling" of its scheme; empty if the scheme goes beyond it.

    ``points`` may hold other schemes.
    """
    rates = [other["bpp"] for other in points if other["scheme"] == point["scheme"]]
    if point["bpp"] > point["target_bpp"]:
        return "floor" if point["bpp"] <= NEAR * min(rates) else ""
    return "ceiling" if NEAR * point["bpp"] >= max(rates) else ""


def spelt(value: Any) -> Any:
    """Return plain values for JSON: infinities as text, null for NaN."""
    if isinstance(value, Mapping):
        return {key: spelt(item) for key, item in value.items()}
    if isinstance(value, list):
        return [spelt(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else str(value)
    return value


def _read(name: str, value: Any) -> Any:
    if isinstance(value, list):
        return [_read(name, item) for item in value]
    if value is None:
        return math.nan
    try:
        if not isinstance(value, bool):
            return float(value)
    except (TypeError, ValueError, OverflowError):
        pass
    raise ValueError(f"{name} is {_short(value)}: a number is needed")


def check_points(records: Any) -> None:
    """Raise ValueError unless this is a list of records that have all FIELDS, each of its kind."""
    if not isinstance(records, Sequence):
        raise ValueError(f"points of the records are {_short(records)}: a list is needed")
    for i, record in enumerate(records):
        if not isinstance(record, Mapping):
            raise ValueError(f"points[{i}] of the records is {_short(record)}: an object is needed")
        if missing := set(FIELDS) - set(record):
            raise ValueError(f"points[{i}] has no {', '.join(sorted(missing))}")
        for name, (kind, right) in KINDS.items():
            if not right(record[name]):
                raise ValueError(f"points[{i}]: {name} is {_short(record[name])}: {kind} is needed")


def _rate(value: Any) -> bool:
    """Whether a value is a positive number; its logarithm is charted."""
    return isinstance(value, int | float) and not isinstance(value, bool) and 0 < value < 1e300


def _number(value: Any) -> bool:
    """Return whether a value is a number, or null for an unknown one."""
    return value is None or (
        isinstance(value, int | float) and not isinstance(value, bool) and not abs(value) > 1e300
    )


KINDS: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "scheme": ("a name", lambda value: isinstance(value, str)),
    "options": ("an object", lambda value: isinstance(value, Mapping)),
    "target_bpp": ("a positive number", _rate),
    "bpp": ("a positive number", _rate),
    "reached": ("true or false", lambda value: isinstance(value, bool)),
    "encode_seconds": ("a number", _number),
    "decode_seconds": ("a number", _number),
    "nbytes": ("a number", _number),
}


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}…"


def are_studies(name: str, value: Any) -> None:
    """Rule: a list of studies, each of a named picture."""
    checks.sequence(name, value)
    for i, study in enumerate(value):
        is_study(f"{name}[{i}]", study)


def is_study(name: str, value: Any) -> None:
    """Rule: a study as `read_study` gives it."""
    checks.mapping(name, value)
    points, picture = value.get("points"), value.get("picture", {"name": ""})
    if not isinstance(points, list) or not isinstance(picture, Mapping) or "name" not in picture:
        raise checks.refuse(name, value, "what read_study gives, with points and, for charts, a named picture,")
    if not all(isinstance(point, Mapping) for point in points):
        raise checks.refuse(f"{name}['points']", points, "a list of dicts")
