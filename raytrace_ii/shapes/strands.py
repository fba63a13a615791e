"""Strands: hair as thin ribbons."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat, PositiveInt

from ..scene.scene import unit_rows
from ..scene.textures import Colour
from .primitives import Mesh, NotNegative, Shape, Sizes

Array = NDArray[Any]


class Strands(Shape):
    """Hair: thin ribbons from a head about the origin, combed, falling, and lying on the head.

    The head is an ellipsoid that faces −z.

    Parameters
    ----------
    count : int
    radii_mm : (x, y, z)
        Half axes of the head.
    length_mm, width_mm : float
        Size of a strand; lengths vary by a fifth.
    steps : int
        Pieces of a strand.
    volume : float
        Distance of the outermost strands from the head, relative to its size.
    parting_mm : float
        x of the parting.
    weight : float
        How soon a strand turns down; 0 is straight.
    wave_mm, wavelength_mm : float
        Amplitude and wavelength of the waves of locks.
    face : float
        Half width of the uncovered face, relative to the head's.
    colours : (dark, light)
        Range of the colours of strands.
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
        # normals of a round strand, so that each has a light and a dark side
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
        """Return directions from the centre of the head to roots of hair, without face and chin."""
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
        # locks: neighbouring strands have equal waves
        lock = np.round(np.arctan2(out[:, 0], out[:, 2]) * 7) + 37 * np.round(out[:, 1] * 4)
        phase = 2.4 * lock + generator.normal(0, 0.35, n)
        side = np.where(out[:, 0] * radii[0] >= self.parting_mm, 1.0, -1.0)
        point = out * radii * 1.01
        behind = np.maximum(out[:, 2], 0)  # strands at the back fall straight
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
        """Move points out of the head, and away from the face to their side."""
        size = np.linalg.norm(point / radii, axis=1)
        # below its centre the head is a cylinder: hair hangs straight down
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
        """Return the half width of the opening of hair: it grows from the hairline down to the chin."""
        high = point[..., 1] / radii[1]
        free = self.face * radii[0] * np.sqrt(np.clip((0.62 - high) / 0.55, 0, 1))
        inside = (point[..., 2] < np.where(high < -0.6, 0.35, -0.1) * radii[2]) & (np.abs(point[..., 0]) < free)
        return np.stack([np.where(inside, side * free, point[..., 0]), point[..., 1], point[..., 2]], axis=-1)
