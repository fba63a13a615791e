"""Raw lenslet pictures of Lytro cameras: LFP and LFR containers, packed samples of 10 or 12 bits.

A container starts with an LFP section, followed by an LFM section, its table of contents as JSON, and LFC sections,
everything else. A section is::

    8 bytes    89 4C 46 (50 | 4D | 43) 0D 0A 1A 0A
    4          version
    4          length of the data, big-endian; of the first section 0
    80         the data's name, "sha1-" and 40 hexadecimal digits, padded with zeros    } if the
    length     data, padded with zeros to a multiple of 16                              } length is not 0

The table says which section is the picture and which its metadata. Samples are packed without gaps::

    12 bit    AAAAAAAA aaaabbbb BBBBBBBB              of two samples: Aa and bB
    10 bit    AAAAAAAA BBBBBBBB CCCCCCCC DDDDDDDD ddccbbaa    of four

References
----------
N. Patel's lfpsplitter (2011) and D. Dansereau's Light Field Toolbox describe the format; the maker does not.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base import checks
from ..base.files import check_file, memory_bytes, one_line, read_image, read_json
from ..camera.camera import Pair
from .lytro import PRIVATE, RawPicture, about_picture

MAGIC = b"\x89LF"
MARK = b"\r\n\x1a\n"
HEADER, NAME = 16, 80
MOST_JSON = 16 << 20  # bytes
CONTAINERS, PACKED = (".lfp", ".lfr"), (".raw",)
TOLD = (".json", ".txt")  # metadata of packed samples


@checks.checked(path=checks.path, metadata=checks.path)
def read_raw(path: str | os.PathLike[str], metadata: str | os.PathLike[str] | None = None) -> RawPicture:
    """A raw lenslet picture: an image file, an LFP or LFR container, or packed samples of another name.

    Parameters
    ----------
    metadata : path, optional
        JSON of packed samples; if not given, the samples' name with ``.json`` or ``.txt`` in place of its suffix or
        behind it, or with ``_metadata.json``.

    Raises
    ------
    ValueError
        If the file does not hold a raw picture, or an image of other than 1, 3 or 4 channels.
    OSError
        If a file cannot be read.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if metadata is None and suffix in CONTAINERS:
        return read_lfp(path)
    if metadata is None and suffix in PACKED:
        metadata = metadata_beside(path)
    if metadata is not None:
        return read_packed(path, metadata)
    samples = read_image(path)
    if samples.shape[2] not in (1, 3, 4):
        raise ValueError(f"{path} has {samples.shape[2]} channels: 1, 3 or 4 are needed")
    return RawPicture(samples=samples[..., 0] if samples.shape[2] == 1 else samples[..., :3])


@checks.checked(path=checks.path)
def read_lfp(path: str | os.PathLike[str]) -> RawPicture:
    """The raw picture of an LFP or LFR container.

    Raises
    ------
    ValueError
        If the file is no container, is cut short, holds data of another hash than its names say, or no raw picture.
    OSError
        If it cannot be read.
    """
    check_file(path)
    data = Path(path).read_bytes()
    try:
        table, sections = read_sections(data)
        frame = _frame(table)
        metadata = dict(_object(_section(sections, frame["metadataRef"], "metadata")))
        private = frame.get("privateMetadataRef")
        if private in sections:
            metadata[PRIVATE] = _object(sections[private])
        return raw_picture(_section(sections, frame["imageRef"], "picture"), metadata)
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, OverflowError) as error:
        text = f"{error.args[0]} missing" if isinstance(error, KeyError) and error.args else error
        raise ValueError(f"{os.fspath(path)} is no raw picture of a Lytro camera: {one_line(text)}") from None


@checks.checked(path=checks.path, metadata=checks.path)
def read_packed(path: str | os.PathLike[str], metadata: str | os.PathLike[str]) -> RawPicture:
    """Packed samples in a file of their own, with the metadata's JSON beside; errors as of `read_lfp`."""
    check_file(path)
    try:
        return raw_picture(Path(path).read_bytes(), read_json(metadata))
    except ValueError as error:  # numbers in the metadata that are text, echoed by Python in full
        raise ValueError(one_line(error)) from None
    except (TypeError, KeyError, IndexError, AttributeError, OverflowError) as error:
        raise ValueError(f"{os.fspath(metadata)} does not describe a raw picture: {one_line(repr(error))}") from None


def metadata_beside(path: Path) -> Path:
    """Return the metadata of packed samples, whose name may be in capitals; ValueError if there are none."""
    wanted = {f"{stem}{end}".lower() for stem in (path.stem, path.name) for end in TOLD}
    wanted.add(f"{path.stem}_metadata.json".lower())
    found = (
        sorted(file for file in path.parent.iterdir() if file.name.lower() in wanted) if path.parent.is_dir() else []
    )
    if not found:
        raise ValueError(f"{path} holds packed samples: {path.stem}.json or .txt, its metadata, is needed beside it")
    return found[0]


def raw_picture(packed: bytes, metadata: Mapping[str, Any]) -> RawPicture:
    """Return the raw picture of packed samples and their metadata.

    Raises
    ------
    ValueError, TypeError, KeyError, IndexError, AttributeError, OverflowError
        If the metadata do not describe the samples.
    """
    about = about_picture(metadata)
    samples = unpacked(packed, about.size, about.bits).astype(np.float32)
    for phase, black in enumerate(about.black):
        samples[phase // 2 :: 2, phase % 2 :: 2] -= np.float32(black)
    return replace(about.picture, samples=samples)


def unpacked(data: bytes, size: Pair, bits: int) -> NDArray[np.uint16]:
    """Packed samples of 10, 12 or, of two bytes the lower first, 16 bits as (N, M); see the top of this file.

    Raises
    ------
    ValueError
        If there are other bits, too few bytes, or a picture larger than memory.
    """
    width, height = size
    count = width * height
    group, packed = {10: (4, 5), 12: (2, 3), 16: (1, 2)}.get(bits, (0, 0))
    if not group:
        raise ValueError(f"samples have {bits} bits: 10, 12 or 16 are known")
    if width < 1 or height < 1 or 2 * count > memory_bytes():
        raise ValueError(f"a picture of {width}×{height} px is none that fits into memory")
    needed = -(-count // group) * packed
    if len(data) < needed:
        raise ValueError(f"{len(data)} bytes of samples: {width}×{height} px of {bits} bits need {needed}")
    octets = np.frombuffer(data, np.uint8, needed).reshape(-1, packed).astype(np.uint16)
    if bits == 16:
        samples = octets[:, 0] | octets[:, 1] << 8
    elif bits == 12:
        samples = np.stack([octets[:, 0] << 4 | octets[:, 1] >> 4, (octets[:, 1] & 15) << 8 | octets[:, 2]], axis=1)
    else:
        samples = np.stack([octets[:, i] << 2 | octets[:, 4] >> 2 * i & 3 for i in range(4)], axis=1)
    return np.asarray(samples.ravel()[:count].reshape(height, width), np.uint16)


def read_sections(data: bytes) -> tuple[Mapping[str, Any], dict[str, bytes]]:
    """The table of contents of a container, and all its data by name; ValueError if it is damaged."""
    if data[:3] != MAGIC or data[3:8] != b"P" + MARK:
        raise ValueError("it does not begin as a container does")
    table: Mapping[str, Any] | None = None
    sections: dict[str, bytes] = {}
    at = HEADER
    while at + HEADER <= len(data):
        kind = data[at + 3 : at + 4]
        if data[at : at + 3] != MAGIC or data[at + 4 : at + 8] != MARK:
            raise ValueError(f"no section begins at byte {at}")
        length = int.from_bytes(data[at + 12 : at + 16], "big")
        name = data[at + HEADER : at + HEADER + NAME].rstrip(b"\0").decode("ascii", "replace")
        start = at + HEADER + NAME
        if length > len(data) - start:
            raise ValueError(f"the section at byte {at} has {length} bytes, {max(0, len(data) - start)} are there")
        content = data[start : start + length]
        if name != f"sha1-{hashlib.sha1(content).hexdigest()}":
            raise ValueError(f"the section at byte {at} does not hold what its name {name!r} says: it is damaged")
        if kind == b"M":
            table = _object(content)
        sections[name] = content
        at = start + -(-length // 16) * 16
    if table is None:
        raise ValueError("it has no table of contents")
    return table, sections


def _section(sections: Mapping[str, bytes], name: Any, what: str) -> bytes:
    if name not in sections:
        raise ValueError(f"its {what}, {checks.shown(name)}, is not in it")
    return sections[name]


def _object(content: bytes) -> Mapping[str, Any]:
    if len(content) > MOST_JSON:
        raise ValueError(f"{len(content)} bytes of JSON: at most {MOST_JSON} are read")
    try:
        value = json.loads(content.rstrip(b"\0").decode("utf-8"))
    except RecursionError:
        raise ValueError("its JSON nests too deeply") from None
    if not isinstance(value, Mapping):
        raise ValueError("its JSON is no object")
    return value


def _frame(table: Mapping[str, Any]) -> Mapping[str, Any]:
    """The first frame of the table of a first or of a second generation camera."""
    frames = table["frames"] if "frames" in table else table["picture"]["frameArray"]
    return frames[0]["frame"]
