"""Reference ray tracer: spheres and a floor in closed form, float64, no triangles.

It shares only the values of materials and lights with `raytrace_ii`; intersections, Snell's and Fresnel's formulas,
shadows and sky are implemented independently. `World.scene` is the same world as triangle meshes.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from raytrace_ii import Background, Body, Light, Material, Scene
from raytrace_ii.shapes.primitives import Plane, Sphere

Array = NDArray[np.float64]
NEAR = 1e-9  # mm: nearer hits are the surface on which the ray starts


@dataclass(frozen=True)
class Ball:
    """A sphere; glass if its material lets light through."""

    name: str
    centre_mm: tuple[float, float, float]
    radius_mm: float
    material: Material

    def distances(self, o: Array, d: Array) -> tuple[Array, Array]:
        """Return distances of entry and exit of unit rays (n, 3), NaN for a miss."""
        to = o - np.asarray(self.centre_mm)
        half = -(to * d).sum(axis=1)
        # measured from the point nearest to the centre: avoids the difference of large squares
        square = self.radius_mm**2 - ((to + half[:, None] * d) ** 2).sum(axis=1)
        root = np.sqrt(np.where(square >= 0, square, np.nan))
        return half - root, half + root

    def first(self, o: Array, d: Array) -> Array:
        """Distance to the first hit, inf if there is none."""
        near, far = self.distances(o, d)
        return np.where(near > NEAR, near, np.where(far > NEAR, far, np.inf))

    def normal(self, p: Array) -> Array:
        return (p - np.asarray(self.centre_mm)) / self.radius_mm

    def body(self, segments: int, smooth: bool) -> Body:
        mesh = Sphere(shape="sphere", radius_mm=self.radius_mm, segments=segments).mesh()
        at = mesh.vertices + np.asarray(self.centre_mm)
        return Body(
            name=self.name, vertices=at, faces=mesh.faces, material=self.material,
            normals=mesh.normals if smooth else None,
        )  # fmt: skip


@dataclass(frozen=True)
class Floor:
    """A rectangle that faces up, ``size_mm`` along x and z."""

    name: str
    centre_mm: tuple[float, float, float]
    size_mm: tuple[float, float]
    material: Material

    def first(self, o: Array, d: Array) -> Array:
        """Distance to the hit, inf if there is none."""
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (self.centre_mm[1] - o[:, 1]) / d[:, 1]
            at = np.abs(o + t[:, None] * d - np.asarray(self.centre_mm))
            hit = (t > NEAR) & (at[:, 0] <= self.size_mm[0] / 2) & (at[:, 2] <= self.size_mm[1] / 2)
        return np.where(hit, t, np.inf)

    def normal(self, p: Array) -> Array:
        return np.broadcast_to([0.0, 1.0, 0.0], p.shape)

    def body(self, segments: int, smooth: bool) -> Body:
        mesh = Plane(shape="plane", size_mm=self.size_mm).mesh()
        at = mesh.vertices + np.asarray(self.centre_mm)
        return Body(name=self.name, vertices=at, faces=mesh.faces, material=self.material)


@dataclass(frozen=True)
class World:
    """Solids under lights and sky. Glass balls do not touch or overlap, and have no local shading."""

    solids: tuple[Ball | Floor, ...]
    lights: tuple[Light, ...] = ()
    background: Background = field(default_factory=Background)
    ambient: tuple[float, float, float] = (0.0, 0.0, 0.0)
    max_depth: int = 6

    def scene(self, segments: int, *, smooth: bool = True) -> Scene:
        """Return the world as triangle meshes, with ``segments`` triangles around a ball."""
        return Scene(
            bodies=[solid.body(segments, smooth) for solid in self.solids], lights=self.lights,
            background=self.background, ambient=self.ambient, max_depth=self.max_depth,
        )  # fmt: skip

    def nearest(self, o: Array, d: Array) -> tuple[Array, NDArray[np.int64], Array]:
        """Return distance (inf on a miss), row of the solid (−1) and outward normal (NaN) at hits of rays (n, 3)."""
        every = np.stack([solid.first(o, d) for solid in self.solids])
        t, which = every.min(axis=0), every.argmin(axis=0)
        which[~np.isfinite(t)] = -1
        normal = np.full_like(o, np.nan)
        for i, solid in enumerate(self.solids):
            here = which == i
            normal[here] = solid.normal(o[here] + t[here, None] * d[here])
        return t, which, normal

    def radiance(self, o: Array, d: Array) -> Array:
        """Return linear light (n, 3) along unit rays that start in air."""
        return self._seen(o, d, 0, -1)

    def _seen(self, o: Array, d: Array, depth: int, inside: int) -> Array:
        """Return linear light along rays inside ball ``inside``; −1 for rays in air."""
        t, which, normal = self.nearest(o, d)
        out = np.empty_like(o)
        out[which < 0] = self.sky(d[which < 0])
        for i in range(len(self.solids)):
            here = which == i
            if here.any():
                p = o[here] + t[here, None] * d[here]
                out[here] = self._shaded(i, p, d[here], normal[here], depth, inside == i)
        if inside >= 0:
            hit = which >= 0
            out[hit] *= np.exp(-np.array(self.solids[inside].material.absorption_per_mm) * t[hit, None])
        return out

    def _shaded(self, i: int, p: Array, d: Array, n: Array, depth: int, within: bool) -> Array:
        m = self.solids[i].material
        n = n * -np.sign((n * d).sum(axis=1, keepdims=True))
        local = 1 - max(m.mirror) - max(m.transmission)
        out = np.broadcast_to(local * np.array(m.colour) * self.ambient, p.shape).copy()
        if local > 0 or m.specular > 0:
            for light in self.lights:
                towards, reach = _towards(light, p)
                cosine = (n * towards).sum(axis=1)
                lit = cosine > 0
                half = towards - d
                half /= np.linalg.norm(half, axis=1, keepdims=True)
                shine = m.specular * np.maximum((n * half).sum(axis=1), 0) ** m.shininess
                strength = local * np.array(m.colour) * cosine[:, None] + shine[:, None]
                arriving = self._arriving(p[lit], towards[lit], reach[lit])
                out[lit] += strength[lit] * arriving * np.array(light.colour)
        if depth == self.max_depth:
            return out
        mirror, through = np.broadcast_to(m.mirror, p.shape), np.zeros_like(p)
        cosine = -(n * d).sum(axis=1)
        if max(m.transmission) > 0:
            ratio = m.ior if within else 1 / m.ior
            reflected, behind = reflectance(cosine, ratio)
            mirror = mirror + reflected[:, None] * m.transmission
            through = (1 - reflected)[:, None] * np.array(m.transmission)
            going = np.flatnonzero(through.max(axis=1) > 0)
            along = ratio * cosine - behind
            bent = ratio * d + along[:, None] * n
            out[going] += through[going] * self._seen(p[going], bent[going], depth + 1, -1 if within else i)
        if mirror.max(initial=0) > 0:
            out += mirror * self._seen(p, d + 2 * cosine[:, None] * n, depth + 1, i if within else -1)
        return out

    def _arriving(self, p: Array, towards: Array, reach: Array) -> Array:
        """Return the share of a light (n, 3) that reaches points past occluders; glass does not refract it."""
        share = np.ones_like(p)
        for solid in self.solids:
            m = solid.material
            if max(m.transmission) == 0:
                share[solid.first(p, towards) < reach] = 0
                continue
            assert isinstance(solid, Ball)
            near, far = solid.distances(p, towards)
            hit = (near > NEAR) & (far < reach)
            chord = (far - near)[hit]
            reflected, _ = reflectance(chord / 2 / solid.radius_mm, 1 / m.ior)
            both = (np.array(m.transmission) * (1 - reflected)[:, None]) ** 2
            share[hit] *= both * np.exp(-np.array(m.absorption_per_mm) * chord[:, None])
        return share

    def sky(self, d: Array) -> Array:
        """Return the sky's light: from horizon to zenith or nadir, linear in the sine of the elevation."""
        b = self.background
        rise = np.minimum(np.abs(d[:, 1:2]) / np.sin(np.radians(b.spread_deg)), 1)
        pole = np.where(d[:, 1:2] > 0, b.zenith, b.nadir)
        return (1 - rise) * np.array(b.horizon) + rise * pole


def reflectance(cosine: Array, ratio: float) -> tuple[Array, Array]:
    """Return Fresnel's unpolarised reflectance at n1/n2 = ``ratio``, and the refracted cosine; (1, 0) if total."""
    sine = ratio * np.sqrt(np.maximum(1 - cosine**2, 0))
    behind = np.sqrt(np.maximum(1 - sine**2, 0))
    s = (ratio * cosine - behind) / (ratio * cosine + behind)
    p = (ratio * behind - cosine) / (ratio * behind + cosine)
    return np.where(sine < 1, (s**2 + p**2) / 2, 1.0), behind


def _towards(light: Light, p: Array) -> tuple[Array, Array]:
    """Return unit vectors to a light, and its distance."""
    if light.kind == "directional":
        d = -np.asarray(light.vector, float)
        return np.broadcast_to(d / np.linalg.norm(d), p.shape), np.full(len(p), np.inf)
    to = np.asarray(light.vector) - p
    reach = np.linalg.norm(to, axis=1)
    return to / reach[:, None], reach


def still_life() -> World:
    """A matt, a mirroring and a glass ball on a floor under sky, sun and lamp: 20 to 60 mm away."""
    return World(
        solids=(
            Floor("floor", (0, -8, 90), (240, 200), Material(colour=(0.55, 0.5, 0.42))),
            Ball("matt", (-9, -3, 34), 5, Material(colour=(0.8, 0.25, 0.15), specular=0.4, shininess=40)),
            Ball("mirror", (6, 0, 50), 8, Material(colour=(0.1, 0.1, 0.1), mirror=(0.85, 0.85, 0.8))),
            Ball(
                "glass", (4, -4, 26), 4,
                Material(colour=(0, 0, 0), transmission=(0.96,) * 3, absorption_per_mm=(0.05, 0.01, 0.03)),
            ),
        ),
        lights=(
            Light(kind="directional", vector=(0.6, -1.0, 0.4), colour=(0.6, 0.58, 0.5)),
            Light(kind="point", vector=(-20, 25, 0), colour=(0.2, 0.22, 0.3)),
        ),
        background=Background(
            horizon=(0.75, 0.8, 0.85), zenith=(0.15, 0.3, 0.6), nadir=(0.4, 0.38, 0.35), spread_deg=40
        ),
        ambient=(0.25, 0.25, 0.27),
    )  # fmt: skip
