"""Point cloud of a view: places in camera coordinates and colours."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base import checks
from ..base.files import atomic_path
from ..camera.camera import Pair
from ..picture.component import sub_images
from ..picture.picture import IIPicture, codes8
from ..picture.view import camera_of


@checks.checked(picture=checks.instance(IIPicture), depth_mm=checks.array, view=checks.indices)
def view_points(
    picture: IIPicture, depth_mm: NDArray[np.floating], view: Pair
) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """Return the points that a view sees.

    Parameters
    ----------
    picture : IIPicture
        With its camera.
    depth_mm : ndarray, (L, K)
        z in camera coordinates; pixels that are not finite have no point.
    view : (u, v)

    Returns
    -------
    places : ndarray, (points, 3)
        Camera coordinates, mm.
    colours : ndarray of uint8, (points, 3)
        sRGB.
    """
    camera = camera_of(picture)
    (across, down), (u, v) = picture.lenses, picture.ei_pixels
    if depth_mm.shape != (down, across):
        raise ValueError(f"depth_mm is of shape {depth_mm.shape}: that of a view, {(down, across)}, is needed")
    places = np.empty((down, across, 3))
    for l in range(down):
        row = l * v + view[1]
        start, direction = (ray[0, view[0] :: u] for ray in camera.rays(rows=slice(row, row + 1)))
        with np.errstate(divide="ignore", invalid="ignore"):  # rays that a rim blocks
            share = (depth_mm[l] - start[:, 2]) / direction[:, 2]
            places[l] = start + share[:, None] * direction
    known = np.isfinite(places).all(axis=2)
    return places[known], codes8(sub_images(picture)[view[1], view[0]])[known]


def write_ply(path: str | os.PathLike[str], places: NDArray[Any], colours: NDArray[np.uint8]) -> Path:
    """Write points with colours as a binary PLY file; return its path."""
    names = [(axis, "<f4") for axis in "xyz"] + [(name, "u1") for name in ("red", "green", "blue")]
    points = np.empty(len(places), names)
    for i, axis in enumerate("xyz"):
        points[axis] = places[:, i]
    for i, name in enumerate(("red", "green", "blue")):
        points[name] = colours[:, i]
    properties = "".join(f"property {'float' if kind == '<f4' else 'uchar'} {name}\n" for name, kind in names)
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(places)}\n{properties}end_header\n"
    with atomic_path(path) as temporary:
        temporary.write_bytes(head.encode("ascii") + points.tobytes())
    return Path(path)
