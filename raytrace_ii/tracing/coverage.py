"""Coverage: which share of each pixel the bodies have, by visibility alone.

Pixels around which one body is seen are that body's. Any others are parted as by `edges`: two bodies share a pixel by
the lines that part them. Where small bodies may be, it gets `SAMPLES`. Rays pass the middle of an aperture.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .edges import FOLLOWED, Cells, Sight
from .kernels import cells as kernels
from .kernels.cells import OPEN, UNITS, Places, Points
from .sampling import Edges, fixed_sum
from .support_images import NAMES, name_hashes
from .tracer import Support

SAMPLES = 64
LIGHT = 1.0 / 65536  # between the bodies
APART = 4096.0 / LIGHT  # codes: edges between bodies are found to a unit of the pixel
CURVE = np.array([0.0, APART])
Whole = NDArray[np.int64]
Shares = tuple[Whole, Whole, NDArray[np.float64]]  # numbers of pixels, bodies, parts of the pixel


@dataclass
class Coverage(Cells):
    """Pixels of bodies: each has a light of its own."""

    by_body = True

    def _trace(self, places: Places, points: Points, bodies: bool, finer: float) -> None:
        self.sight.check()
        within = np.stack([places.x, places.y], axis=1).astype(np.float64) / UNITS
        points.body[:] = self._bodies(
            *self.sight.camera.weighted_rays_at(self.m[places.pixel], self.n[places.pixel], within)
        )
        points.light[:], points.normal[:] = 0, (0, 0, 1)
        points.light[:, 0] = (points.body + 1) * LIGHT

    def _bodies(self, L: Any, D: Any, shares: Any) -> NDArray[np.int32]:
        tracer = self.sight.tracer
        if tracer.sees_bodies:
            return tracer.bodies(L, D, shares)
        seen = Support.empty((len(L),), {"object_id"})
        tracer.run(L, D, np.zeros((len(L), 3), np.float32), seen, shares)
        assert seen.object_id is not None
        return seen.object_id

    def shares(self, pixels: Whole) -> list[Shares]:
        """Return the shares of pixels."""
        half, many = np.full(len(pixels), UNITS / 2, np.float32), self.lens.size
        self.look_around(Places(pixels.astype(np.int32), half, half))
        kernels.encode(self.points.light[:many], self.curve, self.points.code)
        steps, opened = np.zeros(many, np.float32), np.zeros(many, np.bool_)
        kernels.doubtful(self.points, self.lens, self.own, self.wanted.error, steps, np.empty(many, np.bool_))
        self._look_beyond(steps, steps)
        strips = self._strips_of(pixels)
        doubtful, left, found = (steps > 0) | (strips[:, 5] != 0), [pixels[:0]], []
        for _ in range(FOLLOWED):
            some = np.flatnonzero(doubtful & ~opened)
            if not len(some):
                break
            opened[some] = True
            if not self._looks():
                left.append(some)
                continue
            told = self._looked(some, np.full(len(some), APART * LIGHT, np.float32), strips[some])
            codes = ((told.bodies + 1) * LIGHT * APART).astype(np.float32)[:, :, None].repeat(3, axis=2)
            verdict = np.empty(len(some), np.int8)
            kernels.mix(
                some, told, codes, codes, codes, codes, self.points, self.wanted.error, self.lens, self.sums, verdict,
                doubtful,
            )  # fmt: skip
            left.append(some[verdict == OPEN])
            which, group = np.nonzero((told.shares > 0) & (verdict != OPEN)[:, None])
            found.append((some[which], told.bodies[which, group].astype(np.int64), told.shares[which, group]))
        whole = pixels[~opened[pixels]]
        alone = whole, self.points.body[whole].astype(np.int64), np.ones(len(whole))
        return [alone, *found, self._sampled(np.concatenate(left))]

    def _sampled(self, pixels: Whole) -> Shares:
        s, counted = self.sight, [np.empty(0, np.int64)]

        def shoot(L: Any, D: Any, shares: Any, **_: Any) -> NDArray[np.float32]:
            s.check()
            counted.append(self._bodies(L, D, shares).astype(np.int64))
            return np.zeros((len(L), 3), np.float32)

        fixed_sum(s.camera, SAMPLES, s.seed, self.m[pixels], self.n[pixels], s.batch, lambda _: (1, 1), shoot)
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
    n, m = np.mgrid[rows, cols]
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
