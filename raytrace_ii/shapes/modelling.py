"""Shapes that take more than a formula: implicit bodies, terrain and water, hair."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, PositiveInt, model_validator

from ..scene.scene import unit_rows
from ..scene.textures import Colour
from ..tracing.kernels.shade import terrain
from .primitives import (
    Box,
    BoxGrid,
    Cylinder,
    Mesh,
    Plane,
    Point3,
    Revolve,
    Shape,
    Sizes,
    Sphere,
    rotation,
    smooth_curve,
)

Array = NDArray[Any]
NotNegative = Annotated[float, Field(ge=0)]
MOST_CELLS = 40_000_000  # of an implicit body's grid: 160 MB


class _Part(BaseModel):
    """What all parts of an implicit body share.

    Parameters
    ----------
    op : {"add", "cut", "keep", "paint"}
        Join it to the parts before, take it away from them, leave only what lies in it, or only colour what does.
    blend_mm : float
        Over what distance the joint is rounded; of a painted part, how soft its border is.
    mirrored : bool
        The same part once more, at −x.
    colour : sRGB, optional
        Colour of the vertices that this part brings about; a part without one leaves them white.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
    op: Literal["add", "cut", "keep", "paint"] = "add"
    at_mm: Point3 = (0.0, 0.0, 0.0)
    blend_mm: NotNegative = 0.0
    mirrored: bool = False
    colour: Colour = (1.0, 1.0, 1.0)

    def distance(self, x: Array, y: Array, z: Array) -> Array:
        """About the distance from the surface, negative inside, exact on it."""
        raise NotImplementedError

    def bounds(self) -> tuple[Array, Array]:
        """Least and greatest corner of a box around it."""
        raise NotImplementedError


class _Turned(_Part):
    rotate_deg: Point3 = (0.0, 0.0, 0.0)

    def own(self, x: Array, y: Array, z: Array) -> list[Array]:
        """Points in the part's own frame."""
        turn = rotation(self.rotate_deg)
        dx, dy, dz = x - self.at_mm[0], y - self.at_mm[1], z - self.at_mm[2]
        if not any(self.rotate_deg):
            return [dx, dy, dz]
        return [np.asarray(turn[0, i] * dx + turn[1, i] * dy + turn[2, i] * dz) for i in range(3)]

    def _around(self, half: Sizes) -> tuple[Array, Array]:
        reach = np.abs(rotation(self.rotate_deg)) @ np.array(half)
        return np.array(self.at_mm) - reach, np.array(self.at_mm) + reach


class Ball(_Turned):
    """An ellipsoid of three half axes."""

    part: Literal["ball"]
    radii_mm: Sizes

    def distance(self, x: Array, y: Array, z: Array) -> Array:
        own, r = self.own(x, y, z), self.radii_mm
        once = np.sqrt(sum((p / a) ** 2 for p, a in zip(own, r, strict=True)))
        twice = np.sqrt(sum((p / a**2) ** 2 for p, a in zip(own, r, strict=True)))
        # first order: exact on the surface, and of slope 1 there
        return np.where(twice > 0, once * (once - 1) / np.maximum(twice, 1e-12), -min(r))

    def bounds(self) -> tuple[Array, Array]:
        return self._around(self.radii_mm)


class Block(_Turned):
    """A box with edges rounded by ``round_mm``."""

    part: Literal["block"]
    size_mm: Sizes
    round_mm: NotNegative = 0.0

    def distance(self, x: Array, y: Array, z: Array) -> Array:
        out = [
            np.abs(p) - s / 2 + min(self.round_mm, s / 2)
            for p, s in zip(self.own(x, y, z), self.size_mm, strict=True)
        ]
        outside = np.sqrt(sum(np.maximum(q, 0) ** 2 for q in out))
        inside = np.minimum(np.maximum(np.maximum(out[0], out[1]), out[2]), 0)
        return outside + inside - min(self.round_mm, *(s / 2 for s in self.size_mm))

    def bounds(self) -> tuple[Array, Array]:
        a, b, c = (s / 2 for s in self.size_mm)
        return self._around((a, b, c))


class Capsule(_Part):
    """A rounded rod from ``at_mm`` to ``to_mm``, of ``radius_mm`` running to ``end_radius_mm``."""

    part: Literal["capsule"]
    to_mm: Point3
    radius_mm: PositiveFloat
    end_radius_mm: PositiveFloat | None = None

    def distance(self, x: Array, y: Array, z: Array) -> Array:
        along = np.subtract(self.to_mm, self.at_mm)
        dx, dy, dz = x - self.at_mm[0], y - self.at_mm[1], z - self.at_mm[2]
        t = (dx * along[0] + dy * along[1] + dz * along[2]) / max(float(along @ along), 1e-12)
        t = np.clip(t, 0, 1)
        off = (dx - t * along[0]) ** 2 + (dy - t * along[1]) ** 2 + (dz - t * along[2]) ** 2
        return np.sqrt(off) - self.radius_mm - t * (self._end - self.radius_mm)

    def bounds(self) -> tuple[Array, Array]:
        ends = np.array([self.at_mm, self.to_mm])
        reach = np.array([[self.radius_mm], [self._end]])
        return (ends - reach).min(axis=0), (ends + reach).max(axis=0)

    @property
    def _end(self) -> float:
        return self.radius_mm if self.end_radius_mm is None else self.end_radius_mm


class Tube(_Part):
    """A smooth curve through points (x, y, z, radius), thickened by the radius.

    The nearest point is looked for on ``steps`` straight pieces; the curve itself is smooth.
    """

    part: Literal["tube"]
    points_mm: Annotated[list[tuple[float, float, float, PositiveFloat]], Field(min_length=2)]
    steps: Annotated[int, Field(ge=1, le=1000)] = 12

    def distance(self, x: Array, y: Array, z: Array) -> Array:
        shape = np.broadcast_shapes(x.shape, y.shape, z.shape)
        nearest, place = np.full(shape, np.inf), np.zeros(shape)
        for i, (a, b) in enumerate(pairwise(self._curve(self.steps))):
            dx, dy, dz = x - a[0], y - a[1], z - a[2]
            along = b - a
            t = dx * along[0] + dy * along[1] + dz * along[2]
            t = np.clip(t / max(float(along[:3] @ along[:3]), 1e-12), 0, 1)
            off = (dx - t * along[0]) ** 2 + (dy - t * along[1]) ** 2 + (dz - t * along[2]) ** 2
            off = np.sqrt(off) - a[3] - t * along[3]
            closer = off < nearest
            np.copyto(nearest, off, where=closer)
            np.copyto(place, t + i, where=closer)
        # From there to the curve itself, by two steps of Gauss and Newton: pieces would show as rings.
        fine = self._curve(32 * self.steps)
        parameter = np.linspace(0, self.steps, len(fine))
        speed = np.gradient(fine[:, :3], parameter, axis=0)
        for _ in range(2):
            away = [p - np.interp(place, parameter, c) for p, c in zip((x, y, z), fine.T[:3], strict=True)]
            slope = [np.interp(place, parameter, c) for c in speed.T]
            step = sum(p * c for p, c in zip(away, slope, strict=True)) / sum(c * c for c in slope)
            place = np.clip(place + np.clip(step, -1, 1), 0, self.steps)
        away = [p - np.interp(place, parameter, c) for p, c in zip((x, y, z), fine.T[:3], strict=True)]
        return np.asarray(np.sqrt(sum(p * p for p in away)) - np.interp(place, parameter, fine[:, 3]))

    def bounds(self) -> tuple[Array, Array]:
        curve = self._curve(32 * self.steps)
        return (curve[:, :3] - curve[:, 3:]).min(axis=0), (curve[:, :3] + curve[:, 3:]).max(axis=0)

    def _curve(self, steps: int) -> Array:
        curve = smooth_curve(np.array(self.points_mm, float), steps) + np.array([*self.at_mm, 0.0])
        # between a thick and a thin point the curve may dip below the thin one
        curve[:, 3] = np.maximum(curve[:, 3], min(point[3] for point in self.points_mm))
        return np.asarray(curve)


PARTS = (Ball, Block, Capsule, Tube)


class Implicit(Shape):
    """A closed smooth body put together from parts that flow into one another, in the parts' order.

    Parameters
    ----------
    parts : list
        Balls, blocks, capsules and tubes; see `Ball`, `Block`, `Capsule`, `Tube`.
    cell_mm : float
        Side of a cell of the grid that the surface is found on (marching cubes).
    grow_mm : float
        Push the surface outwards (before any part that keeps or cuts).
    front_mm : (x, y, x, y), optional
        The rectangle that a texture fills, thrown onto the body along z.
    """

    shape: Literal["implicit"]
    parts: Annotated[list[Annotated[Ball | Block | Capsule | Tube, Field(discriminator="part")]], Field(min_length=1)]
    cell_mm: PositiveFloat
    grow_mm: float = 0.0
    front_mm: tuple[float, float, float, float] | None = None

    @model_validator(mode="after")
    def _check(self) -> Implicit:
        if self.parts[0].op != "add":
            raise ValueError(f"the first part is to {self.parts[0].op}: one to add is needed")
        f = self.front_mm
        if f is not None and not (f[0] < f[2] and f[1] < f[3]):
            raise ValueError(f"front_mm {f}: x, y and greater x, y are needed")
        cells = np.prod(self._grid()[1].astype(float))
        if cells > MOST_CELLS:
            raise ValueError(f"cell_mm {self.cell_mm:g} makes {cells:.0f} cells: at most {MOST_CELLS} are possible")
        return self

    def mesh(self) -> Mesh:
        from skimage.measure import marching_cubes  # slow to import

        low, count = self._grid()
        x, y, z = (low[i] + self.cell_mm * np.arange(count[i]) for i in range(3))
        field = self._field(x, y, z)
        if not field.min() < 0:
            raise ValueError("the parts leave nothing, or nothing as large as a cell")
        points, faces, normals, _ = marching_cubes(field, 0.0, gradient_direction="ascent", allow_degenerate=False)
        # gradients of the field itself: marching cubes' own are those of whole cells
        slopes = np.stack([_sample(np.gradient(field, axis=axis), points) for axis in range(3)], axis=1)
        length = np.linalg.norm(slopes, axis=1, keepdims=True)
        normals = np.where(length > 1e-6, slopes / np.maximum(length, 1e-6), normals)
        vertices = low + points.astype(np.float64) * self.cell_mm
        faces = faces.astype(np.int64)
        p = vertices[faces]
        if np.einsum("ij,ij->", p[:, 0], np.cross(p[:, 1], p[:, 2])) < 0:
            faces = faces[:, ::-1]
        uv = None
        if self.front_mm is not None:
            x0, y0, x1, y1 = self.front_mm
            uv = (vertices[:, :2] - [x0, y0]) / [x1 - x0, y1 - y0]
        return Mesh(vertices, faces, unit_rows(normals.astype(np.float64)), uv, self._colours(vertices))

    def _placed(self) -> list[tuple[Any, float]]:
        """Every part with the sign of its x; a mirrored one twice."""
        return [(part, sign) for part in self.parts for sign in ((1.0, -1.0) if part.mirrored else (1.0,))]

    def _box(self, part: _Part, sign: float) -> tuple[Array, Array]:
        low, high = part.bounds()
        if sign < 0:
            low, high = low * [-1, 1, 1], high * [-1, 1, 1]
            low, high = np.minimum(low, high), np.maximum(low, high)
        reach = part.blend_mm + 3 * self.cell_mm + max(self.grow_mm, 0.0)
        return low - reach, high + reach

    def _grid(self) -> tuple[Array, Array]:
        """Least corner, and number of points along each axis."""
        every = [self._box(part, sign) for part, sign in self._placed() if part.op == "add"]
        low = np.min([box[0] for box in every], axis=0)
        high = np.max([box[1] for box in every], axis=0)
        return low, np.ceil((high - low) / self.cell_mm).astype(int) + 1

    def _field(self, x: Array, y: Array, z: Array) -> NDArray[np.float32]:
        """The parts' joint distance on a grid; each is worked out only where it can matter."""
        far = np.float32(1e3 * self.cell_mm)
        field = np.full((len(x), len(y), len(z)), far, np.float32)
        for part, sign in self._placed():
            if part.op == "paint":
                continue
            low, high = self._box(part, sign)
            here = tuple(
                slice(int(np.searchsorted(axis, a)), int(np.searchsorted(axis, b, side="right")))
                for axis, a, b in zip((x, y, z), low, high, strict=True)
            )
            near = part.distance(sign * x[here[0], None, None], y[None, here[1], None], z[None, None, here[2]])
            joined = self._join(field[here], near, part)
            if part.op == "keep":
                field[...] = far
            field[here] = np.minimum(joined, far)
        return field

    def _join(self, so_far: Array, near: Array, part: _Part) -> Array:
        if part.op == "add":
            return _smooth_least(so_far, near - self.grow_mm, part.blend_mm)
        if part.op == "cut":
            return -_smooth_least(-so_far, near, part.blend_mm)
        return -_smooth_least(-so_far, -near, part.blend_mm)

    def _colours(self, vertices: Array) -> Array | None:
        """Each vertex has the colour of the part it lies on, running over where two blend."""
        if all(part.colour == (1.0, 1.0, 1.0) for part in self.parts):
            return None
        x, y, z = vertices.T
        colours = np.ones_like(vertices)
        nearest = np.full(len(vertices), np.inf)
        for part, sign in self._placed():
            if part.op in ("cut", "keep"):
                continue
            near = part.distance(sign * x, y, z)
            soft = max(part.blend_mm, self.cell_mm / 2)
            if part.op == "paint":
                share = np.clip(0.5 - near / soft, 0, 1)
            else:
                share = np.clip(0.5 + (nearest - near) / soft, 0, 1)
                nearest = np.minimum(nearest, near)
            colours += share[:, None] * (np.array(part.colour) - colours)
        return colours


def _smooth_least(a: Array, b: Array, blend: float) -> Array:
    """The lesser, lowered where the two are less than ``blend`` apart so that it has no kink."""
    least = np.minimum(a, b)
    if blend == 0:
        return least
    near = np.maximum(blend - np.abs(a - b), 0) / blend
    return least - near**2 * (blend / 4)


def _sample(values: Array, points: Array) -> Array:
    """Values of a grid at points on its edges, in cells."""
    first = np.minimum(np.floor(points).astype(int), np.array(values.shape) - 2)
    part = points - first
    i, j, k = first.T
    here = values[i, j, k]
    x, y, z = values[i + 1, j, k], values[i, j + 1, k], values[i, j, k + 1]
    return np.asarray(here + part[:, 0] * (x - here) + part[:, 1] * (y - here) + part[:, 2] * (z - here))


class Heightfield(Shape):
    """Terrain or water: a fractal surface over x and z that faces up, nearest row at z = 0, x about 0.

    Parameters
    ----------
    size_mm : (x, z)
        Width at the near edge and depth.
    widen : float
        How many times wider the far edge is; rows stand apart in the same proportion.
    cells : (x, z)
    height_mm, feature_mm : float
        Height and wavelength of the coarsest octave.
    swell : bool
        Let heights grow with the rows' width, up to ``height_mm`` at the far edge.
    octaves, ridged : int, bool
        Octaves of noise, each of half the wavelength and ``rough`` times the height; folded into ridges or not.
    rise_mm : float
        How much the ground rises from near to far.
    valley_mm : float
        Half width of a valley along x = 0 at the near edge, wider as the rows are; its floor keeps a quarter of the
        height. 0 for none.
    colours : list of (height_mm, colour)
        Colours from the bottom up, mixed in between.
    steep : colour, optional
        Colour where the slope is too steep for the others.
    """

    shape: Literal["heightfield"]
    size_mm: tuple[PositiveFloat, PositiveFloat]
    widen: Annotated[float, Field(ge=1)] = 1.0
    cells: tuple[PositiveInt, PositiveInt] = (200, 200)
    height_mm: NotNegative
    swell: bool = False
    feature_mm: PositiveFloat
    octaves: Annotated[int, Field(ge=1, le=12)] = 6
    rough: Annotated[float, Field(gt=0, lt=1)] = 0.5
    ridged: bool = False
    rise_mm: float = 0.0
    valley_mm: NotNegative = 0.0
    colours: tuple[tuple[float, Colour], ...] = ()
    steep: Colour | None = None
    seed: Annotated[int, Field(ge=0, lt=1024)] = 0

    def triangles(self) -> int:
        return 2 * self.cells[0] * self.cells[1]

    def mesh(self) -> Mesh:
        nx, nz = self.cells
        across, away = np.linspace(-0.5, 0.5, nx + 1), np.linspace(0, 1, nz + 1)
        if self.widen > 1:  # each row as much wider and further from the next as it is further away
            away = (self.widen**away - 1) / (self.widen - 1)
        wide = 1 + (self.widen - 1) * away
        x = self.size_mm[0] * across * wide[:, None]
        z = np.broadcast_to(self.size_mm[1] * away[:, None], x.shape)
        y = np.empty(x.shape)
        scale = 1 / self.feature_mm
        terrain(x * scale, z * scale, self.seed, self.octaves, self.rough, self.ridged, y)
        y *= self.height_mm * (wide / self.widen if self.swell else np.ones_like(wide))[:, None]
        if self.valley_mm > 0:
            t = np.clip(np.abs(x) / (self.valley_mm * wide[:, None]), 0, 1)
            y *= 0.25 + 0.75 * t * t * (3 - 2 * t)
        y += self.rise_mm * away[:, None]
        points = np.stack([x, y, z], axis=-1)
        normals = unit_rows(np.cross(np.gradient(points, axis=0), np.gradient(points, axis=1)))
        a = (np.arange(nz)[:, None] * (nx + 1) + np.arange(nx)).reshape(-1)
        b = a + nx + 1
        faces = np.concatenate([np.column_stack([a, b, b + 1]), np.column_stack([a, b + 1, a + 1])])
        u, v = np.meshgrid(across + 0.5, away)
        uv = np.column_stack([u.ravel(), v.ravel()])
        return Mesh(points.reshape(-1, 3), faces, normals.reshape(-1, 3), uv, self._colours(y, normals))

    def _colours(self, y: Array, normals: Array) -> Array | None:
        if not self.colours:
            return None
        heights = [height for height, _ in self.colours]
        levels = np.array([colour for _, colour in self.colours])
        # a border that follows no contour line: the steeper, the lower it seems
        seems = y - 0.25 * self.height_mm * (1 - normals[..., 1])
        out = np.stack([np.interp(seems, heights, levels[:, c]) for c in range(3)], axis=-1)
        if self.steep is not None:
            share = np.clip((0.86 - normals[..., 1]) / 0.16, 0, 1)[..., None]
            out += share * (np.array(self.steep) - out)
        return out.reshape(-1, 3)

    @model_validator(mode="after")
    def _check(self) -> Heightfield:
        heights = [height for height, _ in self.colours]
        if any(b <= a for a, b in pairwise(heights)):
            raise ValueError(f"colours stand at heights {heights}: each must be higher than the one before")
        return self


class Strands(Shape):
    """Hair: thin ribbons that grow from a head about the origin, are combed, fall, and lie on the head.

    The head is an ellipsoid that looks to −z.

    Parameters
    ----------
    count : int
    radii_mm : (x, y, z)
        Half axes of the head.
    length_mm, width_mm : float
        Of a strand; lengths vary by a fifth.
    steps : int
        Pieces of a strand.
    volume : float
        How far the outermost strands lie off the head, as a share of its size.
    parting_mm : float
        x of the parting, from which hair is combed to both sides.
    weight : float
        How soon a strand turns down: 0 stands off straight.
    wave_mm, wavelength_mm : float
        How far strands swing aside, in locks, and over what length.
    face : float
        Half width of the face left free, as a share of the head's.
    colours : (dark, light)
        Each strand has a colour between these.
    """

    shape: Literal["strands"]
    count: PositiveInt
    radii_mm: Sizes
    length_mm: PositiveFloat
    width_mm: PositiveFloat
    steps: Annotated[int, Field(ge=2)] = 8
    volume: NotNegative = 0.15
    parting_mm: float = 0.0
    weight: NotNegative = 0.35
    wave_mm: NotNegative = 0.0
    wavelength_mm: PositiveFloat = 10.0
    face: Annotated[float, Field(ge=0, le=1)] = 0.75
    colours: tuple[Colour, Colour] = ((0.02, 0.01, 0.005), (0.1, 0.05, 0.02))
    seed: Annotated[int, Field(ge=0)] = 0

    def triangles(self) -> int:
        return 2 * self.count * self.steps

    def mesh(self) -> Mesh:
        generator = np.random.default_rng(self.seed)
        radii = np.array(self.radii_mm)
        out = self._roots(generator)
        points, widths = self._grow(out, radii, generator)
        along = unit_rows(np.gradient(points, axis=1))
        away = unit_rows(points / radii**2)
        across = unit_rows(np.cross(along, away))
        facing = unit_rows(np.cross(across, along))
        facing *= np.where((facing * away).sum(axis=-1, keepdims=True) < 0, -1.0, 1.0)
        across = np.cross(along, facing)
        half = (0.5 * widths)[..., None] * across
        sides = np.stack([points - half, points + half], axis=2)
        # bent as if the strand were round, so that each shows a light and a dark side
        normals = unit_rows(np.stack([facing - 0.8 * across, facing + 0.8 * across], axis=2))
        n, rows = self.count, self.steps + 1
        first = (np.arange(n)[:, None] * rows + np.arange(self.steps)).reshape(-1) * 2
        left, right, left_on, right_on = first, first + 1, first + 2, first + 3
        faces = np.concatenate([np.column_stack([left, right_on, right]), np.column_stack([left, left_on, right_on])])
        tone = generator.uniform(0, 1, n) ** 1.5
        dark, light = np.array(self.colours)
        along_it = np.linspace(0.7, 1.1, rows)
        colours = np.clip((dark + tone[:, None] * (light - dark))[:, None, :] * along_it[:, None], 0, 1)
        colours = np.repeat(colours[:, :, None, :], 2, axis=2)
        u = np.broadcast_to([0.0, 1.0], (n, rows, 2))
        v = np.broadcast_to(np.linspace(0, 1, rows)[:, None], (n, rows, 2))
        return Mesh(
            sides.reshape(-1, 3),
            faces,
            normals.reshape(-1, 3),
            np.column_stack([u.ravel(), v.ravel()]),
            colours.reshape(-1, 3),
        )

    def _roots(self, generator: np.random.Generator) -> Array:
        """Directions from the head's middle to where hair grows: not on the face, not under the chin."""
        found = np.empty((0, 3))
        while len(found) < self.count:
            n = unit_rows(generator.normal(size=(4 * self.count, 3)))
            face = (n[:, 2] < 0) & (n[:, 1] < 0.56 + 0.1 * n[:, 0] ** 2) & (np.abs(n[:, 0]) < 0.92)
            good = ~face & (n[:, 1] > -0.45)
            found = np.concatenate([found, n[good]])
        return found[: self.count]

    def _grow(self, out: Array, radii: Array, generator: np.random.Generator) -> tuple[Array, Array]:
        n = self.count
        step = self.length_mm * generator.uniform(0.8, 1.0, n) / self.steps
        layer = 1 + self.volume * generator.uniform(0.05, 1, n) ** 0.8
        # hair lies in locks: neighbours share their swing
        lock = np.round(np.arctan2(out[:, 0], out[:, 2]) * 7) + 37 * np.round(out[:, 1] * 4)
        phase = 2.4 * lock + generator.normal(0, 0.35, n)
        side = np.where(out[:, 0] * radii[0] >= self.parting_mm, 1.0, -1.0)
        point = out * radii * 1.01
        behind = np.maximum(out[:, 2], 0)  # what grows there falls where it is
        combed = np.column_stack([side * 0.9 * (1 - behind) ** 2, 0.15 * np.ones(n), 0.45 * np.ones(n)])
        heading = unit_rows(0.6 * out + combed + generator.normal(0, 0.08, (n, 3)))
        points = [point]
        for _ in range(self.steps):
            heading = unit_rows(heading + np.array([0, -self.weight, 0]))
            point = point + heading * step[:, None]
            point = self._off_head(point, radii, layer, side)
            heading = unit_rows(0.5 * heading + 0.5 * unit_rows(point - points[-1]))
            points.append(point)
        line = np.stack(points, axis=1)
        if self.wave_mm:
            t = np.linspace(0, 1, self.steps + 1)
            swing = np.sin(phase[:, None] + 2 * np.pi * self.length_mm * t / self.wavelength_mm) * np.minimum(
                3 * t, 1
            )
            away = unit_rows(np.stack([line[..., 0], np.zeros(line.shape[:2]), line[..., 2] + 1e-9], axis=-1))
            line = line + self.wave_mm * swing[..., None] * np.stack(
                [away[..., 2], 0 * t + 0 * swing, -away[..., 0]], -1
            )
            line = line + 0.4 * self.wave_mm * (1 + np.cos(phase[:, None] + 3 * t))[..., None] * away
            line = self._off_face(line, radii, side[:, None])
        widths = self.width_mm * np.linspace(1, 0.35, self.steps + 1) * np.ones((n, 1))
        return line, widths

    def _off_head(self, point: Array, radii: Array, layer: Array, side: Array) -> Array:
        """Push points out of the head, and off the face to their own side."""
        size = np.linalg.norm(point / radii, axis=1)
        # below its middle the head has a neck: hair hangs straight down round it
        flat = np.array([1.0, 0.0, 1.0])
        below = point[:, 1] < 0
        ring = np.linalg.norm(point * flat / radii, axis=1)
        grow = np.where(below, np.maximum(0.92 * layer / np.maximum(ring, 1e-6), 1), 1.0)
        outward = np.where(
            (~below & (size < layer))[:, None], point * (layer / np.maximum(size, 1e-6))[:, None], point
        )
        point = np.where(below[:, None], point * (1 + (grow - 1)[:, None] * flat), outward)
        return self._off_face(point, radii, side)

    def _off_face(self, point: Array, radii: Array, side: Array) -> Array:
        """A curtain that opens from the hairline down, and under the chin lies wholly to the sides and behind."""
        high = point[..., 1] / radii[1]
        free = self.face * radii[0] * np.sqrt(np.clip((0.62 - high) / 0.55, 0, 1))
        inside = (point[..., 2] < np.where(high < -0.6, 0.35, -0.1) * radii[2]) & (np.abs(point[..., 0]) < free)
        return np.stack([np.where(inside, side * free, point[..., 0]), point[..., 1], point[..., 2]], axis=-1)


AnyShape = Annotated[
    Sphere | Box | Plane | Cylinder | Revolve | BoxGrid | Implicit | Heightfield | Strands,
    Field(discriminator="shape"),
]
