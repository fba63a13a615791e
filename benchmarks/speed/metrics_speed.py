"""Accuracy of depth from focus and of Q_depth against CPU time.

    python -m benchmarks run metrics_speed

Times are CPU seconds of the process, which depend little on other processes. Numbers go to
``benchmarks/results/metrics_speed.jsonl``, the chart to ``docs/images/depth_pareto.png``.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.arguments import command_line
from benchmarks.pages.pictures import write_picture
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import ROOT, Records, origin, with_commits
from codec import decode, encode
from ii_core import IIPicture, preset
from ii_core.depth.layers import virtual_camera_pixels
from ii_core.display.figure import COLOURS, MARKERS, new_figure, save
from metrics import depth_from_focus, linear_layers, q_depth
from raytrace_ii import Shot, load_scene, render

RECORDS = Records("metrics_speed", ("benchmarks.speed.metrics_speed",))
FRONT = ROOT / "docs/images/depth_pareto.png"
NEAR = 0.05  # share of correct depths that the recommended setting may lose against the best
SCENES, SCALE, BPP = ("apples", "twins"), 4, 0.35  # conditions of the accuracy chart
FARTHEST = 250  # largest d of layers z = d·f


def main() -> None:
    """Measure all, print, record and draw."""
    asked = command_line(__doc__, scenes=SCENES).parse_args()
    keys = [{"accuracy": name, "scale": SCALE, "bpp": BPP} for name in asked.scenes]
    for key in RECORDS.todo(keys, asked.again):
        RECORDS.measure(key, lambda name=key["accuracy"]: {"points": accuracy(name)})
    save(draw_front(measured()), FRONT)
    write_picture(FRONT, FRONT)
    publish(tables())


def measured() -> list[dict[str, Any]]:
    """Return the newest points of all scenes."""
    return [
        {"scene": row["accuracy"], "commit": row["commit"], **point}
        for row in RECORDS.rows(scale=SCALE, bpp=BPP)
        for point in row["points"]
    ]


def tables() -> Tables:
    """Return the table of the page of speed and accuracy."""
    return {("docs/speed_accuracy.md", "evaluation"): front_table(measured())}


def accuracy(name: str) -> list[dict[str, Any]]:
    """Measure errors of depth and Q_depth and CPU time over numbers of layers, numbers of EIs and filter sizes."""
    shot = render(load_scene(name), preset("setup1", scale=SCALE), noise=1.0, support=("depth",))
    picture = shot.picture
    decoded = decode(encode(picture, "jpeg2000", bpp=BPP))
    camera = picture.camera
    assert camera is not None
    every = linear_layers(camera, FARTHEST)

    def square(side: int, step: int) -> NDArray[np.int64]:
        offsets = step * (np.arange(side) - side // 2)
        return np.stack(np.meshgrid(offsets, offsets), axis=-1).reshape(-1, 2)

    def layers(count: int) -> NDArray[np.float64]:
        return every[FARTHEST // count - 1 :: FARTHEST // count]

    sides = {n: {"base": square(n, 1), "reference": square(n, 14 // (n // 2))} for n in (3, 5, 7)}
    both = ("dissertation", "robust")
    runs = [("layers", n, m, {"layers_mm": layers(n)}) for n in (25, 50, 125, 250) for m in both]
    runs += [("EIs", 2 * n * n, "dissertation", options) for n, options in sides.items()]
    runs += [("filter", n, m, {"weights": np.ones((n, n))}) for n in (1, 3, 5, 9) for m in both]
    points = []
    for what, number, method, options in runs:
        depth_from_focus(picture, method=method, layers_mm=every[10:12])  # compiled
        started = time.process_time()
        found = depth_from_focus(picture, method=method, **options)
        seconds = time.process_time() - started
        measured = q_depth(picture, decoded, depth=found)
        points.append(
            {"what": what, "number": number, "method": method, "cpu_seconds": seconds,
             **compared(shot, decoded, found, measured)}
        )  # fmt: skip
        print(f"{name} {method} {what} {number}: {points[-1]['right']:.3f} right, {points[-1]['off_db']:.2f} dB off, "
              f"{seconds:.2f} s", flush=True)  # fmt: skip
    return points


def compared(shot: Shot, decoded: IIPicture, found: Any, measured: Any) -> dict[str, float]:
    """Return the share of depths correct within 10 %, and the error of Q_depth weighted by pixels of layers."""
    camera = shot.picture.camera
    assert camera is not None and shot.depth is not None
    z = shot.depth[virtual_camera_pixels(camera)]
    hit = np.isfinite(z) & (z < FARTHEST * camera.gap_mm)
    right = np.abs(found.depth_mm - z)[hit] < 0.1 * z[hit]
    true = q_depth(shot.picture, decoded, depth=shot.depth, layers_mm=found.layers_mm)
    held = (true.counts > 0) & (measured.counts > 0)
    off = np.abs(true.values - measured.values)[held]
    return {"right": float(right.mean()), "off_db": float(np.average(off, weights=true.counts[held]))}


def fronts(points: list[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Return the Pareto front of time and correct depths of each scene, by time."""
    found: dict[str, list[dict[str, Any]]] = {point["scene"]: [] for point in points}
    for point in sorted(points, key=lambda p: (p["cpu_seconds"], -p["right"])):
        best = found[point["scene"]]
        if not best or point["right"] > best[-1]["right"]:
            best.append(point)
    return found


def recommended(best: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the fastest setting of a front whose correct depths are near to the best."""
    return next(point for point in best if point["right"] >= best[-1]["right"] - NEAR)


def setting(point: dict[str, Any]) -> str:
    """Return the description of a setting by its changes from the default."""
    number = point["number"]
    changed = f"filter of {number}×{number}" if point["what"] == "filter" else f"{number} {point['what']}"
    return f"{point['method']}, {changed}"


def front_table(points: list[dict[str, Any]]) -> list[str]:
    """Return the fronts as a table, the recommended setting in bold."""
    lines = ["| scene | setting | correct depths | error of Q_depth | CPU time |", "|---|---|---|---|---|"]
    commits = []
    for scene, best in fronts(points).items():
        pick = recommended(best)
        for point in best:
            name = f"**{setting(point)}**" if point is pick else setting(point)
            cells = f"{point['right']:.0%} | {point['off_db']:.1f} dB | {point['cpu_seconds']:.2f} s"
            lines.append(f"| {scene} | {name} | {cells} |")
            commits.append([point["commit"]])
    size = f"`setup1` at `scale={SCALE}`, JPEG 2000 at {BPP} bit/pixel. {origin(points)}"
    return [
        size,
        "",
        *with_commits(lines, commits),
        "",
        f"Bold: the fastest setting within {100 * NEAR:.0f} percentage points of the best.",
    ]


def draw_front(points: list[dict[str, Any]]) -> Any:
    """Draw all settings of depth from focus, one panel per scene, with the front and the recommended setting."""
    figure = new_figure(8.5, 5)
    best = fronts(points)
    kinds = list(dict.fromkeys((p["what"], p["method"]) for p in points))
    for axes, (scene, edge) in zip(figure.subplots(1, len(best), squeeze=False).flat, best.items(), strict=True):
        x, y = [p["cpu_seconds"] for p in edge], [p["right"] for p in edge]
        axes.step(x, y, where="post", color="0.75", linewidth=4, zorder=1, label="Pareto front")
        for what, method in kinds:
            line = [p for p in points if (p["scene"], p["what"], p["method"]) == (scene, what, method)]
            colour = COLOURS[["layers", "EIs", "filter"].index(what)]
            marker = MARKERS[0] if method == "robust" else MARKERS[1]
            axes.plot([p["cpu_seconds"] for p in line], [p["right"] for p in line], marker, color=colour,
                      label=f"{what}, {method}", zorder=3)  # fmt: skip
            for p in line:
                axes.annotate(
                    p["number"], (p["cpu_seconds"], p["right"]), (4, 4), textcoords="offset points", fontsize=9
                )
        pick = recommended(edge)
        axes.plot(
            pick["cpu_seconds"], pick["right"], "*", color="black", markersize=18, zorder=2, label="recommended"
        )
        axes.set(title=scene, xscale="log", xlabel="CPU time [s]", ylabel="depths correct within 10 % [share]")
        axes.set_xticks([0.1, 0.2, 0.5, 1, 2], ["0.1", "0.2", "0.5", "1", "2"])
        axes.minorticks_off()
        axes.grid(True, color="0.92", linewidth=0.8)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    handles, names = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    return figure


if __name__ == "__main__":
    main()
