"""Supersampling: positions and number of the samples of a pixel.

Up to 16 samples of a pixel stand where `sample_places` puts them, more are the first of a (0, 2)-sequence, see
`sample_kernels.places`. Their number is fixed, or adaptive: it starts with the least, then doubles, pixel by pixel,
until the estimated standard error of the pixel is within a target or the most is reached. The estimate is

    error² = Σ(qᵢ − x̄)² / 12 + d² / n³

in linear light and by channel: qᵢ are the means of the four quarters of the n samples, each of which is spread over
the whole pixel, so that their scatter knows of the stratification; d is the largest difference, after the first
round, to the eight neighbours under the same lens. It stands for an edge that all samples have missed: parallel to a
side and anywhere, an edge of height d hides d / n^1.5 (root mean square) from n stratified samples. Under another
lens something else is seen, and its pixels say nothing. The error is told in steps of 8-bit sRGB, half the distance
of the codes of x̄ ± error, the worst channel's.

The quarters share out the pixel among themselves, so that their mean is better than the mean of four strangers: the
target is kept with room to spare. What the estimate cannot see: an object so small that in the first round no sample
of a pixel or its neighbours meets it, as a hair far away; a highlight smaller than that; and anything beyond white,
where the codes end, also in pictures of floats. Four quarters that agree by chance stop a pixel too soon; `least`
guards against both.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ii_core import IICamera

from ..tracing.kernels.arrays import Start
from ..tracing.tracer import CameraRays
from . import sample_kernels
from .sample_places import doubling_places, fixed_places

MOST_SAMPLES = 1 << 16

Floats = NDArray[np.float64]
Radiance = NDArray[np.float32]


@dataclass(frozen=True)
class Adaptive:
    """From ``least`` to ``most`` samples a pixel, until its standard error is within ``error`` steps of 8 bits."""

    least: int
    most: int
    error: float


@dataclass(frozen=True)
class Edges:
    """The centre of each pixel, and more where the picture has a step, within ``error`` steps of 8 bits: `edges`."""

    error: float


EDGES = "edges"
ERROR = 0.5  # of adaptive samples and `EDGES`, in 8-bit steps, unless it is given
EDGE_ERRORS = 1e-3, 1e3  # least and largest that mean anything: no set is as good, no step as large
APERTURE_SAMPLES = 4, 64  # of `EDGES` with a camera whose rays spread over an aperture
Sampling = int | Adaptive | Edges


def sampling(samples: Any = None, error: float | None = None) -> Sampling:
    """A number of samples, a pair or `EDGES` and an error, checked; an error alone means `EDGES`.

    Raises
    ------
    ValueError
        If a number is not whole or too small, the error is not positive, or it is of a fixed number.
    """
    if samples is None:
        samples = 1 if error is None else EDGES
    wanted = ERROR if error is None else _error(error)
    if isinstance(samples, str):
        if samples != EDGES:
            raise ValueError(f"samples is {samples!r}: a whole number, a pair of them or {EDGES!r} is needed")
        return Edges(min(max(wanted, EDGE_ERRORS[0]), EDGE_ERRORS[1]))
    pair = samples if isinstance(samples, tuple) else (samples,)
    for value in pair:
        if not isinstance(value, int | np.integer) or isinstance(value, bool) or not 1 <= value <= MOST_SAMPLES:
            raise ValueError(f"samples is {value!r}: a whole number from 1 to {MOST_SAMPLES} is needed")
    if len(pair) == 1:
        if error is not None:
            raise ValueError(f"error is {error:g}, but the number of samples is fixed: a pair or {EDGES!r} is needed")
        return int(pair[0])
    if len(pair) != 2 or not 4 <= pair[0] <= pair[1] or any(n & (n - 1) for n in pair):
        raise ValueError(f"samples is {samples!r}: two powers of 2 are needed, at least 4 and the second not less")
    return Adaptive(int(pair[0]), int(pair[1]), wanted)


def _error(error: float) -> float:
    if not 0 < error < math.inf:
        raise ValueError(f"error is {error}: a positive number of 8-bit steps is needed")
    return float(error)


def of_camera(wanted: Sampling, camera: IICamera) -> Sampling:
    """Return the sampling for a camera: rays over an aperture blur edges, and get adaptive samples instead."""
    if isinstance(wanted, Edges) and camera.samples_aperture:
        return Adaptive(*APERTURE_SAMPLES, wanted.error)
    return wanted


def number_of_samples(wanted: Sampling) -> tuple[int, int]:
    """Return the least and the most samples of a pixel: 1 with `EDGES`, where more follow from the picture."""
    if isinstance(wanted, Adaptive):
        return wanted.least, wanted.most
    return (wanted, wanted) if isinstance(wanted, int) else (1, 1)


@dataclass(frozen=True)
class EvenRays:
    """Rays of a camera whose coordinates grow evenly within a pixel, as those of pinholes do.

    The kernel makes them as it does those of ``centres``, from columns, rows and places. A ``lens`` has so many
    pixels, 0 if it is no whole number. ``steps`` (2, 2) is how the coordinates of start and direction grow by a
    pixel, across and down.
    """

    pixels: tuple[int, int]
    steps: Floats
    centres: Start
    lens: tuple[int, int]
    samples_aperture: bool = False

    @classmethod
    def of(cls, camera: IICamera, start: Start | None, pose: Floats) -> EvenRays | None:
        """Return the rays of a camera, whose centres ``start`` from tables; None if they are not even."""
        centres = camera.separable_rays() if start is not None else None
        if start is None or centres is None or camera.samples_aperture:
            return None
        steps = np.empty((2, 2))
        for axis, centre in enumerate(centres[:2]):
            along, across = np.arange(len(centre)), np.zeros(len(centre), np.int64)
            m, n = (along, across) if axis == 0 else (across, along)
            low, high = (
                np.stack([of[:, axis] for of in camera.weighted_rays_at(m, n, place)[:2]], axis=1)
                for place in (((0.0, 0.5), (1.0, 0.5)) if axis == 0 else ((0.5, 0.0), (0.5, 1.0)))
            )
            steps[axis] = (high - low)[0]
            slack = 1e-12 * np.abs(centre).max()
            for far, end in ((-0.5, low), (0.5, high)):
                if not np.allclose(end, centre + far * steps[axis], rtol=1e-12, atol=slack):
                    return None
        turned = np.zeros((2, 8))  # of a step right and one down
        for axis in range(2):
            turned[axis, :6] = (steps[axis, :, None] * pose[:3, axis]).reshape(-1)
        (width, height), (wide, tall) = camera.pixels, camera.lenses
        whole = min(wide, tall) > 1 and width % wide == 0 and height % tall == 0
        lens = (width // wide, height // tall) if whole else (0, 0)
        return cls(camera.pixels, steps, start._replace(steps=turned.reshape(-1)), lens)

    def start(self, m: NDArray[np.int32], n: NDArray[np.int32], within: Floats) -> Start:
        """Return rays through places, 2·p numbers, of pixels in columns m and rows n."""
        return self.centres._replace(rows=n, columns=m, within=within)

    def planes(self, seed: int, samples: int) -> tuple[Floats, Floats]:
        """Return the places of samples under a lens, (samples, U) and (samples, V), in pixels from their centres."""
        diagonal = np.arange(max(self.lens), dtype=np.int32)
        table, out = fixed_places(samples), np.empty((len(diagonal), samples, 2))
        sample_kernels.places(
            seed, diagonal, diagonal, self.pixels[0], 0, samples, 0, table, self.lens, out.reshape(-1, 2)
        )  # fmt: skip
        across, down = (out[:many, :, axis].T - 0.5 for axis, many in enumerate(self.lens))
        return across, down

    def moved(self, rows: slice, cols: slice, across: Floats, down: Floats) -> Start:
        """Return what rays of a block start from at places (U,) and (V,) under each lens, without any pixels."""
        of, (one_right, one_down) = self.centres, self.centres.steps.reshape(2, 8)
        columns, lines = (
            table.reshape(-1, 8)[some] + np.outer(place[np.arange(some.start, some.stop) % len(place)], step)
            for table, some, place, step in (
                (of.column_rays, cols, across, one_right),
                (of.row_rays, rows, down, one_down),
            )
        )
        return of._replace(column_rays=columns.reshape(-1), row_rays=lines.reshape(-1))


def camera_rays(
    camera: IICamera | EvenRays, m: NDArray[np.int32], n: NDArray[np.int32], within: Floats
) -> CameraRays:
    """Return rays through places (p, 2) in [0, 1]² of pixels (p,), by columns and rows where they are even."""
    if isinstance(camera, EvenRays):
        return camera.start(m, n, within.reshape(-1))
    return camera.weighted_rays_at(m, n, within)


class Shoot(Protocol):
    """Traces rays of a camera; ``first`` says that these begin their pixels.

    ``numbers`` are columns and rows of the pixels, the first of their samples, and how many each has; ``traced``
    names the rays in the order in which they share packets, empty if as they come. See `Tracer.run`.
    """

    def __call__(
        self, rays: CameraRays, *,
        numbers: tuple[NDArray[Any], NDArray[Any], int, int], first: slice | None, traced: NDArray[np.int32],
    ) -> NDArray[np.float32]: ...  # fmt: skip


# How samples share packets, by their number: parts of a pixel along each side, and pixels side by side.
Parts = Callable[[int], tuple[int, int]]


def fixed_sum(
    camera: IICamera | EvenRays, samples: int, seed: int, m: NDArray[Any], n: NDArray[Any], batch: int, parts: Parts,
    shoot: Shoot,
) -> Radiance:  # fmt: skip
    """Return the summed radiance (p, 3) of pixels in columns m and rows n, all with the same number of samples.

    The samples of a pixel stand together; those of one of its ``parts`` share packets with those of pixels beside it.
    """
    m, n = m.astype(np.int32, copy=False), n.astype(np.int32, copy=False)
    total, table = np.zeros((len(m), 3), np.float32), fixed_places(samples)
    for some, first, many in _portions(len(m), 0, samples, batch):
        numbers = m[some], n[some], first, many
        rays, traced = _rays(camera, seed, table, *numbers, *parts(many))
        radiance = shoot(rays, numbers=numbers, first=some if first == 0 else None, traced=traced)
        sample_kernels.sum_samples(radiance, many, total[some])
    return total


def _portions(pixels: int, start: int, count: int, batch: int) -> Iterator[tuple[slice, int, int]]:
    """Yield batches of samples start … start + count: a slice of pixels, the first sample, samples per pixel."""
    for first in range(start, start + count, batch):
        many = min(start + count - first, batch)
        for i in range(0, pixels, batch // many):
            yield slice(i, min(i + batch // many, pixels)), first, many


def adaptive_mean(
    camera: IICamera, rays_of: IICamera | EvenRays, wanted: Adaptive, seed: int, rows: slice, cols: slice,
    order: NDArray[np.int32], batch: int, curve: Floats, parts: Parts, shoot: Shoot,
) -> tuple[Radiance, NDArray[np.int32]]:  # fmt: skip
    """Mean radiance (h·w, 3) of a block of pixels and the number of samples (h·w,) of each, in a given order.

    A pixel's neighbours count wherever the block ends: pixels of a rim around it are shot once, those under lenses
    of the block's own.

    Parameters
    ----------
    order : ndarray of int, (h·w,)
        The block's pixels, by their numbers in C order.
    batch : int
        Rays to shoot at a time.
    curve : ndarray
        8-bit codes at even steps of linear light.
    parts : callable
        As of `fixed_sum`.
    shoot : callable
        Called with L, D, shares, the numbers of pixels and samples and, in the first round, which of the ordered
        pixels (every ``least``-th ray) they begin; radiance of the rays comes back.
    """
    height, width = rows.stop - rows.start, cols.stop - cols.start
    m, n, lens = with_rim(camera, rows, cols)
    own = ((n >= rows.start) & (n < rows.stop) & (m >= cols.start) & (m < cols.stop)).ravel()
    m, n = m.ravel(), n.ravel()
    quarters = np.zeros((len(m), 4, 3))
    table = fixed_places(wanted.most) if wanted.least == wanted.most else doubling_places(wanted.most)

    def add(which: NDArray[np.int64], start: int, count: int, begins: bool = False) -> None:
        """Samples start … start + count of some pixels, to the four quarters of all so far."""
        for block, first, many in _portions(len(which), start, count, batch):
            some = which[block]
            numbers = m[some], n[some], first, many
            rays, traced = _rays(rays_of, seed, table, *numbers, *parts(many))
            radiance = shoot(rays, numbers=numbers, first=block if begins and first == 0 else None, traced=traced)
            sample_kernels.add_samples(radiance, some, first, many, (start + count) // 4, quarters)

    inside, rim = np.flatnonzero(own), np.flatnonzero(~own & needed(lens, own))
    corner = int(inside[0]) // lens.shape[1], int(inside[0]) % lens.shape[1]
    inside = inside[order]
    add(inside, 0, wanted.least, begins=True)
    add(rim, 0, wanted.least)
    step = np.empty((height, width, 3))
    mean = np.empty((*lens.shape, 3))
    sample_kernels.means(quarters, np.arange(len(m)), np.full(len(m), wanted.least), mean.reshape(-1, 3))
    sample_kernels.steps_to_neighbours(mean, lens, *corner, step)
    step = step.reshape(-1, 3)[order]
    counts = np.full(len(inside), wanted.least, np.int32)
    unsure, count = np.arange(len(inside)), wanted.least
    while count < wanted.most:
        error = np.empty(len(unsure))
        sample_kernels.standard_errors(quarters, inside[unsure], step[unsure], count, curve, error)
        unsure = unsure[error > wanted.error]
        if not len(unsure):
            break
        sample_kernels.merge_quarters(inside[unsure], quarters)
        add(inside[unsure], count, count)
        count *= 2
        counts[unsure] = count
    found = np.empty((len(inside), 3), np.float32)
    sample_kernels.means(quarters, inside, counts, found)
    return found, counts


def with_rim(camera: IICamera, rows: slice, cols: slice) -> tuple[NDArray[Any], NDArray[Any], NDArray[np.int64]]:
    """Columns, rows and lens numbers of a block with one pixel around it, as far as there are any."""
    columns, lines = camera.pixels
    n, m = np.mgrid[
        max(rows.start - 1, 0) : min(rows.stop + 1, lines), max(cols.start - 1, 0) : min(cols.stop + 1, columns)
    ].astype(np.int32)
    k, l = camera.lens_lattice.nearest(m, n)
    return m, n, np.asarray(l, np.int64) * camera.lenses[0] + np.asarray(k, np.int64)


def needed(lens: NDArray[np.int64], own: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which pixels have one of the block's own under the same lens beside them."""
    mine = np.pad(np.where(own.reshape(lens.shape), lens, -1), 1, constant_values=-1)
    height, width = lens.shape
    near = np.zeros(lens.shape, bool)
    for i in range(3):
        for j in range(3):
            near |= mine[i : i + height, j : j + width] == lens
    return near.ravel()


def _rays(
    camera: IICamera | EvenRays,
    seed: int,
    table: Floats,
    m: NDArray[Any],
    n: NDArray[Any],
    first: int,
    count: int,
    parts: int,
    pixels: int,
) -> tuple[CameraRays, NDArray[np.int32]]:
    """Rays of ``count`` samples of each pixel, and the order in which they share packets.

    Even rays stand in this order, others pixel by pixel: what a pixel's samples have in common is computed once.
    """
    where: list[Floats] = []
    for pair in range(1 + camera.samples_aperture):
        out = np.empty((len(m), count, 2))
        best = table if pair == 0 else table[:0]
        lens = camera.lens if isinstance(camera, EvenRays) else (0, 0)
        sample_kernels.places(seed, m, n, camera.pixels[0], first, count, pair, best, lens, out.reshape(-1, 2))
        where.append(out)
    even, total = isinstance(camera, EvenRays), len(m) * count
    traced, columns, rows = (np.empty(total, np.int32) for _ in range(3))
    within = np.empty(2 * total)
    if parts > 1 or even:
        sample_kernels.near_together(m, n, where[0], parts, pixels, traced, columns, rows, within)
    if isinstance(camera, EvenRays):
        return camera.start(columns, rows, within), traced
    L, D, shares = camera.weighted_rays_at(m[:, None], n[:, None], *where)
    rays = L.reshape(-1, 3), D.reshape(-1, 3), None if shares is None else shares.reshape(-1)
    return rays, traced if parts > 1 else traced[:0]
