"""Contact sheets of images of one size."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

GAP = 4
LETTERS, STRIP = 15, 22  # heights in pixels of a label and of its strip


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
