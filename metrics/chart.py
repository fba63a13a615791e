"""Rate–distortion charts, drawn from a study on disk and nothing else."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ii_core.files import atomic_path

# Okabe and Ito's colours, told apart by colour-blind readers too; their yellow is too pale on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
LINES = ("-", "--", "-.")
SUFFIXES = (".png", ".pdf", ".svg")


def rd_chart(study: Mapping[str, Any], path: str | os.PathLike[str]) -> None:
    """Draw Q_global over rate, a line a scheme.

    Filled markers are targets met, joined. A hollow marker is what a scheme gave for a target it cannot meet, and a
    dotted line marks the rate that it cannot go below (or above). Lossless points sit on the upper edge.

    Parameters
    ----------
    study : dict
        From `read_study`.
    path : path
        The suffix says what is written: .png, .pdf or .svg. Replaced, whole.

    Raises
    ------
    ValueError
        If the suffix is another, or the study has no points.
    OSError
        If the file cannot be written.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise ValueError(f"{path} is no known chart type: known are {', '.join(SUFFIXES)}")
    if not study["points"]:
        raise ValueError("the study has no points: nothing to draw")
    figure = draw(study)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=150, format=suffix[1:])


def draw(study: Mapping[str, Any]) -> Any:
    """The matplotlib Figure of a study with points; see `rd_chart`."""
    points = study["points"]
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 5.2), layout="constrained")
    FigureCanvasAgg(figure)
    axes: Any = figure.add_subplot()
    _set_axes(axes, points)
    schemes = list(dict.fromkeys(point["scheme"] for point in points))
    for i, scheme in enumerate(schemes):
        _draw(axes, [point for point in points if point["scheme"] == scheme], i)
    if not all(point["reached"] for point in points):
        style = {"color": "0.4", "marker": "o", "linestyle": ":"}
        axes.plot([], [], markerfacecolor="white", label="target out of reach: what came instead", **style)
    axes.set_title(study["picture"]["name"], loc="left")
    # Below the axes, where no curve can hide it and long scheme names have room.
    figure.legend(loc="outside lower left", ncols=2, frameon=False, fontsize=9, handlelength=3)
    return figure


def _set_axes(axes: Any, points: Sequence[Mapping[str, Any]]) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    rates = [point["bpp"] for point in points]
    axes.set_xscale("log")
    axes.set_xlim(min(rates) / 1.3, max(rates) * 1.3)
    axes.xaxis.set_major_locator(LogLocator(base=10, subs=(1, 2, 5), numticks=50))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlabel("rate [bit/pixel]")
    axes.set_ylabel(r"$Q_\mathrm{global}$ [dB]")
    axes.grid(True, color="0.9", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def _draw(axes: Any, points: Sequence[Mapping[str, Any]], i: int) -> None:
    """One scheme, the i-th."""
    colour, marker = COLOURS[i % len(COLOURS)], MARKERS[i % len(MARKERS)]
    line = LINES[i // len(COLOURS) % len(LINES)]
    finite = [point for point in points if math.isfinite(point["q_global"])]
    met = sorted({(p["bpp"], p["q_global"]) for p in finite if p["reached"]})
    missed = sorted({(p["bpp"], p["q_global"]) for p in finite if not p["reached"]} - set(met))
    lossless = sorted({p["bpp"] for p in points} - {p["bpp"] for p in finite})

    label = points[0]["scheme"]
    floor = min((p["bpp"] for p in points if not p["reached"] and p["bpp"] > p["target_bpp"]), default=None)
    ceiling = max((p["bpp"] for p in points if not p["reached"] and p["bpp"] <= p["target_bpp"]), default=None)
    for limit, words in ((floor, "not below"), (ceiling, "not above")):
        if limit is not None:
            label += f"  ({words} {limit:.2g} bpp)"
            axes.axvline(limit, color=colour, linewidth=1.2, linestyle=":", zorder=1.5)
    style = {"color": colour, "marker": marker, "markersize": 6}
    axes.plot(*_columns(met), linestyle=line, linewidth=1.8, label=label, **style)
    axes.plot(*_columns(missed), linestyle="none", markerfacecolor="white", markeredgewidth=1.6, zorder=3, **style)
    for rate in lossless:
        top = axes.get_xaxis_transform()  # x in bpp, y as a share of the axes
        axes.plot(rate, 1, transform=top, clip_on=False, linestyle="none", **style)
        axes.annotate(
            "lossless",
            (rate, 1),
            xycoords=top,
            xytext=(0, 6),
            textcoords="offset points",
            ha="center",
            fontsize=8,
            color=colour,
        )


def _columns(pairs: Sequence[tuple[float, float]]) -> tuple[list[float], list[float]]:
    return [x for x, _ in pairs], [y for _, y in pairs]
