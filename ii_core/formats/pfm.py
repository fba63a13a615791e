"""Portable float maps (PFM), single-channel."""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..base.files import atomic_path, check_file


def read_pfm(path: str | os.PathLike[str]) -> NDArray[np.float32]:
    """Read a grey portable float map as (T, S), top row first.

    Raises
    ------
    ValueError
        If it is none, or not whole.
    """
    check_file(path)
    match = re.match(rb"Pf\s+(\d{1,6})\s+(\d{1,6})\s+(-?[\d.]+)\s", data := Path(path).read_bytes())
    if not match or len(data) - match.end() != 4 * int(match[1]) * int(match[2]):
        raise ValueError(f"{path} is no whole grey portable float map")
    values = np.frombuffer(data, "<f4" if float(match[3]) < 0 else ">f4", offset=match.end())
    return values.reshape(int(match[2]), int(match[1]))[::-1].astype(np.float32)


def write_pfm(path: str | os.PathLike[str], values: NDArray[np.float32]) -> Path:
    """Write (T, S) as a little-endian portable float map, bottom row first; return the file's path."""
    rows, cols = values.shape
    with atomic_path(path) as temporary:
        temporary.write_bytes(
            b"Pf\n%d %d\n-1.0\n" % (cols, rows) + np.ascontiguousarray(values[::-1], "<f4").tobytes()
        )
    return Path(path)
