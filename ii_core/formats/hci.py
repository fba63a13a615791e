"""HCI layout: ``input_Cam000.png`` …, ``parameters.cfg`` and a disparity map.

References
----------
K. Honauer et al., "A dataset and evaluation methodology for depth estimation on 4D light fields", 2016.
"""

from __future__ import annotations

import configparser
import math
import os
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base import checks
from ..base.files import atomic_path, one_line, read_text, write_image
from ..camera.camera import Pair
from ..picture.disparity import disparity_of_depth
from ..picture.picture import IIPicture
from .grid import WHOLE_ORDER, Views, camera_views, listed
from .pfm import write_pfm
from .rig import Rig, rig_of

HCI_VIEW = re.compile(r"input_Cam(\d+)\.\w+")
MAX_CONFIG = 1 << 20  # bytes of a parameters.cfg; those of the benchmark have about 1000


def hci_views(folder: Path, files: list[Path], grid: Pair | None) -> Views:
    """Return the views of a folder in this layout; ``grid`` is (columns, rows), else by ``parameters.cfg``."""
    config = _parameters(folder)
    found = listed(files, grid or _hci_grid(folder, len(files), config), known=WHOLE_ORDER)
    return replace(found, rig=_rig(folder, config))


def _parameters(folder: Path) -> configparser.ConfigParser:
    """Return the folder's parameters.cfg, empty if there is none."""
    config = configparser.ConfigParser(interpolation=None)
    path = folder / "parameters.cfg"
    if os.path.lexists(path):
        try:
            config.read_string(read_text(path, MAX_CONFIG))
        except configparser.Error as error:
            raise ValueError(f"{path} does not say num_cams_x and num_cams_y: {one_line(error)}") from None
    return config


def _rig(folder: Path, config: configparser.ConfigParser) -> Rig | None:
    """Return the cameras of parameters.cfg; None without their baseline, focal length or sensor."""
    places = {
        "baseline_mm": ("extrinsics", "baseline_mm", 1.0),
        "focal_mm": ("intrinsics", "focal_length_mm", 1.0),
        "sensor_mm": ("intrinsics", "sensor_size_mm", 1.0),
        "focus_mm": ("extrinsics", "focus_distance_m", 1000.0),
    }
    try:
        given = {
            name: config.getfloat(section, key) * unit
            for name, (section, key, unit) in places.items()
            if config.has_option(section, key)
        }
        return Rig(**given) if {"baseline_mm", "focal_mm", "sensor_mm"} <= set(given) else None
    except (configparser.Error, ValueError) as error:
        raise ValueError(f"{folder / 'parameters.cfg'}: {one_line(error)}") from None


def _hci_grid(folder: Path, count: int, config: configparser.ConfigParser) -> Pair:
    """Return (columns, rows) of the folder's parameters.cfg, or of a square grid."""
    try:
        if config.has_section("extrinsics"):
            return config.getint("extrinsics", "num_cams_x"), config.getint("extrinsics", "num_cams_y")
    except (configparser.Error, ValueError) as error:
        path = folder / "parameters.cfg"
        raise ValueError(f"{path} does not say num_cams_x and num_cams_y: {one_line(error)}") from None
    side = math.isqrt(count)
    if side * side != count:
        raise ValueError(f"{folder} holds {count} views, no square, and no parameters.cfg: give the grid")
    return side, side


@checks.checked(picture=checks.instance(IIPicture), folder=checks.path, depth=checks.array)
def write_hci(picture: IIPicture, folder: str | os.PathLike[str], *, depth: NDArray[Any] | None = None) -> Path:
    """Write the layout of the HCI benchmark: views, ``parameters.cfg`` and, with depth, a disparity map.

    ``gt_disp_lowres.pfm`` holds the disparity of the view at row V//2, column U//2; see `view_disparity`.
    ``parameters.cfg`` has baseline, focal length and focus distance if the camera is that of a `Rig`. Views of other
    II-pictures are parallel projections without a focal length.

    Parameters
    ----------
    picture : IIPicture
        Of 8 or 16 bit.
    depth : ndarray, (N, M), optional
        Scene z of every pixel, mm; NaN without a hit.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    ValueError
        If the picture has float pixels, or depth has another size or the picture no camera.
    OSError
        If a file cannot be written.
    """
    picture.check_regular()
    folder = Path(folder)
    disparity = None if depth is None else view_disparity(picture, depth)
    (k, l), (u, v) = picture.lenses, picture.ei_pixels
    config = configparser.ConfigParser()
    config["intrinsics"] = {"image_resolution_x_px": str(k), "image_resolution_y_px": str(l)}
    config["extrinsics"] = {"num_cams_x": str(u), "num_cams_y": str(v)}
    rig = rig_of(picture.camera) if picture.camera else None
    if rig is not None and rig.focus_mm is not None:
        intrinsics = {"focal_length_mm": rig.focal_mm, "sensor_size_mm": rig.sensor_mm}
        extrinsics = {"baseline_mm": rig.baseline_mm, "focus_distance_m": rig.focus_mm / 1000}
        for section, values in (("intrinsics", intrinsics), ("extrinsics", extrinsics)):
            config[section].update({key: repr(value) for key, value in values.items()})
    if disparity is not None and np.isfinite(disparity).any():
        low, high = float(np.nanmin(disparity)), float(np.nanmax(disparity))
        config["meta"] = {"disp_min": repr(low), "disp_max": repr(high)}
    for row, col, view in camera_views(picture):
        write_image(folder / f"input_Cam{row * u + col:03}.png", view)
    with atomic_path(folder / "parameters.cfg") as temporary, temporary.open("w", encoding="utf-8") as file:
        config.write(file)
    if disparity is not None:
        write_pfm(folder / "gt_disp_lowres.pfm", disparity)
    return folder


def view_disparity(picture: IIPicture, depth: NDArray[Any]) -> NDArray[np.float32]:
    """Return the disparity of the view at row V//2, column U//2 of a rendered picture, pixels per view step.

    See `disparity_of_depth`. A point on the lens plane has the same position in all views. Points behind it move with
    the viewer, hence the sign: column x becomes x − d in the next view to the right. NaN without a hit.

    Parameters
    ----------
    picture : IIPicture
        With its camera.
    depth : ndarray, (N, M)
        Scene z of every pixel, mm.

    Returns
    -------
    ndarray of float32, (L, K)

    Raises
    ------
    ValueError
        If the depth map has another size, the picture has no camera, or elements in front of its lenses refract rays.
    """
    camera = picture.camera
    if camera is None or camera.front:
        what = "has no camera" if camera is None else "was taken through a lens before the array"
        raise ValueError(f"the picture {what}: its disparity does not follow from depth")
    if depth.shape != picture.pixels.shape[:2]:
        raise ValueError(f"depth is {depth.shape}: {picture.pixels.shape[:2]} is needed")
    u, v = picture.ei_pixels
    row, col = v // 2, u // 2
    below, right = (v - 1 - row, u - 1 - col) if picture.erect else (row, col)
    return disparity_of_depth(camera, depth[below::v, right::u]).astype(np.float32)
