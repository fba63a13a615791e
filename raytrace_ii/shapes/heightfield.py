"""Heightfield: fractal terrain or water."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat, PositiveInt, model_validator

from ..scene.scene import unit_rows
from ..scene.textures import Colour
from ..tracing.kernels.noise import terrain
from .primitives import Mesh, NotNegative, Shape

Array = NDArray[Any]


class Heightfield(Shape):
    """Heightfield: a fractal surface over x and z, upward, with its nearest row at z = 0 and centred in x.

    Parameters
    ----------
    size_mm : (x, z)
        Width at the near edge and depth.
    widen : float
        Width of the far edge over that of the near edge; distances of rows grow alike.
    cells : (x, z)
    height_mm, feature_mm : float
        Height and wavelength of the coarsest octave.
    swell : bool
        True if heights grow with the width of rows, up to ``height_mm`` at the far edge.
    octaves, ridged : int, bool
        Octaves of noise, each of half the wavelength and ``rough`` times the height; folded into ridges or not.
    rise_mm : float
        Rise of the ground from the near to the far edge.
    valley_mm : float
        Half width of a valley along x = 0 at the near edge; it widens with the rows. Its floor has a quarter of the
        height. 0 for no valley.
    colours : list of (height_mm, colour)
        Colours from the bottom up, interpolated.
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
        if self.widen > 1:  # width and distance of rows grow with their distance
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
        # the border of colours follows no contour line: steep slopes count as lower
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
