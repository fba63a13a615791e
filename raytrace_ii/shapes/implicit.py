"""Implicit body: union, difference and blend of parts by signed distance, meshed by marching cubes."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat, model_validator

from ..scene.scene import unit_rows
from .implicit_parts import Array, Ball, Block, Capsule, Part, Tube
from .primitives import Mesh, Shape

MOST_CELLS = 40_000_000  # of the grid: 160 MB


class Implicit(Shape):
    """Implicit body: a closed smooth body of blended parts, combined in their order.

    Parameters
    ----------
    parts : list
        Balls, blocks, capsules and tubes; see `Ball`, `Block`, `Capsule`, `Tube`.
    cell_mm : float
        Side of a cell of the grid of marching cubes.
    grow_mm : float
        Offset of the surface outwards, before parts that keep or cut.
    front_mm : (x, y, x, y), optional
        Rectangle of the texture, projected onto the body along z.
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
        # gradients of the field: those of marching cubes are differences over whole cells
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
        """Yield every part with the sign of its x; mirrored parts twice."""
        return [(part, sign) for part in self.parts for sign in ((1.0, -1.0) if part.mirrored else (1.0,))]

    def _box(self, part: Part, sign: float) -> tuple[Array, Array]:
        low, high = part.bounds()
        if sign < 0:
            low, high = low * [-1, 1, 1], high * [-1, 1, 1]
            low, high = np.minimum(low, high), np.maximum(low, high)
        reach = part.blend_mm + 3 * self.cell_mm + max(self.grow_mm, 0.0)
        return low - reach, high + reach

    def _grid(self) -> tuple[Array, Array]:
        """Return the least corner and the number of points along each axis."""
        every = [self._box(part, sign) for part, sign in self._placed() if part.op == "add"]
        low = np.min([box[0] for box in every], axis=0)
        high = np.max([box[1] for box in every], axis=0)
        return low, np.ceil((high - low) / self.cell_mm).astype(int) + 1

    def _field(self, x: Array, y: Array, z: Array) -> NDArray[np.float32]:
        """Return the distance of the whole body on a grid; parts are evaluated only near their surface."""
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

    def _join(self, so_far: Array, near: Array, part: Part) -> Array:
        if part.op == "add":
            return _smooth_least(so_far, near - self.grow_mm, part.blend_mm)
        if part.op == "cut":
            return -_smooth_least(-so_far, near, part.blend_mm)
        return -_smooth_least(-so_far, -near, part.blend_mm)

    def _colours(self, vertices: Array) -> Array | None:
        """Return the colours of vertices by part, interpolated where parts blend."""
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
    """Return the smooth minimum of two distances, which blends differences below ``blend``."""
    least = np.minimum(a, b)
    if blend == 0:
        return least
    near = np.maximum(blend - np.abs(a - b), 0) / blend
    return least - near**2 * (blend / 4)


def _sample(values: Array, points: Array) -> Array:
    """Return the values of a grid at points on its edges, in cells."""
    first = np.minimum(np.floor(points).astype(int), np.array(values.shape) - 2)
    part = points - first
    i, j, k = first.T
    here = values[i, j, k]
    x, y, z = values[i + 1, j, k], values[i, j + 1, k], values[i, j, k + 1]
    return np.asarray(here + part[:, 0] * (x - here) + part[:, 1] * (y - here) + part[:, 2] * (z - here))
