"""PSNR over depth: how distortion spreads from near to far."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ii_core import IICamera, IIPicture
from ii_core.view import camera_of, view_positions

from ..global_angle import check_finite, check_mask, check_pair, peak, psnr
from .focus import FocusDepth, depth_from_focus
from .layers import check_layers, nearest_layer, virtual_viewpoint


@dataclass(frozen=True, eq=False)
class DepthQuality:
    """PSNR of each depth layer.

    Attributes
    ----------
    depth_mm : ndarray of float64, (layers,)
        z of each layer in camera coordinates.
    values : ndarray of float64, (layers,)
        dB over the layer's own pixels; NaN where it has none, +inf where they are identical.
    counts : ndarray of int64, (layers,)
        View pixels in each layer.
    outside : int
        View pixels that hit something nearer or farther than all layers; they count nowhere. 0 if the depth is
        estimated: it is always that of a layer, or none. 0 with the default layers too, but for depths at the pixel
        array or behind it.
    source : str
        Where depth came from: ``given``, or ``focus`` with the method, as in ``focus (dissertation)``.
    layer : ndarray of int64, (L', K)
        Layer of each pixel that the virtual camera sees, −1 where it has none; L' is L, less the rows of lenses
        that the camera does not see.
    error : ndarray of float64, (L', K)
        Root of the mean over R, G and B of the squared error at each of these pixels, in shares of the peak.
    missing : int
        View pixels without a depth: nothing is hit, or nothing tells the layers apart.
    """

    depth_mm: NDArray[np.float64]
    values: NDArray[np.float64]
    counts: NDArray[np.int64]
    outside: int
    source: str
    layer: NDArray[np.int64]
    error: NDArray[np.float64]
    missing: int = 0

    def error_map(self, layer: int) -> NDArray[np.float64]:
        """The error at the pixels of one layer, NaN at all others, (L', K)."""
        if not 0 <= layer < self.values.size:
            raise ValueError(f"layer is {layer}: 0 to {self.values.size - 1} are needed")
        return np.where(self.layer == layer, self.error, np.nan)

    @property
    def outside_share(self) -> float:
        """Share of ``outside`` in the view pixels that have a depth; NaN if none has."""
        hit = self.outside + int(self.counts.sum())
        return self.outside / hit if hit else float("nan")

    @property
    def min(self) -> float:
        """Of the layers that have pixels; NaN if none has."""
        return float(np.min(self._held)) if self._held.size else float("nan")

    @property
    def mean(self) -> float:
        """Of the layers that have pixels, each weighing the same; +inf if one of them is identical."""
        return float(np.mean(self._held)) if self._held.size else float("nan")

    @property
    def max(self) -> float:
        """Of the layers that have pixels; NaN if none has."""
        return float(np.max(self._held)) if self._held.size else float("nan")

    @property
    def _held(self) -> NDArray[np.float64]:
        return self.values[self.counts > 0]


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
    check_pair(reference, decoded)
    camera = camera_of(reference)
    n, m, lens_rows = _seen(camera, reference.erect)
    counted = np.ones(np.broadcast_shapes(n.shape, m.shape), bool)
    if mask is not None:
        counted = check_mask(mask, reference)[n, m]
    a, b = (np.where(counted[..., None], picture.pixels[n, m], 0) for picture in (reference, decoded))
    squared_error = np.square(a.astype(np.float64) - b).sum(axis=-1)
    if not np.isfinite(squared_error).all():
        check_finite(reference, decoded, mask)
    if isinstance(depth, FocusDepth) and layers_mm is None:
        layers_mm = depth.layers_mm
    z = None
    if depth is not None and not isinstance(depth, FocusDepth):
        z = _true_depth(depth, reference)[n, m].astype(np.float64)
        if np.isinf(z).any():
            raise ValueError("depth is infinite at a pixel in view: NaN is needed where nothing is hit")
    layers = check_layers(layers_mm, camera, None if z is None else z[counted])
    if depth is None:
        depth = depth_from_focus(reference, layers_mm=layers, method=method)
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
    dtype = reference.pixels.dtype
    return DepthQuality(
        depth_mm=layers,
        values=psnr(total, 3 * counts, dtype),
        counts=counts,
        outside=outside,
        source=source,
        layer=layer,
        error=np.where(counted, np.sqrt(squared_error / 3) / peak(dtype), np.nan),
        missing=int((counted & missing).sum()),
    )


def told_outside(share: float) -> str:
    """The share of view pixels in no layer, in words."""
    return "no view pixel has a depth" if np.isnan(share) else f"{share:.1%} of view pixels outside all layers"


def _true_depth(depth: ArrayLike, picture: IIPicture) -> NDArray[Any]:
    z = np.asarray(depth)
    if z.shape != picture.pixels.shape[:2] or z.dtype.kind not in "fiu":
        raise ValueError(
            f"depth is {z.dtype} of shape {z.shape}: numbers of shape {picture.pixels.shape[:2]} are needed"
        )
    return z


def virtual_camera_pixels(camera: IICamera, *, erect: bool = False) -> tuple[NDArray[Any], NDArray[Any]]:
    """Row and column of the one pixel under each lens that the virtual camera sees, as an index of the picture.

    Returns
    -------
    n, m : ndarray of int
        Broadcast to (L, K), less the rows whose line ends off the pixel array (only an array higher than wide
        has such rows).
    """
    n, m, _ = _seen(camera, erect)
    return n, m


def view_of(picture: IIPicture) -> NDArray[Any]:
    """What the virtual camera sees: one pixel of the picture through each lens, (L', K, 3)."""
    n, m = virtual_camera_pixels(camera_of(picture), erect=picture.erect)
    return picture.pixels[n, m]


def _seen(camera: IICamera, erect: bool) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """As `virtual_camera_pixels`, and the rows of lenses that are left."""
    x, y = view_positions(camera, virtual_viewpoint(camera), erect=erect)
    m, n = (np.floor(position + 0.5).astype(np.int64) for position in (x, y))
    kept = np.flatnonzero((n >= 0) & (n < camera.pixels[1]))
    return n[kept, None], m[None, :], kept
