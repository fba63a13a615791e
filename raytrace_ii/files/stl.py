"""STL files, ASCII and binary: triangles, read through trimesh."""

from __future__ import annotations

import logging
import re
import warnings
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .beside import read_bytes
from .corners import joined
from .mesh_model import Model, Part

HEADER, TRIANGLE = 84, 50  # bytes
NAME = re.compile(rb"^([ \t]*(?:end)?solid)[^\r\n]*", re.M | re.I)
CORNER = re.compile(rb"^\s*vertex\b", re.M | re.I)


def read_stl(path: Path) -> Model:
    """Read the part of an .stl file, smooth up to `corners.CREASE_DEG`; the normals of the file are ignored.

    Raises
    ------
    ValueError
        If the file is damaged.
    OSError
        If it cannot be read.
    """
    data = read_bytes(path)
    places = _text(data) if _is_text(data) else _parsed(_whole(data))
    if not np.isfinite(places).all():
        raise ValueError("holds vertices that are not finite numbers")
    if not len(places):
        raise ValueError("holds no triangles")
    places, corners = np.unique(places + 0.0, axis=0, return_inverse=True)
    return Model([Part("", joined(places, corners.reshape(-1, 3)))])


def _is_text(data: bytes) -> bool:
    """Return whether a file is ASCII. Binary files may start with the same word."""
    return data.lstrip()[:5].lower() == b"solid" and len(data) != _length(data)


def _length(data: bytes) -> int:
    return HEADER + TRIANGLE * int.from_bytes(data[80:HEADER], "little")


def _whole(data: bytes) -> bytes:
    """Return a binary file up to its last triangle: trimesh refuses further bytes."""
    length = max(_length(data), HEADER)
    if len(data) < length:
        raise ValueError(f"has {len(data)} bytes, {length} are needed: the file is cut off")
    return data[:length]


def _text(data: bytes) -> NDArray[np.float64]:
    """Return all corners of an ASCII file; trimesh omits a solid without an end."""
    places = _parsed(NAME.sub(rb"\1", data))  # trimesh reads a name with the word vertex as a corner
    written = len(CORNER.findall(data))
    if len(places) != written:
        raise ValueError(f"has {written} corners, {len(places)} of them readable: the file is damaged or cut off")
    return places


def _parsed(data: bytes) -> NDArray[np.float64]:
    """Return the corners (3 F, 3) of all triangles, one after another."""
    from trimesh.exchange.stl import load_stl  # imported late: it takes half a second

    log = logging.getLogger("trimesh")
    if not log.handlers:  # otherwise Python prints a traceback for each unreadable normal
        log.addHandler(logging.NullHandler())
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # numpy's for words that are no numbers
        try:
            loaded = load_stl(BytesIO(data))
        except Exception as error:  # trimesh raises errors of any type
            raise ValueError(f"cannot be read as STL: {' '.join(str(error).split())}") from None
    solids = [loaded] if "vertices" in loaded else loaded["geometry"].values()
    return np.concatenate([np.empty((0, 3)), *(solid["vertices"] for solid in solids)])
