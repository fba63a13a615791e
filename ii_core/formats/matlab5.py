"""Arrays of numbers and texts in MATLAB's files of version 5, read within bounds.

SciPy's reader ends the process on damaged files. This one reads numbers and texts alone; structures, cells, objects
and functions are passed over. A file is a header of 128 bytes and elements::

    4 + 4      type and length; if the length's upper half is in the type's, up to 4 bytes of data follow instead
    length     data, padded to 8 bytes; of type 14 an array, of type 15 a compressed element

An array has elements of its own: flags, shape, name, numbers, which may be stored in a smaller type.

References
----------
"MAT-File Format", The MathWorks.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
TEXTS = {1: "utf-8", 2: "utf-8", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
CLASSES = {4: "char", 6: "float64", 7: "float32", 8: "int8", 9: "uint8", 10: "int16", 11: "uint16"}
MATRIX, COMPRESSED = 14, 15
HEADER, MOST_HEAD = 128, 4096  # bytes of a file's head, and of an array's flags, shape and name
COMPLEX = 8
MOST_ARRAYS = 10_000


class Array(NamedTuple):
    """An array of a file: ``read`` returns it, or the text of kind "char"."""

    name: str
    shape: tuple[int, ...]
    kind: str
    read: Callable[[], Any]


def arrays(path: Path) -> list[Array]:
    """Return the arrays of numbers and texts of a file.

    Raises
    ------
    ValueError
        If the file is not of version 5, or is damaged.
    OSError
        If it cannot be read.
    """
    found: list[Array] = []
    with path.open("rb") as file:
        head = file.read(HEADER)
        order = {b"IM": "<", b"MI": ">"}.get(head[126:])
        if order is None or head[124:126] not in (b"\0\1", b"\1\0"):
            raise ValueError("it does not begin as files of version 5 do")
        size = file.seek(0, 2)
        at = HEADER
        while at + 8 <= size:
            file.seek(at)
            kind, length = (int(n) for n in np.frombuffer(file.read(8), order + "u4"))
            if length > size - at - 8:
                raise ValueError(f"the element at byte {at} has {length} bytes, {size - at - 8} are there")
            if kind in (MATRIX, COMPRESSED):
                inside = _Element(path, at + 8, length, kind == COMPRESSED, order)
                found.extend(inside.array())
            at += 8 + length + (0 if kind == COMPRESSED else -length % 8)
            if len(found) > MOST_ARRAYS:
                raise ValueError(f"it holds more than {MOST_ARRAYS} arrays")
    return found


class _Element(NamedTuple):
    """An array or a compressed array at a place of a file."""

    path: Path
    at: int
    length: int
    compressed: bool
    order: str

    def data(self, most: int) -> bytes:
        """Return the first bytes of the array, at most so many."""
        with self.path.open("rb") as file:
            file.seek(self.at)
            if not self.compressed:
                return file.read(min(self.length, most))
            try:
                data = zlib.decompressobj().decompress(file.read(self.length), most + 8)
            except zlib.error as error:
                raise ValueError(f"the element at byte {self.at} is damaged: {error}") from None
        if len(data) < 8 or int(np.frombuffer(data, self.order + "u4", 1)[0]) != MATRIX:
            return b""
        return data[8:]

    def array(self) -> Iterator[Array]:
        """Yield the array, if it is one of numbers or text."""
        parts = list(islice(_parts(self.data(MOST_HEAD), self.order), 3))
        if len(parts) < 3:
            return
        flags, shape, name = parts
        flag = int(np.frombuffer(flags.data, self.order + "u4", 1)[0])
        kind = CLASSES.get(flag & 255)
        sizes = tuple(int(n) for n in np.frombuffer(shape.data, self.order + "i4"))
        if kind is None or flag >> 8 & COMPLEX or min(sizes, default=-1) < 0 or len(sizes) > 32:
            return
        text = name.data.decode("latin-1")
        yield Array(text, sizes, kind, lambda: self.values(name.end, sizes, kind))

    def values(self, start: int, shape: tuple[int, ...], kind: str) -> Any:
        """Return numbers or text, whose element starts at a byte of the array."""
        count = math.prod(shape)
        data = self.data(start + 8 * count + 16)
        part = next(_parts(data, self.order, start), None)
        if part is None or part.type not in (TEXTS if kind == "char" else STORED):
            raise ValueError("an array has no values")
        if kind == "char":
            coding = TEXTS[part.type]
            if coding != "utf-8":
                coding += {"<": "-le", ">": "-be"}[self.order]
            return part.data.decode(coding)
        stored = np.dtype(self.order + STORED[part.type])
        if len(part.data) < count * stored.itemsize:
            raise ValueError(f"an array of {count} numbers has {len(part.data)} bytes of {stored.itemsize} a number")
        numbers: NDArray[Any] = np.frombuffer(part.data, stored, count)
        with np.errstate(invalid="ignore", over="ignore"):
            return numbers.astype(kind, copy=False).reshape(shape, order="F")


class _Part(NamedTuple):
    type: int
    data: bytes
    end: int


def _parts(data: bytes, order: str, at: int = 0) -> Iterator[_Part]:
    """Yield the elements of an array, the last one as far as its bytes are there."""
    while at + 8 <= len(data):
        kind, length = (int(n) for n in np.frombuffer(data, order + "u4", 2, at))
        if kind >> 16:  # a small element
            yield _Part(kind & 0xFFFF, data[at + 4 : at + 4 + min(kind >> 16, 4)], at + 8)
            at += 8
            continue
        end = at + 8 + length + -length % 8
        yield _Part(kind, data[at + 8 : at + 8 + length], end)
        at = end
