"""Pictures of README and docs: width of a page, palette for charts, WebP or JPEG for photographs."""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from benchmarks.records import ROOT
from ii_core.base.files import atomic_path
from ii_core.display.figure import save

IMAGES = ROOT / "docs" / "images"
WIDEST = 1500  # pixels: twice the column of a page
JPEG, WEBP = 80, 85  # qualities
MANY = 16384  # colours; a chart with more contains photographs, in which a palette would cause banding
FEW, OFF = 64, 32  # colours of a chart, and an error that few pixels may have; 256 colours are a third larger
RARE = 0.001  # share of pixels with a larger error
GAP = 4  # pixels between images of a sheet
LETTERS, STRIP = 15, 22  # heights in pixels of a label and of its strip


def write_picture(
    path: str | os.PathLike[str], source: NDArray[np.uint8] | str | os.PathLike[str], *, lossless: bool = False
) -> None:
    """Write a picture of a page from pixels or from a file, which may be the picture itself.

    Parameters
    ----------
    path : path
        ``.png`` for charts, ``.webp`` for photographs, or ``.jpg`` for photographs whose colours change from pixel to
        pixel: its colour is not subsampled; replaced, whole.
    source : (H, W, 3) uint8 or path
        Pictures wider than 1500 pixels are reduced to that width. Charts, which are files with an alpha channel, get
        a palette; other PNG keep their colours.
    lossless : bool
        Whether a ``.webp`` keeps every pixel.

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
        picture.save(data, "WEBP", lossless=lossless, quality=100 if lossless else WEBP, method=6)
    elif ending == "jpg":
        picture.save(data, "JPEG", quality=JPEG, subsampling=0, optimize=True, progressive=True)
    else:
        raise ValueError(f"a picture of a page is a .png, .webp or .jpg, not {os.fspath(path)}")
    with atomic_path(path) as temporary:
        temporary.write_bytes(data.getvalue())


def write_chart(figure: Any, name: str, dpi: int = 130) -> None:
    """Write a figure of matplotlib as a picture of a page."""
    write_picture(IMAGES / name, save(figure, IMAGES / name, dpi=dpi))


def tidy(*panels: Any, axis: str = "both") -> None:
    """Give panels of a chart a light grid behind the lines, and no frame at the top and to the right."""
    for axes in panels:
        axes.grid(True, axis=axis, color="0.9", linewidth=0.8)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)


def with_palette(picture: Image.Image) -> Image.Image:
    """Return an RGB picture reduced to 64 or 256 colours, unless it has more than `MANY`."""
    colours = picture.getcolors(MANY)
    if colours is None:
        return picture
    few = picture.quantize(FEW, method=Image.Quantize.MAXCOVERAGE, kmeans=2, dither=Image.Dither.NONE)
    off = np.abs(np.asarray(few.convert("RGB"), np.int16) - np.asarray(picture)).max(axis=2)
    if (off > OFF).mean() <= RARE:
        return few
    return picture.quantize(min(len(colours), 256), method=Image.Quantize.MEDIANCUT)


def enlarged(image: NDArray[Any], times: int) -> NDArray[Any]:
    """Return an image with every pixel as a square of ``times`` × ``times``."""
    return image.repeat(times, axis=0).repeat(times, axis=1)


def labelled(image: NDArray[np.uint8], text: str) -> NDArray[np.uint8]:
    """Return an image with a label above it."""
    strip = Image.new("RGB", (image.shape[1], STRIP), "white")
    font = ImageFont.load_default(LETTERS)
    ImageDraw.Draw(strip).text((2, STRIP // 2), text, "black", font, anchor="lm")
    return np.concatenate([np.asarray(strip), image])


def sheet(images: Sequence[NDArray[np.uint8]], columns: int, labels: Sequence[str] = ()) -> NDArray[np.uint8]:
    """Return a picture of images of one size in rows, on white, with labels if given."""
    if labels:
        images = [labelled(image, text) for image, text in zip(images, labels, strict=True)]
    height, width = images[0].shape[:2]
    rows = -(-len(images) // columns)
    page = np.full((rows * (height + GAP) - GAP, columns * (width + GAP) - GAP, 3), 255, np.uint8)
    for i, image in enumerate(images):
        top, left = i // columns * (height + GAP), i % columns * (width + GAP)
        page[top : top + height, left : left + width] = image
    return page
