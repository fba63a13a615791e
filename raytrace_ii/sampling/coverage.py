"""Coverage: which share of each pixel the bodies have, by visibility alone.

Every pixel is a cell of `edges` between its corners. One body at all corners and the centre has the pixel; two bodies
share it by the chord of their edge; any other pixel gets `SAMPLES`. Rays pass the middle of an aperture.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..tracing.support_images import NAMES, name_hashes
from ..tracing.tracer import CameraRays, Support
from . import cell_kernels as kernels
from .cell_kernels import CUT, OPEN, UNITS, Places, Points
from .edges import Cells, Sight, _part, _places
from .samples import Edges, camera_rays, fixed_sum

SAMPLES = 64
LIGHT = 1.0 / 65536  # between the bodies
APART = 4096.0 / LIGHT  # codes: edges between bodies are found to a unit of the pixel
CURVE = np.array([0.0, APART])
Whole = NDArray[np.int64]
Shares = tuple[Whole, Whole, NDArray[np.float64]]  # numbers of pixels, bodies, parts of the pixel


@dataclass
class Coverage(Cells):
    """Cells of bodies: each has a light of its own, by which cells tell them apart and mix them."""

    def _trace(self, places: Places, points: Points, bodies: bool, finer: float) -> None:
        self.sight.check()
        within = np.stack([places.x, places.y], axis=1).astype(np.float64) / UNITS
        points.body[:] = self._bodies(
            camera_rays(self.sight.rays, self.m[places.pixel], self.n[places.pixel], within), len(within)
        )
        points.light[:], points.normal[:] = 0, (0, 0, 1)
        points.light[:, 0] = (points.body + 1) * LIGHT

    def _bodies(self, rays: CameraRays, count: int) -> NDArray[np.int32]:
        tracer = self.sight.tracer
        if tracer.sees_bodies:
            return tracer.bodies(rays)
        seen = Support.empty((count,), {"object_id"})
        tracer.run(rays, np.zeros((count, 3), np.float32), seen)
        assert seen.object_id is not None
        return seen.object_id

    def shares(self, pixels: Whole) -> list[Shares]:
        """Return the shares of pixels."""
        half, count = np.full(len(pixels), UNITS / 2, np.float32), len(pixels)
        self.look_around(Places(pixels.astype(np.int32), half, half))
        kernels.encode(self.points.light[: self.lens.size], self.curve, self.points.code)
        corners, places = np.empty((count, 4), np.int32), _places(4 * count)
        corner_of = np.full((self.lens.size, 4), -1, np.int32)
        plain, never, no_places = self.sight.tracer.scene.plain, -1.0, _places(0)
        _, new = kernels.open_pixels(
            pixels, self.lens, corner_of, self.points, plain, never, self._count, corners, places, no_places
        )  # fmt: skip
        self._look(_part(places, slice(new)))
        verdict, groups = np.empty(count, np.int8), np.zeros(count, np.int8)
        kernels.judge(
            pixels, corners, self.points, self.wanted.error, self.lens, self.sums, verdict, groups,
            np.empty(count, np.float32), np.empty(self.lens.size, np.bool_),
        )  # fmt: skip
        if len(self.sight.rods):
            verdict[self._touched(pixels)[0]] = OPEN
        cut = np.flatnonzero(verdict == CUT)
        if len(cut):
            verdict[cut] = self._cut(pixels[cut], corners[cut], groups[cut])
        cut, done = np.flatnonzero(verdict == CUT), np.flatnonzero(verdict == kernels.DONE)
        whole = pixels[done], self.points.body[pixels[done]].astype(np.int64), np.ones(len(done))
        return [whole, self._two(pixels[cut], corners[cut]), self._sampled(pixels[verdict == OPEN])]

    def _two(self, pixels: Whole, corners: NDArray[np.int32]) -> Shares:
        """Return the shares of two bodies, by the mean of their lights."""
        bodies = np.sort(self.points.body[corners].astype(np.int64), axis=1)[:, [0, 3]]
        light = (bodies + 1) * LIGHT
        second = (self.sums[pixels, 0] - light[:, 0]) / (light[:, 1] - light[:, 0])
        return np.repeat(pixels, 2), bodies.reshape(-1), np.stack([1 - second, second], axis=1).reshape(-1)

    def _sampled(self, pixels: Whole) -> Shares:
        s, counted = self.sight, [np.empty(0, np.int64)]

        def shoot(rays: CameraRays, *, numbers: Any, **_: Any) -> NDArray[np.float32]:
            s.check()
            count = len(numbers[0]) * numbers[3]
            counted.append(self._bodies(rays, count).astype(np.int64))
            return np.zeros((count, 3), np.float32)

        fixed_sum(s.rays, SAMPLES, s.seed, self.m[pixels], self.n[pixels], s.batch, lambda _: (1, 1), shoot)
        bodies = np.concatenate(counted)
        many = int(bodies.max(initial=0)) + 2
        keys, times = np.unique(np.repeat(pixels, SAMPLES) * many + bodies + 1, return_counts=True)
        return keys // many, keys % many - 1, times / SAMPLES


def covered(sight: Sight, rows: slice, cols: slice, order: NDArray[np.int32], names: list[str]) -> Any:
    """Return the coverage (h·w, 13), float32, of a block of pixels in a given order: alpha, then names and shares.

    Bodies of one name share one place, and the sky has none. Of more than six names, the largest shares stay.
    """
    (height, width), hashes = (rows.stop - rows.start, cols.stop - cols.start), name_hashes(names)
    unique, name_of = np.unique(hashes, return_inverse=True)
    n, m = np.mgrid[rows, cols].astype(np.int32)
    k, l = sight.camera.lens_lattice.nearest(m, n)
    lens = np.asarray(l, np.int64) * sight.camera.lenses[0] + np.asarray(k, np.int64)
    cells = Coverage(sight, Edges(1.0), CURVE, m.ravel(), n.ravel(), lens, np.ones(height * width, np.bool_))
    found = cells.shares(order.astype(np.int64))
    pixel, body, share = (np.concatenate(arrays) for arrays in zip(*found, strict=True))
    there = body >= 0
    keys, which = np.unique(pixel[there] * len(names) + name_of[body[there]], return_inverse=True)
    shares = np.bincount(which, share[there], len(keys))
    pixel, name = keys // max(len(names), 1), unique[keys % max(len(names), 1)]
    out = np.zeros((height * width, 1 + 2 * NAMES), np.float32)
    np.add.at(out[:, 0], pixel, shares)
    by_share = np.lexsort((-shares, pixel))
    pixel, name, shares = pixel[by_share], name[by_share], shares[by_share]
    rank = np.arange(len(pixel)) - np.searchsorted(pixel, pixel)
    kept = rank < NAMES
    out[pixel[kept], 1 + 2 * rank[kept]] = name[kept].view(np.float32)
    out[pixel[kept], 2 + 2 * rank[kept]] = shares[kept]
    return out[order]
