"""OBJ, PLY and STL files: geometry through trimesh, materials from MTL."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core.files import read_image

from ..scene.scene import Material, Vector
from ..scene.textures import Image, VertexColours, image_texture, linear, srgb_colour
from ..shapes.primitives import Mesh
from .mesh_model import Model, Part

FLIP = np.array([1.0, 1.0, -1.0])  # right-handed with −z ahead to left-handed with z ahead
OBJ_WORDS = {"v", "vt", "vn", "f", "o", "g", "s", "usemtl", "mtllib"}


def read_mesh_file(path: Path) -> Model:
    """Parts of an .obj, one for each object and material in it, or the one of a .ply or .stl.

    Raises
    ------
    ValueError
        If the file holds no triangles or is damaged, or its materials are.
    OSError
        If a file that it names is missing.
    """
    if path.suffix.lower() == ".obj":
        return _read_obj(path)
    mesh = _mesh(path.name, _trimesh(path, path.suffix[1:].lower()))
    # colours of the vertices are all that such a file says of its material
    material = Material(colour=(1.0, 1.0, 1.0), texture=VertexColours()) if mesh.colours is not None else None
    return Model([Part("", mesh, material)])


def _trimesh(path: Path, kind: str, **options: Any) -> Any:
    import trimesh  # half a second that scenes without files need not wait for

    try:
        with path.open("rb") as stream:
            loaded = trimesh.load(stream, file_type=kind, process=False, **options)
    except Exception as error:  # trimesh raises whatever its parsers do
        reason = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(f"cannot be read as a mesh: {reason}") from None
    if isinstance(loaded, trimesh.Scene) and loaded.geometry:
        return loaded
    if not isinstance(loaded, trimesh.Trimesh) or not len(loaded.faces):
        raise ValueError("holds no triangles")
    return loaded


def _mesh(where: str, mesh: Any) -> Mesh:
    """A mesh of trimesh's in our frame."""
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    if not np.isfinite(vertices).all():
        raise ValueError("holds vertices that are not finite numbers")
    if len(faces) and not 0 <= faces.min() <= faces.max() < len(vertices):
        raise ValueError(f"names vertex {faces.max()}, there are {len(vertices)}")
    uv = getattr(mesh.visual, "uv", None)
    colours = None
    if mesh.visual.kind == "vertex":  # 8 bits, and sRGB by custom
        colours = linear(np.asarray(mesh.visual.vertex_colors)[:, :3] / 255)
    return Mesh(
        vertices * FLIP,
        faces[:, ::-1],
        np.asarray(mesh.vertex_normals) * FLIP,
        np.asarray(uv) if uv is not None and len(uv) == len(vertices) else None,
        colours,
    )


class _Names(dict[str, bytes]):
    """In place of the material files: every material is there, and says no more than its name."""

    def __missing__(self, key: str) -> bytes:
        return self[""]

    def get(self, key: str, default: Any = None) -> bytes:
        return self[""]


def _read_obj(path: Path) -> Model:
    text = path.read_text(encoding="utf-8", errors="replace")
    notes = [f"{word} lines" for word in sorted(set(re.findall(r"^[ \t]*([a-z_]+)\s", text, re.M)) - OBJ_WORDS)]
    used = dict.fromkeys(name.strip() for name in re.findall(r"^usemtl\s+(.+)$", text, re.M))
    names = _Names({"": "".join(f"newmtl {name}\n" for name in used).encode()})
    loaded = _trimesh(path, "obj", resolver=names, split_objects=True)
    known = _materials(path, text, notes.append)
    geometry = dict(reversed(loaded.geometry.items())) if hasattr(loaded, "geometry") else {"": loaded}
    parts = []
    for name, each in geometry.items():
        if not hasattr(each, "faces") or not len(each.faces):
            continue
        mesh = _mesh(name, each)
        own = getattr(getattr(each.visual, "material", None), "name", "")
        if known and own in used and own not in known:
            raise ValueError(f"usemtl {own}: known are {', '.join(known)}")
        material = known.get(own)
        if material is not None and material.texture is not None and mesh.uv is None:
            raise ValueError(f"material {own}: map_Kd needs texture coordinates, {name} has none")
        parts.append(Part(name if len(geometry) > 1 else "", mesh, material))
    if not parts:
        raise ValueError("holds no triangles")
    return Model(parts, left_out=list(dict.fromkeys(notes)))


def _materials(path: Path, text: str, note: Callable[[str], None]) -> dict[str, Material]:
    """The materials of all files that ``mtllib`` names."""
    found: dict[str, Material] = {}
    for line in re.findall(r"^mtllib\s+(.+)$", text, re.M):
        whole = path.parent / line.strip()
        for file in [whole] if whole.is_file() else [path.parent / name for name in line.split()]:
            if not file.is_file():
                raise FileNotFoundError(f"mtllib: {file} does not exist")
            blocks = re.split(r"^[ \t]*newmtl[ \t]+", file.read_text(encoding="utf-8", errors="replace"), flags=re.M)
            for block in blocks[1:]:
                name, *lines = block.splitlines()
                found[name.strip()] = _material(f"{file.name}: {name.strip()}", lines, file.parent, note)
    return found


# What MTL has no need to say here: ambient is the colour's share of the ambient light, as everywhere.
_SILENT = {"ka", "sharpness"}


def _material(where: str, lines: list[str], folder: Path, note: Callable[[str], None]) -> Material:
    values: dict[str, Any] = {}
    picture: Image | None = None
    for line in lines:
        word, _, rest = line.partition("#")[0].strip().partition(" ")
        key, rest = word.lower(), rest.strip()
        if key in ("kd", "ks", "ke", "tf"):
            values[key] = _colour(f"{where}: {word}", rest)
        elif key in ("ns", "ni", "d", "tr", "illum"):
            values[key] = _number(f"{where}: {word}", rest)
        elif key == "map_kd":
            picture = _picture(f"{where}: {word}", rest, folder, note)
        elif key and key not in _SILENT:
            note(f"MTL {word}")
    gone = values.get("tr", 1 - values.get("d", 1.0))
    if not 0 <= gone <= 1:
        raise ValueError(f"{where}: d or Tr leaves {gone:g} to go through: a share from 0 to 1 is needed")
    red, green, blue = (gone * f for f in values.get("tf", (1.0, 1.0, 1.0)))
    shine = values.get("ks", (0.0, 0.0, 0.0))
    # illum 3, 5 and up ask for reflection by ray tracing, glass takes its own by Fresnel
    mirror: Vector = tuple(min(s, 1 - gone) for s in shine) if values.get("illum", 2) in (3, 5) else (0, 0, 0)
    return Material(
        colour=(1.0, 1.0, 1.0) if picture is not None and "kd" not in values else values.get("kd", (0.8, 0.8, 0.8)),
        texture=picture,
        specular=sum(shine) / 3 if values.get("ns", 0.0) > 0 else 0.0,
        shininess=values.get("ns", 0.0) or 50.0,
        mirror=mirror,
        transmission=(red, green, blue),
        ior=values.get("ni", 1.0),
        emission=values.get("ke", (0.0, 0.0, 0.0)),
    )


def _numbers(where: str, text: str) -> NDArray[np.float64]:
    try:
        numbers = np.array([float(word) for word in text.split()])
    except ValueError:
        numbers = np.array([np.nan])
    if not len(numbers) or not np.isfinite(numbers).all() or (numbers < 0).any():
        raise ValueError(f"{where} {text!r}: numbers of at least 0 are needed")
    return numbers


def _number(where: str, text: str) -> float:
    return float(_numbers(where, text.removeprefix("-halo "))[0])


def _colour(where: str, text: str) -> Vector:
    """An sRGB colour; one number stands for three, and light given off may be brighter than white."""
    numbers = _numbers(where, text)
    values = [float(v) for v in (numbers if len(numbers) == 3 else np.repeat(numbers[:1], 3))]
    brightest = max(1.0, *values)
    r, g, b = srgb_colour([v / brightest for v in values])
    return r * brightest, g * brightest, b * brightest


def _picture(where: str, text: str, folder: Path, note: Callable[[str], None]) -> Image:
    """The image of a map; its options are left out."""
    if text.startswith("-"):
        note(f"MTL options of map_Kd: {text.split()[0]}")
        text = text.split()[-1]
    try:
        return image_texture(read_image(folder / text.replace("\\", "/")))
    except OSError as error:
        raise type(error)(f"{where}: {error}") from None
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None
