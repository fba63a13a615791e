"""Ray packets of Embree: filled with rays, intersected, and read back as hits.

The addresses of Embree's functions are arguments, because an address is valid in one process only and numba's cache
outlives it. A packet is a matrix of 32-bit numbers: rows are the quantities of `RTCRayN` and `RTCHitN`, columns are
rays (`rtcore_ray.h`, Embree 4).

The position of a hit in its face is computed again in float64. Embree's u and v differ between instruction sets by up
to 4e-4; values from ray and face alone are equal for packets, single rays and all CPUs.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ii_core.base.jit import exact_kernel as kernel
from ii_core.base.jit import exact_lane_stage as stage_kernel
from ii_core.base.jit import lane_kernel, part_kernel

from . import lanes as at
from .addresses import call
from .lanes import BLOCK, NO_END
from .vectors import three_of_row

# Rows of a packet.
_NEAR, DIRECTION, _TIME, FAR, MASK, _FLAGS, U, V, FACE, GEOMETRY, INSTANCE = 3, 4, 7, 8, 9, 11, 15, 16, 17, 18, 19
PACKET_ROWS = 21  # the last one is `instPrimID`
_LONE = 2  # state of a ray without a group
# A packet whose rays spread too far is parted into groups of at least half of its rays, which are apart from their
# first by at most this share of the most spread. After so many rays without a group all others are traced at once
# without coherence, which costs less than single rays (all scenes, scales 1–32 of setup1, 2026-11-23).
_TIGHT, _MOST_LONE = np.float32(0.25), 2


class Calls(NamedTuple):
    """What Embree is called with: addresses of a function, tree, arguments and room; and the most spread of a packet.

    ``near`` bounds the sum of the sides of the box around the origins, ``narrow`` that of the directions as a share
    of the first one's.
    """

    packet: int
    tree: int
    coherent: int
    incoherent: int
    active: int
    room: int
    near: np.float32
    narrow: np.float32


NO_CALLS = Calls(0, 0, 0, 0, 0, 0, np.float32(0), np.float32(0))


class Tools(NamedTuple):
    """Embree's calls for a packet in lanes: nearest hit, whether anything stops a ray, and which lanes are traced.

    The address of a function is 0 if Embree cannot be called so, or if nothing stops any ray. ``clear`` is whether
    a ray meets a face that lets light through.
    """

    nearest: Calls
    occluded: Calls
    clear: Calls
    active: NDArray[np.int32]
    chosen: NDArray[np.int32]


@stage_kernel
def place_hit(ox, oy, oz, dx, dy, dz, x, y, z, x1, y1, z1, x2, y2, z2):
    """u, v and distance where a ray meets the plane of a face of three corners (Möller, Trumbore 1997).

    u and v are kept within the face: Embree's robust rays hit edges from just beside them. The last value is False
    if the ray lies in the plane.
    """
    x, y, z = np.float64(x), np.float64(y), np.float64(z)
    ax, ay, az, bx, by, bz = x1 - x, y1 - y, z1 - z, x2 - x, y2 - y, z2 - z
    dx, dy, dz = np.float64(dx), np.float64(dy), np.float64(dz)
    x, y, z = ox - x, oy - y, oz - z
    px, py, pz = dy * bz - dz * by, dz * bx - dx * bz, dx * by - dy * bx
    qx, qy, qz = y * az - z * ay, z * ax - x * az, x * ay - y * ax
    turn = ax * px + ay * py + az * pz
    inverse = 1.0 / (turn if turn != 0.0 else 1.0)
    u = max((x * px + y * py + z * pz) * inverse, 0.0)
    v = max((dx * qx + dy * qy + dz * qz) * inverse, 0.0)
    within = 1.0 / max(u + v, 1.0)
    return u * within, v * within, max((bx * qx + by * qy + bz * qz) * inverse, 0.0), turn != 0.0


@kernel
def place_hits(origins, directions, corners, primitives, u, v, distances):
    """Replace u, v and distance of every hit by those of `place_hit`, but for rays in the plane of their face."""
    for i in range(primitives.shape[0]):
        f = primitives[i]
        if f < 0:
            continue
        a, b, t, sure = place_hit(
            origins[i, 0], origins[i, 1], origins[i, 2], directions[i, 0], directions[i, 1], directions[i, 2],
            corners[f, 0, 0], corners[f, 0, 1], corners[f, 0, 2],
            corners[f, 1, 0], corners[f, 1, 1], corners[f, 1, 2],
            corners[f, 2, 0], corners[f, 2, 1], corners[f, 2, 2],
        )  # fmt: skip
        if sure:
            u[i], v[i], distances[i] = a, b, t


@stage_kernel
def _begin(packet, numbers, width):
    """Set what stays the same from packet to packet: nearest distance, time, mask, flags, instance."""
    for lane in range(width):
        packet[_NEAR * width + lane] = np.float32(0)
        packet[_TIME * width + lane] = np.float32(0)
        numbers[MASK * width + lane] = -1
        numbers[_FLAGS * width + lane] = 0
        numbers[INSTANCE * width + lane] = -1


@stage_kernel
def _together(packet, calls, ahead, width):
    """Whether rays are near enough to the first for coherent tracing, at their origins and ``ahead`` of them."""
    x, y, z = packet[0], packet[width], packet[2 * width]
    dx, dy, dz = packet[DIRECTION * width], packet[(DIRECTION + 1) * width], packet[(DIRECTION + 2) * width]
    narrow, apart = calls.narrow * (abs(dx) + abs(dy) + abs(dz)), 0
    for lane in range(width):
        away = abs(packet[lane] - x) + abs(packet[width + lane] - y) + abs(packet[2 * width + lane] - z)
        turned = (
            abs(packet[4 * width + lane] - dx)
            + abs(packet[5 * width + lane] - dy)
            + abs(packet[6 * width + lane] - dz)
        )
        apart += (away + turned * ahead > calls.near) | (turned > narrow)
    return apart == 0


@stage_kernel
def _choose(packet, active, chosen, calls, width):
    """Set as active those lanes of ``chosen`` 1 that are near the first one in place and direction.

    Returns
    -------
    active, first : int
        How many lanes are active, and the first one.
    """
    first = 0
    while chosen[first] != 1:
        first += 1
    x, y, z = packet[first], packet[width + first], packet[2 * width + first]
    dx, dy, dz = packet[4 * width + first], packet[5 * width + first], packet[6 * width + first]
    near, narrow = calls.near * _TIGHT, calls.narrow * _TIGHT * (abs(dx) + abs(dy) + abs(dz))
    count = 0
    for lane in range(width):
        away = abs(packet[lane] - x) + abs(packet[width + lane] - y) + abs(packet[2 * width + lane] - z)
        turned = (
            abs(packet[4 * width + lane] - dx)
            + abs(packet[5 * width + lane] - dy)
            + abs(packet[6 * width + lane] - dz)
        )
        together = (away <= near) & (turned <= narrow) & (chosen[lane] == 1)
        active[lane] = -1 if together else 0
        count += together
    return count, first


@stage_kernel
def _trace(calls, active, chosen, packet, ahead, lanes, width):
    """Trace the active lanes, so many, of a packet; one whose rays spread too far in groups of near lanes."""
    if _together(packet, calls, ahead, width):
        call(calls.packet, calls.active, calls.tree, calls.room, calls.coherent)
    else:
        _trace_groups(calls, active, chosen, packet, lanes, width)


@part_kernel
def _trace_groups(calls, active, chosen, packet, lanes, width):
    """Trace a packet whose rays spread too far: groups of near lanes coherently, and the other lanes."""
    for lane in range(width):
        chosen[lane] = active[lane] != 0
    left, lone = lanes, 0
    while left >= width // 2 and lone < _MOST_LONE:
        count, first = _choose(packet, active, chosen, calls, width)
        if count >= width // 2:
            call(calls.packet, calls.active, calls.tree, calls.room, calls.coherent)
            for lane in range(width):
                chosen[lane] = 0 if active[lane] != 0 else chosen[lane]
            left -= count
        else:
            chosen[first] = _LONE
            lone += 1
            left -= 1
    rest = 0
    for lane in range(width):
        active[lane] = -1 if chosen[lane] != 0 else 0
        rest += chosen[lane] != 0
    if rest > 0:
        call(calls.packet, calls.active, calls.tree, calls.room, calls.incoherent)


@stage_kernel
def nearest_of_lanes(tools, first_of_same, ahead, lanes, work, width):
    """Find the faces that the rays in the lanes hit.

    Returns
    -------
    float
        Distance of the last hit, as of `_together`.
    """
    single, whole, room = work.single, work.whole, at.PACKET
    packet, numbers = single[room : room + PACKET_ROWS * width], work.bits[room : room + PACKET_ROWS * width]
    for first in range(0, BLOCK, width):
        some = min(lanes - first, width)
        if some <= 0:
            for lane in range(width):
                whole[at.FACE + first + lane] = -1
            continue
        _begin(packet, numbers, width)
        for c in range(3):
            for lane in range(width):
                packet[c * width + lane] = single[at.START + c * BLOCK + first + lane]
                packet[(DIRECTION + c) * width + lane] = single[at.DX + c * BLOCK + first + lane]
        for lane in range(width):
            packet[FAR * width + lane] = single[at.END + first + lane]
        for lane in range(width):
            numbers[GEOMETRY * width + lane] = -1
            tools.active[lane] = -1 if lane < some else 0
        _trace(tools.nearest, tools.active, tools.chosen, packet, ahead, some, width)
        for lane in range(width):
            single[at.U + first + lane] = packet[U * width + lane]
            single[at.V + first + lane] = packet[V * width + lane]
            single[at.DISTANCE + first + lane] = packet[FAR * width + lane]
        for lane in range(width):
            hit = numbers[GEOMETRY * width + lane] >= 0
            whole[at.FACE + first + lane] = np.int64(numbers[FACE * width + lane]) if hit else -1
        if first_of_same.shape[0] > 0:
            for k in range(first, first + width):
                if whole[at.FACE + k] >= 0:
                    whole[at.FACE + k] = first_of_same[np.uint64(whole[at.FACE + k])]
        ahead = packet[FAR * width] if numbers[GEOMETRY * width] >= 0 else ahead
    return ahead


@stage_kernel
def occluded_of_lanes(tools, calls, work, width):
    """Take those shadow rays in the lanes out of ``WANTED`` that meet a face."""
    single, room = work.single, at.PACKET
    packet, numbers = single[room : room + PACKET_ROWS * width], work.bits[room : room + PACKET_ROWS * width]
    for first in range(0, BLOCK, width):
        some, one = 0, first  # lanes that are off have the last active one's ray: they spread a packet no farther
        for k in range(first, first + width):
            on = single[at.WANTED + k] > 0
            some += on
            one = max(one, k if on else first)
        if some == 0:
            continue
        _begin(packet, numbers, width)
        for c in range(3):
            o, d = at.OX + c * BLOCK, at.LX + c * BLOCK
            a = at.AX + c * BLOCK
            place, way = single[o + one] + single[a + one], single[d + one]
            for lane in range(width):
                on = single[at.WANTED + first + lane] > 0  # all is read before it is chosen: for vectors
                own_place = single[o + first + lane] + single[a + first + lane]
                own_way = single[d + first + lane]
                packet[c * width + lane] = own_place if on else place
                packet[(DIRECTION + c) * width + lane] = own_way if on else way
        for lane in range(width):
            packet[FAR * width + lane] = single[at.REACH + first + lane]
        for lane in range(width):
            tools.active[lane] = -1 if single[at.WANTED + first + lane] > 0 else 0
        _trace(calls, tools.active, tools.chosen, packet, np.float32(0), some, width)
        for lane in range(width):
            free = packet[FAR * width + lane] >= 0
            single[at.WANTED + first + lane] = single[at.WANTED + first + lane] if free else np.float32(0)


@stage_kernel
def _take(first, lanes, origins, directions, reach, o, d, end, single):
    """Bring rays from arrays to quantities ``o``, ``d`` and ``end``; lanes to spare have the last one."""
    for k in range(BLOCK):
        i = np.uint64(first + min(k, lanes - 1))
        single[o + k], single[o + BLOCK + k], single[o + 2 * BLOCK + k] = three_of_row(origins, i)
        single[d + k], single[d + BLOCK + k], single[d + 2 * BLOCK + k] = three_of_row(directions, i)
        single[end + k] = reach[i] if reach.shape[0] > 0 else NO_END


@cache
def packet_kernels(width: int) -> tuple[Any, Any]:
    """The kernels for rays in arrays, in packets of so many: nearest hit, and whether anything is hit.

    u, v and distance are Embree's; of misses they mean nothing. A ``reach`` of no length is no end.
    """

    @lane_kernel
    def nearest(tools, work, origins, directions, reach, primitives, u, v, distances):
        n, wide, ahead = origins.shape[0], np.int64(width), np.float32(0)  # no literal: parts are compiled once
        single, whole = work.single, work.whole
        o, d, end = np.int64(at.START), np.int64(at.DX), np.int64(at.END)
        for first in range(0, n, BLOCK):
            lanes = min(BLOCK, n - first)
            _take(first, lanes, origins, directions, reach, o, d, end, single)
            ahead = nearest_of_lanes(tools, primitives[:0], ahead, lanes, work, wide)
            for k in range(lanes):
                i = np.uint64(first + k)
                primitives[i], u[i], v[i] = whole[at.FACE + k], single[at.U + k], single[at.V + k]
                distances[i] = single[at.DISTANCE + k]

    @lane_kernel
    def occluded(tools, work, origins, directions, reach, found):
        n, wide, single = origins.shape[0], np.int64(width), work.single
        o, d, end = np.int64(at.OX), np.int64(at.LX), np.int64(at.REACH)
        for first in range(0, n, BLOCK):
            lanes = min(BLOCK, n - first)
            _take(first, lanes, origins, directions, reach, o, d, end, single)
            for k in range(BLOCK):
                single[at.WANTED + k] = np.float32(1) if k < lanes else np.float32(0)
            occluded_of_lanes(tools, tools.occluded, work, wide)
            for k in range(lanes):
                found[first + k] = -1 if single[at.WANTED + k] > 0 else 0

    return nearest, occluded
