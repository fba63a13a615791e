"""Views for the programs of JPEG Pleno: ``CCC_RRR.ppm`` of 10 bit, the same names as PGX, or as PNG.

Columns and rows count from the top left, in camera order; the column comes first, as in JPEG Pleno's pictures and
reference software. A view in PGX is three files of one name in folders 0, 1 and 2: red, green and blue, or, for the
reference software, Y, Cb and Cr of BT.709. 8-bit codes become the nearest of the 1024 codes and return unchanged.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.atomic import atomic_path
from ..base.colour import of_video_codes, video_codes
from ..base.files import check_file, write_image
from ..picture.picture import IIPicture
from .pgx import Component, read_pgx, write_pgx
from .views import camera_views, read_view

TEN_BIT = 1023
KINDS = ("ppm", "pgx", "ycbcr", "png")
IN_PARTS = ("pgx", "ycbcr")  # PGX of RGB, and of YCbCr
COMPONENTS = ("0", "1", "2")  # folders of the components in PGX
MAX_HEADER = 256  # bytes
Pixels = NDArray[Any]


def write_pleno_views(picture: IIPicture, folder: Path, kind: str) -> int:
    """Write every view of an 8-bit picture; return the number of views.

    Parameters
    ----------
    picture : IIPicture
        Regular, uint8.
    folder : Path
        Created if missing.
    kind : {"ppm", "pgx", "ycbcr", "png"}

    Raises
    ------
    ValueError
        If the picture is not regular or not of 8 bit.
    """
    if picture.pixels.dtype != np.uint8:
        raise ValueError(f"picture is {picture.pixels.dtype}: views for other programs are made of uint8")
    make_view_folder(folder, kind)
    count = 0
    for row, col, view in camera_views(picture):
        name = view_name(row, col, kind)
        if kind == "ppm":
            write_ppm(folder / name, ten_bit(view))
        elif kind in IN_PARTS:
            ten = ten_bit(view) if kind == "pgx" else video_codes(view / 255)
            for part, codes in zip(COMPONENTS, np.moveaxis(ten, 2, 0), strict=True):
                write_pgx(folder / part / name, Component(codes.astype(np.int32), 10, signed=False))
        else:
            write_image(folder / name, view)
        count += 1
    return count


def make_view_folder(folder: Path, kind: str) -> None:
    """Create a folder for views with the folders of its components."""
    for part in COMPONENTS if kind in IN_PARTS else (".",):
        (folder / part).mkdir(parents=True, exist_ok=True)


def read_pleno_views(folder: Path, like: IIPicture, kind: str) -> IIPicture:
    """Return the picture of the views in a folder.

    Parameters
    ----------
    like : IIPicture
        Structure and camera.

    Raises
    ------
    ValueError
        If a view is missing, is no such picture, or has another size.
    OSError
        If a view cannot be read.
    """
    out = np.empty_like(like.pixels)
    empty = like.with_pixels(out)
    for row, col, view in camera_views(empty):  # views of `out`, in place
        name = view_name(row, col, kind)
        if kind in IN_PARTS:
            parts = [_read_codes(folder, f"{part}/{name}", kind, view.shape[:2]) for part in COMPONENTS]
            codes = np.stack(parts, axis=-1)
            view[...] = codes if kind == "pgx" else np.rint(np.clip(255 * of_video_codes(codes), 0, 255))
        else:
            view[...] = _read_codes(folder, name, kind, view.shape)
    return empty


def _read_codes(folder: Path, name: str, kind: str, shape: tuple[int, ...]) -> Pixels:
    """Return the 8-bit codes of a view or of one component of it; of YCbCr the codes in units of 10 bit."""
    path = folder / name
    if not path.is_file():
        raise ValueError(f"view {name} is missing")
    if kind == "ppm":
        found = _eight_bit(read_ppm(path), TEN_BIT)
    elif kind in IN_PARTS:
        component = read_pgx(path)
        codes, bits = component.codes - component.lowest, component.bits
        found = _eight_bit(codes, (1 << bits) - 1) if kind == "pgx" else codes * 2.0 ** (10 - bits)
    else:
        found = read_view(path)
    if found.shape != shape or found.dtype != (np.float64 if kind == "ycbcr" else np.uint8):
        raise ValueError(
            f"view {name} is {found.shape[1]}×{found.shape[0]} px of {found.dtype}: "
            f"{shape[1]}×{shape[0]} px of {found.dtype if kind == 'ycbcr' else 'uint8'} are needed"
        )
    return found


def view_name(row: int, col: int, kind: str) -> str:
    """Return the name of a view's file."""
    return f"{col:03}_{row:03}.{'pgx' if kind in IN_PARTS else kind}"


def write_ppm(path: Path, codes: Pixels) -> None:
    """Write (T, S, 3) codes of 10 bit as a binary PPM, two bytes a value, the high byte first."""
    height, width, _ = codes.shape
    with atomic_path(path) as temporary:
        temporary.write_bytes(f"P6\n{width} {height}\n{TEN_BIT}\n".encode() + codes.astype(">u2").tobytes())


def read_ppm(path: Path) -> Pixels:
    """Return the codes of a binary PPM of 10 bit, (T, S, 3) uint16.

    Raises
    ------
    ValueError
        If it is no such file, or its length does not fit its size.
    """
    check_file(path)
    data = path.read_bytes()
    words, end = _header(data[:MAX_HEADER])
    if len(words) != 4 or words[0] != b"P6" or not all(word.isdigit() and len(word) < 8 for word in words[1:]):
        raise ValueError(f"view {path.name} is no binary PPM")
    width, height, most = map(int, words[1:])
    if most != TEN_BIT:
        raise ValueError(f"view {path.name} has codes to {most}: {TEN_BIT}, 10 bit, are needed")
    if len(data) - end != 6 * width * height:
        raise ValueError(f"view {path.name} has {len(data) - end} bytes of pixels: {6 * width * height} are needed")
    codes = np.frombuffer(data, ">u2", offset=end).astype(np.uint16).reshape(height, width, 3)
    if codes.max(initial=0) > TEN_BIT:
        raise ValueError(f"view {path.name} has a code of {codes.max()}: at most {TEN_BIT} is allowed")
    return codes


def _header(data: bytes) -> tuple[list[bytes], int]:
    """Return the four words of a PPM's head, without comments, and where its pixels begin."""
    words: list[bytes] = []
    at = 0
    while len(words) < 4 and at < len(data):
        if data[at : at + 1].isspace():
            at += 1
        elif data[at : at + 1] == b"#":
            at = data.find(b"\n", at) + 1 or len(data)
        else:
            stop = next((i for i in range(at, len(data)) if data[i : i + 1].isspace()), len(data))
            words.append(data[at:stop])
            at = stop
    return words, at + 1  # one white space ends the head


def ten_bit(codes: Pixels) -> Pixels:
    """Return the nearest of the 1024 codes of 8-bit codes."""
    return (codes.astype(np.uint32) * TEN_BIT * 2 + 255) // 510


def _eight_bit(codes: Pixels, highest: int) -> Pixels:
    return ((codes.astype(np.uint32) * 255 * 2 + highest) // (2 * highest)).astype(np.uint8)
