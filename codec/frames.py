"""Frames of pseudo video sequences: II-picture to planes of component images and back, in batches.

A batch is gathered directly from the interleaved RGB picture into the planes of an encoder, and scattered directly
from the planes of a decoder. The picture is never rearranged as a whole. `codec.colour` converts colours.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core.picture.component import KINDS

from . import colour
from .colour import Format
from .order import selection_order

Pair = tuple[int, int]
Planes = list[NDArray[Any]]

# Limits of a batch: about the cache of a core, and a number of frames whose objects cost little.
BATCH_BYTES = 8 << 20
BATCH_FRAMES = 128


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Positions of the pixels of component images in the picture; steps count pixels in row-major order."""

    rows: int
    cols: int
    height: int
    width: int
    step_row: int
    step_col: int
    step_y: int
    step_x: int
    turned: bool = False  # whether rows are the columns of the component image

    @property
    def frames(self) -> int:
        """Number J of component images."""
        return self.rows * self.cols

    def origins(self, order: str, by: str = "rows") -> NDArray[np.int64]:
        """Return the first pixel of each component image, by frame number."""
        row, col = np.divmod(selection_order(order, self.rows, self.cols, by), self.cols)
        return row * self.step_row + col * self.step_col

    def transposed(self) -> Layout:
        """Return the layout with each image transposed, on the same grid."""
        sides = {"height": self.width, "width": self.height, "step_y": self.step_x, "step_x": self.step_y}
        return replace(self, **sides, turned=not self.turned)


def layout(lenses: Pair, ei_pixels: Pair, kind: str) -> Layout:
    """Return grid, frame size and steps of one kind of component image.

    =====  ============  =================  ==============
    kind   frame (T×S)   grid (rows×cols)   (2.12)–(2.14)
    =====  ============  =================  ==============
    ei     V × U         L × K              one lens
    si     L × K         V × U              one direction
    ri     K × U         L × V              one picture row
    =====  ============  =================  ==============

    By (2.11) the first index of a component image counts across the grid and the second down. Ray-space images in row
    order are therefore the picture's rows from top to bottom (2.14).

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
    row, col, y, x = tuple({"ei": "lkvu", "si": "vulk", "ri": "lvku"}[kind])
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


@dataclass(frozen=True, kw_only=True)
class Film:
    """Frames of a pseudo video sequence: layout, order, pixel format and size.

    ``width`` and ``height`` of coded frames are at least those of a component image. ``start`` and ``stop`` select a
    part of the sequence.
    """

    layout: Layout
    order: str
    by: str
    format: Format
    width: int
    height: int
    start: int = 0
    stop: int | None = None

    @property
    def frames(self) -> int:
        """Number of frames."""
        return (self.layout.frames if self.stop is None else self.stop) - self.start

    def origins(self) -> NDArray[np.int64]:
        """Return the first pixel of each frame in the picture."""
        return self.layout.origins(self.order, self.by)[self.start : self.stop]

    def batch(self, strides: list[int] | None = None) -> Planes:
        """Return arrays for one batch of frames, (B, rows, ``stride``) of samples per plane."""
        shapes = self.format.planes(self.width, self.height)
        sizes = [(rows, stride) for (rows, _), stride in zip(shapes, strides or [n for _, n in shapes], strict=True)]
        nbytes = sum(rows * stride for rows, stride in sizes) * np.dtype(self.format.dtype).itemsize
        count = max(1, min(self.frames, BATCH_FRAMES, BATCH_BYTES // nbytes))
        return [np.zeros((count, *size), self.format.dtype) for size in sizes]

    def gathered(self, pixels: NDArray[Any], planes: Planes) -> Iterator[int]:
        """Fill ``planes`` with one batch of frames after another.

        Parameters
        ----------
        pixels : ndarray, (N, M, 3)
            The picture, C-contiguous.
        planes : list of ndarray
            From `batch`. Every step overwrites them.

        Yields
        ------
        int
            Number of filled frames in ``planes``.
        """
        flat, origins, size = pixels.reshape(-1, 3), self.origins(), len(planes[0])
        for first in range(0, self.frames, size):
            some = origins[first : first + size]
            colour.gather(flat, some, self._steps, (*self._size, self.width), self.format, planes)
            yield len(some)

    def scatter(self, planes: Planes, origins: NDArray[np.int64], pixels: NDArray[Any]) -> None:
        """Write a batch of frames into the picture, the inverse of one step of `gathered`.

        Parameters
        ----------
        planes : list of ndarray
        origins : ndarray of int64, at most (B,)
            Part of `origins` for these frames.
        pixels : ndarray, (N, M, 3)
            The picture, C-contiguous; the pixels of these frames are written.
        """
        colour.scatter(planes, origins, self._steps, self._size, self.format, pixels.reshape(-1, 3))

    @property
    def _steps(self) -> Pair:
        return self.layout.step_y, self.layout.step_x

    @property
    def _size(self) -> Pair:
        return self.layout.height, self.layout.width
