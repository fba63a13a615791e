"""Multi-focus arrays, as of Raytrix cameras: where lens types are in focus, and pictures in focus under all lenses.

A point at the distance a before the lens plane that stands at the offset r under one lens stands at r + s·Δ under
another whose centre lies Δ away. s = Λ/a is its *shift*, the inverse of the virtual depth a/Λ; it is negative for
points that light has not met yet at the lens plane, as in Galilean cameras. A lens of focal length f images points
of the shift Λ/f − 1 sharply.

The shift of every pixel is found by matching it with the lenses around. Light falls on lenses of all types alike, so
that at one shift only their focus makes detail differ: if blur by |s − s_t| takes log detail down by w·(s − s_t)²,
the difference between types is linear in s, and straight lines through it give all s_t.

References
----------
L. Palmieri, R. Koch, "Optimizing the lens selection process for multi-focus plenoptic cameras and numerical
evaluation", 2017: pixels are taken from lenses in focus. N. Zeller et al., 2016, and C. Heinze et al., 2016: virtual
depth.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base import checks
from ..base.extras import Lazy
from ..base.files import check_file, one_line
from ..base.jit import exact_stage_kernel, kernel
from ..base.parallel import over_rows
from ..camera.camera import IICamera
from ..camera.optics import Lenslet
from ..picture.picture import IIPicture
from ..picture.regular import owners
from .lens_types import LensTypes

ndimage = Lazy("scipy.ndimage")

MOST_SHIFT = 0.5  # either way: nearer points stand under one lens alone
STEP_PX = 0.5  # of matching, at the farthest lens that is compared
REACH = 2.05  # lens pitches: lenses compared
WINDOW = 2  # pixels around one that are matched with it
FEWEST_PIXELS = 200  # of each type at a shift, for its detail to count
BINS = 24  # of shifts, for detail
LEAST_SPREAD = 0.02  # of foci: less is one
KEPT = 0.02  # of shift: how much better the focus of another lens must be
MOST_XML = 1 << 16  # bytes


@dataclass(frozen=True)
class Foci:
    """Shifts at which lens types are in focus.

    Attributes
    ----------
    matrix : rows of int
        Types of the lenses, repeating over the array.
    shifts : tuple of float
        Λ/a of the plane in focus, type 0 first.
    given : bool
        They were given, not found.
    """

    matrix: tuple[tuple[int, ...], ...]
    shifts: tuple[float, ...]
    given: bool

    def describe(self) -> str:
        """One line."""
        each = ", ".join(f"type {t}: {s:+.3f}" for t, s in enumerate(self.shifts))
        return f"lenses in focus at shifts (gap over distance) {'given' if self.given else 'found'}: {each}"


def of_camera(camera: IICamera) -> Foci | None:
    """Return the foci of a camera of lenslets with several focal lengths; None of another."""
    model = camera.lens_model
    if not isinstance(model, Lenslet) or not isinstance(model.focal_mm, tuple):
        return None
    lengths = sorted({f for row in model.focal_mm for f in row})
    if len(lengths) < 2:
        return None
    matrix = tuple(tuple(lengths.index(f) for f in row) for row in model.focal_mm)
    return Foci(matrix, tuple(camera.gap_mm / f - 1 for f in lengths), given=True)


def with_foci(camera: IICamera, foci: Foci) -> IICamera:
    """Return the camera with lenslets as wide as their pitch, of the focal lengths that the foci give."""
    focal = tuple(tuple(camera.gap_mm / (1 + foci.shifts[t]) for t in row) for row in foci.matrix)
    model = Lenslet(focal_mm=focal, aperture_mm=min(camera.lens_pitch_mm))
    return replace(camera, optics=(model, *camera.front))


@checks.checked(path=checks.path)
def virtual_depths(path: str | os.PathLike[str]) -> tuple[float, ...]:
    """Return the virtual depth in focus of each lens type of a calibration that a Raytrix program wrote as XML.

    It is the harmonic mean of the least and the greatest depth of the type's range.

    Raises
    ------
    ValueError
        If the file is no such XML.
    OSError
        If it cannot be read.
    """
    from xml.etree import ElementTree

    path = Path(path)
    check_file(path)
    try:
        text = path.read_bytes()
        if len(text) > MOST_XML or b"<!" in text:  # entities could grow without end
            raise ValueError(f"{len(text)} bytes: at most {MOST_XML} without declarations are read")
        root = ElementTree.fromstring(text)
        ranges = [
            tuple(float(kind.findtext(f"depth_range/{end}", "nan")) for end in ("min", "max"))
            for kind in sorted(root.iterfind("lens_type"), key=lambda kind: int(kind.get("id", "0")))
        ]
        if root.tag != "RayCalibData" or not 2 <= len(ranges) <= 4:
            raise ValueError(f"<{root.tag[:40]}> of {len(ranges)} lens_type: <RayCalibData> of 2 to 4 is needed")
        if not all(1 <= low < high < 1e6 for low, high in ranges):
            raise ValueError("a depth_range is none: 1 ≤ min < max is needed")
    except (ValueError, ElementTree.ParseError, RecursionError) as error:
        raise ValueError(f"{path} is no calibration of a Raytrix camera: {one_line(error)}") from None
    return tuple(2 / (1 / low + 1 / high) for low, high in ranges)


@checks.checked(picture=checks.instance(IIPicture))
def shifts_of(picture: IIPicture) -> NDArray[np.float32]:
    """Return the shift of every pixel, (N, M), by matching with the lenses around; NaN where it has no lens.

    Raises
    ------
    ValueError
        If the picture has no camera.
    """
    lattice, owner, x, y = _lenses(picture)
    farthest = REACH * min(lattice.pitch)
    steps = int(np.ceil(MOST_SHIFT * farthest / STEP_PX))
    shifts = np.linspace(-MOST_SHIFT, MOST_SHIFT, 2 * steps + 1)
    grey = np.ascontiguousarray(picture.pixels.mean(axis=2, dtype=np.float32))
    out = np.full(owner.shape, np.nan, np.float32)
    half = int(np.ceil(0.6 * max(lattice.pitch))) + 1
    over_rows(lambda a, b: match(grey, owner, x, y, shifts, farthest, half, a, b, out), lattice.lenses[1])
    return out


@checks.checked(picture=checks.instance(IIPicture), types=checks.instance(LensTypes))
def lens_foci(
    picture: IIPicture,
    types: LensTypes,
    shifts: NDArray[np.float32] | None = None,
    *,
    depths: tuple[float, ...] | None = None,
) -> Foci | None:
    """Return where each type of lens is in focus, from the detail under lenses over depth.

    Parameters
    ----------
    picture : IIPicture
        Without vignetting, with its camera.
    types : LensTypes
    shifts : ndarray, (N, M), optional
        Of `shifts_of`.
    depths : sequence of float, optional
        Virtual depths in focus, of any order: detail then tells which type has which, and on which side points are.

    Returns
    -------
    Foci or None
        None if there is one type, or the picture does not tell: it needs detail at several depths.
    """
    import itertools

    matrix = types.rows
    count = len(types.detail)
    if count < 2:
        return None
    if depths is not None and len(depths) != count:
        raise ValueError(f"{len(depths)} virtual depths are given, and the array has {count} lens types")
    shifts = shifts_of(picture) if shifts is None else shifts
    found = _lines(picture, matrix, count, shifts)
    if found is None:
        return None
    slope, offset, spread = found
    if depths is not None:
        # Of all orders and both sides, the one whose lines the detail follows best.
        def agreement(order: tuple[float, ...]) -> float:
            s = np.array(order)
            lines = np.stack([2 * (s - s.mean()), -(s * s - (s * s).mean())])
            return float((lines * np.stack([slope, offset]) * spread).sum() / np.linalg.norm(lines * spread))

        sides = ([sign / d for d in depths] for sign in (1, -1))
        best = max((order for side in sides for order in itertools.permutations(side)), key=agreement)
        return Foci(matrix, tuple(map(float, best)), given=True)
    # offset = −mean·slope − (slope² − its mean)/4w: least squares for the mean of all foci and 1/4w.
    terms = np.stack([-slope, -(slope**2 - (slope**2).mean())], axis=1)
    (mean, quarter), *_ = np.linalg.lstsq(terms, offset, rcond=None)
    if count == 2:  # both squares are alike: the mean is known, the distance is not
        return None
    if not quarter > 0:
        return None
    foci = mean + 2 * quarter * slope
    if not (np.ptp(foci) >= LEAST_SPREAD and np.abs(foci).max() < 1):
        return None
    return Foci(matrix, tuple(map(float, foci)), given=False)


@checks.checked(picture=checks.instance(IIPicture), foci=checks.instance(Foci))
def fused(
    picture: IIPicture,
    foci: Foci | None = None,
    *,
    only: int | None = None,
    shifts: NDArray[np.float32] | None = None,
) -> tuple[IIPicture, NDArray[np.bool_]]:
    """Return a picture in which every pixel is as the best focused lenses around show its point.

    Parameters
    ----------
    picture : IIPicture
        With its camera.
    foci : Foci, optional
        Those of the camera, if not given.
    only : int, optional
        Take every pixel from lenses of this type, where one shows its point.
    shifts : ndarray, (N, M), optional
        Of `shifts_of`.

    Returns
    -------
    picture : IIPicture
        Of the same structure. Its camera has pinholes, or lenses of the one type.
    taken : ndarray of bool, (N, M)
        True where a pixel is that of other lenses.

    Raises
    ------
    ValueError
        If the camera has one focus, or there is no such type.
    """
    camera = picture.camera
    if camera is None:
        raise ValueError("the picture has no camera: one is needed")
    foci = of_camera(camera) if foci is None else foci
    if foci is None:
        raise ValueError("the camera has no lenses of several focal lengths: only one focus is known")
    count = len(foci.shifts)
    if only is not None and not 0 <= only < count:
        raise ValueError(f"lens type is {only}: the array has types 0 to {count - 1}")
    lattice, owner, x, y = _lenses(picture)
    shifts = shifts_of(picture) if shifts is None else shifts
    source, out = np.ascontiguousarray(picture.pixels), picture.pixels.copy()
    taken = np.zeros(owner.shape, np.bool_)
    kinds, at = _kinds(foci.matrix, lattice.lenses), np.array(foci.shifts)
    whole, wanted = source.dtype.kind != "f", -1 if only is None else only
    most = float(np.iinfo(source.dtype).max) if whole else np.inf
    reach = REACH * min(lattice.pitch)
    over_rows(
        lambda a, b: fuse(source, owner, x, y, kinds, at, shifts, wanted, reach, whole, most, a, b, out, taken),
        len(owner),
    )
    model: tuple[Any, ...] = ()  # pinholes
    if only is not None:
        model = (Lenslet(focal_mm=camera.gap_mm / (1 + foci.shifts[only]), aperture_mm=min(camera.lens_pitch_mm)),)
    return replace(picture, pixels=out, camera=replace(camera, optics=(*model, *camera.front))), taken


def _lenses(picture: IIPicture) -> tuple[Any, NDArray[np.int32], NDArray[np.float64], NDArray[np.float64]]:
    """Return the lattice, the owner of each pixel, and x and y of all centres, (L, K)."""
    if picture.camera is None:
        raise ValueError("the picture has no camera: one is needed")
    lattice = picture.camera.lens_lattice
    (k, l) = lattice.lenses
    x, y = lattice.centres(np.arange(k)[None, :], np.arange(l)[:, None])
    x, y = (np.ascontiguousarray(np.broadcast_to(a, (l, k))) for a in (x, y))
    return lattice, owners(lattice, picture.size), x, y


def _kinds(matrix: tuple[tuple[int, ...], ...], lenses: tuple[int, int]) -> NDArray[np.int64]:
    """Return the type of each lens, (L, K)."""
    rows = np.array(matrix, np.int64)
    return np.tile(rows, (-(-lenses[1] // rows.shape[0]), -(-lenses[0] // rows.shape[1])))[: lenses[1], : lenses[0]]


def _lines(
    picture: IIPicture, matrix: tuple[tuple[int, ...], ...], count: int, shifts: NDArray[np.float32]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]] | None:
    """Return slope and offset of log detail over the shift, of each type less the mean of all, and weights of both.

    None if detail is too little, or at one depth.
    """
    lattice, owner, x, y = _lenses(picture)
    grey = picture.pixels.mean(axis=2, dtype=np.float32)
    energy = np.square(ndimage.laplace(grey))
    inside = owner >= 0
    lens = owner[inside]
    row, col = np.nonzero(inside)
    near = np.hypot(col + 0.5 - x.ravel()[lens], row + 0.5 - y.ravel()[lens]) < 0.35 * min(lattice.pitch)
    row, col, lens = row[near], col[near], lens[near]
    kind, shift, detail = _kinds(matrix, lattice.lenses).ravel()[lens], shifts[row, col], energy[row, col]
    known = np.isfinite(shift) & (np.abs(shift) < 0.96 * MOST_SHIFT)
    bins = np.floor((shift[known] / MOST_SHIFT + 1) / 2 * BINS).astype(np.int64)
    at = bins * count + kind[known]
    pixels, total, place = (
        np.bincount(at, weights, BINS * count).reshape(BINS, count) for weights in (None, detail[known], shift[known])
    )
    enough = (pixels >= FEWEST_PIXELS).all(axis=1) & (total > 0).all(axis=1)
    if enough.sum() < 2:
        return None
    level = np.log(total[enough] / pixels[enough])
    level -= level.mean(axis=1, keepdims=True)
    s = place[enough].sum(axis=1) / pixels[enough].sum(axis=1)
    weight = np.sqrt(total[enough].sum(axis=1))  # what has detail says more
    slope, offset = np.polyfit(s, level, 1, w=np.sqrt(weight))
    return slope, offset, np.array([[np.sqrt(np.average(s * s, weights=weight))], [1.0]])


@exact_stage_kernel
def _sampled(source, owner, lens, px, py):
    """Return the bilinear value of a grey picture at a place; NaN unless the lens owns all four pixels around."""
    row, column = np.int64(np.floor(py - 0.5)), np.int64(np.floor(px - 0.5))
    if row < 0 or column < 0 or row + 1 >= owner.shape[0] or column + 1 >= owner.shape[1]:
        return np.nan
    for n in range(row, row + 2):
        for m in range(column, column + 2):
            if owner[n, m] != lens:
                return np.nan
    down, right = py - 0.5 - row, px - 0.5 - column
    upper = source[row, column] * (1 - right) + source[row, column + 1] * right
    lower = source[row + 1, column] * (1 - right) + source[row + 1, column + 1] * right
    return upper * (1 - down) + lower * down


@kernel
def match(grey, owner, x, y, shifts, reach, half, first, last, out):
    """Find the shift of the pixels of lenses in rows of lenses, by the mean difference from all lenses in reach."""
    side, count = 2 * half + 1, shifts.shape[0]
    sums, seen = np.empty((side + 1, side + 1)), np.empty((side + 1, side + 1))
    costs = np.empty((count, side, side), np.float32)
    for l in range(first, last):
        for k in range(x.shape[1]):
            lens = l * x.shape[1] + k
            top, left = np.int64(np.floor(y[l, k])) - half, np.int64(np.floor(x[l, k])) - half
            for i in range(count):
                sums[:], seen[:] = 0.0, 0.0
                for r in range(side):
                    n = top + r
                    for c in range(side):
                        m = left + c
                        total, lenses = 0.0, 0
                        if 0 <= n < owner.shape[0] and 0 <= m < owner.shape[1] and owner[n, m] == lens:
                            for lo in range(max(l - 2, 0), min(l + 3, x.shape[0])):
                                for ko in range(max(k - 3, 0), min(k + 4, x.shape[1])):
                                    dx, dy = x[lo, ko] - x[l, k], y[lo, ko] - y[l, k]
                                    if (lo == l and ko == k) or dx * dx + dy * dy > reach * reach:
                                        continue
                                    other = lo * x.shape[1] + ko
                                    px, py = m + 0.5 + (1 + shifts[i]) * dx, n + 0.5 + (1 + shifts[i]) * dy
                                    value = _sampled(grey, owner, other, px, py)
                                    if not np.isnan(value):
                                        total += abs(value - grey[n, m])
                                        lenses += 1
                        have = 1.0 if lenses >= 2 else 0.0
                        mean = total / lenses if lenses >= 2 else 0.0
                        sums[r + 1, c + 1] = mean + sums[r, c + 1] + sums[r + 1, c] - sums[r, c]
                        seen[r + 1, c + 1] = have + seen[r, c + 1] + seen[r + 1, c] - seen[r, c]
                for r in range(side):
                    a, b = max(r - WINDOW, 0), min(r + WINDOW + 1, side)
                    for c in range(side):
                        d, e = max(c - WINDOW, 0), min(c + WINDOW + 1, side)
                        known = seen[b, e] - seen[a, e] - seen[b, d] + seen[a, d]
                        cost = sums[b, e] - sums[a, e] - sums[b, d] + sums[a, d]
                        costs[i, r, c] = cost / known if known > 2 else np.inf
            for r in range(side):
                n = top + r
                for c in range(side):
                    m = left + c
                    if 0 <= n < owner.shape[0] and 0 <= m < owner.shape[1] and owner[n, m] == lens:
                        best = np.argmin(costs[:, r, c])
                        if costs[best, r, c] < np.inf:
                            out[n, m] = shifts[best] + _vertex(costs, best, r, c) * (shifts[1] - shifts[0])


@exact_stage_kernel
def _vertex(costs, best, r, c):
    """Return the minimum of the parabola through a least cost and its neighbours, in steps from it."""
    if best == 0 or best + 1 == costs.shape[0]:
        return 0.0
    before, here, after = costs[best - 1, r, c], costs[best, r, c], costs[best + 1, r, c]
    curve = before + after - 2 * here
    if not (0 < curve < np.inf):
        return 0.0
    return 0.5 * (before - after) / curve


@kernel
def fuse(source, owner, x, y, kinds, foci, shifts, wanted, reach, whole, most, first, last, out, taken):
    """Replace pixels in rows of pixels by the mean of lenses whose type is best focused at their shift."""
    value, total = np.empty(3), np.empty(3)
    for n in range(first, last):
        for m in range(owner.shape[1]):
            lens, s = owner[n, m], shifts[n, m]
            if lens < 0 or np.isnan(s):
                continue
            l, k = lens // x.shape[1], lens % x.shape[1]
            own = kinds[l, k]
            limit = abs(s - foci[own]) - KEPT
            tried = np.zeros(foci.shape[0], np.bool_)
            while True:
                kind = -1
                for t in range(foci.shape[0]):
                    if wanted >= 0:
                        better = t == wanted and t != own and not tried[t]
                    else:
                        better = t != own and not tried[t] and abs(s - foci[t]) < limit
                        better = better and (kind < 0 or abs(s - foci[t]) < abs(s - foci[kind]))
                    if better:
                        kind = t
                if kind < 0:
                    break
                tried[kind] = True
                total[:], weights = 0.0, 0.0
                for lo in range(max(l - 2, 0), min(l + 3, x.shape[0])):
                    for ko in range(max(k - 3, 0), min(k + 4, x.shape[1])):
                        dx, dy = x[lo, ko] - x[l, k], y[lo, ko] - y[l, k]
                        if kinds[lo, ko] != kind or dx * dx + dy * dy > reach * reach:
                            continue
                        px, py = m + 0.5 + (1 + s) * dx, n + 0.5 + (1 + s) * dy
                        if _cubic(source, owner, lo * x.shape[1] + ko, px, py, value):
                            weight = 1 / (dx * dx + dy * dy)
                            weights += weight
                            for c in range(3):
                                total[c] += weight * value[c]
                if weights > 0:
                    taken[n, m] = True
                    for c in range(3):
                        mean = total[c] / weights
                        out[n, m, c] = min(max(np.rint(mean), 0.0), most) if whole else mean
                    break


@exact_stage_kernel
def _cubic(source, owner, lens, px, py, value):
    """Sample colours at a place by cubic convolution; return whether the lens owns all sixteen pixels around."""
    row, column = np.int64(np.floor(py - 0.5)), np.int64(np.floor(px - 0.5))
    if row < 1 or column < 1 or row + 2 >= owner.shape[0] or column + 2 >= owner.shape[1]:
        return False
    for n in range(row - 1, row + 3):
        for m in range(column - 1, column + 3):
            if owner[n, m] != lens:
                return False
    down, right = py - 0.5 - row, px - 0.5 - column
    value[:] = 0.0
    for n in range(4):
        for m in range(4):
            weight = _keys(n - 1 - down) * _keys(m - 1 - right)
            for c in range(3):
                value[c] += weight * source[row - 1 + n, column - 1 + m, c]
    return True


@exact_stage_kernel
def _keys(t):
    """Return the kernel of cubic convolution, a = −½."""
    t = abs(t)
    if t < 1:
        return (1.5 * t - 2.5) * t * t + 1
    return ((-0.5 * t + 2.5) * t - 4) * t + 2 if t < 2 else 0.0
