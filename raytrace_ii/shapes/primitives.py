"""Primitive shapes: sphere, box, plane, cylinder, surface of revolution, grid of boxes.

Meshes are in a frame of their own: x right, y up, z away, millimetres. Faces are outward.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, PositiveInt, model_validator

Point2 = tuple[float, float]
Point3 = tuple[float, float, float]
Sizes = tuple[PositiveFloat, PositiveFloat, PositiveFloat]
NotNegative = Annotated[float, Field(ge=0)]


@dataclass(frozen=True, eq=False)
class Mesh:
    """Mesh: vertices (V, 3), faces (F, 3), normals (V, 3) or None for flat shading, uv (V, 2) or None.

    ``colours`` (V, 3) are linear vertex colours, or None.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    normals: NDArray[np.float64] | None = None
    uv: NDArray[np.float64] | None = None
    colours: NDArray[np.float64] | None = None


MOST_TRIANGLES = 8_000_000  # of all shapes of a scene; a surface of revolution of this size takes 8 s and 1.6 GB
MOST_SEGMENTS = 1 << 16  # around an axis: the polygon is within 1.2·10⁻⁹ radii of the circle, float32 within 6·10⁻⁸


class Shape(BaseModel):
    """Base of all shapes: known parameters only, finite numbers, a bounded number of triangles."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    def mesh(self) -> Mesh:
        raise NotImplementedError

    def triangles(self) -> int:
        """Return an estimate of the number of triangles, before the mesh is computed."""
        return 12

    @model_validator(mode="after")
    def _bounded(self) -> Self:
        if (count := self.triangles()) > MOST_TRIANGLES:
            raise ValueError(
                f"about {float(min(count, 10**300)):.2g} triangles: at most {MOST_TRIANGLES} are allowed"
            )
        if (segments := getattr(self, "segments", 0)) > MOST_SEGMENTS:
            raise ValueError(f"segments is {segments}: at most {MOST_SEGMENTS} are allowed")
        return self


class Sphere(Shape):
    """Sphere about the origin; ``segments`` around, half as many from pole to pole."""

    shape: Literal["sphere"]
    radius_mm: PositiveFloat
    segments: Annotated[int, Field(ge=3)] = 96

    def triangles(self) -> int:
        return self.segments**2

    def mesh(self) -> Mesh:
        angle = np.linspace(-np.pi / 2, np.pi / 2, max(self.segments // 2, 2) + 1)
        profile = self.radius_mm * np.column_stack([np.cos(angle), np.sin(angle)])
        profile[[0, -1], 0] = 0
        mesh = revolve(profile, self.segments)
        return Mesh(mesh.vertices, mesh.faces, mesh.vertices / self.radius_mm, mesh.uv)


class Box(Shape):
    """Box about the origin, flat-shaded; every side shows the whole texture."""

    shape: Literal["box"]
    size_mm: Sizes

    def mesh(self) -> Mesh:
        return boxes(np.zeros((1, 3)), np.array([self.size_mm]), np.eye(3)[None])


class Plane(Shape):
    """Upward rectangle in y = 0, ``size_mm`` along x and z."""

    shape: Literal["plane"]
    size_mm: tuple[PositiveFloat, PositiveFloat]

    def mesh(self) -> Mesh:
        x, z = self.size_mm[0] / 2, self.size_mm[1] / 2
        vertices = np.array([[-x, 0, -z], [-x, 0, z], [x, 0, z], [x, 0, -z]], float)
        uv = np.array([[0, 0], [0, 1], [1, 1], [1, 0]], float)
        return Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]]), None, uv)


class Cylinder(Shape):
    """Closed cylinder about y with its base at y = 0; a cone if ``top_mm`` differs from ``radius_mm``."""

    shape: Literal["cylinder"]
    radius_mm: PositiveFloat
    height_mm: PositiveFloat
    top_mm: Annotated[float, Field(ge=0)] | None = None
    segments: Annotated[int, Field(ge=3)] = 96

    def triangles(self) -> int:
        return 4 * self.segments

    def mesh(self) -> Mesh:
        top = self.radius_mm if self.top_mm is None else self.top_mm
        corners = [(0.0, 0.0), (self.radius_mm, 0.0), (top, self.height_mm), (0.0, self.height_mm)]
        corners = [c for i, c in enumerate(corners) if i == 0 or c != corners[i - 1]]
        parts = [revolve(np.array(side), self.segments) for side in pairwise(corners)]
        return _joined(parts)


class Revolve(Shape):
    """Surface of revolution: a smooth curve through points (radius, height), revolved about y.

    Parameters
    ----------
    profile_mm : list of (radius, height)
        From the bottom up along the outside; ends at radius 0 close the body.
    lobes, lobe_depth : int, float
        Number and relative height of bulges around, strongest at the bottom, as at the foot of an apple.
    sideways_mm : (x, z)
        Shift of the top; points shift with the square of their height.
    """

    shape: Literal["revolve"]
    profile_mm: Annotated[list[Point2], Field(min_length=2)]
    segments: Annotated[int, Field(ge=3)] = 96
    steps: PositiveInt = 64
    lobes: Annotated[int, Field(ge=0)] = 0
    lobe_depth: Annotated[float, Field(ge=0, lt=1)] = 0.0
    sideways_mm: Point2 = (0.0, 0.0)

    def triangles(self) -> int:
        return 2 * self.segments * self.steps

    def mesh(self) -> Mesh:
        profile = smooth_curve(np.array(self.profile_mm, float), self.steps)
        profile[:, 0] = np.maximum(profile[:, 0], 0)
        return revolve(profile, self.segments, self._bend(profile))

    def _bend(self, profile: NDArray[np.float64]) -> Any:
        low, high = profile[:, 1].min(), profile[:, 1].max()

        def bend(points: NDArray[np.float64], angle: NDArray[np.float64]) -> NDArray[np.float64]:
            rise = (points[..., 1] - low) / max(high - low, 1e-12)
            bulge = 1 + self.lobe_depth * (1 - rise) ** 2 * (np.cos(self.lobes * angle) - 1) / 2
            out = points * np.stack([bulge, np.ones_like(bulge), bulge], axis=-1)
            out[..., 0] += self.sideways_mm[0] * rise**2
            out[..., 2] += self.sideways_mm[1] * rise**2
            return out

        return bend


class BoxGrid(Shape):
    """Grid of boxes: ``count`` along x, y and z, centres ``spacing_mm`` apart, about the origin.

    Parameters
    ----------
    box_mm : float
        Side of a box.
    jitter : float
        Strength of random rotations and shifts, 0 to 1.
    grow : float
        Growth of the distance between rows, per row towards the back; 0 is a regular grid.
    tiles : int
        Side of the grid of pictures in the texture image; each side of a box shows one picture.
    """

    shape: Literal["box_grid"]
    count: tuple[PositiveInt, PositiveInt, PositiveInt]
    spacing_mm: Sizes
    box_mm: PositiveFloat
    jitter: Annotated[float, Field(ge=0, le=1)] = 0.0
    grow: Annotated[float, Field(ge=0)] = 0.0
    tiles: Annotated[int, Field(ge=1, le=4096)] = 1
    seed: Annotated[int, Field(ge=0)] = 0

    def triangles(self) -> int:
        return 12 * math.prod(self.count)

    def mesh(self) -> Mesh:
        generator = np.random.default_rng(self.seed)
        i, j, k = np.meshgrid(*(np.arange(n) for n in self.count), indexing="ij")
        middle = np.array([(n - 1) / 2 for n in self.count])
        cells = np.stack([i, j, k], axis=-1).reshape(-1, 3) - middle
        wider = 1 + self.grow * (cells[:, 2:] + middle[2])
        centres = cells * self.spacing_mm * np.concatenate([wider, wider, np.ones_like(wider)], axis=1)
        centres += self.jitter * self.box_mm * generator.uniform(-0.3, 0.3, centres.shape)
        turns = _rotations(self.jitter * generator.uniform(-0.6, 0.6, centres.shape))
        tile = generator.integers(0, self.tiles**2, (len(centres), 6))
        return boxes(centres, np.full((len(centres), 3), self.box_mm), turns, tile, self.tiles)


def revolve(profile: NDArray[np.float64], segments: int, bend: Any = None) -> Mesh:
    """Return the smooth mesh of a polyline (n, 2) of (radius, height), revolved about y; ``bend`` moves its points.

    Vertices of the seam are doubled, so that u runs from 0 to 1; v runs along the profile.
    """
    rows = len(profile)
    angle = np.linspace(0, 2 * np.pi, segments + 1)
    radius, height = profile[:, 0, None], profile[:, 1, None]
    points = np.stack(
        [radius * np.cos(angle), np.broadcast_to(height, (rows, segments + 1)), radius * np.sin(angle)], axis=-1
    )
    if bend is not None:
        points = bend(points, np.broadcast_to(angle, points.shape[:2]))
    points[:, -1] = points[:, 0]
    along = np.gradient(points, axis=0)
    ring = points[:, :-1]
    around = (np.roll(ring, -1, axis=1) - np.roll(ring, 1, axis=1))[:, [*range(segments), 0]]
    for end, inner in ((0, 1), (-1, -2)):  # a pole has no tangent around the axis: use that of its neighbours
        if np.ptp(profile[end, 0]) == 0 and profile[end, 0] == 0:
            around[end] = around[inner]
    normals = np.cross(along, around)
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    a = (np.arange(rows - 1)[:, None] * (segments + 1) + np.arange(segments)).reshape(-1)
    b = a + segments + 1
    faces = np.concatenate([np.column_stack([a, b, b + 1]), np.column_stack([a, b + 1, a + 1])])
    steps = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(profile, axis=0), axis=1))])
    u, v = np.meshgrid(angle / (2 * np.pi), steps / max(steps[-1], 1e-12))
    mesh = Mesh(points.reshape(-1, 3), faces, normals.reshape(-1, 3), np.column_stack([u.ravel(), v.ravel()]))
    return _without_slivers(mesh)


def boxes(
    centres: NDArray[np.float64],
    sizes: NDArray[np.float64],
    turns: NDArray[np.float64],
    tile: NDArray[np.int64] | None = None,
    tiles: int = 1,
) -> Mesh:
    """Return boxes at (n, 3), of sizes (n, 3), rotated by (n, 3, 3), with one of tiles² texture tiles per side."""
    n = len(centres)
    corners, uv = [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            # Two edges whose cross product is the outward normal.
            first, second = ((axis + 1) % 3, (axis + 2) % 3) if sign > 0 else ((axis + 2) % 3, (axis + 1) % 3)
            side = np.zeros((4, 3))
            side[:, axis] = sign
            side[:, first], side[:, second] = (-1, 1, 1, -1), (-1, -1, 1, 1)
            corners.append(side / 2)
            # From outside, u runs to the right, and v runs up on vertical sides.
            along_second = [[0, 0], [0, 1], [1, 1], [1, 0]]
            against_first = [[1, 0], [0, 0], [0, 1], [1, 1]]
            uv.append(np.array(against_first if second == 1 else along_second, float))
    local = np.concatenate(corners) * sizes[:, None, :]
    vertices = np.einsum("nij,nvj->nvi", turns, local) + centres[:, None, :]
    quads = np.arange(n * 6)[:, None] * 4
    faces = np.concatenate([quads + np.array(half) for half in ((0, 1, 2), (0, 2, 3))])
    square = np.broadcast_to(np.stack(uv), (n, 6, 4, 2))
    if tile is None:
        tile = np.zeros((n, 6), np.int64)
    place = np.stack([tile % tiles, tile // tiles], axis=-1)[:, :, None, :]
    return Mesh(vertices.reshape(-1, 3), faces, None, ((square + place) / tiles).reshape(-1, 2))


def smooth_curve(points: NDArray[np.float64], steps: int) -> NDArray[np.float64]:
    """Return a Catmull–Rom curve through points (n, any) in ``steps`` pieces, even in parameter."""
    padded = np.concatenate([[2 * points[0] - points[1]], points, [2 * points[-1] - points[-2]]])
    t = np.linspace(0, len(points) - 1, steps + 1)
    i = np.minimum(t.astype(int), len(points) - 2)
    f = (t - i)[:, None]
    p0, p1, p2, p3 = (padded[i + d] for d in range(4))
    curve = p1 + 0.5 * f * (p2 - p0 + f * (2 * p0 - 5 * p1 + 4 * p2 - p3 + f * (3 * (p1 - p2) + p3 - p0)))
    curve[0], curve[-1] = points[0], points[-1]
    return curve


def rotation(degrees: Point3) -> NDArray[np.float64]:
    """Return the rotation about x (y towards z), then y (z towards x), then z (x towards y)."""
    return _rotations(np.radians([degrees]))[0]


def _rotations(radians: NDArray[np.float64]) -> NDArray[np.float64]:
    (cx, cy, cz), (sx, sy, sz) = np.cos(radians).T, np.sin(radians).T
    zero, one = np.zeros(len(radians)), np.ones(len(radians))

    def matrix(*rows: Any) -> NDArray[np.float64]:
        return np.stack(rows, axis=-1).reshape(-1, 3, 3)

    about_x = matrix(one, zero, zero, zero, cx, -sx, zero, sx, cx)
    about_y = matrix(cy, zero, sy, zero, one, zero, -sy, zero, cy)
    about_z = matrix(cz, -sz, zero, sz, cz, zero, zero, zero, one)
    return about_z @ about_y @ about_x


def _without_slivers(mesh: Mesh) -> Mesh:
    """Return the mesh without faces with two equal corners, as at the poles of a surface of revolution."""
    p = mesh.vertices[mesh.faces]
    good = ~((p[:, 0] == p[:, 1]).all(1) | (p[:, 1] == p[:, 2]).all(1) | (p[:, 2] == p[:, 0]).all(1))
    return Mesh(mesh.vertices, mesh.faces[good], mesh.normals, mesh.uv)


def _joined(parts: list[Mesh]) -> Mesh:
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    return Mesh(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.faces + offset for part, offset in zip(parts, offsets, strict=True)]),
        np.concatenate([part.normals for part in parts if part.normals is not None]),
        np.concatenate([part.uv for part in parts if part.uv is not None]),
    )
