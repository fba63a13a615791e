"""Chart of the page of bounds: `si-lf` against Gaussian views with and without geometry.

python -m benchmarks run lf_bounds_chart
"""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes

from benchmarks.coding.light_field_bounds import RECORDS, SCENES
from benchmarks.pages.video import finished
from ii_core.display.figure import COLOURS, new_figure

KINDS = {"apart": "views apart", "plain": "no geometry", "exact": "exact geometry"}


def main() -> None:
    """Draw rates over PSNR by scene, over the number of views, and over the error of disparity."""
    rows = RECORDS.by("scene", SCENES, scale=8)
    figure = new_figure(10.5, 6.6)
    panels = figure.subplots(2, 3).ravel()
    for axes, (name, row) in zip(panels, rows.items(), strict=False):
        lines(axes, row["curve"], "psnr", name == SCENES[0])
        axes.set_title(f"{name}, 16×16 views", loc="left", fontsize=10)
        axes.set_xlabel("PSNR [dB]")
    first = rows[SCENES[0]]
    lines(panels[4], first["views"], "side", False)
    panels[4].set_title(f"{SCENES[0]}, quantiser 38", loc="left", fontsize=10)
    panels[4].set_xlabel("views a side")
    panels[4].set_xscale("log", base=2)
    for i, (name, row) in enumerate(rows.items()):
        errors = row["errors"]
        across = [point["sigma"] for point in errors]
        panels[5].plot(across, [point["measured"] for point in errors], "o", color=COLOURS[i], label=name)
        panels[5].plot(across, [point["predicted"] for point in errors], color=COLOURS[i], linewidth=0.8)
    panels[5].set_title("36 dB: measured (marks), predicted", loc="left", fontsize=10)
    panels[5].set_xlabel("error of disparity, σ [samples]")
    for axes in panels[[0, 3]]:
        axes.set_ylabel("rate [bit/pixel]")
    finished(figure, "lf_bounds.png", ncols=4)


def lines(axes: Axes, points: list[dict[str, Any]], over: str, labelled: bool) -> None:
    """Rates of the coder and of the model over one of their parameters."""
    across = [point[over] for point in points]
    coded = [point["coded"] for point in points]
    axes.plot(across, coded, "o-", color="0.2", label="si-lf" if labelled else None)
    for kind, style in zip(KINDS, (":", "--", "-"), strict=True):
        rates = [point[kind] for point in points]
        axes.plot(across, rates, style, color="0.5", label=KINDS[kind] if labelled else None)
    axes.set_yscale("log")
    axes.set_ylim(0.01, 20)


if __name__ == "__main__":
    main()
