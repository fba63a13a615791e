"""Diagram of depth from focus: the lenses of B and R, the filter h, the lenses of the robust method.

    python -m benchmarks run focus_patterns

The picture is ``docs/images/focus_patterns.png``, drawn from the defaults in the code alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.pages.pictures import write_picture
from benchmarks.records import ROOT
from ii_core import preset
from ii_core.display.figure import COLOURS, new_figure, save
from metrics import linear_layers
from metrics.depth.focus import BASE, FILTER, REFERENCE
from metrics.depth.lens_tables import NOWHERE, pixels_per_lens, whole_pixel_steps

CHART = ROOT / "docs/images/focus_patterns.png"


def main() -> None:
    """Draw and save."""
    figure = new_figure(13, 4.2)
    patterns, weights, steps = figure.subplots(1, 3, width_ratios=[4, 3, 5])
    _patterns(patterns)
    _filter(weights)
    _whole_pixels(steps)
    save(figure, CHART)
    write_picture(CHART, CHART)


def _patterns(axes: Any) -> None:
    axes.plot(*REFERENCE.T, "s", color=COLOURS[1], markersize=9, markerfacecolor="none", label="reference R")
    axes.plot(*BASE.T, "o", color=COLOURS[0], markersize=4, label="base B")
    axes.set_aspect("equal")
    axes.invert_yaxis()
    axes.set_xlabel("lenses to the right")
    axes.set_ylabel("lenses down")
    axes.set_title(f"{len(BASE)} + {len(REFERENCE)} elementary images", loc="left", fontsize=10)
    axes.legend(loc="upper left", bbox_to_anchor=(0, -0.18), ncols=2, frameon=False)
    axes.grid(True, color="0.92")


def _filter(axes: Any) -> None:
    rows, cols = FILTER.shape
    share = FILTER / FILTER.sum()
    axes.imshow(share, cmap="cividis", vmin=0, vmax=2 * share.max(), extent=_around(cols, rows))
    for (row, col), value in np.ndenumerate(share):
        axes.text(
            col - cols // 2, row - rows // 2, f"{value:.2g}", ha="center", va="center", color="white", fontsize=8
        )
    axes.set_xlabel("view pixels to the right")
    axes.set_ylabel("view pixels down")
    axes.set_title("filter h, as shares", loc="left", fontsize=10)


def _around(cols: int, rows: int) -> tuple[float, float, float, float]:
    return -cols / 2, cols / 2, rows / 2, -rows / 2


def _whole_pixels(axes: Any) -> None:
    camera = preset("setup1")
    layers = linear_layers(camera)
    u = camera.ei_pixels[0]
    reach = whole_pixel_steps(pixels_per_lens(camera, layers) * u, u)
    d = np.broadcast_to(np.arange(1, len(layers) + 1)[:, None], reach.shape)
    held = np.abs(reach) < NOWHERE
    axes.plot(reach[held], d[held], ".", color=COLOURS[2], markersize=1.5, label="robust, setup1")
    for lens in np.unique(REFERENCE[:, 0]):
        axes.axvline(lens, color=COLOURS[1], linewidth=0.8, label="R" if lens == 0 else None)
    axes.set_xlabel("lenses to the right (down likewise)")
    axes.set_ylabel("depth layer d")
    axes.set_title("where a point falls on whole pixels", loc="left", fontsize=10)
    axes.legend(loc="lower right", frameon=False)
