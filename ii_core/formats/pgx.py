"""PGX pictures: one component of 1–16 bit, signed or not, of either byte order, as JPEG 2000 and JPEG Pleno use them.

The header is ``PG``, ``ML`` (the high byte first) or ``LM``, a sign, the depth in bits, width and height. Codes of up
to 8 bit take one byte, others two.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.atomic import atomic_path
from ..base.files import check_file

MAX_BITS = 16
MAX_HEADER = 256  # bytes
# The last white space belongs to the header: a line feed, after a space or a carriage return in some programs.
HEADER = re.compile(rb"PG[ \t]+(ML|LM)[ \t]+([+-]?)[ \t]*(\d{1,2})[ \t]+(\d{1,7})[ \t]+(\d{1,7})[ \t]*\r?\n")


class Component(NamedTuple):
    """Codes of a PGX picture, (T, S) int32, with their depth in bits and sign."""

    codes: NDArray[np.int32]
    bits: int
    signed: bool

    @property
    def lowest(self) -> int:
        """The lowest code of this depth and sign; the highest is ``lowest + 2**bits - 1``."""
        return -(1 << self.bits - 1) if self.signed else 0


def write_pgx(path: Path, component: Component, *, little: bool = False) -> None:
    """Write a component; ``little`` puts the low byte first.

    Raises
    ------
    ValueError
        If the depth is not 1–16 bit, or a code does not fit depth and sign.
    """
    codes, bits, signed = component
    if not 1 <= bits <= MAX_BITS:
        raise ValueError(f"bits is {bits}: 1 to {MAX_BITS} are needed")
    _check_range(path, component)
    height, width = codes.shape
    header = f"PG {'LM' if little else 'ML'} {'-' if signed else '+'}{bits} {width} {height}\n"
    with atomic_path(path) as temporary:
        temporary.write_bytes(header.encode() + codes.astype(_dtype(bits, signed, little)).tobytes())


def read_pgx(path: Path) -> Component:
    """Read a component.

    Raises
    ------
    ValueError
        If it is no PGX file, has another depth than 1–16 bit, its length does not fit its size, or a code does not
        fit its depth.
    OSError
        If it cannot be read.
    """
    check_file(path)
    data = path.read_bytes()
    found = HEADER.match(data[:MAX_HEADER])
    if found is None:
        raise ValueError(f"{path.name} is no PGX file: a header such as 'PG ML +10 512 512' is needed")
    order, sign = found[1], found[2]
    bits, width, height = map(int, found.groups()[2:])
    if not 1 <= bits <= MAX_BITS:
        raise ValueError(f"{path.name} has {bits} bit: 1 to {MAX_BITS} are needed")
    dtype = _dtype(bits, sign == b"-", order == b"LM")
    if len(data) - found.end() != (needed := dtype.itemsize * width * height):
        raise ValueError(f"{path.name} has {len(data) - found.end()} bytes of pixels: {needed} are needed")
    codes = np.frombuffer(data, dtype, offset=found.end()).reshape(height, width).astype(np.int32)
    component = Component(codes, bits, sign == b"-")
    _check_range(path, component)
    return component


def _dtype(bits: int, signed: bool, little: bool) -> np.dtype[Any]:
    return np.dtype(f"{'<' if little else '>'}{'i' if signed else 'u'}{1 if bits <= 8 else 2}")


def _check_range(path: Path, component: Component) -> None:
    lowest, codes = component.lowest, component.codes
    highest = lowest + (1 << component.bits) - 1
    if codes.size and not (lowest <= codes.min() and codes.max() <= highest):
        wrong = codes[(codes < lowest) | (codes > highest)][0]
        raise ValueError(f"{path.name} has a code of {wrong}: {lowest} to {highest} are allowed")
