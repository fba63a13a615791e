"""A learnt filter: what the decoded first plane of a photograph lacks of the original, as a network guesses it.

Its inputs are the differences of a sample from those around it, each limited, in parts of the quantiser's step, and
whether the sample lies at the border of a block, and in a block with a residual. Layers of rectified sums follow. The
`loop_filter` weighs the result by a tap. All numbers are integers below 2^24, which float32 holds exactly, so that
sums have no order. (Networks as filters of decoded pictures: Dai, Liu and Wu 2017.)
"""

from __future__ import annotations

from functools import cache
from importlib import resources
from typing import Any, NamedTuple

import numpy as np

from ii_core.base.jit import lane_kernel, lane_part, lane_stage
from ii_core.base.references import by_reference

from .state import CODED, TALL, WIDE
from .warp import clamped

CHANNELS, LAYERS = 24, 3  # of the layers between the first and the last one
AROUND, INPUTS = 2, 27  # samples to either side; their differences, two borders and a residual
REACH = LAYERS + 1  # rows and columns beyond the view of which layers are known
MARGIN = AROUND + REACH
MOST = np.float32(255)  # of a layer's result
LANES = 16  # of a vector
UNIT = 64  # of an input: 1 is a step, or true
SIZES = CHANNELS * INPUTS, 9 * LAYERS * CHANNELS**2, 9 * CHANNELS, (LAYERS + 1) * CHANNELS  # of arrays of weights


@by_reference
class Net(NamedTuple):
    """Weights: of the first layer and those between in 2^-8, of the last one in 2^-14."""

    first: Any  # (INPUTS / 9, CHANNELS, 9)
    between: Any  # (LAYERS, CHANNELS before, CHANNELS, 9)
    last: Any  # (CHANNELS, 4, 9): `_add_nine` makes four sums, of which the first counts
    biases: Any  # (LAYERS + 1, CHANNELS), in 2^-14


@cache
def net() -> Net:
    """The weights of `assets/learnt_filter.npy`, as `guess` takes them."""
    with resources.files("assets").joinpath("learnt_filter.npy").open("rb") as file:
        numbers = np.load(file).astype(np.float32)
    first, between, last, biases = np.split(numbers, np.cumsum(SIZES[:-1]))
    padded = np.zeros((CHANNELS, 4, 9), np.float32)
    padded[:, 0] = last.reshape(CHANNELS, 9)
    return Net(
        np.ascontiguousarray(first.reshape(CHANNELS, -1, 9).swapaxes(0, 1)),
        np.ascontiguousarray(between.reshape(LAYERS, CHANNELS, CHANNELS, 9).swapaxes(1, 2)),
        padded,
        biases.reshape(LAYERS + 1, CHANNELS),
    )


@lane_part
def _find_inputs(plane, blocks, y, step, inputs):
    """Set the inputs of row y, which may lie up to REACH beyond the view."""
    width = plane.shape[1] - 2 * MARGIN
    limit, unit = np.int32(step >> 3), np.float32((1 << 26) // step)
    own, k = plane[y + MARGIN], 0
    for dy in range(-AROUND, AROUND + 1):
        row = plane[y + MARGIN + dy]
        for dx in range(2 * AROUND + 1):
            if dy != 0 or dx != AROUND:
                into = inputs[k]
                for i in range(width + 2 * REACH):
                    x = np.uint64(i)
                    away = np.int32(np.int32(row[x + np.uint64(dx)]) - np.int32(own[x + np.uint64(AROUND)]))
                    away = min(max(away, np.int32(-limit)), limit)
                    into[x] = np.floor(np.float32(away) * unit * np.float32(2.0**-16))
                k += 1
    for j in range(width + 2 * REACH):
        inputs[k, j] = inputs[k + 1, j] = inputs[k + 2, j] = 0
    if 0 <= y < plane.shape[0] - 2 * MARGIN:
        for j in range(width):
            tall, wide = np.int64(1) << blocks[TALL, y >> 2, j >> 2], np.int64(1) << blocks[WIDE, y >> 2, j >> 2]
            inputs[k, j + REACH] = UNIT if j % wide == 0 or j % wide == wide - 1 else 0
            inputs[k + 1, j + REACH] = UNIT if y % tall == 0 or y % tall == tall - 1 else 0
            inputs[k + 2, j + REACH] = UNIT if blocks[CODED, y >> 2, j >> 2] else 0


@lane_stage
def _add_nine(of, a, b, c, d, e, f, g, h, j, first, second, third, fourth):
    """Add nine rows to four sums, by the nine weights of each: the rows are loaded once."""
    u0, u1, u2, u3, u4 = of[0, 0], of[0, 1], of[0, 2], of[0, 3], of[0, 4]
    u5, u6, u7, u8 = of[0, 5], of[0, 6], of[0, 7], of[0, 8]
    v0, v1, v2, v3, v4 = of[1, 0], of[1, 1], of[1, 2], of[1, 3], of[1, 4]
    v5, v6, v7, v8 = of[1, 5], of[1, 6], of[1, 7], of[1, 8]
    w0, w1, w2, w3, w4 = of[2, 0], of[2, 1], of[2, 2], of[2, 3], of[2, 4]
    w5, w6, w7, w8 = of[2, 5], of[2, 6], of[2, 7], of[2, 8]
    z0, z1, z2, z3, z4 = of[3, 0], of[3, 1], of[3, 2], of[3, 3], of[3, 4]
    z5, z6, z7, z8 = of[3, 5], of[3, 6], of[3, 7], of[3, 8]
    for i in range(len(first)):
        x = np.uint64(i)
        ax, bx, cx, dx, ex, fx, gx, hx, jx = a[x], b[x], c[x], d[x], e[x], f[x], g[x], h[x], j[x]
        first[x] += u0 * ax + u1 * bx + u2 * cx + u3 * dx + u4 * ex + u5 * fx + u6 * gx + u7 * hx + u8 * jx
        second[x] += v0 * ax + v1 * bx + v2 * cx + v3 * dx + v4 * ex + v5 * fx + v6 * gx + v7 * hx + v8 * jx
        third[x] += w0 * ax + w1 * bx + w2 * cx + w3 * dx + w4 * ex + w5 * fx + w6 * gx + w7 * hx + w8 * jx
        fourth[x] += z0 * ax + z1 * bx + z2 * cx + z3 * dx + z4 * ex + z5 * fx + z6 * gx + z7 * hx + z8 * jx


@lane_stage
def _set(total, value):
    for i in range(len(total)):
        total[np.uint64(i)] = value


@lane_stage
def _rectify(total, into):
    for i in range(len(total)):
        x = np.uint64(i)
        into[x] = min(max(np.floor(total[x] * np.float32(2.0**-8)), np.float32(0)), MOST)


@lane_stage
def _scale(total, step, into):
    """Twice the samples that a sum in 2^-20 of the quantiser's step is, of half a step at most."""
    for i in range(len(into)):
        x = np.uint64(i)
        part = min(max(np.floor(total[x] * np.float32(2.0**-7)), np.float32(-4096)), np.float32(4096))
        into[x] = np.int32(np.int32(np.int32(part) * step) + np.int32(1 << 15)) >> np.int32(16)


@lane_part
def _add_around(of, hidden, ring, first, second, third, fourth):
    """Add a channel's three rows, of which ring is the first, to four sums of its inner part."""
    last = hidden.shape[1]
    up, mid, low = hidden[ring % 3], hidden[(ring + 1) % 3], hidden[(ring + 2) % 3]
    _add_nine(
        of, up[: last - 2], up[1 : last - 1], up[2:], mid[: last - 2], mid[1 : last - 1], mid[2:], low[: last - 2],
        low[1 : last - 1], low[2:], first, second, third, fourth,
    )  # fmt: skip


@lane_kernel
def guess(views, view, blocks, step, weights, plane, inputs, hidden, sums, out):
    """out = twice what the first plane of a decoded view lacks of the original.

    Parameters
    ----------
    views : ndarray of int16, (J, 3, H, W)
    view : int
    blocks : ndarray of int16, (FIELDS, H / 4, W / 4)
    step : int
        Of the quantiser, in 2^-7 of an 8-bit code.
    weights : Net
    plane : ndarray of int16, (H + 2 MARGIN, W + 2 MARGIN)
        Memory, as all that follows.
    inputs : ndarray of float32, (INPUTS, W + 2 REACH or more)
    hidden : ndarray of float32, (LAYERS + 1, CHANNELS, 3, the same)
    sums : ndarray of float32, (4, the same)
    out : ndarray of int32, (H, W)
    """
    height, width = out.shape
    for y in range(height + 2 * MARGIN):
        row, into = views[view, 0, clamped(y - MARGIN, height)], plane[y]
        for x in range(width):
            into[x + MARGIN] = row[x]
        for x in range(MARGIN):
            into[x], into[width + MARGIN + x] = row[0], row[width - 1]
    one, two, three, four = sums[0][1:-1], sums[1][1:-1], sums[2][1:-1], sums[3][1:-1]
    for y in range(-REACH, height + REACH):
        ring = y + 3 * REACH
        _find_inputs(plane, blocks, y, step, inputs)
        for o in range(0, CHANNELS, 4):
            for k in range(4):
                _set(sums[k], weights.biases[0, o + k])
            for i in range(INPUTS // 9):
                nine = inputs[9 * i : 9 * i + 9]
                _add_nine(
                    weights.first[i][o : o + 4], nine[0], nine[1], nine[2], nine[3], nine[4], nine[5], nine[6],
                    nine[7], nine[8], sums[0], sums[1], sums[2], sums[3],
                )  # fmt: skip
            for k in range(4):
                _rectify(sums[k], hidden[0, o + k, ring % 3])
        for layer in range(1, LAYERS + 1):
            before, into = hidden[layer - 1], hidden[layer]
            for o in range(0, CHANNELS, 4):
                for k in range(4):
                    _set(sums[k], weights.biases[layer, o + k])
                for i in range(CHANNELS):
                    of = weights.between[layer - 1, i][o : o + 4]
                    _add_around(of, before[i], ring - layer - 1, one, two, three, four)
                for k in range(4):
                    _rectify(sums[k], into[o + k, (ring - layer) % 3])
        if y >= REACH:
            _set(one, np.float32(0))
            for i in range(CHANNELS):
                _add_around(weights.last[i], hidden[LAYERS, i], ring - LAYERS - 2, one, two, three, four)
            _scale(one[REACH - 1 :], np.int32(step), out[y - REACH])


def memory(height: int, width: int) -> tuple[Any, ...]:
    """Return memory for `guess`, whose inner loops take whole vectors."""
    row = -(-(width + 2 * REACH - 2) // LANES) * LANES + 2
    return (
        np.zeros((height + 2 * MARGIN, width + 2 * MARGIN), np.int16),
        np.zeros((INPUTS, row), np.float32),
        np.zeros((LAYERS + 1, CHANNELS, 3, row), np.float32),
        np.zeros((4, row), np.float32),
        np.zeros((height, width), np.int32),
    )
