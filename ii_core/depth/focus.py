"""Depth from focus: the layer of the scene at each lens's pixel, estimated from the picture alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import checks
from ..base.parallel import over_rows
from ..picture.disparity import depth_of_disparity, disparity_of_depth
from ..picture.picture import IIPicture, peak
from ..picture.view import camera_of, view_image
from . import focus_kernels as kernels
from .layers import Floats, check_layers, virtual_viewpoint
from .lens_tables import RINGS, pixel_tables, pixels_per_lens, star, whole_pixel_steps
from .views import near_and_far, place_of, view_steps, view_tables, views_side_by_side


def _square(step: int) -> NDArray[np.int64]:
    """25 lens positions (right, down) on a square grid around (0, 0)."""
    side = step * np.arange(-2, 3)
    return np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)


BASE = _square(1)
REFERENCE = _square(7)
FILTER = np.ones((5, 5))
METHODS = ("dissertation", "robust")
# In steps of 8 bits, summed over R, G and B: from where on a difference is that of another surface, however large;
# by how much a neighbour's colour differs when it counts e times less; what a depth e times as great costs from one
# lens to the next, and a leap to any depth.
OTHER_SURFACE, ALIKE, SLOPE, LEAP = 30.0, 60.0, 60.0, 30.0
# Of `judge`. Independent differences in a cost: on even walls with noise of σ = 0.3–8 codes, behind five cameras,
# the least of up to 768 000 costs fits 7 and 14 or more (2026-11-22). Cost of rounding to whole codes,
# summed over R, G and B.
COMPARISONS = {"dissertation": 6.0, "robust": 12.0}
QUANTISATION = {"dissertation": 0.2, "robust": 1.0}
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
        1/(1 + N·(c/m)ⁿ), in [0, 1]: c is the cost of the chosen layer before it is passed on, m the mean over all
        layers, N the number of costs of all lenses, and n that of independent differences in a cost (6 and 12).
        N·(c/m)ⁿ is the number of costs as low that noise alone is expected to give in the whole picture. Above 0.5
        this is less than one: an even wall with noise has no such lens. 0 where the depth is NaN.
    layers_mm : ndarray of float64, (layers,)
    method : str
    """

    depth_mm: Floats
    layer: NDArray[np.int64]
    confidence: NDArray[np.float32]
    layers_mm: Floats
    method: str


@checks.checked(
    picture=checks.instance(IIPicture),
    layers_mm=checks.numbers,
    method=checks.text,
    base=checks.numbers,
    reference=checks.numbers,
    weights=checks.numbers,
    interpolation=checks.text,
    workers=checks.whole,
)
def depth_from_focus(
    picture: IIPicture,
    *,
    layers_mm: ArrayLike | None = None,
    method: str = "dissertation",
    base: ArrayLike | None = None,
    reference: ArrayLike | None = None,
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

    Views whose viewing zones meet see points on both sides of the lens plane. There, B and R are views around the
    middle one, interpolated between their pixels: a point of disparity D at pixel x of the middle view is at x − p·D
    in the view p steps to the right.

    Parameters
    ----------
    picture : IIPicture
        Regular, with its camera.
    layers_mm : array_like, (layers,), optional
        Depths to try, increasing; `covering_layers` if not given, or `field_layers` if viewing zones meet. The
        dissertation's are `linear_layers`, see also `logarithmic_layers` and `disparity_layers`. None but those
        beyond the lens plane can be chosen, unless viewing zones meet.
    method : {"dissertation", "robust"}
        How alike the lenses see a layer. ``robust`` follows the ray of the very pixel that `q_depth` measures,
        compares its colour with that of lenses in which the ray's point falls on whole pixels (`whole_pixel_steps`,
        eight directions), sums |Δ| over colours, counts none above 30 steps of 8 bits (another surface covers the
        point), and takes the mean over the left, right, upper or lower half of the neighbours, whichever is least:
        behind an edge one half still sees the point. h counts those view pixels less whose colour differs. Then
        costs are passed on along rows and columns, both ways, so that even areas take the depth of what bounds
        them: from lens to lens a depth e times as great costs 60 steps of 8 bits, any other 30, less where the
        view's colour changes.
    base, reference : array_like of int, (n, 2), optional
        Lenses of B and R, to the right and down from the one looked through; of the dissertation's method alone. If
        viewing zones meet: views, to the right and down from the middle one; 3×3 and 5×5 over all by default.
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
    Olsson 2008, (4.4), (4.5), Figures 4.8 and 4.9. Passing costs on: Hirschmüller, Stereo processing by semiglobal
    matching, PAMI 2008, along four paths, with a slope that is that of the logarithm of z'.
    """
    if interpolation not in ("linear", "nearest"):
        raise ValueError(f"unknown interpolation {interpolation!r}: known are linear, nearest")
    if method not in METHODS:
        raise ValueError(f"unknown method {method!r}: known are {', '.join(METHODS)}")
    camera = camera_of(picture)
    picture.check_regular()
    converged = camera.viewer_mm is not None
    if converged and not camera.lens_model.vertical_parallax:
        raise ValueError("viewing zones that meet without vertical parallax have no disparity down: give depth=")
    if camera.front:
        raise ValueError(f"{camera.front[0].kind} before the lens array bends lines of sight: give depth=")
    layers = check_layers(layers_mm, camera)
    usual = near_and_far(camera.ei_pixels) if converged else (BASE, REFERENCE)
    b = _pattern("base", usual[0] if base is None else base)
    r = _pattern("reference", usual[1] if reference is None else reference)
    h = np.asarray(weights, dtype=np.float64)
    if h.ndim != 2 or not (h.shape[0] % 2 and h.shape[1] % 2) or not (np.isfinite(h) & (h >= 0)).all() or not h.any():
        raise ValueError("weights must be of two odd sides, finite, not negative and not all 0")
    _check_finite(picture)

    nearest = interpolation == "nearest"
    if method == "dissertation":
        cost = local = _dissertation(picture, layers, b, r, h, nearest, workers)
    else:
        cost, local = _robust(picture, layers, h, nearest, workers)
    (k, l) = picture.lenses
    layer, fit, confidence = np.empty((l, k), np.int64), np.empty((l, k)), np.empty((l, k), np.float32)
    _by_rows(workers, l, kernels.choose, cost, ROUNDING * peak(picture.pixels.dtype), layer, fit)
    floor = QUANTISATION[method] if picture.pixels.dtype.kind in "iu" else ROUNDING * peak(picture.pixels.dtype)
    _by_rows(workers, l, kernels.judge, local, layer, floor, COMPARISONS[method], l * k * layers.size, confidence)
    place = layer + (fit if method == "robust" else 0.0)
    scale = disparity_of_depth(camera, layers) if converged else layers
    depth = np.where(layer < 0, np.nan, np.interp(place, np.arange(layers.size), scale))
    depth = depth_of_disparity(camera, depth) if converged else depth
    return FocusDepth(depth, layer, confidence, layers, method)


def _dissertation(
    picture: IIPicture, layers: Floats, base: Steps, reference: Steps, h: Floats, nearest: bool, workers: int | None
) -> Costs:
    """Σ_rgb |B_d − R_d| ∗ h, (L, K, layers)."""
    camera = camera_of(picture)
    (k, l) = picture.lenses
    lenses = np.unique(np.concatenate([base, reference]), axis=0)
    across, down = np.unique(lenses[:, 0]), np.unique(lenses[:, 1])
    if camera.viewer_mm is None:
        pixels = picture.pixels
        cols, rows = pixel_tables(camera, layers, across, down, erect=picture.erect, nearest=nearest)
    else:
        pixels = views_side_by_side(picture)
        cols, rows = view_tables(camera, layers, across, down, erect=picture.erect, nearest=nearest)
    where = np.column_stack([np.searchsorted(across, lenses[:, 0]), np.searchsorted(down, lenses[:, 1])])
    members = np.stack([(lenses[:, None] == p).all(axis=2).any(axis=1) for p in (base, reference)], axis=1)
    cost, smooth = (np.empty((l, k, layers.size), np.float32) for _ in range(2))
    _by_rows(workers, l, kernels.focus_cost, pixels, kernels.Tables(*cols, *rows), where, members, cost)
    _by_rows(workers, l, kernels.weigh, cost, h, np.zeros((l, k, 3)), np.inf, smooth)
    return smooth


def _robust(picture: IIPicture, layers: Floats, h: Floats, nearest: bool, workers: int | None) -> tuple[Costs, Costs]:
    """Halves of neighbours ∗ h by likeness, passed on along rows and columns, and before; (L, K, layers)."""
    camera = camera_of(picture)
    (k, l), (u, v) = picture.lenses, picture.ei_pixels
    if camera.viewer_mm is None:
        pixels, shift = picture.pixels, pixels_per_lens(camera, layers)
        across, down = whole_pixel_steps(shift * u, u), whole_pixel_steps(shift * v, v)
        cols, rows = pixel_tables(camera, layers, across, down, erect=picture.erect, nearest=nearest, snap=True)
        start = camera.origin_mm[2] + camera.gap_mm - camera.start_mm
        place = np.log(np.maximum(layers - start, camera.gap_mm / 1e9))
    else:
        pixels, place = views_side_by_side(picture), place_of(camera, layers)
        across, down = view_steps(u, RINGS), view_steps(v, RINGS)
        cols, rows = view_tables(camera, layers, across, down, erect=picture.erect, nearest=nearest)
    middle = across.shape[-1] // 2, down.shape[-1] // 2
    where = star(*middle)
    sides = np.column_stack([where < middle, where > middle])
    step = peak(picture.pixels.dtype) / 255
    cost, smooth = (np.empty((l, k, layers.size), np.float32) for _ in range(2))
    tables, partners = kernels.Tables(*cols, *rows), kernels.Star(where, sides, len(where) - 1)
    _by_rows(workers, l, kernels.half_cost, pixels, tables, partners, OTHER_SURFACE * step, cost)
    view = view_image(picture, virtual_viewpoint(camera), interpolation="nearest")[0].astype(np.float64)
    _by_rows(workers, l, kernels.weigh, cost, h, view, ALIKE * step, smooth)
    total = cost  # its memory
    total[:] = 0
    prices = place, SLOPE * step, LEAP * step, ALIKE * step
    for columns, back in product((False, True), repeat=2):
        _by_rows(workers, k if columns else l, kernels.pass_on, smooth, view, *prices, columns, back, total)
    total[np.isnan(smooth)] = np.nan
    return total, smooth


Steps = NDArray[np.int64]
Costs = NDArray[np.float32]


def _pattern(name: str, value: ArrayLike) -> Steps:
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


def _by_rows(workers: int | None, rows: int, kernel: Callable[..., None], *arguments: Any) -> None:
    """Call a kernel whose last two arguments are its first and last row."""
    over_rows(lambda first, last: kernel(*arguments, first, last), rows, workers=workers)
