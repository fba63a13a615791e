"""Log of a benchmark run: finished points, from which a run that failed or was killed continues."""

from __future__ import annotations

import os
import shlex
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ii_core.base.files import one_line
from ii_core.base.identity import file_hash, source_hash
from ii_core.base.json_lines import append_record, read_records

from ..rates.points import check_points, spelt, unspelt
from ..rates.rd import PACKAGES
from ..reports.study import provenance
from .profile import Profile

FORMAT, VERSION = "ii-benchmark-run", 1


class RunLog:
    """Log file of the points of one run.

    Parameters
    ----------
    path : path
        Written with the first point.
    profile : Profile
    coder : str
    commands : sequence of str, optional
        External commands; files that they name are compared by their hashes.
    restart : bool
        Remove an existing log.

    Raises
    ------
    ValueError
        If the log belongs to another definition, coder, commit, code or libraries, or is damaged.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        profile: Profile,
        coder: str,
        commands: Sequence[str] | None = None,
        *,
        restart: bool = False,
    ) -> None:
        self.path = Path(path)
        origin = provenance()
        self.run = {
            "definition": f"{profile.name} version {profile.version}, {profile.digest}",
            "coder": coder,
            "commands": None if commands is None else list(commands),
            "programs": _programs(commands or ()),
            "commit": origin["git"],
            "code": source_hash(PACKAGES),
            "libraries": origin["versions"],
        }
        if restart:
            self.remove()
        self._pictures: dict[str, str] = {}
        self._points: dict[str, list[dict[str, Any]]] = {}
        self._read()

    def _read(self) -> None:
        for number, line in enumerate(read_records(self.path, FORMAT, VERSION), 1):
            try:
                self._take(line)
            except (KeyError, TypeError, ValueError, AttributeError) as error:
                raise ValueError(f"{self.path}, line {number}: {one_line(error)}") from None

    def _take(self, line: Mapping[str, Any]) -> None:
        for what, ours in self.run.items():
            if (theirs := line["run"].get(what)) != ours:
                raise ValueError(
                    f"points of another {what}, {_short(theirs)} and not {_short(ours)}: "
                    "such points are not mixed, --force starts again"
                )
        check_points([line["point"]])
        name = line["picture"]["name"]
        if self._pictures.setdefault(name, line["picture"]) != line["picture"]:
            raise ValueError(f"two pictures are called {name}")
        self._points.setdefault(name, []).append(unspelt(line["point"]))

    def picture(self, name: str) -> dict[str, Any] | None:
        """Return the identity of the coded picture of this name, as from `picture_json`; None if it has no point."""
        found: Any = self._pictures.get(name)
        return None if found is None else dict(found)

    def points(self, name: str) -> list[dict[str, Any]]:
        """Return the finished points of a picture."""
        return list(self._points.get(name, ()))

    def keep(self, picture: Mapping[str, Any], point: Mapping[str, Any]) -> None:
        """Append a point of a picture, flushed to disk."""
        line = {"format": FORMAT, "version": VERSION, "run": self.run, "picture": dict(picture), "point": dict(point)}
        append_record(self.path, {**line, "point": spelt(line["point"])})

    def remove(self) -> None:
        """Remove the file: the result holds all points."""
        self.path.unlink(missing_ok=True)


def _programs(commands: Sequence[str]) -> dict[str, str]:
    """Return the SHA-256 of the files that commands name."""
    found = {}
    for word in dict.fromkeys(word for command in commands for word in shlex.split(command)):
        path = Path(shutil.which(word) or word)
        if path.is_file():
            found[word] = file_hash(path)
    return found


def _short(value: Any) -> str:
    text = one_line(str(value))
    return text if len(text) <= 60 else f"{text[:57]}…"
