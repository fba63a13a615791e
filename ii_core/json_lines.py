"""Files of JSON lines that grow by one whole record at a time and outlive a kill."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .files import check_file

try:
    import fcntl
except ImportError:  # not on Windows, where two processes must not write one file
    fcntl = None  # type: ignore[assignment]


def append_record(path: Path, record: Mapping[str, Any]) -> None:
    """Add a line to a file, on disk when this returns; a last line that a kill cut off is removed first."""
    path.parent.mkdir(parents=True, exist_ok=True)
    line = json.dumps(record, ensure_ascii=False) + "\n"
    with path.open("a+b") as file:
        if fcntl is not None:
            fcntl.flock(file, fcntl.LOCK_EX)  # another process may add records of its own
        file.seek(0)
        file.truncate(file.read().rfind(b"\n") + 1)
        file.write(line.encode())
        file.flush()
        os.fsync(file.fileno())


def read_records(path: Path, format: str, version: int) -> list[dict[str, Any]]:
    """Return all records of a file, oldest first; a last line that a kill cut off is left out.

    Raises
    ------
    ValueError
        If another line is no record of this format and version.
    OSError
        If the file is a folder, pipe or device.
    """
    if not path.exists():
        return []
    check_file(path)
    found = []
    for number, line in enumerate(path.read_bytes().splitlines(keepends=True), 1):
        if not line.endswith(b"\n"):
            break
        try:
            record = json.loads(line)
        except ValueError as error:
            raise ValueError(f"{path}, line {number}: {error}") from None
        except RecursionError:
            raise ValueError(f"{path}, line {number}: nested too deeply") from None
        if not isinstance(record, dict) or (record.get("format"), record.get("version")) != (format, version):
            raise ValueError(f'{path}, line {number}: no record: needs "format": "{format}", "version": {version}')
        found.append(record)
    return found
