"""CPU time of the metrics at the full size of setup1 (33.5 Mpixel), and Q_depth accuracy against time.

    python -m benchmarks run metrics_speed

Times are CPU seconds of the process, which depend little on other processes. Memory is the peak of numpy's
allocations during a call, beyond the two pictures; for Q_depth it is the growth of the process. Numbers go to
``benchmarks/results/metrics_speed.jsonl``, the chart to ``docs/images/depth_cost.png``.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skimage.metrics import structural_similarity

from benchmarks.arguments import command_line
from benchmarks.pages.pictures import write_picture
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import ROOT, Records, origin, with_commits
from codec import decode, encode
from ii_core import IIPicture, five_viewpoints, preset
from ii_core.depth.virtual_camera import virtual_camera_pixels
from ii_core.display.figure import COLOURS, MARKERS, new_figure, save
from metrics import depth_from_focus, linear_layers, q_angle, q_depth, q_global, q_view
from metrics.measures.view import LUMA, view_pair
from raytrace_ii import Shot, load_scene, render

RECORDS = Records("metrics_speed", ("benchmarks.speed.metrics_speed",))
CHART, FRONT = ROOT / "docs/images/depth_cost.png", ROOT / "docs/images/depth_pareto.png"
NEAR = 0.05  # share of correct depths that the recommended setting may lose against the best
REPEATS = 7
SCENES, SCALE, BPP = ("apples", "twins"), 4, 0.35  # conditions of the accuracy chart
FARTHEST = 250  # largest d of layers z = d·f


def main() -> None:
    """Measure all, print, record and draw."""
    asked = command_line(__doc__, scenes=SCENES).parse_args()
    for key in RECORDS.todo(({"what": what} for what in TARGETS), asked.again):
        RECORDS.measure(key, lambda what=key["what"]: {"value": value_of(what)})
    for row in data()["rows"]:
        print(f"{row['what']:<56} {row['target']:>5}  {row['value']:.3g}", flush=True)
    keys = [{"accuracy": name, "scale": SCALE, "bpp": BPP} for name in asked.scenes]
    for key in RECORDS.todo(keys, asked.again):
        RECORDS.measure(key, lambda name=key["accuracy"]: {"points": accuracy(name)})
    kept = data()
    for figure, path in ((draw(kept), CHART), (draw_front(kept["accuracy"]), FRONT)):
        save(figure, path)
        write_picture(path, path)
    publish(tables())


# Rows of the table, and their targets.
TARGETS = {
    "q_global / numpy subtract and square": "≤ 3",
    "q_global: MiB allocated at most": "",
    "q_angle / numpy subtract and square": "≤ 3",
    "q_angle: MiB allocated at most": "",
    "q_view: CPU s beyond SSIM's own": "≤ 1",
    "q_depth, 250 layers, 25 + 25 EIs: CPU s / 2 cores": "≤ 30",
    "q_depth: GiB over the pictures": "≤ 1",
    "q_depth, robust: CPU s / 2 cores": "",
    "q_depth, robust: GiB over the pictures": "",
}


def value_of(what: str) -> float:
    """Measure one row."""
    if what.startswith("q_depth"):
        seconds, gib = q_depth_at_full_size("robust" if "robust" in what else "dissertation")
        return gib if "GiB" in what else seconds / 2
    a, b = full_size()
    if what.startswith("q_view"):
        return view_seconds(a, b)
    metric = {"q_global": q_global, "q_angle": q_angle}[what.replace(":", " ").split()[0]]
    metric(a, b)
    return _peak(lambda: metric(a, b)) if "MiB" in what else against_numpy(metric, a, b)


def data() -> dict[str, list[dict[str, Any]]]:
    """Return the newest rows and points of the accuracy chart."""
    rows = {row["what"]: row for row in RECORDS.rows() if "what" in row}
    points = [
        {"scene": row["accuracy"], "commit": row["commit"], **point}
        for row in RECORDS.rows(scale=SCALE, bpp=BPP)
        for point in row["points"]
    ]
    return {
        "rows": [{"target": target, **rows[what]} for what, target in TARGETS.items() if what in rows],
        "accuracy": points,
    }


def tables() -> Tables:
    """Return the tables of the records."""
    kept = data()
    lines = [f"| {row['what']} | {row['value']:.3g} |" for row in kept["rows"]]
    cost = with_commits(["| | measured |", "|---|---|", *lines], [[row["commit"]] for row in kept["rows"]])
    return {
        ("docs/speed_accuracy.md", "evaluation"): front_table(kept),
        ("docs/metrics.md", "speed"): [*cost, "", origin(kept["rows"])],
    }


def full_size() -> tuple[IIPicture, IIPicture]:
    """Return two pictures of noise that differ by noise."""
    camera = preset("setup1")
    rng = np.random.default_rng(0)
    blocks = [rng.integers(0, 250, (256, 512, 3), dtype=np.uint8) for _ in range(2)]
    blocks[1] = blocks[0] + blocks[1] % 5
    a, b = (IIPicture(np.tile(x, (16, 16, 1)), camera.lenses, camera.ei_pixels, camera) for x in blocks)
    return a, b


def against_numpy(metric: Callable[[IIPicture, IIPicture], object], a: IIPicture, b: IIPicture) -> float:
    """Return the CPU time of a measure over that of numpy's subtraction and square of bytes."""

    def plain() -> None:
        difference = np.subtract(a.pixels, b.pixels)  # of bytes, with wraparound: a lower bound of numpy's time
        np.square(difference, out=difference)

    return statistics.median([_cpu(lambda: metric(a, b)) / _cpu(plain) for _ in range(REPEATS)])


def view_seconds(a: IIPicture, b: IIPicture) -> float:
    """Return the CPU time of q_view minus that of scikit-image's SSIM on the same five pairs of views."""
    pairs = []
    for viewpoint in five_viewpoints(a.camera).values():  # type: ignore[arg-type]
        x, y, _ = view_pair(a, b, viewpoint)
        pairs.append((x @ LUMA, y @ LUMA))
    options: Any = {"data_range": 255, "gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False}

    def ssim() -> None:
        for x, y in pairs:
            structural_similarity(x, y, **options)

    q_view(a, b)
    return statistics.median([_cpu(lambda: q_view(a, b)) - _cpu(ssim) for _ in range(REPEATS)])


def q_depth_at_full_size(method: str) -> tuple[float, float]:
    """Return CPU seconds and memory growth in GiB of the second q_depth; the first one compiles."""
    script = f"""
import time
from benchmarks.speed.metrics_speed import full_size
from metrics import linear_layers, q_depth
from ii_core import IIPicture, preset
small = preset("setup1", scale=32)
a, b = full_size()
tiny = IIPicture(a.pixels[: small.pixels[1], : small.pixels[0]].copy(), small.lenses, small.ei_pixels, small)
q_depth(tiny, tiny, method={method!r}, layers_mm=linear_layers(small))
def most():  # not `getrusage`, which would begin with what the process that started this one holds
    return int(dict(line.split(":") for line in open("/proc/self/status"))["VmHWM"].split()[0])
before, started = most(), time.process_time()
q_depth(a, b, method={method!r}, layers_mm=linear_layers(a.camera))
print(time.process_time() - started, (most() - before) / 2**20)
"""
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, cwd=ROOT)
    seconds, gib = map(float, run.stdout.split())
    return seconds, gib


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


def draw(data: dict[str, Any]) -> Any:
    """Draw accuracy against time, one row per parameter."""
    points = data["accuracy"]
    kinds = list(dict.fromkeys(point["what"] for point in points))
    titles = {"layers": "number of layers", "EIs": "number of EIs, B + R", "filter": "side of the filter h"}
    figure = new_figure(8.5, 3 * len(kinds) + 0.8)
    panels = figure.subplots(len(kinds), 2, sharey="col", squeeze=False)
    lines = list(dict.fromkeys((point["scene"], point["method"]) for point in points))
    for row, what in zip(panels, kinds, strict=True):
        for i, (scene, method) in enumerate(lines):
            line = [p for p in points if (p["what"], p["scene"], p["method"]) == (what, scene, method)]
            for axes, value in zip(row, ("right", "off_db"), strict=True):
                x, y = [p["cpu_seconds"] for p in line], [p[value] for p in line]
                axes.plot(x, y, marker=MARKERS[i], color=COLOURS[i], label=f"{scene}, {method}")
                for at, point in zip(zip(x, y, strict=True), line, strict=True):
                    axes.annotate(point["number"], at, xytext=(3, 4), textcoords="offset points", fontsize=9)
        for axes in row:
            axes.set_title(titles[what], loc="left", fontsize=11)
        row[0].set_ylabel("depths correct within 10 % [share]")
        row[1].set_ylabel(r"$Q_\mathrm{depth}$ error against true depth [dB]")
    for axes in panels[-1]:
        axes.set_xlabel("CPU time [s]")
    for axes in panels.flat:
        axes.set_xlim(left=0)
        axes.grid(True, color="0.9", linewidth=0.8)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    handles, names = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=2, frameon=False)
    return figure


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


def front_table(data: dict[str, Any]) -> list[str]:
    """Return the fronts as a table, the recommended setting in bold."""
    lines = ["| scene | setting | correct depths | error of Q_depth | CPU time |", "|---|---|---|---|---|"]
    commits = []
    for scene, best in fronts(data["accuracy"]).items():
        pick = recommended(best)
        for point in best:
            name = f"**{setting(point)}**" if point is pick else setting(point)
            cells = f"{point['right']:.0%} | {point['off_db']:.1f} dB | {point['cpu_seconds']:.2f} s"
            lines.append(f"| {scene} | {name} | {cells} |")
            commits.append([point["commit"]])
    size = f"`setup1` at `scale={SCALE}`, JPEG 2000 at {BPP} bit/pixel. {origin(data['accuracy'])}"
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


def _cpu(call: Callable[[], object]) -> float:
    started = time.process_time()
    call()
    return time.process_time() - started


def _peak(call: Callable[[], object]) -> float:
    """Return the peak MiB allocated by Python and numpy during a call."""
    tracemalloc.start()
    try:
        call()
        return tracemalloc.get_traced_memory()[1] / 2**20
    finally:
        tracemalloc.stop()


if __name__ == "__main__":
    main()
