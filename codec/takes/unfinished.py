"""Segments of a take that is being coded, kept on disk until the take is whole."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core.base.atomic import disk_errors
from ii_core.base.files import read_json, write_json

from ..search import Run
from . import container


class Unfinished:
    """Coded segments in ``path.part``, and in ``path.part.json`` their keys: number, settings and hash of the pixels.

    Parameters
    ----------
    path : Path
        The ``.ii`` file of the take.
    header : bytes
        Its header. Segments of a run with another header are not used.
    """

    def __init__(self, path: Path, header: bytes) -> None:
        self.path, self.index = path.with_name(path.name + ".part"), path.with_name(path.name + ".part.json")
        self._header = hashlib.sha256(header).hexdigest()
        self._payloads: dict[str, bytes] = {}  # in the order of the file
        self._end = 0
        try:
            index = read_json(self.index)
            if index["header"] == self._header:
                keys = list(index["segments"])
                found, _ = container.read_segments(self.path, 0, len(keys))
                self._payloads = dict(zip(keys, found, strict=False))
                self._end = sum(len(container.framed(i, payload)) for i, payload in enumerate(found))
        except (OSError, ValueError, KeyError, TypeError):
            pass

    def run(self, number: int, pixels: NDArray[Any], settings: str, code: Callable[[], Run]) -> Run:
        """Return the segment of these pixels and settings: the kept one, or a new one, which is kept."""
        key = f"{number} {settings} {hashlib.sha256(np.ascontiguousarray(pixels).data).hexdigest()}"
        if key in self._payloads:
            return Run(self._payloads[key], 0.0)
        run = code()
        framed = container.framed(len(self._payloads), run.payload)
        with disk_errors(self.path), open(self.path, "r+b" if self._end else "wb") as file:
            file.seek(self._end)
            file.write(framed)
            file.truncate()
            file.flush()
            os.fsync(file.fileno())
        self._end += len(framed)
        self._payloads[key] = run.payload
        write_json(self.index, {"header": self._header, "segments": list(self._payloads)})
        return run

    def remove(self) -> None:
        """Remove both files."""
        self.path.unlink(missing_ok=True)
        self.index.unlink(missing_ok=True)
