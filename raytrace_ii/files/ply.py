"""PLY files, ASCII and binary: polygons or triangle strips with what their vertices carry."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..scene.scene import Material
from ..scene.textures import VertexColours, linear
from .beside import read_bytes
from .corners import Table, joined
from .mesh_model import Model, Part
from .polygons import triangulated

Array = NDArray[np.float64]
Rows = NDArray[np.int64]
Column = Array | list[Array]
TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
    "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "float32": "f4", "float64": "f8",
}  # fmt: skip
CORNERS = ("vertex_indices", "vertex_index")
ORDERS: dict[str, Literal["<", ">"] | None] = {
    "ascii": None, "binary_little_endian": "<", "binary_big_endian": ">"
}  # fmt: skip
UV = (("u", "v"), ("s", "t"), ("texture_u", "texture_v"))
MOST_HEADER = 1 << 16  # bytes


@dataclass(frozen=True)
class _Property:
    """A column; a list has the type of its length too."""

    name: str
    kind: np.dtype[Any]
    length: np.dtype[Any] | None = None


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: list[_Property]


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
    order, elements, start = _header(data)
    read = _Ascii(data, start) if order is None else _Binary(data, start, order)
    columns: dict[str, dict[str, Column]] = {}
    for element in elements:
        if element.name in columns:
            raise ValueError(f"element {element.name} stands there twice")
        columns[element.name] = read.element(element)
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


def _header(data: bytes) -> tuple[Literal["<", ">"] | None, list[_Element], int]:
    """Byte order (None for ASCII), elements, and where they start."""
    end = data.find(b"end_header", 0, MOST_HEADER)
    if not data.startswith(b"ply") or end < 0:
        raise ValueError("has no PLY header")
    start = data.find(b"\n", end) + 1
    if start == 0:
        start = len(data)
    order, said, elements = None, False, []
    for line in data[:end].decode("ascii", "replace").splitlines()[1:]:
        words = line.split()
        if not words or words[0] in ("comment", "obj_info"):
            continue
        try:
            if words[0] == "format":
                order, said = ORDERS[words[1]], True
            elif words[0] == "element":
                elements.append(_Element(words[1], _count(words[2]), []))
            elif words[0] == "property" and words[1] == "list":
                length, kind = np.dtype(TYPES[words[2]]), np.dtype(TYPES[words[3]])
                if length.kind == "f":
                    raise ValueError(line)
                elements[-1].properties.append(_Property(words[4], kind, length))
            elif words[0] == "property":
                elements[-1].properties.append(_Property(words[2], np.dtype(TYPES[words[1]])))
            else:
                raise ValueError(line)
        except (KeyError, IndexError, ValueError, TypeError):
            raise ValueError(f"header: {line[:80]!r} is no line of PLY 1.0") from None
    for element in elements:
        names = [p.name for p in element.properties]
        if twice := [name for name in names if names.count(name) > 1][:1]:
            raise ValueError(f"element {element.name}: property {twice[0]} stands there twice")
    if not said:
        raise ValueError("header: has no format")
    return order, elements, start


def _count(text: str) -> int:
    if not text.isdecimal() or len(text) > 18:
        raise ValueError(text)
    return int(text)


class _Reader:
    """Elements one after another. Nothing is taken that the bytes left do not hold, whatever the header says."""

    def element(self, element: _Element) -> dict[str, Column]:
        """Columns of an element by name: (n,), or of a list (n, length) or n arrays of their own lengths."""
        properties = element.properties
        if not element.count:
            return {p.name: np.empty((0, 0) if p.length is not None else 0) for p in properties}
        if not properties:
            raise ValueError(f"element {element.name}: has no properties")
        try:
            columns = self._even(element)
            if columns is None:
                rows = [self._row(properties) for _ in range(element.count)]
                columns = [list(column) for column in zip(*rows, strict=True)]
        except (IndexError, ValueError, OverflowError):
            raise ValueError(f"element {element.name}: the file does not hold {element.count} of it") from None
        return {p.name: column for p, column in zip(properties, columns, strict=True)}

    def _even(self, element: _Element) -> list[Any] | None:
        """All columns at once, or None if lists have different lengths."""
        raise NotImplementedError

    def _row(self, properties: list[_Property]) -> list[Any]:
        """The next row."""
        raise NotImplementedError


class _Ascii(_Reader):
    def __init__(self, data: bytes, start: int) -> None:
        self.words, self.at = data[start:].split(), 0

    def _even(self, element: _Element) -> list[Any] | None:
        if any(p.length is not None for p in element.properties):
            return None
        width = len(element.properties)
        words = self.words[self.at : self.at + element.count * width]
        self.at += len(words)
        return list(np.array(words).astype(np.float64).reshape(element.count, width).T)

    def _row(self, properties: list[_Property]) -> list[Any]:
        row: list[Any] = []
        for p in properties:
            count = 1 if p.length is None else int(self.words[self.at])
            self.at += p.length is not None
            values = np.array([float(word) for word in self.words[self.at : self.at + count]])
            if len(values) != count:
                raise IndexError
            self.at += count
            row.append(values if p.length is not None else values[0])
        return row


class _Binary(_Reader):
    def __init__(self, data: bytes, start: int, order: Literal["<", ">"]) -> None:
        self.data, self.at, self.order = data, start, order

    def _even(self, element: _Element) -> list[Any] | None:
        start = self.at
        lengths = [np.size(value) for value in self._row(element.properties)]
        self.at = start
        fields: list[Any] = []
        for i, (p, length) in enumerate(zip(element.properties, lengths, strict=True)):
            if p.length is not None:
                fields.append((f"n{i}", p.length.newbyteorder(self.order)))
            fields.append((f"v{i}", p.kind.newbyteorder(self.order), () if p.length is None else (length,)))
        kind = np.dtype(fields)
        lists = [i for i, p in enumerate(element.properties) if p.length is not None]
        if start + element.count * kind.itemsize > len(self.data):
            if lists:
                return None
            raise IndexError
        rows = np.frombuffer(self.data, kind, element.count, start)
        if not all((rows[f"n{i}"] == lengths[i]).all() for i in lists):
            return None
        self.at += rows.nbytes
        return [rows[f"v{i}"].astype(np.float64) for i in range(len(lengths))]

    def _row(self, properties: list[_Property]) -> list[Any]:
        row: list[Any] = []
        for p in properties:
            if p.length is None:
                row.append(self._values(p.kind, 1)[0])
            else:
                row.append(self._values(p.kind, int(self._values(p.length, 1)[0])))
        return row

    def _values(self, kind: np.dtype[Any], count: int) -> Array:
        if count < 0 or self.at + count * kind.itemsize > len(self.data):
            raise IndexError
        values = np.frombuffer(self.data, kind.newbyteorder(self.order), count, self.at)
        self.at += values.nbytes
        return values.astype(np.float64)


def _stacked(columns: dict[str, Column], names: tuple[str, ...]) -> Array | None:
    """Columns of numbers side by side, None if one is not there."""
    found = [columns.get(name) for name in names]
    if any(not isinstance(column, np.ndarray) or column.ndim != 1 for column in found):
        return None
    return np.column_stack(found)  # type: ignore[arg-type]


def _faces(columns: dict[str, dict[str, Column]], places: Array) -> Rows:
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
