"""Rate–distortion studies on disk: what was measured, on what, with what."""

from __future__ import annotations

import hashlib
import math
import os
import platform
import subprocess
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ii_core import IIPicture, checks
from ii_core.files import one_line, read_json, write_json
from ii_core.identity import library_versions

from .measure import known_measures

FORMAT, VERSION = "ii-rd-study", 1
POOLING = "pooled MSE over R, G and B"
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
PACKAGES = ("ii_core", "raytrace_ii", "codec", "metrics", "assets", "benchmarks")
CODE = (*(f":(top){package}" for package in PACKAGES), ":(top)pyproject.toml", ":(top,exclude)benchmarks/results")


@checks.checked(
    path=checks.path, picture_name=checks.text, records=checks.sequence, picture=checks.instance(IIPicture)
)
def write_study(
    path: str | os.PathLike[str],
    picture_name: str,
    records: Sequence[Mapping[str, Any]],
    extra: Mapping[str, Any] | None = None,
    *,
    picture: IIPicture,
) -> None:
    """Write the records of `rate_distortion` and everything needed to judge them, as JSON.

    Parameters
    ----------
    path : path
        Replaced, whole.
    picture_name : str
        What charts call it.
    records : sequence of dict
    extra : dict, optional
        Anything else worth keeping, plain values.
    picture : IIPicture
        What was coded: its structure and the SHA-256 of its pixels are kept.

    Raises
    ------
    ValueError
        If a record lacks a field.
    OSError
        If the file cannot be written.
    """
    check_points(records)
    write_json(
        path,
        {
            "format": FORMAT,
            "version": VERSION,
            "picture": picture_json(picture_name, picture),
            "pooling": POOLING,
            **provenance(),
            "extra": dict(extra or {}),
            # Infinity is no JSON number: a lossless point says so, other qualities are spelt out.
            "points": [{**spelt(dict(record)), "lossless": record["q_global"] == math.inf} for record in records],
        },
    )


def picture_json(name: str, picture: IIPicture) -> dict[str, Any]:
    """Return what identifies a picture: the SHA-256 of its pixels, their type, and its structure."""
    return {
        "name": name,
        "sha256": hashlib.sha256(np.ascontiguousarray(picture.pixels).data).hexdigest(),
        "pixels": list(picture.size),
        "dtype": picture.pixels.dtype.name,
        **picture.structure_json(),
    }


@checks.checked(path=checks.path)
def read_study(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read what `write_study` wrote; ``["points"]`` equal its records, infinite qualities too.

    Raises
    ------
    ValueError
        If the file is not a study.
    OSError
        If it cannot be read.
    """
    study = read_json(path)
    try:
        if not isinstance(study, dict) or study.get("format") != FORMAT or study.get("version") != VERSION:
            raise ValueError(f'not a study: needs "format": "{FORMAT}", "version": {VERSION}')
        if missing := {"picture", "points"} - set(study):
            raise ValueError(f"not a study: {', '.join(sorted(missing))} missing")
        if not isinstance(study["picture"], dict) or not isinstance(study["points"], list):
            raise ValueError("not a study: picture is to be an object, points a list")
        check_points(study["points"])
        study["points"] = [unspelt(point) for point in study["points"]]
    except RecursionError:
        raise ValueError(f"{path}: not a study: it is nested too deeply") from None
    except ValueError as error:
        raise ValueError(f"{path}: {one_line(error)}") from None
    return study


def unspelt(point: Mapping[str, Any]) -> dict[str, Any]:
    """Return a point as `rate_distortion` gave it, from what `spelt` and JSON made of it."""
    point = dict(point)
    lossless = point.pop("lossless", False)
    for name in measures_of([point]) + ["q_depth"] * ("q_depth" in point):
        point[name] = _read(name, point[name])
    if lossless:
        point["q_global"] = math.inf
    return point


def measures_of(points: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the names of the measures that every point has, in the order of their registration."""
    return [name for name in known_measures() if all(name in point for point in points)]


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
    """Raise ValueError unless every record has all FIELDS, each of its kind."""
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


KINDS: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "scheme": ("a name", lambda value: isinstance(value, str)),
    "options": ("an object", lambda value: isinstance(value, Mapping)),
    "target_bpp": ("a positive number", _rate),
    "bpp": ("a positive number", _rate),
    "reached": ("true or false", lambda value: isinstance(value, bool)),
}


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}…"


def provenance() -> dict[str, Any]:
    """What a number was measured on: commit, machine and versions of the libraries."""
    return {
        "git": _git(),
        "machine": {"platform": platform.platform(), "cpus": os.cpu_count()},
        "versions": library_versions(),
    }


def _git() -> dict[str, Any] | None:
    """Commit of the checkout this code runs from, and whether its code was changed; None outside of one.

    Numbers and pages that a study has just written are not code: what is measured next still is of the commit.
    """
    folder = Path(__file__).parent

    def git(*args: str) -> str:
        command = ["git", "-C", str(folder), *args]
        return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout.strip()

    try:
        git("ls-files", "--error-unmatch", __file__)  # installed into somebody else's checkout is not ours
        return {"commit": git("rev-parse", "HEAD"), "dirty": bool(git("status", "--porcelain", "--", *CODE))}
    except (OSError, subprocess.SubprocessError):
        return None


def is_study(name: str, value: Any) -> None:
    """Rule: a study as `read_study` gives it."""
    checks.mapping(name, value)
    points, picture = value.get("points"), value.get("picture", {"name": ""})
    if not isinstance(points, list) or not isinstance(picture, Mapping) or "name" not in picture:
        raise checks.refuse(name, value, "what read_study gives, with points and, for charts, a named picture,")
    if not all(isinstance(point, Mapping) for point in points):
        raise checks.refuse(f"{name}['points']", points, "a list of dicts")
