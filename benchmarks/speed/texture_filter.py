"""Texture filter: CPU time and PSNR over samples per pixel, filtered and point-sampled.

    python -m benchmarks run texture_filter [--scale 32] [--scenes cuboid,twins]

The reference has 256 samples per pixel, point-sampled. PSNR is in 16-bit sRGB. Time is the median CPU time of
`render` without support images, over rounds that interleave both settings, on one thread. Rows go to
``benchmarks/results/texture_filter.jsonl``, table and chart to ``docs/speed_accuracy.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from statistics import median
from typing import Any

from benchmarks.arguments import command_line
from benchmarks.pages.pictures import write_picture
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import ROOT, Records, by_scene
from ii_core import preset
from ii_core.display.figure import COLOURS, new_figure, save
from metrics import q_global
from raytrace_ii import load_scene, render

RECORDS, CHART = Records("texture_filter", ("benchmarks.speed.texture_filter",)), "docs/images/texture_filter.png"
PAGE, SCALE = "docs/speed_accuracy.md", 32
SCENES = ("cuboid", "twins", "hairdo")  # the reference scenes with the finest image textures
SAMPLES, REFERENCE, ROUNDS = (1, 2, 4, 9, 16), 256, 5
IN_TABLE = (1, 4, 16)  # of SAMPLES; the chart has all
SETTINGS = {"points": False, "filtered": True}


def main() -> None:
    """Measure; draw the chart and fill the page if all scenes have records."""
    asked = command_line(__doc__, scale=SCALE, scenes=SCENES).parse_args()
    keys = [{"scene": name, "scale": asked.scale} for name in asked.scenes]
    for key in RECORDS.todo(keys, asked.again):
        record = RECORDS.measure(key, partial(study, key["scene"], key["scale"]))
        print(f"{key['scene']}: {record['seconds']:.0f} s", flush=True)
    if set(scenes := measured()) == set(SCENES):
        save(draw(scenes), ROOT / CHART)
        write_picture(ROOT / CHART, ROOT / CHART)
        publish(tables())


def measured() -> dict[str, Any]:
    """Return the newest row of every scene at the page's scale, in the order of SCENES."""
    return RECORDS.by("scene", SCENES, scale=SCALE)


def study(name: str, scale: int) -> dict[str, Any]:
    """Measure one scene: PSNR in dB and median CPU seconds for each number of samples and both settings."""
    scene, camera = load_scene(name), preset("setup1", scale=scale)
    truth = render(scene, camera, samples=REFERENCE, texture_filter=False, dtype="uint16", support=()).picture
    rows = []
    for samples in SAMPLES:
        psnr, seconds = dict[str, float](), {label: list[float]() for label in SETTINGS}
        for _ in range(ROUNDS):  # interleaved, so that other jobs on the machine affect both settings alike
            for label, on in SETTINGS.items():
                shot = render(
                    scene, camera, samples=samples, texture_filter=on, dtype="uint16", support=(), workers=1
                )
                seconds[label].append(shot.stats.cpu_seconds)
                psnr[label] = q_global(truth, shot.picture)
        rows.append({"samples": samples, "psnr": psnr, "seconds": {k: median(v) for k, v in seconds.items()}})
    return {"reference_samples": REFERENCE, "rounds": ROUNDS, "rows": rows}


def tables() -> Tables:
    """Return the table of the page."""
    scenes = measured()
    (k, l), (m, n) = (camera := preset("setup1", scale=SCALE)).lenses, camera.pixels
    said = f"`setup1` at `scale={SCALE}`: {m}×{n} pixels, {k}×{l} lenses; {REFERENCE} samples in the reference; " + (
        f"median CPU time of {ROUNDS} rounds on one thread, beside other jobs."
    )
    return {(PAGE, "filter"): [said, by_scene(scenes), "", *filter_table(scenes)]}


def filter_table(scenes: dict[str, Any]) -> list[str]:
    """Return PSNR at points and filtered, and the change of CPU time, by scene and number of samples."""
    lines = ["| scene | samples | at points | filtered | gain | CPU time |", "|---|---|---|---|---|---|"]
    for name, one in scenes.items():
        for row in (row for row in one["rows"] if row["samples"] in IN_TABLE):
            psnr, seconds = row["psnr"], row["seconds"]
            cells = [f"{psnr[label]:.1f} dB" for label in SETTINGS]
            gain = psnr["filtered"] - psnr["points"]
            cost = 100 * (seconds["filtered"] / seconds["points"] - 1)
            lines.append(f"| {name} | {row['samples']} | {' | '.join(cells)} | {gain:+.1f} dB | {cost:+.0f} % |")
    return lines


def draw(scenes: dict[str, Any]) -> Any:
    """Draw PSNR over CPU time, a panel for each scene, points labelled with their samples."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    figure = new_figure(10, 3.6)
    panels: Sequence[Any] = figure.subplots(1, len(scenes))
    for axes, (name, one) in zip(panels, scenes.items(), strict=True):
        for label, style, colour in zip(SETTINGS, ("o--", "s-"), COLOURS, strict=False):
            seconds, psnr = ([row[what][label] for row in one["rows"]] for what in ("seconds", "psnr"))
            axes.plot(seconds, psnr, style, color=colour, label=label.replace("points", "at points"))
            below = label == "points"  # the lower curve, its labels below it
            for row, x, y in zip(one["rows"], seconds, psnr, strict=True):
                axes.annotate(
                    str(row["samples"]), (x, y), textcoords="offset points", xytext=(5, -10) if below else (-4, 6),
                    ha="left" if below else "right", fontsize=9,
                )  # fmt: skip
        axes.set_title(name, loc="left")
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(base=10, subs=(1, 2, 5)))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_xlabel("CPU time [s]")
        axes.margins(0.12)
        axes.grid(True, color="0.92", linewidth=0.8)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylabel("PSNR [dB]")
    panels[0].legend(frameon=False, loc="lower right")
    return figure


if __name__ == "__main__":
    main()
