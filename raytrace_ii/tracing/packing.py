"""A scene as the kernels read it: flat arrays of faces, materials, textures and lights."""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ..scene.scene import Body, Light, Material, Scene, Vector, unit_rows
from ..scene.textures import Image
from .columns import NO_COLUMNS, columns_across, light_columns
from .intersect import Intersector
from .kernels import tables
from .kernels.arrays import Columns, Maps, Surfaces, Surroundings
from .kernels.lanes import aligned
from .kernels.tables import DIRECTIONAL, LEAST_WEIGHT, MATERIAL_COLUMNS, POINT, SPOT
from .texture_table import TextureTable

OF_ROD = 500  # vertices that tell the longest axis of a body
MOST_NESTED = 8  # bodies whose bounds meet in one place that a ray keeps count of
# Spawned rays start this share of the face's largest coordinate off the face: float32 places a hit to about
# 1e-7 of it, and from 1e-6 on no ray meets its own face again.
LIFT = 4e-6
# Embree tells the sides of a face by the product of its normal, as long as twice its area, and the way from the ray's
# start, in float32: a lift of fewer subnormal steps is rounded away. It is at most this share of the longest edge.
LIFT_STEPS, MOST_LIFT = 8 * float(np.finfo(np.float32).smallest_subnormal), 1e-3
SOME_FACES = 1 << 16  # of the table, at a time: in float64 all at once would take ten times its memory

_kept: WeakKeyDictionary[Scene, PackedScene] = WeakKeyDictionary()
_building = threading.Lock()  # Embree's tree is built once, however many threads come first


def packed(scene: Scene) -> PackedScene:
    """Return the arrays and trees of a scene: built on first use, kept as long as the scene, never sent elsewhere."""
    with _building:
        found = _kept.get(scene)
        if found is None:
            found = _kept[scene] = PackedScene(scene)
        return found


def share(scene: Scene, other: Scene) -> None:
    """Let another scene use the arrays and trees of this one: the same but for its recursion depth."""
    found = packed(scene)
    with _building:
        _kept[other] = found


class PackedScene:
    """Packed scene: the arrays that the kernels read.

    ``corners`` is (F, 3, 3) float32 positions, ``faces`` (F, 5) unit normals, lifts and pulls, ``coordinates`` like
    ``corners`` for textures, of no faces if there are none: a scene pays only for what it has. ``nested`` is how many
    transmissive bodies a ray may be in at once by their ``clear_bounds`` (B, 2, 3); they and bodies with cut-outs
    follow the ``opaque_faces``. ``least`` is the weight from which on a ray is worth shooting.
    """

    def __init__(self, scene: Scene) -> None:
        bodies = scene.bodies
        opaque = sum(not _lets_through(body) for body in bodies)
        first_clear = sum(not body.material.transmissive for body in bodies)
        self.object_of_face = np.repeat(
            np.arange(len(bodies), dtype=np.int32), [len(body.faces) for body in bodies]
        ).astype(np.int32)
        self._vertices = [np.asarray(body.vertices) for body in bodies]
        bounds = [np.stack([v.min(axis=0), v.max(axis=0)]) for v in self._vertices]
        self.clear_bounds = np.array(bounds[first_clear:], np.float64).reshape(-1, 2, 3)
        meeting = _meeting(self.clear_bounds)
        self.nested = min(int(meeting.sum(axis=1).max(initial=0)), MOST_NESTED)
        vertices = [b.vertices for b in bodies[:first_clear]] + _overlapping(bodies[first_clear:], meeting)
        self.corners = _per_corner(vertices, bodies)
        normals = _per_corner([None if b.normals is None else unit_rows(b.normals) for b in bodies], bodies)
        self.coordinates = _per_corner(
            [b.texture_coordinates if b.material.textures else None for b in bodies], bodies
        )
        sky = scene.background
        images = [image for b in bodies for image in b.material.textures]
        self.textures = TextureTable([*images, sky.image])
        # float32's values in float64's place: the kernels reckon in float64, and need not convert
        rows = np.array([_material_row(body.material, self.textures) for body in bodies], np.float32)
        self.materials = rows.astype(np.float64)
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
        self.least = LEAST_WEIGHT / _brightest(scene)
        self.opaque_faces = sum(len(body.faces) for body in bodies[:opaque])
        self.first_clear = first_clear
        looks = [body.material for body in bodies]
        self.mirrors = any(max(look.mirror) > 0 or look.metallic > 0 for look in looks)
        self.images = sky.image is not None or any(isinstance(t, Image) for look in looks for t in look.textures)
        self.glossy = any(look.roughness > 0 and look.reflects for look in looks)
        self.close_looks = any(_looks_closely(look) for look in looks)
        self.blends = any(look.alpha_blend > 0 for look in looks)
        self.transmits = first_clear < len(bodies)
        self.disperses = any(len(set(body.material.iors)) > 1 for body in bodies[first_clear:])
        self.lets_through = opaque < len(bodies)  # shadow rays do not end at every face
        self.passes = self.nested > 1 or any(body.material.alpha_cutoff > 0 for body in bodies)
        self.intersector = Intersector(self.corners, self.opaque_faces)
        self.corners = self.intersector.corners
        rows = _face_rows(self.corners, self.object_of_face, normals, self.coordinates)
        self.faces = rows[:, tables.FACE : tables.BODY]
        laned = aligned(len(bodies) * tables.LANED)
        laned[:] = self.materials[:, : tables.LANED].reshape(-1)
        self.surfaces = Surfaces(
            rows.reshape(-1), rows.shape[1], len(normals) > 0, self.corners, self.faces, self.coordinates,
            self.object_of_face, self.materials, laned, self._maps(bodies), self.textures.table,
            self.textures.levels, self.textures.texels, self.textures.alphas,
        )  # fmt: skip
        self.surroundings = Surroundings(self.lights, self.background, self.fog, self.ambient)
        self._columns: dict[int, Columns] = {}
        self._making = threading.Lock()

    def columns(self, rays: int) -> Columns:
        """Columns along the light of the lamps, made on first use, if they pay for so many camera rays."""
        size = columns_across(rays, len(self.corners), len(self.lights))
        with self._making:
            if size and size not in self._columns:
                self._columns[size] = light_columns(
                    self.corners, self.faces[: len(self.corners), :3], self.lights, size, not self.lets_through
                )
            return self._columns.get(size, NO_COLUMNS)

    @cached_property
    def plain(self) -> NDArray[np.bool_]:
        """Bodies (b + 1,) without textures, last the sky."""
        return np.append(self.materials[:, tables.EXTRAS] == 0, self.background[tables.SKY_IMAGE] < 0)

    @cached_property
    def rods(self) -> NDArray[np.float64]:
        """Rods (b, 7) around the bodies: the ends of the longest axis, and the greatest distance from it."""
        return np.array([_rod(np.asarray(vertices, np.float64)) for vertices in self._vertices]).reshape(-1, 7)

    def _maps(self, bodies: Sequence[Body]) -> Maps:
        looks = [body.material for body in bodies]
        return Maps(
            any=any(isinstance(t, Image) for look in looks for t in look.textures),
            normal=any(look.normal_map is not None for look in looks),
            emission=any(look.emission_map is not None for look in looks),
            gloss=any(look.metallic_roughness_map is not None for look in looks),
            blend=self.blends,
        )


def _rod(vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the ends of the longest axis of a body, and the greatest distance from it."""
    some = vertices[:: -(-len(vertices) // OF_ROD)]
    middle = some.mean(axis=0)
    axis = np.linalg.svd(some - middle, full_matrices=False)[2][0]
    for points in (some, vertices):  # most bodies are seen to be thick by some of their vertices
        along = (points - middle) @ axis
        radius = np.sqrt(np.square(points - middle - along[:, None] * axis).sum(axis=1).max())
        if radius > np.ptp(along) / 4:
            break
    return np.array([*(middle + along.min() * axis), *(middle + along.max() * axis), radius])


def _lets_through(body: Body) -> bool:
    return body.material.transmissive or body.material.has_holes


def _looks_closely(m: Material) -> bool:
    """Whether it has more than a pattern to look at."""
    images = any(isinstance(image, Image) for image in m.textures)
    return images or m.metallic > 0 or m.alpha_blend > 0 or m.transmissive


def _material_row(m: Material, textures: TextureTable) -> NDArray[np.float64]:
    row = np.zeros(MATERIAL_COLUMNS)
    for first, colour in (
        (tables.COLOUR, m.colour), (tables.MIRROR_SHARE, m.mirror), (tables.TRANSMISSION, m.transmission),
        (tables.ABSORPTION, m.absorption_per_mm), (tables.EMISSION, m.emission), (tables.IOR, m.iors),
    ):  # fmt: skip
        row[first : first + 3] = colour
    row[tables.SPECULAR], row[tables.SHININESS], row[tables.PRIORITY] = m.specular, m.shininess, m.priority
    row[tables.LOCAL] = max(0.0, 1 - max(m.mirror) - max(m.transmission))
    # below this cosine the highlight is too weak to see, and its power need not be taken
    row[tables.LEAST_HALF] = (LEAST_WEIGHT / max(m.specular, LEAST_WEIGHT)) ** (1 / m.shininess)
    row[tables.TEXTURE], row[tables.NORMAL_MAP] = textures.index(m.texture), textures.index(m.normal_map)
    row[tables.NORMAL_SCALE], row[tables.CUTOFF] = m.normal_scale, m.alpha_cutoff
    row[tables.ALPHA_BLEND] = m.alpha_blend
    row[tables.IMAGES] = any(isinstance(image, Image) for image in m.textures)
    row[tables.ROUGHNESS], row[tables.METALLIC] = m.roughness if m.reflects else 0.0, m.metallic
    row[tables.GLOSS_MAP] = textures.index(m.metallic_roughness_map)
    row[tables.EMISSION_MAP] = textures.index(m.emission_map)
    row[tables.EXTRAS] = bool(m.textures) or m.metallic > 0 or m.alpha_blend > 0 or m.transmissive
    return row


def _brightest(scene: Scene) -> float:
    """Return the largest radiance in the scene, at least 1; weights of rays are compared after scaling by it."""
    sky = scene.background
    image = sky.intensity * float(sky.image.pixels.max()) if sky.image is not None else 0.0
    colours = [sky.horizon, sky.zenith, sky.nadir, scene.ambient, *(light.colour for light in scene.lights)]
    return max(1.0, image, *(max(c) for c in colours), *map(_brightest_emission, scene.bodies))


def _brightest_emission(body: Body) -> float:
    image = body.material.emission_map
    return max(body.material.emission) * (1.0 if image is None else float(image.pixels.max()))


def _meeting(bounds: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(B, B): whether bounds touch or overlap, to float32's precision."""
    slack = 4 * LIFT * np.abs(bounds).max(axis=(1, 2))[:, None]
    low, high = bounds[:, 0] - slack, bounds[:, 1] + slack
    return ((low[:, None] <= high[None]) & (high[:, None] >= low[None])).all(axis=2)


def _overlapping(bodies: Sequence[Body], meeting: NDArray[np.bool_]) -> list[NDArray[Any]]:
    """The vertices of transmissive bodies, grown by a few lifts where they may touch one of higher priority.

    Of faces in one place a ray that starts behind the one misses the other. Grown, the lower body's face lies inside
    the higher body, where it is not there, and what is left is the higher one's, in its own place.
    """
    order = sorted(range(len(bodies)), key=lambda b: (-bodies[b].material.priority, b))
    grown = [body.vertices for body in bodies]
    for place, b in enumerate(order):
        above = sum(meeting[b, other] for other in order[:place])
        if above:
            vertices = np.asarray(bodies[b].vertices, np.float64)
            step = above * 4 * LIFT * np.abs(vertices).max()
            grown[b] = vertices + step * _corner_normals(vertices, np.asarray(bodies[b].faces))
    return grown


def _corner_normals(vertices: NDArray[np.float64], faces: NDArray[Any]) -> NDArray[np.float64]:
    """At each vertex a vector that leads one out of every face around it, as nearly as one can."""
    _, place = np.unique(vertices, axis=0, return_inverse=True)
    p = vertices[faces]
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    total = np.zeros((int(place.max()) + 1, 3))
    for corner in range(3):
        before, after = p[:, corner - 1] - p[:, corner], p[:, corner - 2] - p[:, corner]
        angle = np.arctan2(np.linalg.norm(np.cross(before, after), axis=1), np.einsum("ij,ij->i", before, after))
        np.add.at(total, place.reshape(-1)[faces[:, corner]], normal * angle[:, None])
    length = np.linalg.norm(total, axis=1, keepdims=True)
    unit = np.divide(total, length, out=np.zeros_like(total), where=length > 0)
    lean = np.full(len(unit), 1.0)  # the least cosine between a vertex's normal and those of its faces
    for corner in range(3):
        at = place.reshape(-1)[faces[:, corner]]
        np.minimum.at(lean, at, np.einsum("ij,ij->i", unit[at], normal))
    return (unit / np.clip(lean, 0.25, 1)[:, None])[place.reshape(-1)]


def _per_corner(values: Sequence[NDArray[Any] | None], bodies: Sequence[Body]) -> NDArray[np.float32]:
    """Vertex values gathered to (F, 3, 3) float32, zero where a body has none; of no faces if none has any."""
    if all(value is None for value in values):
        return np.empty((0, 3, 3), np.float32)
    out = np.zeros((sum(len(b.faces) for b in bodies) + 1, 3, 3), np.float32)[:-1]  # Embree reads a little farther
    first = 0
    for value, body in zip(values, bodies, strict=True):
        last = first + len(body.faces)
        if value is not None:
            np.take(np.asarray(value, np.float32), np.asarray(body.faces), axis=0, out=out[first:last], mode="clip")
        first = last
    return out


def _face_rows(
    corners: NDArray[np.float32], bodies: NDArray[np.int32], normals: NDArray[np.float32],
    coordinates: NDArray[np.float32],
) -> NDArray[np.float32]:  # fmt: skip
    """Return the table of faces, see `kernels.tables`: at least two rows, of one cache line or two."""
    wide = len(normals) > 0 or len(coordinates) > 0
    columns = tables.ALL_COLUMNS if wide else tables.FLAT_COLUMNS
    # one row is contiguous whatever is cut out of it: kernels would be compiled again for it
    padded = aligned(max(len(corners), 2) * columns).reshape(-1, columns)
    rows = padded[: len(corners)]
    rows[:, : tables.FACE] = corners.reshape(-1, 9)
    _fill_faces(corners, rows[:, tables.FACE : tables.BODY])
    rows[:, tables.BODY] = bodies
    if len(normals):
        rows[:, tables.NORMALS : tables.COORDINATES] = normals.reshape(-1, 9)
    if len(coordinates):
        rows[:, tables.COORDINATES : tables.COORDINATES + 6] = coordinates[:, :, :2].reshape(-1, 6)
        rows[:, tables.THIRD] = coordinates[:, :, 2]
    return padded


def _fill_faces(corners: NDArray[np.float32], out: NDArray[np.float32]) -> None:
    """Write unit normal (0 for a face without area) and lift in mm of every face as rows of ``out``."""
    for first in range(0, len(corners), SOME_FACES):
        some = slice(first, first + SOME_FACES)
        out[some] = _normals_and_lifts(corners[some].astype(np.float64))


def _normals_and_lifts(p: NDArray[np.float64]) -> NDArray[np.float64]:
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    unit = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    longest = np.linalg.norm(p - np.roll(p, 1, axis=1), axis=2).max(axis=1)
    least = np.divide(LIFT_STEPS, length[:, 0], out=np.zeros_like(longest), where=length[:, 0] > 0)
    lift = np.maximum(LIFT * np.abs(p).max(axis=(1, 2)), np.minimum(least, MOST_LIFT * longest))
    return np.column_stack([unit, lift])


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
