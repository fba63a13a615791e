"""Blocks of a view: a quadtree from 32 to 4 samples, three kinds of prediction, and a residual.

A block is predicted by *synthesis* (the picture the decoder makes of other views by itself, `synthesis`), by an
*explicit* disparity between the view and up to four others, or from its surroundings (`intra`). In takes it may also
be predicted *in time* (`motion`), or by the mean of that and synthesis (*mixed*).
"""

from __future__ import annotations

import numpy as np

from ii_core.base.jit import array_kernel, part_kernel, stage_kernel

from . import contexts as at
from . import motion
from .arithmetic import DECODING, REFINED, Arithmetic, bit_cost, code_bit, code_of_four
from .coefficients import code_coefficients
from .cross import code_cross, code_following, keep_first, predict_following, rebuild
from .intra import SMOOTH, coarse, fill_border, predict_intra, turn_class
from .kinds import code_kind
from .modes import mode_class
from .samples import LARGEST_SKIPPED, code_samples
from .signs import code_signs
from .state import (
    CODED,
    CROSS_1,
    DIRECTION,
    DONE,
    EXPLICIT,
    FOLLOWS,
    INDEX,
    INTRA,
    KIND,
    LIMIT,
    LOG,
    MASK,
    MIXED,
    PARTS,
    SKIPPED,
    SYNTHESIS,
    TALL,
    TIMED,
    WIDE,
    Job,
    Work,
    around_block,
    doubt_class,
    neighbours,
)
from .transform import SINE_ACROSS, SINE_DOWN, sides, size_of
from .warp import led, moved_block

LOG_LARGEST, LOG_LEAST = 5, 2
MOST_HALVINGS = 2, 3  # of a square; from version 14 on
MOST_INDEX = 1 << 14


@part_kernel
def split_context(job, by, bx, log):
    """By how many of the blocks above and left are smaller, and doubt."""
    blocks = job.blocks
    count = 0
    if by > 0 and blocks[LOG, by - 1, bx] < log:
        count += 1
    if bx > 0 and blocks[LOG, by, bx - 1] < log:
        count += 1
    return at.SPLIT + ((log - 3) * 3 + count) * 4 + doubt_class(job, by, bx, (log, log))


@part_kernel
def residual_context(job, by, bx, shape, kind):
    """By size, kind, how many of the blocks above and left have a residual, and doubt."""
    other = 0 if kind == SYNTHESIS else 1
    like = neighbours(job.blocks, np.int64(CODED), np.int64(1), by, bx)
    if kind >= TIMED:
        return at.RESIDUAL_IN_TIME + ((size_of(shape) - 2) * 2 + (1 if kind == MIXED else 0)) * 3 + like
    return at.RESIDUAL + (((size_of(shape) - 2) * 2 + other) * 3 + like) * 4 + doubt_class(job, by, bx, shape)


@part_kernel
def coded_context(plane, shape, kind, first, skipped):
    """By plane, size, kind, whether the first plane has a residual, and whether the transform is skipped."""
    if skipped == 1:
        return at.SAMPLE_CODED + (plane * 2 + size_of(shape) - 2) * 2 + first
    return at.CODED + ((plane * 4 + size_of(shape) - 2) * 2 + (1 if kind == INTRA else 0)) * 2 + first


@part_kernel
def skipped_context(job, by, bx, shape):
    """By size, and how many of the blocks above and left have no transform."""
    return at.SKIPPED + (size_of(shape) - 2) * 3 + neighbours(job.blocks, np.int64(SKIPPED), np.int64(1), by, bx)


@part_kernel
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
        mode = 6 * mode_class(coarse(direction))
        mode += (1 if first == direction else 0) + (1 if second == direction else 0)
        mode += (1 if corner == direction else 0) + (1 if above == direction else 0) + (1 if left == direction else 0)
    corner, above, left = around_block(blocks, CODED, by, bx, shape, np.int64(0))
    near = neighbours(blocks, np.int64(CODED), np.int64(1), by, bx) + corner + above + left
    moded, near = at.RESIDUAL_MODE + kind * 30 + mode, at.RESIDUAL_NEAR + kind * 6 + near
    formed = at.RESIDUAL_FORM + ((shape[0] - 2) * 4 + shape[1] - 2) * 2 + (1 if kind == INTRA else 0)
    return code_of_four(coder, context, moded, near, formed, at.MODE_WEIGHTS + 10, coded)


@part_kernel
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


@part_kernel
def predict_synthesis(job, work, y0, x0, shape):
    """work.predicted = the synthesised view."""
    h, w = sides(shape)
    for p in range(3):
        for y in range(h):
            for x in range(w):
                work.predicted[p, y, x] = job.made[p, y0 + y, x0 + x]


@part_kernel
def predict_direction(job, work, plane, y0, x0, shape, direction):
    """work.predicted[plane] from the block's surroundings."""
    fill_border(job.views, job.at, plane, job.blocks, np.int64(DONE), y0, x0, shape, work.border, job.directed)
    predict_intra(work.border, direction, shape, work.predicted, plane, job.directed)


@part_kernel
def store(job, work, plane, y0, x0, shape, residual):
    """Decoded samples: the prediction, and work.block if there is a residual."""
    h, w = sides(shape)
    for y in range(h):
        for x in range(w):
            value = work.predicted[plane, y, x]
            if residual:
                value = min(max(np.int32(value + work.block[y, x]), -LIMIT), LIMIT)
            job.views[job.at, plane, y0 + y, x0 + x] = value


@part_kernel
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


@part_kernel
def mark_block(job, by, bx, shape, leaf, kind, index, mask, direction, coded):
    """Note a block as decoded, and its vector if there are earlier instants."""
    if job.past.shape[0]:
        vector = index if kind >= TIMED else motion.inherited(job, by, bx, shape)[0]
        motion.note(job, by, bx, shape, 1 if kind >= TIMED else 0, vector)
    mark(job.blocks, by, bx, shape, leaf, kind, 0 if kind >= TIMED else index, mask, direction, coded)


@part_kernel
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


@part_kernel
def _note_levels(job, work, plane, y0, x0, shape):
    """job.levels = those decoded, contexts of the planes that follow."""
    h, w = sides(shape)
    for y in range(h):
        for x in range(w):
            job.levels[plane, y0 + y, x0 + x] = work.levels[y, x]


@part_kernel
def note_skipped(blocks, by, bx, shape, skipped, follows):
    """Note whether a block has no transform, and whether its colours follow the first plane."""
    h, w = sides(shape)
    for y in range(by, by + (h >> 2)):
        for x in range(bx, bx + (w >> 2)):
            blocks[SKIPPED, y, x], blocks[FOLLOWS, y, x] = skipped, follows


@part_kernel
def _clear(levels, shape):
    h, w = sides(shape)
    for y in range(h):
        for x in range(w):
            levels[y, x] = 0


@part_kernel
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


@part_kernel
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
    first = skipped = follows = 0
    if coded and job.guided and job.crossed and kind == INTRA:
        follows = code_following(coder, job, by, bx, shape, direction, np.int64(blocks[FOLLOWS, by, bx]))
    if coded and job.skipping and shape[0] + shape[1] <= LARGEST_SKIPPED:
        skipped = code_bit(coder, skipped_context(job, by, bx, shape), np.int64(blocks[SKIPPED, by, bx]) & 1)
    if coded and job.directed and kind == INTRA and not skipped:
        skipped = 2 * _code_transform(coder, shape, np.int64(blocks[SKIPPED, by, bx]) >> 1)
    for p in range(3):
        some = cross = 0
        if decoding and follows and p:
            predict_following(job, job.views[job.at, 0, y0:, x0:], work, p, y0, x0, shape)
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
        note_skipped(blocks, by, bx, shape, skipped, follows)
    else:
        _note_done(blocks, by, bx, shape)


@stage_kernel
def _note_done(blocks, by, bx, shape):
    h, w = sides(shape)
    for y in range(by, by + (h >> 2)):
        for x in range(bx, bx + (w >> 2)):
            blocks[DONE, y, x] = 1


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
        guided = job.guided and intra and p == 0
        code_coefficients(coder, work.levels, p, shape, intra, ways, job.levels, (y0, x0), turn, 0 if guided else 1)
        if guided:
            if not decoding:
                predict_direction(job, work, 0, y0, x0, shape, direction)
            code_signs(coder, job, work, work.levels, y0, x0, shape, skipped >> 1)
        if decoding and coder.state[REFINED]:
            _note_levels(job, work, p, y0, x0, shape)
    return some, cross


@part_kernel
def part_ways(job, shape, depth):
    """Ways to halve a block: 1 into an upper and a lower half, 2 into a left and a right one, 3 both, 0 none."""
    if depth >= job.parted:
        return 0
    return (1 if shape[0] > LOG_LEAST else 0) + (2 if shape[1] > LOG_LEAST else 0)


@part_kernel
def part_context(job, by, bx, shape):
    """By area, and how many of the blocks above and left are narrower and lower."""
    blocks = job.blocks
    count = 0
    if by > 0 and blocks[WIDE, by - 1, bx] < shape[1]:
        count += 1
    if bx > 0 and blocks[TALL, by, bx - 1] < shape[0]:
        count += 1
    return at.PARTED + (6 if job.references.shape[0] else 0) * 3 + (shape[0] + shape[1] - 5) * 3 + count


@part_kernel
def across_context(job, by, bx, shape):
    """Of halves beside each other: by form, and whether the block above is narrower, or the one left lower."""
    blocks = job.blocks
    narrow = 1 if by > 0 and blocks[WIDE, by - 1, bx] < shape[1] else 0
    low = 1 if bx > 0 and blocks[TALL, by, bx - 1] < shape[0] else 0
    form = 0 if shape[0] == shape[1] else (1 if shape[0] < shape[1] else 2)
    return at.ACROSS + form * 3 + (1 + narrow - low)


@part_kernel
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


@part_kernel
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
    job.blocks[DONE] = 0  # an encoder predicts once more, as the decoder does
    for y0 in range(0, height, size):
        for x0 in range(0, width, size):
            code_tree(coder, job, work, y0, x0, LOG_LARGEST)
