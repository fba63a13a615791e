"""Colour conversion between RGB pixels of a picture and planes of frames, at any bit depth and subsampling.

Colour is ITU-R BT.709, full range, rounded to nearest, with P the highest value of the depth (255 or 1023)::

    Y  = (0.2126 R + 0.7152 G + 0.0722 B) · P/255
    Cb = (B − Y') / 1.8556 · P/255 + (P + 1)/2        Y' unrounded, of 8 bit
    Cr = (R − Y') / 1.5748 · P/255 + (P + 1)/2

Conversion at 4:4:4 and 8 bit and back changes values by at most 1. Its PSNR of about 52.9 dB is the upper bound of
coders that use it. At 10 bit it is exact.

At 4:2:0, Cb and Cr are those of the mean colour of 2×2 pixels. The inverse interpolates them linearly between the
centres of these squares (weights 9, 3, 3, 1 of 16), without extrapolation at the border.

RGB formats store values unchanged. The last column and row are repeated to fill a frame larger than its component
image.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ii_core.base.colour import CB, CR, KB, KG, KR
from ii_core.base.jit import kernel

# Fractional bits: 20 suffice to round as real numbers do.
BITS = np.int32(20)
HALF = np.int32(1 << 19)


@dataclass(frozen=True, kw_only=True)
class Format:
    """Pixel format of frames: FFmpeg's name, layout of planes, bit depth.

    ``chroma`` is "444", "420", "gbr" (three planes) or "bgr0" (one plane, four bytes per pixel).
    """

    name: str
    chroma: str
    depth: int

    @property
    def dtype(self) -> str:
        """Type of a sample."""
        return "uint8" if self.depth == 8 else "uint16"

    def planes(self, width: int, height: int) -> list[tuple[int, int]]:
        """Return rows and samples per row of each plane."""
        if self.chroma == "bgr0":
            return [(height, 4 * width)]
        small = (height // 2, width // 2) if self.chroma == "420" else (height, width)
        return [(height, width), small, small]


def ycbcr(chroma: str, depth: int) -> Format:
    """Return the format of Y, Cb and Cr planes."""
    return Format(name=f"yuv{chroma}p{'' if depth == 8 else f'{depth}le'}", chroma=chroma, depth=depth)


RGB8 = Format(name="bgr0", chroma="bgr0", depth=8)
RGB16 = Format(name="gbrp16le", chroma="gbr", depth=16)


def gather(pixels, origins, steps, size, form: Format, planes) -> None:
    """Fill planes[·][b] with the pixels from origins[b] on, ``steps`` apart down and right.

    ``size`` is height, width, and the width up to which the last column is repeated; the last row is repeated to the
    end of the plane. ``pixels`` is (n, 3). Each plane is (B, rows, ≥ samples per row), C-contiguous.
    """
    if form.chroma == "bgr0":
        gather_bgr0(pixels, origins, *steps, *size, planes[0])
    elif form.chroma == "gbr":
        for plane, channel in zip(planes, (1, 2, 0), strict=True):
            gather_channel(pixels, origins, *steps, *size, channel, plane)
    else:
        convert = gather_420 if form.chroma == "420" else gather_444
        convert(pixels, origins, *steps, *size, forward(form.depth), *planes)


def scatter(planes, origins, steps, size, form: Format, pixels) -> None:
    """Invert `gather`: write the pixels of these frames; ``size`` is height, width."""
    if form.chroma == "bgr0":
        scatter_bgr0(planes[0], origins, *steps, *size, pixels)
    elif form.chroma == "gbr":
        for plane, channel in zip(planes, (1, 2, 0), strict=True):
            scatter_channel(plane, origins, *steps, *size, channel, pixels)
    else:
        convert = scatter_420 if form.chroma == "420" else scatter_444
        convert(*planes, origins, *steps, *size, backward(form.depth), pixels)


class Forward(NamedTuple):
    """Factors of R, G and B in Y, Cb and Cr, in units of 2^-`BITS`; chroma of grey and highest value."""

    y_r: np.int32
    y_g: np.int32
    y_b: np.int32
    cb_r: np.int32
    cb_g: np.int32
    cb_b: np.int32
    cr_r: np.int32
    cr_g: np.int32
    cr_b: np.int32
    grey: np.int32
    peak: np.int32


class Backward(NamedTuple):
    """Factors of Y, of Cr in R, of Cb and Cr in G, and of Cb in B, in units of 2^-`BITS`; chroma of grey."""

    y: np.int32
    r_cr: np.int32
    g_cb: np.int32
    g_cr: np.int32
    b_cb: np.int32
    grey: np.int32


def forward(depth: int) -> Forward:
    """Return the factors of the conversion to YCbCr of so many bits."""
    peak = (1 << depth) - 1
    gain = peak / 255
    y_r, y_b = _fixed(KR * gain), _fixed(KB * gain)
    return Forward(
        y_r=y_r,
        y_g=np.int32(_fixed(gain) - y_r - y_b),  # the sum is exact, so that grey has neutral chroma
        y_b=y_b,
        cb_r=_fixed(-KR / CB * gain),
        cb_g=_fixed(-KG / CB * gain),
        cb_b=_fixed(0.5 * gain),
        cr_r=_fixed(0.5 * gain),
        cr_g=_fixed(-KG / CR * gain),
        cr_b=_fixed(-KB / CR * gain),
        grey=np.int32((peak + 1) // 2),
        peak=np.int32(peak),
    )


def backward(depth: int) -> Backward:
    """Return the factors of the conversion from YCbCr of so many bits."""
    peak = (1 << depth) - 1
    gain = 255 / peak
    return Backward(
        y=_fixed(gain),
        r_cr=_fixed(CR * gain),
        g_cb=_fixed(-KB * CB / KG * gain),
        g_cr=_fixed(-KR * CR / KG * gain),
        b_cb=_fixed(CB * gain),
        grey=np.int32((peak + 1) // 2),
    )


def _fixed(value: float) -> np.int32:
    return np.int32(round(value * (1 << BITS)))


# Kernels process one row of several frames before the next row: neighbouring frames are interleaved in the picture,
# so that one cache line holds pixels of several frames.
TILE = 16


@kernel
def gather_444(pixels, origins, step_y, step_x, height, width, wide, f, luma, cb, cr):
    """planes[b, y, x] = YCbCr of pixels[origins[b] + y·step_y + x·step_x]."""
    for tile in range(0, origins.size, TILE):
        for y in range(luma.shape[1]):
            for b in range(tile, min(tile + TILE, origins.size)):
                line = pixels[origins[b] + min(y, height - 1) * step_y :]
                to_luma, to_cb, to_cr = luma[b, y], cb[b, y], cr[b, y]
                for x in range(width):
                    # unsigned: numba then omits the handling of negative indices
                    p = np.uint64(x) * np.uint64(step_x)
                    red, green, blue = np.int32(line[p, 0]), np.int32(line[p, 1]), np.int32(line[p, 2])
                    to_luma[x] = (f.y_r * red + f.y_g * green + f.y_b * blue + HALF) >> BITS
                    # Pure blue and pure red round to one above the highest value.
                    to_cb[x] = min(((f.cb_r * red + f.cb_g * green + f.cb_b * blue + HALF) >> BITS) + f.grey, f.peak)
                    to_cr[x] = min(((f.cr_r * red + f.cr_g * green + f.cr_b * blue + HALF) >> BITS) + f.grey, f.peak)
                for x in range(width, wide):
                    to_luma[x], to_cb[x], to_cr[x] = to_luma[width - 1], to_cb[width - 1], to_cr[width - 1]


@kernel
def scatter_444(luma, cb, cr, origins, step_y, step_x, height, width, f, pixels):
    """pixels[origins[b] + y·step_y + x·step_x] = RGB of planes[b, y, x]."""
    low, high = np.int32(0), np.int32(255)
    for tile in range(0, origins.size, TILE):
        for y in range(height):
            for b in range(tile, min(tile + TILE, origins.size)):
                line = pixels[origins[b] + y * step_y :]
                for x in range(width):
                    p = np.uint64(x) * np.uint64(step_x)
                    grey = np.int32(luma[b, y, x]) * f.y + HALF
                    blue, red = np.int32(cb[b, y, x]) - f.grey, np.int32(cr[b, y, x]) - f.grey
                    line[p, 0] = min(max((grey + f.r_cr * red) >> BITS, low), high)
                    line[p, 1] = min(max((grey + f.g_cb * blue + f.g_cr * red) >> BITS, low), high)
                    line[p, 2] = min(max((grey + f.b_cb * blue) >> BITS, low), high)


@kernel
def gather_420(pixels, origins, step_y, step_x, height, width, wide, f, luma, cb, cr):
    """Do as `gather_444`, with the chroma of the mean colour of every 2×2 pixels."""
    bits, half = BITS + 2, HALF << 2
    for tile in range(0, origins.size, TILE):
        for y in range(luma.shape[1]):
            for b in range(tile, min(tile + TILE, origins.size)):
                line = pixels[origins[b] + min(y, height - 1) * step_y :]
                to_luma = luma[b, y]
                for x in range(width):
                    p = np.uint64(x) * np.uint64(step_x)
                    red, green, blue = np.int32(line[p, 0]), np.int32(line[p, 1]), np.int32(line[p, 2])
                    to_luma[x] = (f.y_r * red + f.y_g * green + f.y_b * blue + HALF) >> BITS
                for x in range(width, wide):
                    to_luma[x] = to_luma[width - 1]
                if y % 2:
                    above = pixels[origins[b] + min(y - 1, height - 1) * step_y :]
                    for x in range(wide // 2):
                        p = np.uint64(min(2 * x, width - 1)) * np.uint64(step_x)
                        q = np.uint64(min(2 * x + 1, width - 1)) * np.uint64(step_x)
                        red = np.int32(line[p, 0]) + line[q, 0] + above[p, 0] + above[q, 0]
                        green = np.int32(line[p, 1]) + line[q, 1] + above[p, 1] + above[q, 1]
                        blue = np.int32(line[p, 2]) + line[q, 2] + above[p, 2] + above[q, 2]
                        to_cb = f.cb_r * red + f.cb_g * green + f.cb_b * blue
                        to_cr = f.cr_r * red + f.cr_g * green + f.cr_b * blue
                        cb[b, y // 2, x] = min(((to_cb + half) >> bits) + f.grey, f.peak)
                        cr[b, y // 2, x] = min(((to_cr + half) >> bits) + f.grey, f.peak)


@kernel
def scatter_420(luma, cb, cr, origins, step_y, step_x, height, width, f, pixels):
    """Do as `scatter_444`, with chroma interpolated between the centres of 2×2 pixels."""
    low, high = np.int32(0), np.int32(255)
    bits, last_x, last_y = BITS + 4, (width - 1) // 2, (height - 1) // 2
    for tile in range(0, origins.size, TILE):
        for y in range(height):
            near_y = y // 2
            far_y = min(max(near_y + (y % 2) * 2 - 1, 0), last_y)
            for b in range(tile, min(tile + TILE, origins.size)):
                line = pixels[origins[b] + y * step_y :]
                for x in range(width):
                    p = np.uint64(x) * np.uint64(step_x)
                    near, far = x // 2, min(max(x // 2 + (x % 2) * 2 - 1, 0), last_x)
                    grey = ((np.int64(luma[b, y, x]) * f.y) << 4) + (HALF << 4)
                    blue = (
                        9 * np.int64(cb[b, near_y, near])
                        + 3 * (np.int64(cb[b, near_y, far]) + cb[b, far_y, near])
                        + cb[b, far_y, far]
                        - 16 * f.grey
                    )
                    red = (
                        9 * np.int64(cr[b, near_y, near])
                        + 3 * (np.int64(cr[b, near_y, far]) + cr[b, far_y, near])
                        + cr[b, far_y, far]
                        - 16 * f.grey
                    )
                    line[p, 0] = min(max((grey + f.r_cr * red) >> bits, low), high)
                    line[p, 1] = min(max((grey + f.g_cb * blue + f.g_cr * red) >> bits, low), high)
                    line[p, 2] = min(max((grey + f.b_cb * blue) >> bits, low), high)


@kernel
def gather_bgr0(pixels, origins, step_y, step_x, height, width, wide, packed):
    """packed[b, y, 4x:4x+3] = B, G, R of pixels[origins[b] + y·step_y + x·step_x]."""
    for tile in range(0, origins.size, TILE):
        for y in range(packed.shape[1]):
            for b in range(tile, min(tile + TILE, origins.size)):
                line = pixels[origins[b] + min(y, height - 1) * step_y :]
                for x in range(wide):
                    p = np.uint64(min(x, width - 1)) * np.uint64(step_x)
                    for channel in range(3):
                        packed[b, y, 4 * x + channel] = line[p, 2 - channel]


@kernel
def scatter_bgr0(packed, origins, step_y, step_x, height, width, pixels):
    """Invert `gather_bgr0`."""
    for tile in range(0, origins.size, TILE):
        for y in range(height):
            for b in range(tile, min(tile + TILE, origins.size)):
                line = pixels[origins[b] + y * step_y :]
                for x in range(width):
                    p = np.uint64(x) * np.uint64(step_x)
                    for channel in range(3):
                        line[p, 2 - channel] = packed[b, y, 4 * x + channel]


@kernel
def gather_channel(pixels, origins, step_y, step_x, height, width, wide, channel, plane):
    """plane[b, y, x] = pixels[origins[b] + y·step_y + x·step_x, channel]."""
    for tile in range(0, origins.size, TILE):
        for y in range(plane.shape[1]):
            for b in range(tile, min(tile + TILE, origins.size)):
                line = pixels[origins[b] + min(y, height - 1) * step_y :]
                for x in range(wide):
                    plane[b, y, x] = line[np.uint64(min(x, width - 1)) * np.uint64(step_x), channel]


@kernel
def scatter_channel(plane, origins, step_y, step_x, height, width, channel, pixels):
    """Invert `gather_channel`."""
    for tile in range(0, origins.size, TILE):
        for y in range(height):
            for b in range(tile, min(tile + TILE, origins.size)):
                line = pixels[origins[b] + y * step_y :]
                for x in range(width):
                    line[np.uint64(x) * np.uint64(step_x), channel] = plane[b, y, x]
