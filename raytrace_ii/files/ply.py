"""PLY files, ASCII and binary: polygons, triangle strips and vertex properties."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..scene.scene import Material
from ..scene.textures import VertexColours, linear
from .beside import read_bytes
from .corners import Table, joined
from .mesh_model import Model, Part
from .ply_elements import Column, Columns, read_columns
from .polygons import triangulated

Array = NDArray[np.float64]
Rows = NDArray[np.int64]
CORNERS = ("vertex_indices", "vertex_index")
UV = (("u", "v"), ("s", "t"), ("texture_u", "texture_v"))


def read_ply(path: Path) -> Model:
    """The one part of a .ply file.

    Raises
    ------
    ValueError
        If the file holds no polygons or is damaged.
    OSError
        If it cannot be read.
    """
    elements, columns = read_columns(read_bytes(path))
    notes = [f"element {name}" for name in columns if name not in ("vertex", "face", "tristrips", "material")]
    vertex = columns.get("vertex", {})
    places = _stacked(vertex, ("x", "y", "z"))
    if places is None:
        raise ValueError("has no element vertex with x, y and z")
    if not np.isfinite(places).all():
        raise ValueError("holds vertices that are not finite numbers")
    faces = _faces(columns, places)
    normals = _stacked(vertex, ("nx", "ny", "nz"))
    if normals is not None:
        normals = np.where(np.isfinite(normals), normals, 0)
    uv = next((found for names in UV if (found := _stacked(vertex, names)) is not None), None)
    if "texcoord" in columns.get("face", {}) and uv is None:
        notes.append("texture coordinates of faces")
    colours = _stacked(vertex, ("red", "green", "blue"))
    if colours is not None:  # sRGB by custom: of whole numbers to 255, of others to 1
        kind = next(p.kind for e in elements if e.name == "vertex" for p in e.properties if p.name == "red")
        peak = np.iinfo(kind).max if kind.kind in "iu" else 1
        colours = linear(np.clip(np.nan_to_num(colours) / peak, 0, 1))
    mesh = joined(
        places, faces, colours=colours,
        normals=None if normals is None else Table(normals, faces), uv=None if uv is None else Table(uv, faces),
    )  # fmt: skip
    material = Material(colour=(1.0, 1.0, 1.0), texture=VertexColours()) if colours is not None else None
    return Model([Part("", mesh, material)], left_out=list(dict.fromkeys(notes)))


def _stacked(columns: dict[str, Column], names: tuple[str, ...]) -> Array | None:
    """Columns of numbers side by side, None if one is not there."""
    found = [columns.get(name) for name in names]
    if any(not isinstance(column, np.ndarray) or column.ndim != 1 for column in found):
        return None
    return np.column_stack(found)  # type: ignore[arg-type]


def _faces(columns: Columns, places: Array) -> Rows:
    """Triangles (T, 3) of polygons and strips."""
    found = [np.empty((0, 3), np.int64)]
    corners, counts = _lists(columns.get("face", {}), len(places))
    if len(counts) and counts.min() < 3:
        kept = counts >= 3  # points and lines
        corners, counts = corners[np.repeat(kept, counts)], counts[kept]
    if len(counts):
        found.append(corners[triangulated(places[corners], counts)])
    for strip in _strips(*_lists(columns.get("tristrips", {}), len(places), ends=True)):
        triangles = np.column_stack([strip[:-2], strip[1:-1], strip[2:]])
        triangles[1::2] = triangles[1::2, [1, 0, 2]]  # every other one is turned over
        found.append(triangles)
    return np.concatenate(found)


def _strips(corners: Rows, counts: Rows) -> Iterator[Rows]:
    """Runs of three corners and more, which −1 and the ends of lists part."""
    cuts = np.flatnonzero(corners < 0)
    for strip in np.split(corners, np.unique(np.concatenate([cuts, cuts + 1, np.cumsum(counts)]))):
        if len(strip) >= 3:
            yield strip


def _lists(columns: dict[str, Column], there: int, *, ends: bool = False) -> tuple[Rows, Rows]:
    """Corners of all lists one after another, and how many each has; −1 may end a strip."""
    column = next((columns[name] for name in CORNERS if name in columns), None)
    if column is None or not len(column):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    if isinstance(column, list):
        counts, flat = np.array([len(row) for row in column]), np.concatenate(column)
    else:
        counts, flat = np.full(len(column), column.shape[1]), column.reshape(-1)
    bad = (flat < (-1 if ends else 0)) | (flat >= there) | (flat != np.floor(flat))
    if bad.any():
        raise ValueError(f"names vertex {flat[bad][0]:g}, there are {there}")
    return flat.astype(np.int64), counts
