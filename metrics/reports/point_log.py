"""Log of the points of a rate–distortion study, from which a killed study continues."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from ii_core import IIPicture
from ii_core.base import checks
from ii_core.base.identity import library_versions, source_hash
from ii_core.base.json_lines import append_record, read_records

from ..rates.points import check_points, spelt, unspelt
from ..rates.rd import PACKAGES
from .study import picture_json

FORMAT, VERSION = "ii-rd-point", 1


class PointLog:
    """File of points; ``known`` holds those of the same picture, conditions, code and libraries.

    Parameters
    ----------
    path : path
    picture : IIPicture
        The coded picture.
    **conditions
        Other inputs of the values: names of measures, depth map, layers.

    Raises
    ------
    ValueError
        If the file exists and is not a log of points.
    """

    def __init__(self, path: str | os.PathLike[str], picture: IIPicture, **conditions: Any) -> None:
        checks.path("path", path)
        checks.instance(IIPicture)("picture", picture)
        self.path = Path(path)
        same = {
            "picture": picture_json("", picture),
            "code": source_hash(PACKAGES),
            "versions": library_versions(),
            "conditions": {name: _plain(value) for name, value in conditions.items()},
        }
        self._same = hashlib.sha256(json.dumps(same, sort_keys=True).encode()).hexdigest()
        self.known = {
            (point["scheme"], point["target_bpp"]): point
            for same, point in read_points(self.path)
            if same == self._same
        }

    def request(self, *further: Any) -> str:
        """Return a hash of everything that the study depends on: the inputs of its points, and further values."""
        return hashlib.sha256(json.dumps([self._same, *further]).encode()).hexdigest()

    def keep(self, point: dict[str, Any]) -> None:
        """Append a point."""
        append_record(self.path, {"format": FORMAT, "version": VERSION, "same": self._same, "point": spelt(point)})

    def remove(self) -> None:
        """Remove the file: the study holds all points."""
        self.path.unlink(missing_ok=True)


def read_points(path: Path) -> list[tuple[str, dict[str, Any]]]:
    """Return the points of a file, each with the hash of its inputs.

    Raises
    ------
    ValueError
        If a line is not a point.
    """
    found = []
    for number, line in enumerate(read_records(path, FORMAT, VERSION), 1):
        try:
            check_points([line.get("point")])
            found.append((str(line.get("same")), unspelt(line["point"])))
        except ValueError as error:
            raise ValueError(f"{path}, line {number}: {error}") from None
    return found


def _plain(value: Any) -> Any:
    if value is None or isinstance(value, str | int | float):
        return value
    if isinstance(value, list | tuple) and all(isinstance(item, str) for item in value):
        return list(value)
    array = np.ascontiguousarray(value)
    return [list(array.shape), array.dtype.str, hashlib.sha256(array.data).hexdigest()]
