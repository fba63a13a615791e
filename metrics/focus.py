"""Depth from focus: which layer of the scene each lens's pixel shows, estimated from the picture alone."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ii_core import IICamera, IIPicture
from ii_core.jit import inline_kernel, kernel
from ii_core.view import camera_of, view_image, view_positions

from .psnr import peak

LAYERS = 250
Floats = NDArray[np.float64]


def _square(step: int) -> NDArray[np.int64]:
    """25 lens positions (right, down) on a square grid around (0, 0)."""
    side = step * np.arange(-2, 3)
    return np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)


BASE = _square(1)
REFERENCE = _square(7)
FILTER = np.ones((5, 5))
METHODS = ("dissertation", "robust")
# The robust method's lenses: eight directions, from near for layers that only near lenses see to far for far layers.
STAR = np.unique([(i * r, j * r) for r in (1, 2, 4, 7, 10, 14) for i in (-1, 0, 1) for j in (-1, 0, 1)], axis=0)
# In steps of 8 bits, summed over R, G and B: from where on a difference is that of another surface, however large,
# and by how much a neighbour's colour differs when it counts e times less.
OTHER_SURFACE, ALIKE = 30.0, 60.0
# Neighbours that a half needs: one alone agrees too easily. More would keep out wrong near layers, which few lenses
# see, but also the lenses at the picture's edge.
FEWEST = 2
# Costs that differ less, in shares of the peak, differ by rounding: an even picture must not have a depth.
ROUNDING = 1e-6


@dataclass(frozen=True, eq=False)
class FocusDepth:
    """The depth of what the virtual camera sees through each lens, estimated.

    Attributes
    ----------
    depth_mm : ndarray of float64, (L, K)
        z in camera coordinates; NaN where nothing tells one depth from another. That of the layer, or, of the
        robust method, of the bottom of the parabola through its cost and those of both neighbours.
    layer : ndarray of int64, (L, K)
        Row of ``layers_mm``, −1 where the depth is NaN.
    confidence : ndarray of float32, (L, K)
        1 − (cost of the chosen layer)/(mean cost of all): 1 where one layer fits exactly and others do not, near
        0 where all fit alike, 0 where the depth is NaN.
    layers_mm : ndarray of float64, (layers,)
    """

    depth_mm: Floats
    layer: NDArray[np.int64]
    confidence: NDArray[np.float32]
    layers_mm: Floats


def linear_layers(camera: IICamera, count: int = LAYERS) -> Floats:
    """Layers at z = d·f from the pixel array, d = 1 … count, with f = Λ in the pinhole approximation, mm."""
    return np.arange(1.0, count + 1) * camera.gap_mm + camera.origin_mm[2]


def virtual_viewpoint(camera: IICamera) -> Floats:
    """V, (0, 0, Λ − K·Λ) before the middle of the array, in camera coordinates."""
    return np.array([0.0, 0.0, camera.gap_mm * (1 - camera.lenses[0])]) + camera.origin_mm


def logarithmic_layers(near_mm: float, far_mm: float, count: int = LAYERS) -> Floats:
    """Layers from near to far in equal ratios, mm."""
    if not 0 < near_mm < far_mm < math.inf:
        raise ValueError(f"layers from {near_mm} to {far_mm} mm: 0 < near < far is needed")
    return np.geomspace(near_mm, far_mm, count)


def check_layers(layers_mm: ArrayLike | None, camera: IICamera) -> Floats:
    """The default layers, or those given; ValueError unless they are one or more positive depths that increase."""
    if layers_mm is None:
        return linear_layers(camera)
    layers = np.asarray(layers_mm, dtype=np.float64)
    if layers.ndim != 1 or not layers.size:
        raise ValueError(f"layers_mm is of shape {layers.shape}: a list of depths is needed")
    if not (np.isfinite(layers).all() and layers[0] > 0 and (np.diff(layers) > 0).all()):
        raise ValueError("layers_mm must be finite, positive and increase")
    return layers


def nearest_layer(z: Floats, layers_mm: Floats, gap_mm: float) -> NDArray[np.int64]:
    """Row of the nearest layer for each depth, −1 beyond the outer ones by more than half a layer, and for NaN.

    A depth halfway between two layers belongs to the farther one. A single layer reaches as far as one of the
    default layers would, half a gap each way.
    """
    if layers_mm.size == 1:
        edges = layers_mm[0] + gap_mm * np.array([-0.5, 0.5])
    else:
        inner = (layers_mm[1:] + layers_mm[:-1]) / 2
        edges = np.concatenate([[2 * layers_mm[0] - inner[0]], inner, [2 * layers_mm[-1] - inner[-1]]])
    row = np.searchsorted(edges, z, side="right") - 1
    return np.where(np.isnan(z) | (row >= layers_mm.size), -1, row)


def depth_from_focus(
    picture: IIPicture,
    *,
    layers_mm: ArrayLike | None = None,
    method: str = "dissertation",
    base: ArrayLike = BASE,
    reference: ArrayLike = REFERENCE,
    weights: ArrayLike = FILTER,
    interpolation: str = "linear",
    workers: int | None = None,
) -> FocusDepth:
    """Depth of what the virtual camera of `q_depth` sees, from how alike near and far lenses see each layer.

    The line from the virtual camera V = (0, 0, Λ − K·Λ) through the centre of lens (k, l) meets the layer z in a
    point. The base image B takes there the mean of the pixels that see this point through the lenses around
    (k, l), the reference image R the mean of those through lenses farther apart. Where the layer is that of the
    surface, all show the same piece of it and B = R; where it is not, B and R mix different surroundings::

                −14  ·  ·  −7  ·  ·   0   ·  ·   7  ·  ·  14      lenses to the right
         −14      R         R         R          R        R
          −7      R         R         R          R        R       R: 5 × 5 lenses, every seventh
                                    B B B B B
                                    B B B B B                     B: 5 × 5 lenses, every one;
           0      R         R       B B B B B    R        R          (0, 0) belongs to both
                                    B B B B B
                                    B B B B B
           7      R         R         R          R        R
          14      R         R         R          R        R

    Then D = argmin_d (Σ_rgb |B_d − R_d| ∗ h). With z' = z − Λ the pixel under lens (k + i, l + j) stands off the
    centre of its elementary image by

        Δu = +i·U·Λ/z' − L_x/(K·δP),   Δv = +j·V·Λ/z' + L_y/(K·δP)

    with (L_x, L_y) the centre of lens (k, l); erect elementary images flip both signs. A lens that does not see the
    point in its own elementary image, or that is not there, is left out of the mean: the pixel across the border
    belongs to another lens and looks elsewhere.

    Parameters
    ----------
    picture : IIPicture
        Regular, with its camera.
    layers_mm : array_like, (layers,), optional
        Depths to try, increasing; `linear_layers` if not given. See also `logarithmic_layers`. None but those
        beyond the lens plane can be chosen.
    method : {"dissertation", "robust"}
        How alike the lenses see a layer. ``robust`` compares each neighbour's pixel with the lens's own one, sums
        |Δ| over colours, counts none above 30 steps of 8 bits (another surface covers the point), and takes the
        mean over the left, right, upper or lower half of the neighbours, whichever is least: behind an edge one
        half still sees the point. Its neighbours stand in eight directions, 1, 2, 4, 7, 10 and 14 lenses away, and
        h counts those view pixels less whose colour differs.
    base, reference : array_like of int, (n, 2)
        Lenses of B and R, to the right and down from the one looked through; of the dissertation's method.
    weights : array_like, (odd, odd)
        h, not negative; each layer's cost becomes the weighted mean over those neighbours that have one. 5×5 equal
        weights by default: the size of B.
    interpolation : {"linear", "nearest"}
        Between the pixels of one elementary image.
    workers : int, optional
        Threads; as many as cores if not given. The result is the same for any number.

    Returns
    -------
    FocusDepth
        Of two layers that cost the same the nearer is chosen. There is no depth (NaN) where all layers cost the
        same, as in an even picture, or where none lets B and R be compared: lenses so few, or layers so near, that
        both are one and the same lens.

    Raises
    ------
    ValueError
        If the picture has no camera, is not regular or holds a pixel that is not finite, if optics before the
        lens array bend the lines of sight, or if a parameter is unknown, of the wrong shape or out of range.

    Notes
    -----
    The text does not say what h is, what becomes of lenses that do not see the point, and whether B and R are
    interpolated. It wants the nearest pixel in the views that are measured, so that artefacts stay as they are; B
    and R are none of these. There the nearest pixel favours layers whose lines fall on whole pixels, and moves an
    even, textured wall by several layers: so linear is the default.

    Between layers d and d + 1 the pixel under a lens i away moves U·i/d² px: 14 lenses away, with 16 px, less than
    one from d = 15 on, and a tenth from d = 47 on.

    It works in 8·layers·K·L bytes beside the picture.

    References
    ----------
    Olsson 2008, (4.4), (4.5), Figures 4.8 and 4.9.
    """
    if interpolation not in ("linear", "nearest"):
        raise ValueError(f"unknown interpolation {interpolation!r}: known are linear, nearest")
    if method not in METHODS:
        raise ValueError(f"unknown method {method!r}: known are {', '.join(METHODS)}")
    camera = camera_of(picture)
    picture.check_regular()
    if camera.front:
        raise ValueError(f"{camera.front[0].kind} before the lens array bends lines of sight: give depth=")
    layers = check_layers(layers_mm, camera)
    b, r = _pattern("base", base), _pattern("reference", reference)
    h = np.asarray(weights, dtype=np.float64)
    if h.ndim != 2 or not (h.shape[0] % 2 and h.shape[1] % 2) or not (np.isfinite(h) & (h >= 0)).all() or not h.any():
        raise ValueError("weights must be of two odd sides, finite, not negative and not all 0")
    _check_finite(picture)

    lenses = np.unique(np.concatenate([b, r]), axis=0) if method == "dissertation" else STAR
    across, down = np.unique(lenses[:, 0]), np.unique(lenses[:, 1])
    cols, rows = pixel_tables(camera, layers, across, down, erect=picture.erect, nearest=interpolation == "nearest")
    where = np.column_stack([np.searchsorted(across, lenses[:, 0]), np.searchsorted(down, lenses[:, 1])])
    (k, l) = picture.lenses
    cost, smooth = (np.empty((layers.size, l, k), np.float32) for _ in range(2))
    if method == "dissertation":
        members = np.stack([(lenses[:, None] == p).all(axis=2).any(axis=1) for p in (b, r)], axis=1)
        _by_rows(workers, l, focus_cost, picture.pixels, *cols, *rows, where, members, cost)
        _by_rows(workers, l, weigh, cost, h, smooth)
    else:
        step = peak(picture.pixels.dtype) / 255
        own, sides = int(np.flatnonzero((lenses == 0).all(axis=1))[0]), np.column_stack([lenses < 0, lenses > 0])
        _by_rows(workers, l, half_cost, picture.pixels, *cols, *rows, where, sides, own, OTHER_SURFACE * step, cost)
        view = view_image(picture, virtual_viewpoint(camera), interpolation=interpolation)[0]
        _by_rows(workers, l, weigh_alike, cost, h, view.astype(np.float64), ALIKE * step, smooth)
    layer, fit, confidence = np.empty((l, k), np.int64), np.empty((l, k)), np.empty((l, k), np.float32)
    _by_rows(workers, l, choose, smooth, ROUNDING * peak(picture.pixels.dtype), layer, fit, confidence)
    place = layer + (fit if method == "robust" else 0.0)
    depth = np.where(layer < 0, np.nan, np.interp(place, np.arange(layers.size), layers))
    return FocusDepth(depth, layer, confidence, layers)


Table = tuple[NDArray[np.int32], Floats]


def pixel_tables(
    camera: IICamera,
    layers_mm: Floats,
    across: NDArray[Any],
    down: NDArray[Any],
    *,
    erect: bool = False,
    nearest: bool = False,
) -> tuple[Table, Table]:
    """Which pixel under each neighbour sees the point of each layer that the virtual camera sees through a lens.

    Parameters
    ----------
    across, down : ndarray of int
        Neighbours' steps i to the right and j down.

    Returns
    -------
    cols : (ndarray of int32, ndarray of float64), (layers, len(across), K)
        The pixel left of where the line ends, −1 if the neighbour does not see the point, and the weight of the
        pixel right of it; with ``nearest`` the weight is 0.
    rows : likewise, (layers, len(down), L)
        The pixel above, and the weight of the one below.
    """
    (u, v) = camera.ei_pixels
    beyond = np.asarray(layers_mm) - camera.origin_mm[2] - camera.gap_mm
    with np.errstate(divide="ignore"):
        # At the lens plane and before it nothing is in focus: infinitely far off through all but the own lens.
        per_lens = np.where(beyond > 0, camera.gap_mm / beyond, np.inf)
    x, y = view_positions(camera, virtual_viewpoint(camera), erect=erect)
    sign = -1.0 if erect else 1.0
    # Without vertical parallax one row of pixels, under whatever lens, sees one row of the scene.
    vertical = sign * per_lens if camera.lens_model.vertical_parallax else np.full_like(per_lens, -1.0)
    return _table(x, u, sign * per_lens * u, across, nearest), _table(y, v, vertical * v, down, nearest)


def _table(position: Floats, ei: int, per_step: Floats, steps: NDArray[Any], nearest: bool) -> Table:
    """Along one axis: own lens's pixel position, EI side, pixels a step by layer → pixel by layer, step and lens."""
    lens = np.arange(position.size)
    step = steps[None, :, None]
    with np.errstate(invalid="ignore"):
        moved = np.where(step == 0, 0.0, step * per_step[:, None, None])
    inside = position - lens * ei + moved
    centre = np.floor(inside + 0.5)
    other = lens + step
    seen = (centre >= 0) & (centre < ei) & (other >= 0) & (other < position.size)
    if nearest:
        low, weight = centre, np.zeros(seen.shape)
    else:
        inside = np.where(seen, np.clip(inside, 0, ei - 1), 0.0)
        low = np.floor(inside)
        weight = inside - low
    return np.where(seen, other * ei + np.where(seen, low, 0), -1).astype(np.int32), weight


def _pattern(name: str, value: ArrayLike) -> NDArray[np.int64]:
    given = np.asarray(value)
    if given.ndim != 2 or given.shape[1] != 2 or not len(given) or given.dtype.kind not in "iu":
        raise ValueError(f"{name} is {given.dtype} of shape {given.shape}: whole lens steps (n, 2) are needed")
    return given.astype(np.int64)


def _check_finite(picture: IIPicture) -> None:
    if picture.pixels.dtype.kind != "f":
        return
    for n, row in enumerate(picture.pixels):
        bad = np.flatnonzero(~np.isfinite(row).all(axis=1))
        if bad.size:
            raise ValueError(f"picture pixel ({bad[0]}, {n}) is {row[bad[0]]}: finite values are needed")


def _by_rows(workers: int | None, rows: int, work: Callable[..., None], *arguments: Any) -> None:
    """Call a kernel with its first and last row, on plain threads: those of numba may abort when two callers meet."""
    count = (
        workers if workers is not None else len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
    )
    count = max(1, min(count, rows))
    bounds = np.linspace(0, rows, count + 1).astype(int)
    if count == 1:
        work(*arguments, 0, rows)
        return
    with ThreadPoolExecutor(count) as pool:
        for done in [pool.submit(work, *arguments, a, b) for a, b in pairwise(bounds)]:
            done.result()


@inline_kernel
def _between(pixels, m, n, x, y):
    """The colour x of the way from pixel (m, n) to its right neighbour and y of the way to the one below."""
    # A weight of 0 must not reach for a pixel that may be off the picture.
    right, below = m + (x > 0), n + (y > 0)
    a, b, c, e = (1 - y) * (1 - x), (1 - y) * x, y * (1 - x), y * x
    return (
        a * pixels[n, m, 0] + b * pixels[n, right, 0] + c * pixels[below, m, 0] + e * pixels[below, right, 0],
        a * pixels[n, m, 1] + b * pixels[n, right, 1] + c * pixels[below, m, 1] + e * pixels[below, right, 1],
        a * pixels[n, m, 2] + b * pixels[n, right, 2] + c * pixels[below, m, 2] + e * pixels[below, right, 2],
    )


@kernel
def focus_cost(pixels, cols, col_weights, rows, row_weights, where, members, out, first, last):
    """out[d, l, k] = Σ_rgb |B_d − R_d|, NaN where nothing can be compared; rows ``first`` to ``last`` of lenses.

    Tables as of `pixel_tables`; ``where`` (n, 2) has the neighbours as rows of the tables, ``members`` (n, 2) says
    which of B and R each is in.
    """
    for l in range(first, last):
        for d in range(out.shape[0]):
            for k in range(out.shape[2]):
                out[d, l, k] = np.nan
                b0, b1, b2, r0, r1, r2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
                in_b, in_r, in_both = 0, 0, 0
                for i in range(where.shape[0]):
                    m, n = cols[d, where[i, 0], k], rows[d, where[i, 1], l]
                    if m < 0 or n < 0:
                        continue
                    x, y = col_weights[d, where[i, 0], k], row_weights[d, where[i, 1], l]
                    p0, p1, p2 = _between(pixels, m, n, x, y)
                    if members[i, 0]:
                        b0, b1, b2 = b0 + p0, b1 + p1, b2 + p2
                        in_b += 1
                    if members[i, 1]:
                        r0, r1, r2 = r0 + p0, r1 + p1, r2 + p2
                        in_r += 1
                        in_both += members[i, 0]
                if in_b == 0 or in_r == 0 or (in_b == in_both and in_r == in_both):
                    continue
                out[d, l, k] = abs(b0 / in_b - r0 / in_r) + abs(b1 / in_b - r1 / in_r) + abs(b2 / in_b - r2 / in_r)


@kernel
def half_cost(pixels, cols, col_weights, rows, row_weights, where, sides, own, limit, out, first, last):
    """out[d, l, k] = min over halves of the mean over their neighbours of min(Σ_rgb |p − p_own|, limit), or NaN.

    As `focus_cost`; ``sides`` (n, 4) says which half each neighbour is in, ``own`` is the neighbour at step 0.
    """
    total, count = np.empty(4), np.empty(4)
    for l in range(first, last):
        for d in range(out.shape[0]):
            for k in range(out.shape[2]):
                out[d, l, k] = np.nan
                total[:], count[:] = 0.0, 0.0
                q0, q1, q2 = 0.0, 0.0, 0.0
                for step in range(-1, where.shape[0]):
                    i = own if step < 0 else step
                    m, n = cols[d, where[i, 0], k], rows[d, where[i, 1], l]
                    if (m < 0 or n < 0) and step < 0:
                        break
                    if m < 0 or n < 0 or step == own:
                        continue
                    x, y = col_weights[d, where[i, 0], k], row_weights[d, where[i, 1], l]
                    p0, p1, p2 = _between(pixels, m, n, x, y)
                    if step < 0:
                        q0, q1, q2 = p0, p1, p2
                        continue
                    difference = min(abs(p0 - q0) + abs(p1 - q1) + abs(p2 - q2), limit)
                    for s in range(4):
                        if sides[i, s]:
                            total[s] += difference
                            count[s] += 1
                best = np.inf
                for s in range(4):
                    if count[s] >= FEWEST:
                        best = min(best, total[s] / count[s])
                if best < np.inf:
                    out[d, l, k] = best


@kernel
def weigh_alike(cost, h, view, alike, out, first, last):
    """As `weigh`, with weights h·exp(−Σ_rgb |Δview|/alike): what looks alike is taken to lie at one depth."""
    layers, rows, cols = cost.shape
    up, left = h.shape[0] // 2, h.shape[1] // 2
    total, weight = np.empty(layers), np.empty(layers)
    for l in range(first, last):
        for k in range(cols):
            total[:], weight[:] = 0.0, 0.0
            for j in range(max(0, l - up), min(rows, l + up + 1)):
                for i in range(max(0, k - left), min(cols, k + left + 1)):
                    difference = 0.0
                    for c in range(3):
                        difference += abs(view[j, i, c] - view[l, k, c])
                    w = h[up - (j - l), left - (i - k)] * math.exp(-difference / alike)
                    for d in range(layers):
                        if not np.isnan(cost[d, j, i]):
                            total[d] += w * cost[d, j, i]
                            weight[d] += w
            for d in range(layers):
                out[d, l, k] = np.nan
                if weight[d] > 0 and not np.isnan(cost[d, l, k]):
                    out[d, l, k] = total[d] / weight[d]


@kernel
def weigh(cost, h, out, first, last):
    """out = cost ∗ h for rows ``first`` to ``last``, over those neighbours that have a cost."""
    layers, rows, cols = cost.shape
    up, left = h.shape[0] // 2, h.shape[1] // 2
    for d in range(layers):
        for l in range(first, last):
            for k in range(cols):
                out[d, l, k] = np.nan
                if np.isnan(cost[d, l, k]):
                    continue
                total, weight = 0.0, 0.0
                for j in range(max(0, l - up), min(rows, l + up + 1)):
                    for i in range(max(0, k - left), min(cols, k + left + 1)):
                        # A convolution mirrors its kernel.
                        w = h[up - (j - l), left - (i - k)]
                        if w > 0 and not np.isnan(cost[d, j, i]):
                            total += w * cost[d, j, i]
                            weight += w
                if weight > 0:
                    out[d, l, k] = total / weight


@kernel
def choose(cost, tie, layer, fit, confidence, first, last):
    """The nearest of the cheapest layers, −1 if all cost the same but for ``tie``, for rows ``first`` to ``last``.

    ``fit`` is how many layers farther, −½ to ½, the parabola through it and its neighbours has its bottom.
    """
    for l in range(first, last):
        for k in range(cost.shape[2]):
            best, low, high, total, count = -1, np.inf, -np.inf, 0.0, 0
            for d in range(cost.shape[0]):
                c = np.float64(cost[d, l, k])
                if np.isnan(c):
                    continue
                total += c
                count += 1
                high = max(high, c)
                if c < low:
                    best, low = d, c
            layer[l, k], fit[l, k], confidence[l, k] = -1, 0.0, 0.0
            if high - low > tie:
                layer[l, k], confidence[l, k] = best, 1 - low * count / total
                if 0 < best < cost.shape[0] - 1:
                    before, after = np.float64(cost[best - 1, l, k]), np.float64(cost[best + 1, l, k])
                    bend = before - 2 * low + after
                    if bend > 0:  # not NaN, and not three alike
                        fit[l, k] = (before - after) / (2 * bend)
