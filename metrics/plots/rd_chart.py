"""Rate–distortion chart of a study."""

from __future__ import annotations

import io
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core.base import checks
from ii_core.base.extras import load
from ii_core.display.figure import COLOURS, LINES, MARKERS, check_suffix, new_figure, plain_text, save

from ..measures.measure import measure_of
from ..rates.points import check_measured, is_study, limit_of


@checks.checked(study=is_study, path=checks.path, measure=checks.text)
def rd_chart(study: Mapping[str, Any], path: str | os.PathLike[str], *, measure: str = "q_global") -> Path:
    """Draw a quality over rate, one line per scheme.

    Filled markers are targets met, joined by lines. A hollow marker is the nearest rate to a target that the scheme
    does not meet; a dotted line marks it if it is the least (or largest) rate of the scheme. Lossless points lie on
    the upper edge.

    Parameters
    ----------
    study : dict
        From `read_study`.
    path : path
        .png, .pdf or .svg; replaced whole, and returned.
    measure : str
        Name of a measure that the study holds.

    Raises
    ------
    ValueError
        If the suffix is unknown, or the study has no points or lacks the measure.
    OSError
        If the file cannot be written.
    """
    check_suffix(path)
    return save(draw(study, measure), path, dpi=150)


def chart_png(study: Mapping[str, Any], measure: str = "q_global") -> bytes:
    """Return the PNG of `rd_chart` as bytes."""
    drawn = io.BytesIO()
    draw(study, measure).savefig(drawn, dpi=100, format="png")
    return drawn.getvalue()


def draw(study: Mapping[str, Any], measure: str = "q_global") -> Any:
    """Return the matplotlib Figure of `rd_chart`."""
    points = study["points"]
    if not points:
        raise ValueError("the study has no points: nothing to draw")
    check_measured(points, measure)
    figure = new_figure(8, 5.2)
    axes: Any = figure.add_subplot()
    set_rate_axis(axes, points)
    axes.set_ylabel(measure_of(measure).axis)
    schemes = list(dict.fromkeys(point["scheme"] for point in points))
    for i, scheme in enumerate(schemes):
        _draw(axes, [point for point in points if point["scheme"] == scheme], i, measure)
    if not all(point["reached"] for point in points):
        style = {"color": "0.4", "marker": "o", "linestyle": ":"}
        axes.plot([], [], markerfacecolor="white", label="target not met: nearest rate", **style)
    axes.set_title(plain_text(study.get("picture", {"name": ""})["name"]), loc="left")
    # Below the axes the legend has space for long scheme names, and covers no curve.
    figure.legend(loc="outside lower left", ncols=2, frameon=False, fontsize=9, handlelength=3)
    return figure


def set_rate_axis(axes: Any, points: Sequence[Mapping[str, Any]]) -> None:
    """Set a logarithmic axis of rates that contains all points, and a light grid."""
    ticker = load("matplotlib.ticker")
    rates = [point["bpp"] for point in points]
    axes.set_xscale("log")
    axes.set_xlim(min(rates) / 1.3, max(rates) * 1.3)
    axes.xaxis.set_major_locator(ticker.LogLocator(base=10, subs=(1, 2, 5), numticks=50))
    axes.xaxis.set_major_formatter(ticker.FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_locator(ticker.NullLocator())
    axes.set_xlabel("rate [bit/pixel]")
    axes.grid(True, color="0.9", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def _draw(axes: Any, points: Sequence[Mapping[str, Any]], i: int, measure: str) -> None:
    """Draw the i-th scheme."""
    colour, marker = COLOURS[i % len(COLOURS)], MARKERS[i % len(MARKERS)]
    line = LINES[i // len(COLOURS) % len(LINES)]
    finite = [point for point in points if math.isfinite(point[measure])]
    met = sorted({(p["bpp"], p[measure]) for p in finite if p["reached"]})
    missed = sorted({(p["bpp"], p[measure]) for p in finite if not p["reached"]} - set(met))
    lossless = sorted({p["bpp"] for p in points if p[measure] == measure_of(measure).best})

    label = plain_text(points[0]["scheme"])
    limits = [(limit_of(point, points), point["bpp"]) for point in points if not point["reached"]]
    floor = min((rate for limit, rate in limits if limit == "floor"), default=None)
    ceiling = max((rate for limit, rate in limits if limit == "ceiling"), default=None)
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


def edges(centres: NDArray[np.float64], alone: float) -> NDArray[np.float64]:
    """Return borders halfway between centres; ``alone`` is half the width of a single cell."""
    if centres.size == 1:
        return centres[0] + np.array([-alone, alone])
    inner = (centres[1:] + centres[:-1]) / 2
    return np.concatenate([[2 * centres[0] - inner[0]], inner, [2 * centres[-1] - inner[-1]]])
