"""Ablation of scene features: loss of quality and saved time without each feature, and the cheapest adequate model.

    python -m benchmarks run feature_ablation [--scale 16] [--scenes apples,car] [--rounds 5]

Every picture is compared with the full picture of the same samples in 16 bits. A picture is *indistinguishable* if it
differs no more than the 8-bit picture of the reference set with sensor noise of one step. The criteria are PSNR, SSIM
of the worst of five views, and the 99.9th percentile of the error; the last detects small distant details, which
averages hide. Features are left out in the order of the time that they save, as long as the picture stays
indistinguishable. CPU time is the median over rounds in which every model is rendered once. Numbers go to
``benchmarks/results/feature_ablation.jsonl``, tables and chart to ``docs/speed_accuracy.md``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import zoom

from benchmarks.arguments import command_line
from benchmarks.pages.pictures import write_picture
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import ROOT, Records, by_scene
from benchmarks.speed.pareto import BASE, SCENES, at_depth, cut_scene, scene_text, sizes
from ii_core import IICamera, IIPicture, add_sensor_noise, preset
from ii_core.display.figure import COLOURS, new_figure, save
from ii_core.picture.component import picture_pixels
from metrics import q_global, q_view
from raytrace_ii import Body, Scene, Shot, render
from raytrace_ii.scene.textures import Checker, Image, Noise, Stripes, VertexColours
from raytrace_ii.tracing.intersect import Hits
from raytrace_ii.tracing.packing import packed

RECORDS = Records("feature_ablation", ("benchmarks.speed.feature_ablation", "benchmarks.speed.pareto"))
CHART = ROOT / "docs/images/feature_ablation.png"
PAGE, SCALE, ROUNDS = "docs/speed_accuracy.md", 16, 5
RARE = 0.999  # quantile of the error
SHADOWS, FILTER = "shadows", "texture filtering"
DEPTH, CUT = "bounces beyond {}", "triangles, × {:g}"
CUTS = (0.25, 0.5)


def main() -> None:
    """Measure, record, and fill the page if all scenes have records."""
    parser = command_line(__doc__, scale=SCALE, scenes=SCENES)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    asked = parser.parse_args()
    keys = [{"scene": name, "scale": asked.scale, "rounds": asked.rounds} for name in asked.scenes]
    for key in RECORDS.todo(keys, asked.again):
        record = RECORDS.measure(key, lambda key=key: study(key["scene"], key["scale"], key["rounds"]))
        least = record["result"]["least"]
        print(f"{key['scene']}: without {', '.join(least['without']) or 'nothing'}, {least['time']:+.0%}, "
              f"{record['seconds']:.0f} s", flush=True)  # fmt: skip
    if set(scenes := measured()) == set(SCENES):
        save(draw(scenes), CHART)
        write_picture(CHART, CHART)
        publish(tables())


def measured() -> dict[str, Any]:
    """Return the newest row of every scene at the page's scale, in the order of SCENES."""
    return RECORDS.by("scene", SCENES, scale=SCALE, rounds=ROUNDS)


def study(name: str, scale: int, rounds: int) -> dict[str, Any]:
    """Measure one scene: its features, their effects, and the cheapest model."""
    camera, parts = preset("setup1", scale=scale), has(name)
    models = [build(name, without) for without in ((), *((part,) for part in parts))]
    full, *others = (shoot(model, camera) for model in models)
    limit = compared(full.picture, noisy(full.picture))
    spent = seconds(models, camera, rounds)
    left_out: list[dict[str, Any]] = [
        {"what": part, **compared(full.picture, shot.picture)} for part, shot in zip(parts, others, strict=True)
    ]
    for row, ratio in zip(left_out, spent[1:], strict=True):
        row["time"] = None if row["what"] == FILTER else ratio / spent[0] - 1  # the same kernel runs without it
    least = least_model(name, camera, full.picture, left_out, limit)
    whole, rest = seconds([models[0], build(name, least["without"])], camera, rounds)
    least["time"] = rest / whole - 1
    rays = {kind: count / full.stats.rays["primary"] for kind, count in full.stats.rays.items() if count}
    return {
        "rays": rays, "uses": uses(models[0]), "limit": limit, "left_out": left_out, "least": least,
        "fewer": fewer(models[0], scale, full.picture, rounds),
    }  # fmt: skip


def has(name: str) -> list[str]:
    """Return the features of a scene that can be left out."""
    scene = build(name, ())
    bounces = packed(scene).mirrors or packed(scene).transmits
    return [
        *([SHADOWS] if scene.lights else []),
        *(part for part, without in WITHOUT.items() if without(scene) is not scene),
        *([DEPTH.format(depth) for depth in range(scene.max_depth)] if bounces else []),
        *([CUT.format(cut) for cut in CUTS] if sizes(scene_text(name)) else []),
    ]


def uses(scene: Scene) -> dict[str, int]:
    """Return the number of bodies by feature."""
    materials = [body.material for body in scene.bodies]
    return {
        "textures": sum(m.texture is not None for m in materials),
        "normal maps": sum(m.normal_map is not None for m in materials),
        "highlights": sum(m.specular > 0 for m in materials),
        "mirrors": sum(max(m.mirror) > 0 for m in materials),
        "glass": sum(m.transmissive for m in materials),
        "smooth normals": sum(body.normals is not None for body in scene.bodies),
        "cut-outs": sum(m.alpha_cutoff > 0 for m in materials),
        "bodies": len(materials),
        "lights": len(scene.lights),
        "fog": int(scene.fog is not None),
    }


def build(name: str, without: Sequence[str]) -> Scene:
    """Return a reference scene without some features, removed in the order that permits all combinations."""
    cut = min([cut for cut in CUTS if CUT.format(cut) in without], default=1.0)
    scene = loaded(name, cut)
    for part, leave_out in WITHOUT.items():
        scene = leave_out(scene) if part in without else scene
    depths = [depth for depth in range(scene.max_depth) if DEPTH.format(depth) in without]
    scene = at_depth(scene, min(depths)) if depths else scene
    return unshadowed(scene) if SHADOWS in without else scene


loaded = lru_cache(maxsize=len(CUTS) + 1)(cut_scene)


def unshadowed(scene: Scene) -> Scene:
    """Return the scene without shadows: no shadow ray is traced."""
    free = replace(scene)  # a copy with a tree of its own
    none = np.empty(0, np.float32)

    def blocked(o: NDArray[Any], *_: Any) -> tuple[NDArray[np.int32], float]:
        return np.full(len(o), -1, np.int32), 0.0

    def clear(o: NDArray[Any]) -> tuple[Hits, float]:
        return Hits(np.full(len(o), -1, np.int32), none, none, none), 0.0

    vars(packed(free).intersector)["blocked"] = blocked
    if packed(scene).lets_through:
        # camera rays still need the body in which they start
        found = packed(free).intersector.nearest_clear
        vars(packed(free).intersector)["nearest_clear"] = lambda o, d, reach=None: (
            found(o, d) if reach is None else clear(o)
        )
    return free


def _bodies(change: Callable[[Body], Body]) -> Callable[[Scene], Scene]:
    """Return the scene with a change of every body; the same scene if nothing changes."""

    def changed(scene: Scene) -> Scene:
        bodies = [change(body) for body in scene.bodies]
        return (
            replace(scene, bodies=bodies)
            if any(a is not b for a, b in zip(bodies, scene.bodies, strict=True))
            else scene
        )

    return changed


def _plain(body: Body) -> Body:
    """Return a body with the mean colour of its texture."""
    texture = body.material.texture
    if texture is None:
        return body
    mean = np.asarray(body.material.colour) * mean_colour(texture, body.texture_coordinates)
    return replace(body, material=replace(body.material, texture=None, colour=tuple(mean), alpha_cutoff=0.0))


def mean_colour(texture: Any, coordinates: Any) -> NDArray[np.float64]:
    """Return the linear mean of an image, of two colours, or of vertex colours."""
    if isinstance(texture, Image):
        return texture.pixels.mean(axis=(0, 1), dtype=np.float64)
    if isinstance(texture, VertexColours):
        return np.asarray(coordinates, np.float64).mean(axis=0)
    assert isinstance(texture, Checker | Stripes | Noise)
    return np.mean(texture.colours, axis=0)


def _unfiltered(body: Body) -> Body:
    """Repeat texels 8 × 8: bilinear interpolation remains on an eighth of their width."""
    texture = body.material.texture
    if not isinstance(texture, Image):
        return body
    codes = None if texture.codes is None else texture.codes.repeat(8, axis=0).repeat(8, axis=1)
    blocks = replace(texture, pixels=texture.pixels.repeat(8, axis=0).repeat(8, axis=1), codes=codes)
    return replace(body, material=replace(body.material, texture=blocks))


def _matt(body: Body) -> Body:
    return replace(body, material=replace(body.material, specular=0.0)) if body.material.specular > 0 else body


def _unmapped(body: Body) -> Body:
    return replace(body, material=replace(body.material, normal_map=None)) if body.material.normal_map else body


WITHOUT: dict[str, Callable[[Scene], Scene]] = {
    "highlights": _bodies(_matt),
    "textures": _bodies(_plain),
    FILTER: _bodies(_unfiltered),
    "normal maps": _bodies(_unmapped),
    "smooth normals": _bodies(lambda body: body if body.normals is None else replace(body, normals=None)),
    "fog": lambda scene: replace(scene, fog=None) if scene.fog else scene,
}


def shoot(scene: Scene, camera: IICamera) -> Shot:
    return render(scene, camera, samples=BASE, dtype="uint16", support=(), workers=1)


def seconds(scenes: Sequence[Scene], camera: IICamera, rounds: int) -> list[float]:
    """Return the median CPU seconds of each model, interleaved so that other load affects all alike."""
    for scene in scenes:
        packed(scene)  # trees are built once and not counted
    spent = [[shoot(scene, camera).stats.cpu_seconds for scene in scenes] for _ in range(rounds)]
    return [median(times) for times in zip(*spent, strict=True)]


def noisy(picture: IIPicture) -> IIPicture:
    """Return a 16-bit picture as in the reference set: rounded to 8 bits, with sensor noise of one step."""
    coded = picture.with_pixels(np.rint(picture.pixels / 257).astype(np.uint8))
    return picture.with_pixels(add_sensor_noise(coded, 1.0, seed=1).pixels.astype(np.uint16) * np.uint16(257))


def compared(full: IIPicture, other: IIPicture) -> dict[str, float]:
    """Return PSNR, mean and worst SSIM of five views, and the 99.9th percentile of the error in 8-bit steps."""
    views = q_view(full, other)
    error = np.abs(full.pixels.astype(np.int32) - other.pixels).max(axis=2) / 257
    rare = float(np.quantile(error, RARE))
    return {"psnr": q_global(full, other), "q_view": views.mean, "worst": views.worst, "rare": rare}


def alike(found: dict[str, float], limit: dict[str, float]) -> bool:
    """Return whether a picture is indistinguishable from the full one."""
    good = found["psnr"] >= limit["psnr"] and found["worst"] >= limit["worst"]
    return bool(good and found["rare"] <= limit["rare"])


def least_model(
    name: str, camera: IICamera, full: IIPicture, left_out: Sequence[dict[str, Any]], limit: dict[str, float]
) -> dict[str, Any]:
    """Return the features that can be left out together, greatest saving first, and the result."""
    without: list[str] = []
    found = compared(full, full)
    tried = [row for row in left_out if row["time"] is not None and alike(row, limit)]
    for row in sorted(tried, key=lambda row: row["time"]):
        more = [*without, row["what"]]
        then = compared(full, shoot(build(name, more), camera).picture)
        if alike(then, limit):
            without, found = more, then
    return {"without": _strongest(without), **found}


def _strongest(without: Sequence[str]) -> list[str]:
    """Return features without implied ones: fewest bounces imply fewer, the coarsest cut a coarser one."""
    depths = [DEPTH.format(depth) for depth in range(99) if DEPTH.format(depth) in without]
    cuts = [CUT.format(cut) for cut in sorted(CUTS) if CUT.format(cut) in without]
    return [part for part in without if part not in depths[1:] and part not in cuts[1:]]


def fewer(scene: Scene, scale: int, full: IIPicture, rounds: int) -> list[dict[str, Any]]:
    """Return pictures with half the lenses, or half the pixels of an elementary image, scaled back."""
    camera, lenses = preset("setup1", scale=scale), preset("setup1", scale=2 * scale)
    pixels = replace(camera, pixels=tuple(n // 2 for n in camera.pixels), pixel_pitch_mm=2 * camera.pixel_pitch_mm)
    rows = []
    for what, small, axes in (("lenses", lenses, (0, 1)), ("pixels a lens", pixels, (2, 3))):
        times = [[shoot(scene, one).stats.cpu_seconds for one in (small, camera)] for _ in range(rounds)]
        spent = median(a for a, _ in times) / median(b for _, b in times) - 1
        picture = shoot(scene, small).picture
        for kind in ("nearest", "linear"):
            back = full.with_pixels(enlarged(picture, axes, linear=kind == "linear"))
            rows.append({"what": what, "by": kind, **compared(full, back), "time": spent})
    return rows


def enlarged(picture: IIPicture, axes: tuple[int, int], *, linear: bool) -> NDArray[Any]:
    """Return pixels with twice the lenses (axes 0, 1 of the light field) or pixels per lens (axes 2, 3) per axis."""
    field = picture.light_field
    if linear:
        factors = [2 if axis in axes else 1 for axis in range(5)]
        field = np.rint(zoom(field.astype(np.float32), factors, order=1, mode="nearest", grid_mode=True))
    else:
        for axis in axes:
            field = field.repeat(2, axis=axis)
    return picture_pixels(field.astype(picture.pixels.dtype), "ei")


def tables() -> Tables:
    """Return the tables of the records."""
    scenes, camera = measured(), preset("setup1", scale=SCALE)
    (k, l), (m, n) = camera.lenses, camera.pixels
    size = f"`setup1` at `scale={SCALE}`: {m}×{n} pixels, {k}×{l} lenses, {BASE} samples per pixel."
    return {
        (PAGE, "ablation-size"): [size, by_scene(scenes)],
        (PAGE, "uses"): uses_table(scenes),
        (PAGE, "least"): least_table(scenes),
        (PAGE, "ablation"): ablation_table(scenes),
        (PAGE, "fewer"): fewer_table(scenes),
    }


def uses_table(scenes: dict[str, Any]) -> list[str]:
    """Return the rays per camera ray by kind."""
    kinds = ("shadow", "reflection", "refraction")
    lines = [f"| scene | {' | '.join(kinds)} |", "|---" * (len(kinds) + 1) + "|"]
    for name, one in scenes.items():
        rays = [f"{one['rays'][kind]:.2f}" if kind in one["rays"] else "–" for kind in kinds]
        lines.append(f"| {name} | {' | '.join(rays)} |")
    return lines


def least_table(scenes: dict[str, Any]) -> list[str]:
    """Return the limits and the cheapest model of every scene that can do without a feature."""
    lines = [
        "| scene | features left out | PSNR | SSIM, worst view | error of the 99.9th percentile | CPU time |",
        "|---" * 6 + "|",
    ]
    for name, one in scenes.items():
        least, limit = one["least"], one["limit"]
        if least["without"]:
            db = "the same" if least["psnr"] is None else f"{least['psnr']:.1f} dB"
            lines.append(
                f"| {name} | {', '.join(least['without'])} | {db} (≥ {limit['psnr']:.1f}) | {least['worst']:.4f} "
                f"(≥ {limit['worst']:.4f}) | {least['rare']:.1f} steps (≤ {limit['rare']:.1f}) | "
                f"{percent(least['time'])} |"
            )
    return lines


def ablation_table(scenes: dict[str, Any]) -> list[str]:
    """Return a table of features by scenes: PSNR in dB, SSIM, time in %; indistinguishable ones in bold.

    Bounces and triangles are in the chart, and in tables of `benchmarks.speed.pareto`.
    """
    parts = [row["what"] for one in scenes.values() for row in one["left_out"]]
    lines = [f"| without | {' | '.join(scenes)} |", "|---" * (len(scenes) + 1) + "|"]
    for part in sorted({*parts} & {SHADOWS, *WITHOUT}, key=_place):
        cells = []
        for one in scenes.values():
            row = next((row for row in one["left_out"] if row["what"] == part), None)
            cells.append("–" if row is None else cell(row, one["limit"]))
        lines.append(f"| {part} | {' | '.join(cells)} |")
    return lines


def _place(part: str) -> tuple[int, str]:
    order = [SHADOWS, *WITHOUT]
    return (order.index(part) if part in order else len(order), part)


def cell(row: dict[str, Any], limit: dict[str, float]) -> str:
    db = "same" if row["psnr"] is None else f"{row['psnr']:.1f}"
    text = f"{db}, {row['q_view']:.3f}" + ("" if row["time"] is None else f", {percent(row['time']).rstrip(' %')}")
    return f"**{text}**" if row["psnr"] is None or alike(row, limit) else text


def percent(share: float) -> str:
    return f"{100 * share:+.0f} %".replace("-", "−")


def fewer_table(scenes: dict[str, Any]) -> list[str]:
    """Return the table of half the lenses and half the pixels, ranges over the scenes."""
    rows = [(row["what"], row["by"]) for row in next(iter(scenes.values()))["fewer"]]
    lines = ["| half the | PSNR, dB | SSIM | CPU time, % |", "|---|---|---|---|"]
    for i, (what, by) in enumerate(rows):
        found = [one["fewer"][i] for one in scenes.values()]
        psnr, ssim = ([row[key] for row in found] for key in ("psnr", "q_view"))
        time = [f"{100 * end(row['time'] for row in found):+.0f}".replace("-", "−") for end in (min, max)]
        cells = f"{min(psnr):.1f} to {max(psnr):.1f} | {min(ssim):.3f} to {max(ssim):.3f} | {' to '.join(time)}"
        lines.append(f"| {what}, {by} | {cells} |")
    return lines


def draw(scenes: dict[str, Any]) -> Any:
    """Draw one panel per scene: error without each feature against the saved time."""
    figure = new_figure(8.5, 13)
    for axes, (name, one) in zip(figure.subplots(4, 2).flat, scenes.items(), strict=True):
        rows = sorted(one["left_out"], key=lambda row: _place(row["what"]), reverse=True)
        limit = one["limit"]["psnr"]
        top = limit + 25  # identical pictures have infinite PSNR: draw them at the edge
        x = [top if row["psnr"] is None else min(row["psnr"], top) for row in rows]
        good = [row["psnr"] is None or alike(row, one["limit"]) for row in rows]
        for y, (at, fine, row) in enumerate(zip(x, good, rows, strict=True)):
            axes.plot([0, at], [y, y], color="0.88", linewidth=1, zorder=1)
            axes.plot(at, y, "o", color=COLOURS[2 if fine else 1], markersize=7, zorder=3)
            saved = "" if row["time"] is None else percent(row["time"])
            axes.annotate(saved, (top + 3, y), va="center", fontsize=9, annotation_clip=False)
        axes.axvline(limit, color="0.4", linestyle=":", linewidth=1)
        axes.set_yticks(range(len(rows)), [row["what"] for row in rows], fontsize=9)
        axes.set_xlim(0, top + 1)
        axes.set_title(name, loc="left", fontsize=11)
        axes.set_title("CPU time", loc="right", fontsize=9)
        axes.spines[["top", "right"]].set_visible(False)
    for axes in figure.axes[6:]:
        axes.set_xlabel("PSNR against the full picture [dB]")
    for fine, label in ((2, "indistinguishable"), (1, "visible")):
        figure.axes[0].plot([], [], "o", color=COLOURS[fine], label=label)
    figure.axes[0].plot([], [], color="0.4", linestyle=":", label="the sensor's noise")
    handles, names = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=3, frameon=False)
    return figure


if __name__ == "__main__":
    main()
