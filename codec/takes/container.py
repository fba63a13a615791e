"""Container format of the ``.ii`` file of a take: a header, and segments with checksums of their own.

==============  =======  =============================================================================
part            bytes    meaning
==============  =======  =============================================================================
magic           4        ``89 49 49 56``
version         1        1
length                   length of the header, LEB128
digest          8        the first bytes of SHA-256 of magic, version, length and header
header                   values of `codec.file_header`, and of the take, as `codec.bitstream.compact`
segments                 each: length in LEB128; digest of its number, 4 bytes, length and payload; payload
==============  =======  =============================================================================

The header determines the number of segments. If a file ends early or is damaged in a segment, all segments before
it can be read.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any, BinaryIO

from ii_core.base import checks
from ii_core.base.files import atomic_path, check_file

from ..bitstream.compact import leb128, read_leb128, read_values, write_values
from ..container import MAX_HEADER

MAGIC = b"\x89IIV"
VERSION = 1
_DIGEST = 8
_LONGEST = 9  # largest number of bytes of a number in LEB128


class DamagedTake(ValueError):
    """A coded take ends early or is damaged; ``whole`` segments before the damage can be decoded."""

    def __init__(self, message: str, whole: int) -> None:
        super().__init__(message)
        self.whole = whole


def is_take(path: str | os.PathLike[str]) -> bool:
    """Whether a file starts like a coded take.

    Raises
    ------
    TypeError
        If ``path`` is no path.
    OSError
        If the file cannot be read.
    """
    checks.path("path", path)
    with open(path, "rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def head(header: list[Any]) -> bytes:
    """Return the bytes before the segments."""
    text = write_values(header)
    fixed = MAGIC + bytes([VERSION]) + leb128(len(text))
    return fixed + _digest(fixed, text) + text


def framed(number: int, payload: bytes) -> bytes:
    """Return the bytes of a segment in the file: length, digest and payload."""
    length = leb128(len(payload))
    return length + _digest(number.to_bytes(4, "little"), length, payload) + payload


def write(path: str | os.PathLike[str], header: list[Any], segments: Iterable[bytes]) -> None:
    """Write a take, whole or not at all."""
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        file.write(head(header))
        for number, payload in enumerate(segments):
            file.write(framed(number, payload))


def read_header(path: str | os.PathLike[str]) -> tuple[list[Any], int]:
    """Return the header and where the segments start.

    Raises
    ------
    ValueError
        If the file is no take, or its header is damaged.
    """
    path = Path(path)
    check_file(path)
    with path.open("rb") as file:
        start = file.read(len(MAGIC) + 1 + _LONGEST)
        if not start.startswith(MAGIC):
            raise ValueError(f"{path} is no coded take: it does not start like one")
        if len(start) > len(MAGIC) and start[len(MAGIC)] != VERSION:
            raise ValueError(f"{path} is of version {start[len(MAGIC)]}: this program reads version {VERSION}")
        try:
            length, at = read_leb128(start, len(MAGIC) + 1)
        except (ValueError, IndexError):
            raise ValueError(f"{path} is truncated: its header is not whole") from None
        if length > MAX_HEADER:
            raise ValueError(f"{path} is damaged: a header of {length} bytes, at most {MAX_HEADER} are allowed")
        file.seek(at)
        digest, text = file.read(_DIGEST), file.read(length)
    if len(text) < length:
        raise ValueError(f"{path} is truncated: its header is not whole")
    if _digest(start[:at], text) != digest:
        raise ValueError(f"{path} is damaged: its header does not match its checksum")
    try:
        values = read_values(text)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path} is damaged: {error}") from None
    return values, at + _DIGEST + length


def read_segments(path: str | os.PathLike[str], start: int, count: int) -> tuple[list[bytes], str]:
    """Return the whole segments from the front, and the fault after them; the fault is empty if all are whole."""
    path = Path(path)
    found: list[bytes] = []
    size = path.stat().st_size
    with path.open("rb") as file:
        file.seek(start)
        for number in range(count):
            payload, wrong = _segment(file, number, size)
            if payload is None:
                return found, wrong
            found.append(payload)
        left = size - file.tell()
    return found, f"has {left} bytes more than its segments" if left else ""


def _segment(file: BinaryIO, number: int, size: int) -> tuple[bytes | None, str]:
    at = file.tell()
    try:
        length, used = read_leb128(file.read(_LONGEST), 0)
    except (ValueError, IndexError):
        return None, "is truncated" if at + _LONGEST > size else "is damaged"
    if at + used + _DIGEST + length > size:
        return None, "is truncated"
    file.seek(at + used)
    digest, payload = file.read(_DIGEST), file.read(length)
    if _digest(number.to_bytes(4, "little"), leb128(length), payload) != digest:
        return None, "is damaged"
    return payload, ""


def _digest(*parts: bytes) -> bytes:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    return digest.digest()[:_DIGEST]
