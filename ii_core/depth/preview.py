"""Picture of a map in false colours, with a scale beside it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

# Colours of matplotlib's viridis at equal distances, sRGB; unknown pixels are grey.
VIRIDIS = np.array([
    [68, 1, 84], [72, 40, 120], [62, 74, 137], [49, 104, 142], [38, 130, 142], [31, 158, 137], [53, 183, 121],
    [109, 205, 89], [180, 222, 44], [253, 231, 37],
])  # fmt: skip
UNKNOWN = (128, 128, 128)
SCALE, TICKS = 96, 5  # px beside the map; numbers


def false_colours(values: NDArray[Any], low: float, high: float) -> NDArray[np.uint8]:
    """Return colours of values from ``low`` to ``high``, (…, 3); grey where a value is not finite."""
    share = np.clip((np.nan_to_num(values) - low) / max(high - low, 1e-12), 0, 1) * (len(VIRIDIS) - 1)
    places = np.arange(len(VIRIDIS))
    colours = np.stack([np.interp(share, places, VIRIDIS[:, c]) for c in range(3)], axis=-1)
    colours[~np.isfinite(values)] = UNKNOWN
    return np.rint(colours).astype(np.uint8)


def preview(
    disparity: NDArray[Any],
    unit: str,
    *,
    told: Callable[[float], Any] = float,
    pixel: tuple[float, float] = (1.0, 1.0),
) -> NDArray[np.uint8]:
    """Return a map in false colours with its scale on the right, (rows, columns + scale, 3).

    Colours change with the disparity, near ones bright: no point near infinity or at the lenses takes them all.

    Parameters
    ----------
    disparity : ndarray, (rows, columns)
    unit : str
        Written above the scale.
    told : callable
        What the scale says of a disparity: its depth, say.
    pixel : (width, height)
        Shape of a pixel: lens pitch across and down.
    """
    finite = disparity[np.isfinite(disparity)]
    low, high = (float(x) for x in np.quantile(finite, [0.005, 0.995])) if finite.size else (0.0, 1.0)
    wide, tall = (max(1, round(side / min(pixel))) for side in pixel)
    rows, columns = disparity.shape
    zoom = max(1, -(-300 // min(rows * tall, columns * wide)))  # small views: so that the scale can be read
    map_ = false_colours(disparity, low, high).repeat(zoom * tall, 0).repeat(zoom * wide, 1)
    rows = map_.shape[0]
    canvas = np.full((rows, map_.shape[1] + SCALE, 3), 255, np.uint8)
    canvas[:, :-SCALE] = map_
    top, bottom = 28, rows - 12
    share = np.linspace(1, 0, bottom - top)[:, None].repeat(16, 1)
    canvas[top:bottom, -SCALE + 8 : -SCALE + 24] = false_colours(share, 0, 1)
    image = Image.fromarray(canvas)
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(13)
    draw.text((canvas.shape[1] - SCALE + 8, 6), unit, fill=0, font=font)
    for i in range(TICKS):
        part = i / (TICKS - 1)
        y, value = bottom - 1 - part * (bottom - top - 1), low + part * (high - low)
        draw.text((canvas.shape[1] - SCALE + 30, y - 8), four_digits(told(value)), fill=0, font=font)
    return np.asarray(image)


def four_digits(value: float) -> str:
    """Return a number rounded to four digits, without an exponent."""
    return np.format_float_positional(float(value), precision=4, fractional=False, trim="-")
