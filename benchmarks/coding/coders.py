"""Bjøntegaard rate and CPU time of every scheme and preset against the dissertation's coder.

    python -m benchmarks run coders [--scale 4] [--scenes apples,car] [--schemes 'si-h264,si-av1*'] [--workers 2]

The four coding scenes are rendered and coded with all registered schemes and with the trials below. Every scheme on
every scene is a row of ``benchmarks/results/coders.jsonl``, written when it is measured, so that an interrupted run
continues. ``python -m benchmarks run coding_docs`` draws charts and fills pages from the rows. The anchor is the
dissertation's SI-PVS: H.264, one I picture and P pictures, 4:2:0, constant quantiser, parallel order.
"""

from __future__ import annotations

import statistics
import textwrap
from collections.abc import Mapping, Sequence
from fnmatch import fnmatch
from itertools import count
from typing import Any

import numpy as np

from benchmarks.arguments import command_line
from benchmarks.coding.rd import climbing, compiled, rd_point
from benchmarks.pages.pictures import write_chart
from benchmarks.records import Records, origin, table
from codec import parse_scheme, schemes
from codec.contract import find
from ii_core import IIPicture, preset
from ii_core.base.parallel import for_each
from ii_core.display.figure import new_figure
from metrics import bd_rate
from metrics.rates.rd import UndefinedDifference
from raytrace_ii import load_scene, render

RECORDS = Records("coders", ("benchmarks.coding.coders", "benchmarks.coding.rd"))
SCENES = ("apples", "twins", "car", "cuboid")
ANCHOR = "si-h264:chroma=420,rate=cq"
RATES = (0.03, 0.06, 0.12, 0.25, 0.5, 1.0, 2.0)
# Quantisers by coder, over the anchor's range of quality.
QUANTISERS = {
    "h264": (16, 21, 26, 31, 36, 41, 46),
    "hevc": (14, 19, 24, 29, 34, 39, 44),
    "av1": (8, 18, 28, 38, 46, 54, 62),
    "vp9": (8, 18, 28, 38, 46, 54, 62),
    "avif": (8, 18, 28, 38, 46, 54, 62),
    "mpeg2": (1, 2, 4, 7, 12, 20, 31),
    "lf": (20, 28, 36, 44, 52),
}
TUNED = ("si-lf:tune=rgb",)  # for the measure of these tables
LETTERS = 8  # height of labels in the chart, typographic points
NEAR = 0.1  # tolerance of the recommended setting, relative to the least rate
# Trials with one option changed, which led to defaults and presets.
TRIALS = (
    "si-h264:rate=cq",
    "si-h264:rate=cq,depth=10",
    "si-h264:rate=crf",
    "si-h264:rate=cq,bframes=3",
    "si-h264:rate=cq,bframes=7,pyramid=1",
    "si-h264:rate=crf,bframes=7,pyramid=1",
    "si-h264:rate=crf,bframes=16,pyramid=1",
    *(f"si-h264:rate=cq,order={order},by={by}" for order in ("row", "parallel", "zigzag", "spiral") for by in (
        "rows", "columns") if (order, by) != ("parallel", "rows")),
    "si-h264:balanced,merange=64",
    "si-hevc:rate=cq",
    "si-hevc:depth=8",
    "si-hevc:chroma=420",
    "si-hevc:bframes=0",
    "si-hevc:bframes=8",
    "si-hevc:merange=128",
    "si-hevc:preset=veryslow",
    "si-hevc:by=columns",
    "si-av1:rate=cq",
    "si-av1:depth=8",
    "si-av1:by=columns",
    "si-av1:preset=5",
    "si-vp9:chroma=420",
)  # fmt: skip


def main() -> None:
    """Measure the chosen rows and print the table."""
    parser = command_line(__doc__, scale=4, scenes=SCENES)
    parser.add_argument(
        "--schemes",
        default="*",
        help="only these, with *, options separated by semicolons: si-av1*,si-h264:balanced;merange=64",
    )
    parser.add_argument("--workers", type=int, default=1)
    asked = parser.parse_args()
    chosen = [one.replace(";", ",") for one in asked.schemes.split(",")]
    names = [name for name in candidates() if name == ANCHOR or any(fnmatch(name, one) for one in chosen)]
    if unknown := [one for one in chosen if not any(fnmatch(name, one) for name in names)]:
        parser.error(f"no scheme {unknown[0]!r}: known are {', '.join(candidates())}")
    for scene in asked.scenes:
        keys = RECORDS.todo(({"scene": scene, "scale": asked.scale, "scheme": name} for name in names), asked.again)
        print(f"{scene}: {len(keys)} of {len(names)} curves to measure", flush=True)
        if keys:
            picture = render(load_scene(scene), preset("setup1", scale=asked.scale), noise=1.0, support=()).picture
            measure(picture, keys, asked.workers)


def measure(picture: IIPicture, keys: Sequence[Mapping[str, Any]], workers: int) -> None:
    """Measure and record curves of one picture; an interrupt drops the curves not yet started."""
    done = count(1)

    def row(key: Mapping[str, Any]) -> None:
        record = RECORDS.measure(key, lambda: {"points": curve(picture, key["scheme"])})
        print(f"{next(done)} of {len(keys)}: {key['scene']} {key['scheme']}, {record['seconds']:.1f} s", flush=True)

    for_each(row, keys, workers=workers)


def studied(scale: int) -> list[dict[str, Any]]:
    """Return the newest row of every scene and scheme at a scale, compared with the scene's anchor."""
    rows = RECORDS.rows(scale=scale)
    anchors = {row["scene"]: row["points"] for row in rows if row["scheme"] == ANCHOR}
    return [{**row, **compared(anchors[row["scene"]], row["points"])} for row in rows if row["scene"] in anchors]


def candidates() -> list[str]:
    """Return the anchor, every scheme with adjustable quality, its presets, and the trials."""
    lossy = [name for name in schemes() if qualities(name)]
    named = [f"{name}:{setting}" for name in lossy for setting in find(name).presets]
    return list(dict.fromkeys([ANCHOR, *lossy, *named, *TUNED, *TRIALS]))


def qualities(scheme: str) -> list[dict[str, Any]]:
    """Return the goals of a scheme, point by point; none for lossless coding."""
    coder, options = parse_scheme(scheme)
    if coder.lossless(options):
        return []
    standard = coder.name.partition("-")[2]
    if standard in QUANTISERS:
        return [{"qp": qp} for qp in QUANTISERS[standard]]
    if coder.rate_control:
        return [{"bpp": bpp} for bpp in RATES]
    for key, bounds in (("qp", coder.qp_range), ("quality", coder.quality_range)):
        if bounds is not None:
            low, high = bounds
            return [{key: type(low)(low + (high - low) * part)} for part in np.linspace(0.05, 0.95, len(RATES))]
    return []


def curve(picture: IIPicture, scheme: str) -> list[dict[str, float]]:
    """Return rate, PSNR and CPU seconds of one encoder run at every quality."""
    compiled(scheme, **qualities(scheme)[0])
    points = (rd_point(picture, scheme, **goal) for goal in qualities(scheme))
    return [
        {
            "bpp": p.bpp, "psnr": p.q_global, "codec_seconds": p.encoder_seconds or 0.0,
            "encode_seconds": p.encode_seconds or 0.0, "decode_seconds": p.decode_seconds, "runs": p.runs,
        }
        for p in points
    ]  # fmt: skip


def compared(anchor: list[dict[str, float]], points: list[dict[str, float]]) -> dict[str, Any]:
    """Return the Bjøntegaard rate to the anchor in percent, or the reason without one, and mean CPU seconds."""
    seconds = statistics.mean(point["codec_seconds"] for point in points)
    pairs = [[(p["bpp"], p["psnr"]) for p in climbing(some)] for some in (anchor, points)]
    try:
        rate = bd_rate(*zip(*pairs[0], strict=True), *zip(*pairs[1], strict=True))
        return {"bd_rate": round(rate, 2), "seconds": seconds}
    except UndefinedDifference as error:
        return {"bd_rate": None, "why": error.short, "seconds": seconds}


def summary(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return rates of all scenes, their mean if complete, and mean seconds by scheme, best first."""
    out = []
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    for scheme in dict.fromkeys(row["scheme"] for row in rows):
        own = [row for row in rows if row["scheme"] == scheme]
        rates = {**dict.fromkeys(scenes), **{row["scene"]: row["bd_rate"] for row in own}}
        known = [rate for rate in rates.values() if rate is not None]
        mean = statistics.mean(known) if len(known) == len(scenes) else None
        seconds = statistics.mean(row["seconds"] for row in own)
        out.append({"scheme": scheme, "rates": rates, "mean": mean, "seconds": seconds})
    return sorted(out, key=lambda row: (row["mean"] is None, row["mean"] or 0.0))


def rate_table(rows: list[dict[str, Any]], best: Sequence[Mapping[str, Any]] | None = None) -> list[str]:
    """Return the lines of a Markdown table of a `summary`, that of the rows unless another is given."""
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    best = summary(rows) if best is None else best
    lines = [
        [f"`{row['scheme']}`", *(_percent(row["rates"][scene]) for scene in scenes), _percent(row["mean"]),
         f"{row['seconds']:.2f}"]
        for row in best
    ]  # fmt: skip
    heads = ["scheme", *(f"{scene}, %" for scene in scenes), "mean, % | CPU s"]
    return table(" | ".join(heads), lines)


def shortened(best: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return a `summary` without repeated rates, and with one setting only of each scheme that is no SI scheme.

    Of rates that look equal in the table, the shortest name remains: a default before its preset. Of other schemes
    than SI schemes the setting of the least mean rate remains, or the shortest name if there is no mean.
    """
    kept: dict[Any, Mapping[str, Any]] = {}
    for row in best:
        scheme, cells = row["scheme"], tuple(map(_percent, row["rates"].values()))
        base = scheme.partition(":")[0]
        key = (base, cells) if base.startswith("si-") else base
        first = kept.setdefault(key, row)
        alike = row["mean"] is None or tuple(map(_percent, first["rates"].values())) == cells
        if alike and len(scheme) < len(first["scheme"]):
            kept[key] = row
    return list(kept.values())


def _percent(rate: float | None) -> str:
    return "–" if rate is None else f"{rate:+.0f}"


def front(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the Pareto front of rate and time."""
    best: list[dict[str, Any]] = []
    for row in sorted((r for r in summary(rows) if r["mean"] is not None), key=lambda r: r["seconds"]):
        if not best or row["mean"] < best[-1]["mean"]:
            best.append(row)
    return best


def recommended(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the fastest scheme of the front whose rate is within NEAR of the least."""
    edge = front([row for row in rows if row["scheme"] not in TRIALS])
    return next(row for row in edge if 100 + row["mean"] <= (1 + NEAR) * (100 + edge[-1]["mean"]))


def together(shown: list[dict[str, Any]]) -> list[tuple[str, dict[str, Any]]]:
    """Return a label for each point; names of equal rates, such as a default and its preset, share one."""
    groups: dict[Any, list[dict[str, Any]]] = {}
    for row in shown:
        groups.setdefault((row["scheme"].partition(":")[0], round(row["mean"])), []).append(row)
    labels = []
    for group in groups.values():
        first = min(group, key=lambda row: len(row["scheme"]))
        rest = [":" + row["scheme"].partition(":")[2] for row in group if row is not first]
        labels.append((", ".join([first["scheme"], *rest]), first))
    return labels


def chart(rows: list[dict[str, Any]], scale: int, name: str) -> None:
    """Draw encoding time against rate with the Pareto front."""
    from matplotlib.ticker import LogLocator, NullFormatter

    figure = new_figure(9, 11)
    axes = figure.subplots()
    colours = {"h264": "C0", "hevc": "C1", "av1": "C2", "vp9": "C4", "mpeg2": "C5"}
    shapes = {"ei": "s", "ri": "^", "si": "o"}
    shown = [row for row in summary(rows) if row["mean"] is not None and row["scheme"] not in TRIALS]
    edge, pick = front([row for row in rows if row["scheme"] not in TRIALS]), recommended(rows)
    named = [(names, (row["seconds"], 1 + row["mean"] / 100), row["scheme"]) for names, row in together(shown)]
    for _, at, scheme in named:
        kind, _, coder = scheme.partition(":")[0].partition("-")
        axes.plot(*at, shapes.get(kind, "D"), color=colours.get(coder, "0.5"))
    axes.plot(pick["seconds"], 1 + pick["mean"] / 100, "*k", markersize=16, zorder=0, label="recommended")
    axes.legend(frameon=False)
    axes.margins(x=0.12)
    axes.step([r["seconds"] for r in edge], [1 + r["mean"] / 100 for r in edge], "k-", lw=0.8, where="post")
    axes.set(xscale="log", yscale="log", xlabel="CPU seconds of one encoder run, mean over rates and scenes")
    axes.set_ylabel("rate at equal PSNR, relative to the dissertation's SI-PVS")
    measured = textwrap.fill(origin(rows).replace("`", ""), 100)
    axes.set_title(
        f"Speed against accuracy, setup1 at scale {scale}; the line is the Pareto front\n{measured}", fontsize=10
    )
    ticks = [0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1, 1.5, 2, 3, 5, 8, 12, 20, 30]
    low, high = axes.get_ylim()
    axes.set_yticks([tick for tick in ticks if low < tick < high])
    axes.yaxis.set_major_formatter("{x:g} ×")
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.grid(alpha=0.3, which="both")
    figure.canvas.draw()  # draw to fix the positions of points
    for (names, at, _), offset in zip(named, offsets(named, axes), strict=True):
        axes.annotate(names, at, offset, textcoords="offset points", fontsize=LETTERS)
    write_chart(figure, name, dpi=150)


def offsets(named: list[tuple[str, tuple[float, float], str]], axes: Any) -> list[tuple[float, float]]:
    """Return offsets of labels in typographic points: the first free position of each."""
    per_point = axes.figure.dpi / 72
    spots = [axes.transData.transform(at) / per_point for _, at, _ in named]
    taken = [(x - 4, y - 4, x + 4, y + 4) for x, y in spots]
    found = []
    for (names, _, _), (x, y) in zip(named, spots, strict=True):
        width, height = 0.55 * LETTERS * len(names), 1.1 * LETTERS
        places = [(side, 3 + step * height) for step in (0, -1.5, 1.1, -2.6, 2.2, -3.7) for side in (5, -5 - width)]
        boxes = [(x + dx, y + dy, x + dx + width, y + dy + height) for dx, dy in places]
        free = [not any(touch(box, other) for other in taken) for box in boxes]
        best = free.index(True) if any(free) else 0
        taken.append(boxes[best])
        found.append(places[best])
    return found


def touch(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    """Return whether two boxes (left, bottom, right, top) overlap."""
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
