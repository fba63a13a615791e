"""Coding of takes in every order over view and time: rate against stills, random access, CPU time.

    python -m benchmarks run takes [--scale 8] [--takes apples,car,cuboid] [--coders HEVC,AV1]

Takes are rendered once into ``out/takes``. Numbers go to ``benchmarks/results/takes.jsonl``, the tables into
``docs/video.md``; `benchmarks.pages.video` draws them. With ``--coders`` only orders of these coders are measured.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from statistics import median
from typing import Any

import numpy as np

from benchmarks.arguments import command_line
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import ROOT, Records, origin, table
from codec import Plan, component_cost, encode_take, open_take
from ii_core import IIVideo, open_video, preset, sub_images, video_of
from metrics import bd_rate, measure_take
from metrics.rates.rd import UndefinedDifference
from raytrace_ii import load_take, render_take

RECORDS = Records("takes", ("benchmarks.coding.takes",))
SCALE = 8  # scale on the page
TAKES = ("apples", "car", "cuboid")
SCHEME = "si-h264:rate=cq,refs=8"
QPS = (22, 27, 32, 37)
# Instants of the orders; for the speeds: steps between frames, and instants.
FRAMES, STEPS, INSTANTS = 16, (1, 2, 4), 8
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
ONE_WAY = ("view-first", "time-first")
ORDERS = ("view-first", "time-first", "interleaved", "stills")  # orders of every coder; the first is its anchor
# Scheme and quantisers by coder.
CODERS = {
    "H.264": (SCHEME, QPS),
    "HEVC": ("si-hevc:rate=cq,refs=8", QPS),
    "AV1": ("si-av1:rate=cq", (24, 35, 46, 57)),
    "si-lf": ("si-lf", (26, 32, 38, 44)),
}
WHOLE_INSTANTS = ("view-first", "stills")  # orders of `si-lf`


def main() -> None:
    """Measure, print, record, and fill tables."""
    asked = command_line(__doc__, scale=SCALE, takes=TAKES, coders=tuple(CODERS)).parse_args()
    takes = asked.takes
    keys: list[dict[str, Any]] = [
        {"take": take, "scale": asked.scale, "plan": plan} for plan in PLANS for take in takes
    ]
    keys += [{"take": take, "scale": asked.scale, "step": step} for step in STEPS for take in takes]
    if asked.coders != list(CODERS):
        keys = []
    keys += [
        {"take": take, "scale": asked.scale, "coder": coder, "order": order}
        for order in ORDERS
        for coder in asked.coders
        for take in takes
        if coder != "si-lf" or order in WHOLE_INSTANTS
    ]
    RECORDS.run(keys, coded, asked.again)
    publish(tables())


def rendered(take: str, scale: int) -> IIVideo:
    """Return the frames of a take that are used, rendered unless they exist."""
    folder = ROOT / "out" / "takes" / f"{take}_{scale}"
    frames = sorted({*range(FRAMES), *(step * i for step in STEPS for i in range(INSTANTS))})
    render_take(load_take(take), folder, preset("setup1", scale=scale), frames=range(frames[-1] + 1))
    return open_video(folder)


def coded(take: str, scale: int, plan: str = "", step: int = 0, coder: str = "", order: str = "") -> dict[str, Any]:
    """Return points of one plan, of a coder in one order, or of both one-way orders on every step-th frame."""
    video = rendered(take, scale)
    if coder:
        some = video_of([video[i] for i in range(INSTANTS)], fps=video.fps)
        return {"points": points(some, PLANS[order], *CODERS[coder])}
    if plan:
        return {"points": points(video_of([video[i] for i in range(FRAMES)], fps=video.fps), PLANS[plan])}
    some = video_of([video[step * i] for i in range(INSTANTS)], fps=video.fps / step)
    curves = {name: points(some, PLANS[name]) for name in ONE_WAY}
    return {"curves": curves, **correlations(some)}


def points(
    video: IIVideo, plan: Plan, scheme: str = SCHEME, quantisers: Sequence[int] = QPS
) -> list[dict[str, float]]:
    """Return rate and quality at every quantiser."""
    found = []
    for qp in quantisers:
        coded = encode_take(video, scheme, qp=qp, plan=plan)
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


def correlations(video: IIVideo) -> dict[str, float]:
    """Return the mean correlation (5.3) of sub-images that are neighbours in view, along rows, and in time."""
    view: list[float] = []
    time: list[float] = []
    last = None
    for picture in video:
        images = sub_images(picture).astype(np.float64)
        images = images.reshape(*images.shape[:2], -1)
        images = images - images.mean(axis=2, keepdims=True)
        images /= np.maximum(np.linalg.norm(images, axis=2, keepdims=True), 1e-12)
        view.append(float((images[:, 1:] * images[:, :-1]).sum(axis=2).mean()))
        if last is not None:
            time.append(float((images * last).sum(axis=2).mean()))
        last = images
    return {"view_correlation": float(np.mean(view)), "time_correlation": float(np.mean(time))}


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
    made = {"takes": plan_table(), "takes-coders": coder_table(), "takes-speed": speed_table()}
    return {("docs/video.md", name): lines for name, lines in made.items()}


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


def coder_table() -> list[str]:
    """Return a table by coder and order: rate against its first order, and against H.264 in that order."""
    rows = {(row["coder"], row["order"], row["take"]): row for row in RECORDS.rows(scale=SCALE) if "order" in row}
    lines, cost = [], []
    for coder, order in product(CODERS, ORDERS):
        there = [rows[coder, order, take] for take in TAKES if (coder, order, take) in rows]
        cells = []
        for take in TAKES:
            for anchor in (coder, "H.264"):
                pair = [rows.get((name, by, take)) for name, by in ((anchor, ORDERS[0]), (coder, order))]
                off = None if None in pair else difference(*(row["points"] for row in pair if row))
                cells.append("anchor" if (anchor, ORDERS[0]) == (coder, order) else rate_text(off))
        if there:
            lines.append([coder, order, *cells])
            cost.append(median(p["encode_seconds"] / p["codec_seconds"] for row in there for p in row["points"]))
    heads = " | ".join(["coder | order", *(f"{take}, own, % | H.264, %" for take in TAKES)])
    whole = f"CPU time of `encode_take` over that inside the encoder: {min(cost):.3f}–{max(cost):.3f}, by row."
    return [origin(rows.values()), "", *table(heads, lines), "", whole]


def rate_text(off: float | None) -> str:
    """Return a Bjøntegaard rate as text of a cell."""
    return "–" if off is None else f"{off:+.1f}"


def speed_table() -> list[str]:
    """Return a table by take and speed: ratio of decorrelations, and rate of time-first against view-first."""
    rows = {(row["take"], row["step"]): row for row in RECORDS.rows(scale=SCALE) if "step" in row}
    lines = []
    for take in TAKES:
        cells = []
        for step in STEPS:
            row = rows.get((take, step))
            if row is None:
                cells.append("–")
                continue
            ratio = (1 - row["time_correlation"]) / (1 - row["view_correlation"])
            off = rate_text(difference(*(row["curves"][name] for name in ONE_WAY)))
            cells.append(f"{ratio:.2g}: {off}")
        lines.append([take, *cells])
    heads = " | ".join(["take", *(f"speed ×{step}" for step in STEPS)])
    return [origin(rows.values()), "", *table(heads, lines)]
