"""Volumes to SPECK streams and back, by SPERR.

How long a stream is to be is asked of the library's quantiser: so long as it is at a step. To this length SPECK's
embedded stream is then cut, since what is cut has a wider zero than what is rounded to a step: a smaller error where
steps are wide, a slightly larger one where they are fine and few coefficients are zero.

The library trusts its input and ends the process where that is wrong. Its streams are therefore kept without their
headers, which are made again from what is known, and are decoded in a process of their own:
`codec.coders.sperr.worker`.
"""

from __future__ import annotations

import math
import struct
import subprocess
import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import imagecodecs
import numpy as np
from numpy.typing import NDArray

from ..clock import spent_elsewhere
from . import worker

Shape = tuple[int, ...]

LEAST_SLICES = 2  # of fewer the library makes pictures, or ends
LARGEST_MEAN, LARGEST_STEP = 512.0, 2.0**20  # in 8-bit codes
BIT_PLANES = 32  # of every stream that is to be cut

# The library's own header: version, kind (three dimensions of floats), columns, rows and slices, length of the rest;
# whether all is constant, mean, step of the last bit plane; bit planes, bits. Of a constant, count and value.
_LIBRARY = struct.Struct("<BB3IIBddBQ")
_COUNTED = 18  # where what its length counts begins
_CONSTANT = struct.Struct("<19xQd")
_VERSION, _KIND, _USUAL, _ALL_THE_SAME = 0, 0x60, 0x80, 0x81

# What the worker may take, by the clock and on a busy machine: it limits its own CPU time.
SECONDS, SECONDS_A_SAMPLE = 120.0, 1e-4


@dataclass(frozen=True, kw_only=True)
class Part:
    """One volume: its mean and an embedded stream, the last bit plane of which has a step; or its mean alone."""

    mean: float
    step: float
    stream: bytes


def coded(volume: NDArray[np.float32], step: float) -> Part:
    """A volume of at least `LEAST_SLICES` cut to as many bytes as a step takes."""
    encoded = partial(imagecodecs.sperr_encode, volume, chunks=volume.shape, numthreads=1)
    # Asked for a largest error, the library takes 3/2 of it for the step, and a list of what exceeds it follows.
    part, bits = _taken_apart(bytes(encoded(step / 1.5, "pwe")), volume.shape)
    if bits == 0:
        return Part(mean=part.mean, step=0.0, stream=b"")
    length = -(-bits // 8)
    part, _ = _taken_apart(bytes(encoded(8 * length / volume.size, "bpp")), volume.shape, BIT_PLANES)
    return Part(mean=part.mean, step=part.step, stream=part.stream[:length])


def decoded(parts: list[Part], shape: Shape) -> tuple[list[NDArray[np.float32]], float]:
    """The volumes of parts, and the CPU seconds of decoding them.

    Raises
    ------
    ValueError
        If a part is none of ours, or the library does not take it.
    ChildProcessError
        If the worker does not start.
    """
    for part in parts:
        _check(part)
    streams = [_whole(part, shape) for part in parts if part.stream]
    volumes, seconds = _by_worker(streams, shape) if streams else (np.empty((0, *shape), np.float32), 0.0)
    remaining = iter(volumes)
    constants = [None if part.stream else np.broadcast_to(np.float32(part.mean), shape) for part in parts]
    return [next(remaining) if constant is None else constant for constant in constants], seconds


def squared_error(part: Part, volume: NDArray[np.float32]) -> float:
    """Of what was just coded, and can be trusted."""
    if part.stream:
        whole = _whole(part, volume.shape)
        error = imagecodecs.sperr_decode(whole, shape=volume.shape, dtype=np.float32, numthreads=1)
        error -= volume
    else:
        error = np.float32(part.mean) - volume
    return float(np.mean(np.square(error, out=error), dtype=np.float64))


def _check(part: Part) -> None:
    sound = abs(part.mean) <= LARGEST_MEAN and 0 <= part.step <= LARGEST_STEP
    if not sound or (part.step > 0) != (len(part.stream) > 0):
        raise ValueError(f"its SPERR stream has {len(part.stream)} bytes, a step {part.step}, a mean {part.mean}")


def _taken_apart(whole: bytes, shape: Shape, planes: int | None = None) -> tuple[Part, int]:
    """A stream of the library's without its header, and its bits; what follows them is left in place."""
    head = whole[: _LIBRARY.size].ljust(_LIBRARY.size, b"\0")
    version, kind, *sizes, _, state, mean, step, bit_planes, bits = _LIBRARY.unpack(head)
    if (version, kind, *sizes) != (_VERSION, _KIND, *shape[::-1]) or state not in (_USUAL, _ALL_THE_SAME):
        raise RuntimeError(f"{imagecodecs.sperr_version()} writes another header than was foreseen")
    if state == _ALL_THE_SAME:
        return Part(mean=_CONSTANT.unpack_from(whole)[1], step=0.0, stream=b""), 0
    if planes not in (None, bit_planes):
        raise RuntimeError(f"{imagecodecs.sperr_version()} writes {bit_planes} bit planes, not {planes}")
    return Part(mean=mean, step=step, stream=whole[_LIBRARY.size :]), bits


def _whole(part: Part, shape: Shape) -> bytes:
    """A stream as the library reads it, which finds zeros, not the end of its memory, beyond what there is."""
    size, beyond = _LIBRARY.size - _COUNTED + len(part.stream), 2 * math.prod(shape)
    bits = 8 * len(part.stream) + beyond
    head = (_VERSION, _KIND, *shape[::-1], size, _USUAL, part.mean, part.step, BIT_PLANES, bits)
    return _LIBRARY.pack(*head) + part.stream


def _by_worker(streams: list[bytes], shape: Shape) -> tuple[NDArray[np.float32], float]:
    samples = len(streams) * math.prod(shape)
    head = worker.HEAD.pack(*shape, len(streams))
    try:
        # By its path and not as a module of this package, which takes long to import.
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
