"""OBJ files: polygons of objects and materials, smoothing groups, vertex colours."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..scene.scene import Material
from ..scene.textures import VertexColours, linear
from .beside import decoded_text, read_bytes
from .corners import Table, joined
from .mesh_model import Model, Part
from .mtl import read_materials
from .polygons import triangulated

Array = NDArray[np.float64]
Rows = NDArray[np.int64]
UNSAID = -1  # the smoothing group of faces before any ``s``


@dataclass(eq=False)
class _Faces:
    """Polygons of one object and material: their corners as written, how many each has, their smoothing groups.

    ``known`` is how many v, vt and vn stood before each polygon, which negative numbers count back from.
    """

    corners: list[str] = field(default_factory=list)
    counts: list[int] = field(default_factory=list)
    groups: list[int] = field(default_factory=list)
    known: list[tuple[int, int, int]] = field(default_factory=list)


@dataclass(eq=False)
class _Obj:
    """Lines of a file by what they say, and its polygons by object and material."""

    lines: dict[str, list[str]] = field(default_factory=lambda: {"v": [], "vt": [], "vn": []})
    faces: dict[tuple[str, str], _Faces] = field(default_factory=dict)
    libraries: list[str] = field(default_factory=list)
    others: set[str] = field(default_factory=set)


def read_obj(path: Path) -> Model:
    """Parts of an .obj file, one for each object and material in it.

    Raises
    ------
    ValueError
        If the file holds no polygons or is damaged, or its materials are.
    OSError
        If it cannot be read.
    """
    obj = _parsed(decoded_text(read_bytes(path)))
    notes = [f"{word} lines" for word in sorted(obj.others)]
    materials = read_materials(path.parent, obj.libraries, notes.append)
    places, colours = _places(obj.lines["v"])
    uv, normals = _numbers("vt", obj.lines["vt"], 2), _numbers("vn", obj.lines["vn"], 3)
    unknown = {own: None for _, own in obj.faces if own and own not in materials}
    if unknown and obj.libraries:
        notes.append(f"materials that no MTL file has: {', '.join(unknown)}")
    parts = []
    for (name, own), faces in obj.faces.items():
        corners, groups = _triangles(faces, places, len(uv), len(normals))
        mesh = joined(
            places, corners[..., 0], uv=Table(uv, corners[..., 1]) if len(uv) else None,
            normals=Table(normals, corners[..., 2]), colours=colours, groups=groups,
        )  # fmt: skip
        material = materials.get(own)
        if material is not None and material.texture is not None and mesh.uv is None:
            notes.append(f"map_Kd of {own} (no texture coordinates)")
            material = replace(material, texture=None)
        if mesh.colours is not None:
            if material is not None and material.texture is not None:
                notes.append("colours of vertices under a texture")
            else:
                white = Material(colour=(1.0, 1.0, 1.0))
                material = replace(material if material is not None else white, texture=VertexColours())
        label = "_".join(word for word in (name, own) if word)
        parts.append(Part(label if len(obj.faces) > 1 else "", mesh, material))
    return Model(parts, left_out=list(dict.fromkeys(notes)))


def _parsed(text: str) -> _Obj:
    obj = _Obj()
    lines, faces = obj.lines, obj.faces
    name, material, group = "", "", UNSAID
    into: _Faces | None = None
    for line in text.replace("\\\n", " ").replace("\\\r\n", " ").splitlines():
        word, _, rest = line.partition("#")[0].strip().replace("\t", " ").partition(" ")
        if word in lines:
            lines[word].append(rest)
        elif word == "f":
            corners = rest.split()
            if len(corners) < 3:
                raise ValueError(f"f {rest[:80]!r}: at least three corners are needed")
            if into is None:
                into = faces.setdefault((name, material), _Faces())
            into.corners += corners
            into.counts.append(len(corners))
            into.groups.append(group)
            into.known.append((len(lines["v"]), len(lines["vt"]), len(lines["vn"])))
        elif word == "o":
            name, into = rest.strip(), None
        elif word == "usemtl":
            material, into = rest.strip(), None
        elif word == "s":
            group = _group(rest.strip())
        elif word == "mtllib":
            obj.libraries.append(rest.strip())
        elif word and word != "g" and word.isidentifier():
            obj.others.add(word)
    return obj


def _group(text: str) -> int:
    """A smoothing group; 0 for none."""
    return int(text) if text.isdecimal() and len(text) < 10 else 0


def _numbers(word: str, lines: list[str], width: int) -> Array:
    """The first numbers of lines of a kind, (n, width)."""
    values = None
    if len({line.count(" ") for line in lines}) == 1:  # written by a program: read in one piece
        values = _in_one_piece(" ".join(lines), np.float64, len(lines))
    if values is None or values.shape[1] < width:
        rows = [line.split(None, width)[:width] for line in lines]
        try:
            values = np.array(rows, np.float64) if rows else np.empty((0, width))
        except ValueError:
            bad = next(line for line, row in zip(lines, rows, strict=True) if not _are_numbers(row, width))
            raise ValueError(f"{word} {bad[:80]!r}: {width} numbers are needed") from None
        if values.shape[1] != width:
            raise ValueError(f"{word} {lines[0][:80]!r}: {width} numbers are needed")
    if not np.isfinite(values[:, :width]).all():
        bad = lines[int(np.argmin(np.isfinite(values[:, :width]).all(axis=1)))]
        raise ValueError(f"{word} {bad[:80]!r}: finite numbers are needed")
    return values[:, :width]


def _in_one_piece(text: str, kind: Any, rows: int) -> NDArray[Any] | None:
    """Numbers with spaces between, (rows, n); None if they are none, or have no such shape."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # where numpy stops reading
        try:
            values = np.fromstring(text, kind, sep=" ")
        except (DeprecationWarning, ValueError, OverflowError):
            return None
    return values.reshape(rows, -1) if rows and len(values) % rows == 0 and len(values) else None


def _are_numbers(row: list[str], width: int) -> bool:
    try:
        return len([float(word) for word in row]) == width
    except ValueError:
        return False


def _places(lines: list[str]) -> tuple[Array, Array | None]:
    """Vertices, and their linear colours if each has one: three more numbers, sRGB, to 1 or to 255."""
    places = _numbers("v", lines, 3)
    if not lines or len(lines[0].split()) not in (6, 7):
        return places, None
    if any(len(line.split()) < 6 for line in lines):
        return places, None
    codes = _numbers("v", [" ".join(line.split()[3:6]) for line in lines], 3)
    return places, linear(np.clip(codes / (255 if codes.max(initial=0) > 1 else 1), 0, 1))


def _triangles(faces: _Faces, places: Array, uvs: int, normals: int) -> tuple[Rows, Rows]:
    """Triangles (T, 3, 3) by rows of v, vt and vn, −1 for none, and their smoothing groups."""
    counts = np.array(faces.counts)
    known = np.repeat(np.array(faces.known), counts, axis=0)
    written = _rows(faces.corners)
    rows = np.where(written > 0, written - 1, known + written)
    for kind, (word, there) in enumerate((("v", len(places)), ("vt", uvs), ("vn", normals))):
        needed = (written[:, kind] != 0) | (word == "v")
        bad = needed & ((written[:, kind] == 0) | (rows[:, kind] < 0) | (rows[:, kind] >= there))
        if bad.any():
            at = faces.corners[int(np.argmax(bad))][:80]
            raise ValueError(f"f {at!r}: names a {word} that is not there: there are {there}")
    rows[written == 0] = -1
    triangles = triangulated(places[rows[:, 0]], counts)
    polygon = np.repeat(np.arange(len(counts)), counts)
    return rows[triangles], np.array(faces.groups)[polygon[triangles[:, 0]]]


def _rows(corners: list[str]) -> Rows:
    """Numbers (C, 3) of v/vt/vn as written; 0 where there is none."""
    slashes = {corner.count("/") for corner in corners}
    text = " ".join(corners)
    if len(slashes) == 1 and ("//" in text) in (False, text.count("//") == len(corners)):
        kinds = [0, 2] if "//" in text else list(range(slashes.pop() + 1))
        values = _in_one_piece(text.replace("/", " "), np.int64, len(corners))
        if values is not None and values.shape[1] == len(kinds) and not text.startswith("/"):
            rows = np.zeros((len(corners), 3), np.int64)
            rows[:, kinds] = values
            return rows
    try:
        return np.array([_row(corner) for corner in corners], np.int64)
    except (ValueError, OverflowError):
        bad = next(corner for corner in corners if not _is_row(corner))
        raise ValueError(f"f {bad[:80]!r}: whole numbers v, v/vt, v//vn or v/vt/vn are needed") from None


def _row(corner: str) -> tuple[int, int, int]:
    v, _, rest = corner.partition("/")
    vt, _, vn = rest.partition("/")
    return int(v), int(vt or 0), int(vn or 0)


def _is_row(corner: str) -> bool:
    try:
        return max(map(abs, _row(corner))) < 1 << 62
    except ValueError:
        return False
