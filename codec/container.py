"""Container format of the ``.ii`` file: magic, lengths, digest, header, payload.

==============  =======  =============================================================================
part            bytes    meaning
==============  =======  =============================================================================
magic           4        ``89 49 49 43``
version         1        2
lengths         2 to 10  of header and payload, LEB128
digest          8        the first bytes of SHA-256 of everything else, in file order
header                   values of `codec.file_header`, in the form of `codec.bitstream.compact`
payload                  input of the scheme's decoder
==============  =======  =============================================================================

Files of the first version have ``0D 0A 1A 0A`` after the magic, then, little endian, the version 1 (2 bytes) and the
lengths of header (4) and payload (8), all 32 bytes of SHA-256, and a header in JSON. They are read, not written.
"""

from __future__ import annotations

import hashlib
import json
import os
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from ii_core.base.files import atomic_path, check_file

from .bitstream.compact import leb128, read_leb128, read_values, write_values

MAGIC = b"\x89IIC"
VERSION = 2
# Upper limit of the header; names and cameras of users take some hundred bytes.
MAX_HEADER = 1 << 20
_DIGEST = 8

FIRST_MAGIC = MAGIC + b"\r\n\x1a\n"
_FIRST = struct.Struct("<8sHIQ")
_FIRST_DIGEST = 32
# Upper limit of fixed part and digest of both versions; a LEB128 number has at most 9 bytes.
_START = max(len(MAGIC) + 1 + 2 * 9 + _DIGEST, _FIRST.size + _FIRST_DIGEST)

Header = dict[str, Any] | list[Any]


@dataclass(frozen=True)
class _Frame:
    """Part before the header: its bytes without the digest, the digest, and the stated lengths."""

    fixed: bytes
    digest: bytes
    header: int
    payload: int

    @property
    def total(self) -> int:
        """Bytes of the whole file."""
        return len(self.fixed) + len(self.digest) + self.header + self.payload


def overhead(header: list[Any], payload_length: int) -> int:
    """Return the number of bytes of a file beyond its payload."""
    text = write_values(header)
    return len(_fixed(text, payload_length)) + _DIGEST + len(text)


def write(path: str | os.PathLike[str], header: list[Any], payload: bytes) -> Path:
    """Write a coded picture, whole or not at all, and return the file's path; equal content makes equal bytes.

    Raises
    ------
    ValueError
        If the header does not consist of JSON values, or is too long.
    OSError
        If the file cannot be written.
    """
    text = write_values(header)
    if len(text) > MAX_HEADER:
        raise ValueError(f"the header has {len(text)} bytes: at most {MAX_HEADER} are allowed")
    fixed = _fixed(text, len(payload))
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        for part in (fixed, _digest(fixed, text, payload)[:_DIGEST], text, payload):
            file.write(part)
    return Path(path)


def read(path: str | os.PathLike[str]) -> tuple[Header, bytes]:
    """Return header and payload of a coded picture; takes no more memory than the file has bytes.

    Returns
    -------
    header : list or dict
        The values given to `write`; an object for files of the first version.
    payload : bytes

    Raises
    ------
    ValueError
        If the file is of another type, truncated, too long or damaged.
    OSError
        If the file cannot be read, or is a folder, pipe or device.
    """
    path = Path(path)
    check_file(path)
    with path.open("rb") as file:
        frame = _frame(path, file)
        text, payload = file.read(frame.header), file.read(frame.payload)
    if _digest(frame.fixed, text, payload)[: len(frame.digest)] != frame.digest:
        raise ValueError(f"{path} is damaged: its content does not match its checksum")
    try:
        return _first_header(text) if frame.fixed.startswith(FIRST_MAGIC) else read_values(text), payload
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path} is damaged: {error}") from None


def _fixed(text: bytes, payload_length: int) -> bytes:
    return MAGIC + bytes([VERSION]) + leb128(len(text)) + leb128(payload_length)


def _frame(path: Path, file: BinaryIO) -> _Frame:
    """Read the part before the header and compare its lengths with the size of the file."""
    there = os.fstat(file.fileno()).st_size
    start = file.read(_START)
    if start[: len(MAGIC)] != MAGIC[: len(start)] or not start:
        raise ValueError(f"{path} is no coded II-picture: it does not start like one")
    try:
        frame = _first_frame(path, start) if start[4:5] == FIRST_MAGIC[4:5] else _second_frame(path, start)
    except IndexError:
        raise ValueError(f"{path} is truncated: it has {there} bytes, fewer than its fixed part") from None
    if frame.header > MAX_HEADER:
        raise ValueError(f"{path} is damaged: a header of {frame.header} bytes, at most {MAX_HEADER} are allowed")
    if there < frame.total:
        raise ValueError(f"{path} is truncated: it has {there} bytes, {frame.total} are needed")
    if there > frame.total:
        raise ValueError(f"{path} is damaged: it has {there} bytes, {frame.total} are expected")
    file.seek(len(frame.fixed) + len(frame.digest))
    return frame


def _second_frame(path: Path, start: bytes) -> _Frame:
    version = start[len(MAGIC)]
    if version != VERSION:
        raise ValueError(f"{path} is of version {version}: this program reads versions 1 and {VERSION}")
    at = len(MAGIC) + 1
    try:
        header, at = read_leb128(start, at)
        payload, at = read_leb128(start, at)
    except ValueError as error:
        if len(start) < _START:
            raise IndexError from None
        raise ValueError(f"{path} is damaged: {error}") from None
    if len(start) < at + _DIGEST:
        raise IndexError
    return _Frame(start[:at], start[at : at + _DIGEST], header, payload)


def _first_frame(path: Path, start: bytes) -> _Frame:
    fixed, digest = start[: _FIRST.size], start[_FIRST.size : _FIRST.size + _FIRST_DIGEST]
    if fixed[: len(FIRST_MAGIC)] != FIRST_MAGIC[: len(fixed)]:
        raise ValueError(f"{path} is no coded II-picture: it does not start like one")
    if len(digest) < _FIRST_DIGEST:
        raise IndexError
    _, version, header, payload = _FIRST.unpack(fixed)
    if version != 1:
        raise ValueError(f"{path} is of version {version}: this program reads versions 1 and {VERSION}")
    return _Frame(fixed, digest, header, payload)


def _first_header(text: bytes) -> dict[str, Any]:
    try:
        header = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"its header is no JSON ({error})") from None
    if not isinstance(header, dict):
        raise ValueError(f"its header is a {type(header).__name__}, an object is needed")
    return header


def _digest(*parts: bytes) -> bytes:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    return digest.digest()
