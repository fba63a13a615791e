"""What is known of a view while it is coded or decoded, and of each of its blocks."""

from __future__ import annotations

import contextlib
import math
import mmap
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ii_core.base.jit import part_kernel, stage_kernel
from ii_core.base.references import by_reference

from . import motion
from .transform import LARGEST, sides

INTRA, EXPLICIT, SYNTHESIS, TIMED, MIXED = range(5)  # kinds of prediction
MOST_REFERENCES = 4
LARGE_BYTES = 1 << 20
LIMIT = 8191  # of a decoded sample's magnitude, in eighths of an 8-bit code
UNKNOWN = -32768  # disparity
# What is known of each 4×4. SKIPPED is 1 without a transform, else twice its kind; FOLLOWS if colours are predicted
# from the first plane.
KIND, INDEX, MASK, DIRECTION, LOG, CODED, DONE, CROSS_1, CROSS_2, SKIPPED, TALL, WIDE, PARTS = range(13)
FOLLOWS, FIELDS = 13, 14


@by_reference
class Job(NamedTuple):
    """A view to be coded or decoded.

    Parameters
    ----------
    views : ndarray of int16, (J, 3, H, W)
        Decoded views; sides are multiples of 4.
    disparities : ndarray of int16, (J, H, W)
        Of the decoded views, -32768 where none is known.
    at : int
        Which of them this is.
    references : ndarray of int64, (R, 3)
        Views to predict from: index, and how far each is, in columns and rows of the grid, in 2^-10 of a view; R ≤ 4.
    unit : int
        Disparity of an index of 1, in 2^-8 samples between neighbouring views.
    low, high : int
        Range of the index.
    made : ndarray of int16, (3, H, W)
        The synthesised view, if ``synthesised``.
    disparity : ndarray of int16, (H, W)
        That of the synthesis, in 2^-8 samples between neighbouring views.
    doubt : ndarray of int16, (H / 4, W / 4)
        How far the sources of the synthesis differ, in eighths of an 8-bit code.
    synthesised : int
    crossed : int
        Binary logarithm of the unit of factors that predict the second and third plane's residuals from the first's;
        0 without them.
    skipping : int
        Whether small blocks may have no transform.
    step : int
        Of the quantiser, in 2^-7 of an 8-bit code.
    blocks : ndarray of int16, (FIELDS, H / 4, W / 4)
    levels : ndarray of int16, (3, H, W)
        The encoder's quantised coefficients.
    past : ndarray of int16, (P, 3, H, W)
        The same view at earlier instants of a take, the latest first; P is 0 for pictures alone.
    motions : ndarray of int16, (J, motion.FIELDS, H / 4, W / 4)
        Vectors of decoded views, if there are earlier instants.
    finer : int
        Whether large coefficients have contexts by their neighbourhood.
    dependent : int
        Whether the quantiser of coefficients is a dependent one.
    directed : int
        Whether intra blocks have the modes and transforms of version 9.
    parted : int
        How often squares may be halved.
    guided : int
        Whether intra blocks have what version 14 gives them: directions, colours that follow, guessed signs.
    """

    views: Any
    disparities: Any
    at: Any
    references: Any
    unit: Any
    low: Any
    high: Any
    made: Any
    disparity: Any
    doubt: Any
    synthesised: Any
    crossed: Any
    skipping: Any
    step: Any
    blocks: Any
    levels: Any
    past: Any = motion.NOTHING
    motions: Any = motion.NOTHING
    finer: Any = 0
    dependent: Any = 0
    directed: Any = 0
    parted: Any = 0
    guided: Any = 0


@by_reference
class Work(NamedTuple):
    """Memory for one block."""

    predicted: Any
    block: Any
    half: Any
    coefficients: Any
    levels: Any
    first: Any  # the first plane's coefficients,
    reach: Any  # and how many rows and columns of them
    spare: Any
    border: Any
    rows: Any
    wanted: Any  # of `signs`: what the border misses,
    norms: Any  # its weights by row and column,
    places: Any  # and places of coefficients, by
    keys: Any


def new_work() -> Work:
    """Memory for one block."""
    square = (LARGEST, LARGEST)
    return Work(
        predicted=np.zeros((3, *square), np.int32),
        block=np.zeros(square, np.int32),
        half=np.zeros(square, np.int32),
        coefficients=np.zeros(square, np.int32),
        levels=np.zeros(square, np.int32),
        first=np.zeros(square, np.int32),
        reach=np.zeros(2, np.int64),
        spare=np.zeros(square, np.int32),
        border=np.zeros((4, 2 * LARGEST + 2), np.int32),
        rows=np.zeros((LARGEST + 6, LARGEST + 8), np.int32),
        wanted=np.zeros((2, LARGEST), np.int64),
        norms=np.zeros((2, LARGEST), np.int64),
        places=np.zeros(LARGEST * LARGEST, np.int64),
        keys=np.zeros(LARGEST * LARGEST, np.int64),
    )


def new_blocks(height: int, width: int) -> np.ndarray[Any, Any]:
    """Nothing known yet."""
    return np.zeros((FIELDS, height // 4, width // 4), np.int16)


def zeros(shape: tuple[int, ...], dtype: Any = np.int16) -> tuple[NDArray[Any], mmap.mmap | None]:
    """Return zeros; if they are many, in memory that the system gets back at once, also in parts, where it can.

    The allocator keeps what is given back to it. Huge pages would take the memory of views that are never written,
    beside others that are.
    """
    size = math.prod(shape) * np.dtype(dtype).itemsize
    if size < LARGE_BYTES or not hasattr(mmap, "MADV_DONTNEED"):
        return np.zeros(shape, dtype), None
    memory = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    if hasattr(mmap, "MADV_NOHUGEPAGE"):
        with contextlib.suppress(OSError):  # a system without huge pages
            memory.madvise(mmap.MADV_NOHUGEPAGE)
    return np.frombuffer(memory, dtype).reshape(shape), memory


@part_kernel
def neighbours(blocks, field, value, by, bx):
    """Return the number of blocks above and to the left that have a value."""
    count = 0
    if by > 0 and blocks[field, by - 1, bx] == value:
        count += 1
    if bx > 0 and blocks[field, by, bx - 1] == value:
        count += 1
    return count


@part_kernel
def doubt_class(job, by, bx, shape):
    """0–3 by how far the synthesis' sources differ in the block, in steps of the quantiser; 0 without synthesis."""
    if not job.synthesised:
        return 0
    height, width = job.doubt.shape
    h, w = sides(shape)
    total = np.int64(0)
    for y in range(by, min(by + (h >> 2), height)):
        for x in range(bx, min(bx + (w >> 2), width)):
            total += job.doubt[y, x]
    total <<= 12 - shape[0] - shape[1]
    # ``doubt`` is in 2^-3, the step in 2^-7.
    return 0 if total < 2 * job.step else (1 if total < 5 * job.step else (2 if total < 12 * job.step else 3))


@stage_kernel
def around_block(blocks, field, by, bx, shape, none):
    """Values of the blocks at the corner, above the right end, and to the left of the lower end."""
    h, w = sides(shape)
    corner = above = left = none
    if by > 0:
        above = np.int64(blocks[field, by - 1, min(bx + (w >> 2), blocks.shape[2]) - 1])
    if bx > 0:
        left = np.int64(blocks[field, min(by + (h >> 2), blocks.shape[1]) - 1, bx - 1])
    if by > 0 and bx > 0:
        corner = np.int64(blocks[field, by - 1, bx - 1])
    return corner, above, left
