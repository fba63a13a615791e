"""Samples where the edges are: one through the centre of each pixel, more where the picture has a step.

A pixel whose neighbours under the same lens look alike has the light of its centre. Any other one is a cell between
corners that neighbours share, see `kernels.cells`. If corners and centre agree, it has their mean; an edge between
two groups of them is found by bisection, mostly by visibility alone, and checked on both sides. What is neither gets
a set of samples. Small and thin bodies, which all of these may miss, have sets of their own in the strip of the pixel
in which they are seen. A tile of fine structure, which a sixteenth of its pixels tell, gets sets in all its pixels.
(Corners and their comparison: Whitted 1980.)

The error wanted is the root mean square of all pixels of a tile that get more than a ray. Some of them get two sets,
whose difference tells how far sets of any number are off; the others get as many samples as the error then allows,
more where the picture is rougher. What the filter of textures errs alike in all sets is told by a narrower one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray

from ii_core import IICamera

from ..scene.scene import Scene
from .intersect import Hits
from .kernels import cells as kernels
from .kernels.cells import ANGLES, DONE, GROUPS, MISSED, OPEN, PICKS, UNITS, Places, Points, Seen
from .kernels.sampling import lobe_keys
from .kernels.sampling import places as set_places
from .sample_places import fixed_places
from .kernels.tables import ALL_COLUMNS
from .sampling import Edges, Parts, Shoot, fixed_sum, needed, with_rim
from .tracer import LOBE_RAYS, Support, Tracer

# Numbers of samples of pixels that are no cells. Others above 16 miss more of an edge than these in turn.
SETS = np.array([2, 3, 4, 6, 9, 12, 16, 32, 64, 128, 256])
GOLDEN = (5**0.5 - 1) / 2  # multiples of it share pixels out evenly
DENSE = 0.3  # share of the pixels, around which much meets, from which on no edges are looked for
BLOCK, BLOCKS, FEW = 16, 16, 4096  # pixels along a block, one of how many tells of a tile, pixels that all do
LOOSE = 2.0  # how much more than the error wanted of all pixels may be hidden in one
SPREAD, SPREAD_ERROR = 0.3, 0.75  # powers of the roughness by which samples of a pixel and their error grow
PILOTS, OF_PILOTS = 768, (4, 9)  # pixels of a tile that get two sets, which tell of the error
PILOTS_FILTER = 0.6  # times the width of a set's filter: what that errs alike in all sets scatters
ALIKE = 0.8  # square of the difference of both in parts of the sum of the squares of their errors
EDGE, EDGES_FALL, NOISE_FALLS = 0.085, 1.5, 1.1  # square error of edges per roughness; powers of n by which it falls
FIRST, FIRST_MISS = (4, 8, 16), np.array([0.088, 0.052, 0.031])  # places looked at first, and by what they miss
TAU = 1.5  # how much more than the error wanted surfaces may cause in one pixel
LOOKS, IN_LINE, SPLIT = 4, 16, 16384  # most looks at a pixel, places around a line, rays at a time
OF_PART = 0.7  # width of a surface's part of a pixel
TO_SIDES = np.array([(0.5, 0.5), (1.0, 0.5), (0.5, 1.0)])  # places between whose rays all others are
FAR = 3.0  # how much more than the error wanted an edge in one pixel may cause
FOLLOWED = 64  # how far a thin body is followed, in pixels
WHITE = 255.0  # code
SMALL, MOST_SMALL = 1.5, 256  # pixels across, any larger square covers a centre; bodies, 5 ns a pixel each
THIN = 0.75  # pixels across a body, wider ones cover centres and corners all along
OF_SMALL = 16, 64  # least and most samples where a small or thin body may be
IN_STRIP, OF_STRIP = 2, (4, 64)  # how much fewer in a strip around it, which has little of the pixel
SHIFTS = 0.7549, 0.5698  # multiples of them share a square out evenly
OF_ROD = 500  # vertices that tell the longest axis of a body
FINEST = 4096  # places in a pixel along each side that have keys of their own
RECORDED = frozenset({"object_id", "shading_normal"})  # what centres have to record

Floats = NDArray[np.float64]
Radiance = NDArray[np.float32]
Whole = NDArray[np.int32]


@dataclass(frozen=True)
class Sight:
    """What looks at places of a tile's pixels.

    ``width`` is the footprint of a pixel's ray over textures, ``pixel`` that of the pixel. ``rods`` (b, 7) are
    ends and radii around small and thin bodies in the camera's frame; ``check`` may stop it.
    """

    camera: IICamera
    tracer: Tracer
    seed: int
    batch: int
    width: tuple[float, float]
    pixel: tuple[float, float]
    rods: Floats
    parts: Parts
    shoot: Shoot
    check: Callable[[], None]


@dataclass(frozen=True)
class Look:
    """Places (p, n, 2) of pixels, their weights, what is `Seen` there, and rays (p, 3, 3) as of `kernels.aim`.

    ``light`` (p, `GROUPS`, 3), ``codes``, their least and greatest and ``bodies`` are those of the first surfaces, as
    many as are ``known``, from samples that ``count`` counts; ``turn`` is that of `kernels.fit`.
    """

    pixels: NDArray[np.int64]
    L: Floats
    D: Floats
    places: Floats
    weights: Floats
    seen: Seen
    light: Radiance
    codes: Radiance
    low: Radiance
    high: Radiance
    bodies: Whole
    count: Whole
    known: NDArray[np.int64]
    turn: Floats

    def of(self, which: NDArray[np.bool_]) -> Look:
        """Return the rows of some of the pixels."""
        count, rows = self.places.shape[1], np.flatnonzero(which)
        samples = (rows[:, None] * count + np.arange(count)).reshape(-1)
        fields = {name: value[rows] for name, value in vars(self).items() if name != "seen"}
        return Look(**fields, seen=_part(self.seen, samples))


@dataclass
class Cells:
    """Pixels of a tile and its rim in rows: columns and rows in the picture, lenses, and what is seen of them.

    ``verdicts`` are those of `kernels.cells`, −1 for pixels that are no cells.
    """

    sight: Sight
    wanted: Edges
    curve: Floats
    m: NDArray[np.int64]
    n: NDArray[np.int64]
    lens: NDArray[np.int64]
    own: NDArray[np.bool_]
    by_body: ClassVar[bool] = False  # whether all of a body is one surface
    points: Points = field(init=False)
    rays: Whole = field(init=False)
    sums: Floats = field(init=False)
    verdicts: NDArray[np.int8] = field(init=False)
    squares: float = field(init=False, default=0.0)
    _count: int = field(init=False)

    def __post_init__(self) -> None:
        self._count = n = self.lens.size
        self.points = Points(
            np.zeros((n, 3), np.float32), np.zeros((n, 3), np.float32), np.full(n, -1, np.int32),
            np.zeros((n, 3), np.float32),
        )  # fmt: skip
        self.rays, self.sums = np.ones(n, np.int32), np.zeros((n, 3))
        self.verdicts = np.full(n, -1, np.int8)

    def look_around(self, centres: Places, finer: float = 1.0) -> None:
        """Look at centres of pixels, of the rim as a rule."""
        first = self._look(centres, finer=finer)
        for array in self.points:
            array[centres.pixel] = array[first : self._count]
        self._count = first

    def refine(self, inside: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Find the light, `sums`, of all pixels whose centres do not tell it; return which they are.

        ``inside`` are the own pixels in the order of the tile's rays.
        """
        many, error = self.lens.size, LOOSE * self.wanted.error
        steps, rough, opened = np.zeros(many, np.float32), np.zeros(many, np.float32), np.zeros(many, np.bool_)
        kernels.encode(self.points.light[: self._count], self.curve, self.points.code)
        kernels.doubtful(self.points, self.lens, self.own, error, steps, uneven := np.empty(many, np.bool_))
        kernels.roughness(self.points, self.lens, np.empty((many, 2), np.float32), rough)
        self._look_beyond(steps, rough)
        doubtful = steps > 0
        if len(self.sight.rods):
            opened[self._small(inside)] = True
        if not self._parts_pixels():
            uneven = doubtful
        left = [np.flatnonzero(uneven & doubtful & ~opened)]
        opened[left[0]] = True
        for _ in range(FOLLOWED):
            pixels = np.flatnonzero(doubtful & ~opened & self.own)
            if not len(pixels):
                break
            opened[pixels] = True
            left.append(self._part_pixels(pixels, steps, doubtful))
        self._share_out(np.concatenate(left), rough)
        return opened

    def _parts_pixels(self) -> bool:
        """Return whether visibility alone parts pixels: no face is passed, and all rays carry the same light."""
        s = self.sight
        return s.tracer.sees_bodies and s.camera.weighted_rays_at(0, 0)[2] is None

    def _part_pixels(
        self, pixels: NDArray[np.int64], steps: NDArray[np.float32], doubtful: NDArray[np.bool_]
    ) -> NDArray[np.int64]:
        """Find the light of pixels by the shares of the surfaces seen in them; return those that need samples."""
        step, limit, left = steps[pixels], TAU * self.wanted.error, [pixels[:0]]
        for number, (low, high) in zip(FIRST, pairwise((0.0, *(limit / FIRST_MISS[:-1]), np.inf)), strict=True):
            some = pixels[(step > low) & (step <= high) | (step == 0) & (number == FIRST[-1])]
            for start in range(0, len(some), SPLIT // number):
                left += self._mix(self._first_look(some[start : start + SPLIT // number], number), limit, doubtful)
        return np.concatenate(left)

    def _mix(self, look: Look, limit: float, doubtful: NDArray[np.bool_]) -> Iterator[NDArray[np.int64]]:
        """Yield those of the pixels looked at that need samples; find the light of the others."""
        for stage in range(LOOKS):
            groups, many = self._surfaces(look)
            self._shade(look, groups, many)
            count = len(look.pixels)
            shares, errors, strip = np.empty((count, GROUPS)), np.empty(count), np.empty((count, 6))
            kernels.fit(
                look.places, groups, many, look.weights, look.turn, np.empty((4, ANGLES)), shares, errors, strip
            )  # fmt: skip
            kernels.contrast(many, look.codes, errors)
            more = (errors > limit) & (many <= GROUPS) & (stage < LOOKS - 1)
            done, verdict = look.of(~more), np.empty(np.count_nonzero(~more), np.int8)
            kernels.mix(
                done.pixels, done.places, groups[~more], many[~more], done.bodies, shares[~more], done.light,
                done.codes, done.low, done.high, self.points, self.wanted.error, self.lens, self.sums, verdict, doubtful,
            )  # fmt: skip
            self.verdicts[done.pixels] = verdict
            self._mixed(done, shares[~more], verdict)
            self.squares += float(np.sum(errors[~more][verdict == DONE] ** 2))
            yield done.pixels[verdict == OPEN]
            straight = strip[:, 5] > 0
            if (more & ~straight).any():
                yield from self._mix(self._more(look.of(more & ~straight)), limit, doubtful)
            if not (more & straight).any():
                break
            look = self._in_strips(look.of(more & straight), strip[more & straight])

    def _mixed(self, look: Look, shares: Floats, verdict: NDArray[np.int8]) -> None:
        """Note the shares of surfaces."""

    def _first_look(self, pixels: NDArray[np.int64], number: int) -> Look:
        """Look at the centres of pixels and at a set of places in them."""
        count, s = len(pixels), self.sight
        L, D, _ = s.camera.weighted_rays_at(self.m[pixels][:, None], self.n[pixels][:, None], TO_SIDES)
        places, weights = np.full((count, number, 2), 0.5), np.full((count, number), 1 / (number - 1))
        places[:, 1:] = self._set(pixels, number - 1, fixed_places(number - 1))
        weights[:, 0] = 0
        look = Look(
            pixels, L, D, places, weights, self._see(pixels, L, D, places),
            *(np.zeros((count, GROUPS, 3), np.float32) for _ in range(4)), np.full((count, GROUPS), -2, np.int32),
            np.zeros((count, GROUPS), np.int32), np.zeros(count, np.int64), np.tile((np.pi / 2, np.pi / 2), (count, 1)),
        )  # fmt: skip
        look.bodies[:, 0] = self.points.body[pixels]
        return look

    def _more(self, look: Look) -> Look:
        """Look at three times as many places of pixels again."""
        old = look.places.shape[1]
        places = self._set(look.pixels, 3 * old, fixed_places(0))
        parts = np.array([old, 3 * old]) ** 1.5
        weights = np.concatenate([look.weights * parts[0] / parts.sum(), np.full(places.shape[:2], parts[1] / parts.sum() / (3 * old))], axis=1)
        return self._joined(look, places, weights)

    def _in_strips(self, look: Look, strip: Floats) -> Look:
        """Look at places in strips of pixels, too."""
        places = self._set(look.pixels, IN_LINE, fixed_places(IN_LINE))
        weights = np.empty((len(places), look.places.shape[1] + IN_LINE))
        kernels.into_strips(strip, places, look.places, weights)
        return self._joined(look, places, weights)

    def _joined(self, look: Look, places: Floats, weights: Floats) -> Look:
        seen = self._see(look.pixels, look.L, look.D, places)
        count = len(places)
        both = [
            np.concatenate([a.reshape(count, -1, *a.shape[1:]), b.reshape(count, -1, *b.shape[1:])], axis=1)
            for a, b in zip(look.seen, seen, strict=True)
        ]
        arrays: list[Any] = [a.reshape(-1, *a.shape[2:]) for a in both]
        return replace(look, places=np.concatenate([look.places, places], axis=1), weights=weights, seen=Seen(*arrays))

    def _set(self, pixels: NDArray[np.int64], number: int, table: Floats) -> Floats:
        out = np.empty((len(pixels) * number, 2))
        set_places(self.sight.seed, self.m[pixels], self.n[pixels], self.sight.camera.pixels[0], 0, number, 0, table, out)
        return out.reshape(-1, number, 2)

    def _see(self, pixels: NDArray[np.int64], L: Floats, D: Floats, places: Floats) -> Seen:
        """Return what is seen through places (p, n, 2) of pixels, by visibility alone."""
        s, rays = self.sight, places.shape[0] * places.shape[1]
        s.check()
        origins, directions = np.empty((rays, 3), np.float32), np.empty((rays, 3), np.float32)
        kernels.aim(L, D, places, s.tracer.pose[:3, :3], s.tracer.pose[:3, 3], origins, directions)
        self.rays[pixels] += places.shape[1]
        return Seen(origins, directions, *s.tracer.seen(origins, directions))

    def _surfaces(self, look: Look) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
        """Return the surfaces of samples, and how many a pixel has."""
        count, number = look.places.shape[:2]
        groups, many = np.empty((count, number), np.uint8), np.empty(count, np.int64)
        faces = self.sight.tracer.scene.surfaces
        kernels.part(
            look.seen, look.places, faces.rows, faces.columns, faces.columns == ALL_COLUMNS, self.by_body,
            *self.sight.pixel, np.empty((GROUPS, 7)), groups, many,
        )  # fmt: skip
        return groups, many

    def _shade(self, look: Look, groups: NDArray[np.uint8], many: NDArray[np.int64]) -> None:
        """Find the light of surfaces that have none yet, by samples of each."""
        kernels.pick(look.places, groups, many, look.known, picks := np.empty((len(many), GROUPS, PICKS), np.int32))
        centres = np.flatnonzero(look.known == 0)
        picks[centres, 0, 0] = -1
        look.known[:] = np.maximum(look.known, np.minimum(many, GROUPS))
        for which, group, light, codes in self._lights(look, picks, centres):
            kernels.take_light(
                which, group, light, codes, look.light, look.codes, look.low, look.high, look.count
            )  # fmt: skip

    def _lights(self, look: Look, picks: Whole, centres: NDArray[np.int64]) -> Iterator[tuple[Any, Any, Radiance, Radiance]]:
        """Yield rows of pixels, surfaces, light and codes of samples picked."""
        pixels = look.pixels[centres]
        yield centres, np.zeros_like(centres), self.points.light[pixels], self.points.code[pixels]
        which, group, pick = np.nonzero(picks >= 0)
        if not len(which):
            return
        at = which * look.places.shape[1] + picks[which, group, pick]
        origins, directions, *found = (array[at] for array in look.seen)
        hits = Hits(*found)
        s, tracer = self.sight, self.sight.tracer
        keys = None
        if tracer.scene.glossy:
            place = (look.places.reshape(-1, 2)[at] * FINEST).astype(np.int64)
            keys = np.empty(len(at), np.uint64)
            m, n = self.m[look.pixels[which]], self.n[look.pixels[which]]
            across, down = FINEST * m + place[:, 0], FINEST * n + place[:, 1]
            lobe_keys(s.seed, across, down, FINEST * s.camera.pixels[0] + 1, 0, 1, keys)
        tracer.footprint, tracer.lobes = (s.width[0] * OF_PART, s.width[1] * OF_PART), (LOBE_RAYS, 1)
        light = tracer.shade(origins, directions, hits, keys)
        kernels.encode(light, self.curve, codes := np.empty_like(light))
        look.bodies[which, group] = np.where(hits.faces >= 0, tracer.scene.object_of_face[hits.faces], -1)
        yield which, group, light, codes

    def dense(self, some: NDArray[np.int64]) -> bool:
        """Tell by some of the pixels whether sets in all of them are worth more than looking for edges."""
        half = np.full(len(some), UNITS / 2, np.float32)
        self.look_around(Places(some.astype(np.int32), half, half), 1.0)
        own = np.zeros(self.lens.size, np.bool_)
        own[some] = True
        lens, crowded = np.where(own.reshape(self.lens.shape), self.lens, -1), np.empty(self.lens.size, np.bool_)
        steps = np.empty(self.lens.size, np.float32)
        kernels.doubtful(self.points, lens, own, LOOSE * self.wanted.error, steps, np.empty(len(steps), np.bool_))
        kernels.crowded(self.points, lens, steps, crowded)
        return bool(np.count_nonzero(crowded) > DENSE * len(some))

    def fill(self, some: NDArray[np.int64], order: NDArray[np.int64]) -> None:
        """Find the light of all pixels by sets of two numbers of samples that some of the pixels tell."""
        rough = np.empty(self.lens.size, np.float32)
        kernels.roughness(self.points, self.lens, np.empty((self.lens.size, 2), np.float32), rough)
        pilots = some[max(len(some) // PILOTS, 4) // 2 :: max(len(some) // PILOTS, 4)]
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
        """Return which pixels small bodies may be seen in, and strips (n, 6) that have them, see `kernels.strips`."""
        one = np.empty(len(pixels), np.int32)
        L, D, _ = self.sight.camera.weighted_rays_at(self.m[pixels], self.n[pixels])
        kernels.touched(L, D, self.sight.rods, *self.sight.pixel, one)
        which = np.flatnonzero(one != -1)
        one, (L, D) = one[which], self._unit_rays(pixels[which], 0.5, 0.5)
        right, down = (2 * (self._unit_rays(pixels[which], *at)[1] - D) for at in ((1.0, 0.5), (0.5, 1.0)))
        kernels.strips(L, D, right, down, self.sight.rods, one, strip := np.empty((len(which), 6)))
        seen = strip[:, 5] != 0
        return which[seen], strip[seen]

    def _unit_rays(self, pixels: NDArray[np.int64], x: float, y: float) -> tuple[Floats, Floats]:
        within = np.broadcast_to(np.array([x, y]), (len(pixels), 2))
        L, D, _ = self.sight.camera.weighted_rays_at(self.m[pixels], self.n[pixels], within)
        length = np.linalg.norm(D, axis=-1, keepdims=True)
        return L, np.divide(D, length, out=D, where=length > 0)

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
            set_places(s.seed, m, n, s.camera.pixels[0], 0, number, 0, fixed_places(number), set_of)
            twice = np.tile(set_of.reshape(-1, number, 2), (1, 2, 1))
            # a body stands in its strip in the same place in all pixels
            twice[:, :number] = (twice[:, :number] + np.outer(m + 1.6 * n, SHIFTS)[:, None]) % 1.0
            kernels.strip_places(strip[some], twice, shares := np.empty(twice.shape[:2]))
            L, D, weights = s.camera.weighted_rays_at(m[:, None], n[:, None], twice)
            light = s.shoot(
                L.reshape(-1, 3), D.reshape(-1, 3), None if weights is None else weights.reshape(-1),
                numbers=(m, n, 0, count), first=None, traced=np.empty(0, np.int32),
            )  # fmt: skip
            kernels.add_shares(light, shares, pixels[some], self.sums)

    def _look(self, places: Places, bodies: bool = False, finer: float = 1.0) -> int:
        """Look at places; return the row of the first of their points, of which ``bodies`` alone may be wanted."""
        first, n, s = self._count, len(places.pixel), self.sight
        self._count += n
        if len(self.points.body) < self._count:
            self.points = _grown(self.points, first, 2 * self._count)
        points = _part(self.points, slice(first, self._count))
        kernels.count_rays(places.pixel, self.rays)
        for start in range(0, n, s.batch):
            some = slice(start, start + s.batch)
            self._trace(_part(places, some), _part(points, some), bodies, finer)
        if not bodies:
            kernels.encode(points.light, self.curve, points.code)
        return first

    def _trace(self, places: Places, points: Points, bodies: bool, finer: float) -> None:
        s, m, n = self.sight, self.m[places.pixel], self.n[places.pixel]
        s.check()
        within = np.stack([places.x, places.y], axis=1).astype(np.float64) / UNITS
        rays = s.camera.weighted_rays_at(m, n, within)
        if bodies:
            points.body[:] = s.tracer.bodies(*rays)
            return
        keys = None
        if s.tracer.scene.glossy:
            fine = (within * FINEST).astype(np.int64)
            keys = np.empty(len(m), np.uint64)
            across, down = FINEST * m + fine[:, 0], FINEST * n + fine[:, 1]
            lobe_keys(s.seed, across, down, FINEST * s.camera.pixels[0] + 1, 0, 1, keys)
        s.tracer.footprint, s.tracer.lobes = (s.width[0] / finer, s.width[1] / finer), (LOBE_RAYS, 1)
        points.light[:] = 0
        s.tracer.run(
            *rays[:2], points.light, Support(object_id=points.body, shading_normal=points.normal), rays[2], keys
        )

    def _share_out(self, pixels: NDArray[np.int64], rough: NDArray[np.float32]) -> None:
        """Find the light of pixels by sets of samples, as many as give all opened pixels the error wanted."""
        if not len(pixels):
            return
        weights, error = np.maximum(rough[pixels], 1.0).astype(np.float64), self.wanted.error
        pilots = slice((every := max(len(pixels) // PILOTS, 4)) // 2, None, every)
        edges, noise = self._pilot(pixels[pilots], float(np.mean(weights[pilots])))
        eighths, which, times = np.unique(
            np.rint(8 * np.log2(weights)).astype(np.int64), return_inverse=True, return_counts=True
        )
        weights = 2.0 ** (eighths / 8)
        done = int(np.count_nonzero(self.verdicts == DONE))
        expected = weights**SPREAD_ERROR / np.average(weights**SPREAD_ERROR, weights=times)
        least = (EDGE * weights / (FAR * error) ** 2) ** (1 / EDGES_FALL)
        squares = max(error**2 * (len(pixels) + done) - self.squares, error**2 * len(pixels))
        of_sets = edges * SETS**-EDGES_FALL + noise * SETS**-NOISE_FALLS
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
        self._sample(pixels[todo], numbers[todo])

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
        light = fixed_sum(s.camera, number, s.seed + seed, self.m[pixels], self.n[pixels], s.batch, s.parts, s.shoot)
        self.rays[pixels] += number
        return light / number


def _between(wanted: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Return which of `SETS` is at most as large as wanted, and the part of the pixels that gets the next one."""
    at = np.interp(np.log2(wanted), np.log2(SETS), np.arange(len(SETS)))
    first = np.minimum(at.astype(np.int64), len(SETS) - 2)
    return first, at - first


def _numbers(wanted: Floats) -> NDArray[np.int64]:
    """Return numbers of samples that are those wanted in the geometric mean."""
    first, more = _between(wanted)
    return SETS[first + (GOLDEN * np.arange(len(wanted)) % 1 < more)]


def small_rods(scene: Scene, pose: Floats, pixel: tuple[float, float]) -> Floats:
    """Return rods (b, 7) around bodies thinner than `THIN` pixels or smaller than `SMALL`.

    They are ends in the camera's frame, and radii.
    """
    rods = np.array([_rod(np.asarray(body.vertices, np.float64)) for body in scene.bodies]).reshape(-1, 7)
    ends = (rods[:, :6].reshape(-1, 2, 3) - pose[:3, 3]) @ pose[:3, :3]
    width, spread = pixel
    far = np.linalg.norm(ends, axis=2).min(axis=1)
    across, pixels = 2 * rods[:, 6], width + spread * far
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    small = (across < THIN * pixels) | (np.maximum(across, length) < SMALL * pixels)
    return np.column_stack([ends.reshape(-1, 6), rods[:, 6]])[small][:MOST_SMALL]


def _rod(vertices: Floats) -> Floats:
    """Return the ends of the longest axis of a body, and the greatest distance from it."""
    some = vertices[:: -(-len(vertices) // OF_ROD)]
    middle = some.mean(axis=0)
    axis = np.linalg.svd(some - middle, full_matrices=False)[2][0]
    for points in (some, vertices):  # most bodies are seen to be thick by some of their vertices
        along = (points - middle) @ axis
        radius = np.sqrt(np.square(points - middle - along[:, None] * axis).sum(axis=1).max())
        if radius > np.ptp(along) / 4:
            break
    return np.array([*(middle + along.min() * axis), *(middle + along.max() * axis), radius])


def dense_mean(
    sight: Sight, wanted: Edges, rows: slice, cols: slice, order: Whole, curve: Floats
) -> tuple[Radiance, Whole] | None:
    """Return what `edge_mean` does for a block of fine structure, without looking for edges; None for any other."""
    n, m = np.mgrid[rows, cols]
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
    rim = ~own & needed(lens, own)
    lens = np.where((own | rim).reshape(lens.shape), lens, -1)
    cells = Cells(sight, wanted, curve, m.ravel(), n.ravel(), lens, own)
    inside, points = np.flatnonzero(own)[order], cells.points
    assert seen.object_id is not None and seen.shading_normal is not None
    points.light[inside], points.body[inside], points.normal[inside] = centres, seen.object_id, seen.shading_normal
    around = np.flatnonzero(rim)
    if len(around):
        half = np.full(len(around), UNITS / 2, np.float32)
        cells.look_around(Places(around.astype(np.int32), half, half))
    opened = cells.refine(inside)[inside]
    found = centres.copy()
    found[opened] = cells.sums[inside[opened]]
    return found, cells.rays[inside]


Table = TypeVar("Table", Points, Places, Seen)


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
