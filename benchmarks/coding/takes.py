"""Coding of takes in every order over view and time: rate against stills, random access, CPU time.

    python -m benchmarks run takes [--scale 8] [--takes apples,car,cuboid]

Takes are rendered once into ``out/takes``. Numbers go to ``benchmarks/results/takes.jsonl``, the tables into
``docs/video.md``; `benchmarks.pages.video` draws them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks.arguments import command_line
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import ROOT, Records, origin, table
from codec import Plan, component_cost, encode_take, open_take
from ii_core import IIVideo, open_video, preset, video_of
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


def main() -> None:
    """Measure, print, record, and fill tables."""
    asked = command_line(__doc__, scale=SCALE, takes=TAKES).parse_args()
    keys = [{"take": take, "scale": asked.scale, "plan": plan} for plan in PLANS for take in asked.takes]
    RECORDS.run(keys, coded, asked.again)
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
