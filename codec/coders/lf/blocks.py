"""Blocks of a view: a quadtree from 32 to 4 samples, three kinds of prediction, and a residual.

A block is predicted by *synthesis* (the picture the decoder makes of other views by itself, `synthesis`), by an
*explicit* disparity between the view and up to four others, or from its surroundings (`intra`). In takes it may also
be predicted *in time* (`motion`), or by the mean of that and synthesis (*mixed*).
"""

from __future__ import annotations

import contextlib
import math
import mmap
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ii_core.base.jit import array_kernel, part_kernel, stage_kernel, tuned_kernel

from . import contexts as at
from . import motion
from .arithmetic import (
    DECODING,
    REFINED,
    Arithmetic,
    bit_cost,
    code_bit,
    code_number,
    code_of_four,
    code_raw,
    number_cost,
)
from .coefficients import code_coefficients
from .cross import code_cross, keep_first, rebuild
from .intra import MODES, SMOOTH, fill_border, predict_intra, turn_class
from .samples import LARGEST_SKIPPED, code_samples
from .transform import LARGEST, SINE_ACROSS, SINE_DOWN, sides, size_of
from .warp import LATTICE, led, moved_block

LOG_LARGEST, LOG_LEAST = 5, 2
MOST_HALVINGS = 2  # of a square
INTRA, EXPLICIT, SYNTHESIS, TIMED, MIXED = range(5)
MOST_REFERENCES = 4
SIDE, STRAIGHT = 17, 8  # directions from one side, and the place of the straight one among them
LIMIT = 8191  # of a decoded sample's magnitude, in eighths of an 8-bit code
MOST_INDEX = 1 << 14
LARGE_BYTES = 1 << 20
UNKNOWN = -32768  # disparity
DIFFERENT = 205  # disparities that lead this far apart, in 2^-8 samples, are of different surfaces
# What is known of each 4×4. SKIPPED is 1 without a transform, else twice its kind.
KIND, INDEX, MASK, DIRECTION, LOG, CODED, DONE, CROSS_1, CROSS_2, SKIPPED, TALL, WIDE, PARTS, FIELDS = range(14)


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


@tuned_kernel
def neighbours(blocks, field, value, by, bx):
    """Return the number of blocks above and to the left that have a value."""
    count = 0
    if by > 0 and blocks[field, by - 1, bx] == value:
        count += 1
    if bx > 0 and blocks[field, by, bx - 1] == value:
        count += 1
    return count


@tuned_kernel
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


@tuned_kernel
def split_context(job, by, bx, log):
    """By how many of the blocks above and left are smaller, and doubt."""
    blocks = job.blocks
    count = 0
    if by > 0 and blocks[LOG, by - 1, bx] < log:
        count += 1
    if bx > 0 and blocks[LOG, by, bx - 1] < log:
        count += 1
    return at.SPLIT + ((log - 3) * 3 + count) * 4 + doubt_class(job, by, bx, (log, log))


@tuned_kernel
def synthesis_context(job, by, bx, shape):
    """By size, how many of the blocks above and left are synthesised, and doubt."""
    like = neighbours(job.blocks, np.int64(KIND), np.int64(SYNTHESIS), by, bx)
    return at.SYNTHESIS + ((size_of(shape) - 2) * 3 + like) * 4 + doubt_class(job, by, bx, shape)


@tuned_kernel
def residual_context(job, by, bx, shape, kind):
    """By size, kind, how many of the blocks above and left have a residual, and doubt."""
    other = 0 if kind == SYNTHESIS else 1
    like = neighbours(job.blocks, np.int64(CODED), np.int64(1), by, bx)
    if kind >= TIMED:
        return at.RESIDUAL_IN_TIME + ((size_of(shape) - 2) * 2 + (1 if kind == MIXED else 0)) * 3 + like
    return at.RESIDUAL + (((size_of(shape) - 2) * 2 + other) * 3 + like) * 4 + doubt_class(job, by, bx, shape)


@tuned_kernel
def coded_context(plane, shape, kind, first, skipped):
    """By plane, size, kind, whether the first plane has a residual, and whether the transform is skipped."""
    if skipped == 1:
        return at.SAMPLE_CODED + (plane * 2 + size_of(shape) - 2) * 2 + first
    return at.CODED + ((plane * 4 + size_of(shape) - 2) * 2 + (1 if kind == INTRA else 0)) * 2 + first


@tuned_kernel
def skipped_context(job, by, bx, shape):
    """By size, and how many of the blocks above and left have no transform."""
    return at.SKIPPED + (size_of(shape) - 2) * 3 + neighbours(job.blocks, np.int64(SKIPPED), np.int64(1), by, bx)


@tuned_kernel
def guesses(job, by, bx, shape):
    """Indices that the synthesis and the blocks left and above suggest; below the range where there is none."""
    none = job.low - 1
    made = left = above = none
    if job.synthesised:
        h, w = sides(shape)
        d = np.int64(job.disparity[by * 4 + (h >> 1), bx * 4 + (w >> 1)])
        made = min(max((2 * d + job.unit) // (2 * job.unit), job.low), job.high)
    if bx > 0 and job.blocks[KIND, by, bx - 1] == EXPLICIT:
        left = np.int64(job.blocks[INDEX, by, bx - 1])
    if by > 0 and job.blocks[KIND, by - 1, bx] == EXPLICIT:
        above = np.int64(job.blocks[INDEX, by - 1, bx])
    return made, left, above


@tuned_kernel
def from_where(job, by, bx, shape, index):
    """Return the source that predicts an index: 1 synthesis, 2 block to the left, 3 block above, 0 none."""
    made, left, above = guesses(job, by, bx, shape)
    none = job.low - 1
    if made > none and index == made:
        return 1
    if left > none and index == left:
        return 2
    return 3 if above > none and index == above else 0


@tuned_kernel
def seen_mask(job, by, bx, shape, index):
    """The references whose own disparity agrees at three of five places of the block, or is not known."""
    height, width = job.disparities.shape[1:]
    h, w = sides(shape)
    down, right = h >> 2, w >> 2
    seen = 0
    for r in range(job.references.shape[0]):
        view, columns, rows = job.references[r, 0], job.references[r, 1], job.references[r, 2]
        d = index * job.unit
        farthest = max(abs(columns), abs(rows))
        against = 0
        for place in range(5):
            y = 4 * by + (2 * down if place == 4 else down + 2 * down * (place >> 1))
            x = 4 * bx + (2 * right if place == 4 else right + 2 * right * (place & 1))
            dy, dx = led(job.references, r, d, y, x, (height, width))
            i, j = x + ((dx + 128) >> 8), y + ((dy + 128) >> 8)
            if i < 0 or j < 0 or i >= width or j >= height:
                against += 1
            else:
                other = np.int64(job.disparities[view, j, i])
                if other != UNKNOWN and abs(other - d) * farthest > DIFFERENT << LATTICE:
                    against += 1
        if against < 3:
            seen |= 1 << r
    return seen


@tuned_kernel
def expected_mask(job, by, bx, where, seen):
    """The references of the block left or above, or those that see the block; and a context."""
    left = above = np.int64(0)
    if bx > 0 and job.blocks[KIND, by, bx - 1] == EXPLICIT:
        left = np.int64(job.blocks[MASK, by, bx - 1])
    if by > 0 and job.blocks[KIND, by - 1, bx] == EXPLICIT:
        above = np.int64(job.blocks[MASK, by - 1, bx])
    expected = left
    if left == 0 or (where == 3 and above):
        expected = above
    if expected == 0:
        expected = seen
    if expected == 0:
        expected = (1 << job.references.shape[0]) - 1
    return expected, at.SAME_MASK + 2 * where + (1 if left == above else 0) + (8 if expected == seen else 0)


@tuned_kernel
def _made_context(made, left, none, shape):
    """By size, and whether the block left has the same index, another, or none."""
    return at.MERGE + (size_of(shape) - 2) * 5 + (0 if left <= none else (1 if left == made else 2))


@tuned_kernel
def likely_directions(blocks, by, bx):
    """Two intra modes, from the blocks left and above."""
    first = np.int64(blocks[DIRECTION, by, bx - 1]) if bx > 0 else SMOOTH
    second = np.int64(blocks[DIRECTION, by - 1, bx]) if by > 0 else 0
    if second == first:
        second = 0 if first else SMOOTH
    return first, second


@tuned_kernel
def mixed_context(job, by, bx, shape):
    """By size, and how many of the blocks above and left are mixed."""
    return at.MIXED + (size_of(shape) - 2) * 3 + neighbours(job.blocks, np.int64(KIND), np.int64(MIXED), by, bx)


@tuned_kernel
def code_kind(coder, job, by, bx, shape, kind, index, mask, direction):
    """Write or read how a block is predicted; return kind, index, mask and direction.

    The index of a block predicted in time is its vector.
    """
    blocks, count = job.blocks, job.references.shape[0]
    if job.past.shape[0] and code_bit(coder, motion.time_context(job, by, bx, shape), 1 if kind >= TIMED else 0):
        mixed = 0
        if job.synthesised:
            mixed = code_bit(coder, mixed_context(job, by, bx, shape), 1 if kind == MIXED else 0)
        vector = motion.code_vector(coder, job, by, bx, shape, index)
        return np.int64(MIXED if mixed else TIMED), vector, mask, direction
    if count == 0:
        kind = INTRA
    else:
        made = 0
        if job.synthesised:
            made = code_bit(coder, synthesis_context(job, by, bx, shape), 1 if kind == SYNTHESIS else 0)
        if made:
            kind = SYNTHESIS
        else:
            context = at.INTRA + neighbours(blocks, np.int64(KIND), np.int64(INTRA), by, bx)
            kind = INTRA if code_bit(coder, context, 1 if kind == INTRA else 0) else EXPLICIT
    if kind == SYNTHESIS:
        index = guesses(job, by, bx, shape)[0]
    elif kind == INTRA:
        direction = _code_mode(coder, job, by, bx, shape, direction)
    else:
        index = _code_index(coder, job, by, bx, shape, index)
        where = from_where(job, by, bx, shape, index)
        seen = seen_mask(job, by, bx, shape, index)
        mask = _code_mask(coder, job, by, bx, where, seen, mask) if count > 1 else 1
    return kind, index, mask, direction


@tuned_kernel
def mode_contexts(job, by, bx, shape):
    """Of the first likely mode, the second, flat or smooth, and which of these; the last is -1 of even bits."""
    if not job.directed:
        return np.int64(at.INTRA_MODE), np.int64(at.INTRA_MODE + 1), np.int64(at.INTRA_MODE + 2), np.int64(-1)
    blocks = job.blocks
    like = neighbours(blocks, np.int64(KIND), np.int64(INTRA), by, bx)
    if like == 2 and blocks[DIRECTION, by, bx - 1] == blocks[DIRECTION, by - 1, bx]:
        like = 3
    first = np.int64(at.LIKELY + (size_of(shape) - 2) * 4 + like)
    return first, first + 16, np.int64(at.UNDIRECTED + size_of(shape) - 2), np.int64(at.UNDIRECTED + 4)


@tuned_kernel
def _code_mode(coder, job, by, bx, shape, mode):
    """Write or read an intra mode: one of two likely ones, flat, smooth, or a direction."""
    if coder.state[REFINED]:
        return _code_mode_around(coder, job, by, bx, shape, mode)
    first, second = likely_directions(job.blocks, by, bx)
    one, two, undirected, smooth = mode_contexts(job, by, bx, shape)
    if code_bit(coder, one, 1 if mode == first else 0):
        return first
    if code_bit(coder, two, 1 if mode == second else 0):
        return second
    if code_bit(coder, undirected, 1 if mode <= SMOOTH else 0):
        return code_bit(coder, smooth, mode) if smooth >= 0 else code_raw(coder, mode)
    if not job.directed:
        return 2 + _code_direction(coder, mode - 2)
    value = mode - 2
    side = code_bit(coder, np.int64(at.SIDE), 1 if value >= SIDE else 0)
    straight = code_bit(coder, np.int64(at.STRAIGHT + side), 1 if value == SIDE * side + STRAIGHT else 0)
    return 2 + (SIDE * side + STRAIGHT if straight else _code_slope(coder, value, side))


@stage_kernel
def _side_of(mode):
    """0 without a direction, 1 from above, 2 from the left."""
    return 0 if mode <= SMOOTH else (1 if mode < 2 + SIDE else 2)


@stage_kernel
def _mode_class(mode):
    """0 flat, 1 smooth, 2 from above, 3 from the left, 4 straight."""
    if mode <= SMOOTH:
        return np.int64(mode)
    return np.int64(4 if (mode - 2) % SIDE == STRAIGHT else 1 + _side_of(mode))


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


@tuned_kernel
def _code_residual(coder, job, by, bx, shape, kind, direction, coded):
    """Write or read whether a block has a residual."""
    context = residual_context(job, by, bx, shape, kind)
    if not coder.state[REFINED]:
        return code_bit(coder, context, coded)
    blocks, mode = job.blocks, np.int64(0)
    if kind == INTRA:
        first = np.int64(blocks[DIRECTION, by, bx - 1]) if bx > 0 else np.int64(SMOOTH)
        second = np.int64(blocks[DIRECTION, by - 1, bx]) if by > 0 else np.int64(SMOOTH)
        corner, above, left = around_block(blocks, DIRECTION, by, bx, shape, np.int64(SMOOTH))
        mode = 6 * _mode_class(direction) + (1 if first == direction else 0) + (1 if second == direction else 0)
        mode += (1 if corner == direction else 0) + (1 if above == direction else 0) + (1 if left == direction else 0)
    corner, above, left = around_block(blocks, CODED, by, bx, shape, np.int64(0))
    near = neighbours(blocks, np.int64(CODED), np.int64(1), by, bx) + corner + above + left
    moded, near = at.RESIDUAL_MODE + kind * 30 + mode, at.RESIDUAL_NEAR + kind * 6 + near
    formed = at.RESIDUAL_FORM + ((shape[0] - 2) * 4 + shape[1] - 2) * 2 + (1 if kind == INTRA else 0)
    return code_of_four(coder, context, moded, near, formed, at.MODE_WEIGHTS + 10, coded)


@stage_kernel
def _code_likely(coder, likely, which, one, where, around, like, form):
    """Write or read whether a mode is the first likely one, or the second; ``where`` holds the mode."""
    corner, above, left = around
    agree = (1 if corner == likely else 0) + (1 if above == likely else 0) + (1 if left == likely else 0)
    near = at.LIKELY_NEAR + (which * 5 + _mode_class(likely)) * 4 + agree
    alike = at.LIKELY_MODE + (which * MODES + likely) * 2 + (1 if left == likely else 0)
    formed = at.LIKELY_FORM + (which * 3 + form) * 4 + like
    return code_of_four(coder, one, near, alike, formed, at.MODE_WEIGHTS + 2 * which, 1 if where == likely else 0)


@tuned_kernel
def _code_mode_around(coder, job, by, bx, shape, mode):
    """As `_code_mode`, from version 12 on: contexts are of the modes around, and mixed."""
    blocks = job.blocks
    first, second = likely_directions(blocks, by, bx)
    one, two, undirected, smooth = mode_contexts(job, by, bx, shape)
    like = (one - at.LIKELY) & 3
    form = 0 if shape[0] == shape[1] else (1 if shape[0] < shape[1] else 2)
    around = around_block(blocks, DIRECTION, by, bx, shape, np.int64(SMOOTH))
    _, above, left = around
    if _code_likely(coder, first, 0, one, mode, around, like, form):
        return first
    if _code_likely(coder, second, 1, two, mode, around, like, form):
        return second
    one_side, two_side, above_side, left_side = _side_of(first), _side_of(second), _side_of(above), _side_of(left)
    both = one_side * 3 + two_side
    directed = (1 if one_side else 0) + (1 if two_side else 0) + (1 if above_side else 0) + (1 if left_side else 0)
    directed = min(directed, 3)
    formed, liked = at.UNDIRECTED_FORM + directed * 3 + form, at.UNDIRECTED_LIKE + directed * 4 + like
    bit, weights = 1 if mode <= SMOOTH else 0, at.MODE_WEIGHTS + 4
    if code_of_four(coder, undirected, at.UNDIRECTED_SIDES + both, formed, liked, weights, bit):
        return code_bit(coder, smooth, mode)
    votes = 0
    for which in range(1, 3):
        count = 2 * ((1 if one_side == which else 0) + (1 if two_side == which else 0))
        count += (1 if above_side == which else 0) + (1 if left_side == which else 0)
        votes += min(count, 5) * (6 if which == 2 else 1)
    value, weights = mode - 2, at.MODE_WEIGHTS + 6
    sided, bit = at.SIDE_SIDES + both, 1 if value >= SIDE else 0
    side = code_of_four(coder, np.int64(at.SIDE), at.SIDE_VOTES + votes, at.SIDE_FORM + form, sided, weights, bit)
    straight = 2 + SIDE * side + STRAIGHT
    same = (1 if first == straight else 0) + (1 if second == straight else 0)
    same += (1 if above == straight else 0) + (1 if left == straight else 0)
    formed, sided = at.STRAIGHT_FORM + side * 3 + form, at.STRAIGHT_SIDES + side * 9 + both
    bit, weights = 1 if mode == straight else 0, at.MODE_WEIGHTS + 8
    if code_of_four(coder, at.STRAIGHT + side, at.STRAIGHT_SAME + side * 5 + same, formed, sided, weights, bit):
        return straight
    return 2 + _code_slope(coder, value, side)


@tuned_kernel
def _code_direction(coder, value):
    """34 directions: 30 of five bits, the last 4 of six."""
    long = value >= 30
    head = 30 + ((value - 30) >> 1) if long else value
    found = 0
    for place in range(4, -1, -1):
        found = 2 * found + code_raw(coder, (head >> place) & 1)
    if found >= 30:
        found = 30 + 2 * (found - 30) + code_raw(coder, (value - 30) & 1)
    return min(found, 33)


@tuned_kernel
def _code_slope(coder, value, side):
    """The directions of a side but the straight one: which way it turns, and how far."""
    slope = value - SIDE * side - STRAIGHT
    back = code_bit(coder, np.int64(at.TURN + side), 1 if slope < 0 else 0)
    size, node = abs(slope) - 1, np.int64(1)
    for place in range(2, -1, -1):
        node = 2 * node + code_bit(coder, at.SLOPE + 8 * side + node, (size >> place) & 1)
    return SIDE * side + STRAIGHT + (7 - node if back else node - 7)


@part_kernel
def _slope_cost(costs, value):
    """Bits that a direction would take from version 9 on."""
    side = 1 if value >= SIDE else 0
    slope = value - SIDE * side - STRAIGHT
    bits = bit_cost(costs, np.int64(at.SIDE), side) + bit_cost(costs, at.STRAIGHT + side, 1 if slope == 0 else 0)
    if slope:
        bits += bit_cost(costs, at.TURN + side, 1 if slope < 0 else 0)
        size, node = abs(slope) - 1, 1
        for place in range(2, -1, -1):
            bit = (size >> place) & 1
            bits += bit_cost(costs, at.SLOPE + 8 * side + node, bit)
            node = 2 * node + bit
    return bits


@part_kernel
def _mode_cost(costs, job, by, bx, shape, mode):
    """Bits that `_code_mode` would take."""
    first, second = likely_directions(job.blocks, by, bx)
    one, two, undirected, smooth = mode_contexts(job, by, bx, shape)
    bits = bit_cost(costs, one, 1 if mode == first else 0)
    if mode == first:
        return bits
    bits += bit_cost(costs, two, 1 if mode == second else 0)
    if mode == second:
        return bits
    bits += bit_cost(costs, undirected, 1 if mode <= SMOOTH else 0)
    if mode <= SMOOTH:
        return bits + (bit_cost(costs, smooth, mode) if smooth >= 0 else np.float32(1))
    return bits + (_slope_cost(costs, mode - 2) if job.directed else np.float32(5.1))


@tuned_kernel
def _code_index(coder, job, by, bx, shape, index):
    made, left, above = guesses(job, by, bx, shape)
    none = job.low - 1
    if made > none and code_bit(coder, _made_context(made, left, none, shape), 1 if index == made else 0):
        return made
    context = at.MERGE + (size_of(shape) - 2) * 5 + 3
    if left > none and left != made and code_bit(coder, context, 1 if index == left else 0):
        return left
    new = above > none and above != made and above != left
    if new and code_bit(coder, context + 1, 1 if index == above else 0):
        return above
    base = left if left > none else (above if above > none else (made if made > none else 0))
    size = code_number(coder, np.int64(at.DELTA), np.int64(14), np.int64(1), abs(index - base))
    if size:
        size = -size if code_bit(coder, np.int64(at.DELTA + 14), 1 if index < base else 0) else size
    return min(max(base + size, job.low), job.high)


@tuned_kernel
def _code_mask(coder, job, by, bx, where, seen, mask):
    expected, context = expected_mask(job, by, bx, where, seen)
    if code_bit(coder, context, 1 if mask == expected else 0):
        return expected
    count = job.references.shape[0]
    found = 0
    for i in range(count):
        if i == count - 1 and found == 0:
            found = 1 << i
        else:
            context = at.MASK + (((count - 1) * 4 + i) * 2 + (1 if found else 0)) * 2 + ((seen >> i) & 1)
            found |= code_bit(coder, context, (mask >> i) & 1) << i
    return found


@part_kernel
def kind_cost(costs, job, by, bx, shape, kind, index, mask, direction):
    """Bits that `code_kind` would take; those of the references left out if the mask is 0."""
    blocks, count = job.blocks, job.references.shape[0]
    bits = np.float32(0)
    if job.past.shape[0]:
        bits += bit_cost(costs, motion.time_context(job, by, bx, shape), 1 if kind >= TIMED else 0)
    if kind >= TIMED:
        if job.synthesised:
            bits += bit_cost(costs, mixed_context(job, by, bx, shape), 1 if kind == MIXED else 0)
        return bits + motion.vector_cost(costs, job, by, bx, shape, index)
    if count and job.synthesised:
        bits += bit_cost(costs, synthesis_context(job, by, bx, shape), 1 if kind == SYNTHESIS else 0)
    if count and kind != SYNTHESIS:
        context = at.INTRA + neighbours(blocks, np.int64(KIND), np.int64(INTRA), by, bx)
        bits += bit_cost(costs, context, 1 if kind == INTRA else 0)
    if kind == INTRA:
        bits += _mode_cost(costs, job, by, bx, shape, direction)
    elif kind == EXPLICIT:
        bits += _index_cost(costs, job, by, bx, shape, index)
        if count > 1 and mask:
            seen = seen_mask(job, by, bx, shape, index)
            bits += mask_cost(costs, job, by, bx, from_where(job, by, bx, shape, index), seen, mask)
    return bits


@part_kernel
def _index_cost(costs, job, by, bx, shape, index):
    made, left, above = guesses(job, by, bx, shape)
    none = job.low - 1
    bits = np.float32(0)
    if made > none:
        bits += bit_cost(costs, _made_context(made, left, none, shape), 1 if index == made else 0)
        if index == made:
            return bits
    context = at.MERGE + (size_of(shape) - 2) * 5 + 3
    if left > none and left != made:
        bits += bit_cost(costs, context, 1 if index == left else 0)
        if index == left:
            return bits
    if above > none and above != made and above != left:
        bits += bit_cost(costs, context + 1, 1 if index == above else 0)
        if index == above:
            return bits
    base = left if left > none else (above if above > none else (made if made > none else 0))
    bits += number_cost(costs, np.int64(at.DELTA), np.int64(14), np.int64(1), abs(index - base))
    if index != base:
        bits += bit_cost(costs, np.int64(at.DELTA + 14), 1 if index < base else 0)
    return bits


@part_kernel
def mask_cost(costs, job, by, bx, where, seen, mask):
    """Bits that a set of references would take."""
    expected, context = expected_mask(job, by, bx, where, seen)
    bits = bit_cost(costs, context, 1 if mask == expected else 0)
    if mask == expected:
        return bits
    count = job.references.shape[0]
    found = 0
    for i in range(count):
        bit = (mask >> i) & 1
        if i < count - 1 or found:
            context = at.MASK + (((count - 1) * 4 + i) * 2 + (1 if found else 0)) * 2 + ((seen >> i) & 1)
            bits += bit_cost(costs, context, bit)
        found |= bit
    return bits


@tuned_kernel
def predict_explicit(job, work, y0, x0, shape, index, mask):
    """work.predicted = the mean of the masked references at a disparity."""
    (h, w), d = sides(shape), index * job.unit
    count = 0
    predicted = work.predicted
    for p in range(3):
        for y in range(h):
            for x in range(w):
                predicted[p, y, x] = 0
    for r in range(job.references.shape[0]):
        if (mask >> r) & 1:
            count += 1
            dy, dx = led(job.references, r, d, y0, x0, job.views.shape[2:])
            for p in range(3):
                moved_block(job.views, job.references[r, 0], p, y0, x0, h, w, dy, dx, work.rows, predicted)
    if count == 3:
        for p in range(3):
            for y in range(h):
                for x in range(w):
                    predicted[p, y, x] = (np.int64(predicted[p, y, x]) * 21845 + (1 << 27)) >> 28
    else:
        shift = 11 + max(count, 1)
        if count == 4:
            shift = 14
        for p in range(3):
            for y in range(h):
                for x in range(w):
                    predicted[p, y, x] = np.int32(predicted[p, y, x] + np.int32(1 << (shift - 1))) >> shift


@tuned_kernel
def predict_synthesis(job, work, y0, x0, shape):
    """work.predicted = the synthesised view."""
    h, w = sides(shape)
    for p in range(3):
        for y in range(h):
            for x in range(w):
                work.predicted[p, y, x] = job.made[p, y0 + y, x0 + x]


@tuned_kernel
def predict_direction(job, work, plane, y0, x0, shape, direction):
    """work.predicted[plane] from the block's surroundings."""
    fill_border(job.views, job.at, plane, job.blocks, np.int64(DONE), y0, x0, shape, work.border, job.directed)
    predict_intra(work.border, direction, shape, work.predicted, plane, job.directed)


@tuned_kernel
def store(job, work, plane, y0, x0, shape, residual):
    """Decoded samples: the prediction, and work.block if there is a residual."""
    h, w = sides(shape)
    for y in range(h):
        for x in range(w):
            value = work.predicted[plane, y, x]
            if residual:
                value = min(max(np.int32(value + work.block[y, x]), -LIMIT), LIMIT)
            job.views[job.at, plane, y0 + y, x0 + x] = value


@tuned_kernel
def mark(blocks, by, bx, shape, leaf, kind, index, mask, direction, coded):
    """Note a block as decoded."""
    h, w = sides(shape)
    for y in range(by, by + (h >> 2)):
        for x in range(bx, bx + (w >> 2)):
            blocks[KIND, y, x] = kind
            blocks[INDEX, y, x] = index
            blocks[MASK, y, x] = mask
            blocks[DIRECTION, y, x] = direction if kind == INTRA else SMOOTH
            blocks[LOG, y, x], blocks[PARTS, y, x] = leaf[0], leaf[1]
            blocks[TALL, y, x], blocks[WIDE, y, x] = shape[0], shape[1]
            blocks[CODED, y, x] = coded
            blocks[DONE, y, x] = 1


@tuned_kernel
def mark_block(job, by, bx, shape, leaf, kind, index, mask, direction, coded):
    """Note a block as decoded, and its vector if there are earlier instants."""
    if job.past.shape[0]:
        vector = index if kind >= TIMED else motion.inherited(job, by, bx, shape)[0]
        motion.note(job, by, bx, shape, 1 if kind >= TIMED else 0, vector)
    mark(job.blocks, by, bx, shape, leaf, kind, 0 if kind >= TIMED else index, mask, direction, coded)


@tuned_kernel
def _load_levels(job, work, plane, y0, x0, shape):
    """work.levels = the encoder's; return whether one is not zero."""
    (h, w), found = sides(shape), 0
    for y in range(h):
        for x in range(w):
            level = job.levels[plane, y0 + y, x0 + x]
            work.levels[y, x] = level
            if level:
                found = 1
    return found


@tuned_kernel
def _note_levels(job, work, plane, y0, x0, shape):
    """job.levels = those decoded, contexts of the planes that follow."""
    h, w = sides(shape)
    for y in range(h):
        for x in range(w):
            job.levels[plane, y0 + y, x0 + x] = work.levels[y, x]


@tuned_kernel
def note_skipped(blocks, by, bx, shape, skipped):
    """Note whether a block has no transform."""
    h, w = sides(shape)
    for y in range(by, by + (h >> 2)):
        for x in range(bx, bx + (w >> 2)):
            blocks[SKIPPED, y, x] = skipped


@tuned_kernel
def _clear(levels, shape):
    h, w = sides(shape)
    for y in range(h):
        for x in range(w):
            levels[y, x] = 0


@tuned_kernel
def _code_transform(coder, shape, kind):
    """Write or read the kind of transform of an intra block."""
    context = np.int64(at.TRANSFORM + (size_of(shape) - 2) * 3)
    if not code_bit(coder, context, 1 if kind else 0):
        return 0
    if code_bit(coder, context + 1, 1 if kind == SINE_DOWN + SINE_ACROSS else 0):
        return SINE_DOWN + SINE_ACROSS
    return SINE_ACROSS if code_bit(coder, context + 2, 1 if kind == SINE_ACROSS else 0) else SINE_DOWN


@part_kernel
def transform_cost(costs, shape, kind):
    """Bits that the kind of transform of an intra block would take."""
    context = at.TRANSFORM + (size_of(shape) - 2) * 3
    bits = bit_cost(costs, context, 1 if kind else 0)
    if kind:
        bits += bit_cost(costs, context + 1, 1 if kind == SINE_DOWN + SINE_ACROSS else 0)
    if 0 < kind < SINE_DOWN + SINE_ACROSS:
        bits += bit_cost(costs, context + 2, 1 if kind == SINE_ACROSS else 0)
    return bits


@tuned_kernel
def code_block(coder, job, work, y0, x0, shape, leaf):
    """Write a block that is marked, or read and decode one."""
    by, bx = y0 >> 2, x0 >> 2
    blocks = job.blocks
    decoding = coder.state[DECODING]
    kind, index = np.int64(blocks[KIND, by, bx]), np.int64(blocks[INDEX, by, bx])
    mask, direction = np.int64(blocks[MASK, by, bx]), np.int64(blocks[DIRECTION, by, bx])
    if kind >= TIMED:
        index = motion.noted(job, job.at, by, bx)
    kind, index, mask, direction = code_kind(coder, job, by, bx, shape, kind, index, mask, direction)
    if decoding:
        _predict(job, work, y0, x0, shape, kind, index, mask, direction)
    coded = _code_residual(coder, job, by, bx, shape, kind, direction, np.int64(blocks[CODED, by, bx]))
    first = skipped = 0
    if coded and job.skipping and shape[0] + shape[1] <= LARGEST_SKIPPED:
        skipped = code_bit(coder, skipped_context(job, by, bx, shape), np.int64(blocks[SKIPPED, by, bx]) & 1)
    if coded and job.directed and kind == INTRA and not skipped:
        skipped = 2 * _code_transform(coder, shape, np.int64(blocks[SKIPPED, by, bx]) >> 1)
    for p in range(3):
        some = cross = 0
        if coded:
            some, cross = _code_plane(coder, job, work, y0, x0, shape, p, kind, first, skipped, direction)
            if p == 0:
                first = some
        if decoding:
            if some or cross:
                rows, cols = rebuild(
                    work, work.levels, shape, job.step, some, cross, job.crossed, skipped, job.dependent
                )
                if p == 0:
                    keep_first(work, rows, cols)
            store(job, work, p, y0, x0, shape, some or cross)
    if decoding:
        mark_block(job, by, bx, shape, leaf, kind, index, mask, direction, coded)
        note_skipped(blocks, by, bx, shape, skipped)


@stage_kernel
def _predict(job, work, y0, x0, shape, kind, index, mask, direction):
    """work.predicted = the prediction of a block."""
    if kind == SYNTHESIS:
        predict_synthesis(job, work, y0, x0, shape)
    elif kind == EXPLICIT:
        predict_explicit(job, work, y0, x0, shape, index, mask)
    elif kind >= TIMED:
        motion.predict_in_time(job, work, y0, x0, shape, index, kind == MIXED)
    else:
        for p in range(3):
            predict_direction(job, work, p, y0, x0, shape, direction)


@stage_kernel
def _code_plane(coder, job, work, y0, x0, shape, p, kind, first, skipped, direction):
    """Write or read the residual of a plane; return whether there are levels, and the factor of `cross`."""
    decoding = coder.state[DECODING]
    some = cross = 0
    if p and first and job.crossed:
        cross = code_cross(coder, p, size_of(shape), np.int64(job.blocks[CROSS_1 + p - 1, y0 >> 2, x0 >> 2]))
    if not decoding:
        some = _load_levels(job, work, p, y0, x0, shape)
    some = code_bit(coder, coded_context(p, shape, kind, first, skipped), some)
    if some and decoding:
        _clear(work.levels, shape)
    if some and skipped == 1:
        code_samples(coder, work.levels, job.levels, y0, x0, p, shape)
        if decoding:
            _note_levels(job, work, p, y0, x0, shape)
    elif some:
        turn = turn_class(direction) if kind == INTRA else 0
        intra, ways = 1 if kind == INTRA else 0, (job.finer, job.dependent)
        code_coefficients(coder, work.levels, p, shape, intra, ways, job.levels, (y0, x0), turn)
        if decoding and coder.state[REFINED]:
            _note_levels(job, work, p, y0, x0, shape)
    return some, cross


@tuned_kernel
def part_ways(job, shape, depth):
    """Ways to halve a block: 1 into an upper and a lower half, 2 into a left and a right one, 3 both, 0 none."""
    if depth >= job.parted:
        return 0
    return (1 if shape[0] > LOG_LEAST else 0) + (2 if shape[1] > LOG_LEAST else 0)


@tuned_kernel
def part_context(job, by, bx, shape):
    """By area, and how many of the blocks above and left are narrower and lower."""
    blocks = job.blocks
    count = 0
    if by > 0 and blocks[WIDE, by - 1, bx] < shape[1]:
        count += 1
    if bx > 0 and blocks[TALL, by, bx - 1] < shape[0]:
        count += 1
    return at.PARTED + (6 if job.references.shape[0] else 0) * 3 + (shape[0] + shape[1] - 5) * 3 + count


@tuned_kernel
def across_context(job, by, bx, shape):
    """Of halves beside each other: by form, and whether the block above is narrower, or the one left lower."""
    blocks = job.blocks
    narrow = 1 if by > 0 and blocks[WIDE, by - 1, bx] < shape[1] else 0
    low = 1 if bx > 0 and blocks[TALL, by, bx - 1] < shape[0] else 0
    form = 0 if shape[0] == shape[1] else (1 if shape[0] < shape[1] else 2)
    return at.ACROSS + form * 3 + (1 + narrow - low)


@tuned_kernel
def code_way(coder, job, by, bx, shape, ways, way):
    """Write or read how a block is halved: 0 for not."""
    if not ways or not code_bit(coder, part_context(job, by, bx, shape), 1 if way else 0):
        return 0
    if ways < 3:
        return ways
    return 1 + code_bit(coder, across_context(job, by, bx, shape), 1 if way == 2 else 0)


@part_kernel
def way_cost(costs, job, by, bx, shape, ways, way):
    """Bits that `code_way` would take."""
    if not ways:
        return np.float32(0)
    bits = bit_cost(costs, part_context(job, by, bx, shape), 1 if way else 0)
    if way and ways == 3:
        bits += bit_cost(costs, across_context(job, by, bx, shape), 1 if way == 2 else 0)
    return bits


@stage_kernel
def halved(shape, way):
    """Shape of the halves."""
    return (shape[0] - 1, shape[1]) if way == 1 else (shape[0], shape[1] - 1)


@array_kernel
def code_parts(coder, job, work, y0, x0, shape, leaf, depth):
    """Write or read the blocks of a square that is not split; ``leaf`` is its size and how it was parted."""
    by, bx = y0 >> 2, x0 >> 2
    ways = part_ways(job, shape, depth)
    way = code_way(coder, job, by, bx, shape, ways, (np.int64(job.blocks[PARTS, by, bx]) >> (2 * depth)) & 3)
    if way == 0:
        code_block(coder, job, work, y0, x0, shape, leaf)
    else:
        half = halved(shape, way)
        h, w = sides(half)
        leaf = leaf[0], leaf[1] + (way << (2 * depth))
        for part in range(2):
            down, across = (part * h, 0) if way == 1 else (0, part * w)
            code_parts(coder, job, work, y0 + down, x0 + across, half, leaf, depth + 1)


@array_kernel
def code_tree(coder, job, work, y0, x0, log):
    """Write or read the blocks of a square; parts beyond the view have none."""
    height, width = job.levels.shape[1:]
    if y0 >= height or x0 >= width:
        return
    n, by, bx = 1 << log, y0 >> 2, x0 >> 2
    if y0 + n > height or x0 + n > width:
        split = 1
    elif log > LOG_LEAST:
        smaller = 1 if job.blocks[LOG, by, bx] < log else 0
        split = code_bit(coder, split_context(job, by, bx, log), smaller)
    else:
        split = 0
    if split:
        half = n >> 1
        for part in range(4):
            code_tree(coder, job, work, y0 + (part >> 1) * half, x0 + (part & 1) * half, log - 1)
    else:
        code_parts(coder, job, work, y0, x0, (log, log), (log, np.int64(0)), np.int64(0))


@array_kernel
def code_blend(coder, nearest):
    """Write or read how a synthesised view is blended."""
    return code_bit(coder, np.int64(at.BLEND), nearest)


def code_view(coder: Arithmetic, job: Job, work: Work) -> None:
    """Write all blocks of a view, which are marked, or read and decode them."""
    height, width = job.levels.shape[1:]
    size = 1 << LOG_LARGEST
    for y0 in range(0, height, size):
        for x0 in range(0, width, size):
            code_tree(coder, job, work, y0, x0, LOG_LARGEST)


assert MODES == 36  # `_code_direction` counts on 34 directions
