"""Scenes of glTF 2.0: nodes, meshes, skins, lights and materials."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scene.scene import Light, unit_rows
from ...shapes.primitives import Mesh
from ..mesh_model import Model, Part
from .clips import Clip, Keys, clip_names
from .container import GltfFile
from .materials import Look, Looks
from .tables import GltfMesh, Node, Primitive, PunctualLight, Skin, left_out

Array = NDArray[np.float64]
FLIP = np.diag([1.0, 1.0, -1.0, 1.0])  # right-handed with −z ahead to left-handed with z ahead
TRIANGLES, STRIP, FAN = 4, 5, 6
MOST_FACES = 50_000_000  # of all instances: about 10 GB when they are traced
# Attributes that are read or have no bearing here: tangents follow from the texture coordinates, of which no
# texture needs the other sets or is named itself, and those with an underscore are the application's own.
_READ = re.compile(r"(POSITION|NORMAL|TANGENT|COLOR_0|TEXCOORD_\d+|JOINTS_\d+|WEIGHTS_\d+|_.*)$")


class GltfScene:
    """A .gltf or .glb file, read once, as it stands at any instant of one of its animations.

    Raises
    ------
    ValueError
        If the file is damaged or needs an extension that is not known.
    OSError
        If a file that it names is missing.
    """

    def __init__(self, path: Path) -> None:
        self.file = GltfFile(path)
        self._reader = _Reader(self.file)
        self._clips: dict[str, Clip] = {}

    @property
    def clips(self) -> list[str]:
        """Names of the animations."""
        return clip_names(self.file)

    def clip(self, name: str) -> Clip:
        """An animation by its name; ValueError if there is none."""
        if name not in self.clips:
            raise ValueError(f"unknown clip {name!r}: known are {', '.join(self.clips) or 'none'}")
        if name not in self._clips:
            self._clips[name] = Clip(self.file, self.clips.index(name))
        return self._clips[name]

    def model(self, clip: str | None = None, seconds: float = 0.0) -> Model:
        """Parts, one for each primitive of each node, and punctual lights.

        Instances of a mesh share their faces, texture coordinates and material. Without a clip every node stands as
        the file has it, and skins follow their joints there.
        """
        tables, keys = self.file.tables, self.clip(clip).at(seconds) if clip is not None else {}
        matrices = dict(_nodes(self.file, keys))
        reader = self._reader
        reader.begin(matrices, keys)
        for index in matrices:
            reader.node(index)
        scenes = len(tables.scenes)
        notes = [*left_out(tables), *([f"scenes but one of {scenes}"] if scenes > 1 else []), *reader.notes]
        if clip is not None:
            notes += self.clip(clip).left_out
        return Model(reader.parts, _exposed(reader.lights, reader.parts), list(dict.fromkeys(notes)))


def _nodes(file: GltfFile, keys: Mapping[tuple[int, str], Array]) -> Iterator[tuple[int, Array]]:
    """Every node of the scene with its matrix to the scene, parents first.

    A file without a scene shows every node that is no other's child.
    """
    tables = file.tables
    if tables.scenes:
        chosen = tables.scene or 0
        roots = file.at("scenes", chosen, "scene").nodes
        waiting = [(root, np.eye(4), f"scenes.{chosen}") for root in reversed(roots)]
    else:
        children = {child for node in tables.nodes for child in node.children}
        waiting = [(i, np.eye(4), "") for i in reversed(range(len(tables.nodes))) if i not in children]
    seen = set()
    while waiting:
        index, above, who = waiting.pop()
        node: Node = file.at("nodes", index, who)
        if index in seen:
            raise ValueError(f"{who}: nodes.{index} is named twice: each node has one parent")
        seen.add(index)
        matrix = above @ _matrix(_keyed(node, index, keys), f"nodes.{index}")
        yield index, matrix
        waiting += [(child, matrix, f"nodes.{index}") for child in reversed(node.children)]


def _keyed(node: Node, index: int, keys: Mapping[tuple[int, str], Array]) -> Node:
    """A node with its animated keys."""
    found = {path: keys[index, path] for path in ("translation", "rotation", "scale") if (index, path) in keys}
    return node.model_copy(update={path: tuple(value.tolist()) for path, value in found.items()}) if found else node


def _matrix(node: Node, where: str) -> Array:
    if node.matrix is not None:
        return np.array(node.matrix).reshape(4, 4).T
    x, y, z, w = node.rotation
    length = math.sqrt(x * x + y * y + z * z + w * w)
    if not length > 0:
        raise ValueError(f"{where}.rotation: a quaternion of length 0")
    x, y, z, w = x / length, y / length, z / length, w / length
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn * node.scale, node.translation
    return matrix


@dataclass(frozen=True, eq=False)
class _Shown:
    """A primitive in its node's frame, right-handed as it is stored, and how it is deformed.

    ``targets`` are displacements of positions and of normals, each (V, 3) or None; ``joints`` and ``weights`` are
    (V, n), or None for a primitive without a skin.
    """

    mesh: Mesh
    look: Look
    targets: list[tuple[Array | None, Array | None]] = field(default_factory=list)
    joints: NDArray[np.int64] | None = None
    weights: Array | None = None

    def morphed(self, weights: Array) -> Mesh:
        """The mesh with its targets added by their weights."""
        if not weights.any():
            return self.mesh
        place, normals = self.mesh.vertices.copy(), self.mesh.normals
        normals = None if normals is None else normals.copy()
        for weight, (by, tilt) in zip(weights, self.targets, strict=True):
            if by is not None:
                place += weight * by
            if normals is not None and tilt is not None:
                normals += weight * tilt
        return replace(self.mesh, vertices=place, normals=None if normals is None else unit_rows(normals))


class _Reader:
    """Gathers parts and lights; meshes are read once for all their instances and instants."""

    def __init__(self, file: GltfFile) -> None:
        self.file = file
        self.notes: list[str] = []
        self._looks = Looks(file, self.notes.append)
        self._meshes: dict[int, list[_Shown]] = {}
        self.begin({}, {})

    def begin(self, matrices: Mapping[int, Array], keys: Keys) -> None:
        """Start another instant: matrices of all nodes to the scene, and animated keys."""
        self.parts: list[Part] = []
        self.lights: list[tuple[PunctualLight, Array]] = []
        self._matrices, self._keys = matrices, keys
        self._faces_shown = 0

    def node(self, index: int) -> None:
        """Add what a node shows."""
        node: Node = self.file.tables.nodes[index]
        matrix = FLIP @ self._matrices[index]
        if node.mesh is not None:
            mesh: GltfMesh = self.file.at("meshes", node.mesh, f"nodes.{index}")
            if node.mesh not in self._meshes:
                self._meshes[node.mesh] = list(self._primitives(node.mesh, mesh))
            shown = self._meshes[node.mesh]
            self._faces_shown += sum(len(one.mesh.faces) for one in shown)
            if self._faces_shown > MOST_FACES:
                raise ValueError(f"nodes.{index}: more than {MOST_FACES} triangles, all instances counted")
            name = node.name or mesh.name or f"node {index}"
            for i, one in enumerate(shown):
                own = f"{name} {i}" if len(shown) > 1 else name
                moved = self._posed(one, index, node, mesh, matrix)
                self.parts.append(Part(own, moved, one.look.material))
        light = node.extensions.KHR_lights_punctual
        if light is not None:
            lights = self.file.tables.extensions.KHR_lights_punctual.lights
            if light.light >= len(lights):
                raise ValueError(f"nodes.{index}: light {light.light} is named, there are {len(lights)}")
            self.lights.append((lights[light.light], matrix))

    def _posed(self, one: _Shown, index: int, node: Node, mesh: GltfMesh, matrix: Array) -> Mesh:
        """A primitive in our frame: morphed, then moved by its node, or by its joints alone if it has a skin."""
        rest = np.array(node.weights or mesh.weights or [0.0] * len(one.targets))
        weights = self._keys.get((index, "weights"), rest)
        if len(weights) != len(one.targets):
            raise ValueError(f"nodes.{index}: {len(weights)} morph weights, {len(one.targets)} targets")
        shape = one.morphed(weights) if one.targets else one.mesh
        if node.skin is None:
            return _moved(shape, matrix)
        if one.joints is None or one.weights is None:
            self.notes.append("a skin over a mesh without joints")
            return _moved(shape, matrix)
        skin: Skin = self.file.at("skins", node.skin, f"nodes.{index}")
        bones = self._bones(skin, f"skins.{node.skin}")
        if one.joints.max() >= len(bones):
            raise ValueError(f"nodes.{index}: joint {one.joints.max()} is named, the skin has {len(bones)}")
        return _skinned(shape, bones, one.joints, one.weights)

    def _bones(self, skin: Skin, where: str) -> Array:
        """Matrices (n, 4, 4) from a mesh at rest to our frame, one a joint."""
        inverse = np.tile(np.eye(4), (len(skin.joints), 1, 1))
        if skin.inverseBindMatrices is not None:
            stored = self.file.array(skin.inverseBindMatrices, where)
            if stored.shape[1] != 16 or len(stored) < len(skin.joints):
                raise ValueError(f"{where}.inverseBindMatrices: {len(skin.joints)} matrices are needed")
            inverse = stored[: len(skin.joints)].astype(np.float64).reshape(-1, 4, 4).transpose(0, 2, 1)
        for joint in skin.joints:
            if joint not in self._matrices:
                raise ValueError(f"{where}: joint nodes.{joint} is not in the scene")
        return FLIP @ np.stack([self._matrices[joint] for joint in skin.joints]) @ inverse

    def _primitives(self, index: int, mesh: GltfMesh) -> Iterator[_Shown]:
        for i, primitive in enumerate(mesh.primitives):
            where = f"meshes.{index}.primitives.{i}"
            if primitive.mode < TRIANGLES:
                self.notes.append("points and lines")
                continue
            look = self._looks.look(primitive.material, "COLOR_0" in primitive.attributes, where)
            if look is not None:
                targets = [self._target(primitive, k, where) for k in range(len(primitive.targets))]
                yield _Shown(self._mesh(primitive, look, where), look, targets, *self._joints(primitive, where))

    def _target(self, primitive: Primitive, k: int, where: str) -> tuple[Array | None, Array | None]:
        """Displacements of positions and normals of a morph target."""
        where = f"{where}.targets.{k}"
        attributes = primitive.targets[k]
        self.notes += [f"morphed {name}" for name in attributes if name not in ("POSITION", "NORMAL", "TANGENT")]
        count = {name: primitive.attributes[name] for name in ("POSITION",) if name in primitive.attributes}
        rows = len(self.file.array(count["POSITION"], where)) if count else 0
        found: list[Array | None] = []
        for name in ("POSITION", "NORMAL"):
            values = self.file.array(attributes[name], f"{where}.{name}") if name in attributes else None
            if values is not None and values.shape != (rows, 3):
                raise ValueError(f"{where}.{name}: has {values.shape}: {(rows, 3)} are needed")
            found.append(None if values is None else values.astype(np.float64))
        return found[0], found[1]

    def _joints(self, primitive: Primitive, where: str) -> tuple[NDArray[np.int64] | None, Array | None]:
        """Joints and weights (V, 4n) of all sets; weights add up to 1."""
        joints, weights = [], []
        for i in range(len(primitive.attributes)):
            if f"JOINTS_{i}" not in primitive.attributes:
                break
            pair = [self._attribute(primitive, f"{name}_{i}", 4, where) for name in ("JOINTS", "WEIGHTS")]
            if pair[0] is None or pair[1] is None:
                raise ValueError(f"{where}: has JOINTS_{i} without WEIGHTS_{i}")
            joints.append(pair[0].astype(np.int64))
            weights.append(pair[1])
        if not joints:
            return None, None
        share = np.concatenate(weights, axis=1)
        total = share.sum(axis=1, keepdims=True)
        if not (total > 0).all() or share.min() < 0:
            raise ValueError(f"{where}: a vertex has no weight or a negative one: shares of joints are needed")
        return np.concatenate(joints, axis=1), share / total

    def _mesh(self, primitive: Primitive, look: Look, where: str) -> Mesh:
        """A primitive in its node's frame, right-handed as it is stored."""
        if "POSITION" not in primitive.attributes:
            raise ValueError(f"{where}: has no POSITION")
        place = self._attribute(primitive, "POSITION", 3, where)
        assert place is not None
        faces = self._faces(primitive, len(place), where)
        normals = self._attribute(primitive, "NORMAL", 3, where)
        colours = self._attribute(primitive, "COLOR_0", (3, 4), where)
        if colours is not None and colours.shape[1] == 4:
            if colours[:, 3].min() < 1:
                self.notes.append("alpha of vertex colours")
            colours = colours[:, :3]
        self.notes += [f"attribute {name}" for name in primitive.attributes if not _READ.match(name)]
        uv = self._attribute(primitive, f"TEXCOORD_{look.uv_set or 0}", 2, where)
        if uv is None and look.uv_set is not None:
            raise ValueError(f"{where}: materials.{primitive.material} needs TEXCOORD_{look.uv_set}, there is none")
        if uv is not None:
            move = look.uv if look.uv is not None else np.array([[1.0, 0, 0], [0, -1, 1]])
            uv = uv @ move[:, :2].T + move[:, 2]
        return Mesh(place, faces, normals, uv, colours)

    def _attribute(self, primitive: Primitive, name: str, width: int | tuple[int, int], where: str) -> Array | None:
        if name not in primitive.attributes:
            return None
        values = self.file.array(primitive.attributes[name], f"{where}.{name}")
        widths = (width,) if isinstance(width, int) else width
        if values.shape[1] not in widths:
            raise ValueError(f"{where}.{name}: has {values.shape[1]} components: {widths[0]} are needed")
        if name != "POSITION":
            count = len(self.file.array(primitive.attributes["POSITION"], where))
            if len(values) != count:
                raise ValueError(f"{where}.{name}: has {len(values)} rows, POSITION {count}")
        return values.astype(np.float64)

    def _faces(self, primitive: Primitive, count: int, where: str) -> NDArray[np.int64]:
        if primitive.indices is None:
            corners = np.arange(count)
        else:
            values = self.file.array(primitive.indices, f"{where}.indices")
            if values.dtype.kind != "u" or values.shape[1] != 1:
                raise ValueError(f"{where}.indices: unsigned whole numbers are needed")
            corners = values[:, 0].astype(np.int64)
            if corners.max() >= count:
                raise ValueError(f"{where}.indices: vertex {corners.max()} is named, there are {count}")
        if len(corners) < 3:
            raise ValueError(f"{where}: {len(corners)} corners make no triangle")
        if primitive.mode == STRIP:
            faces = np.column_stack([corners[:-2], corners[1:-1], corners[2:]])
            faces[1::2] = faces[1::2, [1, 0, 2]]
            return faces
        if primitive.mode == FAN:
            return np.column_stack([np.full(len(corners) - 2, corners[0]), corners[1:-1], corners[2:]])
        if len(corners) % 3:
            raise ValueError(f"{where}: {len(corners)} corners: a multiple of 3 is needed")
        return corners.reshape(-1, 3)


def _moved(mesh: Mesh, matrix: Array) -> Mesh:
    """A mesh taken to another frame; a mirroring one turns the faces round, so that they keep facing outwards."""
    turn = matrix[:3, :3]
    faces = mesh.faces if np.linalg.det(turn) > 0 else mesh.faces[:, ::-1]
    normals = None
    if mesh.normals is not None:  # by the cofactors, which a flattening matrix has too
        cofactors = np.array([np.cross(turn[(i + 1) % 3], turn[(i + 2) % 3]) for i in range(3)])
        normals = unit_rows(mesh.normals @ cofactors.T * (1.0 if np.linalg.det(turn) >= 0 else -1.0))
    return Mesh(mesh.vertices @ turn.T + matrix[:3, 3], faces, normals, mesh.uv, mesh.colours)


def _skinned(mesh: Mesh, bones: Array, joints: NDArray[np.int64], weights: Array) -> Mesh:
    """A mesh whose vertices each follow a weighted mean of their joints' matrices (linear blending)."""
    matrices = np.einsum("vn,vnij->vij", weights, bones[joints][:, :, :3])
    turn = matrices[:, :, :3]
    place = np.einsum("vij,vj->vi", turn, mesh.vertices) + matrices[:, :, 3]
    mirrored = float(np.median(np.linalg.det(turn))) < 0
    normals = None
    if mesh.normals is not None:
        rows = [np.cross(turn[:, (i + 1) % 3], turn[:, (i + 2) % 3]) for i in range(3)]
        normals = unit_rows(np.einsum("vij,vj->vi", np.stack(rows, axis=1), mesh.normals) * (-1 if mirrored else 1))
    return Mesh(place, mesh.faces[:, ::-1] if mirrored else mesh.faces, normals, mesh.uv, mesh.colours)


def _exposed(lights: list[tuple[PunctualLight, Array]], parts: list[Part]) -> list[Light]:
    """The lights, with strengths relative to one another as at the middle of the model, 1 in all.

    Ours do not fall off with distance, and have no unit of their own: candela and lux say how they compare.
    """
    if not lights or not parts:
        return []
    corners = np.array([[p.mesh.vertices.min(axis=0), p.mesh.vertices.max(axis=0)] for p in parts])
    low, high = corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)
    middle, reach = (low + high) / 2, float(np.linalg.norm(high - low))
    shares = []
    for light, matrix in lights:
        away = max(float(np.linalg.norm(matrix[:3, 3] - middle)), 1e-3 * reach, 1e-12)
        lux = light.intensity if light.type == "directional" else light.intensity / away**2
        shares.append(lux * max(light.color, default=0.0))
    total = sum(shares)
    return [
        _light(light, matrix, share / total)
        for (light, matrix), share in zip(lights, shares, strict=True)
        if share > 0
    ]


def _light(light: PunctualLight, matrix: Array, strength: float) -> Light:
    peak = max(light.color)
    r, g, b = (float(c) / peak * strength for c in light.color)
    ahead = -matrix[:3, 2]  # −z of the node's frame
    x, y, z = (float(v) for v in (ahead if light.type == "directional" else matrix[:3, 3]))
    more: dict[str, Any] = {}
    if light.type == "spot":
        outer = math.degrees(light.spot.outerConeAngle)
        inner = math.degrees(light.spot.innerConeAngle)
        more = {"direction": tuple(float(v) for v in ahead), "cone_deg": (min(inner, outer * 0.999), outer)}
    return Light(kind=light.type, vector=(x, y, z), colour=(r, g, b), **more)
