"""Scene files: TOML that pydantic checks, meshes through trimesh, images through OpenImageIO."""

from __future__ import annotations

import math
import os
import tomllib
from collections.abc import Callable, Iterable
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PositiveFloat, ValidationError

from ii_core.files import read_image

from .modelling import PARTS, AnyShape
from .scene import Background, Body, Fog, Light, Material, Scene
from .shapes import Mesh, Point3, rotation
from .texture import Checker, Colour, Image, Noise, Texture, VertexColours, image_texture, srgb_colour

MESH_TYPES = (".glb", ".gltf", ".obj", ".ply", ".stl")


def _share(value: Any) -> Point3:
    """One number for all three colours, or an sRGB colour."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        if not 0 <= value <= 1:
            raise ValueError(f"{value}: a share from 0 to 1 is needed")
        return float(value), float(value), float(value)
    return srgb_colour(value)


def _sizes(value: Any) -> Point3:
    """One number for all three axes, or three."""
    three = value if isinstance(value, list | tuple) else [value] * 3
    if not (
        len(three) == 3
        and all(isinstance(s, int | float) and not isinstance(s, bool) and 0 < s < math.inf for s in three)
    ):
        raise ValueError(f"{value!r}: one number or three are needed, greater than 0")
    x, y, z = (float(s) for s in three)
    return x, y, z


Share = Annotated[Point3, BeforeValidator(_share)]
OneOrThree = Annotated[Point3, BeforeValidator(_sizes)]
NotNegative = Annotated[float, Field(ge=0)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class _ImageTexture(_Strict):
    kind: Literal["image"]
    file: str
    repeat: tuple[PositiveFloat, PositiveFloat] = (1.0, 1.0)


class _TwoColours(_Strict):
    colours: tuple[Colour, Colour]
    size: OneOrThree
    on: Literal["body", "surface"] = "body"


class _CheckerTexture(_TwoColours):
    kind: Literal["checker"]


class _NoiseTexture(_TwoColours):
    kind: Literal["noise"]
    octaves: Annotated[int, Field(ge=1, le=8)] = 1
    contrast: NotNegative = 1.0
    seed: Annotated[int, Field(ge=0, lt=1024)] = 0


class _VertexTexture(_Strict):
    kind: Literal["vertex"]


_AnyTexture = _ImageTexture | _CheckerTexture | _NoiseTexture | _VertexTexture


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


class _Fog(_Strict):
    colour: Colour
    density_per_mm: PositiveFloat


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
    scale: OneOrThree = (1.0, 1.0, 1.0)


class _SceneFile(_Strict):
    title: str = ""
    about: str = ""
    ambient: Share = (0.1, 0.1, 0.1)
    max_depth: Annotated[int, Field(ge=0, le=64)] = 6
    background: _Background = _Background(horizon=(0.0, 0.0, 0.0))
    fog: _Fog | None = None
    light: list[Annotated[_PointLight | _DirectionalLight, Field(discriminator="kind")]] = []
    texture: dict[str, Annotated[_AnyTexture, Field(discriminator="kind")]] = {}
    material: dict[str, _Material] = {}
    object: list[_Object] = []


class _ShapeHolder(_Strict):
    value: AnyShape


# By what pydantic calls the part of a file that a model describes.
_MODELS: dict[str, type[BaseModel]] = {
    "background": _Background,
    "point": _PointLight,
    "directional": _DirectionalLight,
    "image": _ImageTexture,
    "checker": _CheckerTexture,
    "noise": _NoiseTexture,
    "vertex": _VertexTexture,
    "fog": _Fog,
    **{get_args(part.model_fields["part"].annotation)[0]: part for part in PARTS},
    **{get_args(shape.model_fields["shape"].annotation)[0]: shape for shape in get_args(get_args(AnyShape)[0])},
}


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
    except OSError as error:
        raise type(error)(f"{path}: {error}") from None


# pydantic's complaints in the words of the rest of the house; its own stand where none are given.
_WORDS = {
    "missing": "is missing",
    "greater_than": "{input!r}: a number greater than {gt:g} is needed",
    "greater_than_equal": "{input!r}: a number of at least {ge:g} is needed",
    "less_than": "{input!r}: a number less than {lt:g} is needed",
    "less_than_equal": "{input!r}: a number of at most {le:g} is needed",
    "finite_number": "{input!r}: a finite number is needed",
    "float_type": "{input!r}: a number is needed",
    "float_parsing": "{input!r}: a number is needed",
    "int_type": "{input!r}: a whole number is needed",
    "int_parsing": "{input!r}: a whole number is needed",
    "int_from_float": "{input!r}: a whole number is needed",
    "string_type": "{input!r}: a text is needed",
    "bool_type": "{input!r}: true or false is needed",
    "bool_parsing": "{input!r}: true or false is needed",
    "tuple_type": "{input!r}: a list of numbers is needed",
    "list_type": "{input!r}: a list is needed",
    "model_type": "{input!r}: a table of keys is needed",
    "literal_error": "unknown {input!r}: known are {expected}",
    "union_tag_invalid": "unknown {discriminator} {tag!r}: known are {expected_tags}",
    "union_tag_not_found": "{discriminator} is missing",
}


def _first(error: ValidationError) -> str:
    """The first complaint as one line, with the place in the file's own terms."""
    complaints = error.errors()
    first = complaints[0]
    place = list(first["loc"])
    if first["type"] == "extra_forbidden":
        text = f"no such key: known are {_known(_keys(error.title, place))}"
    elif first["type"] in _WORDS:
        context = {k: v.replace("'", "") if isinstance(v, str) else v for k, v in first.get("ctx", {}).items()}
        text = _WORDS[first["type"]].format(input=first["input"], **context)
    else:
        text = first["msg"].removeprefix("Value error, ")
    # The kind by which pydantic chose is no key of the file.
    if error.title == _ShapeHolder.__name__:
        place = place[2:]
        if len(place) > 2 and place[0] == "parts":
            del place[2:3]
    elif place[0] in ("light", "texture"):
        del place[2:3]
    more = f" (and {len(complaints) - 1} more)" if len(complaints) > 1 else ""
    return f"{'.'.join(map(str, place))}{': ' if place else ''}{text}{more}"


def _keys(title: str, place: list[Any]) -> list[str]:
    """The keys that may stand where an unknown one was found."""
    if title == _SceneFile.__name__:
        if len(place) == 1:
            return list(_SceneFile.model_fields)
        return list((_Material if place[0] == "material" else _MODELS[place[-2]]).model_fields)
    if title == _ShapeHolder.__name__ and len(place) > 4:  # a part of a shape
        return list(_MODELS[place[4]].model_fields)
    model = _MODELS[place[1]] if title == _ShapeHolder.__name__ else _MeshFile
    return [*model.model_fields, *_Object.model_fields]


def _known(names: Iterable[str]) -> str:
    return ", ".join(names) or "none"


def _scene(file: _SceneFile, path: Path) -> Scene:
    textures = {name: _texture(name, value, path.parent) for name, value in file.texture.items()}
    materials = {name: _material(name, value, textures) for name, value in file.material.items()}
    if not file.object:
        raise ValueError("no geometry: at least one [[object]] is needed")
    bodies = [_body(i, value, materials, path.parent) for i, value in enumerate(file.object)]
    sky = file.background
    return Scene(
        name=path.stem,
        bodies=bodies,
        lights=[_light(i, value) for i, value in enumerate(file.light)],
        background=Background(
            horizon=sky.horizon,
            zenith=sky.zenith if sky.zenith is not None else sky.horizon,
            nadir=sky.nadir if sky.nadir is not None else sky.horizon,
            spread_deg=sky.spread_deg,
        ),
        fog=Fog(colour=file.fog.colour, density_per_mm=file.fog.density_per_mm) if file.fog else None,
        ambient=file.ambient,
        max_depth=file.max_depth,
    )


def _light(index: int, value: _PointLight | _DirectionalLight) -> Light:
    r, g, b = (c * value.intensity for c in value.colour)
    vector = value.position_mm if isinstance(value, _PointLight) else value.direction
    try:
        return Light(kind=value.kind, vector=vector, colour=(r, g, b))
    except ValueError as error:
        raise ValueError(f"light.{index}: {error}") from None


def _texture(name: str, value: _AnyTexture, folder: Path) -> Texture:
    if isinstance(value, _ImageTexture):
        try:
            return replace(image_texture(read_image(folder / value.file)), repeat=value.repeat)
        except OSError as error:
            raise type(error)(f"texture.{name}.file: {error}") from None
        except ValueError as error:
            raise ValueError(f"texture.{name}.file: {value.file}: {error}") from None
    if isinstance(value, _VertexTexture):
        return VertexColours()
    on_surface = value.on == "surface"
    if isinstance(value, _NoiseTexture):
        return Noise(value.colours, value.size, value.octaves, value.contrast, value.seed, on_surface)
    return Checker(value.colours, value.size, on_surface)


def _material(name: str, value: _Material, textures: dict[str, Texture]) -> Material:
    if value.texture is not None and value.texture not in textures:
        raise ValueError(f"material.{name}: unknown texture {value.texture!r}: known are {_known(textures)}")
    texture = textures[value.texture] if value.texture is not None else None
    if texture is not None and "colour" not in value.model_fields_set:
        value = value.model_copy(update={"colour": (1.0, 1.0, 1.0)})
    try:
        return Material(**{**value.model_dump(), "texture": texture})
    except ValueError as error:
        raise ValueError(f"material.{name}: {error}") from None


def _body(index: int, value: _Object, materials: dict[str, Material], folder: Path) -> Body:
    where = f"object.{index} ({value.name})" if value.name else f"object.{index}"
    if value.material not in materials:
        raise ValueError(f"{where}: unknown material {value.material!r}: known are {_known(materials)}")
    material = materials[value.material]
    mesh, label = _mesh(where, value.model_extra or {}, folder)
    size = np.array(value.scale)
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
    if isinstance(texture, VertexColours):
        if mesh.colours is None:
            raise ValueError(f"{where}: a texture of vertex colours needs them, the mesh has none")
        return mesh.colours
    if not texture.on_surface:
        return mesh.vertices * size
    if mesh.uv is None:
        raise ValueError(f"{where}: a texture on the surface needs texture coordinates, the mesh has none")
    repeat = texture.repeat if isinstance(texture, Image) else (1.0, 1.0)
    return np.column_stack([mesh.uv * repeat, np.zeros(len(mesh.uv))])


def _mesh(where: str, parameters: dict[str, Any], folder: Path) -> tuple[Mesh, str]:
    """The mesh that an object's own parameters describe, and what to call it."""
    checked: Callable[[], tuple[Mesh, str]]
    if "mesh" in parameters and "shape" in parameters:
        raise ValueError(f"{where}: both mesh and shape: one of them is needed")
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
        raise ValueError(f"{where}: {_first(error)}") from None
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None
    except OSError as error:
        raise type(error)(f"{where}: {error}") from None


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
        reason = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(f"{path.name} cannot be read as a mesh: {reason}") from None
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
