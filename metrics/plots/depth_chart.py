"""Chart of Q_depth over rate: an image over depth, and its minimum, mean and maximum."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core.base import checks
from ii_core.depth.layers import logarithmic
from ii_core.display.figure import COLOURS, LINES, MARKERS, check_suffix, new_figure, plain_text, save

from ..measures.quality import told_outside
from ..rates.points import is_study
from .rd_chart import edges, set_rate_axis

EXTREMES = ("q_depth_min", "q_depth_mean", "q_depth_max")
Floats = NDArray[np.float64]


@checks.checked(study=is_study, scheme=checks.text)
def depth_over_rate(study: Mapping[str, Any], scheme: str) -> tuple[Floats, Floats, Floats]:
    """Return Q_depth of a scheme as a function of rate and depth.

    Parameters
    ----------
    study : dict
        From `read_study`, measured with ``q_depth``.
    scheme : str

    Returns
    -------
    rates : ndarray, (n,)
        bpp, strictly increasing.
    depth_mm : ndarray, (layers,)
    values : ndarray, (n, layers)
        dB; NaN for layers without pixels, +inf for identical layers.

    Raises
    ------
    ValueError
        If the study lacks Q_depth or the scheme, or the scheme's points have different layers.

    References
    ----------
    Olsson 2008, §4.5, Figure 5.23.
    """
    points = {p["bpp"]: p for p in study["points"] if p["scheme"] == scheme}
    if not points:
        raise ValueError(f"the study has no scheme {scheme!r}")
    if not all("q_depth" in p for p in points.values()):
        raise ValueError("the study has no q_depth in every layer: measure q_depth_min, q_depth_mean or q_depth_max")
    rates = sorted(points)
    layers = np.array(points[rates[0]]["depth_mm"], np.float64)
    if any(not np.array_equal(p["depth_mm"], layers) for p in points.values()):
        raise ValueError(f"the points of {scheme} have different depth layers")
    return np.array(rates), layers, np.array([points[rate]["q_depth"] for rate in rates], np.float64)


@checks.checked(study=is_study, path=checks.path)
def depth_rate_chart(study: Mapping[str, Any], path: str | os.PathLike[str]) -> Path:
    """Draw Q_depth over rate: for every scheme an image over rate and depth, and below it min, mean and max.

    A column of the image reaches halfway to the next measured rate on the logarithmic axis. Layers without pixels are
    grey, identical layers hatched. The title gives the share of view pixels that are in no layer.

    Parameters
    ----------
    study : dict
        From `read_study`, measured with q_depth_min, q_depth_mean and q_depth_max.
    path : path
        .png, .pdf or .svg; replaced whole, and returned.

    Raises
    ------
    ValueError
        If the suffix is unknown, or the study has no points or no Q_depth.
    """
    check_suffix(path)
    return save(draw_depth_rate(study), path, dpi=150)


def draw_depth_rate(study: Mapping[str, Any]) -> Any:
    """Return the matplotlib Figure of `depth_rate_chart`."""
    points = study["points"]
    if not points:
        raise ValueError("the study has no points: nothing to draw")
    schemes = list(dict.fromkeys(p["scheme"] for p in points))
    images = [depth_over_rate(study, scheme) for scheme in schemes]
    if missing := [name for name in EXTREMES if any(name not in p for p in points)]:
        raise ValueError(f"the study has no {', '.join(missing)}")
    figure = new_figure(2.9 * len(schemes) + 1.2, 6.2)
    panels = figure.subplots(2, len(schemes), squeeze=False, height_ratios=[3, 2], sharex=True, sharey="row")
    finite = np.concatenate([v[np.isfinite(v)] for *_, v in images])
    low, high = (finite.min(), finite.max()) if finite.size else (0.0, 1.0)
    held = np.any([np.any(~np.isnan(v), axis=0) for *_, v in images], axis=0)
    for axes, scheme, image in zip(panels[0], schemes, images, strict=True):
        map_ = _image(axes, *image, held, (low, max(high, low + 0.1)))
        axes.set_title(plain_text(scheme), fontsize=10)
    for axes, scheme in zip(panels[1], schemes, strict=True):
        _extremes(axes, [p for p in points if p["scheme"] == scheme])
        set_rate_axis(axes, points)
    if all(logarithmic(depth) for _, depth, _ in images):
        panels[0, 0].set_yscale("log")
    panels[0, 0].set_ylabel("depth z [mm]")
    panels[1, 0].set_ylabel(r"$Q_\mathrm{depth}$ [dB]")
    handles, names = panels[1, 0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower right", ncols=3, frameon=False, fontsize=9)
    figure.colorbar(map_, ax=panels[0].tolist(), label=r"$Q_\mathrm{depth}$ [dB]")
    lost = [p["depth_outside"] for p in points if "depth_outside" in p]
    told = f": {told_outside(max(lost))}" if lost else ""  # equal for all points: depth is that of the reference
    figure.suptitle(plain_text(study.get("picture", {"name": ""})["name"]) + told, x=0.01, ha="left", fontsize=12)
    return figure


def _image(axes: Any, rates: Floats, depth: Floats, values: Floats, held: Any, scale: tuple[float, float]) -> Any:
    """Draw the image of one scheme over all layers with pixels in any scheme."""
    rows = slice(*(np.flatnonzero(held)[[0, -1]] + [0, 1])) if held.any() else slice(None)
    across, down = np.exp(edges(np.log(rates), 0.35)), edges(depth, depth[0] / 2)[rows.start : _past(rows.stop)]
    shown = np.where(np.isfinite(values), values, np.nan)[:, rows]
    axes.set_facecolor("0.85")
    map_ = axes.pcolormesh(across, down, shown.T, cmap="cividis", vmin=scale[0], vmax=scale[1], rasterized=True)
    same = np.where(np.isposinf(values[:, rows]).T, 1.0, np.nan)
    if np.isfinite(same).any():
        axes.pcolor(across, down, same, hatch="///", alpha=0, rasterized=True)
    return map_


def _past(stop: int | None) -> int | None:
    return None if stop is None else stop + 1


def _extremes(axes: Any, points: Sequence[Mapping[str, Any]]) -> None:
    """Draw minimum, mean and maximum over rate."""
    points = sorted(points, key=lambda p: p["bpp"])
    rates = [p["bpp"] for p in points]
    for i, (name, text) in enumerate(zip(EXTREMES, ("min", "mean", "max"), strict=True)):
        values = [p[name] if math.isfinite(p[name]) else math.nan for p in points]
        axes.plot(rates, values, LINES[i], marker=MARKERS[i], color=COLOURS[i], markersize=5, label=text)
