"""Files that a mesh file refers to: regular, of bounded size, inside its folder."""

from __future__ import annotations

import os
from pathlib import Path, PureWindowsPath
from typing import Any

from numpy.typing import NDArray

from ii_core.files import check_file, image_header, read_image

MOST_BYTES = 4 << 30  # of a mesh file or a buffer of one
MOST_TEXELS = 1 << 28  # of a texture: 16384², 3 GB as linear float32


def read_bytes(path: Path) -> bytes:
    """What a file holds.

    Raises
    ------
    ValueError
        If it is longer than `MOST_BYTES`.
    OSError
        If it does not exist or is not a regular file: a pipe or device may never end.
    """
    check_file(path)
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise ValueError(f"{path.name} has {size} bytes: at most {MOST_BYTES} are read")
    return path.read_bytes()


def read_texture(path: Path) -> NDArray[Any]:
    """The stored pixels (H, W, channels) of a picture; its header is held against `MOST_TEXELS` first.

    Raises
    ------
    ValueError
        If it is larger.
    OSError
        If it does not exist, is not a regular file, or is not a whole picture.
    """
    (height, width, _), _ = image_header(path)
    if width * height > MOST_TEXELS:
        raise ValueError(f"{path.name} has {width}×{height} pixels: at most {MOST_TEXELS} are read")
    return read_image(path)


def beside(folder: Path, name: str) -> Path:
    """The file that a file in ``folder`` names.

    Raises
    ------
    ValueError
        If the name is absolute or leads out of the folder, by ``..`` or by a link.
    """
    if "\0" in name or Path(name).is_absolute() or PureWindowsPath(name).anchor:
        raise ValueError(f"{name[:80]!r}: the relative name of a file is needed")
    path = folder / name
    if not Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder)):
        raise ValueError(f"{name[:80]!r} leads out of the file's folder: nothing is read there")
    return path


def decoded_text(data: bytes) -> str:
    """Text of a file in whatever coding: bytes that are not UTF-8, in names and comments, stand as �."""
    return data.decode("utf-8-sig", "replace")
