"""Textures: images on (u, v), checkers and noise in space; packed into arrays for the kernels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .kernels import CHECKER, IMAGE, NOISE

COLUMNS = 12  # kind, then what the kind needs


@dataclass(frozen=True, eq=False)
class Image:
    """An image, linear float32 (H, W, 3), row 0 on top at v = 1; repeats beyond [0, 1]; bilinear."""

    pixels: NDArray[np.float32]
    on_surface = True


@dataclass(frozen=True)
class Checker:
    """Two linear colours in cubes of ``size`` (mm along each axis; in (u, v) units if ``on_surface``)."""

    colours: tuple[tuple[float, float, float], tuple[float, float, float]]
    size: tuple[float, float, float]
    on_surface: bool = False


@dataclass(frozen=True)
class Noise:
    """Two linear colours mixed by fractal gradient noise with features of ``size`` mm along each axis.

    ``contrast`` 1 uses the whole mix where the noise reaches ±0.5.
    """

    colours: tuple[tuple[float, float, float], tuple[float, float, float]]
    size: tuple[float, float, float]
    octaves: int = 1
    contrast: float = 1.0
    seed: int = 0
    on_surface: bool = False


Texture = Image | Checker | Noise


class TextureTable:
    """Textures as a table (n, COLUMNS) and one array (texels, 3) that holds every image."""

    def __init__(self, textures: Sequence[Texture | None]) -> None:
        self._rows: dict[int, int] = {}
        rows: list[list[float]] = []
        texels: list[NDArray[np.float32]] = []
        used = 0
        for texture in textures:
            if texture is None or id(texture) in self._rows:
                continue
            self._rows[id(texture)] = len(rows)
            if isinstance(texture, Image):
                height, width = texture.pixels.shape[:2]
                rows.append([IMAGE, used, width, height])
                texels.append(texture.pixels.reshape(-1, 3))
                used += width * height
            elif isinstance(texture, Checker):
                rows.append([CHECKER, *(1 / s for s in texture.size), *texture.colours[0], *texture.colours[1]])
            else:
                scale = (1 / s for s in texture.size)
                octaves = texture.octaves + texture.seed % 1024 * 16  # one column for both
                rows.append([NOISE, *scale, *texture.colours[0], *texture.colours[1], octaves, texture.contrast])
        self.table = np.zeros((len(rows), COLUMNS))
        for row, values in zip(self.table, rows, strict=True):
            row[: len(values)] = values
        self.texels = np.concatenate(texels) if texels else np.empty((0, 3), np.float32)

    def index(self, texture: Texture | None) -> int:
        """Row of a texture, −1 for none."""
        return -1 if texture is None else self._rows[id(texture)]


def linear(srgb: Any) -> NDArray[np.float64]:
    """sRGB in [0, 1] to linear light (IEC 61966-2-1)."""
    c = np.asarray(srgb, dtype=np.float64)
    return np.where(c <= 0.04045, c / 12.92, ((np.maximum(c, 0) + 0.055) / 1.055) ** 2.4)


def image_texture(pixels: NDArray[Any]) -> Image:
    """An image texture from stored pixels: integers are sRGB, floats linear; grey is spread, alpha dropped.

    Raises
    ------
    ValueError
        If a pixel is not finite.
    """
    if not np.isfinite(pixels).all():
        raise ValueError("image holds pixels that are not finite numbers")
    if pixels.dtype.kind == "u":
        table = linear(np.arange(np.iinfo(pixels.dtype).max + 1) / np.iinfo(pixels.dtype).max)
        pixels = table[pixels]
    if pixels.shape[2] < 3:
        pixels = np.repeat(pixels[..., :1], 3, axis=2)
    return Image(np.ascontiguousarray(pixels[..., :3], np.float32))
