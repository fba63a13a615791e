"""Cameras stored as images: location and direction maps in PNG, EXR or HDR, and the camera read from them.

A folder holds ``camera.json`` and, for every pixel array and sample, the images L and D. Their red, green and blue
are x, y and z. A third image, W, holds the transmitted share of light if rays are blocked or dimmed. A stored number
x means

    X = x / C · (max − min) + min

in each channel (3.12). Integers of b bits have C = 2^b. ``max`` is chosen so that both extremes are codes; with the
true maximum, (3.11) would not store it. Floats have C = 1. EXR stores millimetres, with min = 0 and max = 1. ``.hdr``
stores no negative numbers and uses the true extremes.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import checks
from ..base.files import image_header, one_line, read_image, read_json, write_image, write_json
from .camera import Floats, IICamera, whole_pair

FORMATS = {
    "png16": (".png", "uint16"),
    "png8": (".png", "uint8"),
    "exr": (".exr", "float32"),
    "hdr": (".hdr", "float32"),
}
SHEET = "camera.json"
BLOCK_ROWS = 64  # rows of rays computed at once

Box = list[list[float]]
Rays = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64] | None]


@checks.checked(
    folder=checks.path,
    cameras=checks.list_of(IICamera),
    format=checks.text,
    samples=checks.sequence,
    progress=checks.callable_,
)
def write_maps(
    cameras: Sequence[IICamera],
    folder: str | os.PathLike[str],
    *,
    format: str = "png16",
    samples: Sequence[tuple[ArrayLike, ArrayLike]] = (((0.5, 0.5), (0.5, 0.5)),),
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Store cameras of one pixel array each as maps.

    Parameters
    ----------
    cameras : sequence of IICamera
        All of the same structure.
    folder : path
        Created if it does not exist; files of the same names are replaced.
    format : {"png16", "png8", "exr", "hdr"}
    samples : sequence of (sample, place)
        Positions in the pixel and on the aperture, one pair of maps each; their centres by default.
    progress : callable, optional
        Called with the number of maps written and of all maps.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    ValueError
        If the format is unknown or the cameras differ in structure.
    OSError
        If the folder cannot be written.

    References
    ----------
    Olsson 2008, (3.11), (3.12).
    """
    if not cameras:
        raise ValueError("cameras is empty: at least one is needed")
    check_format(format)
    for pair in samples:
        if not isinstance(pair, Sequence) or isinstance(pair, str) or len(pair) != 2:
            raise checks.refuse("samples", samples, "a list of pairs of positions")
        for positions in pair:
            checks.numbers("samples", positions)
    first = cameras[0]
    if any((c.pixels, c.lenses) != (first.pixels, first.lenses) for c in cameras):
        raise ValueError("the cameras differ in pixels or lenses: one folder holds arrays of one structure")
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    arrays: list[dict[str, Any]] = []
    total = len(cameras) * len(samples)
    for i, camera in enumerate(cameras):
        stored = []
        for j, where in enumerate(samples):
            ending = "" if total == 1 else f"_{i}_{j}"
            stored.append(_write_pair(camera, where, folder, ending, format))
            if progress is not None:
                progress(len(samples) * i + j + 1, total)
        arrays.append({"camera": camera.to_json(), "samples": stored})
    write_json(folder / SHEET, {**_structure(first), "arrays": arrays})
    return folder


def map_files(cameras: Sequence[IICamera], format: str = "png16", *, samples: int = 1) -> list[str]:
    """Return the names of all files that `write_maps` may write; W is written only if rays lose light."""
    check_format(format)
    total = len(cameras) * samples
    endings = [f"_{i}_{j}" for i in range(len(cameras)) for j in range(samples)] if total > 1 else [""]
    return [SHEET, *(f"{name}{ending}{FORMATS[format][0]}" for ending in endings for name in "LDW")]


def check_format(format: str) -> None:
    """Raise ValueError with the known formats unless this is one."""
    if format not in FORMATS:
        raise ValueError(f"unknown format {format!r}: known are {', '.join(FORMATS)}")


def _structure(camera: IICamera) -> dict[str, Any]:
    focal = getattr(camera.lens_model, "focal_mm", None)
    return {
        "format": "ii-camera-maps",
        "version": 1,
        "name": camera.name,
        "kind": camera.lens_model.kind,
        "pixels": list(camera.pixels),
        "lenses": list(camera.lenses),
        "ei_pixels": list(camera.ei_pixels),
        "pixel_pitch_mm": camera.pixel_pitch_mm,
        "lens_pitch_mm": list(camera.lens_pitch_mm),
        "gap_mm": camera.gap_mm,
        "focal_mm": focal,
        "lattice": camera.lattice,
        "erect": camera.erect,
    }


def _write_pair(
    camera: IICamera, where: tuple[ArrayLike, ArrayLike], folder: Path, ending: str, format: str
) -> dict[str, Any]:
    """Write the images of one sample and return their entry in the sheet."""
    suffix, dtype = FORMATS[format]
    boxes, weighted = _extremes(camera, where)
    if format == "exr":
        boxes = {name: [[0.0, 1.0]] * 3 for name in boxes}
    out = {name: np.empty((camera.pixels[1], camera.pixels[0], 3), dtype) for name in boxes}
    if weighted:
        out["W"] = np.empty((camera.pixels[1], camera.pixels[0], 3), dtype)
        boxes["W"] = [[0.0, 1.0]] * 3
    steps = 2 ** (8 * np.dtype(dtype).itemsize) if dtype != "float32" else 1
    sheet: dict[str, Any] = {}
    for name, box in boxes.items():
        sheet[name] = {"file": f"{name}{ending}{suffix}", "C": steps, "box": [widened(b, steps) for b in box]}
    for rows, L, D, weight in _blocks(camera, where):
        values = {"L": L, "D": D}
        if weighted:
            share = np.ones(L.shape[:2]) if weight is None else weight
            values["W"] = np.repeat(share[..., None], 3, axis=2)
        for name, value in values.items():
            out[name][rows] = encode(value, sheet[name]["box"], steps, dtype)
    for name, pixels in out.items():
        write_image(folder / sheet[name]["file"], pixels)
    return sheet


def _blocks(camera: IICamera, where: tuple[ArrayLike, ArrayLike]) -> Iterator[tuple[slice, Any, Any, Any]]:
    """Yield rays in bands of rows, with unit directions."""
    for top in range(0, camera.pixels[1], BLOCK_ROWS):
        rows = slice(top, min(top + BLOCK_ROWS, camera.pixels[1]))
        L, D, weight = camera.weighted_rays(rows, slice(None), *where)
        if weight is not None:
            D[weight == 0] = (0, 0, 1)  # any direction: W marks the ray as blocked
        yield rows, L, D / np.linalg.norm(D, axis=-1, keepdims=True), weight


def _extremes(camera: IICamera, where: tuple[ArrayLike, ArrayLike]) -> tuple[dict[str, Box], bool]:
    """Return the extremes of the rays that are not blocked, and whether any ray loses light."""
    low, high, weighted = np.full((2, 3), np.inf), np.full((2, 3), -np.inf), False
    for _, L, D, weight in _blocks(camera, where):
        for i, value in enumerate((L, D)):
            needed = value.reshape(-1, 3) if weight is None else value[weight > 0]
            low[i] = np.minimum(low[i], needed.min(axis=0, initial=np.inf))
            high[i] = np.maximum(high[i], needed.max(axis=0, initial=-np.inf))
        weighted = weighted or (weight is not None and bool((weight != 1).any()))
    if not np.isfinite(low).all():
        raise ValueError(f"camera {camera.name!r} blocks every ray: optics that let rays pass are needed")
    boxes = {name: np.stack([low[i], high[i]], axis=1).tolist() for i, name in enumerate("LD")}
    return boxes, weighted


def widened(box: Sequence[float], steps: int) -> list[float]:
    """Return the extremes for which the last code is the true maximum."""
    low, high = box
    return [low, low + (high - low) * steps / (steps - 1)] if steps > 1 else [low, high]


def encode(values: NDArray[np.float64], box: Box, steps: int, dtype: str) -> NDArray[Any]:
    """Return the codes of numbers (3.11); 0 where the extremes are equal."""
    low, high = np.array(box).T
    extent = high - low
    share = (values - low) / np.where(extent == 0, 1, extent)
    return np.clip(np.rint(share * steps), 0, steps - 1).astype(dtype) if steps > 1 else share.astype(dtype)


def decode(stored: NDArray[Any], box: Box, steps: float) -> NDArray[np.float64]:
    """Return the numbers of codes (3.12)."""
    low, high = np.array(box).T
    return stored / steps * (high - low) + low


@dataclass(frozen=True, eq=False)
class _Map:
    stored: NDArray[Any]
    box: Box
    steps: float

    def block(self, rows: slice, cols: slice) -> NDArray[np.float64]:
        return decode(self.stored[rows, cols], self.box, self.steps)


@dataclass(frozen=True, eq=False)
class MapCamera:
    """Camera of stored rays: one pixel array, ``stored_samples`` rays per pixel.

    `read_maps` returns it. `render` accepts it in place of an `IICamera`.
    """

    pixels: tuple[int, int]
    lenses: tuple[int, int]
    ei_pixels: tuple[Any, Any]
    erect: bool
    model: IICamera | None
    name: str
    maps: tuple[dict[str, _Map], ...]

    @property
    def stored_samples(self) -> int:
        """Rays per pixel."""
        return len(self.maps)

    @checks.checked(rows=checks.block, cols=checks.block)
    def rays(self, rows: slice = slice(None), cols: slice = slice(None)) -> tuple[Floats, Floats]:
        """Return L and D, (h, w, 3), of the first sample of a block of pixels."""
        L, D, _ = self.stored_rays(0, rows, cols)
        return L, D

    @checks.checked(sample=checks.whole, rows=checks.block, cols=checks.block)
    def stored_rays(self, sample: int, rows: slice = slice(None), cols: slice = slice(None)) -> Rays:
        """Return L, D and the transmitted share of light (None for all) of one sample of a block of pixels."""
        if not 0 <= sample < len(self.maps):
            raise ValueError(f"sample is {sample}: there are {len(self.maps)}, from 0")
        maps = self.maps[sample]
        L, D = maps["L"].block(rows, cols), maps["D"].block(rows, cols)
        if "W" in maps:
            return L, D, maps["W"].block(rows, cols)[..., 0]
        dark = (D == 0).all(axis=-1)  # maps made by hand: direction 0 is a blocked ray
        return L, D, (~dark).astype(np.float64) if dark.any() else None


@checks.checked(folder=checks.path)
def read_maps(folder: str | os.PathLike[str]) -> tuple[MapCamera, ...]:
    """Read cameras from a folder of maps, one per pixel array.

    ``camera.json`` needs ``arrays`` with the ``file`` of each image, and its ``C`` and ``box`` unless it stores
    millimetres as floats. Without ``lenses`` the camera has one lens.

    Raises
    ------
    ValueError
        If ``camera.json`` or an image has another form.
    OSError
        If a file is missing.
    """
    path = Path(folder) / SHEET
    sheet = read_json(path)
    try:
        if not isinstance(sheet, Mapping) or not isinstance(sheet.get("arrays"), list) or not sheet["arrays"]:
            raise ValueError('no camera maps: "arrays" with at least one is needed')
        return tuple(_map_camera(sheet, array, path.parent) for array in sheet["arrays"])
    except (ValueError, TypeError, KeyError, AttributeError, ArithmeticError) as error:
        raise ValueError(f"{path}: {one_line(error.args[0] if error.args else error)}") from None


def _map_camera(sheet: Mapping[str, Any], array: Mapping[str, Any], folder: Path) -> MapCamera:
    if not isinstance(array, Mapping) or not array.get("samples"):
        raise ValueError('an array has no "samples"')
    for pair in array["samples"]:
        if not {"L", "D"} <= set(pair):
            raise ValueError("every sample needs the images L and D")
    (height, width, _), _ = image_header(inside(folder, array["samples"][0]["L"]["file"]))
    lenses = whole_pair("lenses", sheet.get("lenses", (1, 1)))
    model = IICamera.from_json(array["camera"]) if array.get("camera") else None
    if model is not None and (model.pixels, model.lenses) != ((width, height), lenses):
        raise ValueError(f"the camera has {model.pixels} pixels, the maps {(width, height)}")
    ei = (
        model.ei_pixels
        if model
        else whole_pair("width and height over lenses", (width / lenses[0], height / lenses[1]))
    )
    maps = tuple(
        {name: stored_map(pair, name, folder, (width, height)) for name in ("L", "D", "W") if name in pair}
        for pair in array["samples"]
    )
    name = str(sheet.get("name", folder.name))
    return MapCamera((width, height), lenses, ei, bool(sheet.get("erect", False)), model, name, maps)


def _is_finite(value: Any) -> bool:
    return isinstance(value, int | float) and abs(value) < np.inf


def inside(folder: Path, name: str) -> Path:
    """Return the path of a file in the folder; raise ValueError if the name points outside."""
    if not isinstance(name, str) or not (folder / name).resolve().is_relative_to(folder.resolve()):
        raise ValueError(f"file is {name!r}: a name inside {folder} is needed")
    return folder / name


def stored_map(pair: Mapping[str, Any], name: str, folder: Path, size: tuple[int, int]) -> _Map:
    """Read one map; its header is compared with the size of the first L before pixels are decoded."""
    entry = pair[name]
    stored = read_image(inside(folder, entry["file"]), size=size)
    if stored.shape[2] < 3:
        raise ValueError(f"{entry['file']} has {stored.shape[2]} channels: x, y and z are needed")
    integer = stored.dtype.kind == "u"
    steps = entry.get("C", 2 ** (8 * stored.dtype.itemsize) if integer else 1)
    box = entry.get("box", [[0.0, 1.0]] * 3)
    if integer and "box" not in entry:
        raise ValueError(f"{entry['file']} holds codes: its box is needed")
    if np.shape(box) != (3, 2) or not all(_is_finite(x) for x in (steps, *chain(*box))) or not steps > 0:
        raise ValueError(
            f"{entry['file']}: C is {steps}, box {box}: a positive C and three pairs of numbers are needed"
        )
    return _Map(stored[..., :3], box, float(steps))
