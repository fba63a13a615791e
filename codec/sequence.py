"""II-picture ↔ pseudo video sequence: component images in an order, as planar YCbCr, a batch of frames at a time.

The picture is never rearranged as a whole. A batch is gathered straight from the interleaved RGB picture into the
planes an encoder reads, and scattered straight back from what a decoder wrote.

Colour is ITU-R BT.709, full range, 8 bit, rounded to nearest, at 4:4:4::

    Y  = 0.2126 R + 0.7152 G + 0.0722 B
    Cb = (B − Y) / 1.8556 + 128
    Cr = (R − Y) / 1.5748 + 128

There and back changes no value by more than 1: a PSNR of about 52.9 dB, the most a coder behind it can reach.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from ii_core.component import KINDS

from .order import selection_order

Pair = tuple[int, int]

# A batch holds about as much as a core's own cache, and no more frames than is worth the objects around them.
BATCH_BYTES = 8 << 20
BATCH_FRAMES = 1024


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Where the pixels of each component image lie in the picture; steps count pixels in row-major order."""

    rows: int
    cols: int
    height: int
    width: int
    step_row: int
    step_col: int
    step_y: int
    step_x: int

    @property
    def frames(self) -> int:
        """J, how many component images there are."""
        return self.rows * self.cols

    def origins(self, order: str) -> NDArray[np.int64]:
        """The first pixel of each component image, by frame number."""
        row, col = np.divmod(selection_order(order, self.rows, self.cols), self.cols)
        return row * self.step_row + col * self.step_col

    def batch(self, stride: int) -> NDArray[np.uint8]:
        """Room for one batch of frames, (B, 3, height, stride), with ``stride`` ≥ width bytes from row to row."""
        count = max(1, min(self.frames, BATCH_FRAMES, BATCH_BYTES // (3 * self.height * stride)))
        return np.zeros((count, 3, self.height, stride), np.uint8)


def layout(lenses: Pair, ei_pixels: Pair, kind: str) -> Layout:
    """Grid, frame size and steps of one kind of component image.

    =====  ============  =================  ==============
    kind   frame (T×S)   grid (rows×cols)   (2.12)–(2.14)
    =====  ============  =================  ==============
    ei     V × U         L × K              one lens
    si     L × K         V × U              one direction
    ri     K × U         V × L              one picture row
    =====  ============  =================  ==============

    Raises
    ------
    ValueError
        If the kind is unknown.
    """
    if kind not in KINDS:
        raise ValueError(f"unknown component image {kind!r}: known are {', '.join(KINDS)}")
    (k, l), (u, v) = lenses, ei_pixels
    # One step along each axis of the light field [l, v, k, u], in pixels.
    size = {"l": l, "v": v, "k": k, "u": u}
    step = {"l": v * k * u, "v": k * u, "k": u, "u": 1}
    row, col, y, x = tuple({"ei": "lkvu", "si": "vulk", "ri": "vlku"}[kind])
    return Layout(
        rows=size[row],
        cols=size[col],
        height=size[y],
        width=size[x],
        step_row=step[row],
        step_col=step[col],
        step_y=step[y],
        step_x=step[x],
    )


def gathered(pixels: NDArray[np.uint8], shape: Layout, order: str, planes: NDArray[np.uint8]) -> Iterator[int]:
    """Fill ``planes`` with one batch of frames after another.

    Parameters
    ----------
    pixels : ndarray of uint8, (N, M, 3)
        The picture, C-contiguous.
    shape : Layout
    order : str
        See `codec.order.selection_order`.
    planes : ndarray of uint8, (B, 3, height, stride)
        Overwritten by every batch: use it up before asking for the next.

    Yields
    ------
    int
        How many frames of ``planes`` are filled.
    """
    flat, origins, size = pixels.reshape(-1, 3), shape.origins(order), len(planes)
    for first in range(0, shape.frames, size):
        some = origins[first : first + size]
        gather_ycbcr(flat, some, shape.step_y, shape.step_x, shape.width, planes)
        yield len(some)


def scatter(planes: NDArray[np.uint8], origins: NDArray[np.int64], shape: Layout, pixels: NDArray[np.uint8]) -> None:
    """Put a batch of frames back into the picture: the inverse of one step of `gathered`.

    Parameters
    ----------
    planes : ndarray of uint8, (B, 3, height, stride)
    origins : ndarray of int64, at most (B,)
        The part of `Layout.origins` these frames have.
    pixels : ndarray of uint8, (N, M, 3)
        C-contiguous; the pixels of these frames are written.
    """
    scatter_rgb(planes, origins, shape.step_y, shape.step_x, shape.width, pixels.reshape(-1, 3))


# 20 fractional bits: exact enough to round like the real numbers do, small enough for 32-bit lanes.
BITS = np.int32(20)
HALF = np.int32(1 << 19)
MID = np.int32(128)


def _fixed(value: float) -> np.int32:
    return np.int32(round(value * (1 << 20)))


YR, YB = _fixed(0.2126), _fixed(0.0722)
YG = np.int32((1 << 20) - YR - YB)
BR, BG, BB = _fixed(-0.2126 / 1.8556), _fixed(-0.7152 / 1.8556), _fixed(0.5)
RR, RG, RB = _fixed(0.5), _fixed(-0.7152 / 1.5748), _fixed(-0.0722 / 1.5748)
R_CR, B_CB = _fixed(1.5748), _fixed(1.8556)
G_CB, G_CR = _fixed(-0.0722 * 1.8556 / 0.7152), _fixed(-0.2126 * 1.5748 / 0.7152)


# Both kernels handle one row of a few frames before the next row: neighbouring frames are interleaved in the
# picture, so that a cache line of it serves several of them while it is at hand.
TILE = 16


@numba.njit(cache=True, nogil=True)
def gather_ycbcr(pixels, origins, step_y, step_x, width, planes):
    """planes[b, :, y, x] = YCbCr of pixels[origins[b] + y·step_y + x·step_x]."""
    top = np.int32(255)
    for tile in range(0, origins.size, TILE):
        for y in range(planes.shape[2]):
            for b in range(tile, min(tile + TILE, origins.size)):
                line = pixels[origins[b] + y * step_y :]
                luma, cb, cr = planes[b, 0, y], planes[b, 1, y], planes[b, 2, y]
                for x in range(width):
                    p = np.uint64(x) * np.uint64(step_x)  # unsigned: no check for indices from the end
                    red, green, blue = np.int32(line[p, 0]), np.int32(line[p, 1]), np.int32(line[p, 2])
                    luma[x] = (YR * red + YG * green + YB * blue + HALF) >> BITS
                    # Pure blue and pure red round to 256.
                    cb[x] = min(((BR * red + BG * green + BB * blue + HALF) >> BITS) + MID, top)
                    cr[x] = min(((RR * red + RG * green + RB * blue + HALF) >> BITS) + MID, top)


@numba.njit(cache=True, nogil=True)
def scatter_rgb(planes, origins, step_y, step_x, width, pixels):
    """pixels[origins[b] + y·step_y + x·step_x] = RGB of planes[b, :, y, x]."""
    low, top = np.int32(0), np.int32(255)
    for tile in range(0, origins.size, TILE):
        for y in range(planes.shape[2]):
            for b in range(tile, min(tile + TILE, origins.size)):
                line = pixels[origins[b] + y * step_y :]
                for x in range(width):
                    p = np.uint64(x) * np.uint64(step_x)
                    luma = (np.int32(planes[b, 0, y, x]) << BITS) + HALF
                    cb, cr = np.int32(planes[b, 1, y, x]) - MID, np.int32(planes[b, 2, y, x]) - MID
                    line[p, 0] = min(max((luma + R_CR * cr) >> BITS, low), top)
                    line[p, 1] = min(max((luma + G_CB * cb + G_CR * cr) >> BITS, low), top)
                    line[p, 2] = min(max((luma + B_CB * cb) >> BITS, low), top)
