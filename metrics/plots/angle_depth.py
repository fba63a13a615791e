"""Charts of Q_angle over the viewing angle and of Q_depth over depth."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core.base import checks
from ii_core.depth.layers import logarithmic
from ii_core.display.figure import COLOURS, new_figure, plain_text, save

from ..measures.quality import AngleQuality, DepthQuality, told_outside
from .rd_chart import edges


def angle_figure(quality: AngleQuality) -> Any:
    """Return the figure of `metrics.plot_angle`."""
    values = quality.values
    figure = new_figure(6.2, 5.2, "compressed")  # layout for axes of fixed aspect ratio
    axes: Any = figure.add_subplot()
    v, u = values.shape
    across, down = np.arange(u, dtype=float), np.arange(v, dtype=float)
    degrees = quality.u_deg is not None
    if quality.u_deg is not None and quality.v_deg is not None:
        across, down = quality.u_deg, quality.v_deg
        values = values[np.argsort(down)][:, np.argsort(across)]
        across, down = np.sort(across), np.sort(down)
    else:
        axes.invert_yaxis()
    finite = values[np.isfinite(values)]
    low, high = (finite.min(), finite.max()) if finite.size else (0.0, 1.0)
    if high - low < 0.1:  # dB; a smaller range would show rounding errors as structure
        low, high = (low + high) / 2 - 0.05, (low + high) / 2 + 0.05
    axes.set_facecolor("0.85")
    shown = np.where(np.isfinite(values), values, np.nan)
    map_ = axes.pcolormesh(
        edges(across, 0.5), edges(down, 0.5), shown, cmap="cividis", vmin=low, vmax=high, rasterized=True
    )
    if finite.size < values.size:
        axes.patch.set_hatch("///")
        axes.patch.set_edgecolor("0.6")
        axes.set_title("Q_angle; hatched: identical", loc="left")
    else:
        axes.set_title("Q_angle", loc="left")
    if finite.size:
        bar = figure.colorbar(map_, ax=axes, shrink=0.9)
        bar.set_label("PSNR of the sub-image [dB]")
    axes.set_xlabel("horizontal viewing angle [°]" if degrees else "column u of the elementary image [px]")
    axes.set_ylabel("vertical viewing angle [°]" if degrees else "row v of the elementary image [px]")
    axes.set_aspect("equal")
    return figure


@checks.checked(quality=checks.instance(DepthQuality), path=checks.path)
def plot_depth(quality: DepthQuality, path: str | os.PathLike[str]) -> Path:
    """Draw Q_depth over depth, and below it the number of view pixels in each layer.

    Layers without pixels are gaps. Identical layers are hollow markers on the upper edge.

    Parameters
    ----------
    quality : DepthQuality
        From `q_depth`.
    path : path
        .png, .pdf or .svg; replaced whole, and returned.

    Raises
    ------
    ValueError
        If the suffix is unknown.

    References
    ----------
    Olsson 2008, (4.9), Figure 5.21.
    """
    return save(_depth_figure(quality), path)


def _depth_figure(quality: DepthQuality) -> Any:
    figure = new_figure(7.5, 5)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[3, 1])
    z, values = quality.depth_mm, quality.values
    finite = np.isfinite(values)
    upper.plot(z, np.where(finite, values, np.nan), color=COLOURS[0], linewidth=1, zorder=2)
    # Markers grow with the number of pixels: a layer of three pixels means less than one of thousands.
    size = 4 + 40 * np.sqrt(quality.counts / max(quality.counts.max(), 1))
    upper.scatter(z[finite], values[finite], s=size[finite], color=COLOURS[0], zorder=3, linewidths=0)
    same = np.isposinf(values)
    if same.any():
        top = upper.get_xaxis_transform()
        upper.plot(
            z[same], np.ones(same.sum()), "o", transform=top, clip_on=False, mfc="white", color=COLOURS[0], ms=5
        )
        upper.annotate("○ identical", (1, 1.03), xycoords="axes fraction", ha="right", fontsize=9)
    title = f"Q_depth; depth: {plain_text(quality.source)}"
    if finite.any():
        mean = 10 * np.log10(quality.counts.sum() / _squared(quality).sum())
        upper.axhline(mean, color="0.4", linewidth=1, linestyle="--", zorder=1)
        title += f"; dashed: all layers pooled, {mean:.1f} dB"
    else:
        upper.set_yticks([])
    upper.set_ylabel(r"$Q_\mathrm{depth}$ [dB]")
    upper.set_title(title, loc="left", fontsize=11, pad=14)
    lower.vlines(z, 0.5, np.maximum(quality.counts, 0.5), color="0.35", linewidth=1.5)
    lower.set_yscale("log")
    lower.set_ylim(0.5, 2 * max(quality.counts.max(), 1))
    lower.set_ylabel("view pixels")
    lower.set_xlabel("depth z [mm]")
    if logarithmic(z):
        lower.set_xscale("log")
    lower.set_title(told_outside(quality.outside_share), loc="right", fontsize=9)
    for axes in (upper, lower):
        axes.grid(True, color="0.9", linewidth=0.8)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    return figure


def _squared(quality: DepthQuality) -> NDArray[np.float64]:
    """Squared errors of each layer, in squared peaks, per pixel of the layer."""
    held = quality.counts > 0
    return quality.counts[held] / 10 ** (quality.values[held] / 10)
