"""Limits of shading: terminator of coarse meshes, grazing angles, cameras and lamps inside bodies, recursion."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.accuracy.analytic import still_life
from benchmarks.stability.geometry import Row, ball, body, ground
from raytrace_ii import Background, Light, Material, Scene, trace
from raytrace_ii.shapes.primitives import Box, Mesh
from raytrace_ii.tracing.packing import LIFT

ONES = (1.0, 1.0, 1.0)
# Direction of a light, not aligned with any ring of a ball's vertices.
TERMINATOR = np.array([1.0, 0.37, -0.43])


def terminator_scene(segments: int) -> Scene:
    """Return a smooth white ball of 1 mm, lit from the right and slightly from the front."""
    light = Light(kind="directional", vector=tuple(-TERMINATOR), colour=ONES)
    return Scene(bodies=[body(ball(1, segments), at=(0, 0, 10), smooth=True)], lights=[light])


def terminator() -> list[Row]:
    """Return the share of points of a smooth ball that face the light and are dark, and the error of light."""
    towards = TERMINATOR / np.linalg.norm(TERMINATOR)
    x, y = np.random.default_rng(0).uniform(-0.9, 0.9, (2, 60_000))
    o = np.column_stack([x, y, np.zeros_like(x)])
    d = np.tile([0.0, 0.0, 1.0], (len(x), 1))
    rows = []
    for segments in (12, 24, 48, 96, 192, 384):
        seen = trace(terminator_scene(segments), o, d)
        at = np.column_stack([x, y, seen.depth - 10.0])
        cosine = at @ towards / np.linalg.norm(at, axis=1)
        hit = seen.object_id == 0
        lit = hit & (cosine > 0)
        dark = lit & (seen.radiance[:, 0] == 0)
        rows.append(
            {
                "segments": segments, "lit points dark": float(dark.sum() / lit.sum()),
                "light lost there, most": float(cosine[dark].max(initial=0)),
                "band, degrees": float(np.degrees(np.arcsin(cosine[dark].max(initial=0)))),
                "light off by, rms": float(np.sqrt(np.mean((seen.radiance[hit, 0] - cosine[hit].clip(0)) ** 2))),
            }
        )  # fmt: skip
    return rows


def covered() -> list[Row]:
    """Return the share in shadow of a face of a smooth ball of 12 segments under a sheet, over the sheet's height."""
    mesh = ball(1.0, 12)
    face = mesh.vertices[mesh.faces[len(mesh.faces) // 2]]
    middle = face.mean(axis=0)
    away = np.linalg.norm(middle)
    up, sagitta = middle / away, 1.0 - away
    points = np.random.default_rng(0).dirichlet((1, 1, 1), 4000) @ face
    light = Light(kind="directional", vector=tuple(-up), colour=ONES)
    rows = []
    for height in (0.25, 0.5, 1.0, 1.5, 1.75, 2.0, 2.5):
        sheet = Mesh(middle + 3 * (face - middle) + height * sagitta * up, np.array([[0, 1, 2]]))
        scene = Scene(bodies=[body(mesh, smooth=True), body(sheet, name="sheet")], lights=[light])
        seen = trace(scene, points + 0.1 * sagitta * up, np.broadcast_to(-up, points.shape))
        rows.append({"height, sagittas": height, "in shadow": float((seen.radiance[:, 0] == 0).mean())})
    return rows


def grazing() -> list[Row]:
    """Return hits and light error on a floor of 100 mm, over ever more grazing angles of view and of light."""
    plane = body(ground(100.0), at=(3, 4, 50))
    generator = np.random.default_rng(0)
    points = np.column_stack([generator.uniform(-49, 49, (2, 4000)).T, np.zeros(4000)])[:, [0, 2, 1]] + [3, 4, 50]
    rows = []
    for angle in 10.0 ** np.arange(-1, -8, -1):
        look = np.array([0.0, -np.sin(angle), -np.cos(angle)])
        towards = np.array([np.cos(angle), np.sin(angle), 0.0])
        # a light of strength 1/sin keeps the weight at the least angles above the limit for tracing
        light = Light(kind="directional", vector=tuple(-towards), colour=(1 / np.sin(angle),) * 3)
        start = points - look * 30
        seen = trace(Scene(bodies=[plane], lights=[light]), start, np.tile(look, (len(start), 1)))
        hit = seen.object_id == 0
        lit = hit & (seen.radiance[:, 0] > 0)
        where = (seen.depth - start[:, 2])[hit] / look[2] - 30
        rows.append(
            {
                "angle, rad": angle, "seen": float(hit.mean()), "of them lit": _mean(lit[hit]),
                "light off by": float(np.abs(seen.radiance[lit, 0] - 1).max(initial=0)) if lit.any() else None,
                "place off by, mm": float(np.abs(where).max(initial=0)) if hit.any() else None,
            }
        )  # fmt: skip
    return rows


def _mean(values: NDArray[Any]) -> float | None:
    return float(values.mean()) if values.size else None


def camera_in_glass(segments: int = 384, n: int = 4000) -> list[Row]:
    """Return errors of rays that start in a glass ball, ever nearer to its surface, against the closed form."""
    world = still_life()
    (row,) = (i for i, solid in enumerate(world.solids) if solid.name == "glass")
    glass = world.solids[row]
    scene = world.scene(segments)
    d = np.random.default_rng(0).normal(size=(n, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    rows = []
    for depth in (4.0, 1.0, 0.1, 1e-2, 1e-3, 1e-4, 1e-5):
        towards = np.array([0.48, 0.6, -0.64])
        start = np.asarray(glass.centre_mm) + (4.0 - depth) * towards  # type: ignore[union-attr]
        o = np.tile(start, (len(d), 1))
        true = world._seen(o, d, 0, row)
        error = trace(scene, o, d).radiance - true
        off = float((np.abs(error).max(axis=1) > 0.02).mean())
        rows.append(
            {
                "depth in the glass, mm": depth,
                "PSNR, dB": float(-10 * np.log10(np.mean(error**2))),
                "rays off by more than 0.02": off,
            }
        )
    return rows


def camera_in_body() -> list[Row]:
    """Return the share of a ball that a camera in it sees, and that a lamp outside and a lamp inside light."""
    d = np.random.default_rng(0).normal(size=(4000, 3))
    rows = []
    for name, place in (("lamp outside", (9, 9, 0)), ("lamp within", (0, 0, 10))):
        lamp = Light(kind="point", vector=place, colour=ONES)
        sky = Background(horizon=ONES, zenith=ONES, nadir=ONES)
        scene = Scene(bodies=[body(ball(5, 96), at=(0, 0, 10))], lights=[lamp], background=sky)
        seen = trace(scene, np.tile([0.5, 0.2, 10.0], (len(d), 1)), d)
        rows.append(
            {
                "scene": name, "inside seen": float((seen.object_id == 0).mean()),
                "lit": float((seen.radiance[:, 0] > 0).mean()), "mean light": float(seen.radiance[:, 0].mean()),
            }
        )  # fmt: skip
    return rows


def lamp_at_surface() -> list[Row]:
    """Return the share of a floor that a lamp lights, and should light, over its height above and below the floor."""
    plane = body(ground(100.0), at=(0, 0, 0))
    lift_mm = LIFT * 50
    x, z = np.random.default_rng(0).uniform(-40, 40, (2, 4000))
    o = np.column_stack([x, np.full_like(x, 5.0), z])
    rows = []
    for height in (-10.0, -1.0, 0.0, 0.5, 0.9, 1.1, 2.0, 10.0, 1e3):
        lamp = Light(kind="point", vector=(0, height * lift_mm, 0), colour=(1e6,) * 3)
        seen = trace(Scene(bodies=[plane], lights=[lamp]), o, np.tile([0.0, -1.0, 0.0], (len(o), 1)))
        rows.append(
            {
                "height / lift": height, "height, mm": height * lift_mm,
                "lit": float((seen.radiance[:, 0] > 0).mean()), "should be": float(height > 0),
            }
        )  # fmt: skip
    return rows


def bounces() -> list[Row]:
    """Return the light missing in a room of mirrors of 0.9 with ambient light: 0.9^(depth + 1) in theory."""
    box = Box(shape="box", size_mm=(2, 2, 2)).mesh()
    room = body(box, Material(colour=ONES, mirror=(0.9,) * 3))
    d = np.random.default_rng(0).normal(size=(2000, 3))
    rows = []
    for depth in (0, 1, 2, 4, 6, 8, 16, 32, 64):
        seen = trace(Scene(bodies=[room], ambient=ONES, max_depth=depth), np.zeros_like(d), d).radiance[:, 0]
        missing = 1 - float(seen.mean())
        rows.append(
            {
                "depth": depth, "light missing": missing, "0.9^(depth + 1)": 0.9 ** (depth + 1),
                "largest difference": float(np.abs(1 - seen - 0.9 ** (depth + 1)).max()),
            }
        )  # fmt: skip
    return rows
