"""Weighted sums of four texels, the channels of a texel at once."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types

from .lanes import compiled_by


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
