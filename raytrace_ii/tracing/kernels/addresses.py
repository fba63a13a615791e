"""Calls by address: functions of Embree, and stages that are compiled only for scenes that need them.

Addresses are arguments of kernels, so that nothing of one process is kept in numba's cache.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from ii_core.base import jit


def _call(typing: Any, address: Any, a: Any, b: Any, c: Any, d: Any) -> Any:
    """Call ``void f(a, b, c, d)``, four words, at an address; a function of three does not read the fourth."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        pointer = ir.IntType(8).as_pointer()
        function = ir.FunctionType(ir.VoidType(), [pointer] * 4).as_pointer()
        builder.call(builder.inttoptr(values[0], function), [builder.inttoptr(v, pointer) for v in values[1:]])
        return context.get_dummy_value()

    return types.void(*[types.intp] * 5), generate


def _address_of(typing: Any, value: Any) -> Any:
    """Address of a copy of a named tuple, valid until the kernel returns."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        data = context.data_model_manager[value].as_data(builder, values[0])
        place = cgutils.alloca_once(builder, data.type)  # not within a loop: the place is on the stack
        builder.store(data, place)
        return builder.ptrtoint(place, context.get_value_type(types.intp))

    return types.intp(value), generate


def _value_at(typing: Any, pointer: Any) -> Any:
    """The named tuple that a pointer leads to; what of it is not used is not read."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return context.data_model_manager[pointer.dtype].from_data(builder, _loaded(builder, values[0]))

    return pointer.dtype(pointer), generate


def _loaded(builder: Any, place: Any) -> Any:
    """Load a structure number by number: LLVM reads whole structures that are loaded as one."""
    kind = place.type.pointee
    if not isinstance(kind, ir.LiteralStructType | ir.IdentifiedStructType | ir.ArrayType):
        return builder.load(place)
    value: Any = ir.Constant(kind, ir.Undefined)
    for i in range(kind.count if isinstance(kind, ir.ArrayType) else len(kind.elements)):
        value = builder.insert_value(value, _loaded(builder, cgutils.gep_inbounds(builder, place, 0, i)), i)
    return value


def _ticks(typing: Any) -> Any:
    """A clock of the CPU that a thread reads without a call of the system, of any rate; 0 if there is none."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        triple = builder.module.triple
        if triple.startswith(("x86", "i686", "amd64")):
            return builder.call(builder.module.declare_intrinsic("llvm.readcyclecounter", fnty=_CLOCK), [])
        if triple.startswith(("aarch64", "arm64")):
            return builder.asm(_CLOCK, "mrs $0, cntvct_el0", "=r", [], side_effect=True)
        return ir.Constant(ir.IntType(64), 0)

    return types.int64(), generate


_CLOCK = ir.FunctionType(ir.IntType(64), [])
ticks: Any = intrinsic(_ticks)
call: Any = intrinsic(_call)
address_of: Any = intrinsic(_address_of)
value_at: Any = intrinsic(_value_at)


def addresses(stages: Collection[Any], generation: tuple[Any, ...]) -> dict[Any, int]:
    """Return the addresses of stages, late kernels, for a generation like this; compile them on first use."""
    shape = _shape(generation)
    if any((stage, shape) not in _known for stage in stages):
        arguments = types.CPointer(numba.typeof(generation)), types.intp, types.intp, types.intp
        _known.update({(stage, shape): jit.address(stage, arguments) for stage in stages})
    return {stage: _known[stage, shape] for stage in stages}


_known: dict[Any, int] = {}  # numba's own look takes 3 ms, as long as 10 000 rays


def _shape(value: Any) -> Any:
    """Return what numba tells the types of a value by, as a key."""
    if isinstance(value, np.ndarray):
        return value.dtype.char, value.ndim, value.flags.num
    return (type(value), *map(_shape, value)) if isinstance(value, tuple) else type(value)
