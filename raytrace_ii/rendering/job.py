"""Render job: everything that a worker needs to render any tile of one picture."""

from __future__ import annotations

import math
import threading
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import CancelledError
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core import Camera, IICamera, MapCamera
from ii_core.base.colour import srgb

from ..sampling.coverage import covered
from ..sampling.edges import RECORDED, Sight, dense_mean, edge_mean, small_rods
from ..sampling.sample_places import MOST
from ..sampling.samples import (
    Adaptive,
    Edges,
    EvenRays,
    Sampling,
    Shoot,
    adaptive_mean,
    fixed_sum,
    number_of_samples,
)
from ..scene.scene import Scene
from ..tracing.kernels.arrays import Columns, Start
from ..tracing.kernels.glossy import lobe_keys
from ..tracing.kernels.srgb import encode_srgb, encode_steps
from ..tracing.packing import packed, share
from ..tracing.raster import Raster, Views, parallel_views
from ..tracing.tracer import LOBE_RAYS, CameraRays, RayCount, Support, Tracer, start_tables
from .audit import FULL_DEPTH, FULL_SAMPLES, Audit, chosen, compared
from .nearness import parts_of_pixel, pixels_are_nearer, steps_at_content
from .tiles import Order, Tile, ray_order, strips, tiles

TILE_RAYS = 65536  # many enough to hide the overhead of numpy, few enough for work arrays to stay in cache


def _curve(peak: int, samples: int) -> NDArray[np.float64]:
    """Return unrounded sRGB codes at even steps of linear light."""
    return peak * srgb(np.linspace(0, 1, samples))


# Straight lines between the samples are off by less than 0.01 of a code.
CURVES = {"uint8": _curve(255, 4097), "uint16": _curve(65535, 65537), "float32": None}


def code_steps(curve: NDArray[np.float64]) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """Return rounded 8-bit codes at the samples of a curve, and where each code ends, in steps between samples."""
    ends = np.interp(np.arange(255) + 0.5, curve, np.arange(len(curve)))
    return (curve + 0.5).astype(np.uint8), np.append(ends, np.inf)


STEPS = code_steps(_curve(255, 4097))


def encoded(radiance: NDArray[np.float32], rows: NDArray[np.int32], divisor: int, dtype: str) -> NDArray[Any]:
    """Return pixels of summed radiance (n, 3), each at its row: integers are sRGB, floats linear light."""
    out = np.empty(radiance.shape, dtype)
    curve = CURVES[dtype]
    if curve is None:
        out[rows] = radiance / divisor
    elif dtype == "uint8":
        encode_steps(radiance, rows, 1 / divisor, *STEPS, out)
    else:
        encode_srgb(radiance, rows, 1 / divisor, curve, out)
    return out


@dataclass(frozen=True)
class Block:
    """Rendered tile: ``pixels`` and support images by name, unless they are in the picture; and their cost."""

    rows: slice
    cols: slice
    arrays: dict[str, NDArray[Any]]
    count: RayCount
    samples: dict[int, int]
    audit: Audit | None = None
    cpu_seconds: float = 0.0


@dataclass(frozen=True)
class Job:
    """Picture to render. `tile` runs on any thread of any process; pickling omits working arrays and `images`.

    A camera whose lens has three wavelengths has a job per channel: red and blue give their channel of the pixels,
    green all else.
    """

    scene: Scene
    camera: IICamera | MapCamera
    sampling: Sampling
    seed: int
    pose: NDArray[np.float64]
    dtype: str
    support: tuple[str, ...]
    texture_filter: bool = True
    audit: float = 0.0
    _local: threading.local = field(default_factory=threading.local, compare=False, repr=False)
    _stopped: threading.Event = field(default_factory=threading.Event, compare=False, repr=False)
    _channels: tuple[Job, ...] = field(default=(), init=False, compare=False, repr=False)
    _views: Views | None = field(default=None, init=False, compare=False, repr=False)
    _lock: threading.Lock = field(default_factory=threading.Lock, init=False, compare=False, repr=False)
    _rasters: list[Raster] = field(default_factory=list, init=False, compare=False, repr=False)
    # Whole images by name, into which threads of this process write: to hand blocks over took 5 % of two workers.
    images: dict[str, NDArray[Any]] = field(default_factory=dict, init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        cameras = self.camera.channel_cameras() if isinstance(self.camera, IICamera) else ()
        if len(cameras) == 3:
            supports = ((), self.support, ())
            jobs = [
                replace(self, camera=camera, support=support, audit=0.0, _local=threading.local())
                for camera, support in zip(cameras, supports, strict=True)
            ]
            object.__setattr__(self, "_channels", tuple(jobs))
        elif isinstance(self.sampling, int) and (rays := self._separable_rays()) is not None:
            lenses, views = self.camera.lenses, None
            if self.sampling == 1:
                views = parallel_views(rays, lenses, self.pose)
            elif self.sampling <= MOST and isinstance(even := self._rays(), EvenRays) and even.lens[0]:
                views = parallel_views(rays, lenses, self.pose, even.planes(self.seed, self.sampling), even.steps)
            object.__setattr__(self, "_views", views)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (
            self.scene, self.camera, self.sampling, self.seed, self.pose, self.dtype, self.support,
            self.texture_filter, self.audit,
        )  # fmt: skip

    def tiles(self) -> list[Tile]:
        """Return the tiles that cover the picture, in rows of tiles; independent of the workers.

        Those of parallel views are as wide as the picture: its faces are found row by row.
        """
        if self._views is not None:
            return list(strips(self.camera, TILE_RAYS))
        return list(self._parts_of())

    def stop(self) -> None:
        """Make all threads of this process leave their tiles after the current sample."""
        self._stopped.set()

    def _check_stopped(self) -> None:
        if self._stopped.is_set():
            raise CancelledError("the picture was cancelled")

    def tile(self, rows: slice, cols: slice) -> Block:
        """Render one tile, and audit it."""
        started, audit, count, samples = time.thread_time(), None, RayCount(), Counter[int]()
        if self._views is not None:
            self._columns()  # before lists of faces: making them takes as much memory for a moment
            self._local.strip = rows.start, self._strip(rows)
        images = {name: image[rows, cols] for name, image in self.images.items()}
        for down, right in [(rows, cols)] if self._views is None else self._parts_of((rows, cols)):
            block = self._channel_tiles(down, right) if self._channels else self._tile(down, right)
            count.add(block.count)
            samples.update(block.samples)
            if not images:
                images = _room(block, rows, cols)
            top, left = down.start - rows.start, right.start - cols.start
            for name, array in block.arrays.items():
                images[name][top : top + array.shape[0], left : left + array.shape[1]] = array
        if self.audit:
            audit = self._audited(rows, cols, images["pixels"])
        cost = time.thread_time() - started
        return Block(rows, cols, {} if self.images else images, count, dict(samples), audit, cost)

    def _channel_tiles(self, rows: slice, cols: slice) -> Block:
        """Return a tile of three channels: a channel of each job, all other images of green, and the cost of all."""
        blocks = [job.tile(rows, cols) for job in self._channels]
        pixels = np.stack([block.arrays["pixels"][..., channel] for channel, block in enumerate(blocks)], axis=-1)
        count = RayCount()
        for block in blocks:
            count.add(block.count)
        return replace(blocks[1], arrays={**blocks[1].arrays, "pixels": pixels}, count=count)

    def _parts_of(self, block: Tile | None = None) -> Iterator[Tile]:
        """Return the parts of the picture, or of a block of it, that are traced at once."""
        whole = not isinstance(self.sampling, int) or "coverage" in self.support
        return tiles(self.camera, TILE_RAYS, block, whole_lenses=whole)

    def _tile(self, rows: slice, cols: slice) -> Block:
        shape = rows.stop - rows.start, cols.stop - cols.start
        tracer = self._tracer(shape[0] * shape[1])
        tracer.columns = self._columns()
        order = ray_order(self.camera, rows, cols, self._by_lens())
        support = self._support_room(len(order.pixels))
        if isinstance(self.sampling, Adaptive | Edges):
            if isinstance(self.sampling, Edges):
                radiance, samples, support = self._edges(tracer, self.sampling, rows, cols, order)
            else:
                radiance, samples = self._adaptive(tracer, self.sampling, rows, cols, order, support)
            counts, times = np.unique(samples, return_counts=True)
            histogram = dict(zip(counts.tolist(), times.tolist(), strict=True))
            divisor = 1
        else:
            radiance, divisor = self._fixed(tracer, self.sampling, rows, cols, order, support), self.sampling
            samples = np.full(len(radiance) if "samples" in self.support else 0, divisor, np.int32)
            histogram = {divisor: len(radiance)}
        found = {} if support is None else dict(vars(support))
        if "coverage" in self.support:
            found["coverage"] = self._covered(tracer, rows, cols, order)
        arrays = {"pixels": encoded(radiance, order.pixels, divisor, self.dtype).reshape(*shape, 3)}
        for name in self.support:
            values: NDArray[Any] = samples if name == "samples" else found["depth" if name == "disparity" else name]
            image = order.in_place(values).reshape(*shape, *values.shape[1:])
            arrays[name] = disparity(self.camera, image) if name == "disparity" else image
        return Block(rows, cols, arrays, tracer.count, histogram)

    def _audited(self, rows: slice, cols: slice, pixels: NDArray[Any]) -> Audit:
        """Return the differences of the audited pixels of a tile from the same pixels in full."""
        m, n = chosen(self.seed, self.audit, self.camera.pixels[0], rows, cols)
        full: Job | None = getattr(self._local, "full", None)
        if full is None:
            full = self._local.full = self.in_full()
        return compared(pixels[n - rows.start, m - cols.start], full.pixels_at(m, n, rows, cols))

    def in_full(self) -> Job:
        """Return the job of the same picture in full.

        It has as many samples per pixel as the picture has at most, but at least FULL_SAMPLES, or all of stored maps;
        at least FULL_DEPTH bounces; and filtered textures.
        """
        _, most = number_of_samples(self.sampling)
        scene = self.scene.with_depth(max(self.scene.max_depth, FULL_DEPTH))
        share(self.scene, scene)
        return replace(
            self, scene=scene, sampling=max(most, FULL_SAMPLES) if isinstance(self.camera, IICamera) else most,
            support=(), texture_filter=True, audit=0.0, _local=threading.local(),
        )  # fmt: skip

    def pixels_at(self, m: NDArray[Any], n: NDArray[Any], rows: slice, cols: slice) -> NDArray[Any]:
        """Return pixels (n, 3) in some columns m and rows n of a tile, with a fixed number of samples."""
        if self._channels:
            each = [job.pixels_at(m, n, rows, cols)[:, channel] for channel, job in enumerate(self._channels)]
            return np.stack(each, axis=-1)
        assert isinstance(self.sampling, int)
        tracer = self._tracer()
        if isinstance(self.camera, IICamera):
            shoot, alone = self._shoot(tracer, None), lambda _: (1, 1)  # the pixels are far from each other
            radiance = fixed_sum(self._rays(), self.sampling, self.seed, m, n, TILE_RAYS, alone, shoot)
        else:
            radiance = np.zeros((len(m), 3), np.float32)
            at = n - rows.start, m - cols.start
            for sample in range(self.sampling):
                L, D, shares = self.camera.stored_rays(sample, rows, cols)
                some = None if shares is None else shares[at]
                tracer.run((L[at], D[at], some), radiance, None, self._keys(m, n, sample, 1))
        return encoded(radiance, np.arange(len(m), dtype=np.int32), self.sampling, self.dtype)

    def _columns(self) -> Columns:
        return packed(self.scene).columns(math.prod(self.camera.pixels) * number_of_samples(self.sampling)[0])

    def _tracer(self, rays: int = 0) -> Tracer:
        """Return this thread's own tracer, with counts reset, for so many rays at once: a large lens is one tile."""
        tracer: Tracer | None = getattr(self._local, "tracer", None)
        if tracer is None or tracer.capacity < rays:
            capacity = max(rays, TILE_RAYS)
            tracer = self._local.tracer = Tracer(self.scene, capacity, self.pose, self._lobes(), self._footprint())
        tracer.begin()
        return tracer

    def _by_lens(self) -> bool:
        """Return whether rays go lens by lens: the same on all threads, from camera and scene alone."""
        return pixels_are_nearer(self._steps())

    def _steps(self) -> NDArray[np.float64]:
        """Return the steps of `steps_at_content`, measured once a thread."""
        found: NDArray[np.float64] | None = getattr(self._local, "steps", None)
        if found is None:
            found = self._local.steps = steps_at_content(self.camera, self._distances)
        return found

    def _parts(self, samples: int) -> tuple[int, int]:
        """Return how samples of pixels share packets: see `parts_of_pixel`; those of an aperture stay in order."""
        assert isinstance(self.camera, IICamera)
        return (1, 1) if self.camera.samples_aperture or self._by_lens() else parts_of_pixel(samples, self._steps())

    def _distances(self, L: NDArray[np.float64], D: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distances of the content along rays of unit directions (n, 3) in mm; NaN without a hit."""
        turn, shift = self.pose[:3, :3].T, self.pose[:3, 3]
        with np.errstate(over="ignore", invalid="ignore"):
            origins, directions = (L @ turn + shift).astype(np.float32), (D @ turn).astype(np.float32)
        return packed(self.scene).intersector.distances(origins, directions).astype(np.float64)

    def _lobes(self) -> tuple[int, int]:
        """Return the rays of a sample over a rough mirror's lobe, and the samples that share the lobe's positions."""
        least, most = number_of_samples(self.sampling)
        return -(-LOBE_RAYS // least), most

    def _footprint(self) -> tuple[float, float]:
        """Return the width of a sample's ray at its origin in mm, and its growth per mm: its part of the pixel."""
        if not self.texture_filter or not packed(self.scene).images:
            return 0.0, 0.0
        _, samples = number_of_samples(self.sampling)
        width, spread = footprint(self.camera)
        return width / samples**0.5, spread / samples**0.5

    def _support_room(self, rays: int) -> Support | None:
        """Return support arrays for so many rays; None if no support image is requested."""
        recorded = self._recorded()
        return Support.empty((rays,), recorded) if recorded else None

    def _recorded(self) -> set[str]:
        """Return the names of the support arrays that the tracer fills."""
        traced = set(self.support) - {"samples", "coverage"}
        return {"depth" if name == "disparity" else name for name in traced}

    def _fixed(
        self, tracer: Tracer, samples: int, rows: slice, cols: slice, order: Order, support: Support | None
    ) -> NDArray[np.float32]:
        """Return the summed radiance of a tile with a fixed number of samples, in the order of the rays."""
        m, n = cols.start + order.columns, rows.start + order.rows
        if self._views is not None and (strip := self._local.strip)[1] and samples == self.sampling:
            return self._by_planes(tracer, rows, cols, order, support, *strip)
        if samples > 1 and isinstance(self.camera, IICamera):
            return fixed_sum(
                self._rays(), samples, self.seed, m, n, TILE_RAYS, self._parts, self._shoot(tracer, support)
            )  # fmt: skip
        radiance = tracer.dark(len(order.pixels))
        start = self._start(rows, cols, order)
        if start is not None:
            tracer.run(start, radiance, support, self._keys(m, n, 0, 1))
            return radiance
        for sample in range(samples):
            self._check_stopped()
            if isinstance(self.camera, MapCamera):
                L, D, shares = self.camera.stored_rays(sample, rows, cols)
            else:
                L, D, shares = self.camera.weighted_rays(rows, cols)
            keys = self._keys(m, n, sample, 1)
            tracer.run((L, D, shares), radiance, support if sample == 0 else None, keys, order=order.pixels)
        return radiance

    def _by_planes(
        self, tracer: Tracer, rows: slice, cols: slice, order: Order, support: Support | None, top: int,
        planes: list[NDArray[np.int32]],
    ) -> NDArray[np.float32]:  # fmt: skip
        """Return the summed radiance of a tile from nearest faces, by planes of samples, from row ``top`` on."""
        assert self._views is not None
        m, n = cols.start + order.columns, rows.start + order.rows
        radiance, start = tracer.dark(len(order.pixels)), self._start(rows, cols, order)
        for plane, faces in enumerate(planes):
            self._check_stopped()
            if self._views.planes and isinstance(even := self._rays(), EvenRays):
                across, down = (places[plane] for places in self._views.planes)
                start = even.moved(rows, cols, across, down)._replace(rows=order.rows, columns=order.columns)
            assert start is not None
            some = faces[rows.start - top : rows.stop - top, cols].reshape(-1).take(order.pixels, mode="clip")
            seen = support if plane == 0 else None
            tracer.run(start, radiance, seen, self._keys(m, n, plane, 1), faces=some)
        return radiance

    def _start(self, rows: slice, cols: slice, order: Order) -> Start | None:
        """Return the rays of a tile by columns and rows; None if the camera's do not follow from them.

        Tables of the whole picture are computed once a thread: for every tile they would take 6 ns a pixel.
        """
        start = self._centres()
        return start and start._replace(rows=order.rows, columns=order.columns, top=rows.start, left=cols.start)

    def _rays(self) -> IICamera | EvenRays:
        """Return what makes the rays of samples, found once a thread."""
        if not hasattr(self._local, "rays"):
            assert isinstance(self.camera, IICamera)
            self._local.rays = EvenRays.of(self.camera, self._centres(), self.pose) or self.camera
        rays: IICamera | EvenRays = self._local.rays
        return rays

    def _centres(self) -> Start | None:
        """Return what rays through centres start from, without any pixels."""
        if not hasattr(self._local, "centres"):
            rays = self._separable_rays()
            self._local.centres = None if rays is None else start_tables(rays, self.pose)
        centres: Start | None = self._local.centres
        return centres

    def _separable_rays(self) -> tuple[NDArray[np.float64], ...] | None:
        """Return the rays of the picture by columns and rows; None if the camera's do not follow from them."""
        some = slice(0, 2)
        if not isinstance(self.camera, IICamera) or self.camera.separable_rays(some, some) is None:
            return None  # of such a camera it would compute all to no end
        return self.camera.separable_rays()

    def _strip(self, rows: slice) -> list[NDArray[np.int32]]:
        """Return the nearest faces of rows of the picture, (rows, columns), of each plane; none if Embree finds them.

        Faces are listed by rows once a process, for all threads.
        """
        start = self._centres()
        if self._views is not None and self._views.planes and isinstance(even := self._rays(), EvenRays):
            start = even.centres
        if self._views is None or start is None or not self._tracer().takes_faces(start):
            return []
        with self._lock:
            if not self._rasters:
                scene = packed(self.scene).intersector
                self._rasters.append(Raster(self._views, scene.corners, scene.first_of_same))
            raster = self._rasters[0]
        return [raster.faces(rows, plane) for plane in range(raster.planes)] if raster.pays else []

    def _keys(self, m: NDArray[Any], n: NDArray[Any], first: int, count: int) -> NDArray[np.uint64] | None:
        """Return the keys of ``count`` samples of each pixel; None unless the scene is glossy."""
        if not packed(self.scene).glossy:
            return None
        keys = np.empty(m.size * count, np.uint64)
        lobe_keys(self.seed, m.reshape(-1), n.reshape(-1), self.camera.pixels[0], first, count, keys)
        return keys

    def _adaptive(
        self, tracer: Tracer, wanted: Adaptive, rows: slice, cols: slice, order: Order, support: Support | None
    ) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """Return the mean radiance of a tile and the number of samples per pixel, in the order of the rays."""
        assert isinstance(self.camera, IICamera)
        codes = CURVES["uint8"]
        assert codes is not None
        shoot = self._shoot(tracer, support)
        return adaptive_mean(
            self.camera, self._rays(), wanted, self.seed, rows, cols, order.pixels, TILE_RAYS, codes, self._parts,
            shoot,
        )  # fmt: skip

    def _edges(
        self, tracer: Tracer, wanted: Edges, rows: slice, cols: slice, order: Order
    ) -> tuple[NDArray[np.float32], NDArray[np.int32], Support]:
        """Return radiance of a tile, rays per pixel and support arrays, in the order of the rays."""
        codes, camera, width = CURVES["uint8"], self.camera, self._footprint()
        assert isinstance(camera, IICamera) and codes is not None
        found = dense_mean(self._sight(tracer), wanted, rows, cols, order.pixels, codes)
        names = self._recorded() if found else self._recorded() | RECORDED
        support = Support.empty((len(order.pixels),), names)
        tracer.footprint, tracer.lobes = width, (LOBE_RAYS, 1)
        if names:
            centres = self._fixed(tracer, 1, rows, cols, order, support)
        if found is None:
            found = edge_mean(self._sight(tracer), wanted, rows, cols, order.pixels, centres, support, codes)
        return *found, support

    def _covered(self, tracer: Tracer, rows: slice, cols: slice, order: Order) -> NDArray[np.float32]:
        """Return the coverage of a tile, in the order of the rays."""
        names = [body.name for body in self.scene.bodies]
        return covered(self._sight(tracer), rows, cols, order.pixels, names)

    def _sight(self, tracer: Tracer) -> Sight:
        assert isinstance(self.camera, IICamera)
        if not hasattr(self._local, "small"):
            pixel = footprint(self.camera)
            self._local.small = pixel, small_rods(self.scene, self.pose, pixel)
        pixel, rods = self._local.small
        return Sight(
            self.camera, self._rays(), tracer, self.seed, TILE_RAYS, self._footprint(), pixel, rods, self._parts,
            self._shoot(tracer, None), self._check_stopped,
        )  # fmt: skip

    def _shoot(self, tracer: Tracer, support: Support | None) -> Shoot:
        """Return the function that traces samples of pixels and keeps support arrays of the first ones."""

        def shoot(
            rays: CameraRays, *, numbers: Any, first: slice | None, traced: NDArray[np.int32]
        ) -> NDArray[np.float32]:
            self._check_stopped()
            radiance = tracer.dark(len(numbers[0]) * numbers[3])
            room = self._support_room(len(radiance)) if first is not None and support is not None else None
            tracer.run(rays, radiance, room, self._keys(*numbers), traced=traced)
            if room is not None and first is not None:
                every = len(radiance) // (first.stop - first.start)
                for name, array in vars(support).items():
                    if array is not None:
                        array[first] = getattr(room, name)[::every]
            return radiance

        return shoot


def _room(block: Block, rows: slice, cols: slice) -> dict[str, NDArray[Any]]:
    """Return room for the images of a tile, of the kinds of a part of it."""
    shape = rows.stop - rows.start, cols.stop - cols.start
    return {name: np.empty((*shape, *part.shape[2:]), part.dtype) for name, part in block.arrays.items()}


def footprint(camera: Camera) -> tuple[float, float]:
    """Return the distance of the rays of neighbouring pixels at their origins in mm, and its growth per mm.

    Both are medians over the middle of the picture, which exclude pairs under two lenses, averaged over across and
    down. For a pinhole they are 0, and the pixel pitch over the distance from pixel to pinhole. The distance at the
    origins is negative if rays start behind the lenses: they converge at the lenses, and diverge behind them.
    """
    columns, rows = camera.pixels
    down, across = (slice(max(n // 2 - 32, 0), n // 2 + 32) for n in (rows, columns))
    L, D = camera.rays(down, across)
    length = np.linalg.norm(D, axis=-1, keepdims=True)
    D = np.divide(D, length, out=np.zeros_like(D), where=length > 0)
    steps = [[np.linalg.norm(np.diff(rays, axis=axis), axis=-1) for axis in (0, 1)] for rays in (L, D)]
    width, spread = (float(np.mean([np.median(step) for step in two if step.size] or [0.0])) for two in steps)
    if camera.model is not None and camera.model.start_mm:
        width = -spread * float(np.median(camera.model.start_mm / D[..., 2]))
    return width, spread


def check_disparity(camera: Camera) -> None:
    """Raise ValueError unless the camera's parameters determine disparity between neighbouring lenses."""
    model, named = camera.model, f"camera {camera.name!r}"
    if model is None:
        raise ValueError(f"disparity: the maps of {named} have no camera parameters")
    if model.lenses[0] < 2:
        raise ValueError(f"disparity: {named} has no neighbouring lenses: at least 2 across are needed")
    if model.front:
        raise ValueError(f"disparity: {named} has a lens before its array: pixels per lens do not follow from depth")


def disparity(camera: Camera, depth: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the shift of a point at depth z from an elementary image to its right neighbour, in pixels to the right.

    ±Λ·δL·(1/(z − z₀ − Λ) + 1/d) / δP, negative if elementary images are erect; z₀ is the z of the pixel array, d the
    distance at which viewing zones converge. The shift downwards is the same per lens pitch. NaN if depth is NaN.
    """
    model = camera.model
    assert model is not None
    ahead = depth.astype(np.float64) - (model.gap_mm + model.origin_mm[2])
    per_lens = model.gap_mm * model.lens_pitch_mm[0] / model.pixel_pitch_mm * (-1 if model.erect else 1)
    with np.errstate(divide="ignore"):
        inverse = 1 / ahead if model.viewer_mm is None else 1 / ahead + 1 / model.viewer_mm
        return (per_lens * inverse).astype(np.float32)
