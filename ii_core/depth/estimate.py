"""Disparity and depth of one view of a light field, from all views."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base import checks
from ..base.extras import Lazy
from ..base.parallel import over_rows
from ..camera.camera import IICamera, Pair
from ..picture.disparity import depth_of_disparity
from ..picture.picture import IIPicture
from . import disparity_kernels as kernels
from .around import CODES, DIRECTIONS, halved, views_around
from .disparity_kernels import Views
from .focus_kernels import choose, pass_on
from .highlights import highlights
from .layers import possible

ndimage = Lazy("scipy.ndimage")
Map = NDArray[np.float32]
Mask = NDArray[np.bool_]
Costs = NDArray[np.uint16]  # in 16-bit codes
Progress = Callable[[int, int, str], Any]

# In 8-bit codes summed over R, G and B: the difference of another surface; prices of `pass_on`.
OTHER_SURFACE, SLOPE, LEAP, ALIKE = 30.0, 240.0, 33.0, 90.0
FEW_RANGES = 3.0  # labels of all disparities over the most labels, up to which none are searched
STEP = 0.48  # px that neighbouring labels are apart in the farthest view of a half-line
MOST_LABELS, FEWEST_LABELS = 1.5, 96  # labels a view, at most: two volumes of costs are then twice the field
# The range of disparities: at most WIDEST of the longer side of a view; found in views of at most SEARCH_SIDE px, at
# MANY pixels whose costs within NOISE 8-bit codes of the least span less than VALLEY px.
WIDEST, SEARCH_SIDE, MANY, NOISE, VALLEY = 0.75, 128, 16, 4.0, 2.0
# Gauss–Newton: differences of occluded views, 8-bit codes; window of planes, px; likeness in codes and disparity;
# weight of the old disparity, codes² a px²; weight of level planes over that of the data; longest step, px.
STEPS, OCCLUDED, RADIUS, SAME_COLOUR, SAME_SURFACE, PRIOR, FLAT, LONGEST = 6, 6.0, 5, 20.0, 0.1, 1000.0, 0.2, 0.3
# Data of pixels BEHIND px behind a neighbour count FRINGE: an outline in front moves over them.
BEHIND, FRINGE = 0.25, np.float32(0.05)
# Two steps are enough where data in a window weigh more, codes² a px²; more of them move outlines by the colours that
# pixels mix there. Where data weigh less, two, four, six and nine steps leave 72, 48, 38 and 35 % of the pixels of
# *Apples* bad (2026-11-26). Median of lower rank at jumps of more than JUMP px: such pixels match the surface in
# front. On `cuboid`, 16.7 to 16.0 % above 0.07 px (2026-11-25).
SETTLED, JUMP, LOWER = 1e5, 0.3, 3
# Steps end where `other_motion` is above AT_ODDS px and BY_NOISE times the error by noise: at a moving reflection, a
# hidden edge, or rendering noise that all views share. On antinous of the HCI fields 15.0 % are above 0.07 px with
# this rule, 23.8 % without (2026-11-30). RIDGE keeps motion that no slope tells at zero.
AT_ODDS, BY_NOISE, SUDDEN, RIDGE = 0.02, 15.0, 8, 1e-3
# Confidence: labels APART px away are rivals; labels of 9×9, 5×5 and 3×3 views are 0.12, 0.24 and 0.48 px apart, so
# that 0.48 px counts in each. A pixel is right if the views agree and no rival does as well, the product of two
# logistic terms: `JUDGES`. Few sure pixels among unsure ones are chance: a third term, `CROWD`, has their mean over
# AROUND px. Fitted by `python -m benchmarks run depth_confidence` to 64 fields in closed form (spheres, walls, bars,
# shadows, highlights), whose signs are kept, and to no other field. Means over 31 px do as well there; over 63 px, 42
# instead of 34 % of `cuboid` are sure (2026-11-27).
APART, AROUND, SMALL = 0.45, 63, 0.03  # SMALL: motion besides disparity that counts little, px
JUDGES = (0.06, -0.78, -2.54, 0.97), (-4.89, -0.51, -2.56, 0.82, -0.32)
CROWD = -2.07, 0.67, 3.89
SHINY = 0.5  # times the confidence where `highlights` are found: they move like surfaces behind the true one
LOUD = 2 * OCCLUDED  # noise in codes from which no pixel is sure: all views then count as occluded
# Even blocks from which noise is estimated: side in px, and their share.
BLOCK, EVEN = 8, 0.1
ROUNDING = 0.3  # error of rounding, in codes, which counts beside noise


MOST_DISPARITY = 1e4  # px a step, of a range that is given


@dataclass(frozen=True, eq=False)
class DepthEstimate:
    """Disparity of a view, estimated from all views.

    Attributes
    ----------
    disparity : ndarray of float32, (L, K)
        Pixels a step between views, positive before the lens plane; NaN where nothing tells depths apart, and where a
        rim before the array blocks the ray.
    confidence : ndarray of float32, (L, K)
        Estimated probability that the disparity is within 0.07 px.
    depth_mm : ndarray of float64, (L, K), or None
        z in camera coordinates; None for a picture without camera.
    view : (u, v)
    """

    disparity: Map
    confidence: Map
    depth_mm: NDArray[np.float64] | None
    view: Pair


@checks.checked(
    picture=checks.instance(IIPicture),
    view=checks.indices,
    low=checks.number_from(-MOST_DISPARITY, MOST_DISPARITY),
    high=checks.number_from(-MOST_DISPARITY, MOST_DISPARITY),
    workers=checks.whole_from(1, 1024),
    progress=checks.callable_,
)
def estimate_depth(
    picture: IIPicture,
    *,
    view: Pair | None = None,
    low: float | None = None,
    high: float | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> DepthEstimate:
    """Estimate the disparity of one view, and its depth if the picture has a camera.

    1. Every label, a disparity, costs the mean difference along half-lines of views, the better half of eight.
    2. Costs are passed on along rows and columns; the least one wins, a parabola places it between labels.
    3. Gauss–Newton steps over all views, with gradients of their mean; planes in bilateral windows average them.
       Where colours move as no disparity moves them, the matched disparity stays.

    Parameters
    ----------
    picture : IIPicture
        Regular; two views or more.
    view : (u, v), optional
        The view, counted from the left and the top; the middle one by default.
    low, high : float, optional
        Range of disparities, px a step; found in smaller views by default.
    workers : int, optional
        Threads; as many as cores if not given. The result is the same for any number.
    progress : callable, optional
        Called with steps done, their number, and the next one's name.

    Returns
    -------
    DepthEstimate

    Raises
    ------
    ValueError
        If there is one view only, if views are narrower than 8 px, or if a parameter is out of range.

    References
    ----------
    Hirschmüller, Stereo processing by semiglobal matching, PAMI 2008, along four paths. Lucas and Kanade, An
    iterative image registration technique, IJCAI 1981, over all views.
    """
    check_views(picture)
    u, v = picture.ei_pixels
    at = (u // 2, v // 2) if view is None else view
    if not (0 <= at[0] < u and 0 <= at[1] < v):
        raise ValueError(f"view is {at[0]},{at[1]}: columns 0–{u - 1} and rows 0–{v - 1} are there")
    if low is not None and high is not None and not low < high:
        raise ValueError(f"range of disparities is {low:g} to {high:g} px: low < high is needed")
    told = progress if progress is not None else lambda done, total, step: None
    total = 4 + STEPS
    told(0, total, "views")
    views = views_around(picture, at)
    told(1, total, "range of disparities")
    if low is None or high is None:
        found = search_range(views, picture.camera, workers)
        low, high = found[0] if low is None else low, found[1] if high is None else high
        high = high if high > low else low + 1.0
    told(2, total, "costs")
    start, ratio, margin = matched(views, labels_between(views, low, high), workers)
    disparity, noise, evidence = start, noise_codes(views), nothing_seen(views)
    here = np.ones(start.shape, bool)
    for step in range(STEPS):
        told(3 + step, total, f"step {step + 1} over all views")
        disparity, sure = refined(views, disparity, noise, evidence, here, workers)
        if step > 0:
            here &= sure <= SETTLED * CODES**2
    other = other_motion(evidence)
    disparity = thinned(disparity)
    told(3 + STEPS, total, "confidence")
    disparity[np.isnan(start) | blocked(picture, at)] = np.nan
    confidence = judged(disparity, ratio, margin, other, noise, evidence.mean) / (1 + (noise / LOUD) ** SUDDEN)
    depth = None if picture.camera is None else depth_of_disparity(picture.camera, disparity)
    told(total, total, "")
    return DepthEstimate(disparity, confidence, depth, at)


def check_views(picture: IIPicture) -> None:
    """Refuse a picture without views whose disparity can be found."""
    picture.check_regular()
    (across, down), (u, v) = picture.lenses, picture.ei_pixels
    if u * v < 2:
        raise ValueError("the picture has one view: depth needs two or more")
    if across < 8 or (down < 8 and v > 1):
        raise ValueError(f"views are {across}×{down} px: at least 8×8 are needed")


@checks.checked(picture=checks.instance(IIPicture), workers=checks.whole_from(1, 1024))
def field_range(picture: IIPicture, *, workers: int | None = None) -> tuple[float, float]:
    """Return the lowest and the highest disparity of a regular picture's middle view, px a step between views.

    The search leaves the range of many small views to the camera, −48…0 px of *Apples* at scale 8, whose disparities
    are −6.4…−0.7: there they are estimated, and those of sure pixels tell the range (2026-11-27).
    """
    check_views(picture)
    u, v = picture.ei_pixels
    views = views_around(picture, (u // 2, v // 2))
    low, high = search_range(views, picture.camera, workers)
    if (low, high) != possible(picture.camera, widest(views)):
        return low, high
    found = estimate_depth(picture, low=low, high=high, workers=workers)
    values, weights = found.disparity.ravel(), np.square(found.confidence.ravel(), dtype=np.float64)
    order = np.argsort(values)  # NaN comes last
    known = np.isfinite(values[order]) & (weights[order] > 0)
    if not known.any():
        return low, high
    values, share = values[order][known], np.cumsum(weights[order][known])
    first, last = values[np.searchsorted(share, np.array([0.01, 0.99]) * share[-1])]
    margin = 1.0 / float(np.abs(views.steps).max())  # a pixel in the farthest view
    return max(low, float(first) - margin), min(high, float(last) + margin)


def blocked(picture: IIPicture, view: Pair) -> NDArray[np.bool_]:
    """Return where a rim before the array blocks the rays of a view, (L, K)."""
    camera, (k, l), (u, v) = picture.camera, picture.lenses, picture.ei_pixels
    if camera is None or not camera.front:
        return np.zeros((l, k), bool)
    _, _, share = camera.weighted_rays_at(view[0] + u * np.arange(k), (view[1] + v * np.arange(l))[:, None])
    return np.zeros((l, k), bool) if share is None else share == 0


def labels_between(views: Views, low: float, high: float) -> Map:
    """Return disparities to try: `STEP` px in the farthest view of a half-line that sees the point, or wider."""
    most = max(FEWEST_LABELS, int(MOST_LABELS * len(views.steps)))
    return spaced(views, low, high, most)


def spaced(views: Views, low: float, high: float, most: int | None = None) -> Map:
    """Return as many labels from low to high as `STEP` needs, at most that many."""
    ends = reached(views, np.array([low, high]))
    count = max(int(np.ceil(np.ptp(ends) / STEP)) + 1, 3)
    places = np.linspace(ends[0], ends[1], count if most is None else min(count, max(most, 3)))
    return reached(views, places, back=True).astype(np.float32)


def reached(views: Views, values: NDArray[np.float64], *, back: bool = False) -> NDArray[np.float64]:
    """Return the movement of disparities in the farthest view of a half-line that sees the point, px, or ``back``.

    A point that moves by more than half a view is not counted as seen: the step between labels then grows with the
    disparity, as that of depth does.
    """
    reach = float(np.abs(views.steps[views.lines >= 0]).max())
    half, size = max(views.pixels.shape[2:]) / 2, np.abs(values)
    with np.errstate(over="ignore"):
        if back:
            far = half / reach * np.exp(np.maximum(size / half - 1, 0))
            return np.asarray(np.sign(values) * np.where(size < half, size / reach, far))
        far = half * (1 + np.log(np.maximum(size * reach / half, 1)))
    return np.asarray(np.sign(values) * np.where(size * reach < half, size * reach, far))


def search_range(views: Views, camera: IICamera | None, workers: int | None) -> tuple[float, float]:
    """Return the lowest and the highest disparity of views, by matching small ones over all possible labels."""
    low, high = possible(camera, widest(views))
    if spaced(views, low, high).size < FEW_RANGES * MOST_LABELS * len(views.steps):
        return low, high  # many small views: all disparities are tried
    scale = 1
    while max(views.pixels.shape[2:]) > SEARCH_SIDE:
        views, scale = halved(views), 2 * scale
    labels = spaced(views, low / scale, high / scale)
    cost = costs(views, labels, workers)
    found = labelled(passed_on(views, cost, labels, workers), labels)
    known, gaps, least = np.isfinite(found), np.gradient(labels), cost.argmin(axis=2)
    # a valley of the costs: where it is wide, noise decides
    wide = (cost < cost.min(axis=2, keepdims=True) + NOISE * CODES) @ gaps
    near = np.maximum(0.2, gaps[least])
    certain = known & (wide < VALLEY) & (np.abs(labels[least] - found) < near)
    # Few wrong pixels: 12 of 6724 of a chequered plane by a Lytro took its range from ±0.1 to −57…6 px (2026-11-27).
    certain &= np.abs(ndimage.median_filter(found, 3) - found) < near
    if certain.sum() < MANY:
        certain = known
    if not certain.any():
        return max(low, -1.0), min(high, 1.0)
    ends = np.quantile(found[certain], [0.002, 0.998]) * scale
    # Confidence needs rivals: photographs of a Lytro span 0.1 px, and none of their pixels was sure without them.
    margin = max(0.3 + 0.1 * (ends[1] - ends[0]), 2 * APART - (ends[1] - ends[0]) / 2)
    return max(low, float(ends[0]) - margin), min(high, float(ends[1]) + margin)


def widest(views: Views) -> float:
    """Return the largest disparity that is looked for, px a step."""
    return float(max(views.pixels.shape[2:]) * WIDEST)


def costs(views: Views, labels: Map, workers: int | None) -> Costs:
    """Return the costs of labels at every pixel of the reference, means over 3×3 pixels, (H, W, labels) of uint16."""
    height, width = views.pixels.shape[2:]
    out = np.empty((height, width, labels.size), np.uint16)
    limit = np.float32(OTHER_SURFACE * CODES)
    run(workers, height, kernels.line_costs, views, labels, limit, len(DIRECTIONS), out)
    ndimage.uniform_filter(out, (3, 3, 1), output=out)
    return out


def passed_on(views: Views, cost: Costs, labels: Map, workers: int | None) -> Costs:
    """Return costs passed on along rows and columns, both ways: at most 4·(OTHER_SURFACE + LEAP) codes, 16 bits."""
    height, width = views.pixels.shape[2:]
    view = views.pixels[0].transpose(1, 2, 0).astype(np.float32)
    total = np.zeros_like(cost)
    reach = float(np.abs(views.steps[views.lines >= 0]).max())
    prices = reached(views, labels.astype(np.float64)) / reach, SLOPE * CODES, LEAP * CODES, ALIKE * CODES
    for columns, back in product((False, True), repeat=2):
        run(workers, width if columns else height, pass_on, cost, view, *prices, columns, back, total)
    return total


def labelled(total: Costs, labels: Map) -> Map:
    """Return the disparity of least cost, between labels by a parabola; NaN where all cost the same."""
    layer, fit = np.empty(total.shape[:2], np.int64), np.empty(total.shape[:2])
    choose(total, CODES / 100, layer, fit, 0, total.shape[0])
    found = np.interp(layer + fit, np.arange(labels.size), labels)
    return np.where(layer < 0, np.nan, found).astype(np.float32)


def matched(views: Views, labels: Map, workers: int | None) -> tuple[Map, Map, Map]:
    """Return the disparity by labels, the median over 3×3 pixels, and the `rivals` of its label."""
    height = views.pixels.shape[2]
    cost = costs(views, labels, workers)
    total = passed_on(views, cost, labels, workers)
    ratio, margin = np.empty(cost.shape[:2], np.float32), np.empty(cost.shape[:2], np.float32)
    run(workers, height, kernels.rivals, cost, total, labels, np.float32(APART), ratio, margin)
    del cost
    return np.asarray(ndimage.median_filter(labelled(total, labels), 3)), ratio, margin / CODES


def judged(disparity: Map, ratio: Map, margin: Map, other: OtherMotion, noise: float, mean: Map) -> Map:
    """Return the estimated probability that disparities are within 0.07 px."""
    known = np.nan_to_num(disparity)
    terms = agreement(other, noise), rivalry(known, ratio, margin, other, noise)
    both = _logistic(JUDGES[0], terms[0]) * _logistic(JUDGES[1], terms[1])
    right = _logistic(CROWD, crowd(both)) * np.where(highlights(mean), SHINY, 1)
    return np.where(np.isnan(disparity), 0, right).astype(np.float32)


def agreement(other: OtherMotion, noise: float) -> tuple[Map, ...]:
    """Return what tells whether views agree: motion besides disparity, here and around, and the error by noise."""
    most = ndimage.maximum_filter(other.px, 2 * RADIUS + 1)
    return np.log(at_odds(other, noise) + 0.1), np.log(most + SMALL), log_error(other, noise)


def log_error(other: OtherMotion, noise: float) -> Map:
    """Return the logarithm of the error that noise leaves, px."""
    return np.log((noise + ROUNDING) * CODES * other.error)


def rivalry(disparity: Map, ratio: Map, margin: Map, other: OtherMotion, noise: float) -> tuple[Map, ...]:
    """Return what tells whether another disparity does as well: spread of disparities, `rivals`, error by noise."""
    spread = ndimage.maximum_filter(disparity, 7) - ndimage.minimum_filter(disparity, 7)
    rivals = np.log(np.clip(ratio, 0.05, 2)), np.log(np.maximum(margin, 0) + 2)
    return np.log(spread + 0.02), *rivals, log_error(other, noise)


def crowd(right: Map) -> tuple[Map, ...]:
    """Return the logit of a probability and its mean around each pixel."""
    share = np.clip(right, 1e-4, 1 - 1e-4)
    return np.log(share / (1 - share)), ndimage.uniform_filter(share, AROUND)


def _logistic(weights: tuple[float, ...], terms: tuple[Map, ...]) -> Map:
    sum_ = weights[0] + sum(weight * term for weight, term in zip(weights[1:], terms, strict=True))
    return np.asarray(1 / (1 + np.exp(-sum_)))


class Evidence(NamedTuple):
    """What all views tell about the motion of each pixel: `add_evidence`."""

    push: Map  # (4, H, W)
    reach: Map  # (3, H, W)
    slopes: Map  # (3, H, W)
    mean: Map  # (3, H, W), 16-bit codes


def nothing_seen(views: Views) -> Evidence:
    """Return the evidence before the first step: the mean is the reference."""
    push, reach, slopes = (np.zeros((n, *views.pixels.shape[2:]), np.float32) for n in (4, 3, 3))
    return Evidence(push, reach, slopes, views.pixels[0].astype(np.float32))


def refined(
    views: Views, disparity: Map, noise: float, evidence: Evidence, here: Mask, workers: int | None
) -> tuple[Map, Map]:
    """Return the disparity after a Gauss–Newton step over all views where ``here`` is set, and its weight.

    ``evidence`` is renewed there and in the windows around. Gradients are of its mean: those of one view have its
    noise, which makes steps too short.
    """
    height = here.shape[0]
    known, seen = np.nan_to_num(disparity), evidence.mean.copy()
    around = ndimage.maximum_filter(here, 2 * RADIUS + 1)
    limit, (push, reach, slopes, mean) = np.float32(OCCLUDED * CODES), evidence
    run(workers, height, kernels.add_evidence, views, known, limit, mean, around, push, reach, slopes, seen)
    mean[:] = seen
    odds = at_odds(other_motion(evidence), noise)
    out, sure = known.copy(), np.zeros_like(known)
    view = views.pixels[0].astype(np.float32)
    likeness = np.float32(SAME_COLOUR * CODES), np.float32(SAME_SURFACE)
    counted = np.where(ndimage.maximum_filter(known, 3) - known > BEHIND, FRINGE, np.float32(1))
    weight = slopes[0] * reach[0] + 2 * slopes[1] * reach[1] + slopes[2] * reach[2]
    sums = known, (push[0] + push[3]) * counted, weight * counted, view
    run(workers, height, kernels.fit_planes, *sums, RADIUS, *likeness, PRIOR * CODES**2, FLAT, here, out, sure)
    out = known + np.clip(out - known, -LONGEST, LONGEST) / (1 + np.minimum(odds, 100) ** SUDDEN)
    return np.where(here, ndimage.median_filter(out, 3), known), sure


def thinned(disparity: Map) -> Map:
    """Return the disparity with the surface in front smaller at jumps, by a median of lower rank."""
    jump = ndimage.maximum_filter(disparity, 3) - ndimage.minimum_filter(disparity, 3) > JUMP
    return np.where(jump, ndimage.rank_filter(disparity, LOWER, 3), disparity)


class OtherMotion(NamedTuple):
    """Motion besides that of the disparity, and the error of disparity by noise, in windows of planes."""

    px: Map  # (H, W), px of disparity that would move colours as much
    error: Map  # (H, W), px a 16-bit code


def other_motion(evidence: Evidence) -> OtherMotion:
    """Return the motion that no disparity explains: of highlights, reflections, hidden edges, noise.

    The normal equations of `add_evidence` for M, four numbers, are solved by elimination. What M explains of the
    squared differences in a window beyond what a disparity does is told as px of disparity.
    """
    side, (push, reach, slopes, _) = 2 * RADIUS + 1, evidence

    def summed(part: Map) -> Map:
        return np.asarray(ndimage.uniform_filter(part, side) * np.float32(side**2))

    right = [summed(part) for part in push]
    pairs = {at: summed(slopes[at[0]] * reach[at[1]]) for at in product(range(3), repeat=2)}
    weight = np.maximum(pairs[0, 0] + 2 * pairs[1, 1] + pairs[2, 2], 1)
    left = {(m, n): pairs[m // 2 + n // 2, m % 2 + n % 2].copy() for m in range(4) for n in range(m + 1)}
    for k in range(4):
        left[k, k] += RIDGE * weight
    explained = -np.square(right[0] + right[3]) / (weight * (1 + 2 * RIDGE))
    for k in range(4):
        explained += np.square(right[k]) / left[k, k]
        for m in range(k + 1, 4):
            factor = left[m, k] / left[k, k]
            right[m] -= factor * right[k]
            for n in range(k + 1, m + 1):
                left[m, n] -= factor * left[n, k]
    return OtherMotion(np.sqrt(np.maximum(explained, 0) / weight), np.sqrt(3 / weight))


def at_odds(other: OtherMotion, noise: float) -> Map:
    """Return the motion besides disparity over what is allowed where noise has so many codes."""
    return other.px / (AT_ODDS + BY_NOISE * other.error * noise * CODES)


def noise_codes(views: Views) -> float:
    """Return the standard deviation of noise in 8-bit codes, from the evenest blocks of the reference.

    References
    ----------
    Immerkær, Fast noise variance estimation, CVIU 1996: the second difference both ways.
    """
    height, width = (side // BLOCK * BLOCK for side in views.pixels.shape[2:])
    view = views.pixels[0].astype(np.float32) / CODES
    fine = ndimage.convolve1d(ndimage.convolve1d(view, (1, -2, 1), axis=1), (1, -2, 1), axis=2) / 6
    blocks = (fine[:, :height, :width] ** 2).mean(axis=0).reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK)
    return float(np.sqrt(np.quantile(blocks.mean(axis=(1, 3)), EVEN)))


def run(workers: int | None, rows: int, kernel: Callable[..., None], *arguments: Any) -> None:
    """Call a kernel whose last two arguments are its first and last row."""
    over_rows(lambda first, last: kernel(*arguments, first, last), rows, workers=workers)
