"""Scene files: TOML that pydantic checks, meshes through trimesh, images through OpenImageIO."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PositiveFloat, ValidationError

from ii_core.files import read_image

from .scene import Background, Body, Light, Material, Scene
from .shapes import AnyShape, Mesh, Point3, Sizes, rotation
from .texture import Checker, Noise, Texture, image_texture, linear

MESH_TYPES = (".glb", ".gltf", ".obj", ".ply", ".stl")


def _colour(value: Any) -> Point3:
    """``"#rrggbb"`` or three sRGB numbers in [0, 1], to linear."""
    if isinstance(value, str):
        if not (len(value) == 7 and value[0] == "#" and all(c in "0123456789abcdefABCDEF" for c in value[1:])):
            raise ValueError(f"colour {value!r}: #rrggbb or three numbers from 0 to 1 are needed")
        value = [int(value[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    if not (
        isinstance(value, list | tuple)
        and len(value) == 3
        and all(isinstance(c, int | float) and 0 <= c <= 1 for c in value)
    ):
        raise ValueError(f"colour {value!r}: #rrggbb or three numbers from 0 to 1 are needed")
    r, g, b = (float(c) for c in linear(value))
    return r, g, b


def _share(value: Any) -> Point3:
    """One number for all three colours, or an sRGB colour."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        if not 0 <= value <= 1:
            raise ValueError(f"{value}: a share from 0 to 1 is needed")
        return float(value), float(value), float(value)
    return _colour(value)


Colour = Annotated[Point3, BeforeValidator(_colour)]
Share = Annotated[Point3, BeforeValidator(_share)]
NotNegative = Annotated[float, Field(ge=0)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class _ImageTexture(_Strict):
    kind: Literal["image"]
    file: str


class _TwoColours(_Strict):
    colours: tuple[Colour, Colour]
    size: PositiveFloat | Sizes
    on: Literal["body", "surface"] = "body"


class _CheckerTexture(_TwoColours):
    kind: Literal["checker"]


class _NoiseTexture(_TwoColours):
    kind: Literal["noise"]
    octaves: Annotated[int, Field(ge=1, le=8)] = 1
    contrast: NotNegative = 1.0
    seed: Annotated[int, Field(ge=0, lt=1024)] = 0


class _Material(_Strict):
    colour: Colour = (0.8, 0.8, 0.8)
    texture: str | None = None
    specular: NotNegative = 0.0
    shininess: PositiveFloat = 50.0
    mirror: Share = (0.0, 0.0, 0.0)
    transmission: Share = (0.0, 0.0, 0.0)
    ior: PositiveFloat = 1.5
    absorption_per_mm: tuple[NotNegative, NotNegative, NotNegative] = (0.0, 0.0, 0.0)


class _PointLight(_Strict):
    kind: Literal["point"]
    position_mm: Point3
    colour: Colour = (1.0, 1.0, 1.0)
    intensity: NotNegative = 1.0


class _DirectionalLight(_Strict):
    kind: Literal["directional"]
    direction: Point3
    colour: Colour = (1.0, 1.0, 1.0)
    intensity: NotNegative = 1.0


class _Background(_Strict):
    horizon: Colour
    zenith: Colour | None = None
    nadir: Colour | None = None
    spread_deg: Annotated[float, Field(gt=0, le=90)] = 90.0


class _MeshFile(_Strict):
    """A mesh file stands in for a shape: right-handed as files are, with −z into the scene."""

    mesh: str
    smooth: bool = True


class _Object(BaseModel):
    """Where a shape stands; the shape's own parameters lie beside these."""

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)
    name: str = ""
    material: str
    position_mm: Point3 = (0.0, 0.0, 0.0)
    rotate_deg: Point3 = (0.0, 0.0, 0.0)
    scale: PositiveFloat | Sizes = 1.0


class _SceneFile(_Strict):
    title: str = ""
    about: str = ""
    ambient: Share = (0.1, 0.1, 0.1)
    max_depth: Annotated[int, Field(ge=0, le=64)] = 6
    background: _Background = _Background(horizon=(0.0, 0.0, 0.0))
    light: list[Annotated[_PointLight | _DirectionalLight, Field(discriminator="kind")]] = []
    texture: dict[str, Annotated[_ImageTexture | _CheckerTexture | _NoiseTexture, Field(discriminator="kind")]] = {}
    material: dict[str, _Material] = {}
    object: list[_Object] = []


class _ShapeHolder(_Strict):
    value: AnyShape


def scene_names() -> dict[str, str]:
    """Names of the scenes that come with the package, each with its line of description."""
    found = {}
    for file in sorted(Path(str(files("assets") / "scenes")).glob("*.toml")):
        found[file.stem] = str(tomllib.loads(file.read_text(encoding="utf-8")).get("about", ""))
    return found


def load_scene(name: str | os.PathLike[str]) -> Scene:
    """A scene by its name, or from a TOML file.

    Parameters
    ----------
    name : str or path
        One of `scene_names`, or a file that ends in ``.toml``. Other files named in it are looked for beside it.

    Returns
    -------
    Scene

    Raises
    ------
    ValueError
        If the name is unknown, the file is wrong, or a mesh or texture is.
    OSError
        If a file is missing.
    """
    path = Path(name)
    if path.suffix != ".toml":
        known = scene_names()
        if str(name) not in known:
            raise ValueError(f"unknown scene {str(name)!r}: known are {', '.join(known)}, or give a .toml file")
        path = Path(str(files("assets") / "scenes" / f"{name}.toml"))
    if not path.is_file():
        raise FileNotFoundError(f"{path} does not exist")
    try:
        file = _SceneFile.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
        return _scene(file, path)
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{path}: {error}") from None
    except ValidationError as error:
        raise ValueError(f"{path}: {_first(error)}") from None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _first(error: ValidationError) -> str:
    """The first complaint as one line, with the place in the file's own terms."""
    complaints = error.errors()
    first = complaints[0]
    place = ".".join(str(part) for part in first["loc"] if part != "value")
    text = first["msg"].removeprefix("Value error, ")
    text = {"extra_forbidden": "no such key", "missing": "is missing"}.get(first["type"], text)
    more = f" (and {len(complaints) - 1} more)" if len(complaints) > 1 else ""
    return f"{place}: {text}{more}"


def _scene(file: _SceneFile, path: Path) -> Scene:
    textures = {name: _texture(value, path.parent) for name, value in file.texture.items()}
    materials = {name: _material(name, value, textures) for name, value in file.material.items()}
    if not file.object:
        raise ValueError("no geometry: at least one [[object]] is needed")
    bodies = [_body(i, value, materials, path.parent) for i, value in enumerate(file.object)]
    sky = file.background
    return Scene(
        name=path.stem,
        bodies=bodies,
        lights=[_light(value) for value in file.light],
        background=Background(
            horizon=sky.horizon,
            zenith=sky.zenith if sky.zenith is not None else sky.horizon,
            nadir=sky.nadir if sky.nadir is not None else sky.horizon,
            spread_deg=sky.spread_deg,
        ),
        ambient=file.ambient,
        max_depth=file.max_depth,
    )


def _light(value: _PointLight | _DirectionalLight) -> Light:
    r, g, b = (c * value.intensity for c in value.colour)
    vector = value.position_mm if isinstance(value, _PointLight) else value.direction
    return Light(kind=value.kind, vector=vector, colour=(r, g, b))


def _texture(value: _ImageTexture | _CheckerTexture | _NoiseTexture, folder: Path) -> Texture:
    if isinstance(value, _ImageTexture):
        return image_texture(read_image(folder / value.file))
    size = value.size if isinstance(value.size, tuple) else (value.size, value.size, value.size)
    on_surface = value.on == "surface"
    if isinstance(value, _NoiseTexture):
        return Noise(value.colours, size, value.octaves, value.contrast, value.seed, on_surface)
    return Checker(value.colours, size, on_surface)


def _material(name: str, value: _Material, textures: dict[str, Texture]) -> Material:
    if value.texture is not None and value.texture not in textures:
        raise ValueError(f"material.{name}: unknown texture {value.texture!r}: known are {', '.join(textures)}")
    texture = textures[value.texture] if value.texture is not None else None
    if texture is not None and "colour" not in value.model_fields_set:
        value = value.model_copy(update={"colour": (1.0, 1.0, 1.0)})
    try:
        return Material(**{**value.model_dump(), "texture": texture})
    except ValueError as error:
        raise ValueError(f"material.{name}: {error}") from None


def _body(index: int, value: _Object, materials: dict[str, Material], folder: Path) -> Body:
    where = f"object.{index}"
    if value.material not in materials:
        raise ValueError(f"{where}: unknown material {value.material!r}: known are {', '.join(materials)}")
    material = materials[value.material]
    mesh, label = _mesh(where, value.model_extra or {}, folder)
    size = np.array(value.scale if isinstance(value.scale, tuple) else (value.scale,) * 3)
    turn = rotation(value.rotate_deg)
    vertices = (mesh.vertices * size) @ turn.T + value.position_mm
    normals = None if mesh.normals is None else (mesh.normals / size) @ turn.T
    return Body(
        name=value.name or f"{label} {index}",
        vertices=vertices,
        faces=mesh.faces,
        material=material,
        normals=normals,
        texture_coordinates=_coordinates(where, material.texture, mesh, size),
    )


def _coordinates(where: str, texture: Texture | None, mesh: Mesh, size: NDArray[np.float64]) -> Any:
    if texture is None:
        return None
    if not texture.on_surface:
        return mesh.vertices * size
    if mesh.uv is None:
        raise ValueError(f"{where}: a texture on the surface needs texture coordinates, the mesh has none")
    return np.column_stack([mesh.uv, np.zeros(len(mesh.uv))])


def _mesh(where: str, parameters: dict[str, Any], folder: Path) -> tuple[Mesh, str]:
    """The mesh that an object's own parameters describe, and what to call it."""
    checked: Callable[[], tuple[Mesh, str]]
    if "mesh" in parameters:

        def checked() -> tuple[Mesh, str]:
            file = _MeshFile.model_validate(parameters)
            return read_mesh(folder / file.mesh, smooth=file.smooth), Path(file.mesh).stem

    else:

        def checked() -> tuple[Mesh, str]:
            shape = _ShapeHolder.model_validate({"value": parameters}).value
            return shape.mesh(), shape.shape

    try:
        return checked()
    except ValidationError as error:
        raise ValueError(f"{where}.{_first(error)}") from None


def read_mesh(path: Path, *, smooth: bool = True) -> Mesh:
    """A triangle mesh from glTF, OBJ, PLY or STL, brought to the scene's left-handed frame by z → −z.

    Raises
    ------
    ValueError
        If the file holds no triangles or is none of these.
    OSError
        If it does not exist.
    """
    import trimesh  # half a second that scenes without files need not wait for

    if path.suffix.lower() not in MESH_TYPES:
        raise ValueError(f"{path.name} is no known mesh type: known are {', '.join(MESH_TYPES)}")
    if not path.is_file():
        raise FileNotFoundError(f"{path} does not exist")
    try:
        mesh = trimesh.load(path, force="mesh", process=False)
    except Exception as error:  # trimesh raises whatever its parsers do
        raise ValueError(f"{path.name} cannot be read as a mesh: {error}") from None
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        raise ValueError(f"{path.name} holds no triangles")
    if not np.isfinite(mesh.vertices).all():
        raise ValueError(f"{path.name} holds vertices that are not finite numbers")
    uv = getattr(mesh.visual, "uv", None)
    flip = np.array([1.0, 1.0, -1.0])
    return Mesh(
        np.asarray(mesh.vertices) * flip,
        np.asarray(mesh.faces)[:, ::-1],
        np.asarray(mesh.vertex_normals) * flip if smooth else None,
        np.asarray(uv) if uv is not None and len(uv) == len(mesh.vertices) else None,
    )
