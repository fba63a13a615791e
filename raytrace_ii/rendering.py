"""Pictures: a scene through a camera, by tiles on threads."""

from __future__ import annotations

import math
import os
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ii_core import IICamera, IIPicture, MapCamera, add_sensor_noise

from . import kernels
from .scene import Scene
from .tracing import RayCount, Support, Tracer, rigid

TILE_RAYS = 65536  # enough that numpy's overhead vanishes, few enough that work arrays stay in cache
APERTURE_SEED = 1 << 40  # apart from all seeds a person gives
SUPPORT = ("depth", "normal", "object_id")


@dataclass(frozen=True, kw_only=True)
class Stats:
    """What a picture cost.

    ``rays`` by kind (primary, shadow, reflection, refraction); ``seconds`` by the clock; ``embree_seconds`` and
    ``cpu_seconds`` summed over threads.
    """

    rays: dict[str, int]
    seconds: float
    embree_seconds: float
    cpu_seconds: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Shot:
    """A rendered picture and its support images, of the first sample of each pixel.

    ``depth`` (N, M) is z in mm in the camera's frame, NaN where nothing is hit; ``normal`` (N, M, 3) the faces'
    outward unit normals in the scene's frame, 0 where nothing is hit; ``object_id`` (N, M) the row of
    ``object_names``, −1 where nothing is hit. Those not asked for are None.
    """

    picture: IIPicture
    depth: NDArray[np.float32] | None
    normal: NDArray[np.float32] | None
    object_id: NDArray[np.int32] | None
    object_names: list[str]
    stats: Stats


def render(
    scene: Scene,
    camera: IICamera | MapCamera,
    *,
    samples: int = 1,
    seed: int = 0,
    noise: float = 0.0,
    dtype: str = "uint8",
    workers: int | None = None,
    pose: ArrayLike | None = None,
    support: tuple[str, ...] = SUPPORT,
    progress: Callable[[int, int], None] | None = None,
) -> Shot:
    """Ray trace a scene through a camera.

    The picture is the same to the bit for any number of workers.

    Parameters
    ----------
    samples : int
        Rays per pixel: 1 goes through the pixel's centre, more are spread over the pixel, one in each cell of a
        grid, by a hash of ``seed`` and the pixel. They stay under the pixel's own lens. Over an aperture they are
        spread likewise. Stored maps have their own number.
    seed : int
        For samples and noise.
    noise : float
        σ of monochromatic sensor noise, in steps of 8 bits; see `add_sensor_noise`.
    dtype : {"uint8", "uint16", "float32"}
        Integers are sRGB, floats linear light.
    workers : int, optional
        Threads; as many as cores if not given.
    pose : array_like, (4, 4), optional
        Rigid transform from the camera's frame to the scene's.
    support : tuple of str
        Which of depth, normal and object_id to keep.
    progress : callable, optional
        Called with tiles done and tiles in all, from the calling thread.

    Returns
    -------
    Shot

    Raises
    ------
    ValueError
        If a parameter is out of range.
    """
    if isinstance(camera, MapCamera):
        if samples not in (1, camera.stored_samples):
            raise ValueError(f"samples is {samples}: the maps hold {camera.stored_samples} for each pixel")
        samples = camera.stored_samples
    _check(samples, seed, noise, dtype, workers, support)
    matrix = rigid(pose)
    started, cpu = time.perf_counter(), time.process_time()
    job = _Job(scene, camera, samples, seed, matrix, _empty_shot(camera, dtype, support))
    _ = scene.packed  # Embree's tree, before there are threads to build it twice
    tiles = list(_tiles(camera.pixels))
    count = RayCount()
    with ThreadPoolExecutor(workers if workers is not None else cores()) as pool:
        futures = [pool.submit(job.tile, *tile) for tile in tiles]
        try:
            for done, future in enumerate(as_completed(futures), 1):
                count.add(future.result())
                if progress:
                    progress(done, len(tiles))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    out = job.out
    picture = IIPicture(out["pixels"], camera.lenses, camera.ei_pixels, camera.model, camera.erect)
    return Shot(
        picture=add_sensor_noise(picture, noise, seed) if noise else picture,
        **{name: out.get(name) for name in SUPPORT},
        object_names=[body.name for body in scene.bodies],
        stats=Stats(
            rays=dict(count.rays),
            seconds=time.perf_counter() - started,
            embree_seconds=count.embree_seconds,
            cpu_seconds=time.process_time() - cpu,
        ),
    )


def cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _check(samples: int, seed: int, noise: float, dtype: str, workers: int | None, support: tuple[str, ...]) -> None:
    workers = cores() if workers is None else workers
    for name, value, least in (("samples", samples, 1), ("seed", seed, 0), ("workers", workers, 1)):
        if not isinstance(value, int | np.integer) or value < least:
            raise ValueError(f"{name} is {value!r}: a whole number of at least {least} is needed")
    if not 0 <= noise < math.inf:
        raise ValueError(f"noise sigma is {noise}: at least 0 is needed")
    if dtype not in _CURVES:
        raise ValueError(f"unknown pixel type {dtype!r}: known are {', '.join(_CURVES)}")
    if unknown := set(support) - set(SUPPORT):
        raise ValueError(f"unknown support image {', '.join(sorted(unknown))}: known are {', '.join(SUPPORT)}")


def _empty_shot(camera: IICamera | MapCamera, dtype: str, support: tuple[str, ...]) -> dict[str, NDArray[Any]]:
    columns, rows = camera.pixels
    out: dict[str, NDArray[Any]] = {"pixels": np.empty((rows, columns, 3), dtype)}
    for name, kind, shape in (("depth", "f4", ()), ("normal", "f4", (3,)), ("object_id", "i4", ())):
        if name in support:
            out[name] = np.empty((rows, columns, *shape), kind)
    return out


def _tiles(pixels: tuple[int, int]) -> Iterator[tuple[slice, slice]]:
    """Blocks of about TILE_RAYS pixels, the same whatever the number of workers."""
    columns, rows = pixels
    width = min(columns, TILE_RAYS)
    height = max(1, TILE_RAYS // width)
    for top in range(0, rows, height):
        for left in range(0, columns, width):
            yield slice(top, min(top + height, rows)), slice(left, min(left + width, columns))


def _curve(peak: int, samples: int) -> NDArray[np.float64]:
    """Integer sRGB codes, not yet rounded, at even steps of linear light (IEC 61966-2-1)."""
    x = np.linspace(0, 1, samples)
    return peak * np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-9) ** (1 / 2.4) - 0.055)


# Straight lines between the samples are off by less than 0.01 of a code.
_CURVES = {"uint8": _curve(255, 4097), "uint16": _curve(65535, 65537), "float32": None}


@dataclass
class _Job:
    """One picture being rendered; `tile` runs on any thread."""

    scene: Scene
    camera: IICamera | MapCamera
    samples: int
    seed: int
    pose: NDArray[np.float64]
    out: dict[str, NDArray[Any]]
    local: threading.local = field(default_factory=threading.local)

    def tile(self, rows: slice, cols: slice) -> RayCount:
        """Render one block into ``out``."""
        height, width = rows.stop - rows.start, cols.stop - cols.start
        tracer: Tracer | None = getattr(self.local, "tracer", None)
        if tracer is None:
            tracer = self.local.tracer = Tracer(self.scene, TILE_RAYS, self.pose)
        tracer.count = RayCount()
        n = height * width
        radiance = np.zeros((n, 3), np.float32)
        support = self._support(rows, cols)
        for sample in range(self.samples):
            L, D, shares = self._rays(sample, rows, cols)
            tracer.run(L, D, radiance, support if sample == 0 else None, shares)
        # A tile is whole rows or a piece of one: its block of each array is one run of memory.
        pixels = self.out["pixels"][rows, cols].reshape(n, 3)
        curve = _CURVES[pixels.dtype.name]
        if curve is None:
            np.divide(radiance, self.samples, out=pixels)
        else:
            kernels.encode_srgb(radiance, 1 / self.samples, curve, pixels)
        return tracer.count

    def _support(self, rows: slice, cols: slice) -> Support | None:
        """The tile's part of the support images, with scratch for those nobody asked for."""
        if len(self.out) == 1:
            return None
        shape = rows.stop - rows.start, cols.stop - cols.start
        wanted = {name: self.out[name][rows, cols] for name in self.out if name != "pixels"}
        return Support(**{**vars(Support.empty(shape)), **wanted})

    def _rays(self, sample: int, rows: slice, cols: slice) -> tuple[Any, Any, Any]:
        if isinstance(self.camera, MapCamera):
            return self.camera.stored_rays(sample, rows, cols)
        return self.camera.weighted_rays(rows, cols, *self._places(self.camera, sample, rows, cols))

    def _places(self, camera: IICamera, sample: int, rows: slice, cols: slice) -> list[ArrayLike]:
        """Where in the pixel and where on the aperture."""
        if self.samples == 1:
            return [(0.5, 0.5), (0.5, 0.5)]
        down = max(d for d in range(1, math.isqrt(self.samples) + 1) if self.samples % d == 0)
        places: list[ArrayLike] = []
        for aperture in (False, True):
            out = np.empty((rows.stop - rows.start, cols.stop - cols.start, 2))
            kernels.jitter(
                self.seed + APERTURE_SEED * aperture, sample, self.samples // down, down, aperture,
                camera.pixels[0], rows.start, cols.start, out,
            )  # fmt: skip
            places.append(out)
            if not camera.samples_aperture:
                return [out, (0.5, 0.5)]
        return places
