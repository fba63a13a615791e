"""SPERR coder of volumes: component images as slices, CDF 9/7 in three dimensions, SPECK; by imagecodecs.

Colours are rotated to their principal axes as in `codec.coders.volume`. Each colour is a volume of its own. One step
for all colours makes one rate–distortion slope for all; see `codec.coders.sperr.stream`.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ii_core import IIPicture
from ii_core.base.extras import Lazy

from ...clock import cpu_seconds
from ...contract import Coder, Goal, Option, Options, Pixels
from ...frames import Layout, layout
from ...search import Axis, CodingResult, Run, meet_size, nearest, trials
from ..volume import NAMES, Volume, gather_real, lines, principal_axes, scatter_real
from .stream import LEAST_SLICES, Part, decode_volumes, encode_volume, squared_error

imagecodecs = Lazy("imagecodecs")

COARSEST_DB, FINEST_DB = 0.0, 70.0
# Binary logarithms of the step in 8-bit codes. The coarsest leaves only the mean, the finest gives 70 dB. Each
# doubling of the step about halves the size; a step of 64 (START) gives about 1 bpp.
FINEST, COARSEST, START, OCTAVE = -2.0, 18.0, 6.0, -1.0
QUALITY_RUNS, NEAR_DB = 6, 0.05
DB_A_STEP = 5.0  # growth of the error where the step doubles, about
NO_ERROR = 1e-9
# The payload has at least one byte per so many pixels, zeros if need be: this bounds the memory of a forged size.
PIXELS_A_BYTE = 4096

_HEAD = struct.Struct("<9h3f3f3I")
_UNIT = np.float32(1 << 14)  # unit of the colour matrix in the header


class Sperr(Coder):
    """Component images of one kind as slices of a volume.

    The payload, little-endian, is a header of 54 bytes, the SPECK stream of each colour without the header that SPERR
    writes, and zeros up to one byte per 4096 pixels. The header holds the rows of the colour matrix (nine numbers of
    16 bits in units of 2⁻¹⁴), then of each of the three colours the means (float32, in 8-bit codes about 128), the
    steps of the last of 32 bit planes (float32, 0 for a constant colour) and the lengths of streams (uint32). A
    constant colour has no stream.

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
        """Return the versions of imagecodecs and its SPERR."""
        return {"imagecodecs": imagecodecs.__version__, "sperr": imagecodecs.sperr_version().split()[-1]}

    def check(self, picture: IIPicture, options: Options) -> None:
        """Accept any size."""

    def encode(self, picture: IIPicture, options: Options, goal: Goal) -> CodingResult:
        """Meet a rate or a quality by a search of the step."""
        source = _Source(picture, layout(picture.lenses, picture.ei_pixels, self.kind), options)
        if goal.quality is not None:
            return _meet_quality(source, goal.quality)
        assert goal.bpp is not None
        axis = Axis(low=FINEST, high=COARSEST, start=START + OCTAVE * math.log2(goal.bpp), octave=OCTAVE)
        return meet_size(lambda setting: source.run(*source.parts(setting)), goal.bpp * source.pixels / 8, axis)

    def decode(self, payload: bytes, blank: IIPicture, options: Options) -> tuple[Pixels, float]:
        """Decode in a process with limits; see `codec.coders.sperr.worker`."""
        pixels = blank.pixels.size // 3
        matrix, parts = _parts(payload, pixels)
        shape = layout(blank.lenses, blank.ei_pixels, self.kind)
        colours, seconds = decode_volumes(parts, _coded_shape(shape))
        out = np.empty((pixels, 3), blank.pixels.dtype)
        _to_pixels(colours, shape, _origins(shape, options), matrix, out)
        return out.reshape(blank.pixels.shape), seconds


def _coded_shape(shape: Layout) -> tuple[int, int, int]:
    return max(LEAST_SLICES, shape.frames), shape.height, shape.width


def _origins(shape: Layout, options: Options) -> NDArray[np.int64]:
    return shape.origins(str(options["order"]), str(options["by"]))


class _Source:
    """A picture coded at one step after another."""

    def __init__(self, picture: IIPicture, shape: Layout, options: Options) -> None:
        pixels = np.ascontiguousarray(picture.pixels).reshape(-1, 3)
        self.pixels = len(pixels)
        self.axes = principal_axes(pixels)
        self.colours = np.empty((3, *_coded_shape(shape)), np.float32)
        _to_colours(pixels, shape, _origins(shape, options), self.axes.astype(np.float32) / _UNIT, self.colours)

    def parts(self, setting: float) -> tuple[list[Part], float]:
        """Code the colours at a step of 2^setting; return CPU seconds, too."""
        started = cpu_seconds()
        parts = [encode_volume(colour, 2.0**setting) for colour in self.colours]
        return parts, cpu_seconds() - started

    def run(self, parts: list[Part], seconds: float) -> Run:
        """Return the payload of coded colours."""
        columns = zip(*((part.mean, part.step, len(part.stream)) for part in parts), strict=True)
        head = _HEAD.pack(*self.axes.ravel().tolist(), *(number for column in columns for number in column))
        payload = head + b"".join(part.stream for part in parts)
        return Run(payload.ljust(_least_bytes(self.pixels), b"\0"), seconds)

    def error(self, parts: list[Part]) -> float:
        """Return the mean squared error in 8-bit codes."""
        return sum(squared_error(part, colour) for part, colour in zip(parts, self.colours, strict=True)) / 3


def _meet_quality(source: _Source, quality: float) -> CodingResult:
    """Meet a PSNR in dB by a search of the step, from the step whose uniform error is the one allowed."""
    allowed = 255**2 / 10 ** (quality / 10)

    def try_at(setting: float) -> tuple[Run, float]:
        parts, seconds = source.parts(setting)
        return source.run(parts, seconds), 10 * math.log10(max(source.error(parts), NO_ERROR) / allowed)

    axis = Axis(
        low=FINEST, high=COARSEST, start=math.log2(12 * allowed) / 2, octave=1.0, overshoot=0.0, runs=QUALITY_RUNS
    )
    tried = list(
        trials(try_at, lambda run: run[1] / DB_A_STEP, axis, enough=lambda miss: abs(miss) <= NEAR_DB / DB_A_STEP)
    )
    return CodingResult(run=nearest(tried).result[0], runs=len(tried))


def _least_bytes(pixels: int) -> int:
    return -(-pixels // PIXELS_A_BYTE)


def _parts(payload: bytes, pixels: int) -> tuple[NDArray[np.float32], list[Part]]:
    """Return the colour matrix and the coded colours of a payload."""
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


def _to_colours(
    pixels: NDArray[Any],
    shape: Layout,
    origins: NDArray[np.int64],
    matrix: NDArray[np.float32],
    colours: NDArray[np.float32],
) -> None:
    """Rotate pixels to colours about zero, in 8-bit codes; too few slices are completed by repeating the last."""
    codes = 256**pixels.itemsize
    rows = np.empty((len(origins), 3 * shape.width), np.float32)
    for y, first in lines(shape):
        gather_real(pixels, origins + first, shape.step_x, codes // 2, matrix * np.float32(256 / codes), rows)
        colours[:, : len(origins), y] = rows.reshape(len(origins), 3, shape.width).swapaxes(0, 1)
    colours[:, len(origins) :] = colours[:, len(origins) - 1 : len(origins)]


def _to_pixels(
    colours: list[NDArray[np.float32]],
    shape: Layout,
    origins: NDArray[np.int64],
    matrix: NDArray[np.float32],
    pixels: NDArray[Any],
) -> None:
    """Invert `_to_colours`, rounded and clipped; the matrix is a rotation."""
    codes = 256**pixels.itemsize
    for y, first in lines(shape):
        rows = np.stack([colour[: len(origins), y] for colour in colours], axis=1).reshape(len(origins), -1)
        scatter_real(rows, origins + first, shape.step_x, codes // 2, matrix * np.float32(codes / 256), pixels)
