"""Charts of a pair of pictures: computes their qualities and draws them with `metrics.plots`."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import cast

from ii_core import IIPicture, five_viewpoints
from ii_core.base import checks
from ii_core.display.figure import save
from ii_core.display.view_sheets import plot_pair, plot_views
from ii_core.picture.view import camera_of

from ..measures.global_angle import q_angle
from ..measures.pair import PicturePair
from ..measures.quality import DepthQuality
from ..measures.view import error_map
from ..plots.angle_depth import angle_figure, plot_depth
from ..plots.error_maps import error_views_figure, plot_error_layers

PLOTS = (
    "q_angle.png",
    "views.png",
    "errors_views.png",
    "pair_reference.png",
    "pair_decoded.png",
    "q_depth.png",
    "errors_depth.png",
)
"""The pictures that `plot_all` writes."""


@checks.checked(path=checks.path)
def plot_angle(reference: IIPicture, decoded: IIPicture, path: str | os.PathLike[str]) -> Path:
    """Draw Q_angle as a heat map over the viewing angle.

    Identical sub-images, whose quality is infinite, are hatched.

    Parameters
    ----------
    reference, decoded : IIPicture
        As for `q_angle`; with a camera the axes are degrees, else pixels of the elementary image.
    path : path
        .png, .pdf or .svg; replaced whole, and returned.

    Raises
    ------
    ValueError
        As `q_angle`, or if the suffix is unknown.

    References
    ----------
    Olsson 2008, (2.18), Figure 4.6.
    """
    return save(angle_figure(q_angle(reference, decoded)), path)


@checks.checked(path=checks.path)
def plot_error_views(reference: IIPicture, decoded: IIPicture, path: str | os.PathLike[str]) -> Path:
    """Draw the error map of each of the five views, on one scale up to the 99th percentile.

    Parameters
    ----------
    reference, decoded : IIPicture
        Of the same structure and type; the reference has a camera.
    path : path
        .png, .pdf or .svg; replaced whole, and returned.

    Raises
    ------
    ValueError
        As `error_map`, or if the suffix is unknown.
    """
    PicturePair(reference, decoded)
    views = five_viewpoints(camera_of(reference))
    return save(error_views_figure({name: error_map(reference, decoded, at) for name, at in views.items()}), path)


@checks.checked(quality=checks.instance(DepthQuality, type(None)), folder=checks.path)
def plot_all(
    reference: IIPicture, decoded: IIPicture, quality: DepthQuality | None, folder: str | os.PathLike[str]
) -> list[Path]:
    """Draw all charts of `PLOTS` that the pictures allow into a folder.

    Returns
    -------
    list of path
        ``q_angle.png`` of a regular structure; with a camera also ``views.png``, ``errors_views.png``,
        ``pair_reference.png`` and ``pair_decoded.png``; ``q_depth.png`` and ``errors_depth.png`` if their quality
        is given.

    Raises
    ------
    ValueError
        If the pictures differ in structure or type, or hold a pixel that is not finite.
    OSError
        If a file cannot be written.
    """
    reference, other = PicturePair(reference, decoded).pictures
    seen = reference.regular and reference.camera is not None
    works: list[tuple[bool, Callable[[Path], Path]]] = [
        (reference.regular, lambda path: plot_angle(reference, decoded, path)),
        (seen, lambda path: plot_views(reference, decoded, path)),
        (seen, lambda path: plot_error_views(reference, decoded, path)),
        (seen, lambda path: plot_pair(reference, path)),
        (seen, lambda path: plot_pair(other, path)),
        (quality is not None, lambda path: plot_depth(cast(DepthQuality, quality), path)),
        (quality is not None, lambda path: plot_error_layers(reference, cast(DepthQuality, quality), path)),
    ]
    return [draw(Path(folder, name)) for name, (possible, draw) in zip(PLOTS, works, strict=True) if possible]
