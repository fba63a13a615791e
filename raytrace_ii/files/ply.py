"""PLY files, ASCII and binary: polygons, triangle strips, vertex properties, and MeshLab's picture on the faces."""

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
from .mtl import picture_of_map
from .ply_elements import Column, Columns, read_columns, texture_files
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
    data = read_bytes(path)
    elements, columns = read_columns(data)
    notes = [f"element {name}" for name in columns if name not in ("vertex", "face", "tristrips", "material")]
    vertex = columns.get("vertex", {})
    places = _stacked(vertex, ("x", "y", "z"))
    if places is None:
        raise ValueError("has no element vertex with x, y and z")
    if not np.isfinite(places).all():
        raise ValueError("holds vertices that are not finite numbers")
    faces, uv = _faces(columns, places)
    normals = _stacked(vertex, ("nx", "ny", "nz"))
    if normals is not None:
        normals = np.where(np.isfinite(normals), normals, 0)
    own = next((found for names in UV if (found := _stacked(vertex, names)) is not None), None)
    uv = uv if own is None else Table(own, faces)
    if uv is None and "texcoord" in columns.get("face", {}):
        notes.append("texture coordinates of faces")
    colours = _stacked(vertex, ("red", "green", "blue"))
    if colours is not None:  # sRGB by custom: of whole numbers to 255, of others to 1
        kind = next(p.kind for e in elements if e.name == "vertex" for p in e.properties if p.name == "red")
        peak = np.iinfo(kind).max if kind.kind in "iu" else 1
        colours = linear(np.clip(np.nan_to_num(colours) / peak, 0, 1))
    image = None
    for name in texture_files(data)[:1] if uv is not None else ():
        image = picture_of_map("TextureFile", name, path.parent, notes.append)
    if _more_pictures(columns.get("face", {})):
        notes.append("pictures but the first")
    if image is not None and colours is not None:
        notes.append("vertex colours under a picture")
        colours = None
    mesh = joined(places, faces, colours=colours, normals=None if normals is None else Table(normals, faces), uv=uv)
    texture = image if image is not None else VertexColours() if colours is not None else None
    material = None if texture is None else Material(colour=(1.0, 1.0, 1.0), texture=texture)
    return Model([Part("", mesh, material)], left_out=list(dict.fromkeys(notes)))


def _more_pictures(face: dict[str, Column]) -> bool:
    """Whether faces have another picture than the first, which all are given."""
    numbers = face.get("texnumber")
    return isinstance(numbers, np.ndarray) and bool((numbers > 0).any())


def _stacked(columns: dict[str, Column], names: tuple[str, ...]) -> Array | None:
    """Columns of numbers side by side, None if one is not there."""
    found = [columns.get(name) for name in names]
    if any(not isinstance(column, np.ndarray) or column.ndim != 1 for column in found):
        return None
    return np.column_stack(found)  # type: ignore[arg-type]


def _faces(columns: Columns, places: Array) -> tuple[Rows, Table | None]:
    """Triangles (T, 3) of polygons and strips, and (u, v) of their corners if all faces have those of their own."""
    found, uv = [np.empty((0, 3), np.int64)], None
    face = columns.get("face", {})
    corners, counts = _lists(face, len(places))
    values = _coordinates(face, counts)
    if len(counts) and counts.min() < 3:
        kept = counts >= 3  # points and lines
        of_kept = np.repeat(kept, counts)
        corners, counts, values = corners[of_kept], counts[kept], None if values is None else values[of_kept]
    if len(counts):
        triangles = triangulated(places[corners], counts)
        found.append(corners[triangles])
        uv = None if values is None else Table(values, triangles)
    for strip in _strips(*_lists(columns.get("tristrips", {}), len(places), ends=True)):
        triangles = np.column_stack([strip[:-2], strip[1:-1], strip[2:]])
        triangles[1::2] = triangles[1::2, [1, 0, 2]]  # every other one is turned over
        found.append(triangles)
        uv = None
    return np.concatenate(found), uv


def _coordinates(face: dict[str, Column], counts: Rows) -> Array | None:
    """(u, v) of the corners of all faces one after another; None unless each face has two numbers a corner."""
    column = face.get("texcoord")
    if column is None or not len(counts):
        return None
    rows = np.array([len(row) for row in column])
    if not np.array_equal(rows, 2 * counts):
        return None
    values = np.concatenate(column) if isinstance(column, list) else column
    return np.nan_to_num(values.reshape(-1, 2))


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
