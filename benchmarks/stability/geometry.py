"""Limits of triangles and floating point: self-hits, distance, coplanar, reversed, double and missing faces."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.accuracy.analytic import World, still_life
from ii_core import preset
from raytrace_ii import Body, Light, Material, Scene, trace
from raytrace_ii.shapes.primitives import Mesh, Plane, Sphere, rotation
from raytrace_ii.tracing import packing
from raytrace_ii.tracing.packing import LIFT, packed

Row = dict[str, Any]
WHITE = Material(colour=(1.0, 1.0, 1.0))
TOWARDS = np.array([0.5, 0.7, -0.4]) / np.linalg.norm([0.5, 0.7, -0.4])
SUN = Light(kind="directional", vector=tuple(-TOWARDS), colour=(1.0, 1.0, 1.0))


def ball(radius: float = 1.0, segments: int = 96) -> Mesh:
    return Sphere(shape="sphere", radius_mm=radius, segments=segments).mesh()


def ground(side: float) -> Mesh:
    return Plane(shape="plane", size_mm=(side, side)).mesh()


def body(
    mesh: Mesh, material: Material = WHITE, at: Any = (0, 0, 0), name: str = "body", smooth: bool = False
) -> Body:
    normals = mesh.normals if smooth else None
    vertices = mesh.vertices + np.asarray(at, float)
    return Body(name=name, vertices=vertices, faces=mesh.faces, material=material, normals=normals)


def around(centre: NDArray[np.float64], radius: float, n: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return rays from a distance of three radii to points within nine tenths of the radius."""
    generator = np.random.default_rng(0)
    start, aim = (generator.normal(size=(n, 3)) for _ in range(2))
    start, aim = (3 * start / _length(start), 0.9 * aim / _length(aim))
    return centre + radius * start, (aim - start) / _length(aim - start)


def _length(vectors: NDArray[Any]) -> NDArray[Any]:
    return np.linalg.norm(vectors, axis=1, keepdims=True)


@contextmanager
def lifted(share: float) -> Iterator[None]:
    """Pack scenes with another lift of spawned rays, as a share of the coordinates."""
    packing.LIFT = share
    try:
        yield
    finally:
        packing.LIFT = LIFT


def own_shadow(scale: float, offset: float, n: int = 4000) -> tuple[float, float, float]:
    """Return shares of wrongly dark and wrongly lit points, and the form error, of a ball ``offset`` radii away.

    The form error is the rms distance of hits from the true ball, in radii; the triangles contribute 5e-4.
    """
    at = scale * offset * np.array([1, 1 / 3, -1 / 2])
    scene = Scene(bodies=[body(_scaled(ball(), scale), at=at)], lights=[SUN])
    seen = trace(scene, *around(at, scale, n))
    cosine, lit, hit = seen.normal @ TOWARDS, seen.radiance[:, 0] > 0, seen.object_id == 0
    facing, away = hit & (cosine > 1e-2), hit & (cosine < -1e-2)
    straight = scale * np.random.default_rng(1).uniform(-0.6, 0.6, (n, 3)) * [1, 1, 0] + at - [0, 0, 3 * scale]
    z = trace(scene, straight, np.tile([0.0, 0.0, 1.0], (n, 1))).depth
    p = np.column_stack([straight[:, :2], z]) - at
    form = np.linalg.norm(p, axis=1) / scale - 1
    return (
        float((facing & ~lit).sum() / facing.sum()),
        float((away & lit).sum() / away.sum()),
        float(np.sqrt(np.nanmean(form**2))),
    )


def _scaled(mesh: Mesh, scale: float) -> Mesh:
    return Mesh(mesh.vertices * scale, mesh.faces, mesh.normals)


def lift() -> list[Row]:
    """Return the share of lit points that a ball shades itself, over the lift of the ray to the light."""
    rows = []
    for share in (0.0, 1e-8, 3e-8, 1e-7, 1e-6, LIFT):
        with lifted(share):
            row: Row = {"lift": share}
            for offset in (0, 10, 1000):
                row[f"{offset} radii off"] = own_shadow(1.0, offset)[0]
            rows.append(row)
    return rows


def scales() -> list[Row]:
    """Return the same at our lift over eleven decades of size, and the form error, by distance from the origin."""
    sizes = 10.0 ** np.arange(-4, 6)
    rows = []
    for offset in (0, 10, 100, 1e3, 1e4, 1e5, 1e6):
        shares = np.array([own_shadow(scale, offset) for scale in sizes])
        worst = shares.max(axis=0)
        rows.append(
            {"radii off": offset, "wrongly dark": worst[0], "wrongly lit": worst[1], "form off, radii": worst[2]}
        )
    return rows


def coplanar() -> list[Row]:
    """Return the share of rays that wrongly hit the far one of two tilted walls, first in the scene, over the gap."""
    generator = np.random.default_rng(0)
    d = np.column_stack([*generator.uniform(-0.5, 0.5, (2, 20_000)), np.ones(20_000)])
    corners = np.array([[-20, -20, 0], [20, -20, 0], [20, 20, 0], [-20, 20, 0.0]]) @ rotation((17, 29, 5)).T
    away = rotation((17, 29, 5)) @ [0, 0, 1]
    faces = np.array([[0, 2, 1], [0, 3, 2]])
    rows = []
    for gap in (0.0, 3e-8, 1e-7, 3e-7, 1e-6, 4e-6, 1e-5):
        far, near = (
            Body(name=name, vertices=corners + np.array([0, 0, 20]) + by * away, faces=faces, material=WHITE)
            for name, by in (("far", 20 * gap), ("near", 0.0))
        )
        wrong = trace(Scene(bodies=[far, near], lights=[SUN]), np.zeros_like(d), d).object_id == 0
        rows.append({"gap / distance": gap, "gap, mm": 20 * gap, "far wall seen": float(wrong.mean())})
    return rows


def contact_shadow() -> list[Row]:
    """Return the share of points of a floor in the shadow of a carpet, over the height of the carpet in lifts."""
    floor, half = body(ground(100), name="floor"), 50.0
    lift_mm = LIFT * half
    generator = np.random.default_rng(0)
    rows = []
    for height in (0.25, 0.5, 0.9, 1.1, 2.0, 10.0):
        carpet = body(ground(20), at=(0, height * lift_mm, 0), name="carpet")
        scene = Scene(bodies=[carpet, floor], lights=[Light(kind="directional", vector=(1, -1, 0), colour=(1, 1, 1))])
        # rays start between floor and carpet, at half the height: the carpet hides the floor from above
        x, z = generator.uniform(-9, 9, (2, 4000))
        o = np.column_stack([x, np.full(4000, 0.5 * height * lift_mm), z])
        seen = trace(scene, o, np.tile([0.0, -1.0, 0.0], (4000, 1)))
        on = seen.object_id == 1
        rows.append({"height / lift": height, "height, mm": height * lift_mm, "in shadow": _dark(seen, on)})
    return rows


def _dark(seen: Any, on: NDArray[np.bool_]) -> float:
    return float((seen.radiance[on, 0] == 0).mean()) if on.any() else float("nan")


def bad_faces() -> list[Row]:
    """Return PSNR against the intact ball in dB, of balls with a share of reversed, double or missing faces."""
    camera = preset("setup1", scale=32)
    L, D = camera.rays()
    world = still_life()
    generator = np.random.default_rng(0)
    kinds = {"turned": _turned, "doubled": _doubled, "missing": _missing}
    sound = trace(_only(world, None, world.scene(96)), L, D).radiance
    rows = []
    for share in (0.001, 0.01, 0.1, 0.5, 1.0):
        row: Row = {"share of faces": share}
        for name in ("matt", "mirror", "glass"):
            for kind, change in kinds.items():
                if kind == "missing" and share == 1:
                    continue
                scene = _only(world, name, world.scene(96), partial(change, share=share, generator=generator))
                seen = trace(scene, L, D).radiance
                error = float(np.mean((seen.astype(float) - sound) ** 2))
                # rounding of the same light to float32 gives 150 dB and more
                row[f"{name}, {kind}"] = float(-10 * np.log10(error)) if error > 1e-15 else None
        rows.append(row)
    return rows


def _only(world: World, name: str | None, scene: Scene, change: Any = None) -> Scene:
    bodies = [replace(b, faces=change(np.asarray(b.faces))) if b.name == name else b for b in scene.bodies]
    return replace(scene, bodies=bodies)


def _turned(faces: NDArray[Any], share: float, generator: np.random.Generator) -> NDArray[Any]:
    chosen = generator.random(len(faces)) < share
    return np.where(chosen[:, None], faces[:, ::-1], faces)


def _doubled(faces: NDArray[Any], share: float, generator: np.random.Generator) -> NDArray[Any]:
    return np.concatenate([faces, faces[generator.random(len(faces)) < share]])


def _missing(faces: NDArray[Any], share: float, generator: np.random.Generator) -> NDArray[Any]:
    return faces[generator.random(len(faces)) >= share]


def huge_beside_tiny(balls: int = 500, segments: int = 46) -> list[Row]:
    """Return speed, and shadows of a million triangles in grains of 0.02 mm, over floors of growing size."""
    generator = np.random.default_rng(0)
    grain = ball(0.01, segments)
    places = np.column_stack([generator.uniform(-1, 1, balls), np.full(balls, 0.02), generator.uniform(-1, 1, balls)])
    vertices = (grain.vertices + places[:, None]).reshape(-1, 3)
    faces = (grain.faces + np.arange(balls)[:, None, None] * len(grain.vertices)).reshape(-1, 3)
    grains = Body(name="grains", vertices=vertices, faces=faces, material=WHITE)
    x, z = generator.uniform(-1, 1, (2, 200_000))
    o = np.column_stack([x, np.ones_like(x), z])
    d = np.column_stack([generator.uniform(-0.1, 0.1, (2, len(x))).T, np.full(len(x), -1.0)])[:, [0, 2, 1]]
    under = np.column_stack([places[:, 0], np.full(balls, 0.005), places[:, 2]])
    rows = []
    for side in (None, 10.0, 1e3, 1e4, 1e5, 2e7):
        floor = [] if side is None else [body(ground(side), name="floor")]
        overhead = Light(kind="directional", vector=(0, -1, 0), colour=(1, 1, 1))
        scene = Scene(bodies=[grains, *floor], lights=[overhead])
        started = time.process_time()
        packed(scene)  # builds the tree
        built = time.process_time() - started
        trace(scene, o, d)
        started = time.process_time()
        seen = trace(scene, o, d)
        seconds = time.process_time() - started
        below = trace(scene, under, np.tile([0.0, -1.0, 0.0], (balls, 1)))
        rows.append(
            {
                "floor, mm": side, "faces": len(faces) + 2 * len(floor), "built in, s": built,
                "rays a second": len(x) / seconds, "grains seen": float((seen.object_id == 0).mean()),
                "lift, mm": None if side is None else LIFT * side / 2,
                "shadows there": None if side is None else _dark(below, below.object_id == 1),
            }
        )  # fmt: skip
    return rows
