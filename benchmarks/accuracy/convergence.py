"""Convergence of meshes to the shapes they approximate: error against closed forms over triangle size.

    python -m benchmarks run convergence [--finest 768]

Balls of ever more segments (h = 2π/segments is the side of a triangle on a ball of radius 1) against `analytic`, a
tracer in closed form: distance from the true surface, depth, normal, radiance and PSNR of a picture with shadow,
mirror and glass. Then lenses of triangles: the image position of a point on the axis against Gauss, and the ends of
single rays against Snell. The order of convergence is the slope of a straight line through the logarithms.
Numbers and chart go to ``benchmarks/results/convergence.jsonl`` and
``docs/images/convergence.png``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.accuracy.analytic import Array, Ball, World, still_life
from benchmarks.arguments import command_line
from benchmarks.pages.pictures import tidy, write_chart
from benchmarks.records import Records
from ii_core import IICamera, preset
from ii_core.display.figure import COLOURS, new_figure
from raytrace_ii import Body, Light, Material, Scene, trace
from raytrace_ii.scene.textures import Image

RECORDS = Records("convergence", tuple(f"benchmarks.accuracy.{name}" for name in ("convergence", "analytic")))
FINEST = 768  # segments of the finest ball on the page
COARSEST = 12
STEEP = 0.2  # least cosine between ray and normal for comparing depth: nearer to the rim its error is unbounded
LIT = 0.05  # least cosine to each of three lights for measuring a normal
# The renderer omits highlights below half an 8-bit step. This limits the accuracy of radiance; levels of smaller
# errors are left out of the fit.
FLOOR = 4e-5
GLASS = Material(colour=(0, 0, 0), transmission=(1.0, 1.0, 1.0), ior=1.5)
# Expected order of every error in h, which the fit is compared with.
ORDERS = {
    "position": 2, "depth": 2, "normal_flat": 1, "normal_smooth": 2,
    "radiance_flat": 1, "radiance_smooth": 2, "picture_smooth": 1,
}  # fmt: skip


def main() -> None:
    """Measure, record and draw."""
    parser = command_line(__doc__)
    parser.add_argument("--finest", type=int, default=FINEST, help="segments of the finest ball")
    asked = parser.parse_args()
    levels = [s for s in (COARSEST * 2**i for i in range(10)) if s <= asked.finest]
    parts: dict[str, Callable[[], list[dict[str, Any]]]] = {
        "balls": lambda: balls(levels, preset("setup1", scale=16)),
        "ball lens": lambda: ball_lens(levels),
        "images": lambda: images(max(levels)),
    }
    keys = [{"part": part, "finest": asked.finest} for part in parts]
    RECORDS.run(keys, lambda part, finest: {"rows": parts[part]()}, asked.again)
    write_chart(chart(measured(asked.finest)), "convergence.png")


def measured(finest: int = FINEST) -> dict[str, Any]:
    """Return all rows, with the orders fitted to them."""
    parts = {row["part"]: row for row in RECORDS.rows(finest=finest)}
    rows = parts["balls"]["rows"]
    lenses = parts["ball lens"]["rows"]
    return {
        "rows": rows,
        "orders": {name: order(rows, name) for name in ORDERS},
        "expected": ORDERS,
        "lenses": lenses,
        "lens_orders": {kind: order(lenses, kind) for kind in ("flat", "smooth")},
        "images": parts["images"]["rows"],
        "parts": [row for part, row in parts.items() if part != "plano-convex lens"],
    }


def order(rows: list[dict[str, Any]], name: str, skip: int = 1) -> float:
    """Return the slope of log error over log h, without the ``skip`` coarsest levels, which are not asymptotic."""
    lowest = FLOOR if name.startswith("radiance") else 0.0
    chosen = [row for row in rows[skip:] if row[name] > lowest]
    h, error = (np.log([row[key] for row in chosen]) for key in ("h", name))
    return float(np.polyfit(h, error, 1)[0])


def balls(levels: list[int], camera: IICamera) -> list[dict[str, Any]]:
    """Root mean square errors on the still life, a row a level."""
    L, D = camera.rays()
    o, d = L.reshape(-1, 3), D.reshape(-1, 3)
    d = d / np.linalg.norm(d, axis=1, keepdims=True)
    world = still_life()
    t, which, normal = world.nearest(o, d)
    true = world.radiance(o, d)
    round_ = np.isin(which, [i for i, solid in enumerate(world.solids) if isinstance(solid, Ball)])
    (matt,) = (i for i, solid in enumerate(world.solids) if solid.name == "matt")
    rows = []
    for segments in levels:
        row: dict[str, Any] = {"segments": segments, "h": 2 * np.pi / segments}
        for kind in ("flat", "smooth"):
            scene = world.scene(segments, smooth=kind == "smooth")
            seen = trace(scene, o, d)
            names = np.array([solid.name for solid in world.solids])
            found = np.array([body.name for body in scene.bodies])[seen.object_id]
            same = (seen.object_id >= 0) & (which >= 0) & (found == names[which])
            on = same & round_
            if kind == "flat":
                p = o + ((seen.depth - o[:, 2]) / d[:, 2])[:, None] * d
                row["position"] = _rms(_off_surface(world, p[on], which[on]))
                steep = on & (-(normal * d).sum(axis=1) > STEEP)
                row["depth"] = _rms((seen.depth - (o + t[:, None] * d)[:, 2])[steep])
                row["normal_flat"] = _rms(_angle(seen.normal[on], normal[on]))
            else:
                row["normal_smooth"] = smooth_normal_error(world, segments, o, d)
            error = seen.radiance - true
            row[f"radiance_{kind}"] = _rms(error[same & (which == matt) & _unshaded(world, o, d, t, normal)])
            row[f"picture_{kind}"] = _rms(error)
            row[f"psnr_{kind}"] = -20 * float(np.log10(_rms(error)))
        rows.append(row)
    return rows


def _unshaded(world: World, o: Array, d: Array, t: Array, normal: Array) -> NDArray[np.bool_]:
    """Return the points well on the lit side of every light, where no shadow's edge lies."""
    ok = np.isfinite(t)
    for light in world.lights:
        p = o[ok] + t[ok, None] * d[ok]
        away = np.asarray(light.vector) - p if light.kind == "point" else -np.asarray(light.vector, float)
        cosine = (normal[ok] * away).sum(axis=1) / np.linalg.norm(away, axis=-1)
        ok[ok] = cosine > 0.3
    return ok


def _off_surface(world: World, p: Array, which: NDArray[np.int64]) -> Array:
    """Return the distance of points from their true spheres."""
    centres = np.array([solid.centre_mm for solid in world.solids])[which]
    radii = np.array([solid.radius_mm if isinstance(solid, Ball) else np.nan for solid in world.solids])[which]
    return np.linalg.norm(p - centres, axis=1) - radii


def smooth_normal_error(world: World, segments: int, o: Array, d: Array) -> float:
    """Return the rms angle between true and shading normals, measured by the light of three lamps on white balls.

    A red, a green and a blue light along three directions make the radiance n·l in each colour: three equations for
    the normal, independent of the renderer's support images.
    """
    towards = np.array([[0.7, 0.0, -1.0], [-0.4, 0.6, -1.0], [-0.4, -0.6, -1.0]])
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    lights = [
        Light(kind="directional", vector=tuple(-one), colour=tuple(colour))
        for one, colour in zip(towards, np.eye(3), strict=True)
    ]
    errors = []
    for solid in world.solids:
        if not isinstance(solid, Ball):
            continue
        white = Ball(solid.name, solid.centre_mm, solid.radius_mm, Material(colour=(1.0, 1.0, 1.0)))
        alone = World((white,), tuple(lights))
        t, _, normal = alone.nearest(o, d)
        seen = trace(alone.scene(segments), o, d)
        on = np.isfinite(t) & (seen.object_id >= 0) & (normal @ towards.T > LIT).all(axis=1)
        found = np.linalg.solve(towards, seen.radiance[on].astype(float).T).T
        errors.append(_angle(found, normal[on]))
    return _rms(np.concatenate(errors))


def ball_lens(levels: list[int]) -> list[dict[str, Any]]:
    """Return errors of parallel rays through a glass ball of radius 5 mm, in Gauss's focal plane, against Snell."""
    radius, centre, ior = 5.0, 20.0, GLASS.ior
    focus = ior * radius / (2 * (ior - 1))  # distance from the centre
    height = radius * np.linspace(0.05, 0.6, 12)
    o = _ring(height, 0.0)
    d = np.broadcast_to([0.0, 0.0, 1.0], o.shape)
    incident = np.arcsin(height / radius)
    bent = 2 * (incident - np.arcsin(np.sin(incident) / ior))
    spot = (height / np.sin(bent) - focus) * np.tan(bent)  # (n,) from the axis, positive on the ray's side
    true = o[:, :2] / np.repeat(height, RING)[:, None] * np.repeat(spot, RING)[:, None]
    rows = []
    for segments in levels:
        row: dict[str, Any] = {"lens": "ball", "segments": segments, "h": 2 * np.pi / segments}
        for kind in ("flat", "smooth"):
            glass = Ball("lens", (0, 0, centre), radius, GLASS).body(segments, kind == "smooth")
            row[kind] = _rms(np.linalg.norm(_spots(glass, o, d, centre + focus) - true, axis=1))
        rows.append(row)
    return rows


def images(segments: int) -> list[dict[str, Any]]:
    """Return the error of the image distance of a ball lens against Gauss: 1/a + 1/b = 1/f from its centre."""
    radius, ior = 5.0, GLASS.ior
    focal = ior * radius / (2 * (ior - 1))
    glass = Ball("lens", (0, 0, 0), radius, GLASS).body(segments, True)
    rows = []
    for far in (1.5, 2.0, 3.0, 6.0):
        object_mm = far * focal
        image = 1 / (1 / focal - 1 / object_mm)
        o = np.tile([0.0, 0.0, -object_mm], (RING, 1))
        aim = _ring(np.array([0.02 * radius]), -radius)
        d = (aim - o) / np.linalg.norm(aim - o, axis=1, keepdims=True)
        near, behind = (np.linalg.norm(_spots(glass, o, d, z), axis=1) for z in (0.8 * image, 1.2 * image))
        found = 0.8 * image + 0.4 * image * float((near / (near + behind)).mean())
        rows.append({"object_mm": object_mm, "image_mm": image, "found_mm": found, "off": found / image - 1})
    return rows


RING = 36  # rays per circle


def _ring(height: Array, z: float) -> Array:
    """Starting points on circles about the axis, at angles that avoid the edges of regular meshes."""
    angle = 2 * np.pi * (np.arange(RING) + 0.37) / RING
    around = np.column_stack([np.cos(angle), np.sin(angle)])
    points = (height[:, None, None] * around).reshape(-1, 2)
    return np.column_stack([points, np.full(len(points), z)])


def _spots(glass: Body, o: Array, d: Array, z: float) -> Array:
    """Return positions of rays on a screen behind a lens, (n, 2) mm.

    Red grows with x, green with y, blue is 1. The screen is a texture of two texels each way, because bilinear
    interpolation is exactly linear between their centres. Two bounces, in and out, exclude internal reflections. The
    transmitted share cancels in red / blue and green / blue.
    """
    half = 12.0
    texels = np.array([[[0, 1, 1], [1, 1, 1]], [[0, 0, 1], [1, 0, 1]]], np.float32)
    corners = half * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0.0]])
    uv = 0.5 + corners / (4 * half)
    uv[:, 2] = 0
    screen = Body(
        name="screen", vertices=corners + np.array([0, 0, z]), faces=np.array([[0, 2, 1], [0, 3, 2]]),
        material=Material(colour=(1.0, 1.0, 1.0), texture=Image(texels)), texture_coordinates=uv,
    )  # fmt: skip
    seen = trace(Scene(bodies=[glass, screen], ambient=(1.0, 1.0, 1.0), max_depth=2), o, d).radiance.astype(float)
    return (seen[:, :2] / seen[:, 2:] * 2 - 1) * half


def _rms(values: NDArray[np.floating[Any]]) -> float:
    return float(np.sqrt(np.mean(np.square(values, dtype=np.float64))))


def _angle(a: NDArray[np.floating[Any]], b: NDArray[np.floating[Any]]) -> Array:
    """Return angles between rows, by a formula that is well-conditioned for small angles."""
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))


def chart(result: dict[str, Any]) -> Any:
    """Draw errors of geometry, picture and lenses, each with its expected slope."""
    figure = new_figure(13, 4.4)
    geometry, picture, lens = figure.subplots(1, 3)
    rows, orders = result["rows"], result["orders"]
    segments = [row["segments"] for row in rows]
    names = {
        "position": "hit off the surface [mm]", "depth": "depth [mm]", "normal_flat": "normal of faces [rad]",
        "normal_smooth": "normal, interpolated [rad]",
    }  # fmt: skip
    for i, (name, label) in enumerate(names.items()):
        values = [row[name] for row in rows]
        label = f"{label}: $h^{{{orders[name]:.2f}}}$"
        geometry.loglog(segments, values, "o^sD"[i] + "-", color=COLOURS[i], label=label)
    geometry.set_title("balls of triangles: geometry", loc="left", fontsize=10)
    geometry.set_ylabel("root mean square error")
    for i, kind in enumerate(("flat", "smooth")):
        picture.semilogx(
            segments, [row[f"psnr_{kind}"] for row in rows], "os"[i] + "-", color=COLOURS[i],
            label=f"whole picture, {kind}",
        )  # fmt: skip
        inner = [-20 * np.log10(row[f"radiance_{kind}"]) for row in rows]
        label = f"lit side of the matt ball, {kind}: $h^{{{orders[f'radiance_{kind}']:.2f}}}$"
        picture.semilogx(segments, inner, "os"[i] + ":", color=COLOURS[i], label=label)
    picture.set_title("and the light they send, against a tracer without triangles", loc="left", fontsize=10)
    picture.set_ylabel("PSNR of linear light [dB]")
    for i, kind in enumerate(("flat", "smooth")):
        label = f"{kind}: $h^{{{result['lens_orders'][kind]:.2f}}}$"
        x = [2 * np.pi / row["h"] for row in result["lenses"]]
        lens.loglog(x, [row[kind] for row in result["lenses"]], "o" + "-:"[i], color=COLOURS[i], label=label)
    lens.set_title("ball lens of triangles: where rays end, against Snell", loc="left", fontsize=10)
    lens.set_ylabel("root mean square error at the focus [mm]")
    tidy(geometry, picture, lens)
    for axes in (geometry, picture, lens):
        axes.set_xlabel("segments around a full circle, 2π/h")
        axes.set_xticks(segments, [str(s) for s in segments])
        axes.minorticks_off()
        axes.legend(frameon=False, fontsize=8, loc="lower right" if axes is picture else "lower left")
    picture.set_ylim(bottom=0)
    geometry.set_ylim(bottom=1e-7)
    return figure
