"""Coder of volumes: component images as slices, a wavelet along the slice axis, JPEG 2000 within slices.

The scheme approximates JPEG 2000 Part 10 (JP3D), of which no packaged implementation exists. It applies a dyadic CDF
9/7 or 5/3 along the slices (`codec.coders.lifting`), and codes all slices of all bands and colours as components of
one JPEG 2000 codestream (`codec.coders.planes`). Each slice is scaled by the synthesis gain of its band: rate control
then compares errors as large as they are in the picture. Part 10's three-dimensional code blocks are missing.

Colours are rotated to the principal axes of the picture's colours; a rotation keeps the size of errors. Lossless
coding uses the reversible colour transform and the reversible 5/3 of the standard.

Without the wavelet along the slices, each component image is a JPEG 2000 picture of its own, at one slope for all.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ii_core import IIPicture
from ii_core.base.extras import Lazy
from ii_core.base.jit import kernel

from ..clock import cpu_seconds
from ..contract import Coder, Goal, Option, Options, Pixels
from ..frames import Layout, layout
from ..order import BY, ORDERS
from ..search import Axis, CodingResult, Run, meet_size
from . import lifting
from .planes import MAX_COMPONENTS, decode_planes, encode_planes, picked_planes

imagecodecs = Lazy("imagecodecs")

NAMES = {"ei": "elementary images", "si": "sub-images", "ri": "ray-space images"}

# Largest number of slices in one codestream, in three colours. More slices make volumes of GROUP slices each.
MAX_SLICES = MAX_COMPONENTS // 3
GROUP = 1024

# Range of qualities, and the change that about doubles the size.
COARSEST_DB, FINEST_DB, DB_AN_OCTAVE = 0.0, 70.0, 3.0
# Largest quality to search, by bits of a sample: above it lossless coding takes few more bytes.
NEARLY_LOSSLESS_DB = {8: 55.0, 16: 70.0}
START_DB = 33.0  # at one bit per pixel
# Largest part of the allowed error that comes from rounding coefficients to whole numbers before coding.
ROUNDING = 0.005
# Binary logarithms of the rounding step. 2^-2 suffices for 70 dB, and 16 bits hold the gains of eight levels.
FINEST_STEP, COARSEST_STEP = -2, 8

LOSSLESS, LOSSY = 0, 1
_HEAD = struct.Struct("<Bb9h")
_UNIT = 1 << 14  # unit of the colour matrix in the header
_LENGTH = struct.Struct("<I")


class Volume(Coder):
    """Component images of one kind as slices of a volume, or each alone.

    The payload is a header of 20 bytes (kind of coding, rounding step, colour matrix), then for each group of slices
    the length of its codestream and the codestream, without the fields that structure and options determine. Up to
    1365 slices are one group; more slices make groups of 1024, which meet one squared error.

    References
    ----------
    Olsson 2008, §5.5.2 (SI-PVI), §5.7; ISO/IEC 15444-1, Annexes E to G, and 15444-10.
    """

    dtypes: ClassVar[tuple[str, ...]] = ("uint8", "uint16")
    quality_range: ClassVar[tuple[float, float] | None] = (COARSEST_DB, FINEST_DB)
    scale_about = "PSNR over all colours in dB, nearly met"
    options: ClassVar[Mapping[str, Option]] = {
        "order": Option(about="of the component images", default="parallel", choices=tuple(ORDERS)),
        "by": Option(about="whether the order goes by rows or by columns", default="rows", choices=BY),
        "wavelet": Option(about="CDF 9/7 or 5/3, in all directions", default="97", choices=("97", "53")),
        "levels": Option(about="of the wavelet along the slices", default=5, low=0, high=8),
        "lossless": Option(about="1 for lossless coding, with the reversible 5/3", default=0, low=0, high=1),
    }

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self.name = f"{kind}-jp3d"
        self.about = f"All {NAMES[kind]} as one volume, in the manner of JPEG 2000 Part 10 (JP3D)"

    @property
    def versions(self) -> dict[str, str]:
        """Return the versions of imagecodecs and its OpenJPEG."""
        return {"imagecodecs": imagecodecs.__version__, "openjpeg": imagecodecs.jpeg2k_version().split()[-1]}

    def check(self, picture: IIPicture, options: Options) -> None:
        """Accept any size."""

    def encode(self, picture: IIPicture, options: Options, goal: Goal) -> CodingResult:
        """Meet a goal; a rate above that of lossless coding gives the lossless picture."""
        cut = self._cut(picture, options)
        pixels = np.ascontiguousarray(picture.pixels).reshape(-1, 3)
        exact = partial(_encode_lossless, pixels, cut)
        if options["lossless"]:
            return CodingResult(run=exact())
        colours = principal_axes(pixels)
        at_quality = partial(_encode_lossy, pixels, cut, colours)
        if goal.quality is not None:
            return CodingResult(run=at_quality(goal.quality))
        assert goal.bpp is not None
        axis = Axis(
            low=COARSEST_DB,
            high=NEARLY_LOSSLESS_DB[cut.bits],
            start=START_DB + DB_AN_OCTAVE * math.log2(goal.bpp),
            octave=DB_AN_OCTAVE,
        )
        return meet_size(at_quality, goal.bpp * pixels.shape[0] / 8, axis, finest=exact)

    def decode(self, payload: bytes, blank: IIPicture, options: Options) -> tuple[Pixels, float]:
        """Decode group by group; the structure gives the size of each codestream."""
        frames = layout(blank.lenses, blank.ei_pixels, self.kind).frames
        if len(payload) < 3 * frames:  # a slice has at least one packet in each of three planes
            raise ValueError(f"its JPEG 2000 stream of {len(payload)} bytes cannot hold {frames} slices")
        cut = self._cut(blank, options)
        mode, step, colours, streams = _parts(payload, len(cut.groups))
        pixels = np.empty((0, 3), blank.pixels.dtype)
        seconds = 0.0
        for stream, origins in zip(streams, cut.groups, strict=True):
            shape = (3 * len(origins), cut.shape.height, cut.shape.width)
            started = cpu_seconds()
            if mode == LOSSLESS:
                planes = decode_planes(stream, shape, cut.whole_dtype, wavelet="5/3", lossless=True)
            else:
                planes = decode_planes(stream, shape, "int16", wavelet=cut.wavelet, lossless=False)
            seconds += cpu_seconds() - started
            if not len(pixels):
                pixels = np.empty((blank.pixels.size // 3, 3), blank.pixels.dtype)
            planes = planes.reshape(3, len(origins), cut.shape.height, cut.shape.width)
            if mode == LOSSLESS:
                _from_whole(planes, cut, origins, pixels)
            else:
                _from_real(planes, cut, origins, colours, step, pixels)
        return pixels.reshape(blank.pixels.shape), seconds

    def _cut(self, picture: IIPicture, options: Options) -> _Cut:
        shape = layout(picture.lenses, picture.ei_pixels, self.kind)
        origins = shape.origins(str(options.get("order", "row")), str(options.get("by", "rows")))
        size = GROUP if shape.frames > MAX_SLICES else shape.frames
        return _Cut(
            shape=shape,
            groups=[origins[first : first + size] for first in range(0, shape.frames, size)],
            wavelet={"97": "9/7", "53": "5/3"}[str(options["wavelet"])],
            levels=int(options.get("levels", 0)),
            bits=8 * picture.pixels.dtype.itemsize,
        )


class Separate(Volume):
    """Component images of one kind, each a JPEG 2000 picture that refers to no other, at one slope for all."""

    options: ClassVar[Mapping[str, Option]] = {key: Volume.options[key] for key in ("wavelet", "lossless")}
    components_alone: ClassVar[bool] = True

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self.name = f"{kind}-jpeg2000"
        self.about = f"All {NAMES[kind]}, each alone, JPEG 2000 at one slope for all, by OpenJPEG"

    def decode_component(self, payload: bytes, blank: IIPicture, options: Options, index: int) -> Pixels:
        """Decode one component image by its own packets; ``index`` counts the grid row by row."""
        cut = self._cut(blank, options)
        mode, step, colours, streams = _parts(payload, len(cut.groups))
        sizes = np.cumsum([len(origins) for origins in cut.groups])
        group = int(np.searchsorted(sizes, index, side="right"))
        count = len(cut.groups[group])
        place = index - int(sizes[group]) + count
        shape = (3 * count, cut.shape.height, cut.shape.width)
        dtype, wavelet = (cut.whole_dtype, "5/3") if mode == LOSSLESS else ("int16", cut.wavelet)
        picked = [place, place + count, place + 2 * count]
        planes = picked_planes(streams[group], shape, dtype, picked, wavelet=wavelet, lossless=mode == LOSSLESS)
        alone = replace(cut, shape=replace(cut.shape, step_y=cut.shape.width, step_x=1))
        pixels = np.empty((cut.shape.height * cut.shape.width, 3), blank.pixels.dtype)
        planes, origin = planes.reshape(3, 1, *planes.shape[1:]), np.zeros(1, np.int64)
        if mode == LOSSLESS:
            _from_whole(planes, alone, origin, pixels)
        else:
            _from_real(planes, alone, origin, colours, step, pixels)
        return pixels.reshape(cut.shape.height, cut.shape.width, 3)


@dataclass(frozen=True, kw_only=True)
class _Cut:
    """Slices of a picture, and the transform along them."""

    shape: Layout
    groups: list[NDArray[np.int64]]
    wavelet: str
    levels: int
    bits: int

    @property
    def whole_dtype(self) -> str:
        """Type of the coefficients of lossless coding, which have up to four bits more than pixels."""
        return "int16" if self.bits == 8 else "int32"

    def scales(self, count: int, step: int) -> NDArray[np.float32]:
        """Return the factor of each slice's coefficients for a rounding step of 2^step in 8-bit codes."""
        gains = lifting.synthesis_gains(self.wavelet, self.levels, count)
        return gains * np.float32(2.0 ** (8 - self.bits - step))


def principal_axes(pixels: NDArray[np.integer]) -> NDArray[np.int16]:
    """Return the rotation to the principal axes of colours, rows by falling variance, in units of 2^-14.

    Parameters
    ----------
    pixels : ndarray of uint8 or uint16, (…, 3)
    """
    flat = pixels.reshape(-1, 3)
    sums, products = np.zeros(3, np.int64), np.zeros((3, 3), np.int64)
    for some in np.array_split(flat, len(flat) // (1 << 18) + 1):  # integer sums: exact in any order
        colours = [np.ascontiguousarray(some[:, c], np.int64) for c in range(3)]
        sums += [c.sum() for c in colours]
        products += [[(a * b).sum() for b in colours] for a in colours]
    mean = sums / len(flat)
    axes = np.linalg.eigh(products / len(flat) - np.outer(mean, mean))[1].T[::-1]
    axes *= np.where(axes.sum(axis=1, keepdims=True) < 0, -1, 1)
    return np.rint(axes * _UNIT).astype(np.int16)


def _encode_lossless(pixels: NDArray[Any], cut: _Cut) -> Run:
    streams, seconds = [], 0.0
    for origins in cut.groups:
        planes = np.empty((3, len(origins), cut.shape.height, cut.shape.width), cut.whole_dtype)
        for y, first in lines(cut.shape):
            rows = np.empty((len(origins), 3 * cut.shape.width), np.int32)
            gather_whole(pixels, origins + first, cut.shape.step_x, 1 << (cut.bits - 1), rows)
            lifting.forward_reversible(rows, cut.levels)
            planes[:, :, y] = rows.reshape(len(origins), 3, -1).swapaxes(0, 1)
        started = cpu_seconds()
        streams.append(encode_planes(planes.reshape(-1, *planes.shape[2:]), 0, wavelet="5/3"))
        seconds += cpu_seconds() - started
    return Run(_payload(LOSSLESS, 0, np.zeros(9, np.int16), streams), seconds)


def _encode_lossy(pixels: NDArray[Any], cut: _Cut, colours: NDArray[np.int16], quality: float) -> Run:
    """Code for a PSNR in dB."""
    error = 255**2 / 10 ** (quality / 10)  # in 8-bit codes
    step = int(np.clip(np.floor(np.log2(12 * ROUNDING * error) / 2), FINEST_STEP, COARSEST_STEP))
    matrix, factors = colours.astype(np.float32) / _UNIT, lifting.steps(cut.wavelet)
    streams, seconds = [], 0.0
    for origins in cut.groups:
        planes = np.empty((3, len(origins), cut.shape.height, cut.shape.width), np.int16)
        scales = cut.scales(len(origins), step)
        rows = np.empty((len(origins), 3 * cut.shape.width), np.float32)
        for y, first in lines(cut.shape):
            gather_real(pixels, origins + first, cut.shape.step_x, 1 << (cut.bits - 1), matrix, rows)
            lifting.forward(rows, factors, cut.levels)
            to_whole(rows, scales, planes, y)
        started = cpu_seconds()
        streams.append(encode_planes(planes.reshape(-1, *planes.shape[2:]), error / 4.0**step, wavelet=cut.wavelet))
        seconds += cpu_seconds() - started
    return Run(_payload(LOSSY, step, colours, streams), seconds)


def _from_whole(planes: NDArray[Any], cut: _Cut, origins: NDArray[np.int64], pixels: NDArray[Any]) -> None:
    for y, first in lines(cut.shape):
        rows = np.ascontiguousarray(planes[:, :, y].swapaxes(0, 1), np.int32).reshape(len(origins), -1)
        lifting.backward_reversible(rows, cut.levels)
        scatter_whole(rows, origins + first, cut.shape.step_x, 1 << (cut.bits - 1), pixels)


def _from_real(
    planes: NDArray[Any],
    cut: _Cut,
    origins: NDArray[np.int64],
    colours: NDArray[np.int16],
    step: int,
    pixels: NDArray[Any],
) -> None:
    matrix, factors = colours.astype(np.float32) / _UNIT, lifting.steps(cut.wavelet)
    scales = cut.scales(len(origins), step)
    rows = np.empty((len(origins), 3 * cut.shape.width), np.float32)
    for y, first in lines(cut.shape):
        to_real(planes, scales, y, rows)
        lifting.backward(rows, factors, cut.levels)
        scatter_real(rows, origins + first, cut.shape.step_x, 1 << (cut.bits - 1), matrix, pixels)


def lines(shape: Layout) -> Iterator[tuple[int, int]]:
    """Yield each line of the slices and the offset of its first pixel from that of the slice."""
    return ((y, y * shape.step_y) for y in range(shape.height))


def _payload(mode: int, step: int, colours: NDArray[np.int16], streams: list[bytes]) -> bytes:
    parts = [_HEAD.pack(mode, step, *colours.ravel().tolist())]
    for stream in streams:
        parts += [_LENGTH.pack(len(stream)), stream]
    return b"".join(parts)


def _parts(payload: bytes, groups: int) -> tuple[int, int, NDArray[np.int16], list[bytes]]:
    if len(payload) < _HEAD.size:
        raise ValueError(f"its volume has {len(payload)} bytes: its header alone has {_HEAD.size}")
    mode, step, *numbers = _HEAD.unpack_from(payload)
    if mode not in (LOSSLESS, LOSSY) or not FINEST_STEP <= step <= COARSEST_STEP:
        raise ValueError(f"its volume has an unknown mode or step ({mode}, {step})")
    streams: list[bytes] = []
    at = _HEAD.size
    while at + _LENGTH.size <= len(payload) and len(streams) < groups:
        start = at + _LENGTH.size
        at = start + _LENGTH.unpack_from(payload, at)[0]
        streams.append(payload[start:at])
    if at != len(payload) or len(streams) != groups:
        raise ValueError(f"its volume does not consist of exactly {groups} codestreams")
    return mode, step, np.array(numbers, np.int16).reshape(3, 3), streams


@kernel
def gather_real(pixels, origins, step_x, middle, matrix, rows):
    """rows[j, :] = first, second and third colour of the pixels from origins[j] on, about zero."""
    width = rows.shape[1] // 3
    for j in range(origins.size):
        for x in range(width):
            p = origins[j] + x * step_x
            red = np.float32(np.int32(pixels[p, 0]) - middle)
            green = np.float32(np.int32(pixels[p, 1]) - middle)
            blue = np.float32(np.int32(pixels[p, 2]) - middle)
            for c in range(3):
                rows[j, c * width + x] = matrix[c, 0] * red + matrix[c, 1] * green + matrix[c, 2] * blue


@kernel
def scatter_real(rows, origins, step_x, middle, matrix, pixels):
    """Invert `gather_real`, rounded and clipped; the matrix is a rotation."""
    width = rows.shape[1] // 3
    top = np.float32(2 * middle - 1)
    for j in range(origins.size):
        for x in range(width):
            p = origins[j] + x * step_x
            for c in range(3):
                value = (
                    matrix[0, c] * rows[j, x]
                    + matrix[1, c] * rows[j, width + x]
                    + matrix[2, c] * rows[j, 2 * width + x]
                )
                pixels[p, c] = np.int32(min(max(value + np.float32(middle) + np.float32(0.5), np.float32(0)), top))


@kernel
def to_whole(rows, scales, planes, y):
    """planes[c, j, y] = rows[j], scaled and rounded."""
    width = rows.shape[1] // 3
    for j in range(rows.shape[0]):
        for c in range(3):
            for x in range(width):
                value = np.rint(rows[j, c * width + x] * scales[j])
                planes[c, j, y, x] = np.int32(min(max(value, np.float32(-32768)), np.float32(32767)))


@kernel
def to_real(planes, scales, y, rows):
    """Invert `to_whole`."""
    width = rows.shape[1] // 3
    for j in range(rows.shape[0]):
        for c in range(3):
            for x in range(width):
                rows[j, c * width + x] = np.float32(planes[c, j, y, x]) / scales[j]


@kernel
def gather_whole(pixels, origins, step_x, middle, rows):
    """rows[j, :] = Y, U and V of the reversible colour transform of the pixels from origins[j] on."""
    width = rows.shape[1] // 3
    for j in range(origins.size):
        for x in range(width):
            p = origins[j] + x * step_x
            red, green, blue = np.int32(pixels[p, 0]), np.int32(pixels[p, 1]), np.int32(pixels[p, 2])
            rows[j, x] = ((red + 2 * green + blue) >> 2) - middle
            rows[j, width + x] = blue - green
            rows[j, 2 * width + x] = red - green


@kernel
def scatter_whole(rows, origins, step_x, middle, pixels):
    """Invert `gather_whole`; only damaged streams leave the range of pixels."""
    width = rows.shape[1] // 3
    for j in range(origins.size):
        for x in range(width):
            p = origins[j] + x * step_x
            u, v = rows[j, width + x], rows[j, 2 * width + x]
            green = rows[j, x] + middle - ((u + v) >> 2)
            pixels[p, 0] = v + green
            pixels[p, 1] = green
            pixels[p, 2] = u + green
