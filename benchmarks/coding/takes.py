"""Coding of takes in every order over view and time: rate against stills, random access, CPU time.

    python -m benchmarks run takes [--scale 8] [--takes apples,car,cuboid]

Takes are rendered once into ``out/takes``. Numbers go to ``benchmarks/results/takes.jsonl``, the tables into
``docs/video.md``; `benchmarks.pages.video` draws them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.arguments import command_line
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import ROOT, Records, origin, with_commits
from codec import Plan, component_cost, decode, encode, encode_take, open_take
from ii_core import IIVideo, open_video, preset, sub_images, video_of
from metrics import bd_rate, measure_take
from metrics.rd import UndefinedDifference
from raytrace_ii import load_take, render_take

RECORDS = Records("takes", ("benchmarks.coding.takes",))
SCALE = 8  # of the page
TAKES = ("apples", "car", "cuboid")
SCHEME = "si-h264:rate=cq,refs=8"
QPS = (22, 27, 32, 37)
FRAMES, STEPS, INSTANTS = 16, (1, 2, 4), 8  # of the orders; of the speeds: frames left out, and frames that are kept
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
# Scheme and quantisers by coder, of PSNRs that overlap. `si-lf` codes pictures alone; its frames are FRAMES_ALONE.
CODERS = {
    "H.264": (SCHEME, QPS),
    "HEVC": ("si-hevc", QPS),
    "AV1": ("si-av1", (20, 32, 44, 56)),
    "si-lf": ("si-lf", (26, 32, 38, 44)),
}
FRAMES_ALONE = (0, 4)


def main() -> None:
    """Measure, print, keep, and fill tables."""
    asked = command_line(__doc__, scale=SCALE, takes=TAKES).parse_args()
    takes = asked.takes
    keys = [{"take": take, "scale": asked.scale, "plan": plan} for plan in PLANS for take in takes]
    keys += [{"take": take, "scale": asked.scale, "step": step} for step in STEPS for take in takes]
    keys += [{"take": take, "scale": asked.scale, "coder": coder} for coder in CODERS for take in takes]
    for key in RECORDS.todo(keys, asked.again):
        video = rendered(key["take"], asked.scale)
        RECORDS.measure(key, lambda key=key, video=video: coded(video, **key))
        print(key, flush=True)
    print("\n".join(line for lines in tables().values() for line in lines))
    publish(tables())


def rendered(take: str, scale: int) -> IIVideo:
    """A take's frames that are used, rendered unless they are there."""
    folder = ROOT / "out" / "takes" / f"{take}_{scale}"
    frames = sorted({*range(FRAMES), *(step * i for step in STEPS for i in range(INSTANTS))})
    render_take(load_take(take), folder, preset("setup1", scale=scale), frames=range(frames[-1] + 1))
    return open_video(folder)


def coded(video: IIVideo, take: str, scale: int, plan: str = "", step: int = 0, coder: str = "") -> dict[str, Any]:
    """Points of one plan; of a coder; or, of every step-th frame, points of both one-way orders and correlations."""
    if coder:
        return {"curves": by_coder(video, *CODERS[coder])}
    if plan:
        return {"points": points(video_of([video[i] for i in range(FRAMES)], fps=video.fps), PLANS[plan])}
    some = video_of([video[step * i] for i in range(INSTANTS)], fps=video.fps / step)
    curves = {name: points(some, PLANS[name]) for name in ONE_WAY}
    return {"curves": curves, **correlations(some)}


def by_coder(video: IIVideo, scheme: str, quantisers: Sequence[int]) -> dict[str, list[dict[str, float]]]:
    """Points of the first instants as stills and time-first; of a coder of pictures only as stills."""
    if scheme == "si-lf":
        return {"stills": [alone(video, scheme, qp) for qp in quantisers]}
    some = video_of([video[i] for i in range(INSTANTS)], fps=video.fps)
    return {name: points(some, PLANS[name], scheme, quantisers) for name in ("stills", "time-first")}


def alone(video: IIVideo, scheme: str, qp: int) -> dict[str, float]:
    """Rate and quality of frames that a coder of pictures codes one by one."""
    original = video_of([video[i] for i in FRAMES_ALONE], fps=video.fps)
    coded = [encode(picture, scheme, qp=qp) for picture in original]
    quality = measure_take(original, video_of([decode(one) for one in coded], fps=video.fps))
    return {"qp": qp, "bpp": sum(one.bpp for one in coded) / len(coded), "psnr_of_pooled_mse": quality.pooled_psnr}


def points(
    video: IIVideo, plan: Plan, scheme: str = SCHEME, quantisers: Sequence[int] = QPS
) -> list[dict[str, float]]:
    """Rate and quality at every quantiser."""
    found = []
    for qp in quantisers:
        coded = encode_take(video, scheme, qp=qp, plan=plan)
        quality = measure_take(video, open_take(coded))
        found.append(
            {
                "qp": qp,
                "bpp": coded.bpp,
                "mbit_per_second": coded.mbit_per_second,
                "psnr_of_pooled_mse": quality.pooled_psnr,
                "psnr_worst_frame": quality.worst_psnr,
                "flicker": quality.mean_flicker,
            }
        )
    return found


def correlations(video: IIVideo) -> dict[str, float]:
    """Mean correlation (5.3) of sub-images that follow one another in view, along rows, and in time."""
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
    """Bjøntegaard rate of a curve against another, percent; None where curves have none."""
    a, b = ([[p[name] for p in curve] for name in ("bpp", "psnr_of_pooled_mse")] for curve in (anchor, test))
    try:
        return bd_rate(*a, *b)
    except UndefinedDifference:
        return None


def by_plan(scale: int = SCALE) -> dict[str, dict[str, Any]]:
    """Rows by take and plan."""
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
    """A row a plan: random access, Bjøntegaard rate of each take against its stills."""
    rows = by_plan()
    if not rows:
        return ["Not measured yet."]
    lines = ["| plan | frames for one SI, mean | " + " | ".join(rows) + " |", "|---|---|" + "---|" * len(rows)]
    commits = []
    for plan in PLANS:
        cost = component_cost(PLANS[plan], 256, FRAMES)
        cells = []
        for take in rows.values():
            if plan not in take or "stills" not in take:
                cells.append("–")
                continue
            off = difference(take["stills"]["points"], take[plan]["points"])
            cells.append("anchor" if plan == "stills" else "–" if off is None else f"{off:+.1f} %")
        lines.append(f"| {plan} | {cost.mean:g} | " + " | ".join(cells) + " |")
        commits.append([take[plan]["commit"] for take in rows.values() if plan in take])
    every = [row for take in rows.values() for row in take.values()]
    return [origin(every), "", *with_commits(lines, commits)]


def coder_table() -> list[str]:
    """A row a coder and order: Bjøntegaard rate against stills of H.264."""
    rows = {(row["coder"], row["take"]): row for row in RECORDS.rows(scale=SCALE) if "coder" in row}
    if not rows:
        return ["Not measured yet."]
    lines = ["| coder | order | " + " | ".join(TAKES) + " |", "|---|---|" + "---|" * len(TAKES)]
    for coder in CODERS:
        for order in ("stills", "time-first"):
            cells = []
            for take in TAKES:
                anchor, test = (rows.get((name, take), {"curves": {}})["curves"] for name in ("H.264", coder))
                off = difference(anchor["stills"], test[order]) if "stills" in anchor and order in test else None
                cells.append("anchor" if (coder, order) == ("H.264", "stills") else rate_text(off))
            if coder != "si-lf" or order == "stills":
                lines.append(f"| {coder} | {order} | " + " | ".join(cells) + " |")
    return [origin(rows.values()), "", *lines]


def rate_text(off: float | None) -> str:
    """A Bjøntegaard rate as a table shows it."""
    return "–" if off is None else f"{off:+.1f} %"


def speed_table() -> list[str]:
    """A row a take and speed: correlations, and rate of time-first against view-first."""
    rows = [row for row in RECORDS.rows(scale=SCALE) if "step" in row]
    if not rows:
        return ["Not measured yet."]
    lines = [
        "| take | speed | 1 − c in time | 1 − c in view | time-first against view-first |",
        "|---|---|---|---|---|",
    ]
    for row in sorted(rows, key=lambda row: (TAKES.index(row["take"]), row["step"])):
        off = difference(*(row["curves"][name] for name in ONE_WAY))
        lines.append(
            f"| {row['take']} | ×{row['step']} | {1 - row['time_correlation']:.4f} | "
            f"{1 - row['view_correlation']:.4f} | {'–' if off is None else f'{off:+.1f} %'} |"
        )
    return [origin(rows), "", *lines]


if __name__ == "__main__":
    main()
