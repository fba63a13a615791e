"""Render options: the common parameters of `render`, `render_to` and `render_set`."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from ii_core.base.executors import check_executor

from ..sampling.samples import sampling
from .job import CURVES

MOST_WORKERS = 1024
MOST_NOISE = 1e6  # 8-bit steps, of which white has 255


class SetKeywords(TypedDict, total=False):
    """Keywords of `render_set` for the fields of `RenderOptions`; a set has poses and bits of its own."""

    samples: int | tuple[int, int] | str | None
    error: float | None
    seed: int
    noise: float
    texture_filter: bool
    workers: int | None
    executor: Any


class RenderKeywords(SetKeywords, total=False):
    """Keywords of `render` and `render_to` for the fields of `RenderOptions`."""

    dtype: str
    audit: float
    pose: ArrayLike | None


@dataclass(frozen=True, kw_only=True)
class RenderOptions:
    """Options of rendering; ``pose``, and ``samples`` of stored maps, are checked with the camera.

    Parameters
    ----------
    samples : int, (least, most) or "edges", optional
        Rays per pixel; one if neither this nor ``error`` is given. One ray starts at the pixel's centre. Several are
        the first of a scrambled (0, 2)-sequence, which ``seed`` and the pixel select: any power of 2 has one in each
        cell of every grid of as many equal cells, over the pixel and likewise over an aperture. All pass the lens of
        the pixel. A pair selects adaptive sampling: pixels get the least number, then more up to the most, until they
        meet ``error``. ``"edges"`` takes the centre of each pixel and looks for edges where neighbours differ, see
        `edges`; cameras with an aperture get (4, 64). Stored maps fix the number of samples.
    error : float, optional
        Target of adaptive sampling, 0.5 if not given: standard error of a pixel in 8-bit steps, estimated from its
        samples and from its neighbours under the same lens; see `sampling` for the estimate and its limits. With
        ``"edges"``, which an error alone means, root mean square error of the pixels that get more than one ray,
        measured while they are sampled. A fixed number of samples has none.
    seed : int
        Seed of samples and noise.
    noise : float
        σ of monochromatic sensor noise in 8-bit steps; see `add_sensor_noise`.
    dtype : {"uint8", "uint16", "float32"}
        Integers are sRGB, floats linear light.
    workers : int, optional
        Threads; as many as cores if not given.
    executor : concurrent.futures.Executor or dask.distributed.Client, optional
        Executor of the rendering: threads, processes on this machine, or a cluster. It is not closed.
    pose : array_like, (4, 4), optional
        Rigid transform from the camera's frame to the scene's.
    texture_filter : bool
        Filter image textures, maps and skies over the width of a ray at its hit point; each sample covers its part
        of the pixel, see `job.footprint`. The alternative, point sampling, shows texels finer than pixels as noise.
    audit : float
        Share of pixels, from 0 to 1, that are rendered again in full to measure the error of the picture: with 256
        samples or more, at least 12 bounces, and filtered textures; stored maps with all their samples. The seed
        selects the pixels. The result is `Stats.audit`. Noise is not audited.

    Raises
    ------
    TypeError, ValueError
        If an option has another type or is out of range.
    """

    samples: int | tuple[int, int] | str | None = None
    error: float | None = None
    seed: int = 0
    noise: float = 0.0
    dtype: str = "uint8"
    workers: int | None = None
    executor: Any = None
    pose: ArrayLike | None = None
    texture_filter: bool = True
    audit: float = 0.0

    def __post_init__(self) -> None:
        if not isinstance(self.seed, int | np.integer) or not 0 <= self.seed < 1 << 63:
            raise ValueError(f"seed is {_short(self.seed)}: a whole number of at least 0 and below 2⁶³ is needed")
        for name in ("noise", "audit") if self.error is None else ("error", "noise", "audit"):
            if not isinstance(getattr(self, name), int | float | np.number):
                raise TypeError(f"{name} is {getattr(self, name)!r}: a number is needed")
        if self.error is not None and (not 0 < self.error < math.inf or self.error > sys.float_info.max):
            raise ValueError(f"error is {_short(self.error)}: a positive number of 8-bit steps is needed")
        sampling(self.samples, self.error)
        if not 0 <= self.noise <= MOST_NOISE:
            raise ValueError(f"noise sigma is {_short(self.noise)}: a number from 0 to {MOST_NOISE} is needed")
        if isinstance(self.audit, bool) or not 0 <= self.audit <= 1:
            raise ValueError(f"audit is {_short(self.audit)}: a share of the pixels, from 0 to 1, is needed")
        if not isinstance(self.dtype, str):
            raise TypeError(f"dtype is {self.dtype!r}: one of the names {', '.join(CURVES)} is needed")
        if self.dtype not in CURVES:
            raise ValueError(f"unknown pixel type {self.dtype!r}: known are {', '.join(CURVES)}")
        if not isinstance(self.texture_filter, bool | np.bool_):
            raise TypeError(f"texture_filter is {self.texture_filter!r}: True or False is needed")
        workers = self.workers
        if workers is not None and (not isinstance(workers, int | np.integer) or not 1 <= workers <= MOST_WORKERS):
            raise ValueError(f"workers is {_short(workers)}: a whole number from 1 to {MOST_WORKERS} is needed")
        check_executor(self.executor, workers)


def check_keywords(given: Iterable[str], known: type) -> None:
    """Raise TypeError with the known names unless all are keywords of a TypedDict."""
    if unknown := set(given) - set(known.__annotations__):
        raise TypeError(f"unknown option {min(unknown)}: known are {', '.join(known.__annotations__)}")


def _short(value: Any) -> str:
    """Return a value for a message; long numbers are shortened."""
    text = repr(value)
    return text if len(text) < 40 else f"{text[:20]}… ({len(text)} characters)"
