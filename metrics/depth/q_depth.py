"""PSNR over depth: how distortion spreads from near to far."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ii_core import IIPicture, checks
from ii_core.view import camera_of

from ..global_angle import psnr
from ..pair import PicturePair
from ..quality import DepthQuality
from .focus import METHODS, FocusDepth, depth_from_focus
from .layers import check_layers, nearest_layer
from .virtual_camera import seen_pixels


@checks.checked(layers_mm=checks.numbers, method=checks.one_of(*METHODS))
def q_depth(
    reference: IIPicture,
    decoded: IIPicture,
    *,
    depth: ArrayLike | FocusDepth | None = None,
    layers_mm: ArrayLike | None = None,
    method: str = "dissertation",
    mask: ArrayLike | None = None,
) -> DepthQuality:
    """PSNR of each depth layer, seen by a virtual camera that looks through every lens.

    The camera stands at V = (0, 0, Λ − K·Λ), from where its field of view is the lenslets' viewing angle and
    every lens of an array no higher than wide shows its own elementary image. Each lens gives one pixel, the
    nearest, so that no interpolation softens the artefacts. The pixel falls into the layer nearest to its depth.

    Parameters
    ----------
    reference, decoded : IIPicture
        Of the same structure and type; the reference has a camera.
    depth : array_like, (N, M), or FocusDepth, optional
        Scene z at every pixel of the picture, mm, NaN where nothing is hit; or what `depth_from_focus` found in the
        reference before, with its layers. If it is not given, depth is estimated from the reference now.
    layers_mm : array_like, (layers,), optional
        Depths of the layers, increasing. If not given, `covering_layers`: 250 in equal ratios from the nearest to
        the farthest depth in view, or, where depth is estimated, over all that can be told apart. The dissertation's,
        z = d·Λ with d = 1 … 250, are `linear_layers`; see also `logarithmic_layers`.
    method : {"dissertation", "robust"}
        How depth is estimated, if it is; see `depth_from_focus`.
    mask : array_like of bool, (N, M), optional
        Which pixels count; see `q_global`.

    Returns
    -------
    DepthQuality
        The outer layers reach half a layer outwards; what lies beyond is left out rather than moved in, so that a
        layer's value always tells about its own depth. A pixel halfway between two layers belongs to the farther
        one.

    Raises
    ------
    ValueError
        If the pictures differ in structure or type, have no camera, hold a pixel in view that is not finite, if
        ``depth`` is of another shape or infinite, if it was found for other layers or lenses, or if the layers are
        not depths that increase. Without ``depth`` also as `depth_from_focus`.

    References
    ----------
    Olsson 2008, (4.4)–(4.9).
    """
    return depth_quality(PicturePair(reference, decoded, mask=mask, depth=depth, layers_mm=layers_mm, method=method))


def depth_quality(pair: PicturePair) -> DepthQuality:
    """`q_depth` of a pair."""
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
    z = np.asarray(depth)
    if z.shape != picture.pixels.shape[:2] or z.dtype.kind not in "fiu":
        raise ValueError(
            f"depth is {z.dtype} of shape {z.shape}: numbers of shape {picture.pixels.shape[:2]} are needed"
        )
    return z
