"""Files of rate–distortion studies: points, picture and provenance."""

from __future__ import annotations

import hashlib
import math
import os
import platform
import subprocess
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from ii_core import IIPicture
from ii_core.base import checks
from ii_core.base.files import check_form, one_line, read_json, write_json
from ii_core.base.identity import library_versions

from ..rates.against_anchor import differences
from ..rates.points import check_points, measures_of, spelt, unspelt

FORMAT, VERSION = "ii-rd-study", 1
POOLING = "pooled MSE over R, G and B"
PACKAGES = ("ii_core", "raytrace_ii", "codec", "metrics", "assets", "benchmarks")
CODE = (*(f":(top){package}" for package in PACKAGES), ":(top)pyproject.toml", ":(top,exclude)benchmarks/results")


class Study(dict[str, Any]):
    """A study as a dict; notebooks show its table and chart."""

    def __repr__(self) -> str:
        points = self["points"]
        schemes = dict.fromkeys(point["scheme"] for point in points)
        return f"Study({self['picture']['name']}: {len(points)} points of {', '.join(schemes) or 'no scheme'})"

    def _repr_png_(self) -> bytes:
        from ..plots.rd_chart import chart_png

        return chart_png(self)

    def _repr_html_(self) -> str:
        from ii_core.picture.notebook import captioned

        from ..plots.tables import html_table, summary_table

        return html_table(summary_table(self)) + captioned(self._repr_png_(), repr(self))


@checks.checked(
    path=checks.path,
    picture_name=checks.text,
    records=checks.sequence,
    picture=checks.instance(IIPicture),
    anchor=checks.text,
    extra=checks.mapping,
)
def write_study(
    path: str | os.PathLike[str],
    picture_name: str,
    records: Sequence[Mapping[str, Any]],
    extra: Mapping[str, Any] | None = None,
    *,
    picture: IIPicture,
    anchor: str | None = None,
) -> Path:
    """Write the records of `rate_distortion` and their provenance as JSON.

    Parameters
    ----------
    path : path
        Replaced whole.
    picture_name : str
        Title of charts.
    records : sequence of dict
    extra : dict, optional
        Further plain values to store.
    picture : IIPicture
        The coded picture; the file stores its structure and the SHA-256 of its pixels.
    anchor : str, optional
        Scheme of comparison; the first if not given. The file holds the `differences` to it in every measure.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ValueError
        If a record lacks a field.
    OSError
        If the file cannot be written.
    """
    check_points(records)
    study = {"points": records, "anchor": anchor}
    measured = measures_of(records) if records else []
    return write_json(
        path,
        {
            "format": FORMAT,
            "version": VERSION,
            "picture": picture_json(picture_name, picture),
            "pooling": POOLING,
            **provenance(),
            "extra": dict(extra or {}),
            "anchor": anchor or (records[0]["scheme"] if records else None),
            "differences": {name: spelt(differences(study, measure=name)) for name in measured},
            # JSON has no infinity: lossless points are marked, other infinite qualities are text.
            "points": [{**spelt(dict(record)), "lossless": record["q_global"] == math.inf} for record in records],
        },
    )


def picture_json(name: str, picture: IIPicture) -> dict[str, Any]:
    """Return the identity of a picture: the SHA-256 of its pixels, their type, and its structure."""
    return {
        "name": name,
        "sha256": hashlib.sha256(np.ascontiguousarray(picture.pixels).data).hexdigest(),
        "pixels": list(picture.size),
        "dtype": picture.pixels.dtype.name,
        **picture.structure_json(),
    }


@checks.checked(path=checks.path)
def read_study(path: str | os.PathLike[str]) -> Study:
    """Read a study of `write_study`; its ``["points"]`` equal the records, infinite qualities included.

    Raises
    ------
    ValueError
        If the file is not a study.
    OSError
        If it cannot be read.
    """
    study = read_json(path)
    try:
        check_form(study, "not a study", FORMAT, VERSION, ("picture", "points"))
        if not isinstance(study["picture"], dict) or not isinstance(study["points"], list):
            raise ValueError("not a study: picture is to be an object, points a list")
        check_points(study["points"])
        study["points"] = [unspelt(point) for point in study["points"]]
    except ValueError as error:
        raise ValueError(f"{path}: {one_line(error)}") from None
    return Study(study)


def provenance() -> dict[str, Any]:
    """Return the provenance of a measurement: commit, machine and versions of libraries.

    The commit is that of the first call in this process: modules are loaded by then, and the checkout may move on
    while they measure. Call it before a long measurement.
    """
    return {
        "git": _git(),
        "machine": {"platform": platform.platform(), "cpus": os.cpu_count()},
        "versions": library_versions(),
    }


@lru_cache(maxsize=1)
def _git() -> dict[str, Any] | None:
    """Return the commit of this checkout and whether its code was changed; None outside a checkout.

    Records and pages are not code: writing them does not change the commit of the next measurement.
    """
    folder = Path(__file__).parent

    def git(*args: str) -> str:
        command = ["git", "-C", str(folder), *args]
        return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout.strip()

    try:
        git("ls-files", "--error-unmatch", __file__)  # fails for an installation inside another checkout
        return {"commit": git("rev-parse", "HEAD"), "dirty": bool(git("status", "--porcelain", "--", *CODE))}
    except (OSError, subprocess.SubprocessError):
        return None
