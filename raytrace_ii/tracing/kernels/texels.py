"""Weighted sums of four texels, the channels of a texel at once."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload

_CHANNELS = tuple(map(np.uint64, range(3)))


def mixed(pixels: Any, places: Any, weights: Any) -> Any:
    """Sums of red, green and blue of four texels of float32.

    ``places`` are of the first channels; a number that follows the last texel is read and not used.
    """
    a, b, c, d = places
    w00, w10, w01, w11 = weights
    red, green, blue = (
        w00 * pixels[a + k] + w10 * pixels[b + k] + w01 * pixels[c + k] + w11 * pixels[d + k] for k in _CHANNELS
    )
    return red, green, blue


def _mixed(typing: Any, pixels: Any, places: Any, weights: Any) -> Any:
    """One load, one conversion and one product a texel: LLVM makes none of them from single channels."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        four = ir.VectorType(ir.FloatType(), 4)
        lane = ir.IntType(32)
        data = context.make_array(pixels)(context, builder, values[0]).data
        total = None
        for k in range(4):
            texel = builder.bitcast(builder.gep(data, [builder.extract_value(values[1], k)]), four.as_pointer())
            colours = builder.fpext(builder.load(texel, align=4), ir.VectorType(ir.DoubleType(), 4))
            weight = builder.insert_element(
                ir.Constant(colours.type, ir.Undefined), builder.extract_value(values[2], k), lane(0)
            )
            weight = builder.shuffle_vector(weight, weight, ir.Constant(ir.VectorType(lane, 4), [0] * 4))
            product = builder.fmul(weight, colours, flags=("contract",))
            total = product if total is None else builder.fadd(total, product, flags=("contract",))
        return context.make_tuple(
            builder, signature.return_type, [builder.extract_element(total, lane(k)) for k in range(3)]
        )

    return types.UniTuple(types.float64, 3)(pixels, places, weights), generate


_mixed_vectors: Any = intrinsic(_mixed)


@overload(mixed, inline="always")
def _compiled(pixels: Any, places: Any, weights: Any) -> Any:
    def compiled(pixels: Any, places: Any, weights: Any) -> Any:
        return _mixed_vectors(pixels, places, weights)

    return compiled
