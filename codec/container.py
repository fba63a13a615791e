"""The ``.ii`` file: a coded picture that decodes by itself.

====================  =====  ==========================================================
part                  bytes  meaning, little endian
====================  =====  ==========================================================
magic                 8      ``89 49 49 43 0D 0A 1A 0A``, damaged by any text transfer
version               2      1
header length         4
payload length        8
digest                32     SHA-256 of everything else, in file order
header                       JSON, UTF-8: scheme, options, structure, camera, versions
payload                      what the scheme's decoder reads, and nothing else
====================  =====  ==========================================================
"""

from __future__ import annotations

import hashlib
import json
import os
import struct
from pathlib import Path
from typing import Any, BinaryIO

from ii_core.files import atomic_path

MAGIC = b"\x89IIC\r\n\x1a\n"
VERSION = 1
# A header is under a kilobyte; more than this is no header of ours.
MAX_HEADER = 1 << 20
_FIXED = struct.Struct("<8sHIQ")
_DIGEST = 32


def write(path: str | os.PathLike[str], header: dict[str, Any], payload: bytes) -> None:
    """Write a coded picture, whole or not at all; the same content makes the same bytes.

    Raises
    ------
    ValueError
        If the header is not plain JSON values, or too long.
    OSError
        If the file cannot be written.
    """
    text = json.dumps(header, ensure_ascii=False, allow_nan=False, sort_keys=True, separators=(",", ":")).encode()
    if len(text) > MAX_HEADER:
        raise ValueError(f"the header has {len(text)} bytes: at most {MAX_HEADER} are allowed")
    fixed = _FIXED.pack(MAGIC, VERSION, len(text), len(payload))
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        for part in (fixed, _digest(fixed, text, payload), text, payload):
            file.write(part)


def read(path: str | os.PathLike[str]) -> tuple[dict[str, Any], bytes]:
    """Header and payload of a coded picture; memory stays within the file's own size.

    Raises
    ------
    ValueError
        If the file is something else, cut short, longer than it says, or damaged anywhere.
    OSError
        If the file cannot be read.
    """
    path = Path(path)
    with path.open("rb") as file:
        header_length, payload_length, fixed, digest = _lengths(path, file)
        text, payload = file.read(header_length), file.read(payload_length)
    if _digest(fixed, text, payload) != digest:
        raise ValueError(f"{path} is damaged: its content does not match its checksum")
    try:
        header = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path} is damaged: its header is no JSON ({error})") from None
    if not isinstance(header, dict):
        raise ValueError(f"{path} is damaged: its header is a {type(header).__name__}, an object is needed")
    return header, payload


def _lengths(path: Path, file: BinaryIO) -> tuple[int, int, bytes, bytes]:
    """The fixed part, checked against the file's real size before anything is read by its word."""
    there = os.fstat(file.fileno()).st_size
    fixed, digest = file.read(_FIXED.size), file.read(_DIGEST)
    if fixed[: len(MAGIC)] != MAGIC[: len(fixed)] or not fixed:
        raise ValueError(f"{path} is no coded II-picture: it does not start like one")
    if len(digest) < _DIGEST:
        raise ValueError(
            f"{path} is truncated: {there} bytes are there, the fixed part alone has {_FIXED.size + _DIGEST}"
        )
    _, version, header_length, payload_length = _FIXED.unpack(fixed)
    if version != VERSION:
        raise ValueError(f"{path} is of version {version}: this program reads version {VERSION}")
    if header_length > MAX_HEADER:
        raise ValueError(f"{path} is damaged: a header of {header_length} bytes, at most {MAX_HEADER} are allowed")
    needed = _FIXED.size + _DIGEST + header_length + payload_length
    if there < needed:
        raise ValueError(f"{path} is truncated: {there} bytes are there, {needed} are needed")
    if there > needed:
        raise ValueError(f"{path} is damaged: {there} bytes are there, {needed} are expected")
    return header_length, payload_length, fixed, digest


def _digest(*parts: bytes) -> bytes:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    return digest.digest()
