"""Whitted recursion over a batch of rays, generation by generation (Whitted 1980)."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ii_core.base.checks import MOST_MM

from ..scene.scene import Scene
from .columns import NO_COLUMNS
from .intersect import Hits
from .kernels.addresses import addresses
from .kernels.appearance import attenuate, look_closely, paint
from .kernels.arrays import Generation, Onward, Passage, Rays, Recorded, ShadowRays, Stages, Start
from .kernels.attributes import footprints
from .kernels.clear import pass_clear_face, pass_faces, start_inside, tell_inside
from .kernels.glossy import lobe_keys
from .kernels.lanes import PACKET, aligned, work
from .kernels.light import add_unblocked, keep_unblocked
from .kernels.sky import add_sky_image
from .kernels.spawn import reflect
from .kernels.spawn import spawn as spawn_rays
from .kernels.start import fill_start_tables, start_rays, start_separable_rays, usable
from .kernels.tables import (
    COUNTS,
    EMBREE_TICKS,
    PASSED,
    REFLECTION,
    REFRACTION,
    SHADOW,
    SKY_IMAGE,
    TICKS,
    UNTESTED,
    WEAK_SHADOW,
)  # fmt: skip
from .kernels.way import record, way_kernel
from .packing import PackedScene, packed
from .support_images import RECORDED

CameraRays = Start | tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64] | None]  # L, D, shares
KINDS = ("primary", "shadow", "reflection", "refraction")
_NO_ROWS = np.empty(0, np.int32)
_NO_HITS = Hits(_NO_ROWS, *(np.empty(0, np.float32) for _ in range(3)))  # the kernel finds them
_NO_NUMBERS = np.empty(0)
_NO_START = Start(_NO_NUMBERS, _NO_NUMBERS, _NO_ROWS, _NO_ROWS, 0, 0, _NO_NUMBERS, _NO_NUMBERS)  # rays are in arrays
LOBE_RAYS = 16  # over the lobe of a rough mirror, for each pixel
MOST_CLEAR_FACES = 64  # a shadow ray through more faces than this is taken as dark


@dataclass
class RayCount:
    """Rays by kind, those not shot because nobody would see them, CPU seconds inside Embree and how it was called.

    Rays that go on behind a face that is not there, or ask which body the camera stands in, are kind ``passed``.
    """

    rays: Counter[str] = field(default_factory=lambda: Counter(dict.fromkeys(KINDS, 0)))
    skipped: Counter[str] = field(default_factory=Counter)
    embree_seconds: float = 0.0
    embree: set[str] = field(default_factory=set)

    def add(self, other: RayCount) -> None:
        self.rays.update(other.rays)
        self.skipped.update(other.skipped)
        self.embree_seconds += other.embree_seconds
        self.embree |= other.embree


@dataclass(frozen=True, eq=False)
class Traced:
    """Results of n rays: linear radiance (n, 3), and depth, normal (n, 3), object, ray length and shading normal
    (n, 3) of the first hit."""

    radiance: NDArray[np.float32]
    depth: NDArray[np.float32]
    normal: NDArray[np.float32]
    object_id: NDArray[np.int32]
    ray_length: NDArray[np.float32]
    shading_normal: NDArray[np.float32]
    count: RayCount


def trace(scene: Scene, locations: ArrayLike, directions: ArrayLike, pose: ArrayLike | None = None) -> Traced:
    """Trace any rays through a scene.

    Parameters
    ----------
    locations, directions : array_like, (..., 3)
        Starting points, mm, and directions of any length, as `IICamera.rays` gives them.
    pose : array_like, (4, 4), optional
        Rigid transform from the camera's frame to the scene's; none is the identity.

    Returns
    -------
    Traced
        One row per ray, in C order; depth is along the camera's z axis from its origin, the pixel plane, NaN on a
        miss; normals are those of the faces, outward; object −1 on a miss; ray length from the ray's start, mm, NaN
        on a miss; shading normals are interpolated and tilted by normal maps, on the side of the face's normal.

    Raises
    ------
    TypeError, ValueError
        If a parameter is of another type, a ray has no direction or is not finite, or the pose is not rigid.
    """
    check_scene(scene)
    locations, directions = _numbers("locations", locations), _numbers("directions", directions)
    if locations.shape != directions.shape or locations.shape[-1:] != (3,):
        raise ValueError(
            f"locations {locations.shape} and directions {directions.shape}: the same (..., 3) is needed"
        )
    n = locations.size // 3
    tracer = Tracer(scene, n, rigid(pose))
    seen = {name: np.empty((n, *image.shape), image.dtype) for name, image in RECORDED.items()}
    radiance = np.zeros((n, 3), np.float32)
    keys = np.empty(n if packed(scene).glossy else 0, np.uint64)
    lobe_keys(0, np.arange(len(keys)), np.zeros(len(keys), np.int64), max(n, 1), 0, 1, keys)
    tracer.run((locations, directions, None), radiance, Support(**seen), keys if len(keys) else None)
    return Traced(radiance=radiance, count=tracer.count, **seen)


@dataclass(frozen=True)
class Support:
    """Support arrays of one block, as far as they are wanted."""

    depth: NDArray[np.float32] | None = None
    normal: NDArray[np.float32] | None = None
    object_id: NDArray[np.int32] | None = None
    ray_length: NDArray[np.float32] | None = None
    shading_normal: NDArray[np.float32] | None = None

    @classmethod
    def empty(cls, shape: tuple[int, ...], names: Collection[str]) -> Support:
        return cls(**{n: np.empty((*shape, *i.shape), i.dtype) for n, i in RECORDED.items() if n in names})

    def clear(self) -> None:
        """As if no ray hit anything."""
        for name, array in vars(self).items():
            if array is not None:
                array[...] = RECORDED[name].missed

    def rows(self) -> list[NDArray[Any]]:
        """One row per ray; arrays of no rows are not wanted."""
        return [
            np.empty((0, *i.shape), i.dtype)
            if (array := getattr(self, name)) is None
            else array.reshape(-1, *i.shape)
            for name, i in RECORDED.items()
        ]


def start_tables(rays: tuple[NDArray[np.float64], ...], pose: NDArray[np.float64]) -> Start | None:
    """Return what columns and rows give to rays of `IICamera.separable_rays`, without any pixels.

    None if some rays may be unusable.
    """
    x, y, z = rays
    if not usable(x, y, z):
        return None
    columns, rows = (aligned(16 * len(part)).view(np.float64).reshape(-1, 8) for part in (x, y))
    fill_start_tables(x, y, z, pose[:3, :3], pose[:3, 3], columns, rows)
    return _NO_START._replace(column_rays=columns.reshape(-1), row_rays=rows.reshape(-1))


def check_scene(scene: Any) -> None:
    """Raise TypeError unless it is a scene."""
    if not isinstance(scene, Scene):
        raise TypeError(f"scene is a {type(scene).__name__}: a Scene is needed, as load_scene gives it")


def _numbers(name: str, value: Any) -> NDArray[np.float64]:
    """An array of float64; a ValueError that names the argument if the value is none."""
    try:
        return np.asarray(value, np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{name} is no array of numbers: {error}") from None


def rigid(pose: ArrayLike | None) -> NDArray[np.float64]:
    """A (4, 4) rigid transform, checked; the identity for None."""
    if pose is None:
        return np.eye(4)
    matrix = _numbers("pose", pose)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise ValueError("pose is not a finite 4×4 matrix")
    if np.abs(matrix[:3, 3]).max() > MOST_MM:
        raise ValueError(f"pose is {matrix[:3, 3].tolist()} mm off: coordinates up to {MOST_MM:g} mm are needed")
    turn = matrix[:3, :3]
    turns = np.allclose(turn @ turn.T, np.eye(3), atol=1e-9) and np.linalg.det(turn) > 0
    if not turns or not np.array_equal(matrix[3], [0, 0, 0, 1]):
        raise ValueError("pose is not rigid: a rotation and a shift with the last row 0 0 0 1 are needed")
    return matrix


def _room(n: int, nested: int, glossy: bool = False, widening: bool = False) -> Rays:
    """Room for one generation of n rays."""
    origins, directions, weights = (np.empty((n, 3), np.float32) for _ in range(3))
    pixels, inside = np.empty(n, np.int32), np.empty((n, nested), np.int32)
    keys, widths = np.empty(n * glossy, np.uint64), np.empty(n * widening, np.float32)
    return Rays(origins, directions, weights, pixels, inside, keys, widths)


def _shadow_room(n: int, nested: int) -> ShadowRays:
    origins, directions, colours = (np.empty((n, 3), np.float32) for _ in range(3))
    reach, pixels, inside = np.empty(n, np.float32), np.empty(n, np.int32), np.empty((n, nested), np.int32)
    return ShadowRays(origins, directions, reach, colours, pixels, inside)


Batch = TypeVar("Batch", Rays, ShadowRays)


def _rows(batch: Batch, some: slice) -> Batch:
    arrays: list[Any] = [array[some] for array in batch]
    return type(batch)(*arrays)


def _joined(rays: Rays, first: int, start: int, count: int) -> Rays:
    """Return the first rays, followed by a number of others from row ``start`` on."""
    for array in rays:
        if len(array):
            array[first : first + count] = array[start : start + count]
    return _rows(rays, slice(first + count))


class Tracer:
    """Traces batches of up to ``capacity`` primary rays, keeping its work arrays between batches. One a thread.

    ``lobes`` is how many rays at most a camera ray sends over the lobe of a rough mirror, and how many samples of a
    pixel share the lobe's places; later rays send one. ``footprint`` is how wide a ray is at its origin, mm, and by
    how much it grows a mm of its way: images are filtered over it.
    """

    def __init__(
        self, scene: Scene, capacity: int, pose: NDArray[np.float64], lobes: tuple[int, int] = (LOBE_RAYS, 1),
        footprint: tuple[float, float] = (0.0, 0.0),
    ) -> None:  # fmt: skip
        self.scene: PackedScene = packed(scene)
        self.max_depth = scene.max_depth
        self.pose = pose
        self.lobes = lobes
        self.footprint = footprint if self.scene.images else (0.0, 0.0)
        self.columns = NO_COLUMNS  # to be set for a large picture
        self.capacity = capacity
        self.begin()
        self._primary = _room(capacity, self.scene.nested, self.scene.glossy)
        self._pixels = np.arange(capacity, dtype=np.int32)  # of rays one a pixel: read only
        self._radiance = np.empty((capacity, 3), np.float32)
        self._unplaced = np.zeros((3, capacity), np.float32)  # u, v and distance, which shading finds: read only
        self._shadow = _shadow_room(0, self.scene.nested)
        self._work = work()
        self._tools = self.scene.intersector.tools(self._work.single[PACKET:])
        self._told: tuple[Any, bool] = None, False  # whether rays of these tables may start within glass
        self._follow = way_kernel(self.scene.intersector.width)
        # hits and shadow rays that the kernel does not see to the end
        self._finds = self._tools.nearest.packet != 0 and not self.scene.passes
        self._later = self._tools.occluded.packet == 0 or self.scene.lets_through
        self._addresses: dict[Any, int] = {}  # of stages: the types of their arguments stay the same

    def dark(self, n: int) -> NDArray[np.float32]:
        """Radiance (n, 3) to add to, valid until the next call: new memory for each tile takes 2 ns a pixel."""
        self._radiance[:n] = 0
        return self._radiance[:n]

    def begin(self) -> None:
        """Count from 0."""
        self.count = RayCount(embree={self.scene.intersector.about})

    def run(
        self, rays: CameraRays, radiance: NDArray[np.float32], support: Support | None,
        keys: NDArray[np.uint64] | None = None, *, order: NDArray[np.int32] = _NO_ROWS,
        traced: NDArray[np.int32] = _NO_ROWS, faces: NDArray[np.int32] | None = None,
    ) -> None:  # fmt: skip
        """Add what each ray sees to ``radiance`` (n, 3), and fill ``support`` if given.

        Parameters
        ----------
        rays : Start or tuple
            By columns and rows of pixels; or L, D and, or None, the share of light that each ray carries: one that
            carries none is not traced.
        keys : (n,) uint64
            Needed if the scene is glossy.
        order : (n,) int32, optional
            Names L and D in the order in which they are traced: that of ``radiance``, ``support`` and ``keys``.
        traced : (n,) int32, optional
            Names the rows of ``radiance``, ``support`` and ``keys`` in the order in which rays are traced, in which a
            `Start` has them.
        faces : (n,) int32, optional
            The nearest ones, −1 where there is none, of a `Start` that `takes_faces`.
        """
        if isinstance(rays, Start):
            start, n = rays, len(rays.rows)
            room = self._primary._replace(pixels=traced if len(traced) else self._pixels)
            room.inside.fill(-1)
            if faces is None and not self.takes_faces(start):  # they are wanted before the kernel runs
                start_separable_rays(start, self._work, room.origins, room.directions)
                room.weights.fill(1)
                start = _NO_START
        else:
            (room, n), start = self._started(*rays, traced if len(traced) else order), _NO_START
            if len(traced):
                room.pixels[:n] = traced[room.pixels[:n]]
            if support is not None and n < len(radiance):
                support.clear()
        if keys is not None:
            room.keys[:n] = keys[room.pixels[:n]]
        hits = _NO_HITS if faces is None else Hits(faces, *self._unplaced[:, :n])
        self._trace(room, n, radiance, support, start, hits)

    def bodies(self, rays: CameraRays) -> NDArray[np.int32]:
        """Return the bodies that rays meet, −1 where none, for scenes whose rays pass no faces: `sees_bodies`."""
        origins, directions = self.unit_rays(rays)
        self.count.rays["primary"] += len(origins)
        faces = self._nearest(origins, directions, placed=False).faces
        return np.where((faces >= 0) & directions.any(axis=1), self.scene.object_of_face[faces], np.int32(-1))

    def unit_rays(self, rays: CameraRays) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return origins and unit directions (n, 3) of rays in the scene's frame; 0 of rays that carry no light."""
        if isinstance(rays, Start):
            origins, directions = np.empty((2, len(rays.rows), 3), np.float32)
            start_separable_rays(rays, self._work, origins, directions)
            return origins, directions
        room, n = self._started(*rays, _NO_ROWS)
        origins, directions = np.zeros((2, len(rays[0]), 3), np.float32)
        origins[room.pixels[:n]], directions[room.pixels[:n]] = room.origins[:n], room.directions[:n]
        return origins, directions

    @property
    def sees_bodies(self) -> bool:
        """Whether the nearest face of a ray is there: not cut out, not within another body, not seen through."""
        return not (self.scene.passes or self.scene.blends)

    def _started(
        self, locations: NDArray[Any], directions: NDArray[Any], shares: NDArray[np.float64] | None,
        order: NDArray[np.int32],
    ) -> tuple[Rays, int]:  # fmt: skip
        """Return the room of primary rays and how many of them carry light."""
        shape = locations.shape[:-1]
        # one kind of array, for which the kernel is compiled once
        locations, directions = (np.require(a.reshape(-1, 3), float, ["C", "W"]) for a in (locations, directions))
        shares = np.empty(0) if shares is None else np.require(shares.reshape(-1), float, ["C", "W"])
        room = self._primary
        n, bad = start_rays(
            locations, directions, shares, order, self.pose[:3, :3], self.pose[:3, 3],
            room.origins, room.directions, room.weights, room.pixels, room.inside,
        )  # fmt: skip
        if bad >= 0:
            where = ", ".join(map(str, np.unravel_index(bad, shape)))
            raise ValueError(
                f"ray [{where}] from {locations[bad].tolist()} along {directions[bad].tolist()}: "
                "a finite place and a finite direction other than zero are needed"
            )
        return room, n

    def takes_faces(self, start: Start) -> bool:
        """Return whether the kernel makes the camera rays of these tables, and needs no more of hits than faces."""
        return self._finds and not self._near_glass(start)

    def _near_glass(self, start: Start) -> bool:
        """Return whether any camera ray of the picture may start within the bounds of a clear body."""
        if self._told[0] is not start.steps:
            columns, rows = (rays.reshape(-1, 8)[:, :3] for rays in (start.column_rays, start.row_rays))
            half_pixel = np.abs(start.steps.reshape(-1, 8)[:, :3]).sum(axis=0) / 2
            low, high = columns.min(axis=0) + rows.min(axis=0), columns.max(axis=0) + rows.max(axis=0)
            around, slack = self.scene.clear_bounds, 1e-6 * (np.abs(low) + np.abs(high))  # rays start at float32's
            slack += half_pixel
            near = ((low - slack <= around[:, 1]) & (high + slack >= around[:, 0])).all(axis=1).any()
            self._told = start.steps, bool(near)
        return self._told[1]

    def _trace(
        self, primary: Rays, n: int, radiance: NDArray[np.float32], support: Support | None, start: Start,
        hits: Hits = _NO_HITS,
    ) -> None:  # fmt: skip
        """Trace the first n of the primary rays, whose hits may be known."""
        rays = _rows(primary, slice(n))
        self.count.rays["primary"] += n
        if self.scene.transmits and not len(start.rows):
            self._start_inside(rays)
        for depth in range(self.max_depth + 1):
            lobe_rays = self.lobes[0] if depth == 0 else 1
            spawn = depth < self.max_depth
            rays = self._generation(start, hits, rays, radiance, support if depth == 0 else None, spawn, lobe_rays)
            start, hits = _NO_START, _NO_HITS
            if not len(rays.pixels):
                break

    def _generation(
        self, start: Start, hits: Hits, rays: Rays, radiance: NDArray[np.float32], support: Support | None,
        spawn: bool, lobe_rays: int,
    ) -> Rays:  # fmt: skip
        """Trace and shade one generation; the next one comes back."""
        s, n = self.scene, len(rays.pixels)
        hits = hits if self._finds else self._hits(rays)
        spawn = spawn and (s.mirrors or s.transmits or s.blends)
        through, mirrored = n * (s.transmits + 2 * s.disperses + s.blends), n * (lobe_rays if s.glossy else 1)
        following = _room(through + mirrored if spawn else 0, s.nested, s.glossy, any(self.footprint))
        if len(self._shadow.reach) < n * len(s.lights):  # memory that nothing is written to is not used
            self._shadow = _shadow_room(n * len(s.lights), s.nested)
        counts, lit = np.zeros(COUNTS, np.int64), np.zeros(len(s.lights), np.int64)
        passage = Passage(
            s.least, lobe_rays, self.lobes[1], *self.footprint, placed=s.passes, later=self._later, mirrored=through,
        )  # fmt: skip
        images: list[Any] = [*(support or Support()).rows(), self.pose[:3, 3], self.pose[:3, 2]]
        generation = Generation(
            hits, self._tools, s.intersector.first_of_same, start, rays, s.surfaces, s.surroundings, passage,
            Recorded(*images), radiance, self._shadow, following, counts, lit, self._work,
            self.columns,
        )  # fmt: skip
        started = time.thread_time()
        self._follow(generation, self._stages(generation, support is not None, spawn))
        share = int(counts[EMBREE_TICKS]) / max(int(counts[TICKS]), 1)
        self.count.embree_seconds += share * (time.thread_time() - started)
        kinds = {"shadow": SHADOW, "reflection": REFLECTION, "refraction": REFRACTION}
        self.count.rays.update({kind: int(counts[column]) for kind, column in kinds.items()})
        self.count.skipped.update(dict(zip(KINDS[1:], map(int, counts[WEAK_SHADOW:PASSED]), strict=True)))
        if s.blends:
            self.count.rays["passed"] += int(counts[PASSED])
        for light in np.flatnonzero(lit):
            some = slice(light * n, light * n + lit[light])
            self._light(_rows(self._shadow, some), radiance, tested=self._later and not counts[UNTESTED])
        return _joined(following, int(counts[REFRACTION] + counts[PASSED]), through, int(counts[REFLECTION]))

    def _stages(self, generation: Generation, recorded: bool, spawn: bool) -> Stages:
        """Addresses of the stages that the generation needs, compiled here when the first scene needs them."""
        s = self.scene
        clear = s.glossy or s.transmits or s.blends
        wanted = (
            footprints if any(self.footprint) else None,
            attenuate if s.nested or len(s.fog) else None,
            look_closely if s.close_looks else paint,
            add_sky_image if s.background[SKY_IMAGE] >= 0 else None,
            record if recorded else None,
            (spawn_rays if clear else reflect) if spawn else None,
        )
        unknown = [stage for stage in wanted if stage is not None and stage not in self._addresses]
        if unknown:
            self._addresses.update(addresses(unknown, generation))
        return Stages(*(self._addresses[stage] if stage is not None else 0 for stage in wanted))

    def _hits(self, rays: Rays) -> Hits:
        """Face, u, v and distance of the nearest face that is there: not cut out, not hidden in another body.

        They are placed only if rays pass faces; else shading does it, for it reads the faces' corners anyway.
        """
        s = self.scene
        found = self._nearest(rays.origins, rays.directions, placed=s.passes)
        if not s.passes:
            return found
        table, rows = found, _NO_ROWS
        n = len(rays.pixels)
        onward = Onward(np.empty((n, 3), np.float32), np.empty((n, 3), np.float32), np.empty(n, np.int32))
        for _ in range(MOST_CLEAR_FACES):
            count = pass_faces(found, rows, table, rays.directions, rays.inside, s.surfaces, onward)
            if not count:
                break
            self.count.rays["passed"] += count
            rows = onward.rows[:count].copy()
            found = self._nearest(onward.origins[:count], onward.directions[:count])
        return table

    def _nearest(self, origins: NDArray[np.float32], directions: NDArray[np.float32], placed: bool = True) -> Hits:
        hits, seconds = self.scene.intersector.nearest(origins, directions, placed)
        self.count.embree_seconds += seconds
        return hits

    def _start_inside(self, rays: Rays) -> None:
        """Note the transmissive bodies that camera rays start in."""
        s = self.scene
        rows = np.empty(len(rays.pixels), np.int32)
        candidates = np.empty((len(rows), s.nested), np.int32)
        count = start_inside(rays.origins, s.clear_bounds, s.first_clear, rows, candidates)
        rows, candidates = rows[:count], candidates[:count]
        origins, directions = rays.origins[rows], rays.directions[rows]
        for _ in range(MOST_CLEAR_FACES):
            if not count:
                return
            self.count.rays["passed"] += count
            hits, seconds = s.intersector.nearest_clear(origins[:count], directions[:count])
            self.count.embree_seconds += seconds
            count = tell_inside(hits, rows, candidates, origins, directions, rays.inside, s.surfaces, s.opaque_faces)

    def _light(self, shadow: ShadowRays, radiance: NDArray[np.float32], tested: bool) -> None:
        """Add the light of shadow rays that nothing opaque stops, as told here or before, dimmed by what is clear."""
        s, kept = self.scene, len(shadow.pixels)
        if not tested:
            found, seconds = s.intersector.blocked(shadow.origins, shadow.directions, shadow.reach)
            self.count.embree_seconds += seconds
            if not s.lets_through:
                add_unblocked(found, shadow.colours, shadow.pixels, radiance)
                return
            kept = keep_unblocked(found, shadow)
        for _ in range(MOST_CLEAR_FACES):
            shadow = _rows(shadow, slice(kept))
            hits, seconds = s.intersector.nearest_clear(shadow.origins, shadow.directions, shadow.reach)
            self.count.embree_seconds += seconds
            kept = pass_clear_face(hits, shadow, s.surfaces, s.opaque_faces, radiance)
            if not kept:
                return
            self.count.rays["shadow"] += kept
