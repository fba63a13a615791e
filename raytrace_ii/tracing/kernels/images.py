"""Images read by all lanes of a packet, each over its own footprint."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types

from ii_core.base.colour import LINEAR
from ii_core.base.jit import compiled_by, lane_part, lane_stage

from . import lanes as at
from .lanes import BLOCK, bits_of, single_of, take_rows
from .tables import IMAGE_COLUMNS, LEVELS, REPEAT
from .textures import filter_taps, folded, texels_about

_LINEAR = LINEAR.astype(np.float32)
_ZERO, _HALF, _ONE = np.float32(0), np.float32(0.5), np.float32(1)
_3, _4 = np.uint64(3), np.uint64(4)


def _add_mixed(typing: Any, pixels: Any, places: Any, weights: Any, out: Any, at: Any) -> Any:
    """One load and one product a texel: LLVM makes none of them from single channels."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        four, lane = ir.VectorType(ir.FloatType(), 4), ir.IntType(32)
        data = context.make_array(pixels)(context, builder, values[0]).data
        target = context.make_array(out)(context, builder, values[3]).data
        place = builder.bitcast(builder.gep(target, [values[4]]), four.as_pointer())
        total = builder.load(place, align=4)
        for k in range(4):
            texel = builder.bitcast(builder.gep(data, [builder.extract_value(values[1], k)]), four.as_pointer())
            weight = builder.extract_value(values[2], k)
            weight = builder.insert_element(ir.Constant(four, ir.Undefined), weight, lane(0))
            weight = builder.shuffle_vector(weight, weight, ir.Constant(ir.VectorType(lane, 4), [0] * 4))
            product = builder.fmul(weight, builder.load(texel, align=4), flags=("contract",))
            total = builder.fadd(total, product, flags=("contract",))
        builder.store(total, place, align=4)
        return context.get_dummy_value()

    return types.void(pixels, places, weights, out, types.intp), generate


@compiled_by(_add_mixed)
def add_mixed(pixels: Any, places: Any, weights: Any, out: Any, at: Any) -> None:
    """Add the weighted sum of four texels of float32 to ``out[at:at + 3]``; ``out[at + 3]`` is changed, too.

    ``places`` are of the first channels; a number that follows the last texel is read.
    """
    for place, weight in zip(places, weights, strict=True):
        for c in range(4):
            out[at + c] += weight * pixels[int(place) + c]


@lane_part
def read_images(surfaces, work):
    """Colours of images over ellipses about (u, v) of two diameters: means of their pyramids (Williams 1983).

    Rows of the table of textures, −1 for none, are in ``IMAGE``, places in ``SU`` and ``SV``, diameters in ``AU`` to
    ``BV``; colours come to ``Q0`` to ``Q2``.
    """
    single = work.single
    for k in range(4 * BLOCK):
        single[at.QUAD + k] = _ZERO
    for tap in range(_choose_levels(surfaces.levels, work)):
        _find_places(np.float32(tap), single, work.double)
        for level in (0, at.FAR_LEVEL - at.NEAR_LEVEL):
            _find_texels(level, single)
            for k in range(BLOCK):
                if single[at.SHARE + k] * single[at.NEAR_LEVEL + level + k] > _ZERO:
                    _add_texels(k, single[at.NEAR_LEVEL + level + 5 * BLOCK + k] > _ZERO, surfaces.texels, single)
    for k in range(BLOCK):
        q = at.QUAD + 4 * k
        single[at.Q0 + k], single[at.Q1 + k], single[at.Q2 + k] = single[q], single[q + 1], single[q + 2]


@lane_stage
def _choose_levels(levels, work):
    """Choose taps and two levels of each lane's image; their parts of the colour stand before their sizes.

    Returns
    -------
    int
        The largest number of taps.
    """
    single, whole, image = work.single, work.whole, at.NEAR_LEVEL
    wide, none, rows = np.int64(IMAGE_COLUMNS), np.int64(0), np.int64(at.LEVEL_ROW)
    for k in range(BLOCK):
        whole[at.LEVEL_ROW + k] = max(whole[at.IMAGE + k], 0)
        single[at.SHARE + k] = _ONE if whole[at.IMAGE + k] >= 0 else _ZERO
    take_rows(levels, wide, none, whole, rows, single, np.int64(at.NEAR_LEVEL))
    for k in range(BLOCK):
        taps, level, bu, bv = filter_taps(
            single[image + 2 * BLOCK + k], single[image + 3 * BLOCK + k], single[image + LEVELS * BLOCK + k],
            single[at.AU + k], single[at.AV + k], single[at.BU + k], single[at.BV + k],
        )  # fmt: skip
        single[at.TAPS + k], single[at.WAY_U + k], single[at.WAY_V + k] = taps * single[at.SHARE + k], bu, bv
        single[at.REPEATS + k] = single[image + 6 * BLOCK + k]
        single[at.REPEATS + BLOCK + k] = single[image + 7 * BLOCK + k]
        single[at.LEVEL + k] = level
    most = _ZERO
    for k in range(BLOCK):
        most = max(most, single[at.TAPS + k])
        whole[at.LEVEL_ROW + k] += np.int64(single[at.LEVEL + k])
    take_rows(levels, wide, none, whole, rows, single, np.int64(at.NEAR_LEVEL))
    for k in range(BLOCK):
        whole[at.LEVEL_ROW + k] += 1 if single[at.LEVEL + k] > np.floor(single[at.LEVEL + k]) else 0
    take_rows(levels, wide, none, whole, rows, single, np.int64(at.FAR_LEVEL))
    for k in range(BLOCK):
        part = single[at.LEVEL + k] - np.floor(single[at.LEVEL + k])
        single[at.NEAR_LEVEL + k], single[at.FAR_LEVEL + k] = _ONE - part, part
    return int(most)


@lane_stage
def _find_places(tap, single, double):
    """Find the place of one tap of each lane in its image, and its share of the colour."""
    for k in range(BLOCK):
        taps = single[at.TAPS + k]
        share = _ONE / max(taps, _ONE)
        s = np.float64((tap + _HALF) * share - _HALF)
        single[at.X + k] = folded(double[at.SU + k] + s * single[at.WAY_U + k], single[at.REPEATS + k])
        single[at.Y + k] = 1.0 - folded(double[at.SV + k] + s * single[at.WAY_V + k], single[at.REPEATS + BLOCK + k])
        single[at.SHARE + k] = share if tap < taps else _ZERO


@lane_stage
def _find_texels(level, single):
    """Find the four texels about the places in one level, and their shares of the colour."""
    for k in range(BLOCK):
        c = at.NEAR_LEVEL + level + k
        width, first = single[c + 2 * BLOCK], bits_of(single[c + BLOCK])
        i0, i1, j0, j1, fx, fy = texels_about(
            single[at.X + k], single[at.Y + k], width, single[c + 3 * BLOCK],
            single[at.REPEATS + k] == REPEAT, single[at.REPEATS + BLOCK + k] == REPEAT,
        )  # fmt: skip
        share = single[at.SHARE + k] * single[c]
        above, below = first + np.int32(j0) * np.int32(width), first + np.int32(j1) * np.int32(width)
        single[at.TEXELS + k], single[at.TEXELS + BLOCK + k] = (
            single_of(np.int32(above + np.int32(i0))), single_of(np.int32(above + np.int32(i1))),
        )  # fmt: skip
        single[at.TEXELS + 2 * BLOCK + k], single[at.TEXELS + 3 * BLOCK + k] = (
            single_of(np.int32(below + np.int32(i0))), single_of(np.int32(below + np.int32(i1))),
        )  # fmt: skip
        left, right, upper, lower = _ONE - fx, fx, share * (_ONE - fy), share * fy
        single[at.SHARES + k], single[at.SHARES + BLOCK + k] = left * upper, right * upper
        single[at.SHARES + 2 * BLOCK + k], single[at.SHARES + 3 * BLOCK + k] = left * lower, right * lower


@lane_stage
def _add_texels(k, codes, texels, single):
    """Add one lane's four texels."""
    s, t, q = at.SHARES + k, at.TEXELS + k, at.QUAD + 4 * k
    weights = single[s], single[s + BLOCK], single[s + 2 * BLOCK], single[s + 3 * BLOCK]
    a, b, c, d = (
        np.uint64(bits_of(single[t])), np.uint64(bits_of(single[t + BLOCK])),
        np.uint64(bits_of(single[t + 2 * BLOCK])), np.uint64(bits_of(single[t + 3 * BLOCK])),
    )  # fmt: skip
    if codes:
        for channel in range(3):
            i = np.uint64(channel)
            single[q + channel] += (
                weights[0] * _LINEAR[texels[1][a * _4 + i]] + weights[1] * _LINEAR[texels[1][b * _4 + i]]
                + weights[2] * _LINEAR[texels[1][c * _4 + i]] + weights[3] * _LINEAR[texels[1][d * _4 + i]]
            )  # fmt: skip
    else:
        add_mixed(texels[0], (a * _3, b * _3, c * _3, d * _3), weights, single, q)
