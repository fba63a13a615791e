"""Pictures of README and docs: width of a page, palette for charts, WebP or JPEG for photographs."""

from __future__ import annotations

import io
import os
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from benchmarks.records import ROOT
from ii_core.base.files import atomic_path

IMAGES = ROOT / "docs" / "images"
WIDEST = 1500  # pixels: twice the column of a page
QUALITY = 80  # JPEG quality
MANY = 16384  # colours; a chart with more contains photographs, in which a palette would cause banding


def write_picture(path: str | os.PathLike[str], source: NDArray[np.uint8] | str | os.PathLike[str]) -> None:
    """Write a picture of a page from pixels or from a file, which may be the picture itself.

    Parameters
    ----------
    path : path
        ``.png``, ``.webp`` without loss for photographs whose pixels matter (a quarter smaller), or ``.jpg`` for
        JPEG of quality 80 without subsampled colour; replaced, whole.
    source : (H, W, 3) uint8 or path
        Pictures wider than 1500 pixels are reduced to that width. Charts, which are files with an alpha channel, get
        a palette of 256 colours; other PNG keep their colours.

    Raises
    ------
    ValueError
        If the path ends otherwise.
    """
    picture: Any = Image.open(source) if isinstance(source, str | os.PathLike) else Image.fromarray(source)
    chart = picture.mode in ("RGBA", "P")
    white = Image.new("RGBA", picture.size, "white")
    picture = Image.alpha_composite(white, picture.convert("RGBA")).convert("RGB")
    if picture.width > WIDEST:
        size = WIDEST, round(picture.height * WIDEST / picture.width)
        picture = picture.resize(size, Image.Resampling.LANCZOS)
    ending, data = os.fspath(path).rpartition(".")[2], io.BytesIO()
    if ending == "png":
        (with_palette(picture) if chart else picture).save(data, "PNG", optimize=True)
    elif ending == "webp":
        picture.save(data, "WEBP", lossless=True, quality=100, method=6)
    elif ending == "jpg":
        picture.save(data, "JPEG", quality=QUALITY, subsampling=0, optimize=True, progressive=True)
    else:
        raise ValueError(f"a picture of a page is a .png, .webp or .jpg, not {os.fspath(path)}")
    with atomic_path(path) as temporary:
        temporary.write_bytes(data.getvalue())


def with_palette(picture: Image.Image) -> Image.Image:
    """Return an RGB picture reduced to 256 colours, unless it has more than `MANY`."""
    colours = picture.getcolors(MANY)
    if colours is None:
        return picture
    return picture.quantize(min(len(colours), 256), method=Image.Quantize.MEDIANCUT)
