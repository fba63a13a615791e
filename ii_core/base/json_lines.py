"""JSON-lines files: appended record by record; a killed writer loses no whole record. ``.gz`` files are read."""

from __future__ import annotations

import gzip
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .atomic import disk_errors
from .files import check_file, check_form, parse_json

try:
    import fcntl
except ImportError:  # Windows has no fcntl: there, only one process may write a file
    fcntl = None  # type: ignore[assignment]


def append_record(path: Path, record: Mapping[str, Any]) -> None:
    """Append a record and flush it to disk; an incomplete last line of a killed writer is removed first."""
    path.parent.mkdir(parents=True, exist_ok=True)
    line = json.dumps(record, ensure_ascii=False) + "\n"
    with disk_errors(path), path.open("a+b") as file:
        if fcntl is not None:
            fcntl.flock(file, fcntl.LOCK_EX)  # other processes may append, too
        file.seek(0)
        file.truncate(file.read().rfind(b"\n") + 1)
        file.write(line.encode())
        file.flush()
        os.fsync(file.fileno())


def lines_of(path: Path) -> list[bytes]:
    """Return the lines of a file with their ends, decompressed if its suffix is ``.gz``."""
    data = path.read_bytes()
    return (gzip.decompress(data) if path.suffix == ".gz" else data).splitlines(keepends=True)


def read_records(path: Path, format: str, version: int) -> list[dict[str, Any]]:
    """Return all records of a file, oldest first, without an incomplete last line.

    Raises
    ------
    ValueError
        If a line is not a record of this format and version.
    OSError
        If the path is a folder, pipe or device.
    """
    if not path.exists():
        return []
    check_file(path)
    found = []
    for number, line in enumerate(lines_of(path), 1):
        if not line.endswith(b"\n"):
            break
        try:
            record = parse_json(line)
            check_form(record, "no record", format, version)
        except ValueError as error:
            raise ValueError(f"{path}, line {number}: {error}") from None
        found.append(record)
    return found
