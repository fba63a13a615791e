"""glTF 2.0 scenes: nodes, meshes and lights, with the materials of materials.py."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scene.scene import Light, unit_rows
from ...shapes.primitives import Mesh
from ..mesh_model import Model, Part
from .container import GltfFile
from .materials import Look, Looks
from .tables import GltfMesh, Node, Primitive, PunctualLight, left_out

Array = NDArray[np.float64]
FLIP = np.diag([1.0, 1.0, -1.0, 1.0])  # right-handed with −z ahead to left-handed with z ahead
TRIANGLES, STRIP, FAN = 4, 5, 6
MOST_FACES = 50_000_000  # of all instances: about 10 GB when they are traced
# Attributes that are read or have no bearing here: tangents follow from the texture coordinates, of which no
# texture needs the other sets or is named itself, and those with an underscore are the application's own.
_READ = re.compile(r"(POSITION|NORMAL|TANGENT|COLOR_0|TEXCOORD_\d+|_.*)$")


def read_gltf(path: Path) -> Model:
    """Parts, one for each primitive of each node, and punctual lights of a .gltf or .glb file.

    Instances of a mesh share their faces, texture coordinates and material.

    Raises
    ------
    ValueError
        If the file is damaged or needs an extension that is not known.
    OSError
        If a file that it names is missing.
    """
    file = GltfFile(path)
    reader = _Reader(file)
    for index, matrix in _nodes(file):
        reader.node(index, FLIP @ matrix)
    scenes = len(file.tables.scenes)
    notes = [*left_out(file.tables), *([f"scenes but one of {scenes}"] if scenes > 1 else []), *reader.notes]
    return Model(reader.parts, _exposed(reader.lights, reader.parts), list(dict.fromkeys(notes)))


def _nodes(file: GltfFile) -> Iterator[tuple[int, Array]]:
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
        matrix = above @ _matrix(node, f"nodes.{index}")
        yield index, matrix
        waiting += [(child, matrix, f"nodes.{index}") for child in reversed(node.children)]


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


class _Reader:
    """Gathers parts and lights; meshes are read once for all their instances."""

    def __init__(self, file: GltfFile) -> None:
        self.file = file
        self.notes: list[str] = []
        self.parts: list[Part] = []
        self.lights: list[tuple[PunctualLight, Array]] = []
        self._looks = Looks(file, self.notes.append)
        self._meshes: dict[int, list[tuple[Mesh, Look]]] = {}
        self._faces_shown = 0

    def node(self, index: int, matrix: Array) -> None:
        """Add what a node shows, by its matrix to our frame."""
        node: Node = self.file.tables.nodes[index]
        if node.mesh is not None:
            mesh: GltfMesh = self.file.at("meshes", node.mesh, f"nodes.{index}")
            if node.mesh not in self._meshes:
                self._meshes[node.mesh] = list(self._primitives(node.mesh, mesh))
            shown = self._meshes[node.mesh]
            self._faces_shown += sum(len(primitive.faces) for primitive, _ in shown)
            if self._faces_shown > MOST_FACES:
                raise ValueError(f"nodes.{index}: more than {MOST_FACES} triangles, all instances counted")
            name = node.name or mesh.name or f"node {index}"
            for i, (primitive, look) in enumerate(shown):
                own = f"{name} {i}" if len(shown) > 1 else name
                self.parts.append(Part(own, _moved(primitive, matrix), look.material))
        light = node.extensions.KHR_lights_punctual
        if light is not None:
            lights = self.file.tables.extensions.KHR_lights_punctual.lights
            if light.light >= len(lights):
                raise ValueError(f"nodes.{index}: light {light.light} is named, there are {len(lights)}")
            self.lights.append((lights[light.light], matrix))

    def _primitives(self, index: int, mesh: GltfMesh) -> Iterator[tuple[Mesh, Look]]:
        for i, primitive in enumerate(mesh.primitives):
            where = f"meshes.{index}.primitives.{i}"
            if primitive.mode < TRIANGLES:
                self.notes.append("points and lines")
                continue
            look = self._looks.look(primitive.material, "COLOR_0" in primitive.attributes, where)
            if look is not None:
                yield self._mesh(primitive, look, where), look

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
