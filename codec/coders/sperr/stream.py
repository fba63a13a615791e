"""SPECK streams of volumes by SPERR.

The length of a stream is SPERR's output size at the step; the embedded stream is truncated to it. A truncated stream
has a wider dead zone than a quantised one: its error is smaller at wide steps, and slightly larger at fine ones.

SPERR aborts the process on malformed streams. Payloads therefore hold streams without SPERR's headers, which are
rebuilt from the structure, and streams decode in a subprocess with limits: `codec.coders.sperr.worker`.
"""

from __future__ import annotations

import math
import struct
import subprocess
import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ii_core.base.extras import Lazy

from ...clock import spent_elsewhere
from . import worker

imagecodecs = Lazy("imagecodecs")

Shape = tuple[int, ...]

LEAST_SLICES = 2  # SPERR codes a single slice as a picture, or aborts
LARGEST_MEAN, LARGEST_STEP = 512.0, 2.0**20  # in 8-bit codes
BIT_PLANES = 32  # of every stream before truncation

# SPERR's header: version, kind (three dimensions of floats), columns, rows and slices, length of the rest; flag of a
# constant volume, mean, step of the last bit plane; bit planes, bits. A constant volume has a count and a value.
_LIBRARY = struct.Struct("<BB3IIBddBQ")
_COUNTED = 18  # position from which the length counts
_CONSTANT = struct.Struct("<19xQd")
_VERSION, _KIND, _USUAL, _ALL_THE_SAME = 0, 0x60, 0x80, 0x81

# Limits of the worker by the wall clock, for a busy machine; it limits its own CPU time.
SECONDS, SECONDS_A_SAMPLE = 120.0, 1e-4


@dataclass(frozen=True, kw_only=True)
class Part:
    """One coded volume: mean, step of the last bit plane, embedded stream; a constant has no stream."""

    mean: float
    step: float
    stream: bytes


def encode_volume(volume: NDArray[np.float32], step: float) -> Part:
    """Code a volume of at least `LEAST_SLICES` slices at a step."""
    encoded = partial(imagecodecs.sperr_encode, volume, chunks=volume.shape, numthreads=1)
    # For a largest error SPERR uses a step of 3/2 times the error, and appends a list of outliers.
    part, bits = _split(bytes(encoded(step / 1.5, "pwe")), volume.shape)
    if bits == 0:
        return Part(mean=part.mean, step=0.0, stream=b"")
    length = -(-bits // 8)
    part, _ = _split(bytes(encoded(8 * length / volume.size, "bpp")), volume.shape, BIT_PLANES)
    return Part(mean=part.mean, step=part.step, stream=part.stream[:length])


def decode_volumes(parts: list[Part], shape: Shape) -> tuple[list[NDArray[np.float32]], float]:
    """Return the volumes of parts, and the CPU seconds of decoding them.

    Raises
    ------
    ValueError
        If a part is damaged.
    ChildProcessError
        If the worker does not start.
    """
    for part in parts:
        _check(part)
    streams = [_with_header(part, shape) for part in parts if part.stream]
    volumes, seconds = _by_worker(streams, shape) if streams else (np.empty((0, *shape), np.float32), 0.0)
    remaining = iter(volumes)
    constants = [None if part.stream else np.broadcast_to(np.float32(part.mean), shape) for part in parts]
    return [next(remaining) if constant is None else constant for constant in constants], seconds


def squared_error(part: Part, volume: NDArray[np.float32]) -> float:
    """Return the mean squared error of a part that was just coded; it decodes in this process."""
    if part.stream:
        whole = _with_header(part, volume.shape)
        error = imagecodecs.sperr_decode(whole, shape=volume.shape, dtype=np.float32, numthreads=1)
        error -= volume
    else:
        error = np.float32(part.mean) - volume
    return float(np.mean(np.square(error, out=error), dtype=np.float64))


def _check(part: Part) -> None:
    sound = abs(part.mean) <= LARGEST_MEAN and 0 <= part.step <= LARGEST_STEP
    if not sound or (part.step > 0) != (len(part.stream) > 0):
        raise ValueError(f"its SPERR stream has {len(part.stream)} bytes, a step {part.step}, a mean {part.mean}")


def _split(whole: bytes, shape: Shape, planes: int | None = None) -> tuple[Part, int]:
    """Return a stream of SPERR without its header, and its number of bits; outliers after them stay in place."""
    head = whole[: _LIBRARY.size].ljust(_LIBRARY.size, b"\0")
    version, kind, *sizes, _, state, mean, step, bit_planes, bits = _LIBRARY.unpack(head)
    if (version, kind, *sizes) != (_VERSION, _KIND, *shape[::-1]) or state not in (_USUAL, _ALL_THE_SAME):
        raise RuntimeError(f"{imagecodecs.sperr_version()} writes another header than expected")
    if state == _ALL_THE_SAME:
        return Part(mean=_CONSTANT.unpack_from(whole)[1], step=0.0, stream=b""), 0
    if planes not in (None, bit_planes):
        raise RuntimeError(f"{imagecodecs.sperr_version()} writes {bit_planes} bit planes, not {planes}")
    return Part(mean=mean, step=step, stream=whole[_LIBRARY.size :]), bits


def _with_header(part: Part, shape: Shape) -> bytes:
    """Return a stream with SPERR's header; its number of bits lets SPERR read zeros beyond the truncated end."""
    size, beyond = _LIBRARY.size - _COUNTED + len(part.stream), 2 * math.prod(shape)
    bits = 8 * len(part.stream) + beyond
    head = (_VERSION, _KIND, *shape[::-1], size, _USUAL, part.mean, part.step, BIT_PLANES, bits)
    return _LIBRARY.pack(*head) + part.stream


def _by_worker(streams: list[bytes], shape: Shape) -> tuple[NDArray[np.float32], float]:
    samples = len(streams) * math.prod(shape)
    head = worker.HEAD.pack(*shape, len(streams))
    try:
        # Start the worker by its path: importing it as a module of this package takes long.
        ended = subprocess.run(
            [sys.executable, "-P", str(Path(worker.__file__))],
            input=head + b"".join(worker.LENGTH.pack(len(stream)) + stream for stream in streams),
            capture_output=True,
            timeout=SECONDS + SECONDS_A_SAMPLE * samples,
        )
    except subprocess.TimeoutExpired:
        raise ValueError("its SPERR stream takes too long to decode") from None
    if not ended.stdout.startswith(worker.READY):
        said = ended.stderr.decode(errors="replace").strip().splitlines()
        raise ChildProcessError(f"the SPERR decoder does not start: {said[-1] if said else ended.returncode}")
    if ended.returncode != 0:
        raise ValueError(f"its SPERR stream does not decode (the library ended with {ended.returncode})")
    decoding, all_of_it = worker.TIMES.unpack(ended.stdout[-worker.TIMES.size :])
    spent_elsewhere(all_of_it)
    volumes = np.frombuffer(ended.stdout, np.float32, samples, len(worker.READY))
    return volumes.reshape(len(streams), *shape), decoding
