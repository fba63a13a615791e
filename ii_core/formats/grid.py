"""Grid of views: the result of every reader; views of an II-picture in camera order."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..camera.camera import Pair
from ..picture.picture import IIPicture
from .order import Read
from .positions import Positions
from .profiles import read_upright
from .rig import Rig

WHOLE_ORDER = frozenset(("transposed", "flip_down", "flip_across"))


@dataclass(frozen=True, kw_only=True)
class Views:
    """Grid of views in the arrangement of their files.

    Parameters
    ----------
    shape : (int, int)
        Number of views along the first and the second number.
    read : callable
        Returns view (a, b) as (T, S, 3); size and type are checked against the other views.
    known : frozenset of str
        Parts of an `Arrangement` that the layout fixes at their defaults.
    structure : dict, optional
        Structure of the original picture, if `write_views` stored it.
    rig : Rig, optional
        Measures of the cameras, if the layout holds them.
    positions : Positions, optional
        Grid of the cameras, if names hold their places.
    aspect : float, optional
        Width over height of a view as it is shown, if the layout says so; else its pixels are square.
    """

    shape: tuple[int, int]
    read: Read
    known: frozenset[str] = frozenset()
    structure: dict[str, Any] | None = None
    rig: Rig | None = None
    positions: Positions | None = None
    aspect: float | None = None

    def middle(self, shape: Pair) -> Views:
        """Return the middle views, so many along the first and the second number; ValueError if there are fewer."""
        if not all(1 <= few <= most for few, most in zip(shape, self.shape, strict=True)) or max(shape) < 2:
            raise ValueError(
                f"middle is {shape[0]}×{shape[1]} views: 2 to {self.shape[0]}×{self.shape[1]} are needed"
            )
        first = [(most - few) // 2 for few, most in zip(shape, self.shape, strict=True)]
        return replace(self, shape=shape, read=lambda a, b: self.read(first[0] + a, first[1] + b), structure=None)


def listed(files: list[Path], grid: Pair, known: frozenset[str]) -> Views:
    """Return the views of a list, row by row; ``grid`` is (columns, rows)."""
    cols, rows = grid
    if rows < 1 or cols < 1 or rows * cols != len(files):
        raise ValueError(f"grid is {cols}×{rows} views, columns × rows: {len(files)} are there")
    if len(files) == 1:
        raise ValueError(f"one view, {files[0]}, is no light field: at least two are needed")
    return Views(shape=(rows, cols), read=checked_reader(lambda i, j: files[i * cols + j], read_view), known=known)


def checked_reader(path_of: Callable[[int, int], Path], read: Callable[[Path], NDArray[Any]]) -> Read:
    """Return a reader that compares size and type of every view with the first."""
    known: list[tuple[Path, tuple[int, ...], np.dtype[Any]]] = []

    def checked(a: int, b: int) -> NDArray[Any]:
        path = path_of(a, b)
        pixels = read(path)
        if not known:
            known.append((path, pixels.shape, pixels.dtype))
        first, shape, dtype = known[0]
        if pixels.shape != shape:
            sizes = [f"{s[1]}×{s[0]} px" for s in (pixels.shape, shape)]
            raise ValueError(f"view {path} has {sizes[0]}, {first.name} {sizes[1]}: all must be of one size")
        if pixels.dtype != dtype:
            raise ValueError(f"view {path} is {pixels.dtype}, {first.name} {dtype}: all must be of one type")
        return pixels

    return checked


def read_view(path: str | os.PathLike[str]) -> NDArray[Any]:
    """Read a picture as (T, S, 3), upright and in sRGB, see `read_upright`; grey is repeated, opaque alpha dropped.

    Raises
    ------
    ValueError
        If it has another number of channels, or a transparent pixel.
    OSError
        If it cannot be read.
    """
    pixels = read_upright(path)
    channels = pixels.shape[2]
    if channels == 4:
        opaque = 1.0 if pixels.dtype.kind == "f" else np.iinfo(pixels.dtype).max
        if (pixels[..., 3] != opaque).any():
            raise ValueError(f"{path} is transparent in places: views must be opaque")
        return pixels[..., :3]
    if channels == 1:
        return np.repeat(pixels, 3, axis=2)
    if channels != 3:
        raise ValueError(f"{path} has {channels} channels: 1, 3 or 4 are needed")
    return pixels


def camera_views(picture: IIPicture) -> Iterator[tuple[int, int, NDArray[Any]]]:
    """Yield (row, column, view) in camera order from the top left, each view (L, K, 3).

    Raises
    ------
    ValueError
        If the structure is not regular.
    """
    picture.check_regular()
    u, v = picture.ei_pixels
    for row, col in np.ndindex(v, u):
        below, right = (v - 1 - row, u - 1 - col) if picture.erect else (row, col)
        yield row, col, picture.pixels[below::v, right::u]
