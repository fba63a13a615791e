"""Charts of the study, drawn from its records."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.pages.pictures import tidy
from benchmarks.records import number
from ii_core.display.figure import COLOURS, LINES, MARKERS, new_figure, save
from metrics.plots.depth_chart import depth_rate_chart
from metrics.plots.rd_chart import edges, set_rate_axis

from .claims import NAMES, Results, of_scenes
from .rates import REFERENCE, SI, VOLUME

LABELS = {
    **{scheme: f"{name}-PVS" for scheme, name in NAMES.items()},
    REFERENCE: "JPEG 2000",
    VOLUME: "SI-PVI",
    "si-jp3d": "SI-PVI, 9/7",
    "si-h264": "SI-PVS, 4:4:4",
    "ei-h264": "EI-PVS, 4:4:4",
    "si-hevc": "SI, HEVC",
    "ei-hevc:fast": "EI, HEVC",
    "si-av1": "SI, AV1",
    "ei-av1:fast": "EI, AV1",
}
THEIRS = (SI, VOLUME, "ri-h264:chroma=420", "ei-h264:chroma=420", REFERENCE)  # schemes of Figure 5.10
AXIS = {
    "q_global": r"$Q_\mathrm{global}$ [dB]",
    "q_view": r"$Q_\mathrm{view}$, mean MSSIM",
    "q_depth_mean": r"$Q_\mathrm{depth}$, mean [dB]",
}


def draw_all(results: Results, folder: Path) -> list[Path]:
    """Draw every chart that the results allow into a folder."""
    made: list[Path] = []
    for name, draw in CHARTS.items():
        figure = draw(results)
        if figure is not None:
            made.append(folder / f"{name}.png")
            save(figure, made[-1], dpi=90)
    if result := of_scenes(results, "views").get("apples"):
        made.append(folder / "depth-rate-apples.png")
        depth_rate_chart(depth_study("apples", result), made[-1])
    return made


def over_rate(step: str, schemes: Sequence[str], quality: str = "q_global") -> Callable[[Results], Any]:
    """Draw quality over rate, one panel per scene; hollow markers are least rates."""

    def draw(results: Results) -> Any:
        made = of_scenes(results, step)
        if not made:
            return None
        figure, panels = scene_panels(made)
        for axes, result in zip(panels, made.values(), strict=True):
            for i, scheme in enumerate(schemes):
                curve(axes, [p for p in result["points"] if p["scheme"] == scheme], i, quality, label_of(scheme))
            set_rate_axis(axes, [p for p in result["points"] if p["scheme"] in schemes])
        return finished(figure, panels, AXIS[quality])

    return draw


def label_of(scheme: str) -> str:
    """Return the label of a scheme."""
    return LABELS.get(scheme, scheme.removeprefix(f"{SI},").removeprefix("order="))


def scene_panels(made: Mapping[str, Any]) -> tuple[Any, list[Any]]:
    """Return a figure with one panel per scene, two in a row."""
    columns = min(2, len(made))
    rows = -(-len(made) // columns)
    figure = new_figure(4.6 * columns, 3.1 * rows + 0.5)
    panels = list(figure.subplots(rows, columns, squeeze=False).flat)
    for axes, scene in zip(panels, made, strict=False):
        axes.set_title(scene, loc="left", fontsize=10)
        tidy(axes)
    return figure, panels[: len(made)]


def curve(axes: Any, points: Sequence[Mapping[str, Any]], i: int, quality: str, label: str) -> None:
    """Draw the curve of a scheme."""
    points = sorted(points, key=lambda p: p["bpp"])
    style = {"color": COLOURS[i % len(COLOURS)], "marker": MARKERS[i % len(MARKERS)], "markersize": 4}
    style |= {"linestyle": LINES[i // len(COLOURS) % len(LINES)], "linewidth": 1.4}
    axes.plot([p["bpp"] for p in points], [number(p[quality]) for p in points], label=label, **style)
    lowest = [p for p in points if not p["reached"] and p["bpp"] > p["target_bpp"]][:1]
    style |= {"markerfacecolor": "white", "linestyle": "none"}
    axes.plot([p["bpp"] for p in lowest], [number(p[quality]) for p in lowest], zorder=3, **style)


def finished(figure: Any, panels: Sequence[Any], axis: str) -> Any:
    """Add a legend below and the label of the quality."""
    for axes in panels:
        if axes.get_subplotspec().is_first_col():
            axes.set_ylabel(axis)
    handles, names = panels[0].get_legend_handles_labels()
    figure.legend(
        handles, names, loc="outside lower left", ncols=5 if len(panels) > 1 else 3, frameon=False, fontsize=8
    )
    return figure


def depth_study(scene: str, result: Mapping[str, Any]) -> dict[str, Any]:
    """Return a study of the schemes of Figures 5.21 and 5.22 for `depth_rate_chart`."""
    points = []
    for scheme in (SI, "ei-h264:chroma=420", VOLUME, REFERENCE):
        for p in result["points"]:
            if p["scheme"] == scheme:
                numbers = {key: number(p[key]) for key in p if key.startswith("q_depth_")}
                layers = [number(value) for value in p["q_depth"]]
                points.append(
                    {**p, **numbers, "scheme": label_of(scheme), "q_depth": layers, "depth_mm": result["depth_mm"]}
                )
    return {"picture": {"name": scene}, "points": points}


def layers(results: Results) -> Any:
    """Draw Figure 5.21: Q_depth of every layer at equal Q_global."""
    made = of_scenes(results, "equal")
    if not made:
        return None
    figure, panels = scene_panels(made)
    for axes, result in zip(panels, made.values(), strict=True):
        held = np.flatnonzero(result["depth_pixels"])
        for i, scheme in enumerate(THEIRS):
            row = next(row for row in result["rows"] if row["scheme"] == scheme)
            values = np.array([number(value) for value in row["q_depth"]])[held]
            values[~np.isfinite(values)] = np.nan
            axes.plot(held + 1, values, color=COLOURS[i], lw=1, label=label_of(scheme))
        axes.set_xlabel("depth layer d")
    return finished(figure, panels, r"$Q_\mathrm{depth}$ [dB]")


def angles(results: Results) -> Any:
    """Draw Figure 4.6: PSNR of the middle row of sub-images at equal Q_global."""
    made = of_scenes(results, "equal")
    if not made:
        return None
    figure, panels = scene_panels(made)
    for axes, result in zip(panels, made.values(), strict=True):
        across = np.argsort(result["angle_deg"])
        for i, scheme in enumerate(THEIRS):
            row = next(row for row in result["rows"] if row["scheme"] == scheme)
            values = np.array([number(value) for value in row["q_angle"]])[across]
            axes.plot(np.sort(result["angle_deg"]), values, color=COLOURS[i], lw=1.2, label=label_of(scheme))
            axes.axhline(row["q_global"], color=COLOURS[i], lw=0.7, ls=":")
        axes.set_xlabel("view angle [°]")
    return finished(figure, panels, "PSNR [dB]; dotted: of all")


def structures(results: Results) -> Any:
    """Draw Figure 5.12: SI minus EI over rate, for every size of elementary image."""
    made = {scene: results[f"plane-{scene}-1"] for scene in ("apples", "car") if f"plane-{scene}-1" in results}
    if not made:
        return None
    figure, panels = scene_panels(made)
    for axes, result in zip(panels, made.values(), strict=True):
        rates: list[float] = []
        for i, duel in enumerate(result["duels"]):
            si, ei = ({float(r): q for r, q in duel["psnr"][kind].items()} for kind in ("si", "ei"))
            both = sorted(si.keys() & ei.keys())
            rates += both
            label = f"{duel['lenses'][0]}×{duel['lenses'][1]}×{duel['side']}²"
            axes.plot(
                both, [si[r] - ei[r] for r in both], marker=MARKERS[i], color=COLOURS[i], label=label, markersize=4
            )
        axes.axhline(0, color="0.3", lw=0.8)
        set_rate_axis(axes, [{"bpp": rate} for rate in rates or [0.1, 1.0]])
    return finished(figure, panels, r"SI less EI, $\Delta Q_\mathrm{global}$ [dB]")


def plane(results: Results) -> Any:
    """Draw the best kind of component image over sizes of elementary image and picture, with theory."""
    duels = [d for name, result in results.items() if name.startswith("plane-apples-") for d in result["duels"]]
    if not duels:
        return None
    figure = new_figure(11, 4.2)
    for axes, rate in zip(figure.subplots(1, 3, sharey=True), (0.1, 0.4, 1.6), strict=True):
        sizes = sorted({math.sqrt(d["pixels"][0] * d["pixels"][1]) for d in duels})
        sides = sorted({d["side"] for d in duels})
        image = np.full((len(sides), len(sizes)), np.nan)
        for d in duels:
            cell = sides.index(d["side"]), sizes.index(math.sqrt(d["pixels"][0] * d["pixels"][1]))
            winner, lead = best_of(d, rate)
            if winner is not None:
                image[cell] = ("si", "ri", "ei").index(winner)
                axes.annotate(lead, (sizes[cell[1]], d["side"]), ha="center", va="center", fontsize=8)
        x, y = (2 ** edges(np.log2(np.array(values, float)), 0.5) for values in (sizes, sides))
        from matplotlib.colors import ListedColormap

        colours = ListedColormap(["#9ecae1", "#c7e9c0", "#fdd0a2"])
        axes.set_facecolor("0.85")
        axes.pcolormesh(x, y, image, cmap=colours, vmin=-0.5, vmax=2.5, edgecolors="white")
        size = np.geomspace(x[0], x[-1], 50)
        axes.plot(size, np.sqrt(size), "k-", lw=1.5, label=r"(5.14): $U \cdot V = \sqrt{M N}$")
        # Pictures are twice as wide as high: √M of (5.15), and U = L = N/U of (2.14), N = √(MN)/√2.
        axes.plot(size, np.sqrt(size * math.sqrt(2)), "k--", lw=1.2, label=r"(5.15): $U = \sqrt{M}$")
        axes.plot(size, np.sqrt(size / math.sqrt(2)), "k:", lw=1.2, label=r"by (2.14): $U = L$")
        axes.set(xscale="log", yscale="log", xlim=(x[0], x[-1]), ylim=(y[0], y[-1]), title=f"{rate:g} bit/pixel")
        axes.set_xticks(sizes, [f"{s:.0f}" for s in sizes])
        axes.set_yticks(sides, [f"{s}²" for s in sides])
        axes.minorticks_off()
        axes.set_xlabel(r"picture, $\sqrt{M N}$ [pixels]")
    from matplotlib.patches import Patch

    figure.axes[0].set_ylabel("elementary image [pixels]")
    handles, _ = figure.axes[0].get_legend_handles_labels()
    kinds = [Patch(color=colours(i), label=name) for i, name in enumerate(("SI best", "RI best", "EI best"))]
    figure.legend(handles=[*kinds, *handles], loc="outside lower left", ncols=6, frameon=False, fontsize=8)
    return figure


def best_of(duel: Mapping[str, Any], rate: float) -> tuple[str | None, str]:
    """Return the best kind at a rate and its lead in dB; the kind alone if no other reaches the rate."""
    there = {kind: points[f"{rate:g}"] for kind, points in duel["psnr"].items() if f"{rate:g}" in points}
    if not there:
        return None, ""
    ranked = sorted(there, key=lambda kind: -there[kind])
    if len(ranked) == 1:
        return ranked[0], f"{ranked[0].upper()} alone"
    return ranked[0], f"{ranked[0].upper()} +{there[ranked[0]] - there[ranked[1]]:.1f}"


CHARTS: dict[str, Callable[[Results], Any]] = {
    "rates": over_rate("rates", THEIRS),
    "orders": over_rate(
        "orders", tuple(f"{SI},order={o}" for o in ("row", "column", "parallel", "zigzag", "spiral"))
    ),
    "structures": structures,
    "plane": plane,
    "q-view": over_rate("views", THEIRS, "q_view"),
    "layers": layers,
    "angles": angles,
}
