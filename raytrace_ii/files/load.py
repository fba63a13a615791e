"""Scenes from files: TOML scene files and single mesh files."""

from __future__ import annotations

import os
import tomllib
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from ii_core.base.checks import place, shown, text
from ii_core.base.files import check_file, one_line

from ..scene.scene import Background, Body, Fog, Light, Material, Scene, Vector, unit_rows
from ..scene.textures import (
    Checker,
    Image,
    Noise,
    Stripes,
    Texture,
    VertexColours,
    image_texture,
    metallic_roughness_map,
    normal_map,
)
from ..shapes.primitives import MOST_TRIANGLES, Mesh, Point3, rotation
from ..shapes.watertight import flaw
from .beside import read_texture
from .mesh_model import Model, Part
from .obj import read_obj
from .ply import read_ply
from .stl import read_stl
from .toml_schema import (  # fmt: skip
    AnyLight,
    AnyTexture,
    BackgroundTable,
    CheckerTexture,
    ImageTexture,
    MaterialTable,
    NoiseTexture,
    ObjectTable,
    PointLight,
    SceneFile,
    SpotLight,
    StripesTexture,
    VertexTexture,
    parse,
    parse_mesh,
    parse_shape,
)
from .validation_messages import line, words

if TYPE_CHECKING:
    from .gltf.nodes import GltfScene

Made = TypeVar("Made")
GLTF_TYPES = (".glb", ".gltf")
MESH_TYPES = (*GLTF_TYPES, ".obj", ".ply", ".stl")
MOST_NAMED = 40  # names of left-out parts in a warning
# Box of a scene of one mesh file, mm: scaled to fit, front at the near side; setup1 sees all of it.
WORKING_VOLUME = np.array([[-20.0, -10.0, 20.0], [20.0, 10.0, 80.0]])


def scene_names() -> dict[str, str]:
    """Return the names of the scenes of the package with a description in one line."""
    found = {}
    for file in _scene_files():
        found[file.stem] = str(tomllib.loads(file.read_text(encoding="utf-8")).get("about", ""))
    return found


def _scene_files() -> list[Path]:
    return sorted(Path(str(files("assets") / "scenes")).glob("*.toml"))


def load_scene(
    name: str | os.PathLike[str], *, rotate_deg: Sequence[float] = (0.0, 0.0, 0.0), fit: str = "*"
) -> Scene:
    """Load a scene by name, from a TOML file, or from a single mesh file.

    Parameters
    ----------
    name : str or path
        One of `scene_names`, a file that ends in ``.toml``, or a mesh file (.glb, .gltf, .obj, .ply, .stl), which is
        scaled and placed to fill `WORKING_VOLUME`, with its own lights or, without any, two lights. Paths in a file
        are relative to its folder.
    rotate_deg : (x, y, z)
        Rotation of a mesh file in degrees, about x, then y, then z, before it is scaled.
    fit : str
        Pattern of names of a mesh file's parts, as in ``"head*"``: they fill the volume, other parts may leave it.

    Returns
    -------
    Scene

    Raises
    ------
    TypeError
        If the name is neither text nor a path, or another argument has a wrong type.
    ValueError
        If the name is unknown, the file is wrong, or a mesh or texture is; if no part is of the names; or if a scene
        that is no mesh file is to be rotated or fitted.
    OSError
        If a file is missing.

    Warns
    -----
    UserWarning
        Once per mesh file with unsupported parts, with their names; and once with the names of objects of glass that
        are not watertight.
    """
    path = scene_path(name)
    files, fitted = MeshFiles(), fitting(path, rotate_deg, fit)
    if is_mesh(path):
        model = files.model(path)
        scene = mesh_scene(path, model, working_place(path, model, fitted))
    else:
        scene = built(path, SceneLoader(path, files).scene, read_tables(path))
    warn_of(path, scene, files)
    return scene


def scene_path(name: str | os.PathLike[str]) -> Path:
    """The file of a scene; errors as `load_scene`."""
    if not isinstance(name, str | os.PathLike) or not isinstance(os.fspath(name), str):
        raise TypeError(f"name is {name!r}: the name of a scene or a path is needed")
    path = Path(name)
    if path.suffix != ".toml" and not is_mesh(path):
        known = {file.stem: file for file in _scene_files()}
        if str(name) not in known:
            raise ValueError(
                f"unknown scene {str(name)!r}: known are {', '.join(known)}, or give a .toml or mesh file"
            )
        path = known[str(name)]
    check_file(path)
    return path


class Fitting(NamedTuple):
    """How a mesh file is fitted into the working volume: its rotation, and a pattern of names of fitted parts."""

    rotate_deg: Point3
    fit: str


def fitting(path: Path, rotate_deg: Sequence[float], fit: str) -> Fitting:
    """Return the checked fitting of a mesh file; raise ValueError if another file is to be rotated or fitted."""
    x, y, z = place("rotate_deg", rotate_deg, 3)
    text("fit", fit)
    if not is_mesh(path) and ((x, y, z) != (0.0, 0.0, 0.0) or fit != "*"):
        raise ValueError(f"{path.name} places its objects itself: only a mesh file can be rotated and fitted")
    return Fitting((x, y, z), fit)


def is_mesh(path: Path) -> bool:
    """Whether a file is a mesh file alone."""
    return path.suffix.lower() in MESH_TYPES


def read_tables(path: Path) -> SceneFile:
    """The checked tables of a scene file; errors name it."""
    return built(path, lambda: parse(path.read_text(encoding="utf-8")))


def built(path: Path, make: Callable[..., Made], *arguments: Any) -> Made:
    """Return the result of a function of a scene file; its errors name the file."""
    try:
        return make(*arguments)
    except ValueError as error:
        raise ValueError(f"{path}: {one_line(error)}") from None
    except OSError as error:
        raise type(error)(f"{path}: {one_line(error)}") from None


def warn_of(path: Path, scene: Scene, files: MeshFiles) -> None:
    """Warn of what mesh files hold that is left out, and of glass without an inside."""
    for file, names in files.left_out.items():
        named, more = names[:MOST_NAMED], len(names) - MOST_NAMED
        rest = f" and {more} more" if more > 0 else ""
        warnings.warn(f"{file}: not supported or not there, and left out: {', '.join(named)}{rest}", stacklevel=3)
    glass = [body for body in scene.bodies if body.material.fills]
    if hollow := [f"{body.name!r} ({why})" for body in glass if (why := flaw(body.vertices, body.faces))]:
        needed = "closed meshes whose faces look outwards are needed, or ior = 1 without absorption for a sheet"
        warnings.warn(f"{path}: glass without an inside: {', '.join(hollow)}: {needed}", stacklevel=3)


class MeshFiles:
    """Mesh files, each read once; glTF files as they stand at any instant of a clip."""

    def __init__(self) -> None:
        self.left_out: dict[Path, list[str]] = {}
        self._scenes: dict[Path, GltfScene] = {}
        self._models: dict[Path, tuple[Any, Model]] = {}  # the latest of each file, and its instant

    def model(self, path: Path, clip: str | None = None, seconds: float = 0.0) -> Model:
        """Meshes, materials and lights of a file; errors as `read_model`."""
        instant = (clip, seconds if clip is not None else 0.0)
        if path not in self._models or self._models[path][0] != instant:
            self._models[path] = instant, read_model(path, clip, seconds, self._scenes)
            self.left_out[path] = self._models[path][1].left_out
            if not self.left_out[path]:
                del self.left_out[path]
        return self._models[path][1]


def read_model(
    path: Path, clip: str | None = None, seconds: float = 0.0, scenes: dict[Path, GltfScene] | None = None
) -> Model:
    """Read meshes, materials and lights of a file in the scene's left-handed frame, by z → −z.

    Parameters
    ----------
    clip : str, optional
        Animation of a glTF file, taken at ``seconds``, and repeated without end.
    scenes : dict, optional
        Keeps glTF files that have been read.

    Raises
    ------
    ValueError
        If the file has no triangles, is damaged, or is of unknown type.
    OSError
        If it, or a file that it refers to, does not exist.
    """
    kind = path.suffix.lower()
    if kind not in MESH_TYPES:
        raise ValueError(f"{path.name} is no known mesh type: known are {', '.join(MESH_TYPES)}")
    check_file(path)
    try:
        if kind in GLTF_TYPES:
            from .gltf.nodes import GltfScene

            scenes = {} if scenes is None else scenes
            if path not in scenes:
                scenes[path] = GltfScene(path)
            model = scenes[path].model(clip, seconds)
        elif clip is not None:
            raise ValueError(f"clip {clip!r}: only glTF files have animations")
        else:
            model = {".obj": read_obj, ".ply": read_ply, ".stl": read_stl}[kind](path)
        if not any(len(part.mesh.faces) for part in model.parts):
            raise ValueError("holds no triangles")
        if not any(_has_area(part.mesh) for part in model.parts):
            raise ValueError("holds no triangles with an area")
        return model
    except ValidationError as error:
        first = error.errors()[0]
        raise ValueError(f"{path.name}: {one_line(line(error, first['loc'], words(first)))}") from None
    except ValueError as error:
        raise ValueError(f"{path.name}: {one_line(error)}") from None
    except OSError as error:
        raise type(error)(f"{path.name}: {one_line(error)}") from None
    except MemoryError:
        raise ValueError(f"{path.name}: needs more memory than there is") from None


def _has_area(mesh: Mesh) -> bool:
    p = mesh.vertices[mesh.faces]
    with np.errstate(over="ignore", invalid="ignore"):  # overflow is refused later, with its position
        return bool((np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]) != 0).any())


def _known(names: Iterable[str]) -> str:
    return ", ".join(names) or "none"


MAPS: dict[str, Callable[[NDArray[Any]], Image]] = {
    "normal_map": normal_map,
    "emission_map": image_texture,
    "metallic_roughness_map": metallic_roughness_map,
}


class SceneLoader:
    """Makes scenes of one file's tables; what stays the same from scene to scene is made once.

    With ``moves`` meshes of bodies are kept at their size and turn, too, which takes their memory once more.
    """

    def __init__(self, path: Path, files: MeshFiles, *, moves: bool = False) -> None:
        self.path, self.files, self.moves = path, files, moves
        self._made: dict[Any, tuple[Any, Any, Any]] = {}
        self._triangles: Counter[int] = Counter()  # of each object's shape

    def scene(self, file: SceneFile, seconds: float = 0.0) -> Scene:
        """The scene at an instant, which clips of mesh files show."""
        textures = {
            name: self._once(("texture", name), value, None, partial(self._texture, name, value))
            for name, value in file.texture.items()
        }
        materials = {}
        for name, table in file.material.items():
            texture = textures.get(table.texture or "")
            make = partial(self._material, name, table, textures)
            materials[name] = self._once(("material", name), table, texture, make)
        if not file.object:
            raise ValueError("no geometry: at least one [[object]] is needed")
        bodies: list[Body] = []
        lights = [_light(i, value) for i, value in enumerate(file.light)]
        for i, value in enumerate(file.object):
            where = f"object.{i} ({value.name})" if value.name else f"object.{i}"
            try:
                moment = seconds if (value.model_extra or {}).get("clip") else 0.0
                look = materials.get(value.material or "")
                made = partial(self._object, i, value, materials, seconds)
                shown, shining = self._once(("object", i), (value, moment), look, made)
            except ValueError as error:
                raise ValueError(f"{where}: {error}") from None
            except OSError as error:
                raise type(error)(f"{where}: {error}") from None
            bodies += shown
            lights += shining
        sky = self._once("background", file.background, None, partial(self._background, file.background))
        return Scene(
            name=self.path.stem,
            bodies=bodies,
            lights=lights,
            background=sky,
            fog=Fog(colour=file.fog.colour, density_per_mm=file.fog.density_per_mm) if file.fog else None,
            ambient=file.ambient,
            max_depth=file.max_depth,
        )

    def _once(self, key: Any, value: Any, other: Any, make: Callable[[], Any]) -> Any:
        """Return the object of a table, made again only if the table or the object that it uses has changed."""
        found = self._made.get(key)
        if found is None or found[0] != value or found[1] is not other:
            found = self._made[key] = value, other, make()
        return found[2]

    def _object(
        self, i: int, value: ObjectTable, materials: dict[str, Material], seconds: float
    ) -> tuple[list[Body], list[Light]]:
        """An object's bodies and lights."""
        model, label, strength = self._model(i, value, materials, seconds)
        bodies = list(_bodies(value, model.parts, f"{label} {i}", partial(self._turned, i, value)))
        return bodies, [_placed(light, value, strength) for light in model.lights if strength > 0]

    def _turned(self, i: int, value: ObjectTable, part: int, mesh: Mesh) -> _Turned:
        """Return a part's mesh at the object's size and turn, before its place is added."""
        make = partial(_turned, value, mesh)
        return self._once(("turned", i, part), (value.scale, value.rotate_deg), mesh, make) if self.moves else make()

    def _model(
        self, i: int, value: ObjectTable, materials: dict[str, Material], seconds: float
    ) -> tuple[Model, str, float]:
        """Return the parts of an object with its material, its name, and the strength of its lights."""
        parameters = value.model_extra or {}
        if value.material is not None and value.material not in materials:
            raise ValueError(f"unknown material {value.material!r}: known are {_known(materials)}")
        material = materials[value.material] if value.material is not None else None
        if "mesh" not in parameters:
            mesh, label = self._once(("shape", i), parameters, None, partial(self._shape, i, parameters))
            if material is None:
                raise ValueError("material: is missing")
            return Model([Part("", mesh, material)]), label, 0.0
        if "shape" in parameters:
            raise ValueError("both mesh and shape: one of them is needed")
        file = parse_mesh(parameters)
        path = self.path.parent / file.mesh
        model = self.files.model(path, file.clip, file.clip_s + file.clip_speed * seconds)
        parts = model.parts
        if material is not None:
            parts = [replace(part, material=material) for part in parts]
        if not file.smooth:
            parts = [replace(part, mesh=replace(part.mesh, normals=None)) for part in parts]
        return Model(parts, model.lights), path.stem, file.lights

    def _shape(self, i: int, parameters: dict[str, Any]) -> tuple[Mesh, str]:
        """Return the mesh and the name of an object's shape; the triangles of all shapes are bounded before."""
        shape = parse_shape(parameters)
        self._triangles[i] = shape.triangles()
        if self._triangles.total() > MOST_TRIANGLES:
            raise ValueError(
                f"about {self._triangles.total():.3g} triangles with the shapes before it: "
                f"at most {MOST_TRIANGLES} are allowed"
            )
        return shape.mesh(), shape.shape

    def _image(self, where: str, name: str, make: Any = image_texture) -> Image:
        try:
            image: Image = make(read_texture(self.path.parent / name))
        except OSError as error:
            raise type(error)(f"{where}: {error}") from None
        except ValueError as error:
            raise ValueError(f"{where}: {name}: {error}") from None
        return image

    def _background(self, sky: BackgroundTable) -> Background:
        if sky.image is not None:
            image = self._image("background.image", sky.image)
            return Background(image=image, turn_deg=sky.turn_deg, intensity=sky.intensity)
        horizon = sky.horizon if sky.horizon is not None else (0.0, 0.0, 0.0)
        return Background(
            horizon=horizon,
            zenith=sky.zenith if sky.zenith is not None else horizon,
            nadir=sky.nadir if sky.nadir is not None else horizon,
            spread_deg=sky.spread_deg,
        )

    def _texture(self, name: str, value: AnyTexture) -> Texture:
        try:
            if isinstance(value, ImageTexture):
                return replace(self._image("file", value.file), repeat=value.repeat, wrap=(value.wrap, value.wrap))
            return _pattern(value)
        except OSError as error:
            raise type(error)(f"texture.{name}.{error}") from None
        except ValueError as error:
            dot = "." if isinstance(value, ImageTexture) else ": "
            raise ValueError(f"texture.{name}{dot}{error}") from None

    def _material(self, name: str, value: MaterialTable, textures: dict[str, Texture]) -> Material:
        if value.texture is not None and value.texture not in textures:
            raise ValueError(f"material.{name}: unknown texture {value.texture!r}: known are {_known(textures)}")
        values = value.model_dump(exclude={"emission_strength"})
        values["texture"] = textures[value.texture] if value.texture is not None else None
        if value.texture is not None and "colour" not in value.model_fields_set:
            values["colour"] = (1.0, 1.0, 1.0)
        # factors not given are 1 with a map, else 0
        maps = {"emission": value.emission_map, "roughness": value.metallic_roughness_map}
        maps["metallic"] = value.metallic_roughness_map
        for factor, file in maps.items():
            if values[factor] is None:
                full, none = ((1.0,) * 3, (0.0,) * 3) if factor == "emission" else (1.0, 0.0)
                values[factor] = none if file is None else full
        values["emission"] = tuple(e * value.emission_strength for e in values["emission"])
        if len(set(value.ior)) == 1:
            values["ior"] = value.ior[0]
        for key, make in MAPS.items():
            if values[key] is not None:
                image = self._image(f"material.{name}.{key}", values[key], make)
                texture = values["texture"]
                values[key] = replace(image, wrap=texture.wrap) if isinstance(texture, Image) else image
        try:
            return Material(**values)
        except ValueError as error:
            raise ValueError(f"material.{name}: {error}") from None


def _pattern(value: CheckerTexture | StripesTexture | NoiseTexture | VertexTexture) -> Texture:
    if isinstance(value, VertexTexture):
        return VertexColours()
    on_surface = value.on == "surface"
    if isinstance(value, NoiseTexture):
        return Noise(value.colours, value.size, value.octaves, value.contrast, value.seed, on_surface)
    if isinstance(value, StripesTexture):
        return Stripes(value.colours, value.width, value.axis, value.soft, on_surface)
    return Checker(value.colours, value.size, on_surface)


def _light(index: int, value: AnyLight) -> Light:
    r, g, b = (c * value.intensity for c in value.colour)
    more: dict[str, Any] = {}
    if isinstance(value, SpotLight):
        more = {"direction": value.direction, "cone_deg": value.cone_deg}
    vector = value.position_mm if isinstance(value, PointLight | SpotLight) else value.direction
    try:
        return Light(kind=value.kind, vector=vector, colour=(r, g, b), **more)
    except ValueError as error:
        raise ValueError(f"light.{index}: {error}") from None


class _Turned(NamedTuple):
    """Mesh at an object's size and turn: vertices, their normals, and positions in the object's own frame."""

    vertices: NDArray[np.float64]
    normals: NDArray[np.float64] | None
    positions: NDArray[np.float64]


def _turned(value: ObjectTable, mesh: Mesh) -> _Turned:
    size, turn = np.array(value.scale), rotation(value.rotate_deg)
    positions = mesh.vertices * size
    normals = None if mesh.normals is None else unit_rows(mesh.normals / size) @ turn.T
    return _Turned(positions @ turn.T, normals, positions)


def _bodies(
    value: ObjectTable, parts: list[Part], label: str, turned: Callable[[int, Mesh], _Turned]
) -> Iterator[Body]:
    """Return the parts of an object in its pose."""
    size = np.array(value.scale)
    name = value.name or label
    shared: dict[Any, NDArray[np.float64]] = {}
    for i, part in enumerate(parts):
        mesh, material = part.mesh, part.material if part.material is not None else Material()
        if part.material is not None and value.material is None:  # a file's own material counts in its own units
            material = _scaled(material, float(np.prod(size) ** (1 / 3)))
        placed = turned(i, mesh)
        yield Body(
            name=f"{name}/{part.name}" if part.name else name,
            vertices=placed.vertices + value.position_mm,
            faces=mesh.faces,
            material=material,
            normals=placed.normals,
            texture_coordinates=_coordinates(material, mesh, placed.positions, shared),
        )


def _scaled(material: Material, size: float) -> Material:
    r, g, b = (a / size for a in material.absorption_per_mm)
    return replace(material, absorption_per_mm=(r, g, b)) if max(r, g, b) > 0 else material


def _coordinates(material: Material, mesh: Mesh, positions: NDArray[np.float64], shared: dict[Any, Any]) -> Any:
    """Return the coordinates of a body's textures; ``shared`` holds those that instances share."""
    texture = material.texture
    if isinstance(texture, VertexColours):
        if mesh.colours is None:
            raise ValueError("a texture of vertex colours needs them, the mesh has none")
        return mesh.colours
    if not material.textures:
        return None
    if texture is not None and not texture.on_surface:
        return positions
    if mesh.uv is None:
        what = next((what for what, image in material.maps.items() if image is not None), "")
        what = what if texture is None else "a texture on the surface"
        raise ValueError(f"{what} needs texture coordinates, the mesh has none")
    repeat = texture.repeat if isinstance(texture, Image) else (1.0, 1.0)
    key = id(mesh.uv), repeat
    if key not in shared:
        shared[key] = np.column_stack([mesh.uv * repeat, np.zeros(len(mesh.uv))])
    return shared[key]


def _placed(light: Light, value: ObjectTable, strength: float) -> Light:
    """A file's light where its object stands."""
    turn = rotation(value.rotate_deg) * value.scale

    def vector(values: Any) -> Vector:
        x, y, z = (float(v) for v in values)
        return x, y, z

    colour = vector(c * strength for c in light.colour)
    along = vector(turn @ light.direction)
    if light.kind == "directional":
        return replace(light, vector=vector(turn @ light.vector), colour=colour)
    return replace(light, vector=vector(turn @ light.vector + value.position_mm), direction=along, colour=colour)


def mesh_scene(path: Path, model: Model, value: ObjectTable) -> Scene:
    """A mesh file as a scene of its own, at a place; errors name the file."""
    try:
        return _alone(path, model, value)
    except ValueError as error:
        raise ValueError(f"{path.name}: {one_line(error)}") from None


def working_place(path: Path, model: Model, how: Fitting) -> ObjectTable:
    """Return the transform that rotates a model and fits its parts of some names into the working volume.

    Raises
    ------
    ValueError
        If no part has such a name, or a corner is not finite; the message names the file.
    """
    fitted = [part.mesh.vertices for part in model.parts if fnmatchcase(part.name, how.fit)]
    if not fitted:
        known = _known(dict.fromkeys(part.name for part in model.parts[:MOST_NAMED] if part.name))
        raise ValueError(f"{path.name}: fit is {shown(how.fit)}: no part has such a name, known are {known}")
    corners = np.concatenate(fitted)
    low, high = corners.min(axis=0), corners.max(axis=0)
    if not max(np.abs(low).max(), np.abs(high).max()) <= np.finfo(np.float32).max:
        raise ValueError(
            f"{path.name}: reaches from {low.tolist()} to {high.tolist()}: finite float32 numbers are needed"
        )
    corners = corners @ rotation(how.rotate_deg).T
    low, high = corners.min(axis=0), corners.max(axis=0)
    room = WORKING_VOLUME[1] - WORKING_VOLUME[0]
    scale = float(np.min(room / np.maximum(high - low, 1e-12 * room)))
    shift = (WORKING_VOLUME.sum(axis=0) - (low + high) * scale) / 2
    shift[2] = WORKING_VOLUME[0, 2] - low[2] * scale
    x, y, z = (float(s) for s in shift)
    return ObjectTable(name=path.stem, position_mm=(x, y, z), rotate_deg=how.rotate_deg, scale=(scale, scale, scale))


def _alone(path: Path, model: Model, value: ObjectTable) -> Scene:
    lights = [_placed(light, value, 1.0) for light in model.lights] or [
        Light(kind="directional", vector=(0.5, -1.0, 0.8), colour=(0.7, 0.7, 0.7)),
        Light(kind="directional", vector=(-0.8, -0.2, 0.6), colour=(0.25, 0.25, 0.25)),
    ]
    bodies = list(_bodies(value, model.parts, path.stem, lambda _, mesh: _turned(value, mesh)))
    grey = Background(horizon=(0.6, 0.62, 0.65), zenith=(0.25, 0.35, 0.55), nadir=(0.3, 0.29, 0.28), spread_deg=60)
    return Scene(name=path.stem, bodies=bodies, lights=lights, background=grey, ambient=(0.25, 0.25, 0.25))
