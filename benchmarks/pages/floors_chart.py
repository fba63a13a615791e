"""Chart of docs/structure.md: lowest rates of schemes by size of elementary images.

python -m benchmarks run floors_chart
"""

from __future__ import annotations

from typing import Any

from matplotlib.ticker import NullFormatter

from benchmarks.coding.headers import RECORDS, SCALE, SCENE, SIDES
from benchmarks.pages.pictures import tidy, write_chart
from ii_core.display.figure import COLOURS, MARKERS, new_figure

PANELS = {
    "ei": "elementary images",
    "si": "sub-images",
    "ri": "ray-space images",
    "": "plain pictures",
}
CODERS = ("h264", "hevc", "av1", "vp9", "mpeg2", "avif", "jp3d", "jpeg2000", "sperr", "htj2k", "jpeg", "jpegxl")


def main() -> None:
    """Draw the lowest rates of the scene and of a black picture; one panel for each kind of component image."""
    rows = [row for row in RECORDS.rows(part="floor", scene=SCENE, scale=SCALE) if row.get("floor_db") is not None]
    figure = new_figure(10, 7.6)
    panels = figure.subplots(2, 2, sharex=True, sharey=True).ravel()
    for axes, (kind, title) in zip(panels, PANELS.items(), strict=True):
        for i, coder in enumerate(CODERS):
            draw(axes, [row for row in rows if row["scheme"] == (f"{kind}-{coder}" if kind else coder)], i)
        axes.set_title(title, loc="left", fontsize=10)
        axes.set_xscale("log", base=2)
        axes.set_yscale("log")
        axes.set_xticks(SIDES, [f"{side}²" for side in SIDES])
        axes.xaxis.set_minor_formatter(NullFormatter())
    for axes in panels[2:]:
        axes.set_xlabel("pixels of an elementary image")
    for axes in panels[::2]:
        axes.set_ylabel("lowest rate [bpp]")
    for i, coder in enumerate(CODERS):
        panels[0].plot([], [], marker=MARKERS[i % 7], color=COLOURS[i % 7], mfc=face(i), linewidth=1, label=coder)
    panels[0].plot([], [], ":", color="0.3", label="black picture")
    tidy(*panels)
    figure.legend(loc="outside lower left", ncols=7, frameon=False, fontsize=8)
    write_chart(figure, "floors.png", dpi=110)


def draw(axes: Any, rows: list[dict[str, Any]], i: int) -> None:
    """Draw one scheme: marks and a line for the scene, dots for a black picture."""
    rows = sorted(rows, key=lambda row: row["side"])
    sides = [row["side"] for row in rows]
    look = {"color": COLOURS[i % 7], "linewidth": 1}
    axes.plot(sides, [row["floor_bpp"] for row in rows], marker=MARKERS[i % 7], mfc=face(i), markersize=6, **look)
    axes.plot(sides, [row["black_bpp"] for row in rows], ":", **look)


def face(i: int) -> str:
    """Return the colour inside the marks: those after the seventh coder are open."""
    return COLOURS[i % 7] if i < 7 else "white"
