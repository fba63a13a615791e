"""Speed against accuracy: CPU time and error of every setting, scene by scene, and its Pareto front.

    python -m benchmarks run pareto [--scale 32] [--scenes apples,car]

The error is PSNR in 16-bit sRGB against a reference of 256 samples per pixel and 12 bounces, with triangles half as
large where the scene file sets the tessellation. Time is CPU seconds of `render` without support images, the least of
two or three. Samples per pixel, adaptive sampling, samples by edges, recursion depth and tessellation are varied. The
code of an earlier commit renders each setting that it has in turn with the present one, each in a process of its own
and against its own reference. A band of lenses stands for pictures with more rows of them. Records go to
``benchmarks/results/pareto.jsonl``, tables to ``docs/speed_accuracy.md``, charts of both scales to ``docs/images``.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.arguments import command_line
from benchmarks.pages.pictures import tidy, write_chart
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import ROOT, Records, by_scene, table
from benchmarks.speed.before import COMMIT, worktree
from benchmarks.speed.shots import Shots, shots
from benchmarks.speed.tessellation import scene_text, sizes
from ii_core import IICamera, preset
from ii_core.display.figure import COLOURS, new_figure
from raytrace_ii import load_scene
from raytrace_ii.sampling.samples import EDGES
from raytrace_ii.tracing.packing import packed

MODULES = tuple(f"benchmarks.speed.{name}" for name in ("pareto", "shots", "before", "tessellation"))
RECORDS, SCALE = Records("pareto", MODULES), 32  # scale on the page
FINE_SCALE = 4  # of which the page shows times at equal PSNR
SCENES = ("apples", "twins", "car", "cuboid", "objects", "dolphin", "hairdo", "mountains")
SAMPLES = (1, 2, 4, 9, 16)
AT_DEPTHS = (1, 4)  # samples at which other depths are tried
DEPTHS = (0, 1, 2, 3, 4, 6, 8)
ERRORS = (8.0, 4.0, 2.0, 1.0, 0.5)  # of adaptive sampling between LEAST and MOST, steps of 8 bits
LEAST, MOST = 4, 16
EDGE_ERRORS = (8.0, 4.0, 2.0, 1.0)  # of samples by edges, which the earlier code has not
FINER = 2.0  # tessellation of the reference
CUTS = (0.25, 0.5, 1.0, FINER)
TRUE = {"samples": 256, "depth": 12}
TRUE_SEED = 1  # not that of the settings: their samples would be among the reference's
BAND = 8  # rows of lenses
SENSOR_DB = 47.5  # PSNR of the sensor's own noise of one 8-bit step
BASE = 4  # samples at which depth and cut are compared


def main() -> None:
    """Measure, print, record, draw and fill the page."""
    asked = command_line(__doc__, scale=SCALE, scenes=SCENES).parse_args()
    camera = band(preset("setup1", scale=asked.scale))
    keys = [{"scene": name, "scale": asked.scale} for name in asked.scenes]
    for key in RECORDS.todo(keys, asked.again):
        record = RECORDS.measure(key, lambda key=key: both(key["scene"], camera))
        best = record["result"]["recommended"]
        print(f"{key['scene']}: {best['setting']}, {best['psnr']:.1f} dB, {record['seconds']:.0f} s", flush=True)
    for scale, target in ((SCALE, "pareto.png"), (FINE_SCALE, "pareto_fine.png")):
        if set(scenes := measured(scale)) == set(SCENES):
            write_chart(chart(scenes), target, dpi=150)
    if set(measured()) == set(SCENES):
        publish(tables())


def measured(scale: int = SCALE) -> dict[str, Any]:
    """Return the newest row of every scene at a scale, in the order of SCENES."""
    return RECORDS.by("scene", SCENES, scale=scale)


def tables() -> Tables:
    """Return the tables of the page."""
    data, camera = measured(), preset("setup1", scale=SCALE)
    (k, l), (m, n) = camera.lenses, camera.pixels
    page = "docs/speed_accuracy.md"
    return {
        (page, "size"): [
            f"`setup1` at `scale={SCALE}`: {m}×{n} pixels, {k}×{l} lenses. The reference has "
            f"{' or '.join(sorted({str(one.get('truth_samples', 64)) for one in data.values()}))} samples per pixel.",
            by_scene(data),
        ],
        (page, "fronts"): fronts_table(data, measured(FINE_SCALE)),
        (page, "recommended"): recommended_table(data),
        (page, "samples"): samples_table(data),
        (page, "edges"): edges_table(data),
        (page, "depth"): depth_table(data),
        (page, "cut"): cut_table(data),
    }


def band(camera: IICamera) -> IICamera:
    """Return the camera of the middle rows of lenses; the camera itself if it has no more than BAND."""
    (columns, rows), (across, down) = camera.pixels, camera.lenses
    if down <= BAND:
        return camera
    height = rows // down
    shift = (rows / 2 - ((down - BAND) // 2 + BAND / 2) * height) * camera.pixel_pitch_mm
    x, y, z = camera.origin_mm
    return replace(
        camera, name="band", pixels=(columns, BAND * height), lenses=(across, BAND), origin_mm=(x, y + shift, z)
    )


def both(name: str, camera: IICamera) -> dict[str, Any]:
    """Return the study of one scene, with that of the earlier code as ``before``: each setting by both in turn."""
    cuts = [*CUTS] if sizes(scene_text(name)) else [1.0]
    start = name, json.dumps(camera.to_json()), cuts
    with shots(ROOT, *start) as (now, facts), shots(worktree(), *start) as (before, _):
        studies = study(name, facts, (now, before))
    return {**studies[0], "before": studies[1]}


def speedup(one: dict[str, Any]) -> float:
    """Return how many times faster the front reaches the PSNR of the earlier code's recommended setting.

    Between two settings of the front the logarithm of the time is interpolated: numbers of samples and errors lie
    between theirs, too. NaN if no setting reaches the PSNR.
    """
    aim = one["before"]["recommended"]
    psnr, seconds = np.array([[one["rows"][i][name] for i in one["front"]] for name in ("psnr", "seconds")])
    if aim["psnr"] > psnr.max():
        return math.nan
    up = np.argsort(psnr)
    return float(aim["seconds"] / np.exp(np.interp(aim["psnr"], psnr[up], np.log(seconds[up]))))


def study(name: str, facts: dict[str, Any], codes: Sequence[Shots]) -> list[dict[str, Any]]:
    """Return the results of all settings of one scene, by each code; references first."""
    most_depth, cuts = facts["max_depth"], [float(cut) for cut in facts["faces"]]
    scene = packed(load_scene(name))
    bounces = scene.mirrors or scene.transmits
    repeats_to = []
    for options in ({"samples": TRUE["samples"], "seed": TRUE_SEED}, {"samples": 64, "seed": TRUE_SEED + 1}):
        repeats_to = [shoot(cut=max(cuts), depth=TRUE["depth"], repeats=1, options=options)[1] for shoot in codes]
    rows: list[list[dict[str, Any]]] = [[] for _ in codes]
    for sweep, cut, depth, samples, error in settings(most_depth, bounces, cuts):
        how: dict[str, Any] = {"samples": (LEAST, samples) if sweep == "adaptive" else samples}
        how |= {"error": error} if error is not None else {}
        shown = {"sweep": sweep, "samples": samples, "depth": depth if bounces else 0, "error": error, "cut": cut}
        for shoot, found in zip(codes[: 1 if sweep == "edges" else None], rows, strict=False):
            seconds, psnr = shoot(
                cut=cut, depth=depth, repeats=3 if samples in (1, 2) else 2, options={**how, "workers": 1}
            )
            found.append({**shown, "seconds": seconds, "psnr": psnr})
    return [
        {
            **facts, "bounces": bounces, "truth_samples": TRUE["samples"], "truth_repeats_to": repeats, "rows": found,
            "front": (best := front(found)), "recommended": recommended([found[i] for i in best]),
        }
        for repeats, found in zip(repeats_to, rows, strict=True)
    ]  # fmt: skip


def settings(
    most_depth: int, bounces: bool, cuts: Sequence[float]
) -> Iterator[tuple[str, float, int, int | str, float | None]]:
    """Yield sweep, tessellation, depth, samples and error of every setting; with an error, the most samples."""
    for depth in sorted({*DEPTHS, most_depth}) if bounces else (most_depth,):
        for samples in SAMPLES if depth == most_depth else AT_DEPTHS:
            yield "samples" if depth == most_depth else "depth", 1.0, depth, samples, None
    for error in ERRORS:
        yield "adaptive", 1.0, most_depth, MOST, error
    for error in EDGE_ERRORS:
        yield "edges", 1.0, most_depth, EDGES, error
    for cut in cuts:
        if cut != 1:
            yield "cut", cut, most_depth, BASE, None


def front(rows: Sequence[dict[str, Any]]) -> list[int]:
    """Return the Pareto front of time and error, by time."""
    best: list[int] = []
    for i in sorted(range(len(rows)), key=lambda i: (rows[i]["seconds"], -rows[i]["psnr"])):
        if not best or rows[i]["psnr"] > rows[best[-1]]["psnr"]:
            best.append(i)
    return best


def recommended(best: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the fastest setting of a front below sensor noise, else within 1 dB of the best."""
    good = [row for row in best if row["psnr"] >= SENSOR_DB]
    near = [row for row in best if row["psnr"] >= best[-1]["psnr"] - 1]
    pick, rule = (good[0], "below the sensor's noise") if good else (near[0], "within 1 dB of the best")
    return {**pick, "rule": rule, "setting": setting(pick)}


def setting(row: dict[str, Any]) -> str:
    """Return the description of a setting."""
    if row["samples"] == EDGES:
        return f"edges, error {row['error']:g}"
    how = f"{LEAST} to {MOST} samples, error {row['error']:g}" if row["error"] else f"{row['samples']} samples"
    how = how.replace("1 samples", "1 sample") if row["samples"] == 1 else how
    return how + (f", depth {row['depth']}" if row["depth"] else "") + (f", cut ×{row['cut']:g}" * (row["cut"] != 1))


SWEEPS = {"samples": "o", "adaptive": "D", "edges": "^", "depth": "v", "cut": "s"}
OLD, NEW = ("0.8", 4), ("0.35", 2)  # grey level and line width of fronts
NAMES = {
    "samples": "1, 2, 4, 9, 16 samples", "adaptive": f"adaptive, {LEAST} to {MOST} samples",
    "edges": "edges, error 16 to 2", "depth": "other recursion depths",
    "cut": f"triangles × ¼, ½, {FINER:g}, {BASE} samples",
}  # fmt: skip


def chart(data: dict[str, Any]) -> Any:
    """Draw one panel per scene."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    figure = new_figure(8.5, 12)
    for axes, (name, one) in zip(figure.subplots(4, 2).flat, data.items(), strict=True):
        rows = one["rows"]
        best = [rows[i] for i in one["front"]]
        earlier = [one["before"]["rows"][i] for i in one["before"]["front"]] if "before" in one else []
        for steps, (color, width) in ((earlier, OLD), (best, NEW)):
            axes.step(
                [r["seconds"] for r in steps], [r["psnr"] for r in steps], where="post", color=color, linewidth=width,
                zorder=1,
            )  # fmt: skip
        for i, (sweep, marker) in enumerate(SWEEPS.items()):
            chosen = [r for r in rows if r["sweep"] == sweep]
            joined = "-" if sweep in ("samples", "adaptive", "edges") else ""
            axes.plot(
                [r["seconds"] for r in chosen], [r["psnr"] for r in chosen], marker + joined, color=COLOURS[i],
                markersize=4 if sweep == "depth" else 6, linewidth=1, label=NAMES[sweep],
                zorder=2 if sweep == "depth" else 3,
            )  # fmt: skip
        pick = one["recommended"]
        axes.plot(pick["seconds"], pick["psnr"], "*", color="black", markersize=15, zorder=4, label="recommended")
        axes.axhline(SENSOR_DB, color="0.4", linestyle=":", linewidth=1)
        axes.set_title(f"{name}: {pick['setting']}", loc="left", fontsize=9)
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(base=10, subs=(1, 2, 5)))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
    tidy(*figure.axes)
    for axes in figure.axes[6:]:
        axes.set_xlabel("CPU time [s]")
    for axes in figure.axes[::2]:
        axes.set_ylabel("PSNR [dB]")
    handles = {label: h for axes in figure.axes for h, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    for label, (color, width) in ((f"Pareto front of {COMMIT}", OLD), ("Pareto front", NEW)):
        handles[label] = figure.axes[0].plot([], [], color=color, linewidth=width)[0]
    figure.legend(
        [*handles.values()], [*handles], loc="outside lower center", ncols=3, frameon=False, fontsize=9
    )  # fmt: skip
    return figure


def fronts_table(data: dict[str, Any], fine: dict[str, Any]) -> list[str]:
    """Return the factors between the CPU times of the earlier and the present code at equal PSNR."""
    if not all("before" in one for one in data.values()):
        return [f"`{COMMIT}` is not measured."]
    scales = {SCALE: data, **({FINE_SCALE: fine} if set(fine) == set(data) else {})}
    lines = [
        f"| scene | PSNR | {' | '.join(f'faster at scale {s}' for s in scales)} |",
        "|---" * (2 + len(scales)) + "|",
    ]
    for name, one in data.items():
        factors = " | ".join(_factor(speedup(rows[name])) for rows in scales.values())
        lines.append(f"| {name} | {one['before']['recommended']['psnr']:.1f} dB | {factors} |")
    means = " | ".join(_factor(_mean([speedup(one) for one in rows.values()])) for rows in scales.values())
    lines.append(f"| geometric mean | | {means} |")
    if FINE_SCALE in scales:
        (columns, rows), commits = band(preset("setup1", scale=FINE_SCALE)).pixels, by_scene(fine)
        lines += [
            "",
            f"At scale {FINE_SCALE}, pictures are the middle {BAND} rows of lenses ({columns}×{rows}). {commits}",
        ]
    return lines


def _factor(times: float) -> str:
    return f"{times:.2f}" if math.isfinite(times) else "not reached"


def _mean(times: Sequence[float]) -> float:
    """Return the geometric mean; NaN if one is."""
    return math.exp(sum(map(math.log, times)) / len(times))


def recommended_table(data: dict[str, Any]) -> list[str]:
    """Return the recommended setting of every scene, in bold below sensor noise, beside one sample per pixel."""
    lines = []
    for name, one in data.items():
        pick = one["recommended"]
        (first,) = [r for r in one["rows"] if r["sweep"] == "samples" and r["samples"] == 1]
        how = f"**{pick['setting']}**" if pick["psnr"] >= SENSOR_DB else pick["setting"]
        lines.append(
            f"{name} | {how} | {pick['psnr']:.1f} dB | {pick['seconds']:.2f} s | "
            f"{first['psnr']:.1f} dB, {first['seconds']:.2f} s"
        )
    return table("scene | setting | PSNR | CPU time | one sample", lines)


def samples_table(data: dict[str, Any]) -> list[str]:
    """Return PSNR over samples, and the adaptive setting nearest to the largest number."""
    lines = []
    for name, one in data.items():
        plain = {r["samples"]: r for r in one["rows"] if r["sweep"] == "samples"}
        (fine,) = [r for r in one["rows"] if r["error"] == min(ERRORS)]
        share = fine["seconds"] / plain[MOST]["seconds"]
        lines.append([name, *(f"{plain[s]['psnr']:.1f}" for s in SAMPLES), f"{fine['psnr']:.1f}", f"{share:.2f}"])
    return table(" | ".join(["scene", *map(str, SAMPLES), f"adaptive to ½ step | its time / {MOST} samples"]), lines)


def edges_table(data: dict[str, Any]) -> list[str]:
    """Return PSNR and time of samples by edges, and how many times longer fixed sets take to the same PSNR."""
    lines = []
    for name, one in data.items():
        sets = sorted((r["psnr"], math.log(r["seconds"])) for r in one["rows"] if r["sweep"] == "samples")
        cells = []
        for row in (r for r in one["rows"] if r["sweep"] == "edges"):
            inside = sets[0][0] <= row["psnr"] <= sets[-1][0]
            factor = math.exp(np.interp(row["psnr"], *zip(*sets, strict=True))) / row["seconds"]
            cells.append(f"{row['psnr']:.1f}, {row['seconds']:.2f}, {f'{factor:.2f}' if inside else '–'}")
        if cells:
            lines.append([name, *cells])
    if not lines:
        return ["Samples by edges are not measured."]
    return table(" | ".join(["scene", *(f"error {error:g}" for error in EDGE_ERRORS)]), lines)


def depth_table(data: dict[str, Any]) -> list[str]:
    """Return PSNR and time over recursion depth, at BASE samples, of scenes with mirrors or glass."""
    lines = []
    for name, one in data.items():
        if one["bounces"]:
            at = {r["depth"]: r for r in one["rows"] if r["samples"] == BASE and r["sweep"] in ("samples", "depth")}
            cells = " | ".join(f"{at[d]['psnr']:.1f}, {at[d]['seconds']:.2f}" for d in DEPTHS)
            lines.append(f"{name} | {cells} | {one['max_depth']}")
    return table(" | ".join(["scene", *map(str, DEPTHS), "the scene's"]), lines)


def cut_table(data: dict[str, Any]) -> list[str]:
    """Return faces, PSNR and time over tessellation, at BASE samples."""
    lines = []
    for name, one in data.items():
        if len(one["faces"]) == 1:
            continue
        cells = []
        for cut in CUTS:
            rows = [r for r in one["rows"] if r["cut"] == cut and r["samples"] == BASE and r["error"] is None]
            (row,) = [r for r in rows if r["sweep"] in ("samples", "cut")]
            cells.append(f"{one['faces'][str(cut)] / 1e3:.0f}, {row['psnr']:.1f}, {row['seconds']:.2f}")
        lines.append([name, *cells])
    return table(" | ".join(["scene", *(f"×{cut:g}" for cut in CUTS)]), lines)
