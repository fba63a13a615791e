"""Chart of quality over time."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ii_core.base import checks
from ii_core.display.figure import COLOURS, check_suffix, new_figure, plain_text, save

from ..measures.over_time import TakeQuality


@checks.checked(takes=checks.mapping, path=checks.path)
def time_chart(takes: Mapping[str, TakeQuality], path: str | os.PathLike[str]) -> Path:
    """Draw Q_global, the range of Q_angle, flicker and, if measured, the moving viewer's PSNR over time.

    Parameters
    ----------
    takes : mapping of str to TakeQuality
        Qualities of takes by their names in the legend.
    path : path
        .png, .pdf or .svg; replaced whole, and returned.

    Raises
    ------
    ValueError
        If the suffix is unknown, or there is nothing to draw.
    OSError
        If the file cannot be written.
    """
    check_suffix(path)
    if not takes:
        raise ValueError("there are no takes: at least one is needed")
    for name, quality in takes.items():
        checks.text("takes has a name that", name)
        checks.instance(TakeQuality)(f"takes[{name!r}]", quality)
    seen = any(quality.view_psnr is not None for quality in takes.values())
    panels = [
        "Q_global [dB],\nband: Q_angle",
        *(["moving viewer,\nPSNR [dB]"] if seen else []),
        "flicker\n[8-bit steps]",
    ]
    figure = new_figure(8, 1.2 + 2 * len(panels))
    axes: Any = figure.subplots(len(panels), 1, sharex=True)
    for i, (name, quality) in enumerate(takes.items()):
        seconds, colour = np.arange(len(quality.q_global)) / quality.fps, COLOURS[i % len(COLOURS)]
        axes[0].plot(seconds, quality.q_global, color=colour, label=plain_text(name))
        angles = quality.q_angle.reshape(len(seconds), -1)
        axes[0].fill_between(seconds, angles.min(axis=1), angles.max(axis=1), color=colour, alpha=0.15, linewidth=0)
        if quality.view_psnr is not None:
            axes[1].plot(seconds, quality.view_psnr, color=colour)
        axes[-1].plot(seconds, quality.flicker, color=colour)
    for axis, label in zip(axes, panels, strict=True):
        axis.set_ylabel(label)
        axis.grid(True, color="0.9", linewidth=0.8)
        axis.spines[["top", "right"]].set_visible(False)
    axes[-1].set_xlabel("time [s]")
    figure.legend(loc="outside lower left", ncols=2, frameon=False, fontsize=9)
    return save(figure, path, dpi=150)
