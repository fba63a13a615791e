"""STL files, ASCII and binary: triangles and nothing else."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .beside import read_bytes
from .corners import joined
from .mesh_model import Model, Part

HEADER, TRIANGLE = 84, np.dtype([("numbers", "<f4", (4, 3)), ("attribute", "<u2")])
VERTEX = re.compile(rb"^\s*vertex\s+(\S+)\s+(\S+)\s+(\S+)\s*$", re.M | re.I)


def read_stl(path: Path) -> Model:
    """The one part of an .stl file. Its normals, one a face, are left to the corners' order.

    Raises
    ------
    ValueError
        If the file is damaged.
    OSError
        If it cannot be read.
    """
    data = read_bytes(path)
    places = _ascii(data) if _is_text(data) else _binary(data)
    if not np.isfinite(places).all():
        raise ValueError("holds vertices that are not finite numbers")
    if not len(places):
        raise ValueError("holds no triangles")
    places, corners = np.unique(places + 0.0, axis=0, return_inverse=True)
    return Model([Part("", joined(places, corners.reshape(-1, 3)))])


def _is_text(data: bytes) -> bool:
    """Whether a file is ASCII; some binary ones start with the word too, but are as long as their number says."""
    return data.lstrip()[:5].lower() == b"solid" and len(data) != _length(data)


def _length(data: bytes) -> int:
    count = int.from_bytes(data[80:HEADER], "little")
    return HEADER + count * TRIANGLE.itemsize


def _binary(data: bytes) -> NDArray[np.float64]:
    if len(data) < HEADER or len(data) < _length(data):
        raise ValueError(f"has {len(data)} bytes, {max(_length(data), HEADER)} are needed: the file is cut off")
    count = (_length(data) - HEADER) // TRIANGLE.itemsize
    triangles = np.frombuffer(data, TRIANGLE, count, HEADER)
    return triangles["numbers"][:, 1:].reshape(-1, 3).astype(np.float64)


def _ascii(data: bytes) -> NDArray[np.float64]:
    corners = VERTEX.findall(data)
    if len(corners) % 3 or len(corners) != len(re.findall(rb"\bvertex\b", data)):
        raise ValueError(f"has {len(corners)} readable corners: three for each facet are needed")
    try:
        return np.array(corners).astype(np.float64).reshape(-1, 3)
    except ValueError:
        raise ValueError("holds corners that are no numbers") from None
