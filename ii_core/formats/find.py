"""Import of a light field: its views, their order, the II-picture."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..base import checks
from ..camera.camera import Pair
from ..picture.picture import IIPicture
from ..picture.view import turned_pixels
from .arrays import ARRAYS, array_views
from .grid import Views
from .order import Arrangement, estimate
from .quilt import quilt_views
from .views import folder_views


@checks.checked(source=checks.path, grid=checks.whole_pair)
def find_views(source: str | os.PathLike[str], *, grid: Pair | None = None) -> Views:
    """Return the views of a folder, of an array in a file, or of a quilt.

    Parameters
    ----------
    source : path
        A folder, a file of `ARRAYS`, or a picture file with ``_qsCxRaA`` in its name.
    grid : (columns, rows), optional
        Grid of views with only one number in their names, or of the tiles of a quilt without it in its name.

    Raises
    ------
    ValueError
        If there are no views, only one, some are missing, numbers have gaps, or file types are mixed.
    OSError
        If the source cannot be read.
    """
    path = Path(source)
    if path.is_dir():
        return folder_views(path, grid)
    if path.suffix.lower() in ARRAYS:
        if grid is not None:
            raise ValueError(f"{path} says its grid of views: leave out the grid")
        return array_views(path)
    return quilt_views(path, grid)


@checks.checked(views=checks.instance(Views), transposed=checks.flag, flip_down=checks.flag, flip_across=checks.flag)
def picture_of(
    views: Views, *, transposed: bool | None = None, flip_down: bool | None = None, flip_across: bool | None = None
) -> tuple[IIPicture, Arrangement]:
    """Return the II-picture whose sub-images are the views, and the arrangement of the views.

    Parameters
    ----------
    views : Views
    transposed, flip_down, flip_across : bool, optional
        See `Arrangement`; given values are not estimated.

    Raises
    ------
    ValueError
        If views differ in size or type.
    OSError
        If a view cannot be read.
    """
    given = {"transposed": transposed, "flip_down": flip_down, "flip_across": flip_across}
    chosen: Any = {name: value for name, value in given.items() if value is not None}
    order = _arranged(views, chosen)
    first = views.read(0, 0)
    height, width = first.shape[:2]
    cols, rows = order.grid(views.shape)
    pixels = np.empty((height * rows, width * cols, 3), first.dtype)
    for a, b in np.ndindex(*views.shape):
        row, col = order.place(a, b, views.shape)
        pixels[row::rows, col::cols] = views.read(a, b)
    camera = None
    if views.structure is None and views.rig is not None:
        camera = views.rig.camera((cols, rows), (width, height))
    picture = IIPicture(pixels, (width, height), (cols, rows), camera)
    if views.structure is None:
        return picture, order
    known = IIPicture.from_structure_json(pixels, views.structure)
    return (known.with_pixels(turned_pixels(known)) if known.erect else known), order


def _arranged(views: Views, chosen: dict[str, Any]) -> Arrangement:
    """Return the arrangement: as chosen, else by the places of cameras in names, else by the pictures."""
    names = views.positions if views.structure is None else None
    if names is None:
        return estimate(views.read, views.shape, Arrangement(**chosen), views.known | set(chosen))
    start: dict[str, Any] = {
        "transposed": names.transposed,
        "flip_across": names.flip_across,
        "flip_down": names.flip_down,
        **chosen,
    }
    order = estimate(
        views.read, views.shape, Arrangement(**start), {*views.known, *chosen, "transposed", "flip_across"}
    )
    across, down = names.step_mm
    how = "; vertical places upwards is assumed" if order.basis == "assumed" else f"; {order.basis}"
    told = "" if order.basis == "given" else how
    return replace(order, basis=f"by camera places in names, {across:.4g}×{down:.4g} mm apart{told}")
