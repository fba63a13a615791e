"""The volume by SPERR: component images as slices, a CDF 9/7 in three dimensions and SPECK, through imagecodecs.

Each colour, turned to the picture's principal axes as in `codec.volume`, is a volume of its own. How the bytes are
shared among the three is asked of the library's quantiser: coded with one step for all, which is one slope for all,
they have the lengths that they get. To these lengths SPECK's embedded streams are then cut, because truncation leaves
a wider zero than rounding to the step does, and is worth up to 0.4 dB below 35 dB.

The library trusts its input and ends the process where that is wrong. Its streams are therefore kept without their
headers, which are made again from what is known, and are decoded in a process of their own; see `codec.sperr_worker`.
"""

from __future__ import annotations

import math
import struct
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import imagecodecs
import numpy as np
from numpy.typing import NDArray

from ii_core import IIPicture
from ii_core.jit import kernel

from . import sperr_worker as worker
from .base import Coder, Coding, Goal, Option, Options, Pixels
from .clock import cpu_seconds, spent_elsewhere
from .rate import Run
from .search import nearest_setting
from .sequence import Layout, layout
from .volume import NAMES, Volume, principal_axes

COARSEST_DB, FINEST_DB = 0.0, 70.0
# Binary logarithms of the quantiser's step in 8-bit codes: at the coarsest nothing but the mean is left, at the finest
# the error is that of 70 dB. About one more halves the size; at 64 there is about a bit per pixel.
FINEST, COARSEST, START, OCTAVE = -2.0, 18.0, 6.0, -1.0
QUALITY_RUNS, NEAR_DB, DB_A_STEP = 6, 0.05, 5.0
LEAST_SLICES = 2  # of fewer the library makes pictures, or ends
LARGEST_MEAN, LARGEST_STEP, MOST_BIT_PLANES = 512.0, 2.0**20, 53

_MATRIX = struct.Struct("<9h")
_UNIT = 1 << 14  # of the colour matrix
_PART = struct.Struct("<ffBI")  # mean, step of the last bit plane, bit planes, bytes
# The library's own header: version, kind (three dimensions of floats), size by columns, rows and slices, length;
# whether it is a constant, mean, step; bit planes, bits.
_LIBRARY = struct.Struct("<BB3IIBddBQ")
_VERSION, _KIND, _USUAL, _CONSTANT = 0, 0x60, 0x80, 0x81
_SIZES = 18  # bytes of it before the length ends

# What decoding may take: wall-clock for a busy machine, since the worker itself limits its own time.
SECONDS, SECONDS_A_SAMPLE = 120.0, 1e-4


class Sperr(Coder):
    """Component images of one kind as slices of a volume.

    The payload is the colour matrix (18 bytes), then for each colour mean, step, bit planes and length (13 bytes) and
    its SPECK stream. A constant colour has no stream.

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
        source = _Source(
            pixels=np.ascontiguousarray(picture.pixels).reshape(-1, 3), room=_room(picture, self.kind, options)
        )
        if goal.quality is not None:
            return _nearest_quality(source, goal.quality)
        assert goal.bpp is not None
        run, runs = nearest_setting(
            lambda step: source.run(step)[0],
            goal.bpp * len(source.pixels) / 8,
            low=FINEST,
            high=COARSEST,
            start=START + OCTAVE * np.log2(goal.bpp),
            octave=OCTAVE,
        )
        return Coding(run=run, runs=runs)

    def decode(self, payload: bytes, blank: IIPicture, options: Options) -> tuple[Pixels, float]:
        """The headers that the library trusts are ours; what is left of the bytes is another process's risk."""
        shape = layout(blank.lenses, blank.ei_pixels, self.kind)
        matrix, parts = _parts(payload, shape)
        colours, seconds = _decoded(parts, shape)
        room = _room(blank, self.kind, options)
        pixels = np.empty((blank.pixels.size // 3, 3), blank.pixels.dtype)
        scatter_colours(colours, room.origins, room.steps, matrix / np.float32(worker.UNIT), room.unit, pixels)
        return pixels.reshape(blank.pixels.shape), seconds


@dataclass(frozen=True, kw_only=True)
class _Room:
    """Where the pixels of the slices lie, and what a code is worth: 1, or 1/256 if there are 16 bits."""

    origins: NDArray[np.int64]
    steps: tuple[int, int]
    shape: tuple[int, int, int]
    unit: np.float32


def _room(picture: IIPicture, kind: str, options: Options) -> _Room:
    shape = layout(picture.lenses, picture.ei_pixels, kind)
    return _Room(
        origins=shape.origins(str(options["order"]), str(options["by"])),
        steps=(shape.step_y, shape.step_x),
        shape=_coded_shape(shape),
        unit=np.float32(2.0 ** (8 - 8 * picture.pixels.dtype.itemsize)),
    )


def _coded_shape(shape: Layout) -> tuple[int, int, int]:
    return max(LEAST_SLICES, shape.frames), shape.height, shape.width


@dataclass(frozen=True, kw_only=True)
class _Part:
    """One colour: an embedded stream of bit planes, the last of which has a step; without any it is its mean."""

    mean: float
    step: float
    bit_planes: int
    stream: bytes


class _Source:
    """A picture to be coded, one colour in memory at a time."""

    def __init__(self, *, pixels: NDArray[Any], room: _Room) -> None:
        self.pixels, self.room = pixels, room
        self.axes = principal_axes(pixels)

    def run(self, setting: float, *, measured: bool = False) -> tuple[Run, float]:
        """Coded at a step of 2^setting, and the squared error in 8-bit codes, NaN unless it is to be measured."""
        volume = np.empty(self.room.shape, np.float32)
        payload, seconds, error = [_MATRIX.pack(*self.axes.ravel().tolist())], 0.0, 0.0
        for axis in self.axes:
            gather_colour(
                self.pixels,
                self.room.origins,
                self.room.steps,
                axis.astype(np.float32) / _UNIT,
                self.room.unit,
                volume,
            )
            started = cpu_seconds()
            part = _coded(volume, 2.0**setting)
            seconds += cpu_seconds() - started
            payload += [_PART.pack(part.mean, part.step, part.bit_planes, len(part.stream)), part.stream]
            error += _squared_error(part, volume) / 3 if measured else math.nan
        return Run(b"".join(payload), seconds), error


def _coded(volume: NDArray[np.float32], step: float) -> _Part:
    """Cut to as many bytes as a step takes."""
    encoded = partial(imagecodecs.sperr_encode, volume, chunks=volume.shape, numthreads=1)
    # Asked for a largest error, the library takes 3/2 of it for the step, and a list of what exceeds it follows.
    mean, _, bit_planes, bits, _ = _taken_apart(bytes(encoded(step / 1.5, "pwe")), volume.shape)
    if bit_planes == 0:
        return _Part(mean=mean, step=0.0, bit_planes=0, stream=b"")
    length = -(-bits // 8)
    mean, step, bit_planes, _, stream = _taken_apart(
        bytes(encoded(8 * length / volume.size, "bpp")), volume.shape
    )
    return _Part(mean=mean, step=step, bit_planes=bit_planes, stream=stream[:length])


def _taken_apart(whole: bytes, shape: tuple[int, ...]) -> tuple[float, float, int, int, bytes]:
    """Mean, step, bit planes, bits and the rest of a stream of the library's."""
    whole_head = whole[: _LIBRARY.size].ljust(_LIBRARY.size, b"\0")  # a constant's ends sooner, after its value
    version, kind, *sizes, _, state, mean, step, bit_planes, bits = _LIBRARY.unpack(whole_head)
    if (version, kind, *sizes) != (_VERSION, _KIND, *shape[::-1]) or state not in (_USUAL, _CONSTANT):
        raise RuntimeError(f"{imagecodecs.sperr_version()} writes another header than was foreseen")
    if state == _CONSTANT:
        return struct.unpack_from("<d", whole, _SIZES + 9)[0], 0.0, 0, 0, b""
    return mean, step, bit_planes, bits, whole[_LIBRARY.size :]


def _whole(part: _Part, shape: tuple[int, int, int]) -> bytes:
    """A stream as the library reads it, which finds zeros, not the end of its memory, beyond what there is."""
    beyond = 2 * math.prod(shape)
    size = _LIBRARY.size - _SIZES + len(part.stream)
    bits = 8 * len(part.stream) + beyond
    head = (_VERSION, _KIND, *shape[::-1], size, _USUAL, part.mean, part.step, part.bit_planes, bits)
    return _LIBRARY.pack(*head) + part.stream


def _squared_error(part: _Part, volume: NDArray[np.float32]) -> float:
    """Of what was just coded, and can be trusted."""
    if part.bit_planes:
        decoded = imagecodecs.sperr_decode(
            _whole(part, volume.shape), shape=volume.shape, dtype=np.float32, numthreads=1
        )
        decoded -= volume
    else:
        decoded = np.float32(part.mean) - volume
    return float(np.mean(np.square(decoded, out=decoded), dtype=np.float64))


def _nearest_quality(source: _Source, quality: float) -> Coding:
    """By secants from the step whose even error were the one allowed."""
    allowed = 255**2 / 10 ** (quality / 10)
    setting = min(max(math.log2(12 * allowed) / 2, FINEST), COARSEST)
    tried: dict[float, tuple[float, Run]] = {}
    slope = DB_A_STEP
    while setting not in tried and len(tried) < QUALITY_RUNS:
        run, error = source.run(setting, measured=True)
        over = 10 * math.log10(error / allowed) if error > 0 else -math.inf
        if tried:
            last = next(reversed(tried))
            if math.isfinite(change := (over - tried[last][0]) / (setting - last)):
                slope = min(max(change, 1.0), 2 * DB_A_STEP)
        tried[setting] = over, run
        if abs(over) <= NEAR_DB:
            break
        setting = min(max(setting - over / slope, FINEST), COARSEST)
    return Coding(run=min(tried.values(), key=lambda one: abs(one[0]))[1], runs=len(tried))


def _parts(payload: bytes, shape: Layout) -> tuple[NDArray[np.float32], list[_Part]]:
    """Colour matrix and colours, each within what our encoder writes."""
    if len(payload) < _MATRIX.size + 3 * _PART.size:
        raise ValueError(f"its volume has {len(payload)} bytes: its headers alone take more")
    matrix = np.array(_MATRIX.unpack_from(payload), np.float32).reshape(3, 3) / _UNIT
    parts: list[_Part] = []
    at = _MATRIX.size
    while at + _PART.size <= len(payload) and len(parts) < 3:
        mean, step, bit_planes, length = _PART.unpack_from(payload, at)
        start = at + _PART.size
        at = start + length
        parts.append(_Part(mean=mean, step=step, bit_planes=bit_planes, stream=payload[start:at]))
        sound = abs(mean) <= LARGEST_MEAN and 0 <= step <= LARGEST_STEP and bit_planes <= MOST_BIT_PLANES
        if not sound or (bit_planes > 0) != (length > 0) or (bit_planes > 0) != (step > 0):
            raise ValueError(f"its volume has {bit_planes} bit planes in {length} bytes, a step {step}, a mean {mean}")
    if at != len(payload) or len(parts) != 3:
        raise ValueError("its volume does not consist of 3 colours and no more")
    return matrix, parts


def _decoded(parts: list[_Part], shape: Layout) -> tuple[NDArray[np.int16], float]:
    """Colours in the worker's unit, and the CPU seconds of decoding them."""
    size = _coded_shape(shape)
    streams = [_whole(part, size) for part in parts if part.bit_planes]
    volumes, seconds = _by_worker(streams, size) if streams else ([], 0.0)
    colours = np.empty((3, *size), np.int16)
    remaining = iter(volumes)
    for colour, part in zip(colours, parts, strict=True):
        colour[:] = next(remaining) if part.bit_planes else np.rint(part.mean * worker.UNIT)
    return colours, seconds


def _by_worker(streams: list[bytes], shape: tuple[int, int, int]) -> tuple[NDArray[np.int16], float]:
    request = worker.HEAD.pack(*shape, len(streams)) + b"".join(
        worker.LENGTH.pack(len(stream)) + stream for stream in streams
    )
    samples = len(streams) * math.prod(shape)
    with tempfile.TemporaryFile() as answer:
        try:
            # By its path and not as a module of this package, which takes long to import.
            ended = subprocess.run(
                [sys.executable, "-P", str(Path(worker.__file__))],
                input=request,
                stdout=answer,
                stderr=subprocess.DEVNULL,
                timeout=SECONDS + SECONDS_A_SAMPLE * samples,
            ).returncode
        except subprocess.TimeoutExpired:
            raise ValueError("its SPERR stream takes too long to decode") from None
        if ended != 0 or answer.seek(0, 2) != 2 * samples + worker.TIMES.size:
            raise ValueError(f"its SPERR stream does not decode (the library ended with {ended})")
        answer.seek(0)
        volumes = np.fromfile(answer, "<i2", samples).reshape(len(streams), *shape)
        decoding, all_of_it = worker.TIMES.unpack(answer.read())
    spent_elsewhere(all_of_it)
    return volumes, decoding


@kernel
def gather_colour(pixels, origins, steps, axis, unit, volume):
    """volume[j, y, x] = one colour of the pixels from origins[j] on, about zero in 8-bit codes; the last repeated."""
    step_y, step_x = steps
    middle = np.float32(128)
    for j in range(volume.shape[0]):
        first = origins[min(j, origins.size - 1)]
        for y in range(volume.shape[1]):
            for x in range(volume.shape[2]):
                p = first + y * step_y + x * step_x
                total = np.float32(0)
                for c in range(3):
                    total += axis[c] * (np.float32(pixels[p, c]) * unit - middle)
                volume[j, y, x] = total


@kernel
def scatter_colours(colours, origins, steps, matrix, unit, pixels):
    """The inverse of `gather_colour` for all three, rounded and clipped; the matrix is a rotation and the scale."""
    step_y, step_x = steps
    middle, top = np.float32(128) / unit, np.float32(256) / unit - np.float32(1)
    for j in range(origins.size):
        for y in range(colours.shape[2]):
            for x in range(colours.shape[3]):
                p = origins[j] + y * step_y + x * step_x
                for c in range(3):
                    value = np.float32(0)
                    for a in range(3):
                        value += matrix[a, c] * np.float32(colours[a, j, y, x])
                    value = value / unit + middle + np.float32(0.5)
                    pixels[p, c] = np.int32(min(max(value, np.float32(0)), top))
