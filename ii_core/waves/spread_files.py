"""Point-spread functions as images in a folder of camera maps.

Beside L and D of every pixel array stand two images: S holds the diameters of the disks of defocus and of spherical
aberration, A the radii of Airy's first dark ring for red, green and blue. ``camera.json`` has ``spread`` in every
array, with the ``file``, ``C`` and ``box`` of both as for L and D, and ``pixel_pitch_mm``. Lengths are in mm.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..base import checks
from ..base.files import image_header, one_line, read_json, write_image, write_json
from ..camera.maps import FORMATS, SHEET, check_format, encode, inside, stored_map, widened
from .spread import SpreadMaps

NAMES = ("S", "A")


@checks.checked(count=checks.whole_from(1, 1 << 16), format=checks.text)
def spread_files(count: int, format: str = "png16") -> list[str]:
    """Return the names of the images that `write_spread` writes for this number of pixel arrays."""
    check_format(format)
    return [f"{name}{_ending(i, count)}{FORMATS[format][0]}" for i in range(count) for name in NAMES]


@checks.checked(maps=checks.list_of(SpreadMaps), folder=checks.path, format=checks.text)
def write_spread(maps: Sequence[SpreadMaps], folder: str | os.PathLike[str], *, format: str = "png16") -> Path:
    """Store point-spread functions in a folder that `write_maps` wrote.

    Parameters
    ----------
    maps : sequence of SpreadMaps
        One for every pixel array.
    folder : path
    format : {"png16", "png8", "exr", "hdr"}

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    ValueError
        If the format is unknown, or the folder holds another number of pixel arrays or of pixels.
    OSError
        If ``camera.json`` is missing or the folder cannot be written.
    """
    check_format(format)
    folder = Path(folder)
    sheet = read_json(folder / SHEET)
    arrays = sheet.get("arrays") if isinstance(sheet, dict) else None
    if not isinstance(arrays, list) or len(arrays) != len(maps):
        there = f"{len(arrays)} pixel arrays" if isinstance(arrays, list) else "no pixel arrays"
        raise ValueError(f"{folder / SHEET} has {there}, maps {len(maps)}: as many are needed")
    suffix, dtype = FORMATS[format]
    steps = 2 ** (8 * np.dtype(dtype).itemsize) if dtype != "float32" else 1
    written = []
    for i, (array, one) in enumerate(zip(arrays, maps, strict=True)):
        if list(one.defocus_mm.shape[::-1]) != sheet.get("pixels"):
            raise ValueError(f"maps are of {one.defocus_mm.shape[::-1]} pixels, the folder of {sheet.get('pixels')}")
        entry: dict[str, Any] = {"pixel_pitch_mm": one.pixel_pitch_mm}
        aberration = np.zeros_like(one.defocus_mm) if one.aberration_mm is None else one.aberration_mm
        spot = np.stack([one.defocus_mm, aberration, np.zeros_like(one.defocus_mm)], axis=-1)
        for name, values in zip(NAMES, (spot, one.airy_mm), strict=True):
            plane = values.reshape(-1, 3).astype(np.float64)
            ends = np.stack([plane.min(axis=0), plane.max(axis=0)], axis=1).tolist()
            box = [[0.0, 1.0]] * 3 if format == "exr" else [widened(pair, steps) for pair in ends]
            file = f"{name}{_ending(i, len(maps))}{suffix}"
            entry[name] = {"file": file, "C": steps, "box": box}
            written.append((file, encode(values.astype(np.float64), box, steps, dtype)))
        array["spread"] = entry
    for file, pixels in written:
        write_image(folder / file, pixels)
    write_json(folder / SHEET, sheet)
    return folder


@checks.checked(folder=checks.path)
def read_spread(folder: str | os.PathLike[str]) -> tuple[SpreadMaps, ...]:
    """Read the point-spread functions of a folder of camera maps, one for every pixel array.

    Raises
    ------
    ValueError
        If the folder has none, or ``camera.json`` or an image has another form.
    OSError
        If a file is missing.
    """
    path = Path(folder) / SHEET
    sheet = read_json(path)
    try:
        arrays = sheet.get("arrays") if isinstance(sheet, Mapping) else None
        if not isinstance(arrays, list) or not all(isinstance(a, Mapping) and a.get("spread") for a in arrays):
            raise ValueError("no point-spread functions: `raytrace-ii camera NAME --spread inf -o DIR` writes them")
        return tuple(_read(array["spread"], path.parent) for array in arrays)
    except (TypeError, KeyError, AttributeError, ArithmeticError) as error:
        raise ValueError(f"{path}: spread is damaged: {one_line(error)}") from None
    except ValueError as error:
        raise ValueError(f"{path}: {one_line(error)}") from None


def _read(entry: Mapping[str, Any], folder: Path) -> SpreadMaps:
    if missing := {*NAMES, "pixel_pitch_mm"} - set(entry):
        raise ValueError(f"spread has no {', '.join(sorted(missing))}")
    (height, width, _), _ = image_header(inside(folder, entry["S"]["file"]))
    every = (slice(None), slice(None))
    spot, airy = (stored_map(entry, name, folder, (width, height)).block(*every) for name in NAMES)
    least = 1e-12  # of a ring: 0 would be a lens without end
    if not (np.isfinite(spot).all() and (airy >= least).all() and np.isfinite(airy).all()):
        raise ValueError(f"{entry['A']['file']}, {entry['S']['file']}: finite widths, rings above 0, are needed")
    aberration = spot[..., 1].astype(np.float32) if spot[..., 1].any() else None
    disk = np.maximum(spot[..., 0], 0).astype(np.float32)
    return SpreadMaps(
        disk, airy.astype(np.float32), checks.length("pixel_pitch_mm", entry["pixel_pitch_mm"]), aberration
    )


def _ending(i: int, count: int) -> str:
    return "" if count == 1 else f"_{i}"
