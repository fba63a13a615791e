"""Work memory of one packet of rays: quantities by name, one lane per ray."""

from __future__ import annotations

from itertools import count
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numpy.typing import NDArray

from ii_core.base.jit import compiled_by, stage_kernel

BLOCK = 16  # rays that go from their start to their light together: what is kept of them stays in the first cache
LINE = 64  # bytes of a cache line
NO_END = np.float32(1e37)


class Work(NamedTuple):
    """Room for one packet: a quantity is ``BLOCK`` numbers from its offset on, a place, or lane, for each ray.

    Offsets are constants and loops run over all lanes, so that the compiler sees what is apart and makes vectors.
    ``bits`` is the memory of ``single`` as integers; ``double`` holds what noise needs.
    """

    single: NDArray[np.float32]
    bits: NDArray[np.int32]
    double: NDArray[np.float64]
    whole: NDArray[np.int64]


_offset = count(0, BLOCK)


def _offsets(many: int) -> tuple[int, ...]:
    return tuple(next(_offset) for _ in range(many))


# Ray, place in the face and distance; 1 where a ray hits and 0 where not.
START = next(_offset)
_offsets(2)
DX, DY, DZ, W0, W1, W2, U, V, DISTANCE, HIT = _offsets(10)  # weights: after fog, media and blending
# A row of the table of faces: corners, normal, lift, body; then normals and texture coordinates of the corners.
CORNER = next(_offset)
_offsets(8)
FACE_NORMAL = next(_offset)
_offsets(2)
LIFT, FACE_BODY, THIRD_0, THIRD_1, NORMAL = _offsets(5)
_offsets(8)
COORDINATE = next(_offset)
_offsets(5)
THIRD_2 = next(_offset)
PX, PY, PZ = _offsets(3)  # the hit, drawn to the middle of its face
GX, GY, GZ = _offsets(3)  # the face's normal on the ray's side
OX, OY, OZ = _offsets(3)  # where rays start that stay on that side
NX, NY, NZ = _offsets(3)  # normal of shading
AX, AY, AZ = _offsets(3)  # way up to the smooth surface
ENTERING, SMOOTH, WIDTH = _offsets(3)
F0, F1, F2 = _offsets(3)  # light of the fog before the hit
B0, B1, B2 = _offsets(3)  # weights of what is seen through a blended surface
AU, AV, BU, BV = _offsets(4)  # footprint over (u, v)
# The first columns of the material as they stand in its table: colours scattered, mirrored and given off, share
# scattered, strength and exponent of the highlight, least cosine at which it is seen, roughness, share of metal,
# whether there is more.
R0, R1, R2, K0, K1, K2, E0, E1, E2, SCATTERED, GLOSS, EXPONENT, HALF_FROM, ROUGH, METAL, EXTRA = _offsets(16)
CLEAR = next(_offset)  # share let through
T0, T1, T2 = _offsets(3)  # colour of the texture
LX, LY, LZ, COSINE, HALF, SHINE, CONE = _offsets(7)  # of the light at hand
C0, C1, C2, WANTED, LEFT = _offsets(5)  # what its shadow rays would let through, and 1 where there is one, or is left
L0, L1, L2 = _offsets(3)  # light that a ray brings
Q0, Q1, Q2 = _offsets(3)  # colours of images
QUAD = next(_offset)  # the same, four numbers a lane
_offsets(3)
# Of the images: place of a tap and its share; number of taps, way along them, level, how the image goes on across and
# down; four texels and their shares; rows of the table of levels, with their parts of the colour in place of a kind.
X, Y, SHARE, TAPS, WAY_U, WAY_V, LEVEL, REPEATS = _offsets(8)
_offsets(1)
SHARES = next(_offset)
_offsets(3)
TEXELS = next(_offset)
_offsets(3)
NEAR_LEVEL = next(_offset)
_offsets(15)
FAR_LEVEL = next(_offset)
_offsets(15)
PACKET = next(_offset)  # Embree's rays, see packets.py
_offsets(20)
END, REACH = _offsets(2)  # how far rays reach, and those to the light at hand, in their own lengths
_SINGLES = next(_offset)

# Quantities in float64. Of a noise: place, sum and strength of the octave.
_offset = count(0, BLOCK)
SX, SY, SZ, TOTAL, STRENGTH = _offsets(5)
SU, SV = _offsets(2)  # place in an image
RAY = next(_offset)  # origin and direction of a camera ray, of any length; its place from the middle of the pixel
_offsets(7)
_DOUBLES = next(_offset)

# Whole numbers: face, −1 on a miss, its row in the table and its body; of noise its lane, octaves and seed; rows of
# an image and of its level in the table of textures.
_offset = count(0, BLOCK)
FACE, TABLE_ROW, BODY, NOISY, OCTAVES, SEED, IMAGE, LEVEL_ROW = _offsets(8)
_WHOLES = next(_offset)


@stage_kernel
def slot(quantity, lane):
    """Index of a lane's number: unsigned, so that numba need not look for negative ones.

    Lanes of a loop over all of them are known not to be negative; those that are counted or read are not.
    """
    return np.uint64(quantity + lane)


def work() -> Work:
    """Room for the stages of one thread."""
    single = aligned(_SINGLES)
    single[END : END + BLOCK] = NO_END
    return Work(single, single.view(np.int32), np.zeros(_DOUBLES), np.zeros(_WHOLES, np.int64))


def aligned(count: int) -> NDArray[np.float32]:
    """Zeros from the start of a cache line on."""
    raw = np.zeros(4 * count + LINE, np.uint8)
    start = -raw.ctypes.data % LINE
    return raw[start : start + 4 * count].view(np.float32)


def _take_rows(typing: Any, table: Any, columns: Any, first: Any, rows: Any, at: Any, out: Any, to: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        vector, word = ir.VectorType(ir.FloatType(), BLOCK), ir.IntType(64)
        source, numbers, target = (
            context.make_array(kind)(context, builder, values[i]).data
            for i, kind in ((0, table), (3, rows), (5, out))
        )
        loaded = []
        for k in range(BLOCK):
            row = builder.load(builder.gep(numbers, [builder.add(values[4], word(k))]))
            place = builder.gep(source, [builder.add(builder.mul(row, values[1]), values[2])])
            loaded.append(builder.load(builder.bitcast(place, vector.as_pointer()), align=4))
        for c, column in enumerate(_transposed(builder, loaded)):
            place = builder.gep(target, [builder.add(values[6], word(BLOCK * c))])
            builder.store(column, builder.bitcast(place, vector.as_pointer()), align=4)
        return context.get_dummy_value()

    return types.void(table, types.intp, types.intp, rows, types.intp, out, types.intp), generate


@compiled_by(_take_rows)
def take_rows(table: Any, columns: Any, first: Any, rows: Any, at: Any, out: Any, to: Any) -> None:
    """Read 16 numbers, from column ``first`` on, of row ``rows[at + k]`` of a table for each lane k.

    Quantity c of lane k comes to ``out[to + BLOCK·c + k]``. Whole vectors are loaded and transposed in registers:
    LLVM gathers number by number, which takes three times as long (*Apples*, full `setup1`, 2026-11-25).
    """
    for k in range(BLOCK):
        row = int(rows[at + k]) * int(columns) + int(first)
        for c in range(16):
            out[to + BLOCK * c + k] = table[row + c]


def _add_rows(typing: Any, tables: Any, rows: Any, at: Any, out: Any, to: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        vector, word = ir.VectorType(ir.DoubleType(), 8), ir.IntType(64)
        sources = [
            context.make_array(kind)(context, builder, builder.extract_value(values[0], i)).data
            for i, kind in enumerate(tables)
        ]
        numbers, target = (
            context.make_array(kind)(context, builder, values[i]).data for i, kind in ((1, rows), (3, out))
        )
        for first in (0, 8):
            sums = []
            for k in range(first, first + 8):
                parts = []
                for i, source in enumerate(sources):
                    place = builder.add(builder.extract_value(values[2], i), word(k))
                    row = builder.mul(builder.load(builder.gep(numbers, [place])), word(8))
                    place = builder.bitcast(builder.gep(source, [row]), vector.as_pointer())
                    parts.append(builder.load(place, align=8))
                sums.append(builder.fadd(*parts))
            for c, column in enumerate(_transposed(builder, sums)):
                place = builder.gep(target, [builder.add(values[4], word(BLOCK * c + first))])
                builder.store(column, builder.bitcast(place, vector.as_pointer()), align=8)
        return context.get_dummy_value()

    return types.void(tables, rows, types.UniTuple(types.intp, 2), out, types.intp), generate


@compiled_by(_add_rows)
def add_rows(tables: Any, rows: Any, at: Any, out: Any, to: Any) -> None:
    """Add 8 numbers of two tables of float64 for each lane k: rows ``rows[at[0] + k]`` and ``rows[at[1] + k]``.

    Sum c of lane k comes to ``out[to + BLOCK·c + k]``, as by `take_rows`.
    """
    for k in range(BLOCK):
        a, b = 8 * int(rows[at[0] + k]), 8 * int(rows[at[1] + k])
        for c in range(8):
            out[to + BLOCK * c + k] = tables[0][a + c] + tables[1][b + c]


def _transposed(builder: Any, rows: Any) -> Any:
    """As many vectors as each has numbers, a power of 2, transposed by butterflies."""
    many = len(rows)
    kind = ir.VectorType(ir.IntType(32), many)
    for step in (1 << bit for bit in reversed(range(many.bit_length() - 1))):
        low = [k if not k & step else many + k - step for k in range(many)]
        high = [k + step if not k & step else many + k for k in range(many)]
        turned = list(rows)
        for i in range(many):
            if not i & step:
                a, b = rows[i], rows[i + step]
                turned[i] = builder.shuffle_vector(a, b, ir.Constant(kind, low))
                turned[i + step] = builder.shuffle_vector(a, b, ir.Constant(kind, high))
        rows = turned
    return rows


def _bits_of(typing: Any, number: Any) -> Any:
    return types.int32(types.float32), lambda _c, builder, _s, values: builder.bitcast(values[0], ir.IntType(32))


@compiled_by(_bits_of)
def bits_of(number: Any) -> Any:
    """The 32 bits of a float32."""
    return np.float32(number).view(np.int32)


def _single_of(typing: Any, number: Any) -> Any:
    return types.float32(types.int32), lambda _c, builder, _s, values: builder.bitcast(values[0], ir.FloatType())


@compiled_by(_single_of)
def single_of(number: Any) -> Any:
    """The float32 of 32 bits."""
    return np.int32(number).view(np.float32)
