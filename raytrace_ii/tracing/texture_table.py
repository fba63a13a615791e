"""Texture table: textures and the texels of images as arrays for the kernels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..scene.textures import Checker, Image, Stripes, Texture, VertexColours
from .kernels.lanes import aligned
from .kernels.tables import CHECKER, CLAMP, IMAGE, IMAGE_COLUMNS, MIRROR, NOISE, REPEAT, STRIPES, VERTEX

COLUMNS = 12  # kind, then what the kind needs
WRAPS = {"repeat": REPEAT, "mirror": MIRROR, "clamp": CLAMP}


class TextureTable:
    """Textures as a table (n, COLUMNS), and what their images hold.

    ``levels`` is the table in float32 in one dimension, in rows of a cache line, with first texels as int32.

    ``texels`` are linear colours, three numbers a texel, of some images, and sRGB codes, four a texel, of the others,
    of which one texel never lies in two cache lines; ``alphas`` those of images that have any. The rows of an image's
    coarser levels, each of half its size, follow its own.
    """

    def __init__(self, textures: Sequence[Texture | None]) -> None:
        self._rows: dict[int, int] = {}
        self._pixels: list[NDArray[np.float32]] = [np.empty((0, 3), np.float32)]
        self._codes: list[NDArray[np.uint8]] = [np.empty((0, 4), np.uint8)]
        self._alphas: list[NDArray[np.float32]] = [np.empty(0, np.float32)]
        rows: list[list[float]] = []
        for texture in textures:
            if texture is None or id(texture) in self._rows:
                continue
            self._rows[id(texture)] = len(rows)
            if isinstance(texture, Image):
                colours = pyramid(texture.pixels)
                alphas = [None] * len(colours) if texture.alpha is None else pyramid(texture.alpha)
                rows.append([*self._level(texture.pixels, texture.alpha, texture), len(colours)])
                coarse = replace(texture, codes=None)
                rows += [self._level(*level, coarse) for level in zip(colours, alphas, strict=True)]
            elif isinstance(texture, Checker):
                rows.append([CHECKER, *(1 / s for s in texture.size), *texture.colours[0], *texture.colours[1]])
            elif isinstance(texture, VertexColours):
                rows.append([VERTEX])
            elif isinstance(texture, Stripes):
                steps = np.asarray(texture.axis) / np.linalg.norm(texture.axis) / texture.width
                rows.append([STRIPES, *steps, *texture.colours[0], *texture.colours[1], texture.soft])
            else:
                scale = (1 / s for s in texture.size)
                octaves = texture.octaves + texture.seed % 1024 * 16  # one column for both
                rows.append([NOISE, *scale, *texture.colours[0], *texture.colours[1], octaves, texture.contrast])
        self.table = np.zeros((len(rows), COLUMNS))
        for row, values in zip(self.table, rows, strict=True):
            row[: len(values)] = values
        self.levels = aligned(len(rows) * IMAGE_COLUMNS)
        levels = self.levels.reshape(-1, IMAGE_COLUMNS)
        levels[:, :COLUMNS] = self.table
        levels[:, 1].view(np.int32)[:] = np.where(self.table[:, 0] == IMAGE, self.table[:, 1], 0)
        if len(self._pixels) > 1:
            self._pixels.append(np.zeros((1, 3), np.float32))  # `texels.mixed` reads beyond the last texel
        self.texels = np.concatenate(self._pixels).reshape(-1), np.concatenate(self._codes).reshape(-1)
        self.alphas = np.concatenate(self._alphas)
        del self._pixels, self._codes, self._alphas

    def _level(self, colours: NDArray[np.float32], alpha: NDArray[np.float32] | None, image: Image) -> list[float]:
        """Keep what a level of an image holds; its row comes back."""
        height, width = colours.shape[:2]
        store = self._pixels if image.codes is None else self._codes
        first, first_alpha = sum(map(len, store)), -1 if alpha is None else sum(map(len, self._alphas))
        if image.codes is None:
            self._pixels.append(colours.reshape(-1, 3))
        else:
            self._codes.append(np.pad(image.codes.reshape(-1, 3), ((0, 0), (0, 1))))
        if alpha is not None:
            self._alphas.append(alpha.reshape(-1))
        wraps = (WRAPS[name] for name in image.wrap)
        return [IMAGE, first, width, height, first_alpha, image.codes is not None, *wraps]

    def index(self, texture: Texture | None) -> int:
        """Row of a texture, −1 for none."""
        return -1 if texture is None else self._rows[id(texture)]


def pyramid(values: NDArray[np.float32]) -> list[NDArray[np.float32]]:
    """Coarser levels of an image (H, W, …), each of half the size, down to one texel: means over area."""
    levels = []
    while max(values.shape[:2]) > 1:
        values = _halved(np.swapaxes(_halved(values), 0, 1)).swapaxes(0, 1)
        levels.append(np.ascontiguousarray(values, np.float32))
    return levels


def _halved(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Half as many rows; of an odd number, each takes its share of the texels that it cuts."""
    n, half = len(values), len(values) // 2
    if n == 1:
        return values
    if n % 2 == 0:
        return 0.5 * (values[0::2] + values[1::2])
    j = np.arange(half, dtype=np.float32).reshape(-1, *[1] * (values.ndim - 1))
    total = (half - j) * values[0:-1:2] + np.float32(half) * values[1::2] + (j + 1) * values[2::2]
    return np.asarray(total / np.float32(n))
