"""Pictures of the page of videos: frames of takes, and charts of random access and over time.

    python -m benchmarks run video [--only charts]

Views are the middle sub-images of frames that `benchmarks.coding.takes` renders.
"""

from __future__ import annotations

import argparse

import numpy as np
from PIL import Image

from benchmarks.coding.takes import FRAMES, PLANS, SCALE, SCHEME, TAKES, by_plan, difference, rendered
from benchmarks.pages.pictures import IMAGES, tidy, write_chart, write_picture
from codec import Plan, component_cost, encode_take, open_take
from ii_core import video_of
from ii_core.display.figure import COLOURS, MARKERS, new_figure
from ii_core.display.look import viewpoints_around
from metrics import measure_take, time_chart

SHOWN, INSTANTS = (0, 5, 10, 15), 8
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
    tidy(axes)
    figure.legend(loc="outside lower left", ncols=3, frameon=False, fontsize=8)
    write_chart(figure, "takes_access.png", dpi=110)


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
    places = viewpoints_around(some.structure, INSTANTS)
    plans = {"stills": Plan(span=1), "time-first, 8 instants": Plan(walk="time-first")}
    measured = {
        name: measure_take(some, open_take(encode_take(some, SCHEME, qp=32, plan=plan)), viewpoints_mm=places)
        for name, plan in plans.items()
    }
    path = IMAGES / "takes_time.png"
    write_picture(path, time_chart(measured, path))
