"""Files that a mesh file refers to: regular, of bounded size, inside its folder."""

from __future__ import annotations

import os
from pathlib import Path, PureWindowsPath
from typing import Any

from numpy.typing import NDArray

from ii_core.base.files import check_file, image_header, read_image

MOST_BYTES = 4 << 30  # of a mesh file or its buffer
MOST_TEXELS = 1 << 28  # of a texture: 16384², 3 GB as linear float32


def read_bytes(path: Path) -> bytes:
    """Return the bytes of a file.

    Raises
    ------
    ValueError
        If it is longer than `MOST_BYTES`.
    OSError
        If it does not exist or is not a regular file.
    """
    check_file(path)
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise ValueError(f"{path.name} has {size} bytes: at most {MOST_BYTES} are read")
    return path.read_bytes()


def read_texture(path: Path) -> NDArray[Any]:
    """Return the stored pixels (H, W, channels) of a picture; its header is compared with `MOST_TEXELS` first.

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
    """Return the path of a file that a file in ``folder`` refers to.

    Raises
    ------
    ValueError
        If the name is absolute, or points outside the folder by ``..`` or by a link.
    """
    if "\0" in name or Path(name).is_absolute() or PureWindowsPath(name).anchor:
        raise ValueError(f"{name[:80]!r}: the relative name of a file is needed")
    path = folder / name
    if not Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder)):
        raise ValueError(f"{name[:80]!r} leads out of the file's folder: nothing is read there")
    return path


def decoded_text(data: bytes) -> str:
    """Return the text of a file; bytes that are not UTF-8 become �."""
    return data.decode("utf-8-sig", "replace")
