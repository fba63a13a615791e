"""Pictures of the page of videos: frames of takes, and charts of random access, of crossing orders and over time.

    python -m benchmarks run video [--only charts]

Views are the middle sub-images of frames that `benchmarks.coding.takes` renders.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from benchmarks.coding import crossing, neighbours
from benchmarks.coding.takes import (  # fmt: skip
    FRAMES,
    INSTANTS,
    ONE_WAY,
    PLANS,
    RECORDS,
    SCALE,
    SCHEME,
    TAKES,
    by_plan,
    difference,
    rendered,
)
from benchmarks.pages.pictures import IMAGES, write_picture
from benchmarks.records import ROOT
from codec import Plan, component_cost, encode_take, open_take
from ii_core import video_of
from ii_core.display.figure import COLOURS, MARKERS, new_figure, save
from ii_core.display.look import viewpoints_around
from metrics import measure_take, time_chart

SHOWN = (0, 5, 10, 15)
USE_WHEN = {  # words above the plan that serves best
    "time-first, groups of 1 view": "any image at once:\nfilms of one view",
    "interleaved, groups of 16 views": "small file, quick access:\ninterleaved, groups of 16 views",
    "stills": "each instant alone",
    "time-first": "smallest file:\ntime-first",
}
HEIGHT = 180


def main() -> None:
    """Write the pictures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=("charts",), help="the charts that are drawn from records alone")
    access_chart()
    crossing_chart()
    if parser.parse_args().only is None:
        taken()


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
    finished(figure, "takes_access.png", ncols=3)


def crossing_chart() -> None:
    """Draw time-first against view-first over the ratio of decorrelations, by number of references."""
    figure = new_figure(9.5, 4.4)
    panels = figure.subplots(1, 2, sharey=True)
    for axes, refs, title in zip(panels, (8, 1), ("8 references", "1 reference"), strict=True):
        for i, pitch in enumerate(crossing.PITCHES):
            rows = [row for row in crossing.rows() if (row["refs"], row["pitch_px"]) == (refs, pitch)]
            for kind, face in (("plain", "0.35"), ("compensated", "none")):
                places = [(crossing.ratios(row, kind)[0], row["rate"]) for row in rows]
                label = f"apples, lens pitch {pitch} px" if (refs, kind) == (1, "plain") else None
                drawn(axes, places, MARKERS[i], "0.35", label=label, markerfacecolor=face)
        for i, take in enumerate(TAKES):
            drawn(axes, take_places(take, refs), "o", COLOURS[i], label=f"take {take}" if refs == 8 else None)
        axes.axhline(0, color="0.5", linewidth=0.8)
        axes.axvline(1, color="0.5", linewidth=0.8, linestyle=":")
        axes.set_xscale("log")
        axes.set_xlabel("(1 − c in time) / (1 − c in view)")
        axes.set_title(title, loc="left", fontsize=10)
    panels[0].set_ylabel("rate of time-first against view-first [%]")
    finished(figure, "takes_crossing.png", ncols=3)


def take_places(take: str, refs: int) -> list[tuple[float, float | None]]:
    """Return ratio of decorrelations and rate of a take: for 8 references at each speed, for one at its own speed."""
    rows = {row["step"]: row for row in RECORDS.rows(scale=SCALE, take=take) if "step" in row}
    ratios = {
        step: (1 - row["time_correlation"]) / (1 - row["view_correlation"]) for step, row in sorted(rows.items())
    }
    if refs == 8:
        return [(ratios[step], difference(*(rows[step]["curves"][name] for name in ONE_WAY))) for step in ratios]
    coded = {row["what"]: row for row in neighbours.RECORDS.rows(scale=SCALE, take=take)}
    pair = [coded.get(f"{name}, 1 reference") for name in ONE_WAY]
    return (
        [] if None in pair or 1 not in ratios else [(ratios[1], difference(*(row["points"] for row in pair if row)))]
    )


def drawn(axes: Axes, places: Sequence[tuple[float, float | None]], marker: str, colour: str, **look: Any) -> None:
    """Draw the defined rates over their ratios, by rising ratio."""
    known = sorted((x, y) for x, y in places if y is not None)
    if known:
        axes.plot(*np.array(known).T, marker=marker, color=colour, linewidth=0.8, **look)


def finished(figure: Figure, name: str, *, ncols: int) -> None:
    """Add grid and legend to a chart, and write it among the pictures of the pages."""
    for axes in figure.axes:
        axes.grid(True, color="0.9", linewidth=0.8)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside lower left", ncols=ncols, frameon=False, fontsize=8)
    out = ROOT / "out" / name
    out.parent.mkdir(exist_ok=True)
    write_picture(IMAGES / name, save(figure, out, dpi=110))


def taken() -> None:
    """Write frames of the takes, and the chart over time."""
    rows = []
    for take in TAKES:
        video = rendered(take, SCALE)
        u, v = video.structure.ei_pixels
        views = [video.component(frame, "si", (u // 2, v // 2)) for frame in SHOWN]
        rows.append(np.hstack([np.asarray(Image.fromarray(view).resize((2 * HEIGHT, HEIGHT), 0)) for view in views]))
    write_picture(IMAGES / "takes_frames.webp", np.vstack(rows))
    video = rendered("car", SCALE)
    some = video_of([video[frame] for frame in range(INSTANTS)], fps=video.fps)
    path = viewpoints_around(some.structure, INSTANTS)
    plans = {"stills": Plan(span=1), "time-first, 8 instants": Plan(walk="time-first")}
    measured = {
        name: measure_take(some, open_take(encode_take(some, SCHEME, qp=32, plan=plan)), viewpoints_mm=path)
        for name, plan in plans.items()
    }
    out = ROOT / "out" / "takes_time.png"
    out.parent.mkdir(exist_ok=True)
    write_picture(IMAGES / "takes_time.png", time_chart(measured, out))


if __name__ == "__main__":
    main()
