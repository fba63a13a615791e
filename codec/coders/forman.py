"""Coder of groups of elementary images by a three-dimensional cosine transform, after Forman (1997).

Forman (1997) cut the elementary images of a lenticular picture into blocks of 8×8 pixels, put the blocks of eight
neighbouring elementary images on each other, and transformed, quantised and entropy-coded these 8×8×8 pixels. Here
elementary images have any size: their sides, and the rows of elementary images, are cut into the fewest parts of at
most eight, of nearly equal length. The entropy coder is that of `codec.coders.lf`; Forman used a Huffman code.

References
----------
Dissertation, 2.3.3; Forman, Aggoun and McCormick 1997, "A novel coding scheme for full parallax 3D-TV pictures".
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ii_core import IIPicture
from ii_core.base.jit import array_kernel, part_kernel, stage_kernel

from .. import clock
from ..contract import Coder, Goal, Option, Options, Pixels
from ..search import Axis, CodingResult, Run, meet_size
from .lf import planes
from .lf.arithmetic import (
    DECODING,
    Arithmetic,
    code_bit,
    code_number,
    code_raw,
    finish,
    new_contexts,
    overrun,
    reader,
    writer,
)
from .volume import principal_axes

SIDE = 8  # largest side of a block
FINEST, COARSEST = 0, 63
FRACTIONS = 16
START, OCTAVE = 34 * FRACTIONS, -6.0 * FRACTIONS
DEAD_ZONE = 1 / 3  # rounding offset in steps: a coefficient is rounded up from this far below the next level
MOST_LEVEL = 1 << 17
MOST_STEP = 1 << 18
# The payload has at least one byte per so many pixels, padded with zeros: this bounds the memory of a forged size.
PIXELS_A_BYTE = 4096
PIXEL_BYTES = 64  # upper bound of the coded size of a pixel
VERSION = 1

# Contexts. CODED: 3 planes × 2 states of the plane before. LAST: 3 planes × 12 digits of the last coefficient's
# place. SIGNIFICANT, ABOVE_ONE: 3 planes × 6 classes of the sum of indices × 8 classes of the neighbourhood.
CODED, LAST = 0, 6
SIGNIFICANT = LAST + 36
ABOVE_ONE = SIGNIFICANT + 144
REST = ABOVE_ONE + 144
CONTEXTS = REST + 3 * 16

_HEAD = struct.Struct("<B9hI")


def _matrices() -> NDArray[np.int64]:
    """Orthonormal DCT-II of 1 to 8 samples, in units of 2^-14."""
    found = np.zeros((SIDE + 1, SIDE, SIDE), np.int64)
    for n in range(1, SIDE + 1):
        k, i = np.mgrid[:n, :n]
        rows = np.sqrt(2 / n) * np.cos(np.pi * (2 * i + 1) * k / (2 * n))
        rows[0] /= np.sqrt(2)
        found[n, :n, :n] = np.rint(rows * (1 << 14))
    return found


def _scan() -> NDArray[np.int64]:
    """Places of an 8×8×8 block by rising sum of indices."""
    every = range(SIDE)
    places = sorted((t + y + x, t, y, x) for t in every for y in every for x in every)
    return np.array([place[1:] for place in places])


MATRICES, SCAN = _matrices(), _scan()


class Forman(Coder):
    """Elementary images in groups along rows; the payload is a header of 23 bytes and one arithmetic code."""

    kind = "ei"
    name = "ei-dct3d"
    about = "Groups of elementary images by a 3-D cosine transform, after Forman"
    dtypes: ClassVar[tuple[str, ...]] = ("uint8", "uint16")
    qp_range: ClassVar[tuple[int, int] | None] = (FINEST, COARSEST)
    scale_about = "the step doubles every 6, and is one 8-bit code at 8"
    options: ClassVar[Mapping[str, Option]] = {
        "group": Option(about="elementary images in a group, at most", default=SIDE, low=1, high=SIDE),
    }

    @property
    def versions(self) -> dict[str, str]:
        """Return the version of numba, which compiles the kernels."""
        return {"numba": numba.__version__}

    def check(self, picture: IIPicture, options: Options) -> None:
        """Accept any size."""

    def encode(self, picture: IIPicture, options: Options, goal: Goal) -> CodingResult:
        """Meet a rate by a search of the step."""
        count = picture.pixels.size // 3

        def run(setting: float) -> Run:
            started = clock.cpu_seconds()
            return Run(_encoded(picture, int(options["group"]), setting), clock.cpu_seconds() - started)

        if goal.qp is not None:
            return CodingResult(run=run(goal.qp * FRACTIONS))
        assert goal.bpp is not None
        start = START + OCTAVE * math.log2(min(max(goal.bpp, 1e-3), 100) * 4)
        axis = Axis(low=FINEST * FRACTIONS, high=COARSEST * FRACTIONS, start=start, octave=OCTAVE, step=1)
        return meet_size(run, goal.bpp * count / 8, axis)

    def decode(self, payload: bytes, blank: IIPicture, options: Options) -> tuple[Pixels, float]:
        """Decode block by block; a stream that ends early raises ValueError."""
        started = clock.cpu_seconds()
        height, width = blank.pixels.shape[:2]
        least = _least_bytes(height * width)
        if len(payload) < max(_HEAD.size, least):
            raise ValueError(f"its stream has {len(payload)} bytes, too few for {height * width} pixels")
        version, *axes, step = _HEAD.unpack_from(payload)
        if version != VERSION or not 0 < step <= MOST_STEP:
            raise ValueError(f"its header states version {version} and step {step}: no encoder writes these")
        matrix = np.array(axes, np.int16).reshape(3, 3)
        coder = reader(new_contexts(CONTEXTS), payload[_HEAD.size :])
        samples = np.zeros((3, height, width), np.int16)
        _code(coder, samples, blank, int(options["group"]), step)
        if overrun(coder):
            raise ValueError("its stream ends early")
        pixels = np.empty(blank.pixels.shape, blank.pixels.dtype)
        planes.scatter(samples[None], 0, (1, 1), 0, 0, matrix, pixels.itemsize == 2, pixels)
        return pixels, clock.cpu_seconds() - started


def _encoded(picture: IIPicture, group: int, setting: float) -> bytes:
    pixels = np.ascontiguousarray(picture.pixels)
    height, width = pixels.shape[:2]
    step = max(1, round(128 * 2 ** ((setting / FRACTIONS - 8) / 6)))
    axes = principal_axes(pixels)
    samples = np.empty((3, height, width), np.int16)
    planes.gather(pixels, (1, 1), 0, 0, axes, pixels.itemsize == 2, samples)
    coder = writer(new_contexts(CONTEXTS), PIXEL_BYTES * height * width + 1024)
    _code(coder, samples, picture, group, step)
    head = _HEAD.pack(VERSION, *axes.ravel().tolist(), step)
    return (head + finish(coder)).ljust(_least_bytes(height * width), b"\0")


def _least_bytes(pixels: int) -> int:
    return -(-pixels // PIXELS_A_BYTE)


def parts(length: int, most: int) -> NDArray[np.int64]:
    """Return the borders of the fewest parts of at most ``most``, of nearly equal length, from 0 on."""
    count = -(-length // most)
    return np.array([i * length // count for i in range(count + 1)])


def _code(coder: Arithmetic, samples: NDArray[np.int16], picture: IIPicture, group: int, step: int) -> None:
    """Write or read the blocks of the three planes."""
    (k, l), (u, v) = picture.lenses, picture.ei_pixels
    _code_blocks(coder, samples, (l, u, v), parts(k, group), parts(v, SIDE), parts(u, SIDE), step)


@part_kernel
def _transformed(block, sizes, backward, half):
    """Transform a block (8, 8, 8) of int64 in place, along one axis after the other."""
    for axis in range(3):
        n = sizes[axis]
        if n == 1:
            continue
        across, along = sizes[1 if axis == 0 else 0], sizes[1 if axis == 2 else 2]
        for i in range(across):
            for j in range(along):
                for a in range(n):
                    half[a] = block[a, i, j] if axis == 0 else (block[i, a, j] if axis == 1 else block[i, j, a])
                for a in range(n):
                    total = np.int64(1 << 13)
                    for b in range(n):
                        total += (MATRICES[n, b, a] if backward else MATRICES[n, a, b]) * half[b]
                    if axis == 0:
                        block[a, i, j] = total >> 14
                    elif axis == 1:
                        block[i, a, j] = total >> 14
                    else:
                        block[i, j, a] = total >> 14


@stage_kernel
def _near(levels, t, y, x):
    """Class 0–7 by the magnitudes of the six places one or two further along an axis."""
    total = np.int64(0)
    for away in range(1, 3):
        if t + away < SIDE:
            total += abs(levels[t + away, y, x])
        if y + away < SIDE:
            total += abs(levels[t, y + away, x])
        if x + away < SIDE:
            total += abs(levels[t, y, x + away])
    return total if total < 5 else (5 if total < 7 else (6 if total < 11 else 7))


@part_kernel
def _code_levels(coder, levels, sizes, plane, before):
    """Write levels, or read them into zeros; return whether there are any."""
    count = sizes[0] * sizes[1] * sizes[2]
    last = np.int64(-1)
    number = np.int64(0)
    for k in range(SIDE**3):
        t, y, x = SCAN[k, 0], SCAN[k, 1], SCAN[k, 2]
        if t < sizes[0] and y < sizes[1] and x < sizes[2]:
            if levels[t, y, x]:
                last = number
            number += 1
    some = code_bit(coder, CODED + plane * 2 + before, 1 if last >= 0 else 0)
    if not some:
        return 0
    last = min(code_number(coder, LAST + plane * 12, np.int64(12), np.int64(0), last), count - 1)
    number = count
    for k in range(SIDE**3 - 1, -1, -1):
        t, y, x = SCAN[k, 0], SCAN[k, 1], SCAN[k, 2]
        if t >= sizes[0] or y >= sizes[1] or x >= sizes[2]:
            continue
        number -= 1
        if number > last:
            continue
        far = t + y + x
        far = far if far < 3 else (3 if far < 5 else (4 if far < 9 else 5))
        context = (plane * 6 + far) * 8 + _near(levels, t, y, x)
        size = abs(levels[t, y, x])
        if number < last and not code_bit(coder, SIGNIFICANT + context, 1 if size else 0):
            continue
        found = np.int64(1)
        if code_bit(coder, ABOVE_ONE + context, 1 if size > 1 else 0):
            found = 2 + min(code_number(coder, REST + plane * 16, np.int64(16), np.int64(0), size - 2), MOST_LEVEL)
        levels[t, y, x] = -found if code_raw(coder, 1 if levels[t, y, x] < 0 else 0) else found
    return 1


class _Block(NamedTuple):
    """Memory for one block."""

    samples: Any  # (8, 8, 8), then coefficients
    levels: Any
    sizes: Any  # (3,) sides: elementary images, rows, columns
    half: Any


@array_kernel
def _code_blocks(coder, samples, structure, groups, rows, cols, step):
    """Write or read all blocks: by rows of elementary images, groups, rows and columns of blocks, and planes."""
    count, width, height = structure
    side = (SIDE, SIDE, SIDE)
    block = _Block(
        np.zeros(side, np.int64), np.zeros(side, np.int64), np.zeros(3, np.int64), np.zeros(SIDE, np.int64)
    )
    decoding = coder.state[DECODING]
    before = np.zeros(3, np.int64)
    for l in range(count):
        for g in range(groups.size - 1):
            block.sizes[0] = groups[g + 1] - groups[g]
            for r in range(rows.size - 1):
                block.sizes[1] = rows[r + 1] - rows[r]
                for c in range(cols.size - 1):
                    block.sizes[2] = cols[c + 1] - cols[c]
                    top, left = l * height + rows[r], groups[g] * width + cols[c]
                    for p in range(3):
                        block.levels[:] = 0
                        block.samples[:] = 0
                        if not decoding:
                            _quantise(samples[p], top, left, width, block, step)
                        before[p] = _code_levels(coder, block.levels, block.sizes, p, before[p])
                        if decoding and before[p]:
                            _rebuild(samples[p], top, left, width, block, step)


@stage_kernel
def _quantise(plane, top, left, width, block, step):
    """Fill the levels of a block with those of a plane's samples; ``width`` is that of an elementary image."""
    for t in range(block.sizes[0]):
        for y in range(block.sizes[1]):
            for x in range(block.sizes[2]):
                block.samples[t, y, x] = np.int64(plane[top + y, left + t * width + x]) * 16
    _transformed(block.samples, block.sizes, False, block.half)
    for t in range(block.sizes[0]):
        for y in range(block.sizes[1]):
            for x in range(block.sizes[2]):
                # Coefficients are in 2^-7 of a code, as the step is.
                size: Any = np.int64(abs(block.samples[t, y, x]) / step + DEAD_ZONE)
                size = min(size, MOST_LEVEL)
                block.levels[t, y, x] = -size if block.samples[t, y, x] < 0 else size


@stage_kernel
def _rebuild(plane, top, left, width, block, step):
    """Write the samples that the levels of a block stand for to a plane."""
    for t in range(block.sizes[0]):
        for y in range(block.sizes[1]):
            for x in range(block.sizes[2]):
                block.samples[t, y, x] = block.levels[t, y, x] * step
    _transformed(block.samples, block.sizes, True, block.half)
    for t in range(block.sizes[0]):
        for y in range(block.sizes[1]):
            for x in range(block.sizes[2]):
                value = (block.samples[t, y, x] + 8) >> 4
                plane[top + y, left + t * width + x] = min(max(value, -32768), 32767)
