"""II-video for screens: quilt videos, a film of each view, films along a path of viewpoints."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.files import one_line
from ..camera.camera import Pair
from ..formats.grid import camera_views
from ..formats.quilt import QUILT, aspect_of, quilt_name
from ..picture.assumed import with_assumed_camera
from ..picture.picture import IIPicture, codes8
from ..video.video import IIVideo
from .film import write_animation
from .look import focused_view
from .quilt import quilt

Progress = Callable[[int, int], None] | None


def write_quilt_video(
    video: IIVideo,
    path: str | os.PathLike[str],
    tiles: Pair,
    *,
    size: Pair,
    aspect: float | None = None,
    whole: bool = False,
    depth_mm: float | None = None,
    cone: float = 1.0,
    progress: Progress = None,
) -> Path:
    """Write an MP4 of quilts, ``name_qsCxRaA.mp4``: a `quilt` of every frame, with the same parameters.

    Raises
    ------
    ValueError
        If a parameter is out of range, or the path is no MP4.
    OSError
        If it cannot be written.
    """
    target = quilt_name(path, tiles, size[0] / size[1] if aspect is None else aspect)
    if target.suffix.lower() != ".mp4":
        raise ValueError(f"{target} is no .mp4: a quilt video is one")
    options: dict[str, Any] = {"size": size, "aspect": aspect, "whole": whole, "depth_mm": depth_mm, "cone": cone}
    quilts = (quilt(with_assumed_camera(eight_bit(picture)), tiles, **options) for picture in video)
    return write_animation(target, _told(quilts, video.frames, progress), fps=video.fps)


def write_view_films(video: IIVideo, folder: str | os.PathLike[str], *, progress: Progress = None) -> list[Path]:
    """Write a film of each view, ``view_ROW_COLUMN.mp4``, row by row from the top left camera.

    Every frame is read once per row of views; memory holds at most one row of films, 8 bit.

    Raises
    ------
    OSError
        If a film cannot be written.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    u, v = video.structure.ei_pixels
    made = []
    for row in range(v):
        films: list[list[NDArray[np.uint8]]] = [[] for _ in range(u)]
        for picture in video:
            for at, col, view in camera_views(eight_bit(picture)):
                if at == row:
                    films[col].append(np.ascontiguousarray(view))
        for col, film in enumerate(films):
            made.append(write_animation(folder / f"view_{row:02}_{col:02}.mp4", film, fps=video.fps))
            if progress:
                progress(len(made), u * v)
    return made


def write_path_film(
    video: IIVideo,
    path: str | os.PathLike[str],
    viewpoints_mm: Sequence[ArrayLike] | NDArray[np.float64],
    *,
    size: Pair | None = None,
    depth_mm: float | None = None,
    progress: Progress = None,
) -> Path:
    """Write a film in which scene and viewer move: frame τ from viewpoint τ, with viewpoints repeated in a loop.

    Parameters
    ----------
    viewpoints_mm : (n, 3)
        Camera coordinates, as of `viewpoints_around`.
    size, depth_mm
        As for `focused_view`.

    Raises
    ------
    ValueError
        If there is no viewpoint, or the file type is unknown.
    OSError
        If it cannot be written.
    """
    if not len(viewpoints_mm):
        raise ValueError("there are no viewpoints: at least one is needed")
    places = [viewpoints_mm[frame % len(viewpoints_mm)] for frame in range(video.frames)]
    views = (
        focused_view(with_assumed_camera(picture), place, size=size, depth_mm=depth_mm)
        for picture, place in zip(video, places, strict=True)
    )
    return write_animation(path, _told(views, video.frames, progress), fps=video.fps)


def open_quilt_video(path: str | os.PathLike[str], *, grid: Pair | None = None) -> IIVideo:
    """Open a quilt video as II-video: a lens for each pixel of a tile, and the views as one row of pixels under it.

    The camera is assumed, with the aspect of the name; without one there is none.

    Frames are decoded in order; reading a frame before the latest one restarts at the first.

    Parameters
    ----------
    grid : (columns, rows), optional
        Grid of tiles, if the name does not contain ``_qsCxRaA``.

    Raises
    ------
    ValueError
        If the grid is unknown or does not fit, or the file is no video.
    OSError
        If it cannot be read.
    """
    path = Path(path)
    match = QUILT.search(path.stem)
    if match is None and grid is None:
        raise ValueError(f"{path.name} has no _qsCxRaA in its name: the grid of tiles is needed")
    tiles = grid or (int(match[1]), int(match[2]))  # type: ignore[index]
    source = _QuiltFilm(path, tiles)
    try:
        with av.open(str(path)) as file:
            stream: Any = file.streams.video[0]
            rate, count = float(stream.average_rate or 24), int(stream.frames)
        first = source.picture(0)
    except (av.FFmpegError, IndexError) as error:
        raise ValueError(f"{path} cannot be read as a video: {one_line(error)}") from None
    return IIVideo(count or sum(1 for _ in source.all()), rate, source, first)


@dataclass
class _QuiltFilm:
    """Frames of a quilt video."""

    path: Path
    tiles: Pair
    _next: tuple[int, Iterator[Any]] | None = field(default=None, repr=False)

    def picture(self, frame: int) -> IIPicture:
        """Decode up to a frame."""
        if self._next is None or self._next[0] > frame:
            self._next = 0, self.all()
        at, frames = self._next
        for pixels in frames:
            at += 1
            self._next = at, frames
            if at > frame:
                return self._of(pixels)
        raise ValueError(f"{self.path} ends before frame {frame}")

    def all(self) -> Iterator[Any]:
        """Yield every frame, RGB, in order."""
        with av.open(str(self.path)) as file:
            for frame in file.decode(video=0):
                yield frame.to_ndarray(format="rgb24")

    def _of(self, quilt: NDArray[np.uint8]) -> IIPicture:
        (cols, rows), (height, width) = self.tiles, quilt.shape[:2]
        h, w = height // rows, width // cols
        if h < 1 or w < 1:
            raise ValueError(f"{self.path} of {width}×{height} px cannot hold {cols}×{rows} tiles")
        tiles = quilt[: rows * h, : cols * w].reshape(rows, h, cols, w, 3)[::-1]
        views = tiles.transpose(1, 3, 0, 2, 4).reshape(h, w * cols * rows, 3)
        picture, aspect = IIPicture(np.ascontiguousarray(views), (w, h), (cols * rows, 1)), aspect_of(self.path.stem)
        return picture if aspect is None else with_assumed_camera(picture, aspect=aspect)


def eight_bit(picture: IIPicture) -> IIPicture:
    """Return a picture in 8-bit sRGB."""
    return picture.with_pixels(codes8(picture.pixels))


def _told(frames: Iterator[Any], count: int, progress: Progress) -> Iterator[Any]:
    for done, frame in enumerate(frames, 1):
        yield frame
        if progress:
            progress(done, count)
