"""MTL files: materials of OBJ as Whitted materials."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..scene.scene import Material, Vector
from ..scene.textures import Image, image_texture, linear
from .beside import beside, decoded_text, read_bytes, read_texture
from .mesh_model import share

Note = Callable[[str], None]


def read_materials(folder: Path, libraries: list[str], note: Note) -> dict[str, Material]:
    """The materials of all files that ``mtllib`` lines name; ``note`` takes what is missing or not supported.

    A line is one name with spaces, or several.

    Raises
    ------
    ValueError
        If a value of a material is wrong.
    """
    found: dict[str, Material] = {}
    for file in _libraries(folder, libraries, note):
        blocks = re.split(r"^[ \t]*newmtl[ \t]+", decoded_text(read_bytes(file)), flags=re.M)
        for block in blocks[1:]:
            name, *lines = block.splitlines() or [""]
            found[name.strip()] = _material(f"{file.name}: {name.strip()}", lines, file.parent, note)
    return found


def _libraries(folder: Path, lines: list[str], note: Note) -> Iterator[Path]:
    for line in dict.fromkeys(lines):
        whole = _there(folder, line)
        if whole is not None:
            yield whole
            continue
        for name in line.split():
            file = _there(folder, name)
            if file is not None:
                yield file
            else:
                note(f"mtllib {name} (not there)")


def _there(folder: Path, name: str) -> Path | None:
    """A file beside another, None where there is none."""
    try:
        path = beside(folder, name.replace("\\", "/"))
        return path if path.is_file() else None
    except (ValueError, OSError):
        return None


# What MTL has no need to say here: ambient is the colour's share of the ambient light, as everywhere.
_SILENT = {"ka", "sharpness"}


def _material(where: str, lines: list[str], folder: Path, note: Note) -> Material:
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
            picture = picture_of_map(f"{where}: {word}", rest, folder, note)
        elif key and key not in _SILENT:
            note(f"MTL {word}")
    if values.get("tr") == 1 and "d" not in values and not _is_glass(values):
        note("Tr 1, by which MeshLab means opaque")
        values["d"] = 1.0
    gone = share(1 - values["d"] if "d" in values else values.get("tr", 0.0))  # files with both mean d
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
        ior=values.get("ni") or 1.0,  # 0 stands for no index: ours is above 0
        emission=values.get("ke", (0.0, 0.0, 0.0)),
    )


def _is_glass(values: dict[str, Any]) -> bool:
    """Whether a material that lets all light through colours it, bends it, or asks for transparency by its model."""
    return "tf" in values or values.get("ni", 1.0) not in (0, 1) or values.get("illum") in (4, 6, 7, 9)


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
    values = numbers if len(numbers) == 3 else np.repeat(numbers[:1], 3)
    brightest = max(1.0, float(values.max()))
    r, g, b = (float(c) for c in linear(values / brightest) * brightest)
    return r, g, b


def picture_of_map(where: str, text: str, folder: Path, note: Note) -> Image | None:
    """The image of a map; its options are left out. None if there is no such file beside the material's."""
    if text.startswith("-"):
        note(f"MTL options of map_Kd: {text.split()[0]}")
        text = text.split()[-1]
    path = _there(folder, text)
    if path is None:
        note(f"{where} {text} (not there)")
        return None
    try:
        return image_texture(read_texture(path))
    except OSError as error:
        raise type(error)(f"{where}: {error}") from None
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None
