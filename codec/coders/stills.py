"""Coders of the II-picture as a single picture: JPEG, JPEG XL, High-Throughput JPEG 2000.

None has usable rate control: a target rate is met by a search of the quality.
"""

from __future__ import annotations

import io
import re
import struct
import sys
import threading
from abc import abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from typing import Any, ClassVar

import numpy as np
import PIL
from numpy.typing import NDArray
from PIL import Image, features
from PIL.JpegImagePlugin import JpegImageFile

from ii_core import IIPicture
from ii_core.base.extras import Lazy

from ..bitstream.jpeg2000 import without_comments
from ..clock import cpu_seconds
from ..contract import Coder, Goal, Option, Options, Pixels
from ..search import Axis, CodingResult, Run, meet_size

imagecodecs = Lazy("imagecodecs")

LOSSLESS = Option(about="1 for lossless coding", default=0, low=0, high=1)


class Still(Coder):
    """Coder of one picture with one setting of quality.

    Attributes
    ----------
    axis : Axis
        Settings of the search for a rate.
    """

    axis: ClassVar[Axis]

    def check(self, picture: IIPicture, options: Options) -> None:
        """Accept any size."""

    def encode(self, picture: IIPicture, options: Options, goal: Goal) -> CodingResult:
        """Meet a goal; a rate above that of lossless coding gives the lossless picture, if the coder has one."""
        pixels = np.ascontiguousarray(picture.pixels)
        at_setting = partial(self._timed_run, pixels, options)
        if self.lossless(options):
            return CodingResult(run=at_setting(None))
        if goal.bpp is None:
            return CodingResult(run=at_setting(goal.quality if goal.qp is None else goal.qp))
        return meet_size(
            at_setting,
            goal.bpp * picture.size[0] * picture.size[1] / 8,
            self.axis,
            finest=partial(at_setting, None) if "lossless" in self.options else None,
        )

    def decode(self, payload: bytes, blank: IIPicture, options: Options) -> tuple[Pixels, float]:
        """Decode; a stream of another size is refused before memory is allocated."""
        started = cpu_seconds()
        pixels = self._run_decoder(payload, blank, options)
        if pixels.shape != blank.pixels.shape or pixels.dtype != blank.pixels.dtype:
            raise ValueError(
                f"its picture is {pixels.shape} {pixels.dtype}, {blank.pixels.shape} {blank.pixels.dtype} is needed"
            )
        return pixels, cpu_seconds() - started

    def _timed_run(self, pixels: NDArray[Any], options: Options, setting: float | None) -> Run:
        started = cpu_seconds()
        payload = self._run_encoder(pixels, options, setting)
        return Run(payload, cpu_seconds() - started)

    @abstractmethod
    def _run_encoder(self, pixels: NDArray[Any], options: Options, setting: float | None) -> bytes:
        """Run the encoder at a setting; None means lossless."""

    @abstractmethod
    def _run_decoder(self, payload: bytes, blank: IIPicture, options: Options) -> Pixels:
        """Run the decoder."""


# Tables K.1 and K.2 of ISO/IEC 10918-1, row by row; encoders scale them by quality.
# fmt: off
LUMINANCE = np.array([
    16, 11, 10, 16, 24, 40, 51, 61,  12, 12, 14, 19, 26, 58, 60, 55,  14, 13, 16, 24, 40, 57, 69, 56,
    14, 17, 22, 29, 51, 87, 80, 62,  18, 22, 37, 56, 68, 109, 103, 77,  24, 35, 55, 64, 81, 104, 113, 92,
    49, 64, 78, 87, 103, 121, 120, 101,  72, 92, 95, 98, 112, 100, 103, 99,
])
CHROMINANCE = np.array([
    17, 18, 24, 47, 99, 99, 99, 99,  18, 21, 26, 66, 99, 99, 99, 99,  24, 26, 56, 99, 99, 99, 99, 99,
    47, 66, 99, 99, 99, 99, 99, 99,  *(32 * [99]),
])
# fmt: on


class Jpeg(Still):
    """Progressive JPEG with optimised Huffman tables, by libjpeg-turbo through Pillow.

    Qualities are those of libjpeg. Fractional qualities interpolate the quantiser tables, so that rates can be met.
    """

    name = "jpeg"
    about = "The II-picture itself, progressive JPEG by libjpeg-turbo"
    options: ClassVar[Mapping[str, Option]] = {
        "chroma": Option(about="444 for full chroma, 420 for a quarter", default="444", choices=("444", "420")),
    }
    quality_range: ClassVar[tuple[float, float] | None] = (1.0, 100.0)
    scale_about = "libjpeg's quality"
    axis = Axis(low=1.0, high=100.0, start=20.0, octave=25.0)
    max_side = 65500  # libjpeg's
    # Every block has a DC coefficient of at least a bit: six blocks in 16×16 pixels at 4:2:0.
    pixels_a_byte = 8 * 256 // 6

    @property
    def versions(self) -> dict[str, str]:
        """Return the versions of Pillow and its libjpeg-turbo."""
        return {"pillow": PIL.__version__, "libjpeg-turbo": str(features.version("libjpeg_turbo"))}

    def check(self, picture: IIPicture, options: Options) -> None:
        """Refuse pictures larger than the 16-bit sizes of JPEG."""
        if max(picture.size) > self.max_side:
            width, height = picture.size
            raise ValueError(f"the picture has {width}×{height} pixels: JPEG takes {self.max_side} a side at most")

    def _run_encoder(self, pixels: NDArray[Any], options: Options, setting: float | None) -> bytes:
        assert setting is not None
        out = io.BytesIO()
        Image.fromarray(pixels).save(
            out,
            "JPEG",
            qtables=jpeg_tables(setting),
            subsampling={"444": "4:4:4", "420": "4:2:0"}[str(options["chroma"])],
            progressive=True,
        )
        return out.getvalue()

    def _run_decoder(self, payload: bytes, blank: IIPicture, options: Options) -> Pixels:
        width, height = blank.size
        if len(payload) * self.pixels_a_byte < width * height:
            raise ValueError(f"its JPEG stream of {len(payload)} bytes cannot hold {width}×{height} pixels")
        try:
            with JpegImageFile(io.BytesIO(payload)) as image:
                if image.size != blank.size or image.mode != "RGB":
                    raise ValueError(f"its JPEG stream is {image.size} {image.mode}, {blank.size} RGB is needed")
                return np.array(image)
        except (OSError, SyntaxError, IndexError, KeyError, struct.error) as error:
            raise ValueError(f"its JPEG stream does not decode ({error})") from None


def jpeg_tables(quality: float) -> list[list[int]]:
    """Return libjpeg's quantiser tables of a quality from 1 to 100, row by row, with an unrounded scale."""
    scale = 50 / quality if quality < 50 else 2 - quality / 50
    return [np.clip(np.floor(table * scale + 0.5), 1, 255).astype(int).tolist() for table in (LUMINANCE, CHROMINANCE)]


class JpegXl(Still):
    """JPEG XL as a bare codestream, by libjxl through imagecodecs: lossy in XYB colour space, or lossless."""

    name = "jpegxl"
    about = "The II-picture itself, JPEG XL by libjxl"
    dtypes: ClassVar[tuple[str, ...]] = ("uint8", "uint16")
    options: ClassVar[Mapping[str, Option]] = {
        "effort": Option(about="of the encoder, time against size", default=7, low=1, high=9),
        "lossless": LOSSLESS,
    }
    presets: ClassVar[Mapping[str, Options]] = {"fast": {"effort": 3}, "best": {"effort": 9}}
    quality_range: ClassVar[tuple[float, float] | None] = (0.0, 100.0)
    scale_about = "libjxl's quality: 90 is distance 1, 100 is lossless"
    axis = Axis(low=0.0, high=99.9, start=30.0, octave=25.0)

    @property
    def versions(self) -> dict[str, str]:
        """Return the versions of imagecodecs and its libjxl."""
        return {"imagecodecs": imagecodecs.__version__, "libjxl": imagecodecs.jpegxl_version().split()[-1]}

    def _run_encoder(self, pixels: NDArray[Any], options: Options, setting: float | None) -> bytes:
        how: dict[str, Any] = {"lossless": True}
        if setting is not None and setting < 100:
            how = {"distance": jpegxl_distance(setting)}
        effort = int(options["effort"])
        stream = imagecodecs.jpegxl_encode(pixels, effort=effort, usecontainer=False, numthreads=1, **how)
        return jpegxl_codestream(bytes(stream))

    def _run_decoder(self, payload: bytes, blank: IIPicture, options: Options) -> Pixels:
        if (size := jpegxl_size(payload)) != blank.size:
            raise ValueError(f"its JPEG XL stream is {size}, {blank.size} is needed")
        try:
            return imagecodecs.jpegxl_decode(payload, numthreads=1)
        except (RuntimeError, ValueError) as error:
            raise ValueError(f"its JPEG XL stream does not decode ({error})") from None


def jpegxl_distance(quality: float) -> float:
    """Return libjxl's distance for a quality from 0 to 100."""
    if quality >= 30:
        return 0.1 + (100 - quality) * 0.09
    return 53 / 3000 * quality**2 - 23 / 20 * quality + 25


def jpegxl_codestream(stream: bytes) -> bytes:
    """Return the codestream without the container that libjxl writes for 16-bit pictures."""
    if stream.startswith(b"\xff\x0a"):
        return stream
    parts, at = [], 0
    while at < len(stream):
        size, kind = struct.unpack_from(">I4s", stream, at)
        if kind == b"jxlc":
            parts.append(stream[at + 8 : at + size if size else None])
        at += size or len(stream)
    return b"".join(parts)


def jpegxl_size(stream: bytes) -> tuple[int, int] | None:
    """Return (M, N) of a JPEG XL codestream from its SizeHeader (ISO/IEC 18181-1); None for other data."""
    if stream[:2] != b"\xff\x0a":
        return None
    bits, at = int.from_bytes(stream[2:14], "little"), 0

    def take(count: int) -> int:
        nonlocal at
        at += count
        return bits >> (at - count) & ((1 << count) - 1)

    small = take(1)

    def side() -> int:
        return 8 * (1 + take(5)) if small else 1 + take((9, 13, 18, 30)[take(2)])

    height = side()
    ratio = take(3)
    if ratio:
        above, below = ((1, 1), (12, 10), (4, 3), (3, 2), (16, 9), (5, 4), (2, 1))[ratio - 1]
        return height * above // below, height
    return side(), height


class Htj2k(Still):
    """High-Throughput JPEG 2000 (Part 15), by OpenJPH through imagecodecs: 9/7 and one quantiser, or 5/3 lossless.

    Its block coder is an order of magnitude faster than that of Part 1. Its streams cannot be truncated to a rate.
    """

    name = "htj2k"
    about = "The II-picture itself, High-Throughput JPEG 2000 by OpenJPH"
    dtypes: ClassVar[tuple[str, ...]] = ("uint8", "uint16")
    options: ClassVar[Mapping[str, Option]] = {"lossless": LOSSLESS}
    qp_range: ClassVar[tuple[int, int] | None] = (0, 60)
    scale_about = "OpenJPH's base step is 0.625·2^(qp/6) 8-bit codes"
    axis = Axis(low=6.0, high=60.0, start=40.0, octave=-5.0)
    levels = 5

    @property
    def versions(self) -> dict[str, str]:
        """Return the versions of imagecodecs and its OpenJPH."""
        return {"imagecodecs": imagecodecs.__version__, "openjph": imagecodecs.htj2k_version().split()[-1]}

    def _run_encoder(self, pixels: NDArray[Any], options: Options, setting: float | None) -> bytes:
        step = 0.0 if setting is None else min(0.625 * 2 ** (setting / 6) / 256, 1.0)
        stream = imagecodecs.htj2k_encode(
            pixels, step, rgb=True, planar=False, resolutions=self.levels, reversible=setting is None
        )
        return b"\xff\x4f" + without_comments(bytes(stream)[2:])

    def _run_decoder(self, payload: bytes, blank: IIPicture, options: Options) -> Pixels:
        if not _htj2k_head(blank).match(payload) or not payload.endswith(b"\xff\xd9"):
            raise ValueError(f"its HTJ2K stream is not a whole one for {blank.size} {blank.pixels.dtype}")
        try:
            with _raised():
                return imagecodecs.htj2k_decode(payload, planar=False)
        except (RuntimeError, ValueError) as error:
            raise ValueError(f"its HTJ2K stream does not decode ({error})") from None


_hooks = threading.Lock()


@contextmanager
def _raised() -> Iterator[None]:
    """Raise exceptions of OpenJPH that its binding only prints, by two hooks of the process."""
    thrown: list[BaseException | None] = []

    def keep(args: Any) -> None:
        if "_htj2k" in str(args.object):
            thrown.append(args.exc_value)
        else:
            unraisable(args)

    with _hooks:  # one set of hooks per process
        printing, unraisable = sys.excepthook, sys.unraisablehook
        sys.excepthook, sys.unraisablehook = lambda *_: None, keep
        try:
            yield
        finally:
            sys.excepthook, sys.unraisablehook = printing, unraisable
    if thrown:
        raise RuntimeError(thrown[0])


def _htj2k_head(blank: IIPicture) -> re.Pattern[bytes]:
    """Return the pattern of main headers of `Htj2k`, with free quantiser steps; its decoder may crash on others."""
    (width, height), bits = blank.size, 8 * blank.pixels.dtype.itemsize
    size = struct.pack(">HH8IH", 47, 0x4000, width, height, 0, 0, width, height, 0, 0, 3)
    size += bytes((bits - 1, 1, 1)) * 3
    ways = []
    for levels in range(Htj2k.levels + 1):  # imagecodecs 2026.10 divides small pictures fewer times
        bands = 3 * levels + 1
        least = b"\x08" if levels == Htj2k.levels else b"\x00"  # exponents from 1 or 0 up to 20
        for reversible, guard, rest in ((0, 0x22, b"."), (1, 0x20, b"")):
            style = struct.pack(">HHBBHBBBBBB", 0xFF52, 12, 0, 2, 1, 1, levels, 4, 4, 0x40, reversible)
            steps = struct.pack(">HHB", 0xFF5C, 3 + (1 if reversible else 2) * bands, guard)
            ways.append(re.escape(style + steps) + b"(?:[%s-\xa7]%s){%d}" % (least, rest, bands))
    capabilities = b"\xff\x50\x00\x08\x00\x02\x00\x00\x00[\x00-\x3f]"
    pattern = re.escape(b"\xff\x4f\xff\x51" + size) + capabilities + b"(?:" + b"|".join(ways) + b")\xff\x90"
    return re.compile(pattern, re.DOTALL)
