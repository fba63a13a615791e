"""Rendering of one picture, in memory or written band by band."""

from __future__ import annotations

import json
import os
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from ii_core import IICamera, IIPicture, MapCamera, add_sensor_noise
from ii_core.base import checks
from ii_core.base.files import RowWriter, atomic_paths, check_type, image_rows
from ii_core.base.progress import reporter
from ii_core.picture.notebook import captioned, front_png
from ii_core.picture.picture import picture_rows, sidecar
from ii_core.picture.sensor_noise import NOISE_ROWS, noisy_rows

from ..sampling.samples import of_camera, sampling
from ..scene.scene import Scene
from ..tracing.support_images import SUPPORT, SUPPORT_IMAGES, UNITS, coverage_header
from ..tracing.tracer import RayCount, check_scene, rigid
from .audit import Audit
from .executors import Tile, run
from .job import Block, Job, check_disparity
from .options import RenderKeywords, RenderOptions, check_keywords

Paths = str | os.PathLike[str] | Sequence[str | os.PathLike[str]]
Progress = Callable[[int, int], None]


@dataclass(frozen=True, kw_only=True)
class Stats:
    """Cost of a picture.

    ``rays`` counts rays by kind (primary, shadow, reflection, refraction), also those whose end is known without
    Embree, ``skipped`` the rays too weak to change an 8-bit pixel. ``seconds`` is wall-clock time. ``embree_seconds``
    and ``cpu_seconds`` are sums over all threads and processes. ``samples`` counts pixels by their number of samples.
    ``embree`` is Embree's version and packet size, or the reason for single rays. ``audit`` is the result of the
    audit, None without one; its rays are not counted, its CPU seconds are.
    """

    rays: dict[str, int]
    skipped: dict[str, int]
    seconds: float
    embree_seconds: float
    cpu_seconds: float
    samples: dict[int, int]
    embree: str
    audit: Audit | None = None

    @property
    def mean_samples(self) -> float:
        """Mean number of samples per pixel."""
        return sum(n * pixels for n, pixels in self.samples.items()) / sum(self.samples.values())


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Shot:
    """Rendered picture and support images of the first sample of each pixel; images not requested are None.

    Parameters
    ----------
    depth : ndarray, (N, M)
        z in mm in the camera's frame, measured from its pixel plane z = 0; NaN without a hit.
    normal : ndarray, (N, M, 3)
        Outward unit normals of the faces in the scene's frame, 0 without a hit.
    object_id : ndarray of int, (N, M)
        Row of ``object_names``, −1 without a hit.
    ray_length : ndarray, (N, M)
        mm along the ray from its origin L on the lens; NaN without a hit. ``depth`` is measured from the pixel plane
        and is larger by the gap on the axis of a pinhole.
    shading_normal : ndarray, (N, M, 3)
        Outward unit normals of shading in the scene's frame: interpolated between vertices and changed by normal
        maps, or those of the faces; 0 without a hit.
    disparity : ndarray, (N, M)
        Shift of the point from one elementary image to the next on the right, in pixels to the right; see
        `job.disparity`.
    samples : ndarray of int, (N, M)
        Number of samples of the pixel.
    coverage : ndarray, (N, M, 13)
        Share of the pixel that is not sky, then six times the name of a body, as a hash in the bits of the float,
        and its share, the largest first; see `support_images`.
    """

    picture: IIPicture
    depth: NDArray[np.float32] | None
    normal: NDArray[np.float32] | None
    object_id: NDArray[np.int32] | None
    ray_length: NDArray[np.float32] | None
    shading_normal: NDArray[np.float32] | None
    disparity: NDArray[np.float32] | None
    samples: NDArray[np.int32] | None
    coverage: NDArray[np.float32] | None
    object_names: list[str]
    stats: Stats

    @property
    def about(self) -> str:
        """Picture, support images and cost in one line."""
        kept = [name for name in SUPPORT_IMAGES if getattr(self, name) is not None]
        cost = f"{sum(self.stats.rays.values()) / 1e6:.3g} M rays in {self.stats.seconds:.1f} s"
        return "; ".join([self.picture.about, *([", ".join(kept)] if kept else []), cost])

    def __repr__(self) -> str:
        return f"Shot({self.about})"

    def _repr_png_(self) -> bytes:
        return front_png(self.picture)

    def _repr_html_(self) -> str:
        return captioned(self._repr_png_(), self.about)


def render(
    scene: Scene,
    camera: IICamera | MapCamera,
    *,
    support: tuple[str, ...] = SUPPORT,
    progress: Progress | bool | None = None,
    **options: Unpack[RenderKeywords],
) -> Shot:
    """Ray trace a scene through a camera.

    The picture is bitwise equal for all numbers of threads, processes and workers.

    Parameters
    ----------
    support : tuple of str
        Support images to return, of depth, normal, object_id, ray_length, shading_normal, disparity, samples and
        coverage.
    progress : callable, optional
        Called in the calling thread with the number of finished tiles and of all tiles.
    **options
        Fields of `RenderOptions`: ``samples``, ``error``, ``seed``, ``noise``, ``dtype``, ``workers``, ``executor``,
        ``pose``, ``texture_filter`` and ``audit``.

    Returns
    -------
    Shot

    Raises
    ------
    TypeError, ValueError
        If a parameter has another type or is out of range.
    OSError
        If worker processes die and are not replaced.
    """
    tally = _Tally()
    wanted = _options(scene, camera, options, progress)
    job = _job(scene, camera, wanted, support)
    columns, rows = camera.pixels
    out: dict[str, NDArray[Any]] = {"pixels": np.empty((rows, columns, 3), job.dtype)}
    for name in support:
        out[name] = np.empty((rows, columns, *SUPPORT_IMAGES[name].shape), SUPPORT_IMAGES[name].dtype)
    job.images.update(out)
    with closing(_rendered(job, job.tiles(), wanted, progress, tally)) as blocks:
        for block in blocks:
            for name, array in block.arrays.items():  # of other processes
                out[name][block.rows, block.cols] = array
    picture = IIPicture(out["pixels"], camera.lenses, camera.ei_pixels, camera.model, camera.erect)
    return Shot(
        picture=add_sensor_noise(picture, wanted.noise, wanted.seed) if wanted.noise else picture,
        **{name: out.get(name) for name in SUPPORT_IMAGES},
        object_names=[body.name for body in scene.bodies],
        stats=tally.stats(),
    )


def render_to(
    picture: str | os.PathLike[str] | None,
    scene: Scene,
    camera: IICamera | MapCamera,
    *,
    support: Mapping[str, Paths] | None = None,
    upright: bool = False,
    progress: Progress | bool | None = None,
    **options: Unpack[RenderKeywords],
) -> Stats:
    """Ray trace into files band by band, for pictures larger than memory.

    The files are bitwise equal to the result of `render`. They appear when all are complete, or not at all. Other
    parameters and errors are those of `render`.

    Parameters
    ----------
    picture : path or None
        PNG, TIFF or EXR, with a sidecar as from `IIPicture.save`. None for support images alone.
    support : mapping of str to path or sequence of paths, optional
        Files of support images by name. Several images in one EXR have named channels, and the names of objects in
        its header. One image may have several files.
    upright : bool
        Turn the upside-down picture of a camera of one lens.

    Raises
    ------
    OSError
        If a file cannot be written.
    """
    tally = _Tally()
    if picture is not None:
        picture = _path("picture", picture)
    if not isinstance(support, Mapping | None):
        raise TypeError(f"support is {support!r}: a mapping of names to paths is needed")
    files = {name: _paths(value) for name, value in (support or {}).items()}
    wanted = _options(scene, camera, options, progress)
    job = _job(scene, camera, wanted, tuple(files))
    checks.flag("upright", upright)
    if upright and camera.lenses != (1, 1):
        raise ValueError(f"only the picture of one lens is turned upright: this camera has {camera.lenses} lenses")
    strips = _strips(job.tiles())
    tiles = [tile for strip in (reversed(strips) if upright else strips) for tile in strip]
    with _outputs(job, picture, files, upright) as (stack, writers):
        blocks = stack.enter_context(closing(_rendered(job, tiles, wanted, progress, tally)))
        for top, band in _bands(blocks, camera.pixels, upright):
            if wanted.noise:
                band["pixels"] = noisy_rows(band["pixels"], top, wanted.noise, wanted.seed)
            for write, names in writers:
                rows = [np.atleast_3d(band[name]) for name in names]
                joined = rows[0] if len(rows) == 1 else np.concatenate(rows, axis=2, dtype=np.float32)
                joined = joined.astype(np.float32) if joined.dtype == np.int32 else joined
                write(joined[::-1, ::-1] if upright else joined)
    return tally.stats()


@contextmanager
def _outputs(
    job: Job, picture: str | os.PathLike[str] | None, files: dict[str, list[str]], upright: bool
) -> Iterator[tuple[ExitStack, list[tuple[RowWriter, list[str]]]]]:
    """Open all files; return a stack that closes them, and the writers of rows by image.

    All files are complete and checked before the first appears.
    """
    camera, unique = job.camera, list(dict.fromkeys(file for paths in files.values() for file in paths))
    for file, dtype in [*([(picture, job.dtype)] if picture is not None else []), *((f, "float32") for f in unique)]:
        check_type(file, dtype)
    pair = [] if picture is None else [sidecar(picture), picture]
    out: list[tuple[RowWriter, list[str]]] = []
    with atomic_paths([*pair, *unique]) as temporaries, ExitStack() as stack:
        if picture is not None:
            beside, file = temporaries[:2]
            nothing = np.broadcast_to(np.zeros(1, job.dtype), (*camera.pixels[::-1], 3))
            structure = IIPicture(nothing, camera.lenses, camera.ei_pixels, camera.model, camera.erect != upright)
            out.append((stack.enter_context(picture_rows(structure, file, beside, named=picture)), ["pixels"]))
        bodies = [body.name for body in job.scene.bodies]
        about = {"objectNames": json.dumps(bodies), "units": UNITS}
        for target, file in zip(unique, temporaries[len(pair) :], strict=True):
            names = [name for name in files if target in files[name]]
            channels = [channel for name in names for channel in SUPPORT_IMAGES[name].channels]
            header = coverage_header(bodies) if "coverage" in names else {}
            writer = image_rows(
                file, camera.pixels, len(channels), "float32",
                names=channels if len(names) > 1 or header else (), about=about | header, named=target,
            )  # fmt: skip
            out.append((stack.enter_context(writer), names))
        yield stack, out


def _paths(value: Paths) -> list[str]:
    several = not isinstance(value, str | bytes | os.PathLike)
    return [_path("support", path) for path in (_items("support", value) if several else [value])]


@dataclass
class _Tally:
    """Sum of the costs of tiles."""

    started: float = field(default_factory=time.perf_counter)
    cpu: float = field(default_factory=time.thread_time)
    count: RayCount = field(default_factory=RayCount)
    samples: Counter[int] = field(default_factory=Counter)
    block_seconds: float = 0.0
    audit: Audit | None = None

    def add(self, block: Block) -> None:
        if block.audit is not None:
            self.audit = (self.audit or Audit()) + block.audit
        self.count.add(block.count)
        self.samples.update(block.samples)
        self.block_seconds += block.cpu_seconds

    def stats(self) -> Stats:
        return Stats(
            rays=dict(self.count.rays),
            skipped=dict(self.count.skipped),
            seconds=time.perf_counter() - self.started,
            embree_seconds=self.count.embree_seconds,
            cpu_seconds=self.block_seconds + time.thread_time() - self.cpu,
            samples=dict(sorted(self.samples.items())),
            embree="; ".join(sorted(self.count.embree)),
            audit=self.audit,
        )


def _rendered(
    job: Job, tiles: Sequence[Tile], options: RenderOptions, progress: Progress | bool | None, tally: _Tally
) -> Generator[Block, None, None]:
    """Yield tiles in their order; count them and report progress."""
    with closing(run(job, tiles, workers=options.workers, executor=options.executor)) as blocks:
        report = reporter(progress, "render")
        for done, block in enumerate(blocks, 1):
            tally.add(block)
            yield block
            if report:
                report(done, len(tiles))


def _strips(tiles: Sequence[Tile]) -> list[list[Tile]]:
    """Return the tiles of each strip of rows."""
    strips: dict[int, list[Tile]] = {}
    for tile in tiles:
        strips.setdefault(tile[0].start, []).append(tile)
    return list(strips.values())


def _bands(
    blocks: Iterator[Block], pixels: tuple[int, int], backwards: bool
) -> Iterator[tuple[int, dict[str, NDArray[Any]]]]:
    """Yield complete rows with the number of the first, in whole blocks of noise.

    Tiles arrive in strips, from the top or from the bottom.
    """
    columns, rows = pixels
    strip: list[Block] = []
    held: list[tuple[int, dict[str, NDArray[Any]]]] = []
    for block in blocks:
        strip.append(block)
        if block.cols.stop < columns:
            continue
        whole = {name: np.concatenate([b.arrays[name] for b in strip], axis=1) for name in block.arrays}
        held.insert(0 if backwards else len(held), (block.rows.start, whole))
        strip = []
        first, last = held[0][0], held[-1][0] + len(held[-1][1]["pixels"])
        cut = -(-first // NOISE_ROWS) * NOISE_ROWS if backwards else last // NOISE_ROWS * NOISE_ROWS
        cut = last if last == rows and not backwards else cut
        if not first < cut < last and cut != (first if backwards else last):
            continue
        joined = {name: np.concatenate([part[name] for _, part in held]) for name in whole}
        top, bottom = (cut, last) if backwards else (first, cut)
        yield top, {name: array[top - first : bottom - first] for name, array in joined.items()}
        rest = slice(0, cut - first) if backwards else slice(cut - first, None)
        left = {name: array[rest].copy() for name, array in joined.items()}
        held = [(first if backwards else cut, left)] if len(left["pixels"]) else []


def _options(scene: Any, camera: Any, options: RenderKeywords, progress: Any) -> RenderOptions:
    """Return the options; check the types of scene and camera first."""
    check_scene(scene)
    if not isinstance(camera, IICamera | MapCamera):
        raise TypeError(f"camera is a {type(camera).__name__}: an IICamera or a MapCamera is needed")
    if progress is not None and not callable(progress) and not isinstance(progress, bool):
        raise TypeError(f"progress is {progress!r}: True, or a function of two numbers, is needed")
    check_keywords(options, RenderKeywords)
    return RenderOptions(**options)


def _job(scene: Scene, camera: IICamera | MapCamera, options: RenderOptions, support: tuple[str, ...]) -> Job:
    """Return the checked job of a picture."""
    samples = options.samples
    if isinstance(camera, MapCamera):
        if samples not in (None, 1, camera.stored_samples):
            raise ValueError(f"samples is {samples}: the maps hold {camera.stored_samples} for each pixel")
        samples = camera.stored_samples
    if isinstance(support, str) or not all(isinstance(name, str) for name in _items("support", support)):
        raise TypeError(f"support is {support!r}: a sequence of names is needed")
    if unknown := set(support) - set(SUPPORT_IMAGES):
        known = ", ".join(SUPPORT_IMAGES)
        raise ValueError(f"unknown support image {', '.join(sorted(unknown))}: known are {known}")
    if "disparity" in support:
        check_disparity(camera)
    if "coverage" in support and not isinstance(camera, IICamera):
        raise ValueError("coverage: stored maps have no rays between those of pixels, an IICamera is needed")
    wanted = sampling(samples, options.error)
    if isinstance(camera, IICamera):
        wanted = of_camera(wanted, camera)
    return Job(
        scene, camera, wanted, int(options.seed), rigid(options.pose), options.dtype,
        support, bool(options.texture_filter), float(options.audit),
    )  # fmt: skip


def _items(name: str, value: Any) -> Iterator[Any]:
    try:
        return iter(value)
    except TypeError:
        raise TypeError(f"{name} is {value!r}: a sequence is needed") from None


def _path(name: str, value: Any) -> str:
    """Return a path as text; raise TypeError that names the argument."""
    if not isinstance(value, str | os.PathLike) or not isinstance(path := os.fspath(value), str):
        raise TypeError(f"{name} is {value!r}: a path is needed")
    return path


__all__ = ["Shot", "Stats", "render", "render_to"]
