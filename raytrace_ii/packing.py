"""A scene as the kernels read it: flat arrays of faces, materials, textures and lights."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .intersect import Intersector
from .kernels import DIRECTIONAL, LEAST_WEIGHT, POINT, SPOT
from .scene import Body, Light, Scene, Vector
from .texture import TextureTable

# Spawned rays start this share of the face's largest coordinate off the face: float32 places a hit to about
# 1e-7 of it, and from 1e-6 on no ray meets its own face again.
LIFT = 4e-6

# Columns of the material table.
COLOUR, MIRROR, TRANSMISSION, ABSORPTION = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12)
SPECULAR, SHININESS, IOR, LOCAL, TEXTURE, LEAST_HALF, EMISSION = 12, 13, 14, 15, 16, 17, slice(18, 21)
MATERIAL_COLUMNS = 21


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
        sky = scene.background
        self.textures = TextureTable([*(b.material.texture for b in bodies), sky.image])
        self.materials = np.zeros((len(bodies), MATERIAL_COLUMNS), np.float32)
        for row, body in zip(self.materials, bodies, strict=True):
            m = body.material
            row[COLOUR], row[MIRROR], row[TRANSMISSION] = m.colour, m.mirror, m.transmission
            row[ABSORPTION] = m.absorption_per_mm
            row[SPECULAR], row[SHININESS], row[IOR] = m.specular, m.shininess, m.iors[1]
            row[EMISSION] = m.emission
            row[LOCAL] = max(0.0, 1 - max(m.mirror) - max(m.transmission))
            # below this cosine the highlight is too weak to see, and its power need not be taken
            row[LEAST_HALF] = (LEAST_WEIGHT / max(m.specular, LEAST_WEIGHT)) ** (1 / m.shininess)
            row[TEXTURE] = self.textures.index(m.texture)
        self.lights = np.array([_light_row(light) for light in scene.lights], np.float64).reshape(-1, 12)
        self.background = np.array(
            [
                *(*sky.horizon, *sky.zenith, *sky.nadir, 1 / math.sin(math.radians(sky.spread_deg))),
                *(self.textures.index(sky.image), sky.turn_deg / 360, sky.intensity),
            ],
            np.float64,
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
    """Kind, place or unit direction, colour; of a spot its unit direction, glTF's scale and offset of its cone."""
    if light.kind == "directional":
        return [DIRECTIONAL, *_unit(light.vector), *light.colour, 0, 0, 0, 0, 0]
    if light.kind == "point":
        return [POINT, *light.vector, *light.colour, 0, 0, 0, 0, 0]
    inner, outer = np.cos(np.radians(light.cone_deg))
    scale = 1 / (inner - outer)
    return [SPOT, *light.vector, *light.colour, *_unit(light.direction), scale, -outer * scale]


def _unit(vector: Vector) -> NDArray[np.float64]:
    return np.asarray(vector, np.float64) / np.linalg.norm(vector)


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
