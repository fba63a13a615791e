"""Calibration of a Looking Glass, ``visual.json``: which view each subpixel of its panel shows.

The maker's shader gives a subpixel at (u, v), shares of the panel's width from the left and height from the bottom,
the position under its lens::

    t = (u + i/(3·W) + v·tilt) · P − center,   tilt = H/(W·slope),   P = pitch · W/DPI · cos(atan(1/slope))

with i = 0, 1, 2 for red, green, blue, and view ⌊(1 − t mod 1)·views⌋ of views that count from the left.

References
----------
Looking Glass Factory, HoloPlay Core 0.0.11 (shader) and the calibration of its Unity plugin.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base import checks
from ..base.checks import Pair, view_size
from ..base.colour import linear
from ..base.files import one_line, read_json
from ..base.parallel import over_rows
from ..picture.picture import IIPicture
from .eye import RAYS, Eye, EyeImage, pupil_rays
from .look import display_views
from .quilt import cone_share, shown_shares

MOST_ALONG = 1 << 14  # pixels of a panel
MOST_VIEWS = 256
VIEWS = 48
LEAST, MOST = 1e-5, 0.999999  # the shader's own bounds of 1 − t mod 1
CELL = ("ROffsetX", "ROffsetY", "GOffsetX", "GOffsetY", "BOffsetX", "BOffsetY")


@dataclass(frozen=True, kw_only=True)
class LookingGlass:
    """Panel and lenses of one display.

    Attributes
    ----------
    size : (width, height)
        Pixels of the panel.
    pitch, slope, centre, dpi : float
        As in the file; see the top of this file.
    cone_deg : float
        Angle that the views cover.
    inverted : bool
        Views count from the left, as on all displays sold; else from the right.
    flip_x, flip_y, flip_subpixels : bool
        The panel is mounted mirrored, or its subpixels are blue, green, red.
    cells : tuple of six numbers each
        Places of red, green and blue from the pixel, in pixels, on panels without stripes.
    pattern : int
        How the cells take turns: 0 one, 1 chequered, 2 columns, 3 columns in steps of two rows, 4 rows.
    """

    size: Pair
    pitch: float
    slope: float
    centre: float
    dpi: float
    cone_deg: float = 40.0
    inverted: bool = True
    flip_x: bool = False
    flip_y: bool = False
    flip_subpixels: bool = False
    cells: tuple[tuple[float, ...], ...] = ()
    pattern: int = 0


@checks.checked(path=checks.path)
def read_looking_glass(path: str | os.PathLike[str]) -> LookingGlass:
    """Return the display of a ``visual.json``, whose values may be numbers or ``{"value": number}``.

    Raises
    ------
    ValueError
        If a value is missing or makes no sense.
    OSError
        If the file cannot be read.
    """
    data = read_json(path)
    try:
        return _display(data)
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError) as error:
        text = f"{error.args[0]} missing" if isinstance(error, KeyError) and error.args else error
        raise ValueError(f"{os.fspath(path)} is no calibration of a Looking Glass: {one_line(text)}") from None


def _display(data: Mapping[str, Any]) -> LookingGlass:
    def value(name: str, least: float, most: float, usual: float | None = None) -> float:
        given = data[name] if usual is None else data.get(name, usual)
        number = float(given["value"] if isinstance(given, Mapping) else given)
        if not least <= number <= most:
            raise ValueError(f"{name} is {number:g}: a number from {least:g} to {most:g} is needed")
        return number

    slope = value("slope", -1e4, 1e4)
    if abs(slope) < 1e-4:
        raise ValueError(f"slope is {slope:g}: lenses that are not horizontal are needed")
    cells = tuple(tuple(float(cell[name]) for name in CELL) for cell in data.get("subpixelCells", ()))
    if len(cells) > 10 or not all(abs(place) <= 10 for cell in cells for place in cell):
        raise ValueError("subpixelCells are at most ten, with places within ten pixels")
    return LookingGlass(
        size=(int(value("screenW", 1, MOST_ALONG)), int(value("screenH", 1, MOST_ALONG))),
        pitch=value("pitch", 1e-3, 1e4),
        slope=slope,
        centre=value("center", -1e4, 1e4),
        dpi=value("DPI", 1, 1e4),
        cone_deg=value("viewCone", 0.1, 179, 40.0),
        inverted=value("invView", 0, 1, 1.0) > 0.5,
        flip_x=value("flipImageX", 0, 1, 0.0) > 0.5,
        flip_y=value("flipImageY", 0, 1, 0.0) > 0.5,
        flip_subpixels=value("flipSubp", 0, 1, 0.0) > 0.5,
        cells=cells,
        pattern=int(value("CellPatternMode", 0, 4, 0.0)),
    )


@checks.checked(display=checks.instance(LookingGlass), views=checks.whole_from(2, MOST_VIEWS))
def view_numbers(display: LookingGlass, views: int = VIEWS) -> NDArray[np.uint8]:
    """Return the view, counted from the left, that each subpixel shows: (height, width, 3), top row first."""
    (width, height), slope = display.size, display.slope
    lenses = display.pitch * width / display.dpi * math.cos(math.atan(1 / slope))
    tilt = height / (width * slope) * (-1 if display.flip_x else 1)
    u = (np.arange(width) + 0.5) / width
    if display.flip_x:
        u = 1 - u
    out = np.empty((height, width, 3), np.uint8)

    def fill(first: int, last: int) -> None:
        for row in range(first, last):
            below = height - 1 - row  # the shader counts rows from the bottom
            v = (below + 0.5) / height
            for channel in range(3):
                place = 2 - channel if display.flip_subpixels else channel
                right, up = _places(display, below, place)
                t = (u + right + (v + up) * tilt) * lenses - display.centre
                t = t - np.floor(t)
                share = np.clip(1 - t if display.inverted else t, LEAST, MOST)
                out[row, :, channel] = share * views

    over_rows(fill, height)
    return out


def _places(display: LookingGlass, below: int, place: int) -> tuple[Any, Any]:
    """Return the places of a row's subpixels from their pixels, shares of width and height."""
    (width, height), count = display.size, len(display.cells)
    if not count:
        return place / (3 * width), 0.0
    x = np.arange(width)
    patterns = (0 * x, (below + x) % 2, x % 2, (below + 2 * (x % 2)) % 4, 0 * x + below % 2)
    offsets = np.array(display.cells)[patterns[display.pattern] % count]
    return offsets[:, 2 * place] / width, offsets[:, 2 * place + 1] / height


@checks.checked(
    picture=checks.instance(IIPicture), display=checks.instance(LookingGlass), views=checks.whole_from(2, MOST_VIEWS),
    depth_mm=checks.number, cone=checks.number, whole=checks.flag,
)  # fmt: skip
def native_picture(
    picture: IIPicture,
    display: LookingGlass,
    *,
    views: int = VIEWS,
    depth_mm: float | None = None,
    cone: float | None = None,
    whole: bool = False,
) -> NDArray[np.uint8]:
    """Return the picture for the panel itself, subpixel by subpixel: (height, width, 3).

    Parameters
    ----------
    views : int
        Number of views.
    depth_mm : float, optional
        z of the scene plane that appears in the plane of the display.
    cone : float, optional
        Share of the viewing zone that the views cover; the display's cone if not given.
    whole : bool
        Show the whole lens array between black borders; see `quilt`.
    """
    numbers = view_numbers(display, views)
    share = cone_share(picture, display.cone_deg) if cone is None else cone
    shares = shown_shares(picture, display.size[0] / display.size[1], whole=whole)
    made = display_views(picture, views, size=display.size, depth_mm=depth_mm, cone=share, shares=shares)
    out = np.empty((*display.size[::-1], 3), np.uint8)
    for number, view in enumerate(made):
        seen = view[:, ::-1] if display.flip_x else view
        np.copyto(out, seen[::-1] if display.flip_y else seen, where=numbers == number)
    return out


@checks.checked(
    pixels=checks.array, display=checks.instance(LookingGlass), view=checks.whole_from(0, MOST_VIEWS - 1),
    views=checks.whole_from(2, MOST_VIEWS),
)  # fmt: skip
def view_of_native(
    pixels: NDArray[Any], display: LookingGlass, view: int, *, views: int = VIEWS
) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Return one view of a picture for the panel: its subpixels, others 0, and which are its own.

    Inverse of `native_picture`: every subpixel belongs to one view.

    Returns
    -------
    pixels : ndarray, (height, width, 3)
    own : ndarray of bool, (height, width, 3)

    Raises
    ------
    ValueError
        If the pixels are not the panel's.
    """
    if pixels.shape != (*display.size[::-1], 3):
        raise ValueError(f"pixels are {pixels.shape}: {(*display.size[::-1], 3)}, the panel's, are needed")
    own = view_numbers(display, views) == view
    seen = np.where(own, pixels, 0)
    if display.flip_x:
        seen, own = seen[:, ::-1], own[:, ::-1]
    if display.flip_y:
        seen, own = seen[::-1], own[::-1]
    return seen, own


@checks.checked(
    pixels=checks.array, display=checks.instance(LookingGlass), eye=checks.instance(Eye), size=checks.whole_pair,
    rays=checks.whole_from(1, 1 << 16),
)  # fmt: skip
def native_eye_image(
    pixels: NDArray[Any], display: LookingGlass, eye: Eye, *, size: Pair | None = None, rays: int = RAYS
) -> EyeImage:
    """Return the view of an eye of the panel's picture through the display's slanted lenses: the mean of many rays.

    The panel is the plane z = 0, its middle the origin. A ray towards the eye leaves the lens at the place of the
    panel where the lens focuses it: at the right end of the lens for eyes at the left of the cone. It has the light
    of the stripe that lies there, three times as bright in its one colour. Beyond the cone the zones repeat.

    Parameters
    ----------
    pixels : ndarray of uint8, (height, width, 3)
        Of `native_picture`.
    display : LookingGlass
        The display itself, whichever the picture was made for; its subpixels are stripes.
    eye : Eye
        Its focus is the panel.
    size : (width, height), optional
        Points of the view, spread over the panel; its pixels if not given.
    rays : int
        Rays a point, spread over the pupil and over the point's part of the panel.

    Raises
    ------
    ValueError
        If the pixels are not the panel's, the subpixels are no stripes, or the eye is not before the panel.
    """
    width, height = display.size
    if pixels.shape != (height, width, 3) or pixels.dtype != np.uint8:
        raise ValueError(f"pixels are {pixels.dtype} {pixels.shape}: uint8 {(height, width, 3)} are needed")
    if display.cells or display.flip_x or display.flip_y:
        raise ValueError("the display has subpixelCells or is mirrored: upright stripes are needed")
    distance = -eye.position_mm[2]
    if not distance > 0:
        raise ValueError(f"eye is at z {eye.position_mm[2]:g} mm, not before the panel: z < 0 is needed")
    columns, rows = display.size if size is None else view_size("size", size)
    pixel = 25.4 / display.dpi
    step = np.array([width / columns, height / rows])  # pixels
    places = pupil_rays(rays, eye.pupil_mm, step)
    # Phases of lenses grow by so much a pixel to the right and up; the eye's place counts across the lenses.
    across = display.pitch / display.dpi * math.cos(math.atan(1 / display.slope))
    up = across / display.slope
    half_cone = math.tan(math.radians(display.cone_deg / 2))
    table = linear(np.arange(256) / 255).astype(np.float32)
    light = np.zeros((rows, columns, 3), np.float32)

    def fill(first: int, last: int) -> None:
        y, x = np.meshgrid(
            (np.arange(first, last) + 0.5) * step[1], (np.arange(columns) + 0.5) * step[0], indexing="ij"
        )
        for pupil_x, pupil_y, right, down in places:
            px, py = x + right, y + down  # on the lenses, pixels from the top left
            phase = px * across + (height - py) * up - display.centre
            off_x = eye.position_mm[0] + pupil_x - (px - width / 2) * pixel
            off_y = eye.position_mm[1] + pupil_y - (height / 2 - py) * pixel
            share = 0.5 + (off_x + off_y / display.slope) / (2 * distance * half_cone)
            wanted = (1 - share if display.inverted else share) % 1
            shift = (np.floor(phase) + wanted - phase) / (across * across + up * up)
            # A pixel's red stripe lies where the shader has it, around the middle of the pixel.
            column, row = px + shift * across - 0.5 + 1 / 6, py - shift * up
            m, n = np.floor(column).astype(np.int64), np.floor(row).astype(np.int64)
            inside = (m >= 0) & (m < width) & (n >= 0) & (n < height)
            stripe = np.minimum((3 * (column - m)).astype(np.int64), 2)
            channel = 2 - stripe if display.flip_subpixels else stripe
            m, n = m.clip(0, width - 1), n.clip(0, height - 1)
            seen = np.where(inside, 3 * table[pixels[n, m, channel]], 0)
            for c in range(3):
                light[first:last, :, c] += np.where(channel == c, seen, 0) / len(places)

    over_rows(fill, rows)
    return EyeImage(light, np.ones((rows, columns), np.float32))
