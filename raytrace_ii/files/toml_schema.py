"""Schema of scene files, checked by pydantic; docs/scenes.md describes every key."""

from __future__ import annotations

import json
import math
import tomllib
from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PositiveFloat, ValidationError, model_validator

from ..scene.textures import Colour, srgb_colour
from ..shapes.heightfield import Heightfield
from ..shapes.implicit import Implicit
from ..shapes.implicit_parts import PARTS
from ..shapes.primitives import Box, BoxGrid, Cylinder, Plane, Point3, Revolve, Sphere
from ..shapes.strands import Strands
from .validation_messages import line, words

AnyShape = Annotated[
    Sphere | Box | Plane | Cylinder | Revolve | BoxGrid | Implicit | Heightfield | Strands,
    Field(discriminator="shape"),
]


def _share(value: Any) -> Point3:
    """One number for all three colours, or an sRGB colour."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        if not 0 <= value <= 1:
            raise ValueError(f"{value}: a share from 0 to 1 is needed")
        return float(value), float(value), float(value)
    return srgb_colour(value)


def _positive(value: Any) -> Point3:
    """One number for all three, or three."""
    three = value if isinstance(value, list | tuple) else [value] * 3
    if not (
        len(three) == 3
        and all(isinstance(s, int | float) and not isinstance(s, bool) and 0 < s < math.inf for s in three)
    ):
        raise ValueError(f"{value!r}: one number or three are needed, greater than 0")
    x, y, z = (float(s) for s in three)
    return x, y, z


Share = Annotated[Point3, BeforeValidator(_share)]
OneOrThree = Annotated[Point3, BeforeValidator(_positive)]
NotNegative = Annotated[float, Field(ge=0)]
OfOne = Annotated[float, Field(ge=0, le=1)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class ImageTexture(_Strict):
    kind: Literal["image"]
    file: str
    repeat: tuple[PositiveFloat, PositiveFloat] = (1.0, 1.0)
    wrap: Literal["repeat", "mirror", "clamp"] = "repeat"


class _TwoColours(_Strict):
    colours: tuple[Colour, Colour]
    on: Literal["body", "surface"] = "body"


class CheckerTexture(_TwoColours):
    kind: Literal["checker"]
    size: OneOrThree


class StripesTexture(_TwoColours):
    kind: Literal["stripes"]
    width: PositiveFloat
    axis: Point3 = (1.0, 0.0, 0.0)
    soft: Annotated[float, Field(ge=0, le=1)] = 0.0


class NoiseTexture(_TwoColours):
    kind: Literal["noise"]
    size: OneOrThree
    octaves: Annotated[int, Field(ge=1, le=8)] = 1
    contrast: NotNegative = 1.0
    seed: Annotated[int, Field(ge=0, lt=1024)] = 0


class VertexTexture(_Strict):
    kind: Literal["vertex"]


AnyTexture = ImageTexture | CheckerTexture | StripesTexture | NoiseTexture | VertexTexture


class MaterialTable(_Strict):
    colour: Colour = (0.8, 0.8, 0.8)
    texture: str | None = None
    specular: NotNegative = 0.0
    shininess: PositiveFloat = 50.0
    mirror: Share = (0.0, 0.0, 0.0)
    transmission: Share = (0.0, 0.0, 0.0)
    ior: OneOrThree = (1.5, 1.5, 1.5)
    absorption_per_mm: tuple[NotNegative, NotNegative, NotNegative] = (0.0, 0.0, 0.0)
    priority: Annotated[int, Field(ge=-1_000_000, le=1_000_000)] = 0
    roughness: OfOne | None = None
    metallic: OfOne | None = None
    metallic_roughness_map: str | None = None
    emission: Share | None = None
    emission_strength: NotNegative = 1.0
    emission_map: str | None = None
    normal_map: str | None = None
    normal_scale: NotNegative = 1.0
    alpha_cutoff: OfOne = 0.0
    alpha_blend: OfOne = 0.0


class PointLight(_Strict):
    kind: Literal["point"]
    position_mm: Point3
    colour: Colour = (1.0, 1.0, 1.0)
    intensity: NotNegative = 1.0


class DirectionalLight(_Strict):
    kind: Literal["directional"]
    direction: Point3
    colour: Colour = (1.0, 1.0, 1.0)
    intensity: NotNegative = 1.0


class SpotLight(_Strict):
    kind: Literal["spot"]
    position_mm: Point3
    direction: Point3
    cone_deg: tuple[NotNegative, Annotated[float, Field(gt=0, le=90)]]
    colour: Colour = (1.0, 1.0, 1.0)
    intensity: NotNegative = 1.0


AnyLight = PointLight | DirectionalLight | SpotLight


class BackgroundTable(_Strict):
    horizon: Colour | None = None
    zenith: Colour | None = None
    nadir: Colour | None = None
    spread_deg: Annotated[float, Field(gt=0, le=90)] = 90.0
    image: str | None = None
    turn_deg: float = 0.0
    intensity: NotNegative = 1.0

    @model_validator(mode="after")
    def _check(self) -> BackgroundTable:
        if self.horizon is None and self.image is None:
            raise ValueError("neither horizon nor image: one of them is needed")
        of_other = {"turn_deg", "intensity"} if self.image is None else {"horizon", "zenith", "nadir", "spread_deg"}
        if stray := sorted(of_other & self.model_fields_set):
            raise ValueError(f"{', '.join(stray)}: no use {'without' if self.image is None else 'with'} an image")
        return self


class FogTable(_Strict):
    colour: Colour
    density_per_mm: PositiveFloat


class MeshFile(_Strict):
    """A mesh file stands in for a shape: right-handed as files are, with −z into the scene.

    Parameters
    ----------
    smooth : bool
        Shade by vertex normals.
    lights : float
        Strength of all the file's lights together at its middle; 0 leaves them out.
    clip : str, optional
        Animation of a glTF file, at ``clip_s`` seconds; in a take ``clip_speed`` seconds a second later.
    """

    mesh: str
    smooth: bool = True
    lights: NotNegative = 1.0
    clip: str | None = None
    clip_s: NotNegative = 0.0
    clip_speed: NotNegative = 1.0


class ObjectTable(BaseModel):
    """Placement of a shape; the shape's own parameters are in the same table."""

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)
    name: str = ""
    material: str | None = None
    position_mm: Point3 = (0.0, 0.0, 0.0)
    rotate_deg: Point3 = (0.0, 0.0, 0.0)
    scale: OneOrThree = (1.0, 1.0, 1.0)


def _listed(value: Any) -> Any:
    return [value] if isinstance(value, str) else value


def _rows(value: Any) -> Any:
    return [row if isinstance(row, list) else [row] for row in value] if isinstance(value, list) else value


class TrackTable(_Strict):
    """Keyframes of one key of one or several tables of the file, or of the camera."""

    of: Annotated[list[str], BeforeValidator(_listed)]
    key: str
    frames: list[float]
    values: Annotated[list[list[float]], BeforeValidator(_rows)]
    how: Literal["linear", "smooth", "step"] = "linear"


class AnimationTable(_Strict):
    frames: Annotated[int, Field(ge=1, le=1_000_000)]
    fps: Annotated[float, Field(gt=0, le=1000)] = 24.0
    track: list[TrackTable] = []


class SceneFile(_Strict):
    title: str = ""
    about: str = ""
    ambient: Share = (0.1, 0.1, 0.1)
    max_depth: Annotated[int, Field(ge=0, le=64)] = 6
    background: BackgroundTable = BackgroundTable(horizon=(0.0, 0.0, 0.0))
    fog: FogTable | None = None
    light: list[Annotated[AnyLight, Field(discriminator="kind")]] = []
    texture: dict[str, Annotated[AnyTexture, Field(discriminator="kind")]] = {}
    material: dict[str, MaterialTable] = {}
    object: list[ObjectTable] = []
    animation: AnimationTable | None = None


class _ShapeHolder(_Strict):
    value: AnyShape


def _by_tag(models: Any, tag: str) -> dict[str, type[BaseModel]]:
    return {get_args(model.model_fields[tag].annotation)[0]: model for model in models}


TEXTURES = _by_tag(get_args(AnyTexture), "kind")
LIGHTS = _by_tag(get_args(AnyLight), "kind")
SHAPES = _by_tag(get_args(get_args(AnyShape)[0]), "shape")
SHAPE_PARTS = _by_tag(PARTS, "part")
# By what pydantic calls the part of a file that a model describes.
_MODELS: dict[str, type[BaseModel]] = {
    "background": BackgroundTable, "fog": FogTable, "animation": AnimationTable, "track": TrackTable,
    **TEXTURES, **LIGHTS, **SHAPES, **SHAPE_PARTS,
}  # fmt: skip


def parse(text: str) -> SceneFile:
    """A scene file's text as checked tables.

    Raises
    ------
    ValueError
        With one line on the first thing that is wrong, and where it stands.
    """
    return checked_tables(raw_tables(text))


def raw_tables(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text, unchecked; ValueError as of `parse`."""
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("tables or lists are nested too deeply") from None


def checked_tables(data: dict[str, Any]) -> SceneFile:
    """Return the checked tables of a scene file; errors as of `parse`."""
    try:
        return _checked(SceneFile, data)
    except RecursionError:
        raise ValueError("tables or lists are nested too deeply") from None


def parse_mesh(parameters: dict[str, Any]) -> MeshFile:
    """Return the checked parameters of an object whose shape is a mesh file."""
    return _checked(MeshFile, parameters)


def check_shape(parameters: dict[str, Any]) -> None:
    """Raise ValueError unless these are the parameters of a shape or a mesh file; nothing is modelled or read."""
    if "mesh" in parameters:
        _checked(MeshFile, parameters)
    else:
        _checked(_ShapeHolder, {"value": parameters})


def parse_shape(parameters: dict[str, Any]) -> AnyShape:
    """Return the shape of an object's own parameters."""
    shape: AnyShape = _checked(_ShapeHolder, {"value": parameters}).value
    return shape


def _checked(model: Any, data: dict[str, Any]) -> Any:
    """Return a model of the data, validated as JSON: strict about types, but lists serve as tuples.

    Raises
    ------
    ValueError
        With one line on the first error and its place.
    """
    try:
        return model.model_validate_json(json.dumps(data, default=str), strict=True)
    except ValidationError as error:
        raise ValueError(_first(error)) from None


def _first(error: ValidationError) -> str:
    """Return the first error as one line, with its place in the terms of the file."""
    first = error.errors()[0]
    place = list(first["loc"])
    if first["type"] == "extra_forbidden":
        text = f"no such key: known are {', '.join(_keys(error.title, place))}"
    else:
        text = words(first)
    # The kind by which pydantic chose is no key of the file.
    if error.title == _ShapeHolder.__name__:
        place = place[2:]
        if len(place) > 2 and place[0] == "parts":
            del place[2:3]
    elif place and place[0] in ("light", "texture"):
        del place[2:3]
    return line(error, place, text)


def _keys(title: str, place: list[Any]) -> list[str]:
    """Return the keys that are allowed at the place of an unknown one."""
    if title == SceneFile.__name__:
        if len(place) == 1:
            return list(SceneFile.model_fields)
        holder = next(part for part in reversed(place[:-1]) if isinstance(part, str))
        return list((MaterialTable if place[0] == "material" else _MODELS[holder]).model_fields)
    if title == _ShapeHolder.__name__ and len(place) > 4:  # a part of a shape
        return list(_MODELS[place[4]].model_fields)
    model = _MODELS[place[1]] if title == _ShapeHolder.__name__ else MeshFile
    return [*model.model_fields, *ObjectTable.model_fields]
