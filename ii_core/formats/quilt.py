"""Quilt of views along one line: tiles from the bottom left, rows upward; ``name_qsCxRaA.png``."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base import checks
from ..base.files import write_image
from ..camera.camera import Pair
from ..picture.picture import IIPicture
from .grid import WHOLE_ORDER, Views, camera_views, read_view

QUILT = re.compile(r"_qs(\d+)x(\d+)(?:a(\d+(?:\.\d+)?))?")


def aspect_of(name: str) -> float | None:
    """Return the aspect of the display in the name of a quilt; None without one."""
    match = QUILT.search(name)
    return float(match[3]) or None if match and match[3] else None


def quilt_views(path: Path, grid: Pair | None) -> Views:
    """Return the views of a quilt; ``grid`` is (columns, rows) of tiles, by default that of the name."""
    match = QUILT.search(path.stem)
    if match is None and grid is None:
        if not path.exists():
            raise ValueError(f"{path} does not exist: a folder of views, or a quilt with its grid, is needed")
        raise ValueError(
            f"{path} is no folder and its name says no _qsCxRaA: a quilt needs its grid of tiles, a lenslet picture "
            "its white picture or the pixels under a lens"
        )
    cols, rows = grid or (int(match[1]), int(match[2]))  # type: ignore[index]
    pixels = read_view(path)
    height, width = pixels.shape[:2]
    if not (1 <= rows <= height and 1 <= cols <= width):
        raise ValueError(f"{path} of {width}×{height} px cannot hold {cols}×{rows} tiles")
    if rows * cols == 1:
        raise ValueError(f"{path} holds one view: a light field needs at least two")
    tile_height, tile_width = height // rows, width // cols

    def tile(_: int, number: int) -> NDArray[Any]:
        up, right = divmod(number, cols)
        top = height - (up + 1) * tile_height
        return pixels[top : top + tile_height, right * tile_width : (right + 1) * tile_width]

    return Views(shape=(1, rows * cols), read=tile, known=WHOLE_ORDER, aspect=aspect_of(path.stem))


def quilt_pixels(views: Iterable[NDArray[Any]], tiles: Pair) -> NDArray[Any]:
    """Return one picture with views, from left to right, as its tiles.

    Parameters
    ----------
    views : iterable of ndarray, (height, width, 3)
        As many as tiles.
    tiles : (columns, rows)

    Returns
    -------
    ndarray, (rows · height, columns · width, 3)
    """
    columns, rows = tiles
    out = None
    for number, view in enumerate(views):
        if out is None:
            height, width, _ = view.shape
            out = np.empty((rows, height, columns, width, 3), view.dtype)
        out[rows - 1 - number // columns, :, number % columns] = view
    assert out is not None
    return out.reshape(rows * height, columns * width, 3)


def quilt_name(path: str | os.PathLike[str], tiles: Pair, aspect: float) -> Path:
    """Return the path with ``_qsCxRaA`` after its stem: tiles, and the aspect of the display.

    Tiles of other sides are stretched to that aspect: a display of 16:9 has square ones.
    """
    path = Path(path)
    return path.with_name(f"{QUILT.sub('', path.stem)}_qs{tiles[0]}x{tiles[1]}a{aspect:.6g}{path.suffix}")


@checks.checked(picture=checks.instance(IIPicture), path=checks.path, row=checks.whole)
def write_quilt(picture: IIPicture, path: str | os.PathLike[str], *, row: int | None = None) -> Path:
    """Write one row of views as a quilt, left to right from the bottom left.

    Parameters
    ----------
    path : path
        ``_qsCxRaA`` is added after its stem.
    row : int, optional
        Row of views; the middle one, V//2, if not given.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ValueError
        If there is no such row.
    OSError
        If it cannot be written.
    """
    pixels = quilt_row(picture, row)
    target = quilt_path(path, picture)
    write_image(target, pixels)
    return target


def quilt_row(picture: IIPicture, row: int | None = None) -> NDArray[Any]:
    """Return one row of views as a quilt; errors as `write_quilt`."""
    picture.check_regular()
    (k, l), (u, v) = picture.lenses, picture.ei_pixels
    chosen = v // 2 if row is None else row
    if not 0 <= chosen < v:
        raise ValueError(f"row is {row}: the picture has {v} rows of views, from 0")
    views = (view for at, _, view in camera_views(picture) if at == chosen)
    return quilt_pixels(views, _tiles(u, (k, l)))


def quilt_path(path: str | os.PathLike[str], picture: IIPicture) -> Path:
    """Return the path that `write_quilt` writes, with tiles and aspect after the stem."""
    picture.check_regular()
    (k, l), (u, _) = picture.lenses, picture.ei_pixels
    pitch = picture.camera.lens_pitch_mm if picture.camera else (1.0, 1.0)
    return quilt_name(path, _tiles(u, (k, l)), k * pitch[0] / (l * pitch[1]))


def _tiles(views: int, size: Pair) -> Pair:
    """Return (columns, rows) of ``views`` tiles for the most nearly square quilt."""
    divisors = [n for n in range(1, views + 1) if views % n == 0]
    down = min(divisors, key=lambda n: abs(math.log(views / n * size[0] / (n * size[1]))))
    return views // down, down
