"""Work memory of one block of rays: quantities by name, one lane per hit."""

from __future__ import annotations

from itertools import count
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ii_core.base.jit import inline_kernel

BLOCK = 64  # rays that go through the stages together: what is kept of them fits in the first cache


class Work(NamedTuple):
    """Room for one block: a quantity is ``BLOCK`` numbers from its offset on, a place, or lane, for each hit.

    Offsets are constants and loops run over all lanes, so that the compiler sees what is apart and makes vectors.
    """

    single: NDArray[np.float32]
    double: NDArray[np.float64]
    whole: NDArray[np.int64]


_offset = count(0, BLOCK)


def _offsets(many: int) -> tuple[int, ...]:
    return tuple(next(_offset) for _ in range(many))


# Quantities in float32, as they are gathered: place in the face, ray, corners, face and normals of its corners.
U, V, DISTANCE, DX, DY, DZ, WEIGHT = _offsets(7)
_offsets(2)
START = next(_offset)
_offsets(2)
CORNER = next(_offset)
_offsets(8)
FACE_NORMAL = next(_offset)  # a row of the table of faces: normal, lift, pull
_offsets(2)
LIFT, PULL, NORMAL = _offsets(3)
_offsets(8)
COORDINATE = next(_offset)  # u and v of three corners
_offsets(5)
_SINGLES = next(_offset)

# Quantities in float64, as they are reckoned.
_offset = count(0, BLOCK)
PX, PY, PZ = _offsets(3)  # the hit, drawn to the middle of its face
GX, GY, GZ = _offsets(3)  # the face's normal on the ray's side
OX, OY, OZ = _offsets(3)  # where rays start that stay on that side
NX, NY, NZ = _offsets(3)  # normal of shading
AX, AY, AZ = _offsets(3)  # way up to the smooth surface
ENTERING, SMOOTH, WIDTH = _offsets(3)
W0, W1, W2 = _offsets(3)  # weights, after fog, media and blending
F0, F1, F2 = _offsets(3)  # light of the fog before the hit
B0, B1, B2 = _offsets(3)  # weights of what is seen through a blended surface
AU, AV, BU, BV = _offsets(4)  # footprint over (u, v)
# Columns of the material as they stand in its table: colours scattered, mirrored and given off, share scattered,
# strength and exponent of the highlight, least cosine at which it is seen, roughness, share of metal.
R0, R1, R2, K0, K1, K2, E0, E1, E2, SCATTERED, GLOSS, EXPONENT, HALF_FROM, ROUGH, METAL = _offsets(15)
CLEAR = next(_offset)  # share let through
T0, T1, T2 = _offsets(3)  # colour of the texture
LX, LY, LZ, COSINE, HALF, SHINE, CONE = _offsets(7)  # of the light at hand
C0, C1, C2, STRONGEST = _offsets(4)  # what its shadow rays would let through
SX, SY, SZ, TOTAL, STRENGTH = _offsets(5)  # noise: place, sum, strength of the octave
_DOUBLES = next(_offset)

# Whole numbers: ray, face and body of a lane, lane of a ray; of noise its lane, octaves and seed.
_offset = count(0, BLOCK)
ROW, FACE, BODY, LANE, NOISY, OCTAVES, SEED = _offsets(7)
_WHOLES = next(_offset)


@inline_kernel
def slot(quantity, lane):
    """Index of a lane's number: unsigned, so that numba need not look for negative ones.

    Lanes of a loop over all of them are known not to be negative; those that are counted or read are not.
    """
    return np.uint64(quantity + lane)


def work() -> Work:
    """Room for the stages of one thread."""
    return Work(np.zeros(_SINGLES, np.float32), np.zeros(_DOUBLES), np.zeros(_WHOLES, np.int64))
