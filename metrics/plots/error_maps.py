"""Error maps of views and of depth layers."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core import IIPicture
from ii_core.base import checks
from ii_core.depth.layers import view_of
from ii_core.display.figure import new_figure, save
from ii_core.picture.picture import peak

from ..measures.quality import DepthQuality

COLOURS_OF_ERRORS = "magma"
PANELS = 12  # largest number of panels on a sheet of layers: more would be too small to read
Floats = NDArray[np.float64]


def error_views_figure(shares: Mapping[str, Floats]) -> Any:
    """Return the figure of `metrics.plot_error_views`, from the error map of each view by name, (L, K)."""
    maps = {name: 255 * values for name, values in shares.items()}
    l, k = next(iter(maps.values())).shape
    figure = new_figure(3 * len(maps) + 1, 3 * min(max(l / k, 0.2), 3) + 0.6)
    panels = figure.subplots(1, len(maps))
    top = _top(np.concatenate([m.ravel() for m in maps.values()]))
    for axes, (name, values) in zip(panels, maps.items(), strict=True):
        shown = axes.imshow(values, cmap=COLOURS_OF_ERRORS, vmin=0, vmax=top, interpolation="nearest")
        mean = np.sqrt(np.nanmean(np.square(values))) if np.isfinite(values).any() else np.nan
        axes.set_title(f"{name}: RMS {mean:.2f}", fontsize=10)
        _bare(axes)
    figure.colorbar(shown, ax=panels.tolist(), label="RMS error [steps of 8 bits]", extend="max")
    return figure


@checks.checked(reference=checks.instance(IIPicture), quality=checks.instance(DepthQuality), path=checks.path)
def plot_error_layers(reference: IIPicture, quality: DepthQuality, path: str | os.PathLike[str]) -> Path:
    """Draw the errors of each depth layer in a panel, over the virtual camera's view in grey.

    More than 12 layers with pixels are merged with their neighbours into 12 panels of about equally many pixels.

    Parameters
    ----------
    reference : IIPicture
    quality : DepthQuality
        Result of `q_depth` for that picture.
    path : path
        .png, .pdf or .svg; replaced whole, and returned.

    Raises
    ------
    ValueError
        If the suffix is unknown, or the quality belongs to a picture of another size.
    """
    return save(_error_layers_figure(reference, quality), path)


def _error_layers_figure(reference: IIPicture, quality: DepthQuality) -> Any:
    view = view_of(reference)
    if view.shape[:2] != quality.layer.shape:
        raise ValueError(f"the quality is that of a view of {quality.layer.shape}, the picture's is {view.shape[:2]}")
    groups = layer_groups(quality.counts)
    grey = 0.25 + 0.5 * (view / peak(view.dtype)).mean(axis=-1)
    columns = min(4, max(len(groups), 1))
    rows = max(-(-len(groups) // columns), 1)
    shape = min(max(view.shape[0] / view.shape[1], 0.2), 3)
    figure = new_figure(3.2 * columns + 1, rows * (3.2 * shape + 0.4) + 0.3)
    panels = figure.subplots(rows, columns, squeeze=False)
    error = 255 * quality.error
    top = _top(error[quality.layer >= 0])
    for axes in panels.flat:
        axes.axis("off")
    for axes, (first, last) in zip(panels.flat, groups, strict=False):
        here = (quality.layer >= first) & (quality.layer <= last)
        axes.imshow(grey, cmap="gray", vmin=0, vmax=1, interpolation="nearest")
        shown = axes.imshow(
            np.where(here, error, np.nan), cmap=COLOURS_OF_ERRORS, vmin=0, vmax=top, interpolation="nearest"
        )
        rms = np.sqrt(np.square(error[here]).mean())
        z = quality.depth_mm[[first, last]]
        span = f"{z[0]:.4g} mm" if first == last else f"{z[0]:.4g} to {z[1]:.4g} mm"
        axes.set_title(f"z {span}: RMS {rms:.2f}", fontsize=9)
    if groups:
        figure.colorbar(shown, ax=panels.ravel().tolist(), label="RMS error [steps of 8 bits]", extend="max")
    else:
        panels[0, 0].text(0.5, 0.5, "no pixel has a depth", ha="center")
    return figure


def layer_groups(counts: NDArray[np.int64], groups: int = PANELS) -> list[tuple[int, int]]:
    """Return the first and last layer of up to ``groups`` runs of layers with about equally many pixels."""
    held = np.flatnonzero(counts)
    if held.size <= groups:
        return [(int(d), int(d)) for d in held]
    before = np.cumsum(counts[held]) - counts[held] / 2
    label = np.minimum((before * groups / counts.sum()).astype(int), groups - 1)
    runs = [held[label == i] for i in range(groups)]
    return [(int(run[0]), int(run[-1])) for run in runs if run.size]


def _top(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return max(float(np.quantile(known, 0.99)), 1e-3) if known.size else 1.0


def _bare(axes: Any) -> None:
    axes.set_xticks([])
    axes.set_yticks([])
