"""The volume by SPERR: component images as slices, a CDF 9/7 in three dimensions and SPECK, through imagecodecs.

Colours are turned to the picture's principal axes as in `codec.coders.volume`, and each is a volume of its own, coded
with one step for all, which is one slope for all; see `codec.coders.sperr.stream`.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from typing import Any, ClassVar

import imagecodecs
import numpy as np
from numpy.typing import NDArray

from ii_core import IIPicture

from ...contract import Coder, Coding, Goal, Option, Options, Pixels
from ...frames import Layout, layout
from ...rate import Run
from ...search import nearest_setting
from ..clock import cpu_seconds
from ..volume import NAMES, Volume, gather_real, lines, principal_axes, scatter_real
from .stream import LEAST_SLICES, Part, coded, decoded, squared_error

COARSEST_DB, FINEST_DB = 0.0, 70.0
# Binary logarithms of the step in 8-bit codes: at the coarsest nothing but the mean is left, at the finest the error
# is that of 70 dB. About one more halves the size; at 64 there is about a bit per pixel.
FINEST, COARSEST, START, OCTAVE = -2.0, 18.0, 6.0, -1.0
QUALITY_RUNS, NEAR_DB = 6, 0.05
DB_A_STEP, FLATTEST, STEEPEST = 5.0, 1.0, 10.0  # what doubling the step does to the error
NO_ERROR = 1e-9
# The payload has a byte for so many pixels at least, zeros if need be, lest a few bytes claim memory without end.
PIXELS_A_BYTE = 4096

_HEAD = struct.Struct("<9h3f3f3I")
_UNIT = np.float32(1 << 14)  # of the colour matrix in it


class Sperr(Coder):
    """Component images of one kind as slices of a volume.

    The payload is a header of 54 bytes (colour matrix; of the three colours the means, the steps, the lengths), then
    the SPECK stream of each colour, of which a constant one has none, then zeros where it would be shorter than a
    byte for 4096 pixels.

    References
    ----------
    Li, Lindstrom and Clyne 2023, "Lossy scientific data compression with SPERR"; Pearlman et al. 2004 (SPECK).
    """

    dtypes: ClassVar[tuple[str, ...]] = ("uint8", "uint16")
    quality_range: ClassVar[tuple[float, float] | None] = (COARSEST_DB, FINEST_DB)
    scale_about = Volume.scale_about
    options: ClassVar[Mapping[str, Option]] = {key: Volume.options[key] for key in ("order", "by")}

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self.name = f"{kind}-sperr"
        self.about = f"All {NAMES[kind]} as one volume by SPERR: CDF 9/7 in three dimensions and SPECK"

    @property
    def versions(self) -> dict[str, str]:
        """imagecodecs and its SPERR."""
        return {"imagecodecs": imagecodecs.__version__, "sperr": imagecodecs.sperr_version().split()[-1]}

    def check(self, picture: IIPicture, options: Options) -> None:
        """Any size will do."""

    def encode(self, picture: IIPicture, options: Options, goal: Goal) -> Coding:
        """Both goals are met by trying steps."""
        source = _Source(picture, layout(picture.lenses, picture.ei_pixels, self.kind), options)
        if goal.quality is not None:
            return _nearest_quality(source, goal.quality)
        assert goal.bpp is not None
        run, runs = nearest_setting(
            lambda setting: source.run(*source.coded(setting)),
            goal.bpp * source.pixels / 8,
            low=FINEST,
            high=COARSEST,
            start=START + OCTAVE * np.log2(goal.bpp),
            octave=OCTAVE,
        )
        return Coding(run=run, runs=runs)

    def decode(self, payload: bytes, blank: IIPicture, options: Options) -> tuple[Pixels, float]:
        """The bytes are another process's risk; see `codec.coders.sperr.worker`."""
        pixels = blank.pixels.size // 3
        matrix, parts = _parts(payload, pixels)
        shape = layout(blank.lenses, blank.ei_pixels, self.kind)
        colours, seconds = decoded(parts, _coded_shape(shape))
        out = np.empty((pixels, 3), blank.pixels.dtype)
        _turn_back(colours, shape, _origins(shape, options), matrix, out)
        return out.reshape(blank.pixels.shape), seconds


def _coded_shape(shape: Layout) -> tuple[int, int, int]:
    return max(LEAST_SLICES, shape.frames), shape.height, shape.width


def _origins(shape: Layout, options: Options) -> NDArray[np.int64]:
    return shape.origins(str(options["order"]), str(options["by"]))


class _Source:
    """A picture to be coded at one step after another."""

    def __init__(self, picture: IIPicture, shape: Layout, options: Options) -> None:
        pixels = np.ascontiguousarray(picture.pixels).reshape(-1, 3)
        self.pixels = len(pixels)
        self.axes = principal_axes(pixels)
        self.colours = np.empty((3, *_coded_shape(shape)), np.float32)
        _turn(pixels, shape, _origins(shape, options), self.axes.astype(np.float32) / _UNIT, self.colours)

    def coded(self, setting: float) -> tuple[list[Part], float]:
        """The colours at a step of 2^setting, and the CPU seconds that they took."""
        started = cpu_seconds()
        parts = [coded(colour, 2.0**setting) for colour in self.colours]
        return parts, cpu_seconds() - started

    def run(self, parts: list[Part], seconds: float) -> Run:
        """As bytes."""
        columns = zip(*((part.mean, part.step, len(part.stream)) for part in parts), strict=True)
        head = _HEAD.pack(*self.axes.ravel().tolist(), *(number for column in columns for number in column))
        payload = head + b"".join(part.stream for part in parts)
        return Run(payload.ljust(_least_bytes(self.pixels), b"\0"), seconds)

    def error(self, parts: list[Part]) -> float:
        """Mean squared error in 8-bit codes."""
        return sum(squared_error(part, colour) for part, colour in zip(parts, self.colours, strict=True)) / 3


def _nearest_quality(source: _Source, quality: float) -> Coding:
    """By secants, from the step whose even error would be the one allowed."""
    allowed = 255**2 / 10 ** (quality / 10)
    setting, slope = min(max(math.log2(12 * allowed) / 2, FINEST), COARSEST), DB_A_STEP
    tried: dict[float, tuple[float, Run]] = {}
    while setting not in tried and len(tried) < QUALITY_RUNS:
        parts, seconds = source.coded(setting)
        miss = 10 * math.log10(max(source.error(parts), NO_ERROR) / allowed)
        if tried:
            last = next(reversed(tried))
            slope = min(max((miss - tried[last][0]) / (setting - last), FLATTEST), STEEPEST)
        tried[setting] = miss, source.run(parts, seconds)
        if abs(miss) > NEAR_DB:
            setting = min(max(setting - miss / slope, FINEST), COARSEST)
    return Coding(run=min(tried.values(), key=lambda one: abs(one[0]))[1], runs=len(tried))


def _least_bytes(pixels: int) -> int:
    return -(-pixels // PIXELS_A_BYTE)


def _parts(payload: bytes, pixels: int) -> tuple[NDArray[np.float32], list[Part]]:
    """Colour matrix and colours."""
    if len(payload) < max(_HEAD.size, _least_bytes(pixels)):
        raise ValueError(f"its volume has {len(payload)} bytes, too few for {pixels} pixels")
    numbers = _HEAD.unpack_from(payload)
    parts, at = [], _HEAD.size
    for mean, step, length in zip(numbers[9:12], numbers[12:15], numbers[15:], strict=True):
        parts.append(Part(mean=mean, step=step, stream=payload[at : at + length]))
        at += length
    if len(payload) != max(at, _least_bytes(pixels)) or payload[at:].strip(b"\0"):
        raise ValueError(f"its volume has {len(payload)} bytes, where its header says {at}")
    return np.array(numbers[:9], np.float32).reshape(3, 3) / _UNIT, parts


def _turn(
    pixels: NDArray[Any],
    shape: Layout,
    origins: NDArray[np.int64],
    matrix: NDArray[np.float32],
    colours: NDArray[np.float32],
) -> None:
    """Pixels to colours about zero, in 8-bit codes; slices that are too few end in more of the last."""
    codes = 256**pixels.itemsize
    rows = np.empty((len(origins), 3 * shape.width), np.float32)
    for y, first in lines(shape):
        gather_real(pixels, origins + first, shape.step_x, codes // 2, matrix * np.float32(256 / codes), rows)
        colours[:, : len(origins), y] = rows.reshape(len(origins), 3, shape.width).swapaxes(0, 1)
    colours[:, len(origins) :] = colours[:, len(origins) - 1 : len(origins)]


def _turn_back(
    colours: list[NDArray[np.float32]],
    shape: Layout,
    origins: NDArray[np.int64],
    matrix: NDArray[np.float32],
    pixels: NDArray[Any],
) -> None:
    """The inverse of `_turn`, rounded and clipped; the matrix is a rotation."""
    codes = 256**pixels.itemsize
    for y, first in lines(shape):
        rows = np.stack([colour[: len(origins), y] for colour in colours], axis=1).reshape(len(origins), -1)
        scatter_real(rows, origins + first, shape.step_x, codes // 2, matrix * np.float32(codes / 256), pixels)
