"""Parts of implicit bodies: signed distances of balls, blocks, capsules and tubes."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, PositiveFloat

from ..scene.textures import Colour
from .primitives import NotNegative, Point3, Sizes, rotation, smooth_curve

Array = NDArray[Any]


class Part(BaseModel):
    """Base of the parts of an implicit body.

    Parameters
    ----------
    op : {"add", "cut", "keep", "paint"}
        Union with the parts before, difference, intersection, or only a change of colour.
    blend_mm : float
        Distance over which the joint is rounded, or over which a painted colour is blended.
    mirrored : bool
        True for a second copy of the part at −x.
    colour : sRGB, optional
        Colour of the vertices of this part; white without one.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
    op: Literal["add", "cut", "keep", "paint"] = "add"
    at_mm: Point3 = (0.0, 0.0, 0.0)
    blend_mm: NotNegative = 0.0
    mirrored: bool = False
    colour: Colour = (1.0, 1.0, 1.0)

    def distance(self, x: Array, y: Array, z: Array) -> Array:
        """Return the approximate signed distance to the surface: exact on it, negative inside."""
        raise NotImplementedError

    def bounds(self) -> tuple[Array, Array]:
        """Return the least and greatest corner of a bounding box."""
        raise NotImplementedError


class _Turned(Part):
    rotate_deg: Point3 = (0.0, 0.0, 0.0)

    def own(self, x: Array, y: Array, z: Array) -> list[Array]:
        """Return points in the frame of the part."""
        turn = rotation(self.rotate_deg)
        dx, dy, dz = x - self.at_mm[0], y - self.at_mm[1], z - self.at_mm[2]
        if not any(self.rotate_deg):
            return [dx, dy, dz]
        return [np.asarray(turn[0, i] * dx + turn[1, i] * dy + turn[2, i] * dz) for i in range(3)]

    def _around(self, half: Sizes) -> tuple[Array, Array]:
        reach = np.abs(rotation(self.rotate_deg)) @ np.array(half)
        return np.array(self.at_mm) - reach, np.array(self.at_mm) + reach


class Ball(_Turned):
    """Ellipsoid of three half axes."""

    part: Literal["ball"]
    radii_mm: Sizes

    def distance(self, x: Array, y: Array, z: Array) -> Array:
        own, r = self.own(x, y, z), self.radii_mm
        once = np.sqrt(sum((p / a) ** 2 for p, a in zip(own, r, strict=True)))
        twice = np.sqrt(sum((p / (a * a)) ** 2 for p, a in zip(own, r, strict=True)))
        # first order: exact, with slope 1, on the surface
        return np.where(twice > 0, once * (once - 1) / np.maximum(twice, 1e-12), -min(r))

    def bounds(self) -> tuple[Array, Array]:
        return self._around(self.radii_mm)


class Block(_Turned):
    """Box with edges rounded by ``round_mm``."""

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


class Capsule(Part):
    """Capsule from ``at_mm`` to ``to_mm``, with radii from ``radius_mm`` to ``end_radius_mm``."""

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


class Tube(Part):
    """Tube: a smooth curve through points (x, y, z, radius), thickened by the radius.

    The search for the nearest point starts on ``steps`` straight pieces; the curve is smooth.
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
        # Two Gauss–Newton steps towards the smooth curve; straight pieces would be visible as rings.
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
        # between a thick and a thin point the interpolated radius may fall below the thin one
        curve[:, 3] = np.maximum(curve[:, 3], min(point[3] for point in self.points_mm))
        return np.asarray(curve)


PARTS = (Ball, Block, Capsule, Tube)
