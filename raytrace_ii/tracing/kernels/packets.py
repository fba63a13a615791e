"""Numba kernels that hand rays to Embree in packets and take their hits back.

The addresses of Embree's functions are arguments, so that nothing of one process is kept in numba's cache. A packet
is a matrix of 32-bit numbers: a row a quantity of `RTCRayN` and `RTCHitN`, a column a ray (`rtcore_ray.h`, Embree 4).
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from ii_core.jit import inline_kernel
from ii_core.jit import lean_kernel as kernel

# Rows of a packet.
_DIRECTION, _FAR, _MASK, _FLAGS, _U, _V, _FACE, _GEOMETRY, _INSTANCE = 4, 8, 9, 11, 15, 16, 17, 18, 19
PACKET_ROWS = 24  # the hit ends with `instPrimID`, row 20; the rest is room to spare
_NO_END = np.float32(1e37)


class Calls(NamedTuple):
    """What Embree is called with: addresses of functions, tree, arguments and room; and the most spread of a packet.

    ``near`` bounds the sum of the sides of the box around the origins, ``narrow`` that of the directions as a share
    of the first one's.
    """

    packet: int
    single: int
    tree: int
    coherent: int
    incoherent: int
    active: int
    room: int
    one: int
    near: np.float32
    narrow: np.float32


def _pointers_call(typing: Any, address: Any, a: Any, b: Any, c: Any, d: Any) -> Any:
    """Call ``void f(a, b, c, d)``, four pointers, at an address; a function of three does not read the fourth."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        pointer = ir.IntType(8).as_pointer()
        function = ir.FunctionType(ir.VoidType(), [pointer] * 4).as_pointer()
        builder.call(builder.inttoptr(values[0], function), [builder.inttoptr(v, pointer) for v in values[1:]])
        return context.get_dummy_value()

    return types.void(*[types.intp] * 5), generate


_call: Any = intrinsic(_pointers_call)


@inline_kernel
def _fill(packet, numbers, lane, o, d, i, far):
    for c in range(3):
        packet[c, lane] = o[i, c]
        packet[_DIRECTION + c, lane] = d[i, c]
    packet[3, lane] = np.float32(0)
    packet[7, lane] = np.float32(0)
    packet[_FAR, lane] = far
    numbers[_MASK, lane] = -1
    numbers[_FLAGS, lane] = 0
    numbers[_FACE, lane] = -1
    numbers[_GEOMETRY, lane] = -1
    numbers[_INSTANCE, lane] = -1


@inline_kernel
def _spread(packet, first, width):
    """Sum of the sides of the box around a quantity of three rows."""
    total = np.float32(0)
    for c in range(first, first + 3):
        low = high = packet[c, 0]
        for lane in range(1, width):
            low, high = min(low, packet[c, lane]), max(high, packet[c, lane])
        total += high - low
    return total


@inline_kernel
def _together(packet, calls, width):
    """Whether rays are near enough to each other for a packet."""
    length = abs(packet[_DIRECTION, 0]) + abs(packet[_DIRECTION + 1, 0]) + abs(packet[_DIRECTION + 2, 0])
    near, narrow = _spread(packet, 0, width), _spread(packet, _DIRECTION, width)
    return (near <= calls.near) & (narrow <= calls.narrow * length)


@cache
def packet_kernels(width: int) -> tuple[Any, Any]:
    """The kernels for packets of so many rays: nearest hit, and whether anything is hit.

    Rays go in groups of ``width`` in their order; a group that spreads too far is traced ray by ray.
    """

    @kernel
    def nearest(
        calls, active, packet, numbers, one, one_number, origins, directions, reach,
        primitives, u, v, distances,
    ):  # fmt: skip
        n = origins.shape[0]
        for first in range(0, n, width):
            lanes = min(width, n - first)
            for lane in range(width):
                i = first + min(lane, lanes - 1)
                active[lane] = -1 if lane < lanes else 0
                _fill(packet, numbers, lane, origins, directions, i, reach[i] if reach.shape[0] > 0 else _NO_END)
            if _together(packet, calls, width):
                _call(calls.packet, calls.active, calls.tree, calls.room, calls.coherent)
                for lane in range(lanes):
                    i = first + lane
                    primitives[i], distances[i] = numbers[_FACE, lane], packet[_FAR, lane]
                    u[i], v[i] = packet[_U, lane], packet[_V, lane]
            else:
                for i in range(first, first + lanes):
                    _fill(one, one_number, 0, origins, directions, i, reach[i] if reach.shape[0] > 0 else _NO_END)
                    _call(calls.single, calls.tree, calls.one, calls.incoherent, 0)
                    primitives[i], distances[i] = one_number[_FACE, 0], one[_FAR, 0]
                    u[i], v[i] = one[_U, 0], one[_V, 0]

    @kernel
    def occluded(
        calls, active, packet, numbers, one, one_number, origins, directions, reach, found
    ):  # fmt: skip
        n = origins.shape[0]
        for first in range(0, n, width):
            lanes = min(width, n - first)
            for lane in range(width):
                i = first + min(lane, lanes - 1)
                active[lane] = -1 if lane < lanes else 0
                _fill(packet, numbers, lane, origins, directions, i, reach[i])
            if _together(packet, calls, width):
                _call(calls.packet, calls.active, calls.tree, calls.room, calls.coherent)
                for lane in range(lanes):
                    found[first + lane] = 0 if packet[_FAR, lane] < 0 else -1
            else:
                for i in range(first, first + lanes):
                    _fill(one, one_number, 0, origins, directions, i, reach[i])
                    _call(calls.single, calls.tree, calls.one, calls.incoherent, 0)
                    found[i] = 0 if one[_FAR, 0] < 0 else -1

    return nearest, occluded
