"""Where a photograph of the benchmark is had: repository, commit, path, licence and the command that makes it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from ii_core.base import checks


@dataclass(frozen=True, kw_only=True)
class Source:
    """Origin of a photograph in a public repository.

    Parameters
    ----------
    repository : str
        Address of the repository.
    commit : str
        Commit, 40 hexadecimal digits.
    path : str
        Folder of views or file in the repository.
    licence : str
        Licence of the picture as the repository states it.
    camera : str
        Device.
    options : str
        Options of `raytrace-ii import`.
    """

    repository: str
    commit: str
    path: str
    licence: str
    camera: str
    options: str = ""

    def command(self, name: str, folder: str) -> str:
        """Return the command that makes the picture in a folder, inside a checkout of the commit."""
        options = f" {self.options}" if self.options else ""
        return f'raytrace-ii import "{self.path}"{options} -o {folder}/{name}.png'


def source_of(values: Mapping[str, Any]) -> Source:
    """Return the source of a profile's entry.

    Raises
    ------
    ValueError
        If an entry is missing, unknown or no text.
    """
    known = sorted(field.name for field in fields(Source))
    if unknown := sorted(set(values) - set(known)):
        raise ValueError(f"source has no {', '.join(unknown)}: known are {', '.join(known)}")
    if missing := [name for name in known if name not in values and name != "options"]:
        raise ValueError(f"source: {', '.join(missing)} missing")
    for name, value in values.items():
        checks.text(f"source {name}", value)
    return Source(**values)
