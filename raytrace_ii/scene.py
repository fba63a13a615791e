"""A scene as the tracer wants it: flat arrays of faces, materials, textures and lights, checked once."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .intersect import Intersector
from .kernels import LEAST_WEIGHT
from .texture import Texture, TextureTable

Vector = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Material:
    """How a surface answers light, in Whitted's terms. Colours are linear.

    Parameters
    ----------
    colour : (3,)
        Diffuse and ambient reflectance, multiplied by the texture.
    specular, shininess : float
        Strength and exponent of the Blinn–Phong highlight.
    mirror : (3,)
        Share of light reflected as by a mirror.
    transmission : (3,)
        Share of light that each face of the body hands on, split by Fresnel into reflected and refracted: a pane
        takes it twice.
    ior : float
        Index of refraction of the body.
    absorption_per_mm : (3,)
        Beer–Lambert coefficient inside the body.
    texture : Texture, optional

    The matt share is what ``mirror`` and ``transmission`` leave: energy stays in bounds.
    """

    colour: Vector = (0.8, 0.8, 0.8)
    specular: float = 0.0
    shininess: float = 50.0
    mirror: Vector = (0.0, 0.0, 0.0)
    transmission: Vector = (0.0, 0.0, 0.0)
    ior: float = 1.5
    absorption_per_mm: Vector = (0.0, 0.0, 0.0)
    texture: Texture | None = None

    def __post_init__(self) -> None:
        if max(self.mirror) + max(self.transmission) > 1 + 1e-9:
            raise ValueError(
                f"mirror {max(self.mirror):g} and transmission {max(self.transmission):g} "
                "are more than all the light: at most 1 together is needed"
            )

    @property
    def transmissive(self) -> bool:
        return max(self.transmission) > 0


@dataclass(frozen=True, kw_only=True)
class Light:
    """A point light at a position, or a directional light shining along a direction (mm, camera frame).

    Neither falls off with distance.
    """

    kind: str
    vector: Vector
    colour: Vector

    def __post_init__(self) -> None:
        if self.kind not in ("point", "directional"):
            raise ValueError(f"unknown light {self.kind!r}: known are point, directional")
        if not all(map(math.isfinite, (*self.vector, *self.colour))):
            raise ValueError(f"a {self.kind} light has {self.vector}, {self.colour}: finite numbers are needed")
        if self.kind == "directional" and not math.hypot(*self.vector) > 0:
            raise ValueError("a directional light has the direction zero: a direction is needed")


@dataclass(frozen=True, kw_only=True)
class Background:
    """Sky: horizon colour, running to zenith and nadir at ``spread_deg`` above and below it. Linear colours."""

    horizon: Vector = (0.0, 0.0, 0.0)
    zenith: Vector = (0.0, 0.0, 0.0)
    nadir: Vector = (0.0, 0.0, 0.0)
    spread_deg: float = 90.0


@dataclass(frozen=True, kw_only=True)
class Fog:
    """Air perspective: what lies at a distance t keeps the share exp(−density·t), ``colour`` (linear) comes in.

    It fills all space outside transmissive bodies, along reflected and refracted ways too; lights and the sky
    shine through it: the sky's colours are taken as they are seen. Give the fog the horizon's colour and far
    things fade into it.
    """

    colour: Vector
    density_per_mm: float

    def __post_init__(self) -> None:
        if not 0 < self.density_per_mm < math.inf:
            raise ValueError(f"fog has a density of {self.density_per_mm} per mm: more than 0 is needed")


@dataclass(frozen=True, kw_only=True, eq=False)
class Body:
    """One object: a triangle mesh in scene coordinates (mm) with its material.

    Parameters
    ----------
    vertices : ndarray, (V, 3)
    faces : ndarray of int, (F, 3)
        Counter-clockwise about the outward normal: (v1 − v0) × (v2 − v0) points out.
    normals : ndarray, (V, 3), optional
        Vertex normals for smooth shading; None shades flat.
    texture_coordinates : ndarray, (V, 3), optional
        (u, v, 0) for textures on the surface, positions in the body's own frame for solid ones, linear colours for
        those of the vertices.
    """

    name: str
    vertices: NDArray[Any]
    faces: NDArray[Any]
    material: Material
    normals: NDArray[Any] | None = None
    texture_coordinates: NDArray[Any] | None = None

    def __post_init__(self) -> None:
        vertices, faces = np.asarray(self.vertices), np.asarray(self.faces)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3 or not len(faces):
            raise ValueError(f"object {self.name!r} has no geometry: triangles are needed")
        bad = ~(np.abs(vertices) <= np.finfo(np.float32).max).all(axis=1)
        if bad.any():
            at = int(np.argmax(bad))
            raise ValueError(
                f"object {self.name!r}: vertex {at} is {vertices[at].tolist()}: finite float32 numbers are needed"
            )
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise ValueError(
                f"object {self.name!r}: a face names vertex {faces.max() if faces.min() >= 0 else faces.min()}, "
                f"there are {len(vertices)}"
            )
        for what in ("normals", "texture_coordinates"):
            value = getattr(self, what)
            if value is not None and np.shape(value) != vertices.shape:
                raise ValueError(f"object {self.name!r}: {what} are {np.shape(value)}, vertices {vertices.shape}")


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """Bodies, lights and surroundings, in millimetres in the camera's frame (x right, y up, z away).

    Raises
    ------
    ValueError
        If there is no body, or ``max_depth`` is negative.
    """

    bodies: Sequence[Body]
    lights: Sequence[Light] = ()
    background: Background = field(default_factory=Background)
    fog: Fog | None = None
    ambient: Vector = (0.0, 0.0, 0.0)
    max_depth: int = 6
    name: str = ""

    def __post_init__(self) -> None:
        if not self.bodies:
            raise ValueError(f"scene {self.name!r} has no geometry: at least one object is needed")
        if not self.max_depth >= 0:
            raise ValueError(f"max_depth is {self.max_depth}: at least 0 is needed")
        # Transmissive faces go last, so that opaque ones are a prefix that shadow rays may be tested against alone.
        ordered = sorted(self.bodies, key=lambda body: body.material.transmissive)
        object.__setattr__(self, "bodies", tuple(ordered))

    def with_depth(self, max_depth: int) -> Scene:
        """The same scene with another recursion depth."""
        return replace(self, max_depth=max_depth)

    @cached_property
    def packed(self) -> PackedScene:
        """The arrays that kernels read, and Embree's tree, built on first use."""
        return PackedScene(self)

    @property
    def bounds_mm(self) -> NDArray[np.float64]:
        """(2, 3): least and greatest corner."""
        every = np.concatenate([np.asarray(b.vertices, np.float64) for b in self.bodies])
        return np.stack([every.min(axis=0), every.max(axis=0)])


# Spawned rays start this share of the face's largest coordinate off the face: float32 places a hit to about
# 1e-7 of it, and from 1e-6 on no ray meets its own face again.
LIFT = 4e-6

# Columns of the material table.
COLOUR, MIRROR, TRANSMISSION, ABSORPTION = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12)
SPECULAR, SHININESS, IOR, LOCAL, TEXTURE, LEAST_HALF = 12, 13, 14, 15, 16, 17
MATERIAL_COLUMNS = 18


class PackedScene:
    """What the kernels read.

    ``corners`` is (F, 3, 3) float32 positions, ``faces`` (F, 5) unit normals, lifts and pulls. ``normals`` is like
    ``corners`` for shading, of no faces if every body is flat; ``coordinates`` for textures, of no faces if there
    are none: a scene pays only for what it has.
    """

    def __init__(self, scene: Scene) -> None:
        bodies = scene.bodies
        self.object_of_face = np.repeat(
            np.arange(len(bodies), dtype=np.int32), [len(body.faces) for body in bodies]
        ).astype(np.int32)
        self.corners = _per_corner([b.vertices for b in bodies], bodies)
        self.faces = _face_table(self.corners)
        smooth = any(b.normals is not None for b in bodies)
        textured = any(b.material.texture is not None for b in bodies)
        self.normals = _per_corner([b.normals for b in bodies], bodies) if smooth else np.empty((0, 3, 3), np.float32)
        self.coordinates = (
            _per_corner([b.texture_coordinates if b.material.texture else None for b in bodies], bodies)
            if textured
            else np.empty((0, 3, 3), np.float32)
        )
        self.textures = TextureTable([b.material.texture for b in bodies])
        self.materials = np.zeros((len(bodies), MATERIAL_COLUMNS), np.float32)
        for row, body in zip(self.materials, bodies, strict=True):
            m = body.material
            row[COLOUR], row[MIRROR], row[TRANSMISSION] = m.colour, m.mirror, m.transmission
            row[ABSORPTION] = m.absorption_per_mm
            row[SPECULAR], row[SHININESS], row[IOR] = m.specular, m.shininess, m.ior
            row[LOCAL] = max(0.0, 1 - max(m.mirror) - max(m.transmission))
            # below this cosine the highlight is too weak to see, and its power need not be taken
            row[LEAST_HALF] = (LEAST_WEIGHT / max(m.specular, LEAST_WEIGHT)) ** (1 / m.shininess)
            row[TEXTURE] = self.textures.index(m.texture)
        self.lights = np.array([_light_row(light) for light in scene.lights], np.float64).reshape(-1, 7)
        b = scene.background
        self.background = np.array(
            [*b.horizon, *b.zenith, *b.nadir, 1 / math.sin(math.radians(b.spread_deg))], np.float64
        )
        fog = scene.fog
        self.fog = np.array([*fog.colour, fog.density_per_mm] if fog else [], np.float64)
        self.ambient = np.array(scene.ambient, np.float64)
        opaque = int(np.searchsorted([body.material.transmissive for body in bodies], True))
        self.opaque_faces = sum(len(body.faces) for body in bodies[:opaque])
        self.mirrors = any(max(body.material.mirror) > 0 for body in bodies)
        self.transmits = opaque < len(bodies)
        self.intersector = Intersector(self.corners, self.opaque_faces)


def _per_corner(values: Sequence[NDArray[Any] | None], bodies: Sequence[Body]) -> NDArray[np.float32]:
    """Vertex values gathered to (F, 3, 3) float32, zero where a body has none."""
    parts = [
        np.zeros((len(b.faces), 3, 3), np.float32) if v is None else np.asarray(v, np.float32)[np.asarray(b.faces)]
        for v, b in zip(values, bodies, strict=True)
    ]
    return np.ascontiguousarray(np.concatenate(parts))


def _light_row(light: Light) -> list[float]:
    vector = np.asarray(light.vector, np.float64)
    if light.kind == "directional":
        return [1.0, *(vector / np.linalg.norm(vector)), *light.colour]
    return [0.0, *vector, *light.colour]


def _face_table(corners: NDArray[np.float32]) -> NDArray[np.float32]:
    """Unit normal (0 for a face without area), lift in mm and pull of every face.

    The pull takes a hit about as far towards the middle of its face as the lift takes it off the face, as a share
    of the way.
    """
    p = corners.astype(np.float64)
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    unit = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    lift = LIFT * np.abs(p).max(axis=(1, 2))
    longest = np.linalg.norm(p - np.roll(p, 1, axis=1), axis=2).max(axis=1)
    pull = np.minimum(np.divide(lift, longest, out=np.zeros_like(lift), where=longest > 0), 0.25)
    return np.column_stack([unit, lift, pull]).astype(np.float32)
