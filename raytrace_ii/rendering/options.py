"""Render options: the common parameters of `render`, `render_to` and `render_set`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from ii_core.executors import check_executor

from .job import CURVES

MOST_WORKERS = 1024
MOST_NOISE = 1e6  # steps of 8 bits; 255 is white


class SetKeywords(TypedDict, total=False):
    """Keywords of `render_set` for the fields of `RenderOptions`; a set has poses and bits of its own."""

    samples: int | tuple[int, int]
    error: float
    seed: int
    noise: float
    texture_filter: bool
    workers: int | None
    executor: Any


class RenderKeywords(SetKeywords, total=False):
    """Keywords of `render` and `render_to` for the fields of `RenderOptions`."""

    dtype: str
    pose: ArrayLike | None


@dataclass(frozen=True, kw_only=True)
class RenderOptions:
    """How a picture is rendered; ``samples``, ``error`` and ``pose`` are checked with the camera.

    Parameters
    ----------
    samples : int or (least, most)
        Rays per pixel: 1 goes through the pixel's centre, more are spread over the pixel, one in each cell of a
        grid, by a hash of ``seed`` and the pixel. They stay under the pixel's own lens. Over an aperture they are
        spread likewise. Of a pair, pixels get the least and then more, up to the most, until they are within
        ``error``. Stored maps have their own number.
    error : float
        Target of adaptive sampling: standard error of a pixel, in steps of 8 bits, estimated from its samples and
        its neighbours under the same lens; see `sampling` for how, and for what that does not see.
    seed : int
        For samples and noise.
    noise : float
        σ of monochromatic sensor noise, in steps of 8 bits; see `add_sensor_noise`.
    dtype : {"uint8", "uint16", "float32"}
        Integers are sRGB, floats linear light.
    workers : int, optional
        Threads; as many as cores if not given.
    executor : concurrent.futures.Executor or dask.distributed.Client, optional
        What renders instead: threads, processes that share this machine's files, or a cluster. It stays open.
    pose : array_like, (4, 4), optional
        Rigid transform from the camera's frame to the scene's.
    texture_filter : bool
        Read images of textures, maps and skies over the width that a ray has where it meets them, each sample its
        part of the pixel; see `job.footprint`. If not, at a point, which shows texels that are finer than pixels as
        noise.

    Raises
    ------
    TypeError, ValueError
        If an option is of another type or out of range.
    """

    samples: int | tuple[int, int] = 1
    error: float = 0.5
    seed: int = 0
    noise: float = 0.0
    dtype: str = "uint8"
    workers: int | None = None
    executor: Any = None
    pose: ArrayLike | None = None
    texture_filter: bool = True

    def __post_init__(self) -> None:
        if not isinstance(self.seed, int | np.integer) or not 0 <= self.seed < 1 << 63:
            raise ValueError(f"seed is {_short(self.seed)}: a whole number of at least 0 and below 2⁶³ is needed")
        for name in ("error", "noise"):
            if not isinstance(getattr(self, name), int | float | np.number):
                raise TypeError(f"{name} is {getattr(self, name)!r}: a number is needed")
        if not 0 <= self.noise <= MOST_NOISE:
            raise ValueError(f"noise sigma is {_short(self.noise)}: a number from 0 to {MOST_NOISE} is needed")
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
    """Raise TypeError, with the known ones, unless all are keywords of a TypedDict."""
    if unknown := set(given) - set(known.__annotations__):
        raise TypeError(f"unknown option {min(unknown)}: known are {', '.join(known.__annotations__)}")


def _short(value: Any) -> str:
    """A value for a message; a number of 400 digits is not read by anyone."""
    text = repr(value)
    return text if len(text) < 40 else f"{text[:20]}… ({len(text)} characters)"
