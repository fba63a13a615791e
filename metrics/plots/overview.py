"""Charts of a quality over angle and over depth, and pictures of the views."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core import IIPicture, checks, five_viewpoints, view_image
from ii_core.colour import srgb
from ii_core.view import camera_of

from ..depth.layers import logarithmic
from ..pair import PicturePair, peak
from ..quality import AngleQuality, DepthQuality, told_outside
from .rd_chart import COLOURS, edges, new_figure, save

AMPLIFY = (32, 16, 8, 4, 2, 1)  # of differences: the first that keeps nine values in ten from clipping


def angle_figure(quality: AngleQuality) -> Any:
    """Return the figure of `metrics.plot_angle`."""
    values = quality.values
    figure = new_figure(6.2, 5.2, "compressed")  # for axes of fixed shape
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
    if high - low < 0.1:  # dB: nobody sees less, and a map of rounding errors would look like a finding
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
def plot_depth(quality: DepthQuality, path: str | os.PathLike[str]) -> None:
    """Draw Q_depth over depth, and below it how many pixels of the view each layer has.

    Layers without pixels are gaps; identical ones lie as hollow markers on the upper edge.

    Parameters
    ----------
    quality : DepthQuality
        From `q_depth`.
    path : path
        .png, .pdf or .svg. Replaced, whole.

    Raises
    ------
    ValueError
        If the suffix is another.

    References
    ----------
    Olsson 2008, (4.9), Figure 5.21.
    """
    save(_depth_figure(quality), path)


def _depth_figure(quality: DepthQuality) -> Any:
    figure = new_figure(7.5, 5)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[3, 1])
    z, values = quality.depth_mm, quality.values
    finite = np.isfinite(values)
    upper.plot(z, np.where(finite, values, np.nan), color=COLOURS[0], linewidth=1, zorder=2)
    # A layer of three pixels must not weigh like one of thousands.
    size = 4 + 40 * np.sqrt(quality.counts / max(quality.counts.max(), 1))
    upper.scatter(z[finite], values[finite], s=size[finite], color=COLOURS[0], zorder=3, linewidths=0)
    same = np.isposinf(values)
    if same.any():
        top = upper.get_xaxis_transform()
        upper.plot(
            z[same], np.ones(same.sum()), "o", transform=top, clip_on=False, mfc="white", color=COLOURS[0], ms=5
        )
        upper.annotate("○ identical", (1, 1.03), xycoords="axes fraction", ha="right", fontsize=9)
    title = f"Q_depth; depth: {quality.source}"
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


@checks.checked(path=checks.path)
def plot_views(reference: IIPicture, decoded: IIPicture, path: str | os.PathLike[str]) -> None:
    """Draw the five view images of both pictures, and their difference, amplified.

    The difference is decoded − reference around middle grey, amplified by up to 32, less where more than one value
    in ten would clip.

    Parameters
    ----------
    reference, decoded : IIPicture
        Of the same structure and type; the reference has a camera.
    path : path
        .png, .pdf or .svg. Replaced, whole.

    Raises
    ------
    ValueError
        If the pictures differ in structure or type, have no camera or are not regular, or if the suffix is another.

    References
    ----------
    Olsson 2008, Figure 5.18.
    """
    save(_views_figure(reference, decoded), path)


def _views_figure(reference: IIPicture, decoded: IIPicture) -> Any:
    reference, other = PicturePair(reference, decoded).pictures
    views = five_viewpoints(camera_of(reference))
    k, l = reference.lenses
    pairs = [tuple(view_image(p, viewpoint)[0] for p in (reference, other)) for viewpoint in views.values()]
    apart = [(b.astype(np.float64) - a) / peak(a.dtype) for a, b in pairs]
    most = np.quantile(np.abs(apart), 0.9)
    amplify = next((factor for factor in AMPLIFY if factor * most <= 0.5), 1)
    width = 3.0
    figure = new_figure(width * 5 + 0.3, 3 * width * min(max(l / k, 0.2), 3) + 0.6)
    figure.get_layout_engine().set(h_pad=0.02, w_pad=0.02)
    panels = figure.subplots(3, len(views), squeeze=False)
    for column, name, (a, b), difference in zip(panels.T, views, pairs, apart, strict=True):
        for axes, image in zip(
            column, (_shown(a), _shown(b), np.clip(0.5 + amplify * difference, 0, 1)), strict=True
        ):
            axes.imshow(image, interpolation="nearest")
            axes.set_xticks([])
            axes.set_yticks([])
        column[0].set_title(name)
    for axes, label in zip(panels[:, 0], ("reference", "decoded", f"difference × {amplify}"), strict=True):
        axes.set_ylabel(label, fontsize=12)
    return figure


@checks.checked(picture=checks.instance(IIPicture), path=checks.path)
def plot_pair(picture: IIPicture, path: str | os.PathLike[str]) -> None:
    """Draw a cross-eyed pair: the right eye's view on the left, the left eye's on the right.

    The eyes are half-way to the left and right viewpoints of `five_viewpoints`.

    Parameters
    ----------
    picture : IIPicture
        Regular, with its camera.
    path : path
        .png, .pdf or .svg. Replaced, whole.

    Raises
    ------
    ValueError
        If the picture has no camera or is not regular, or if the suffix is another.
    """
    save(_pair_figure(picture), path)


def _pair_figure(picture: IIPicture) -> Any:
    views = five_viewpoints(camera_of(picture))
    k, l = picture.lenses
    figure = new_figure(10, 5 * min(max(l / k, 0.2), 3) + 0.5)
    for axes, eye in zip(figure.subplots(1, 2), ("right", "left"), strict=True):
        image, _ = view_image(picture, (views[eye] + views["front"]) / 2)
        axes.imshow(_shown(image), interpolation="nearest")
        axes.set_title(f"for the {eye} eye", fontsize=10)
        axes.axis("off")
    return figure


def _shown(pixels: NDArray[Any]) -> NDArray[np.float64]:
    """Code values as matplotlib wants them, 0 … 1; linear light as sRGB."""
    share = np.clip(pixels / peak(pixels.dtype), 0, 1)
    if pixels.dtype.kind != "f":
        return share
    return srgb(share)
