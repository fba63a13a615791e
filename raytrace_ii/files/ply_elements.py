"""Header and columns of a PLY file, ASCII and binary, read through trimesh."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from io import BytesIO
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Column = Array | list[Array]
Columns = dict[str, dict[str, Column]]
Order = Literal["<", ">"]
TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
    "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "float32": "f4", "float64": "f8",
}  # fmt: skip
ORDERS: dict[str, Order | None] = {"ascii": None, "binary_little_endian": "<", "binary_big_endian": ">"}
MOST_HEADER = 1 << 16  # bytes


@dataclass(frozen=True)
class Property:
    """A column; a list has the type of its length too."""

    name: str
    kind: np.dtype[Any]
    length: np.dtype[Any] | None = None


@dataclass(frozen=True)
class Element:
    """Rows of the same properties: vertices, faces, strips."""

    name: str
    count: int
    properties: list[Property]


def texture_files(data: bytes) -> list[str]:
    """Names of pictures in the comments of a header, as MeshLab and others write them."""
    lines = data[: data.find(b"end_header", 0, MOST_HEADER)].decode("utf-8", "replace").splitlines()
    words = [line.split(maxsplit=2) for line in lines]
    return [line[2].strip() for line in words if len(line) == 3 and line[:2] == ["comment", "TextureFile"]]


def read_columns(data: bytes) -> tuple[list[Element], Columns]:
    """Elements of a PLY file and their columns by name: (n,), a list (n, length) or n arrays of their own lengths.

    trimesh parses the rows. It parses no binary lists of different lengths, which are walked row by row here, and
    believes what an ASCII row says of its own length, which is checked before.

    Raises
    ------
    ValueError
        If the header is no PLY 1.0 or the file holds less than it says.
    """
    order, elements, start = _header(data)
    for element in elements:
        if element.count and not element.properties:
            raise ValueError(f"element {element.name}: has no properties")
    if order is None:
        return elements, _parsed(b"\n".join(_rows(data[start:], elements)), None, elements)
    try:
        return elements, _parsed(data[start:], order, elements)
    except ValueError:
        walk = _Walk(data, start, order)
        return elements, {element.name: walk.columns(element) for element in elements}


def _header(data: bytes) -> tuple[Order | None, list[Element], int]:
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
                elements.append(Element(words[1], _count(words[2]), []))
            elif words[0] == "property" and words[1] == "list":
                length, kind = np.dtype(TYPES[words[2]]), np.dtype(TYPES[words[3]])
                if length.kind == "f":
                    raise ValueError(line)
                elements[-1].properties.append(Property(words[4], kind, length))
            elif words[0] == "property":
                elements[-1].properties.append(Property(words[2], np.dtype(TYPES[words[1]])))
            else:
                raise ValueError(line)
        except (KeyError, IndexError, ValueError, TypeError):
            raise ValueError(f"header: {line[:80]!r} is no line of PLY 1.0") from None
    for at, element in enumerate(elements):
        if element.name in [other.name for other in elements[:at]]:
            raise ValueError(f"element {element.name} stands there twice")
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


def _rows(body: bytes, elements: list[Element]) -> list[bytes]:
    """Rows of an ASCII body, each cut to as many words as its element and its lists have."""
    rows = [row for row in body.splitlines() if row.strip()]
    found: list[bytes] = []
    for element in elements:
        own = rows[len(found) : len(found) + element.count]
        try:
            found += [_cut(row, element) for row in own]
        except (IndexError, ValueError):
            raise _short(element) from None
        if len(own) != element.count:
            raise _short(element)
    return found


def _cut(row: bytes, element: Element) -> bytes:
    words = row.split()
    needed = _width(element, words)
    if len(words) < needed:
        raise IndexError
    return row if len(words) == needed else b" ".join(words[:needed])


def _width(element: Element, words: list[bytes]) -> int:
    """Return the number of words of a row."""
    at = 0
    for p in element.properties:
        at += 1 if p.length is None else 1 + int(words[at])
    return at


def _short(element: Element) -> ValueError:
    return ValueError(f"element {element.name}: the file does not hold {element.count} of it")


def _parsed(body: bytes, order: Order | None, elements: list[Element]) -> Columns:
    """Columns as trimesh parses them; ``order`` is None for ASCII."""
    from trimesh.exchange import ply  # half a second that scenes without files need not wait for

    parse = ply._ply_ascii if order is None else ply._ply_binary
    table = {e.name: _as_in_trimesh(e, order or "<") for e in elements if e.count}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # where numpy stops reading, and numbers that their type cannot hold
            parse(table, BytesIO(body))
            return {e.name: {p.name: _column(table, e, p) for p in e.properties} for e in elements}
    except Exception as error:  # trimesh raises whatever its parsers do
        raise ValueError(f"cannot be read as PLY: {' '.join(str(error).split())}") from None


def _as_in_trimesh(element: Element, order: Order) -> dict[str, Any]:
    """An element as trimesh describes it; ``$LIST`` stands for a length that its parser finds."""
    kinds = {
        p.name: order + p.kind.str[1:]
        if p.length is None
        else f"{order}{p.length.str[1:]}, ($LIST,){order}{p.kind.str[1:]}"
        for p in element.properties
    }
    return {"length": element.count, "properties": kinds}


def _column(table: dict[str, dict[str, Any]], element: Element, p: Property) -> Column:
    if not element.count:
        return np.empty((0, 0) if p.length is not None else 0)
    values = table[element.name]["data"][p.name]
    if values.dtype.names:  # a binary list: its lengths f0 and values f1
        if (values["f0"] != values["f1"].shape[1]).any():
            raise ValueError("lists of different lengths")
        values = values["f1"]
    if values.dtype == object:
        return [np.asarray(row, np.float64) for row in values]
    return np.asarray(values, np.float64).reshape((element.count, -1) if p.length is not None else element.count)


class _Walk:
    """Binary elements row by row. Nothing is taken that the bytes left do not hold, whatever the header says."""

    def __init__(self, data: bytes, start: int, order: Order) -> None:
        self.data, self.at, self.order = data, start, order

    def columns(self, element: Element) -> dict[str, Column]:
        rows: dict[str, list[Array]] = {p.name: [] for p in element.properties}
        for _ in range(element.count):
            for p in element.properties:
                count = 1 if p.length is None else int(self._numbers(element, p.length, 1)[0])
                rows[p.name].append(self._numbers(element, p.kind, count))
        return {
            p.name: rows[p.name] if p.length is not None else np.concatenate([np.empty(0), *rows[p.name]])
            for p in element.properties
        }

    def _numbers(self, element: Element, kind: np.dtype[Any], count: int) -> Array:
        if count < 0 or self.at + count * kind.itemsize > len(self.data):
            raise _short(element)
        values = np.frombuffer(self.data, kind.newbyteorder(self.order), count, self.at)
        self.at += values.nbytes
        return values.astype(np.float64)
