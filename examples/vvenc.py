"""Encoder and decoder commands for `raytrace-ii benchmark`: VVC by VVenC, at a target size.

python examples/vvenc.py encode FOLDER FILE BYTES ROWS COLUMNS WIDTH HEIGHT [PRESET]
python examples/vvenc.py decode FILE FOLDER
FOLDER holds views as YCbCr in PGX (``--views ycbcr``). The program is FFmpeg of the package imageio-ffmpeg, which
carries VVenC. The views form one sequence with one I picture, in serpentine order. VVenC takes 4:2:0 of 10 bit alone:
chroma is reduced by a Lanczos filter, and corrected such that the decoder's Lanczos enlargement is nearest to it. The
quantisation parameter is the least with at most BYTES bytes; tuning to perception is off. PRESET is "slower" by
default.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ii_core.formats.pgx import Component, read_pgx, write_pgx

QUIET = ("-loglevel", "error", "-y")
FINEST, COARSEST = 0, 63
LEAST_SIDE = 64
CORRECTIONS = 6  # of the reduced chroma; further ones change it by less than a code


def main() -> None:
    """Encode or decode."""
    what, *words = sys.argv[1:] or [""]
    if what == "encode" and len(words) in (7, 8):
        encode(Path(words[0]), Path(words[1]), int(words[2]), *map(int, words[3:7]), *words[7:])  # type: ignore[arg-type]
    elif what == "decode" and len(words) == 2:
        decode(Path(words[0]), Path(words[1]))
    else:
        raise SystemExit(__doc__)


def encode(
    folder: Path, file: Path, limit: int, rows: int, columns: int, width: int, height: int, preset: str = "slower"
) -> None:
    """Write the largest file within the target."""
    size = padded(width), padded(height)
    raw = b"".join(frame(folder, name, size) for name in names(rows, columns))
    head = json.dumps({"rows": rows, "columns": columns, "width": width, "height": height}).encode() + b"\n"
    low, high = FINEST, COARSEST + 1
    streams: dict[int, bytes] = {}
    while low < high:
        middle = (low + high) // 2
        streams[middle] = head + coded(raw, size, middle, preset)
        low, high = (low, middle) if len(streams[middle]) <= limit else (middle + 1, high)
    if low > COARSEST:
        raise SystemExit(f"{limit} bytes are too few: the smallest file has {len(streams[COARSEST])}")
    file.write_bytes(streams[low])


def decode(file: Path, folder: Path) -> None:
    """Write the views of a file."""
    head, stream = file.read_bytes().split(b"\n", 1)
    sizes = json.loads(head)
    width, height = sizes["width"], sizes["height"]
    wide, high = padded(width), padded(height)
    command = [program(), *QUIET, "-f", "vvc", "-i", "-", "-f", "rawvideo", "-pix_fmt", "yuv420p10le", "-"]
    raw = subprocess.run(command, input=stream, stdout=subprocess.PIPE, check=True).stdout
    frames = np.frombuffer(raw, "<u2").reshape(sizes["rows"] * sizes["columns"], -1)
    for i in range(3):
        (folder / str(i)).mkdir(exist_ok=True)
    for name, codes in zip(names(sizes["rows"], sizes["columns"]), frames, strict=True):
        luma, *chroma = np.split(codes, [wide * high, wide * high * 5 // 4])
        planes = [luma.reshape(high, wide)]
        planes += [resized(plane.reshape(high // 2, wide // 2), (wide, high)) for plane in chroma]
        for i, plane in enumerate(planes):
            values = np.clip(np.rint(plane[:height, :width]), 0, 1023).astype(np.int32)
            write_pgx(folder / str(i) / name, Component(values, 10, False))


def padded(side: int) -> int:
    """Return the side of a frame: even for 4:2:0, and not too small for the program's buffer of a frame."""
    return max(LEAST_SIDE, side + side % 2)


def names(rows: int, columns: int) -> list[str]:
    """Return names of views in serpentine order: even rows from the left, odd ones from the right."""
    return [
        f"{column if row % 2 == 0 else columns - 1 - column:03d}_{row:03d}.pgx"
        for row in range(rows)
        for column in range(columns)
    ]


def frame(folder: Path, name: str, size: tuple[int, int]) -> bytes:
    """Return the samples of a view as 4:2:0; its border is repeated up to the size."""
    planes = []
    for i in range(3):
        plane = read_pgx(folder / str(i) / name).codes.astype(np.float32)
        margin = size[1] - plane.shape[0], size[0] - plane.shape[1]
        plane = np.pad(plane, ((0, margin[0]), (0, margin[1])), mode="edge")
        planes.append(plane if i == 0 else reduced(plane))
    return b"".join(np.clip(np.rint(plane), 0, 1023).astype("<u2").tobytes() for plane in planes)


def reduced(plane: NDArray[Any]) -> NDArray[Any]:
    """Return a plane of half the sides whose enlargement is near to it."""
    whole = plane.shape[1], plane.shape[0]
    half = whole[0] // 2, whole[1] // 2
    small = resized(plane, half)
    for _ in range(CORRECTIONS):
        small = small + resized(plane - resized(small, whole), half)
    return small


def resized(plane: NDArray[Any], size: tuple[int, int]) -> NDArray[Any]:
    """Return a plane of another size (width, height) by a Lanczos filter."""
    return np.asarray(Image.fromarray(plane.astype(np.float32)).resize(size, Image.Resampling.LANCZOS))


def program() -> str:
    """Return the path of FFmpeg."""
    try:
        from imageio_ffmpeg import get_ffmpeg_exe
    except ModuleNotFoundError:
        raise SystemExit("imageio-ffmpeg is not installed: pip install imageio-ffmpeg") from None
    return str(get_ffmpeg_exe())


def coded(raw: bytes, size: tuple[int, int], parameter: int, preset: str) -> bytes:
    """Return the stream of frames at a quantisation parameter."""
    source = ("-f", "rawvideo", "-pix_fmt", "yuv420p10le", "-s", f"{size[0]}x{size[1]}", "-r", "25", "-i", "-")
    coder = ("-c:v", "libvvenc", "-preset", preset, "-qp", str(parameter), "-qpa", "0", "-period", "1000000")
    command = [program(), *QUIET, *source, *coder, "-threads", "1", "-f", "vvc", "-"]
    return subprocess.run(command, input=raw, stdout=subprocess.PIPE, check=True).stdout


if __name__ == "__main__":
    main()
