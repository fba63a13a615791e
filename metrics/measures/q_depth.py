"""Q_depth: PSNR of each depth layer."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ii_core import IIPicture
from ii_core.base import checks
from ii_core.depth.focus import METHODS, FocusDepth, depth_from_focus
from ii_core.depth.layers import check_layers, nearest_layer, seen_pixels
from ii_core.picture.view import camera_of

from .global_angle import psnr
from .pair import Compared, PicturePair, Structure, picture_pair
from .quality import DepthQuality


@checks.checked(layers_mm=checks.numbers, method=checks.one_of(*METHODS))
def q_depth(
    reference: Compared,
    decoded: Compared,
    *,
    depth: ArrayLike | FocusDepth | None = None,
    layers_mm: ArrayLike | None = None,
    method: str = "dissertation",
    mask: ArrayLike | None = None,
    structure: Structure | None = None,
) -> DepthQuality:
    """Return the PSNR of each depth layer in the view of a virtual camera.

    The camera stands at V = (0, 0, Λ − K·Λ). Its field of view is the lenslets' viewing angle, and every lens of an
    array no higher than wide shows its own elementary image. Each lens contributes the nearest pixel, since
    interpolation would smooth artefacts. A pixel belongs to the layer nearest to its depth.

    Parameters
    ----------
    reference, decoded : IIPicture
        Of the same structure and type; the reference has a camera.
    depth : array_like, (N, M), or FocusDepth, optional
        Scene z at every pixel of the picture, mm, NaN without a hit; or the result of `depth_from_focus` for the
        reference, with its layers. If not given, it is estimated from the reference.
    layers_mm : array_like, (layers,), optional
        Depths of the layers, increasing. The default is `covering_layers`: 250 in equal ratios over the depths in
        view, or over all distinguishable depths if depth is estimated. The dissertation's layers z = d·Λ, d = 1 …
        250, are `linear_layers`; see also `logarithmic_layers`.
    method : {"dissertation", "robust"}
        Method of estimating depth; see `depth_from_focus`.
    mask : array_like of bool, (N, M), optional
        Pixels that count; see `q_global`.
    structure : IIPicture, IICamera or dict, optional
        Structure of pictures given as arrays (N, M, 3): that of a picture or a camera, or
        ``{"lenses": (K, L), "ei_pixels": (U, V)}``.

    Returns
    -------
    DepthQuality
        The outer layers extend half a layer outwards; pixels beyond are left out. A pixel halfway between two layers
        belongs to the farther one.

    Raises
    ------
    ValueError
        If the pictures differ in structure or type, have no camera, or hold a pixel in view that is not finite; if
        ``depth`` has another shape, other layers or an infinite value; if the layers do not increase. Without
        ``depth`` also as `depth_from_focus`.

    References
    ----------
    Olsson 2008, (4.4)–(4.9).
    """
    return depth_quality(
        picture_pair(reference, decoded, structure, mask=mask, depth=depth, layers_mm=layers_mm, method=method)
    )


def depth_quality(pair: PicturePair) -> DepthQuality:
    """Return `q_depth` of a pair."""
    reference, depth, layers_mm = pair.reference, pair.depth, pair.layers_mm
    camera = camera_of(reference)
    n, m, lens_rows = seen_pixels(camera, reference.erect)
    counted = np.ones(np.broadcast_shapes(n.shape, m.shape), bool)
    if pair.mask is not None:
        counted = pair.mask[n, m]
    a, b = (np.where(counted[..., None], picture.pixels[n, m], 0) for picture in pair.pictures)
    squared_error = np.square(a.astype(np.float64) - b).sum(axis=-1)
    if not np.isfinite(squared_error).all():
        pair.check_finite()
    if isinstance(depth, FocusDepth) and layers_mm is None:
        layers_mm = depth.layers_mm
    z = None
    if depth is not None and not isinstance(depth, FocusDepth):
        z = _true_depth(depth, reference)[n, m].astype(np.float64)
        if np.isinf(z).any():
            raise ValueError("depth is infinite at a pixel in view: NaN is needed where nothing is hit")
    layers = check_layers(layers_mm, camera, None if z is None else z[counted])
    if depth is None:
        depth = depth_from_focus(reference, layers_mm=layers, method=pair.method)
    if isinstance(depth, FocusDepth):
        if depth.layer.shape != reference.lenses[::-1] or not np.array_equal(depth.layers_mm, layers):
            raise ValueError(
                f"depth has {depth.layer.shape[::-1]} lenses and {depth.layers_mm.size} layers: those of picture and "
                f"of layers_mm, {reference.lenses} lenses and {layers.size} layers, are needed"
            )
        source, layer = f"focus ({depth.method})", depth.layer[lens_rows]
        missing = layer < 0
    else:
        assert z is not None
        source = "given"
        layer, missing = nearest_layer(z, layers, camera.gap_mm), np.isnan(z)

    outside = int((counted & (layer < 0) & ~missing).sum())
    layer = np.where(counted, layer, -1)
    inside = layer >= 0
    counts = np.bincount(layer[inside], minlength=layers.size)
    total = np.bincount(layer[inside], weights=squared_error[inside], minlength=layers.size)
    return DepthQuality(
        depth_mm=layers,
        values=psnr(total, 3 * counts, pair.dtype),
        counts=counts,
        outside=outside,
        source=source,
        layer=layer,
        error=np.where(counted, np.sqrt(squared_error / 3) / pair.peak, np.nan),
        missing=int((counted & missing).sum()),
    )


def _true_depth(depth: ArrayLike, picture: IIPicture) -> NDArray[Any]:
    checks.numbers("depth", depth)
    z = np.asarray(depth)
    if z.shape != picture.pixels.shape[:2] or z.dtype.kind not in "fiu":
        raise ValueError(
            f"depth is {z.dtype} of shape {z.shape}: numbers of shape {picture.pixels.shape[:2]} are needed"
        )
    return z
