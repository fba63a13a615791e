"""Textures: images on (u, v); checkers, stripes and noise in space."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator

from ii_core.base.colour import LINEAR, linear

WRAPS = ("repeat", "mirror", "clamp")


@dataclass(frozen=True, eq=False)
class Image:
    """Image texture, linear float32 (H, W, 3), row 0 on top at v = 1, read bilinearly.

    With ``codes``, uint8 sRGB of the same shape, it takes a quarter of the memory and is faster to read. ``repeat``
    is the factor of texture coordinates from a scene file, applied when the body is built. ``alpha`` (H, W), 0…1, is
    the alpha of the file, if any, for cut-outs. ``wrap`` names the wrapping beyond [0, 1] along u and v: repeat,
    mirrored repeat, or clamp to the edge.

    Raises
    ------
    ValueError
        If the wrapping is unknown.
    """

    pixels: NDArray[np.float32]
    repeat: tuple[float, float] = (1.0, 1.0)
    alpha: NDArray[np.float32] | None = None
    codes: NDArray[np.uint8] | None = None
    wrap: tuple[str, str] = ("repeat", "repeat")
    on_surface = True

    def __post_init__(self) -> None:
        if unknown := [name for name in self.wrap if name not in WRAPS]:
            raise ValueError(f"unknown wrapping {unknown[0]!r} of an image: known are {', '.join(WRAPS)}")


@dataclass(frozen=True)
class Checker:
    """Checkers: two linear colours in cubes of ``size`` (mm along each axis; (u, v) units if ``on_surface``)."""

    colours: tuple[tuple[float, float, float], tuple[float, float, float]]
    size: tuple[float, float, float]
    on_surface: bool = False


@dataclass(frozen=True)
class Stripes:
    """Stripes: two linear colours, each ``width`` wide (mm; (u, v) units if ``on_surface``), along ``axis``.

    The first starts at the origin. ``soft`` is the share of the width over which the colours are blended.

    Raises
    ------
    ValueError
        If the axis is zero, the width not positive, or ``soft`` not from 0 to 1.
    """

    colours: tuple[tuple[float, float, float], tuple[float, float, float]]
    width: float
    axis: tuple[float, float, float] = (1.0, 0.0, 0.0)
    soft: float = 0.0
    on_surface: bool = False

    def __post_init__(self) -> None:
        if not 0 < self.width < np.inf:
            raise ValueError(f"stripes are {self.width} wide: more than 0 is needed")
        if not 0 < np.linalg.norm(self.axis) < np.inf:
            raise ValueError(f"the axis of stripes is {self.axis}: a finite direction other than zero is needed")
        if not 0 <= self.soft <= 1:
            raise ValueError(f"the soft edge of stripes is {self.soft}: a share from 0 to 1 is needed")


@dataclass(frozen=True)
class Noise:
    """Noise: two linear colours mixed by fractal gradient noise with features of ``size`` mm along each axis.

    With ``contrast`` 1, noise of ±0.5 gives the pure colours.
    """

    colours: tuple[tuple[float, float, float], tuple[float, float, float]]
    size: tuple[float, float, float]
    octaves: int = 1
    contrast: float = 1.0
    seed: int = 0
    on_surface: bool = False


@dataclass(frozen=True)
class VertexColours:
    """Vertex colours: linear colours of the mesh, stored in place of texture coordinates."""

    on_surface = True


Texture = Image | Checker | Stripes | Noise | VertexColours


def srgb_colour(value: Any) -> tuple[float, float, float]:
    """Return the linear colour of ``"#rrggbb"`` or of three sRGB numbers in [0, 1]."""
    if isinstance(value, str):
        if not (len(value) == 7 and value[0] == "#" and all(c in "0123456789abcdefABCDEF" for c in value[1:])):
            raise ValueError(f"colour {value!r}: #rrggbb or three numbers from 0 to 1 are needed")
        value = [int(value[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    if not (
        isinstance(value, list | tuple)
        and len(value) == 3
        and all(isinstance(c, int | float) and not isinstance(c, bool) and 0 <= c <= 1 for c in value)
    ):
        raise ValueError(f"colour {value!r}: #rrggbb or three numbers from 0 to 1 are needed")
    r, g, b = (float(c) for c in linear(value))
    return r, g, b


Colour = Annotated[tuple[float, float, float], BeforeValidator(srgb_colour)]


def image_texture(pixels: NDArray[Any]) -> Image:
    """Return the image texture of stored pixels: integers are sRGB, floats linear; grey is repeated.

    Raises
    ------
    ValueError
        If a pixel is not finite.
    """
    if not np.isfinite(pixels).all():
        raise ValueError("image holds pixels that are not finite numbers")
    data, alpha = _split(pixels)
    codes = np.ascontiguousarray(data) if data.dtype == np.uint8 else None
    if codes is not None:
        data = LINEAR[codes]
    elif data.dtype.kind == "u":
        data = linear(np.arange(np.iinfo(data.dtype).max + 1) / np.iinfo(data.dtype).max)[data]
    return Image(np.ascontiguousarray(data, np.float32), alpha=alpha, codes=codes)


def normal_map(pixels: NDArray[Any]) -> Image:
    """Return the normal map of stored pixels, which are linear data: 0…1 means −1…1 for x, y and z.

    Tangent space is that of glTF 2.0, §3.9.3: x towards larger u, y towards larger v, z out of the face.

    Raises
    ------
    ValueError
        If there are not three channels, or a pixel is not finite.
    """
    return _data(pixels, "normal map")


def metallic_roughness_map(pixels: NDArray[Any]) -> Image:
    """Return the map of roughness (green) and metal (blue) of stored pixels, which are linear data (glTF 2.0).

    Raises
    ------
    ValueError
        If there are not three channels, or a pixel is not finite.
    """
    return _data(pixels, "metallic-roughness map")


def _data(pixels: NDArray[Any], what: str) -> Image:
    if pixels.shape[2] < 3 or not np.isfinite(pixels).all():
        raise ValueError(f"a {what} has {pixels.shape[2]} channels: three of finite numbers are needed")
    data = pixels[..., :3]
    if data.dtype.kind == "u":
        data = data / np.float32(np.iinfo(data.dtype).max)
    return Image(np.ascontiguousarray(data, np.float32))


def _split(pixels: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.float32] | None]:
    """Return three channels of colour, and alpha as 0…1 if there is a second or fourth channel."""
    channels = pixels.shape[2]
    alpha = None
    if channels in (2, 4):
        alpha = pixels[..., -1].astype(np.float32)
        if pixels.dtype.kind == "u":
            alpha /= np.float32(np.iinfo(pixels.dtype).max)
    return pixels[..., :3] if channels >= 3 else np.repeat(pixels[..., :1], 3, axis=2), alpha
