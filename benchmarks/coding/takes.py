"""Coding of takes in every order over view and time: rate against stills, random access, CPU time.

    python -m benchmarks run takes [--scale 8] [--takes apples,car,cuboid]

Takes are rendered once into ``out/takes``. Numbers go to ``benchmarks/results/takes.jsonl``, the tables into
``docs/video.md``, the chart of random access to ``docs/images/takes_access.png``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks.arguments import command_line
from benchmarks.pages.pictures import tidy, write_chart
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import ROOT, Records, origin, table
from codec import Plan, component_cost, encode_take, open_take
from ii_core import IIVideo, open_video, preset, video_of
from ii_core.display.figure import COLOURS, MARKERS, new_figure
from metrics import bd_rate, measure_take
from metrics.rates.rd import UndefinedDifference
from raytrace_ii import load_take, render_take

RECORDS = Records("takes", ("benchmarks.coding.takes",))
SCALE = 8  # scale on the page
TAKES = ("apples", "car", "cuboid")
SCHEME = "si-h264:rate=cq,refs=8"
QPS = (22, 27, 32, 37)
FRAMES = 16  # instants
SPAN = 8
PLANS = {
    "stills": Plan(span=1),
    "stills, groups of 16 views": Plan(span=1, group=16),
    "view-first": Plan(walk="view-first", span=SPAN),
    "time-first": Plan(walk="time-first", span=SPAN),
    "time-first, groups of 1 view": Plan(walk="time-first", span=SPAN, group=1),
    "interleaved": Plan(walk="interleaved", span=SPAN, strip=4),
    "interleaved, groups of 16 views": Plan(walk="interleaved", span=SPAN, group=16, strip=4),
}
USE_WHEN = {  # words above the plan that serves best
    "time-first, groups of 1 view": "any image at once:\nfilms of one view",
    "interleaved, groups of 16 views": "small file, quick access:\ninterleaved, groups of 16 views",
    "stills": "each instant alone",
    "time-first": "smallest file:\ntime-first",
}


def main() -> None:
    """Measure, print, record, and fill tables."""
    asked = command_line(__doc__, scale=SCALE, takes=TAKES).parse_args()
    keys = [{"take": take, "scale": asked.scale, "plan": plan} for plan in PLANS for take in asked.takes]
    RECORDS.run(keys, coded, asked.again)
    access_chart()
    publish(tables())


def rendered(take: str, scale: int) -> IIVideo:
    """Return the frames of a take that are used, rendered unless they exist."""
    folder = ROOT / "out" / "takes" / f"{take}_{scale}"
    render_take(load_take(take), folder, preset("setup1", scale=scale), frames=range(FRAMES))
    return open_video(folder)


def coded(take: str, scale: int, plan: str) -> dict[str, Any]:
    """Return points of one plan."""
    video = rendered(take, scale)
    return {"points": points(video_of([video[i] for i in range(FRAMES)], fps=video.fps), PLANS[plan])}


def points(video: IIVideo, plan: Plan) -> list[dict[str, float]]:
    """Return rate and quality at every quantiser."""
    found = []
    for qp in QPS:
        coded = encode_take(video, SCHEME, qp=qp, plan=plan)
        quality = measure_take(video, open_take(coded))
        found.append(
            {
                "qp": qp, "bpp": coded.bpp, "mbit_per_second": coded.mbit_per_second,
                "psnr_of_pooled_mse": quality.pooled_psnr, "psnr_worst_frame": quality.worst_psnr,
                "flicker": quality.mean_flicker, "encode_seconds": coded.encode_seconds,
                "codec_seconds": coded.codec_seconds,
            }
        )  # fmt: skip
    return found


def difference(anchor: Sequence[Mapping[str, Any]], test: Sequence[Mapping[str, Any]]) -> float | None:
    """Return the Bjøntegaard rate of a curve against another, percent; None if undefined."""
    a, b = ([[p[name] for p in curve] for name in ("bpp", "psnr_of_pooled_mse")] for curve in (anchor, test))
    try:
        return bd_rate(*a, *b)
    except UndefinedDifference:
        return None


def by_plan(scale: int = SCALE) -> dict[str, dict[str, Any]]:
    """Return rows by take and plan."""
    found: dict[str, dict[str, Any]] = {}
    for row in RECORDS.rows(scale=scale):
        if "plan" in row:
            found.setdefault(row["take"], {})[row["plan"]] = row
    return found


def tables() -> Tables:
    """Return the tables of the page of videos."""
    return {("docs/video.md", "takes"): plan_table()}


def plan_table() -> list[str]:
    """Return a table with a row per plan: random access, Bjøntegaard rate of each take against its stills."""
    rows = by_plan()
    lines, commits = [], []
    for plan in PLANS:
        offs = [difference(take["stills"]["points"], take[plan]["points"]) for take in rows.values()]
        cells = ["anchor" if plan == "stills" else rate_text(off) for off in offs]
        lines.append([plan, f"{component_cost(PLANS[plan], 256, FRAMES).mean:g}", *cells])
        commits.append([take[plan]["commit"] for take in rows.values()])
    every = [row for take in rows.values() for row in take.values()]
    heads = ["plan | frames for one SI, mean", *(f"{take}, %" for take in rows)]
    return [origin(every), "", *table(" | ".join(heads), lines, commits)]


def rate_text(off: float | None) -> str:
    """Return a Bjøntegaard rate as text of a cell."""
    return "–" if off is None else f"{off:+.1f}"


def access_chart() -> None:
    """Draw the rate of every plan against stills over its random-access cost."""
    figure = new_figure(8, 4.8)
    axes = figure.subplots()
    for i, (take, plans) in enumerate(by_plan().items()):
        axes.plot([], [], color=COLOURS[i], linewidth=5, label=take)
        for j, plan in enumerate(PLANS):
            if plan in plans and (off := difference(plans["stills"]["points"], plans[plan]["points"])) is not None:
                cost = component_cost(PLANS[plan], 256, FRAMES).mean
                axes.plot(cost, off, marker=MARKERS[j], color=COLOURS[i], linestyle="none", markersize=8)
    for j, plan in enumerate(PLANS):
        axes.plot([], [], marker=MARKERS[j], color="0.3", linestyle="none", label=plan)
    for plan, words in USE_WHEN.items():
        place = component_cost(PLANS[plan], 256, FRAMES).mean, 4 if plan == "stills" else 29
        side = {"stills": "left", "time-first": "right"}.get(plan, "left" if place[0] < 10 else "center")
        axes.text(*place, words, ha=side, va="bottom", fontsize=9)
    axes.set_ylim(top=40)
    axes.axhline(0, color="0.5", linewidth=0.8)
    axes.set_xscale("log")
    axes.set_xlabel("frames decoded for one SI at one instant, mean")
    axes.set_ylabel("rate against stills at equal quality [%]")
    tidy(axes)
    figure.legend(loc="outside lower left", ncols=3, frameon=False, fontsize=8)
    write_chart(figure, "takes_access.png", dpi=110)
