"""Samples where the edges are: one through the centre of each pixel, more where the picture has a step.

A pixel whose neighbours under the same lens look alike has the light of its centre. Any other one is a cell between
corners that neighbours share, see `cell_kernels`. If corners and centre agree, it has their mean; an edge between
two groups of them is found by bisection, mostly by visibility alone, and checked on both sides. What is neither gets
a set of samples. Small and thin bodies, which all of these may miss, have sets of their own in the strip of the pixel
in which they are seen. A tile of fine structure, which a sixteenth of its pixels tell, gets sets in all its pixels.
(Corners and their comparison: Whitted 1980.)

The error wanted is the root mean square of all pixels of a tile that get more than a ray. Some of them get two sets,
whose difference tells how far sets of any number are off; the others get as many samples as the error then allows,
more where the picture is rougher. What the filter of textures errs alike in all sets is told by a narrower one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ii_core import IICamera

from ..scene.scene import Scene
from ..tracing.kernels.glossy import lobe_keys
from ..tracing.packing import packed
from ..tracing.tracer import LOBE_RAYS, Support, Tracer
from . import cell_kernels as kernels
from . import rod_kernels
from .cell_kernels import CUT, DONE, MISSED, OPEN, UNITS, Places, Points, Sides
from .sample_kernels import places as set_places
from .sample_places import fixed_places
from .samples import Edges, EvenRays, Parts, Shoot, camera_rays, fixed_sum, needed, with_rim

ROUNDS = 3  # how often neighbours of pixels follow an edge that they did not see
# Numbers of samples of pixels that are no cells. Others above 16 miss more of an edge than these in turn.
SETS = np.array([2, 3, 4, 6, 9, 12, 16, 32, 64, 128, 256])
GOLDEN = (5**0.5 - 1) / 2  # multiples of it share pixels out evenly
DENSE = 0.28  # share of the pixels, around which much meets, from which on no edges are looked for
BLOCK, BLOCKS, FEW = 16, 16, 4096  # pixels along a block, one of how many tells of a tile, pixels that all do
LOOSE = 2.0  # how much more than the error wanted of all pixels may be hidden in one
SPREAD, SPREAD_ERROR = 0.3, 0.75  # powers of the roughness by which samples of a pixel and their error grow
PILOTS, OF_PILOTS = 400, (4, 9)  # pixels of a tile that get two sets, which tell of the error
PILOTS_FILTER = 0.6  # times the width of a set's filter: what that errs alike in all sets scatters
ALIKE = 0.8  # square of the difference of both in parts of the sum of the squares of their errors
EDGE, EDGES_FALL, NOISE_FALLS = 0.085, 1.5, 1.1  # square error of edges per roughness; powers of n by which it falls
AS_MANY = 2.9  # samples of a set that err as much as corners and centre of a cell
FAR = 3.0  # how much more than the error wanted an edge in one pixel may cause
DONE_ERROR, CUT_ERROR = 0.5, 0.9  # of cells, in parts of the error wanted
FOLLOWED, OF_THIN = 64, (4, 16)  # how far a thin body is followed, in pixels, least and most samples to find it
WHITE = 255.0  # code
SMALL, MOST_SMALL = 1.5, 256  # pixels across, any larger square covers a centre; bodies, 5 ns a pixel each
THIN = 0.75  # pixels across a body, wider ones cover centres and corners all along
OF_SMALL = 6, 64  # least and most samples where a small or thin body may be
IN_STRIP, OF_STRIP = 2, (3, 64)  # how much fewer in a strip around it, which has little of the pixel
SHIFTS = 0.7549, 0.5698  # multiples of them share a square out evenly
OF_BOX = 1000  # pixels that tell where the content is
FINER = 4.0  # how much narrower than a pixel's ray are those at corners and edges
FINEST = 4096  # places in a pixel along each side that have keys of their own
RECORDED = frozenset({"object_id", "shading_normal", "ray_length"})  # what centres have to record

Floats = NDArray[np.float64]
Radiance = NDArray[np.float32]
Whole = NDArray[np.int32]


@dataclass(frozen=True)
class Sight:
    """What looks at places of a tile's pixels.

    ``width`` is the footprint of a pixel's ray over textures, ``pixel`` that of the pixel. ``rods`` (b, 7) are
    ends and radii around small and thin bodies; ``check`` may stop it.
    """

    camera: IICamera
    rays: IICamera | EvenRays
    tracer: Tracer
    seed: int
    batch: int
    width: tuple[float, float]
    pixel: tuple[float, float]
    rods: Floats
    parts: Parts
    shoot: Shoot
    check: Callable[[], None]


@dataclass
class Cells:
    """Pixels of a tile and its rim in rows: columns and rows in the picture, lenses, and what is seen of them.

    ``verdicts`` are those of `cell_kernels`, −1 for pixels that are no cells.
    """

    sight: Sight
    wanted: Edges
    curve: Floats
    m: Whole
    n: Whole
    lens: NDArray[np.int64]
    own: NDArray[np.bool_]
    points: Points = field(init=False)
    rays: Whole = field(init=False)
    sums: Floats = field(init=False)
    verdicts: NDArray[np.int8] = field(init=False)
    _count: int = field(init=False)

    def __post_init__(self) -> None:
        self._count = n = self.lens.size
        self.points = Points(
            np.zeros((n, 3), np.float32), np.zeros((n, 3), np.float32), np.full(n, -1, np.int32),
            np.zeros((n, 3), np.float32),
        )  # fmt: skip
        self.rays, self.sums = np.ones(n, np.int32), np.zeros((n, 3))
        self.verdicts = np.full(n, -1, np.int8)

    def look_around(self, centres: Places, finer: float = FINER) -> None:
        """Look at centres of pixels, of the rim as a rule."""
        first = self._look(centres, finer=finer)
        for array in self.points:
            array[centres.pixel] = array[first : self._count]
        self._count = first

    def refine(self, inside: NDArray[np.int64], reach: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Find the light, `sums`, of all pixels whose centres do not tell it; return which they are.

        ``inside`` are the own pixels in the order of the tile's rays, ``reach`` the lengths of all pixels' rays.
        """
        many, error = self.lens.size, LOOSE * self.wanted.error
        steps, rough, opened = np.zeros(many, np.float32), np.zeros(many, np.float32), np.zeros(many, np.bool_)
        kernels.encode(self.points.light[: self._count], self.curve, self.points.code)
        kernels.doubtful(self.points, self.lens, self.own, error, steps)
        kernels.roughness(self.points, self.lens, np.empty((many, 2), np.float32), rough)
        self._look_beyond(steps, rough)
        doubtful = steps > 0
        if len(self.sight.rods):
            opened[self._small(inside)] = True
        left, thin, near = [], np.zeros(many, np.bool_), np.empty(many, np.float32)
        kernels.nearest_around(reach, self.lens, near)
        corner_of = np.full((many, 4), -1, np.int32)
        for _ in range(ROUNDS):
            pixels = np.flatnonzero(doubtful & ~opened & self.own)
            if not len(pixels):
                break
            opened[pixels] = True
            left.append(self._open(self._near_together(pixels, near), corner_of, doubtful, rough, thin))
        self._share_out(np.concatenate(left or [inside[:0]]), rough)
        self._follow(thin, opened)
        return opened

    def dense(self, some: NDArray[np.int64]) -> bool:
        """Tell by some of the pixels whether sets in all of them are worth more than looking for edges."""
        half = np.full(len(some), UNITS / 2, np.float32)
        self.look_around(Places(some.astype(np.int32), half, half), 1.0)
        own = np.zeros(self.lens.size, np.bool_)
        own[some] = True
        lens, crowded = np.where(own.reshape(self.lens.shape), self.lens, -1), np.empty(self.lens.size, np.bool_)
        steps = np.empty(self.lens.size, np.float32)
        kernels.doubtful(self.points, lens, own, LOOSE * self.wanted.error, steps)
        kernels.crowded(self.points, lens, steps, crowded)
        return bool(np.count_nonzero(crowded) > DENSE * len(some))

    def fill(self, some: NDArray[np.int64], order: NDArray[np.int64]) -> None:
        """Find the light of all pixels by sets of two numbers of samples that some of the pixels tell."""
        rough = np.empty(self.lens.size, np.float32)
        kernels.roughness(self.points, self.lens, np.empty((self.lens.size, 2), np.float32), rough)
        pilots = some[_pilots(len(some))]
        edges, noise = self._pilot(pilots, float(np.mean(np.maximum(rough[pilots], 1.0))))
        squares = edges * SETS**-EDGES_FALL + noise * SETS**-NOISE_FALLS
        at = np.interp(-(self.wanted.error**2), -squares, np.arange(len(SETS)))
        more = GOLDEN * np.arange(len(order)) % 1 < at % 1
        numbers = SETS[np.minimum(int(at) + more, len(SETS) - 1)]
        if len(self.sight.rods):
            thin = np.zeros(self.lens.size, np.bool_)
            thin[self._small(order)] = True
            numbers, order = numbers[~thin[order]], order[~thin[order]]
        self._sample(order, numbers)

    def _look_beyond(self, steps: NDArray[np.float32], rough: NDArray[np.float32]) -> None:
        """Doubt pixels at the border of a lens on whose outer side another body is seen."""
        places = _places(4 * int(np.count_nonzero(self.own)))
        places = _part(places, slice(kernels.beyond(self.lens, self.own, steps, places)))
        if not len(places.pixel):
            return
        first = self._look(places, self.sight.tracer.sees_bodies)
        other = places.pixel[self.points.body[first : self._count] != self.points.body[places.pixel]]
        self._count = first
        usual = np.median(rough[steps > 0]) if (steps > 0).any() else 0.0
        steps[other], rough[other] = WHITE, np.maximum(rough[other], usual)

    def _small(self, inside: NDArray[np.int64]) -> NDArray[np.int64]:
        """Find the light of those pixels in which small bodies may be seen, and return them."""
        which, strip = self._touched(inside)
        pixels, narrow = inside[which], strip[:, 5] > 0
        number = (MISSED * WHITE / 2 / self.wanted.error) ** (4 / 3)
        whole = pixels[~narrow]
        self._sample(whole, _numbers(np.full(len(whole), np.clip(number, *OF_SMALL))))
        numbers = _numbers(np.full(int(np.count_nonzero(narrow)), np.clip(number / IN_STRIP, *OF_STRIP)))
        for number in np.unique(numbers).tolist():
            self._strips(pixels[narrow][numbers == number], strip[narrow][numbers == number], number)
        return pixels

    def _touched(self, pixels: NDArray[np.int64]) -> tuple[NDArray[np.int64], Floats]:
        """Return which pixels small bodies may be seen in, and strips (n, 6) of them, see `rod_kernels.strips`."""
        one = np.empty(len(pixels), np.int32)
        rod_kernels.touched(*self._unit_rays(pixels), self.sight.rods, *self.sight.pixel, one)
        which = np.flatnonzero(one != -1)
        one, (L, D) = one[which], self._unit_rays(pixels[which])
        right, down = (2 * (self._unit_rays(pixels[which], *at)[1] - D) for at in ((1.0, 0.5), (0.5, 1.0)))
        rod_kernels.strips(L, D, right, down, self.sight.rods, one, strip := np.empty((len(which), 6)))
        seen = strip[:, 5] != 0
        return which[seen], strip[seen]

    def _unit_rays(self, pixels: NDArray[np.int64], x: float = 0.5, y: float = 0.5) -> tuple[Radiance, Radiance]:
        """Return origins and unit directions of rays through one place of pixels, in the scene's frame."""
        within = np.broadcast_to(np.array([x, y]), (len(pixels), 2))
        return self.sight.tracer.unit_rays(camera_rays(self.sight.rays, self.m[pixels], self.n[pixels], within))

    def _strips(self, pixels: NDArray[np.int64], strip: Floats, number: int) -> None:
        """Find the light of pixels by as many samples in the strip of a small body as around it."""
        s, count = self.sight, 2 * number
        s.tracer.footprint = s.width[0] / number**0.5, s.width[1] / number**0.5
        s.tracer.lobes = -(-LOBE_RAYS // count), count
        self.rays[pixels] += count
        for start in range(0, len(pixels), s.batch // count):
            some = slice(start, start + s.batch // count)
            m, n = self.m[pixels[some]], self.n[pixels[some]]
            set_of = np.empty((len(m) * number, 2))
            set_places(s.seed, m, n, s.camera.pixels[0], 0, number, 0, fixed_places(number), (0, 0), set_of)
            twice = np.tile(set_of.reshape(-1, number, 2), (1, 2, 1))
            # a body stands in its strip in the same place in all pixels
            twice[:, :number] = (twice[:, :number] + np.outer(m + 1.6 * n, SHIFTS)[:, None]) % 1.0
            rod_kernels.strip_places(strip[some], twice, shares := np.empty(twice.shape[:2]))
            rays = camera_rays(s.rays, np.repeat(m, count), np.repeat(n, count), twice.reshape(-1, 2))
            light = s.shoot(rays, numbers=(m, n, 0, count), first=None, traced=np.empty(0, np.int32))
            rod_kernels.add_shares(light, shares, pixels[some], self.sums)

    def _near_together(self, pixels: NDArray[np.int64], near: NDArray[np.float32]) -> NDArray[np.int64]:
        """Return pixels in an order in which the edges that they see are close to each other in the scene.

        Rays and shadow rays of one packet then meet the same things: they take 311 instead of 436 ns (*Apples*,
        `setup1` at scale 4, 2026-11-25). An edge belongs to the nearest body around the pixel.
        """
        L, D = self._unit_rays(pixels)
        far = near[pixels]
        known = np.isfinite(far)
        far[~known] = np.median(far[known]) if known.any() else 1.0
        some = slice(None, None, -(-len(pixels) // OF_BOX))
        low, high = np.percentile(L[some] + D[some] * far[some, None], (1, 99), axis=0)
        boxes = np.empty(len(pixels), np.uint16)
        kernels.boxes(L, D, far, low, 32 / np.maximum(high - low, 1e-9), boxes)
        return pixels[np.argsort(boxes, kind="stable")]

    def _open(
        self, pixels: NDArray[np.int64], corner_of: Whole, wanted: NDArray[np.bool_], rough: NDArray[np.float32],
        thin: NDArray[np.bool_],
    ) -> NDArray[np.int64]:  # fmt: skip
        """Find the light of pixels as cells between their corners; return those that are none."""
        count = len(pixels)
        corners, places, known = np.empty((count, 4), np.int32), _places(4 * count), _places(4 * count)
        self._make_room(4 * count)
        first = self._count
        alike, new = kernels.open_pixels(
            pixels, self.lens, corner_of, self.points, self.sight.tracer.scene.plain, LOOSE * self.wanted.error,
            first, corners, places, known,
        )  # fmt: skip
        self._count += alike
        self._look(_part(places, slice(new)))
        verdict, groups, steps = np.empty(count, np.int8), np.zeros(count, np.int8), np.zeros(count, np.float32)
        kernels.judge(
            pixels, corners, self.points, LOOSE * self.wanted.error, self.lens, self.sums, verdict, groups, steps,
            wanted,
        )  # fmt: skip
        kernels.find_thin(pixels, corners, self.points, LOOSE * self.wanted.error, self.lens, thin)
        cut = np.flatnonzero(verdict == CUT)
        if len(cut):
            verdict[cut] = self._cut(pixels[cut], corners[cut], groups[cut])
        self.verdicts[pixels] = verdict
        kernels.corners_of_open(corners, verdict, first, unsure := np.zeros(alike, np.bool_))
        self._look_again(first + np.flatnonzero(unsure), _part(known, np.flatnonzero(unsure)), wanted)
        left = verdict == OPEN
        rough[pixels[left]] = steps[left] ** 2 / 3
        return pixels[left]

    def _look_again(self, rows: NDArray[np.int64], places: Places, wanted: NDArray[np.bool_]) -> None:
        """Look at corners that have the mean of four centres; pixels are wanted where another body is in between.

        Thin bodies go on from open cells to pixels whose centres show nothing of them.
        """
        if not len(rows):
            return
        first = self._look(places, self.sight.tracer.sees_bodies)
        other = np.flatnonzero(self.points.body[first : self._count] != self.points.body[rows])
        self._count = first
        if len(other):
            first = self._look(_part(places, other))
            for array in self.points:
                array[rows[other]] = array[first : self._count]
            self._count = first
            kernels.mark_around(_part(places, other), self.lens, wanted)

    def _follow(self, thin: NDArray[np.bool_], opened: NDArray[np.bool_]) -> None:
        """Find the light of pixels in which a thin body may go on that was met nearby, as far as it does."""
        calm = self.own & (self.verdicts != OPEN)
        pixels, number = np.flatnonzero(thin & calm), (MISSED * WHITE / 2 / self.wanted.error) ** (4 / 3)
        number = int(SETS[np.searchsorted(SETS, np.clip(number, *OF_THIN))])
        for _ in range(FOLLOWED):
            if not len(pixels):
                break
            calm[pixels], opened[pixels], thin[:] = False, True, False
            self._sample(pixels, np.full(len(pixels), number))
            light = self.sums[pixels].astype(np.float32)
            kernels.encode(light, self.curve, codes := np.empty_like(light))
            kernels.follow(pixels, codes, self.points, LOOSE * self.wanted.error, self.lens, thin)
            pixels = np.flatnonzero(thin & calm & (self.verdicts != CUT))

    def _cut(self, pixels: NDArray[np.int64], corners: Whole, groups: NDArray[np.int8]) -> NDArray[np.int8]:
        """Find the light of cells with one edge; return which of them turn out to have none, or more."""
        many, error = len(pixels), LOOSE * self.wanted.error
        of_cell, sides = np.empty((many, 4), np.int32), _sides(2 * many)
        side_of = np.full((self.lens.size, 4), -1, np.int32)
        made = kernels.gather_sides(pixels, corners, groups, self.lens, side_of, sides, of_cell)
        sides = _part(sides, slice(made))
        by_body = self.sight.tracer.sees_bodies
        while True:
            which, places = np.empty(made, np.int32), _places(made)
            seen, shaded = kernels.probe_sides(sides, self.points, error, by_body, which, places)
            if not seen + shaded:
                break
            for part, bodies in ((slice(seen), True), (slice(made - shaded, made), False)):
                if part.stop > (part.start or 0):
                    first = self._look(_part(places, part), bodies)
                    kernels.narrow_sides(sides, which[part], first, self.points)
                    self._count = first  # they are not needed again
        shares, places, verdict = np.empty(many), _places(2 * many), np.empty(many, np.int8)
        kernels.chords(pixels, corners, groups, of_cell, sides, self.points, error, verdict, shares, places)
        sure = np.flatnonzero(verdict == CUT)
        beside = self._look(_part(places, np.stack([2 * sure, 2 * sure + 1], axis=1).reshape(-1)))
        checked = verdict[sure]
        kernels.confirm(
            pixels[sure], corners[sure], groups[sure], shares[sure], beside, self.points, error, checked, self.sums
        )
        self._count = beside
        verdict[sure] = checked
        return verdict

    def _look(self, places: Places, bodies: bool = False, finer: float = FINER) -> int:
        """Look at places; return the row of the first of their points, of which ``bodies`` alone may be wanted."""
        first, n, s = self._count, len(places.pixel), self.sight
        self._make_room(n)
        self._count += n
        points = _part(self.points, slice(first, self._count))
        kernels.count_rays(places.pixel, self.rays)
        for start in range(0, n, s.batch):
            some = slice(start, start + s.batch)
            self._trace(_part(places, some), _part(points, some), bodies, finer)
        if not bodies:
            kernels.encode(points.light, self.curve, points.code)
        return first

    def _make_room(self, more: int) -> None:
        if len(self.points.body) < self._count + more:
            self.points = _grown(self.points, self._count, 2 * (self._count + more))

    def _trace(self, places: Places, points: Points, bodies: bool, finer: float) -> None:
        s, m, n = self.sight, self.m[places.pixel], self.n[places.pixel]
        s.check()
        within = np.stack([places.x, places.y], axis=1).astype(np.float64) / UNITS
        rays = camera_rays(s.rays, m, n, within)
        if bodies:
            points.body[:] = s.tracer.bodies(rays)
            return
        keys = None
        if s.tracer.scene.glossy:
            fine = (within * FINEST).astype(np.int64)
            keys = np.empty(len(m), np.uint64)
            across, down = FINEST * m + fine[:, 0], FINEST * n + fine[:, 1]
            lobe_keys(s.seed, across, down, FINEST * s.camera.pixels[0] + 1, 0, 1, keys)
        s.tracer.footprint, s.tracer.lobes = (s.width[0] / finer, s.width[1] / finer), (LOBE_RAYS, 1)
        points.light[:] = 0
        s.tracer.run(rays, points.light, Support(object_id=points.body, shading_normal=points.normal), keys)

    def _share_out(self, pixels: NDArray[np.int64], rough: NDArray[np.float32]) -> None:
        """Find the light of pixels by sets of samples, as many as give all opened pixels the error wanted."""
        if not len(pixels):
            return
        weights, error = np.maximum(rough[pixels], 1.0).astype(np.float64), self.wanted.error
        pilots = _pilots(len(pixels))
        cells = self.sums[pixels]
        estimated = np.isfinite(cells[:, 0])
        edges, noise = self._pilot(pixels[pilots], float(np.mean(weights[pilots])))
        eighths, which, times = np.unique(
            np.rint(8 * np.log2(weights)).astype(np.int64), return_inverse=True, return_counts=True
        )
        weights = 2.0 ** (eighths / 8)
        done, cut = (int(np.count_nonzero(self.verdicts == verdict)) for verdict in (DONE, CUT))
        expected = weights**SPREAD_ERROR / np.average(weights**SPREAD_ERROR, weights=times)
        least = (EDGE * weights / (FAR * error) ** 2) ** (1 / EDGES_FALL)
        squares = error**2 * (len(pixels) + done * (1 - DONE_ERROR**2) + cut * (1 - CUT_ERROR**2))
        of_sets = (1 - estimated.mean() * _of_cell(SETS)) * (edges * SETS**-EDGES_FALL + noise * SETS**-NOISE_FALLS)
        low, high = -10.0, 10.0
        for _ in range(30):
            middle = (low + high) / 2
            low_set, more_of = _between(np.maximum(2.0**middle * weights**SPREAD, least))
            each = of_sets[low_set] * (1 - more_of) + of_sets[low_set + 1] * more_of
            more = np.sum(times * expected * each) > squares
            low, high = (middle, high) if more else (low, middle)
        numbers = _numbers(np.maximum(2.0**high * weights**SPREAD, least)[which])
        todo = np.ones(len(pixels), np.bool_)
        todo[pilots] = numbers[pilots] > sum(OF_PILOTS)
        numbers[~todo] = sum(OF_PILOTS)
        self._sample(pixels[todo], numbers[todo])
        shares = _of_cell(numbers[estimated])[:, None]
        self.sums[pixels[estimated]] *= 1 - shares
        self.sums[pixels[estimated]] += shares * cells[estimated]

    def _pilot(self, some: NDArray[np.int64], rough: float) -> tuple[float, float]:
        """Return the mean square errors, in codes, of a sample: of edges and of noise.

        Two sets in the same pixels differ by the sum of their errors. What is more than of edges is noise.
        """
        sets, self.sums[some] = [], 0.0
        for number in OF_PILOTS:
            light = np.ascontiguousarray(self._mean(some, number, number, PILOTS_FILTER), np.float32)
            self.sums[some] += light * (number / sum(OF_PILOTS))
            sets.append(np.empty_like(light))
            kernels.encode(light, self.curve, sets[-1])
        apart = float(np.mean((sets[0] - sets[1]) ** 2)) / ALIKE
        of_edges, of_noise = (sum(n**power for n in OF_PILOTS) for power in (-EDGES_FALL, -NOISE_FALLS))
        edges = min(EDGE * rough, apart / of_edges)
        return edges, (apart - edges * of_edges) / of_noise

    def _sample(self, pixels: NDArray[np.int64], numbers: NDArray[np.int64]) -> None:
        """Find the light of pixels by sets of so many samples."""
        for number in np.unique(numbers).tolist():
            some = pixels[numbers == number]
            self.sums[some] = self._mean(some, number)

    def _mean(self, pixels: NDArray[np.int64], number: int, seed: int = 0, wide: float = 1.0) -> Floats:
        """Return the mean light of sets of samples, each filtered over its part of the pixel or ``wide`` times it."""
        s = self.sight
        s.tracer.footprint = s.width[0] * wide / number**0.5, s.width[1] * wide / number**0.5
        s.tracer.lobes = -(-LOBE_RAYS // number), number
        light = fixed_sum(s.rays, number, s.seed + seed, self.m[pixels], self.n[pixels], s.batch, s.parts, s.shoot)
        self.rays[pixels] += number
        return light / number


def _between(wanted: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Return which of `SETS` is at most as large as wanted, and the part of the pixels that gets the next one."""
    at = np.interp(np.log2(wanted), np.log2(SETS), np.arange(len(SETS)))
    first = np.minimum(at.astype(np.int64), len(SETS) - 2)
    return first, at - first


def _of_cell(numbers: NDArray[np.int64]) -> Floats:
    """Return the weight of corners and centre of a cell beside a set of samples, by least squares at edges."""
    return np.asarray(1 / (1 + (numbers / AS_MANY) ** EDGES_FALL))


def _numbers(wanted: Floats) -> NDArray[np.int64]:
    """Return numbers of samples that are those wanted in the geometric mean."""
    first, more = _between(wanted)
    return SETS[first + (GOLDEN * np.arange(len(wanted)) % 1 < more)]


def small_rods(scene: Scene, pose: Floats, pixel: tuple[float, float]) -> Floats:
    """Return rods (b, 7), ends and radii, around bodies thinner than `THIN` pixels or smaller than `SMALL`."""
    rods = packed(scene).rods
    ends = rods[:, :6].reshape(-1, 2, 3)
    width, spread = pixel
    far = np.linalg.norm(ends - pose[:3, 3], axis=2).min(axis=1)
    across, pixels = 2 * rods[:, 6], width + spread * far
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    small = (across < THIN * pixels) | (np.maximum(across, length) < SMALL * pixels)
    return rods[small][:MOST_SMALL]


def _pilots(pixels: int) -> slice:
    """Return every so many-th of some pixels, and at least one."""
    every = max(pixels // PILOTS, 4)
    return slice(min(every, pixels) // 2, None, every)


def dense_mean(
    sight: Sight, wanted: Edges, rows: slice, cols: slice, order: Whole, curve: Floats
) -> tuple[Radiance, Whole] | None:
    """Return what `edge_mean` does for a block of fine structure, without looking for edges; None for any other."""
    n, m = np.mgrid[rows, cols].astype(np.int32)
    k, l = sight.camera.lens_lattice.nearest(m, n)
    lens = np.asarray(l, np.int64) * sight.camera.lenses[0] + np.asarray(k, np.int64)
    cells = Cells(sight, wanted, curve, m.ravel(), n.ravel(), lens, np.ones(lens.size, np.bool_))
    chosen = (m // BLOCK + 4 * (n // BLOCK)) % BLOCKS == BLOCKS // 3
    some = np.flatnonzero(chosen | (lens.size <= FEW))
    if not cells.dense(some):
        return None
    inside = order.astype(np.int64)
    cells.fill(some, inside)
    return cells.sums[inside].astype(np.float32), cells.rays[inside] - 1


def edge_mean(
    sight: Sight, wanted: Edges, rows: slice, cols: slice, order: Whole, centres: Radiance, seen: Support,
    curve: Floats,
) -> tuple[Radiance, Whole]:  # fmt: skip
    """Mean radiance (h·w, 3) of a block of pixels and the number of rays (h·w,) of each, in a given order.

    Parameters
    ----------
    order : ndarray of int, (h·w,)
        The block's pixels, by their numbers in C order.
    centres, seen
        Radiance of the pixels' centres in that order, and what they `RECORDED`.
    curve : ndarray
        8-bit codes at even steps of linear light.
    """
    m, n, lens = with_rim(sight.camera, rows, cols)
    own = ((n >= rows.start) & (n < rows.stop) & (m >= cols.start) & (m < cols.stop)).ravel()
    rim = ~own if own.all() else ~own & needed(lens, own)
    lens = np.where((own | rim).reshape(lens.shape), lens, -1)
    cells = Cells(sight, wanted, curve, m.ravel(), n.ravel(), lens, own)
    inside, points, reach = np.flatnonzero(own)[order], cells.points, np.full(lens.size, np.nan, np.float32)
    assert seen.object_id is not None and seen.shading_normal is not None and seen.ray_length is not None
    found = centres.copy()  # the tracer's memory
    points.light[inside], points.body[inside] = found, seen.object_id
    points.normal[inside], reach[inside] = seen.shading_normal, seen.ray_length
    around = np.flatnonzero(rim)
    if len(around):
        half = np.full(len(around), UNITS / 2, np.float32)
        cells.look_around(Places(around.astype(np.int32), half, half))
    opened = cells.refine(inside, reach)[inside]
    found[opened] = cells.sums[inside[opened]]
    return found, cells.rays[inside]


Table = TypeVar("Table", Points, Places, Sides)


def _part(table: Table, rows: slice | NDArray[np.int64]) -> Table:
    arrays: list[Any] = [array[rows] for array in table]
    return type(table)(*arrays)


def _grown(points: Points, kept: int, room: int) -> Points:
    arrays: list[Any] = [np.empty((room, *array.shape[1:]), array.dtype) for array in points]
    for array, old in zip(arrays, points, strict=True):
        array[:kept] = old[:kept]
    return Points(*arrays)


def _places(n: int) -> Places:
    return Places(np.empty(n, np.int32), np.empty(n, np.float32), np.empty(n, np.float32))


def _sides(n: int) -> Sides:
    whole = [np.empty(n, np.int32) for _ in range(4)]
    return Sides(whole[0], whole[1], np.empty((n, 2), np.int32), whole[2], whole[3], np.empty(n, np.bool_))
