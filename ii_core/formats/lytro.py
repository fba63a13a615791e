"""Metadata of raw pictures of Lytro cameras: size, levels, mosaic, colours, lens array, zoom and focus.

The first generation writes ``image`` with ``rawDetails``, the second puts their parts into ``image`` itself. White
pictures of both have the whole container's tree, ``master.picture.frameArray[0].frame.metadata``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base import checks
from ..camera.camera import Pair

PRIVATE = "privateMetadata"
MOST_GAIN = 100.0  # of colours; those of cameras are below 4
PHASES = ("r", "gr", "gb", "b")


class RawColour(NamedTuple):
    """Colours of a sensor.

    Attributes
    ----------
    gains : (r, g, b)
        Factors that make grey things grey.
    matrix : 3×3 numbers
        From balanced values to linear sRGB.
    """

    gains: tuple[float, float, float]
    matrix: tuple[tuple[float, float, float], ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class RawPicture:
    """A raw picture and what its metadata tell.

    Attributes
    ----------
    samples : ndarray, (N, M) or (N, M, 1 or 3)
        Of a container float32, linear, the value of no light taken off; of image files as they are stored.
    mosaic : str or None
        Colours of the first 2×2 pixels, such as "bggr".
    full_scale : float or None
        Sample value at the end of the scale, if the metadata say it.
    pixel_pitch_mm, lens_pitch_mm, gap_mm : float or None
    turn_rad : float or None
        Of the lens grid, as the maker measured it.
    lattice : str or None
    colour : RawColour or None
    setting : Setting or None
        Of the camera, by which a white picture is chosen.
    """

    samples: NDArray[Any]
    mosaic: str | None = None
    full_scale: float | None = None
    pixel_pitch_mm: float | None = None
    lens_pitch_mm: float | None = None
    gap_mm: float | None = None
    turn_rad: float | None = None
    lattice: str | None = None
    colour: RawColour | None = None
    setting: Setting | None = None


class Setting(NamedTuple):
    """Camera, zoom and focus of a picture.

    Attributes
    ----------
    serial : str
        Empty if unknown.
    zoom, focus : float
        Steps of the motors.
    dark : bool
        Whether the picture was taken without light.
    """

    serial: str
    zoom: float
    focus: float
    dark: bool = False


class AboutPicture(NamedTuple):
    """Metadata of packed samples; ``picture`` has all of a `RawPicture` but the samples."""

    picture: RawPicture
    size: Pair
    bits: int
    black: tuple[float, ...]  # of the first 2×2 pixels


def about_picture(metadata: Mapping[str, Any]) -> AboutPicture:
    """Return the parts of a picture's metadata that `RawPicture` has.

    Raises
    ------
    ValueError, TypeError, KeyError, IndexError, AttributeError, OverflowError
        If they do not describe a picture.
    """
    metadata = _frame_metadata(metadata)
    image = metadata["image"]
    details = image.get("rawDetails", image)
    bits = int(details["pixelPacking"]["bitsPerPixel"])
    if not 1 <= bits <= 32:
        raise ValueError(f"samples have {checks.shown(bits)} bits: 10, 12 or 16 are known")
    cells = _mosaic(details.get("mosaic") or image.get("mosaic"))
    levels = details.get("pixelFormat", {})
    devices = metadata.get("devices", {})
    sensor, mla = devices.get("sensor", {}), devices.get("mla", {})
    tiling = str(mla.get("tiling", ""))
    black = _levels(levels.get("black"), cells, 0.0)
    white = _levels(levels.get("white"), cells, float((1 << bits) - 1))
    picture = RawPicture(
        samples=np.zeros((0, 0)),
        mosaic=None if cells is None else "".join(cell[0] for cell in cells),
        full_scale=float(np.min(np.subtract(white, black))),
        pixel_pitch_mm=_millimetres(sensor.get("pixelPitch")),
        lens_pitch_mm=_millimetres(mla.get("lensPitch")),
        gap_mm=_millimetres(mla.get("sensorOffset", {}).get("z")),
        turn_rad=float(mla["rotation"]) if "rotation" in mla else None,
        lattice="hexagonal" if tiling.startswith("hex") else "rectangular" if tiling else None,
        colour=None if cells is None else _colour(image.get("color", {})),
        setting=setting_of(metadata),
    )
    return AboutPicture(picture, (int(image["width"]), int(image["height"])), bits, black)


def setting_of(metadata: Mapping[str, Any]) -> Setting | None:
    """Return camera, zoom and focus of a picture's metadata; None if they do not say them."""
    metadata = _frame_metadata(metadata)
    lens = metadata.get("devices", {}).get("lens", {})
    if "zoomStep" not in lens or "focusStep" not in lens:
        return None
    zoom, focus = float(lens["zoomStep"]), float(lens["focusStep"])
    if not (math.isfinite(zoom) and math.isfinite(focus)):
        raise ValueError(f"its zoom and focus are {zoom} and {focus}: numbers of steps are needed")
    private = metadata.get(PRIVATE, metadata)
    serial = str(private.get("camera", {}).get("serialNumber", ""))
    return Setting(serial, zoom, focus, metadata.get("darkFrame") is True)


def _frame_metadata(metadata: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the metadata of a frame, out of the tree of a whole container if they are that, with private ones."""
    if "image" in metadata or "master" not in metadata:
        return metadata
    entry = metadata["master"]["picture"]["frameArray"][0]
    frame, tags = entry["frame"], entry.get("parameters", {}).get("vendorContent", {}).get("com.lytro.tags", {})
    found = {**frame["metadata"], "darkFrame": tags.get("darkFrame")}
    return {**found, PRIVATE: frame[PRIVATE]} if PRIVATE in frame else found


def _mosaic(mosaic: Any) -> list[str] | None:
    """Return colours of the first 2×2 pixels: ``tile`` gives rows as "r,gr:gb,b", ``upperLeftPixel`` its start."""
    if not mosaic or mosaic["tile"] == "monochrome":
        return None
    rows = [[cell.strip() for cell in row.split(",")] for row in str(mosaic["tile"]).split(":")]
    if [len(row) for row in rows] != [2, 2] or sorted(cell[:1] for row in rows for cell in row) != list("bggr"):
        raise ValueError(f"its mosaic is {checks.shown(mosaic['tile'])}: 2×2 pixels of r, g, g and b are known")
    tile = np.array(rows)
    first = np.argwhere(tile == mosaic.get("upperLeftPixel", tile[0, 0]))
    if not len(first):
        raise ValueError(f"its mosaic {checks.shown(mosaic['tile'])} has no {checks.shown(mosaic['upperLeftPixel'])}")
    return [str(cell) for cell in np.roll(tile, tuple(-first[0]), axis=(0, 1)).ravel()]


def _levels(levels: Any, cells: list[str] | None, usual: float) -> tuple[float, ...]:
    """Return a level of each of the first 2×2 pixels, from one number or from numbers by colour."""
    by_name = levels if isinstance(levels, Mapping) else {}
    values = [float(v) for v in by_name.values()] if by_name else [] if levels is None else [float(levels)]
    mean = float(np.mean(values)) if values else usual
    return tuple(float(by_name.get(cell, mean)) for cell in (cells or PHASES))


def _colour(colour: Mapping[str, Any]) -> RawColour | None:
    """Return gains and matrix of the metadata; None if one of them is missing."""
    array = colour.get("ccm", colour.get("ccmRgbToSrgbArray"))
    given = colour.get("whiteBalanceGain")
    if array is None or given is None:
        return None
    r, gr, gb, b = (float(given[name]) for name in PHASES)
    matrix = np.array([float(a) for a in array])
    gains = r, (gr + gb) / 2, b
    if matrix.size != 9 or not np.all(np.abs(matrix) <= MOST_GAIN) or not all(0 < g <= MOST_GAIN for g in gains):
        raise ValueError(
            f"its colours are {checks.shown(list(array))}, {checks.shown(dict(given))}: nine numbers and positive "
            f"gains up to {MOST_GAIN:g} are needed"
        )
    rows = tuple((float(a), float(b), float(c)) for a, b, c in matrix.reshape(3, 3))
    return RawColour(gains, rows)


def _millimetres(metres: Any) -> float | None:
    """A length of the metadata; None if there is none that makes sense."""
    value = float(metres) * 1000 if isinstance(metres, int | float) else 0.0
    return value if 0 < value < np.inf else None
