"""Rate–distortion studies on disk: what was measured, on what, with what; and as a table."""

from __future__ import annotations

import csv
import hashlib
import json
import math
import os
import platform
import subprocess
from collections.abc import Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from ii_core import IIPicture
from ii_core.files import atomic_path, write_json

from .rd import UndefinedDifference, bd_psnr, bd_rate

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
LIBRARIES = ("numpy", "numba", "OpenImageIO", "scikit-image", "av", "pillow", "glymur", "bjontegaard")


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
    _check_points(records)
    (width, height) = picture.size
    write_json(
        path,
        {
            "format": FORMAT,
            "version": VERSION,
            "picture": {
                "name": picture_name,
                "sha256": hashlib.sha256(np.ascontiguousarray(picture.pixels).data).hexdigest(),
                "pixels": [width, height],
                "dtype": picture.pixels.dtype.name,
                **picture.structure_json(),
            },
            "pooling": POOLING,
            **provenance(),
            "extra": dict(extra or {}),
            # Infinity is no JSON number: a lossless point says so.
            "points": [{**record, "lossless": record["q_global"] == math.inf} for record in records],
        },
    )


def read_study(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read what `write_study` wrote; ``["points"]`` equal its records, infinite qualities too.

    Raises
    ------
    ValueError
        If the file is not a study.
    OSError
        If it cannot be read.
    """
    try:
        study = json.loads(Path(path).read_text(encoding="utf-8"))
        if not isinstance(study, dict) or study.get("format") != FORMAT or study.get("version") != VERSION:
            raise ValueError(f'not a study: needs "format": "{FORMAT}", "version": {VERSION}')
        if missing := {"picture", "points"} - set(study):
            raise ValueError(f"not a study: {', '.join(sorted(missing))} missing")
        _check_points(study["points"])
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    for point in study["points"]:
        if point.pop("lossless", False):
            point["q_global"] = math.inf
    return study


def write_csv(path: str | os.PathLike[str], records: Sequence[Mapping[str, Any]]) -> None:
    """Write records as a table, one row a point, for spreadsheets.

    Raises
    ------
    ValueError
        If a record lacks a field.
    OSError
        If the file cannot be written.
    """
    _check_points(records)
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, FIELDS, extrasaction="ignore")
        writer.writeheader()
        for record in records:
            options = " ".join(f"{key}={value}" for key, value in record["options"].items())
            writer.writerow({**record, "options": options})


def summary_table(study: Mapping[str, Any], *, anchor: str = "jpeg2000") -> list[dict[str, str]]:
    """A study as rows of text, one a scheme, all with the same columns.

    Parameters
    ----------
    study : dict
        From `read_study`.
    anchor : str
        The scheme the others are compared with.

    Returns
    -------
    list of dict
        ``scheme``; a column a target rate with dB, or the floor (or ceiling) of a scheme that cannot reach it;
        ``gain``, the mean difference in dB to the anchor over the target rates both reach; ``BD-rate`` and
        ``BD-PSNR`` against it, or why they are not defined.
    """
    points = study["points"]
    schemes = list(dict.fromkeys(point["scheme"] for point in points))
    targets = sorted({point["target_bpp"] for point in points})
    by_target = {scheme: {p["target_bpp"]: p for p in points if p["scheme"] == scheme} for scheme in schemes}
    rows = []
    for scheme in schemes:
        row = {"scheme": scheme}
        for target in targets:
            row[f"{target:g}"] = _cell(by_target[scheme].get(target))
        if scheme == anchor:
            row |= dict.fromkeys(("gain", "BD-rate", "BD-PSNR"), "anchor")
        elif anchor not in by_target:
            row |= dict.fromkeys(("gain", "BD-rate", "BD-PSNR"), f"– (no {anchor})")
        else:
            row["gain"] = _gain(by_target[anchor], by_target[scheme])
            a, b = operating_points(points, anchor), operating_points(points, scheme)
            row["BD-rate"] = _difference(bd_rate, a, b, " %")
            row["BD-PSNR"] = _difference(bd_psnr, a, b, " dB")
        rows.append(row)
    return rows


def operating_points(points: Sequence[Mapping[str, Any]], scheme: str) -> list[tuple[float, float]]:
    """The different (bpp, dB) of a scheme by rate, without lossless ones.

    A point beside its target is as true an operating point as any; the same one given for several targets counts
    once.
    """
    return sorted(
        {(p["bpp"], p["q_global"]) for p in points if p["scheme"] == scheme and math.isfinite(p["q_global"])}
    )


def _cell(point: Mapping[str, Any] | None) -> str:
    if point is None:
        return ""
    if point["reached"]:
        return f"{point['q_global']:.2f}"
    return f"– ({'floor' if point['bpp'] > point['target_bpp'] else 'ceiling'} {point['bpp']:.3g})"


def _gain(anchor: Mapping[float, Mapping[str, Any]], tested: Mapping[float, Mapping[str, Any]]) -> str:
    both = [
        tested[target]["q_global"] - anchor[target]["q_global"]
        for target in tested.keys() & anchor.keys()
        if tested[target]["reached"] and anchor[target]["reached"]
    ]
    gains = [gain for gain in both if math.isfinite(gain)]
    return f"{sum(gains) / len(gains):+.2f} dB at {len(gains)} rates" if gains else "– (no common rate)"


def _difference(function: Any, a: list[tuple[float, float]], b: list[tuple[float, float]], unit: str) -> str:
    try:
        return f"{function(*zip(*a, strict=True), *zip(*b, strict=True)):+.1f}{unit}"
    except UndefinedDifference as error:
        return f"– ({error.short})"


def _check_points(records: Any) -> None:
    for i, record in enumerate(records):
        if missing := set(FIELDS) - set(record):
            raise ValueError(f"points[{i}] has no {', '.join(sorted(missing))}")


def provenance() -> dict[str, Any]:
    """What a number was measured on: commit, machine and versions of the libraries."""
    return {
        "git": _git(),
        "machine": {"platform": platform.platform(), "cpus": os.cpu_count()},
        "versions": _versions(),
    }


def _git() -> dict[str, Any] | None:
    """Commit of the checkout this code runs from, and whether tracked files were changed; None outside of one."""
    folder = Path(__file__).parent

    def git(*args: str) -> str:
        command = ["git", "-C", str(folder), *args]
        return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout.strip()

    try:
        git("ls-files", "--error-unmatch", __file__)  # installed into somebody else's checkout is not ours
        return {"commit": git("rev-parse", "HEAD"), "dirty": bool(git("status", "--porcelain", "-uno"))}
    except (OSError, subprocess.SubprocessError):
        return None


def _versions() -> dict[str, str]:
    found = {"python": platform.python_version()}
    for library in ("raytrace-ii", *LIBRARIES):
        try:
            found[library] = metadata.version(library)
        except metadata.PackageNotFoundError:
            continue
    return found
