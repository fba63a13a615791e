"""Orientation and colour profile of picture files: EXIF's tag, and ICC profiles of three primaries and curves.

Pixels come out upright, as sRGB codes. A profile with linear curves, as raw converters embed in their linear TIFF of
16 bit, thus becomes sRGB as well. Profiles that are tables, or of other colour spaces than RGB, are refused.

References
----------
ICC.1:2022, sections 9.2 and 10.
"""

from __future__ import annotations

import os
import struct
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from ..base.colour import srgb
from ..base.files import check_file, check_name, one_line, read_image

# From the D50 of profiles to linear sRGB: inverse of the primaries that sRGB's own profiles have.
TO_SRGB = np.linalg.inv(
    np.array([[0.43607, 0.38515, 0.14307], [0.22249, 0.71687, 0.06061], [0.01392, 0.09708, 0.71410]])
)
MOST_PROFILE = 4 << 20  # bytes
SAME = 1.5 / 255  # difference of codes up to which a profile is sRGB; profiles of sRGB differ in the third digit
BLOCK = 64  # rows converted at once


def read_upright(path: str | os.PathLike[str]) -> NDArray[Any]:
    """Return a picture, (N, M, channels), turned as EXIF says, its colours converted to sRGB.

    Raises
    ------
    ValueError
        If its profile is of no known kind or is damaged.
    OSError
        If it cannot be read.
    """
    path = Path(path)
    orientation, profile = _tags(path)
    pixels = turned(read_image(path), orientation)
    if profile is None or pixels.shape[2] not in (3, 4) or pixels.dtype.kind == "f":
        return pixels
    try:
        curves, matrix = parse_profile(profile)
    except (ValueError, struct.error, IndexError, OverflowError, np.linalg.LinAlgError) as error:
        raise ValueError(f"{path} has a colour profile that is no matrix with curves: {one_line(error)}; "
                         "convert it to sRGB first") from None  # fmt: skip
    return pixels if _is_srgb(curves, matrix) else _converted(pixels, curves, matrix)


def turned(pixels: NDArray[Any], orientation: int) -> NDArray[Any]:
    """Return pixels as they are to be seen, by EXIF's orientation from 1 to 8; other numbers change nothing."""
    if orientation in (5, 6, 7, 8):
        pixels = pixels.transpose(1, 0, 2)
    if orientation in (2, 3, 6, 7):
        pixels = pixels[:, ::-1]
    if orientation in (3, 4, 7, 8):
        pixels = pixels[::-1]
    return np.ascontiguousarray(pixels)


def _tags(path: Path) -> tuple[int, bytes | None]:
    """Return orientation and profile of a file's header; unreadable files are left to `read_image`."""
    check_file(path)
    check_name(path)
    source = oiio.ImageInput.open(str(path))
    if not source:
        oiio.geterror()
        return 1, None
    spec = source.spec()
    orientation = spec.get_int_attribute("Orientation", 1)
    profile = next((a.value for a in spec.extra_attribs if a.name == "ICCProfile"), None)
    source.close()
    if profile is None:
        return orientation, None
    data = np.asarray(profile).astype(np.uint8).tobytes()
    if len(data) > MOST_PROFILE:
        raise ValueError(f"{path} has a colour profile of {len(data)} bytes: at most {MOST_PROFILE} are read")
    return orientation, data


def parse_profile(data: bytes) -> tuple[list[NDArray[np.float64]], NDArray[np.float64]]:
    """Return the curves of red, green and blue, at 65536 codes each, and the matrix to linear sRGB.

    Raises
    ------
    ValueError, struct.error
        If the profile has no curves and primaries, or is of another colour space.
    """
    if len(data) < 132 or data[36:40] != b"acsp":
        raise ValueError("it does not begin as profiles do")
    if data[16:20] != b"RGB " or data[20:24] != b"XYZ ":
        spaces = [data[at : at + 4].decode("ascii", "replace").strip() for at in (16, 20)]
        raise ValueError(f"it converts {spaces[0]!r} to {spaces[1]!r}")
    (count,) = struct.unpack_from(">I", data, 128)
    if count > 100:
        raise ValueError(f"it has {count} tags")
    tags = {}
    for i in range(count):
        name, offset, size = struct.unpack_from(">4sII", data, 132 + 12 * i)
        tags[name] = data[offset : offset + size]
    if b"A2B0" in tags:
        raise ValueError("it is a table")
    if missing := [name for name in (b"rXYZ", b"gXYZ", b"bXYZ", b"rTRC", b"gTRC", b"bTRC") if name not in tags]:
        raise ValueError(f"it has no {missing[0].decode()}")
    primaries = [_fixed(tags[name], 8, 3) for name in (b"rXYZ", b"gXYZ", b"bXYZ")]
    matrix = TO_SRGB @ np.array(primaries).T
    return [_curve(tags[name]) for name in (b"rTRC", b"gTRC", b"bTRC")], matrix


def _fixed(data: bytes, at: int, count: int) -> NDArray[np.float64]:
    return np.array(struct.unpack_from(f">{count}i", data, at), np.float64) / 65536


def _curve(data: bytes) -> NDArray[np.float64]:
    """Return a tone curve at 65536 codes from 0 to 1."""
    x = np.linspace(0, 1, 65536)
    if data[:4] == b"curv":
        (count,) = struct.unpack_from(">I", data, 8)
        if count == 0:
            return x
        if count == 1:
            return np.asarray(x ** (struct.unpack_from(">H", data, 12)[0] / 256))
        table = np.frombuffer(data, ">u2", count, 12) / 65535
        return np.interp(x, np.linspace(0, 1, count), table)
    if data[:4] != b"para":
        raise ValueError(f"its curves are of the kind {data[:4].decode('ascii', 'replace')!r}")
    (kind,) = struct.unpack_from(">H", data, 8)
    if kind > 4:
        raise ValueError(f"its curves have the parametric form {kind}")
    given = _fixed(data, 12, (1, 3, 4, 5, 7)[kind])
    g, a, b, c, d, e, f = (*given[:1], *((1, 0) if kind == 0 else given[1:3]), *np.zeros(4))[:7]
    if kind == 1:
        d = -b / a
    elif kind == 2:
        c, d, e, f = 0.0, -b / a, given[3], given[3]
    elif kind >= 3:
        c, d = given[3:5]
        e, f = given[5:7] if kind == 4 else (0.0, 0.0)
    with np.errstate(all="ignore"):
        curve = np.where(x >= d, np.maximum(a * x + b, 0) ** g + e, c * x + f)
    if not np.isfinite(curve).all():
        raise ValueError("its curves are not finite")
    return np.clip(curve, 0, 1)


def _is_srgb(curves: list[NDArray[np.float64]], matrix: NDArray[np.float64]) -> bool:
    """Return whether a profile leaves all corners and greys of sRGB within `SAME`."""
    codes = np.stack(np.meshgrid(*[np.linspace(0, 65535, 6).astype(int)] * 3), axis=-1).reshape(-1, 3)
    light = np.stack([curve[codes[:, i]] for i, curve in enumerate(curves)], axis=-1) @ matrix.T
    return bool(np.abs(srgb(np.clip(light, 0, 1)) - codes / 65535).max() < SAME)


def _converted(pixels: NDArray[Any], curves: list[NDArray[np.float64]], matrix: NDArray[np.float64]) -> NDArray[Any]:
    """Return sRGB codes of codes of a profile; a fourth channel stays."""
    most = np.iinfo(pixels.dtype).max
    tables = [curve[:: 65535 // most].astype(np.float32) for curve in curves]
    out = pixels.copy()
    for top in range(0, len(pixels), BLOCK):
        rows = pixels[top : top + BLOCK]
        light = np.stack([tables[i][rows[..., i]] for i in range(3)], axis=-1) @ matrix.T.astype(np.float32)
        out[top : top + BLOCK, :, :3] = np.rint(most * srgb(np.clip(light, 0, 1)))
    return out
