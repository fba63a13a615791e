"""Point-spread functions on the command line: written beside camera maps, applied to pictures."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from ii_core import IICamera, IIPicture
    from ii_core.waves.spread import SpreadMaps

AUTO = "auto"


def depth_of(text: str) -> Any:
    """Return a depth in mm, infinity, or the map of a depth image.

    Raises
    ------
    ValueError
        If it is neither a number nor an .exr file.
    """
    from ii_core.base.files import read_depth

    if text.endswith(".exr"):
        return read_depth(text)
    try:
        depth = float(text)
    except ValueError:
        depth = math.nan
    if math.isnan(depth):
        raise ValueError(f"spread is {text!r}: a depth in mm, inf, or a depth image .exr is needed")
    return depth


def maps_of(text: str, camera: IICamera | None, index: int, depth_mm: Any) -> SpreadMaps:
    """Return the maps of ``auto``, by depth, or those of one pixel array of a folder.

    Raises
    ------
    ValueError
        If it is neither, there is no such array, or ``auto`` has no camera.
    """
    from ii_core.waves.spread import spread_maps
    from ii_core.waves.spread_files import read_spread

    if text != AUTO:
        return _stored(read_spread, text, index)
    if camera is None:
        raise ValueError("the maps have no camera parameters: --spread DIR with point-spread functions is needed")
    return spread_maps(camera, depth_mm)


def check_spread(text: str, arrays: Sequence[Any]) -> None:
    """Raise ValueError, before any work, unless pictures of these pixel arrays can be spread."""
    from ii_core.waves.spread_files import read_spread

    for i, array in enumerate(arrays):
        if array.lenses == (1, 1):
            raise ValueError("--spread is of lens arrays: this camera has one lens")
        if text == AUTO:
            if array.model is None:
                maps_of(text, None, i, 0.0)
            if not array.model.regular:
                raise ValueError("camera is not regular: --spread needs lenses over whole numbers of pixels")
            continue
        maps = _stored(read_spread, text, i)
        if maps.defocus_mm.shape != array.pixels[::-1]:
            raise ValueError(f"{text} is of {maps.defocus_mm.shape[::-1]} pixels, the camera of {array.pixels}")


def _stored(read: Callable[[str], tuple[SpreadMaps, ...]], text: str, index: int) -> SpreadMaps:
    if not Path(text).is_dir():
        raise ValueError(f"spread is {text!r}: auto, or a folder that `raytrace-ii camera --spread` wrote, is needed")
    maps = read(text)
    if index >= len(maps):
        raise ValueError(f"{text} has point-spread functions of {len(maps)} pixel arrays: {index + 1} are needed")
    return maps[index]


def shoot_spread(
    shoot: Callable[..., Any], path: Path, camera: Any, index: int, text: str, options: dict[str, Any]
) -> Any:
    """Render in linear light, spread it, and store it in the wanted type with the sensor's noise; return the stats.

    Parameters
    ----------
    shoot : callable
        ``shoot(path, **options)`` renders into a file.
    """
    from ii_core import IIPicture
    from ii_core.base.atomic import folder_beside
    from ii_core.base.files import read_depth
    from ii_core.waves.spread import spread_picture

    dtype, noise = options.pop("dtype"), options.pop("noise", 0.0)
    with folder_beside(path) as folder:
        light, depth = folder / "light.exr", folder / "depth.exr"
        files = dict(options.pop("support"))
        if text == AUTO:
            files["depth"] = [*files.get("depth", ()), depth]
        stats = shoot(light, support=files, dtype="float32", **options)
        sharp = IIPicture.load(light)
        maps = maps_of(text, camera.model, index, read_depth(depth) if text == AUTO else None)
    _coded(spread_picture(sharp, maps), dtype, noise, options.get("seed", 0)).save(path)
    return stats


def _coded(light: IIPicture, dtype: str, noise: float, seed: int) -> IIPicture:
    from ii_core.base.colour import srgb
    from ii_core.picture.picture import peak
    from ii_core.picture.sensor_noise import add_sensor_noise

    pixels = light.pixels
    if dtype != "float32":
        top = peak(np.dtype(dtype))
        pixels = np.rint(np.clip(srgb(np.maximum(pixels, 0).astype(np.float64)), 0, 1) * top).astype(dtype)
    done = light.with_pixels(pixels)
    return add_sensor_noise(done, noise, seed) if noise else done
