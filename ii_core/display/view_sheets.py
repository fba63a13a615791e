"""Sheets of view images: five views of two pictures with their differences, and a cross-eyed stereo pair."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base import checks
from ..base.colour import srgb
from ..picture.picture import IIPicture, peak
from ..picture.view import camera_of, five_viewpoints, view_image
from .figure import new_figure, save

AMPLIFY = (32, 16, 8, 4, 2, 1)  # factors of the difference; `plot_views` selects one


@checks.checked(reference=checks.instance(IIPicture), decoded=checks.instance(IIPicture), path=checks.path)
def plot_views(reference: IIPicture, decoded: IIPicture, path: str | os.PathLike[str]) -> Path:
    """Draw the five view images of both pictures, and their amplified difference.

    The difference is decoded − reference around middle grey. Its factor is the largest of `AMPLIFY` that clips at
    most one value in ten.

    Parameters
    ----------
    reference, decoded : IIPicture
        Of the same structure and type; the reference has a camera.
    path : path
        .png, .pdf or .svg; replaced whole, and returned.

    Raises
    ------
    ValueError
        If the pictures differ in structure or type, have no camera or are not regular, or if the suffix is another.

    References
    ----------
    Olsson 2008, Figure 5.18.
    """
    return save(_views_figure(reference, decoded), path)


def _views_figure(reference: IIPicture, decoded: IIPicture) -> Any:
    reference.check_same_structure(decoded)
    other = reference.with_pixels(decoded.pixels)
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
def plot_pair(picture: IIPicture, path: str | os.PathLike[str]) -> Path:
    """Draw a cross-eyed stereo pair: the right eye's view on the left, the left eye's on the right.

    The eyes are halfway from the front viewpoint to the left and right ones of `five_viewpoints`.

    Parameters
    ----------
    picture : IIPicture
        Regular, with its camera.
    path : path
        .png, .pdf or .svg; replaced whole, and returned.

    Raises
    ------
    ValueError
        If the picture has no camera or is not regular, or if the suffix is another.
    """
    return save(_pair_figure(picture), path)


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
    """Return sRGB in [0, 1] of code values or of linear light."""
    share = np.clip(pixels / peak(pixels.dtype), 0, 1)
    return share if pixels.dtype.kind != "f" else srgb(share)
