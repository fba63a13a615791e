"""Textures: images on (u, v), checkers and noise in space; packed into arrays for the kernels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

IMAGE, CHECKER, NOISE = 0, 1, 2
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


@numba.njit(cache=True, nogil=True, inline="always")
def _wrap(i, n):
    i %= n
    return i + n if i < 0 else i


@numba.njit(cache=True, nogil=True)
def texture_colour(row, texels, x, y, z):
    """Linear colour of a texture at a texture coordinate."""
    kind = row[0]
    if kind == IMAGE:
        return _image(row, texels, x, y)
    if kind == CHECKER:
        # A face often lies just on a cell's border: decided here, not by rounding noise.
        odd = (math.floor(x * row[1] + 1e-6) + math.floor(y * row[2] + 1e-6) + math.floor(z * row[3] + 1e-6)) % 2
        t = 1.0 if odd else 0.0
    else:
        t = 0.5 + row[11] * _fractal(x * row[1], y * row[2], z * row[3], int(row[10]))
        t = min(max(t, 0.0), 1.0)
    return (
        row[4] + t * (row[7] - row[4]),
        row[5] + t * (row[8] - row[5]),
        row[6] + t * (row[9] - row[6]),
    )


@numba.njit(cache=True, nogil=True)
def _image(row, texels, u, v):
    first, width, height = int(row[1]), int(row[2]), int(row[3])
    x = (u - math.floor(u)) * width - 0.5
    y = (1.0 - (v - math.floor(v))) * height - 0.5
    i, j = math.floor(x), math.floor(y)
    fx, fy = x - i, y - j
    i0, i1 = _wrap(int(i), width), _wrap(int(i) + 1, width)
    a, b = first + _wrap(int(j), height) * width, first + _wrap(int(j) + 1, height) * width
    w00, w10, w01, w11 = (1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy
    red = w00 * texels[a + i0, 0] + w10 * texels[a + i1, 0] + w01 * texels[b + i0, 0] + w11 * texels[b + i1, 0]
    green = w00 * texels[a + i0, 1] + w10 * texels[a + i1, 1] + w01 * texels[b + i0, 1] + w11 * texels[b + i1, 1]
    blue = w00 * texels[a + i0, 2] + w10 * texels[a + i1, 2] + w01 * texels[b + i0, 2] + w11 * texels[b + i1, 2]
    return red, green, blue


@numba.njit(cache=True, nogil=True)
def _fractal(x, y, z, packed):
    """Octaves of gradient noise, each of half the size and strength."""
    octaves, seed = packed % 16, packed // 16
    total, strength = 0.0, 1.0
    for octave in range(octaves):
        total += strength * gradient_noise(x, y, z, seed + octave)
        x, y, z, strength = 2.03 * x, 2.03 * y, 2.03 * z, 0.5 * strength
    return total


@numba.njit(cache=True, nogil=True)
def gradient_noise(x, y, z, seed):
    """Perlin's improved gradient noise (2002) with hashed lattice gradients; about −1…1, 0 on the lattice."""
    fx, fy, fz = math.floor(x), math.floor(y), math.floor(z)
    i, j, k = np.int64(fx), np.int64(fy), np.int64(fz)
    x, y, z = x - fx, y - fy, z - fz
    u, v, w = _fade(x), _fade(y), _fade(z)
    near = _lerp(
        v,
        _lerp(u, _slope(i, j, k, seed, x, y, z), _slope(i + 1, j, k, seed, x - 1, y, z)),
        _lerp(u, _slope(i, j + 1, k, seed, x, y - 1, z), _slope(i + 1, j + 1, k, seed, x - 1, y - 1, z)),
    )
    far = _lerp(
        v,
        _lerp(u, _slope(i, j, k + 1, seed, x, y, z - 1), _slope(i + 1, j, k + 1, seed, x - 1, y, z - 1)),
        _lerp(
            u,
            _slope(i, j + 1, k + 1, seed, x, y - 1, z - 1),
            _slope(i + 1, j + 1, k + 1, seed, x - 1, y - 1, z - 1),
        ),
    )
    return _lerp(w, near, far)


@numba.njit(cache=True, nogil=True, inline="always")
def _fade(t):
    return t * t * t * (t * (t * 6 - 15) + 10)


@numba.njit(cache=True, nogil=True, inline="always")
def _lerp(t, a, b):
    return a + t * (b - a)


@numba.njit(cache=True, nogil=True, inline="always")
def _slope(i, j, k, seed, x, y, z):
    """Dot product with one of twelve gradients towards the edges of a cube."""
    h = (i * 73856093) ^ (j * 19349663) ^ (k * 83492791) ^ (seed * 2654435761)
    h = ((h ^ (h >> 16)) * 0x45D9F3B) & 0xFFFFFFFF
    h = (h ^ (h >> 16)) & 15
    a = x if h < 8 else y
    b = y if h < 4 else (x if h == 12 or h == 14 else z)
    return (a if h & 1 == 0 else -a) + (b if h & 2 == 0 else -b)


def linear(srgb: Any) -> NDArray[np.float64]:
    """sRGB in [0, 1] to linear light (IEC 61966-2-1)."""
    c = np.asarray(srgb, dtype=np.float64)
    return np.where(c <= 0.04045, c / 12.92, ((np.maximum(c, 0) + 0.055) / 1.055) ** 2.4)


def image_texture(pixels: NDArray[Any]) -> Image:
    """An image texture from stored pixels: integers are sRGB, floats linear; grey is spread, alpha dropped."""
    if pixels.dtype.kind == "u":
        table = linear(np.arange(np.iinfo(pixels.dtype).max + 1) / np.iinfo(pixels.dtype).max)
        pixels = table[pixels]
    if pixels.shape[2] < 3:
        pixels = np.repeat(pixels[..., :1], 3, axis=2)
    return Image(np.ascontiguousarray(pixels[..., :3], np.float32))
