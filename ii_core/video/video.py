"""II-video: II-pictures of one camera over time, read frame by frame."""

from __future__ import annotations

import itertools
import os
import re
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import checks
from ..base.files import one_line, read_json, write_json
from ..camera.camera import IICamera, Pair
from ..formats.find import find_views, picture_of
from ..formats.views import STRUCTURE, write_views
from ..picture.component import KINDS, component_images
from ..picture.picture import IIPicture
from ..picture.view import view_image

KEPT = 3  # frames in memory at most
FORMAT, VERSION, INDEX, TAKE, TAKE_INDEX = "ii-video", 1, "video.json", "ii-take", "manifest.json"
FRAME = re.compile(r"frame_(\d+)(\.(?:png|tif|tiff|exr))?")


class FrameSource(Protocol):
    """Source of the frames of an II-video."""

    def picture(self, frame: int) -> IIPicture:
        """Return one frame."""


@dataclass(eq=False)
class IIVideo:
    """Frames of one structure and one camera model at a constant rate, read when they are used.

    At most `KEPT` frames are kept in memory.

    Parameters
    ----------
    frames : int
        Number T of frames.
    fps : float
        Frames a second.
    source : FrameSource
        Reads a frame; if it has ``component(frame, kind, place)``, that reads one component image alone.
    structure : IIPicture
        Structure, camera and pixel type of every frame; its pixels are not looked at.
    poses : ndarray, (T, 4, 4), optional
        From the camera's frame to the scene's, frame by frame, where they are known.

    Raises
    ------
    ValueError
        If there is no frame, the rate is not positive, or the poses do not fit.

    See Also
    --------
    open_video : from a folder or a quilt video.
    codec.open_take : from a coded take.
    """

    frames: int
    fps: float
    source: FrameSource
    structure: IIPicture
    poses: NDArray[np.float64] | None = None
    _kept: OrderedDict[int, IIPicture] = field(default_factory=OrderedDict, repr=False)

    def __post_init__(self) -> None:
        if not isinstance(self.frames, int) or self.frames < 1:
            raise ValueError(f"frames is {self.frames!r}: at least 1 is needed")
        if not 0 < checks.number("fps", self.fps) < float("inf"):
            raise ValueError(f"fps is {self.fps!r}: a finite number above 0 is needed")
        checks.instance(IIPicture)("structure", self.structure)
        if not callable(getattr(self.source, "picture", None)):
            raise checks.refuse("source", self.source, "an object with picture(frame)")
        if self.poses is not None:
            checks.numbers("poses", self.poses)
        if self.poses is not None and np.shape(self.poses) != (self.frames, 4, 4):
            raise ValueError(f"poses are {np.shape(self.poses)}: {(self.frames, 4, 4)} is needed")

    @property
    def camera(self) -> IICamera | None:
        """Camera model of all frames."""
        return self.structure.camera

    @property
    def size(self) -> Pair:
        """(M, N), pixels of a frame across and down."""
        return self.structure.size

    @property
    def seconds(self) -> float:
        """Length."""
        return self.frames / self.fps

    def __len__(self) -> int:
        return self.frames

    def __iter__(self) -> Iterator[IIPicture]:
        return (self[frame] for frame in range(self.frames))

    def __getitem__(self, frame: int) -> IIPicture:
        """One frame, 0 … T−1.

        Raises
        ------
        TypeError, IndexError
            If the frame is no whole number, or there is none of that number.
        ValueError
            If it is of another structure or type than the first.
        OSError
            If it cannot be read.
        """
        frame = self._checked(frame)
        if frame not in self._kept:
            picture = self.source.picture(frame)
            try:
                self.structure.check_same_structure(picture)
            except ValueError as error:
                raise ValueError(f"frame {frame}: {error}") from None
            self._kept[frame] = picture
            while len(self._kept) > KEPT:
                self._kept.popitem(last=False)
        self._kept.move_to_end(frame)
        return self._kept[frame]

    def component(self, frame: int, kind: str, place: Pair) -> NDArray[Any]:
        """One component image of one frame, (T, S, 3).

        A coded stream decodes only what this image needs, if it codes images of this kind.

        Parameters
        ----------
        frame : int
        kind : {"ei", "si", "ri"}
        place : (int, int)
            (u, v) of a sub-image, (k, l) of an elementary image, (v, l) of a ray-space image.

        Raises
        ------
        TypeError, ValueError, IndexError, OSError
            If there is no such image or frame, or it cannot be read.
        """
        frame = self._checked(frame)
        if not isinstance(kind, str) or kind not in KINDS:
            raise ValueError(f"unknown component image {kind!r}: known are {', '.join(KINDS)}")
        (k, l), (u, v) = self.structure.lenses, self.structure.ei_pixels
        cols, rows = {"ei": (k, l), "si": (u, v), "ri": (v, l)}[kind]
        a, b = checks.indices("place", place)
        if not (0 <= a < cols and 0 <= b < rows):
            raise ValueError(f"component image {tuple(place)}: there are {cols}×{rows}, from (0, 0)")
        alone = getattr(self.source, "component", None)
        if alone is not None and frame not in self._kept:
            pixels = alone(frame, kind, (a, b))
            if pixels is not None:
                return np.asarray(pixels)
        stack = component_images(self[frame], kind)
        return np.asarray(stack[a, b] if kind == "ri" else stack[b, a])

    def view(self, frame: int, viewpoint_mm: ArrayLike, *, interpolation: str = "linear") -> Any:
        """Return the view image of one frame from one point; see `view_image`."""
        return view_image(self[frame], viewpoint_mm, interpolation=interpolation)

    @checks.checked(folder=checks.path, progress=checks.callable_)
    def save(self, folder: str | os.PathLike[str], progress: Callable[[int, int], None] | None = None) -> Path:
        """Write ``frame_0000.png`` … (``.exr`` of floats) with sidecars, and ``video.json``, last.

        Raises
        ------
        OSError
            If a file cannot be written.
        """
        folder = _made(folder)
        suffix = ".exr" if self.structure.pixels.dtype.kind == "f" else ".png"
        for frame, picture in enumerate(self):
            picture.save(folder / f"frame_{frame:04}{suffix}")
            if progress:
                progress(frame + 1, self.frames)
        self.write_index(folder)
        return folder

    @checks.checked(folder=checks.path)
    def write_index(self, folder: str | os.PathLike[str]) -> None:
        """Write ``video.json``: rate, number of frames, poses."""
        poses = None if self.poses is None else np.asarray(self.poses).tolist()
        write_json(
            Path(folder) / INDEX,
            {"format": FORMAT, "version": VERSION, "frames": self.frames, "fps": self.fps, "poses": poses},
        )

    def _checked(self, frame: int) -> int:
        if isinstance(frame, bool) or not isinstance(frame, int | np.integer):
            raise checks.refuse("frame", frame, "a whole number")
        if not 0 <= frame < self.frames:
            raise IndexError(f"frame {checks.shown(frame)}: there are {self.frames}, from 0")
        return int(frame)


@dataclass(frozen=True)
class Pictures:
    """Frames in memory."""

    pictures: Sequence[IIPicture]

    def picture(self, frame: int) -> IIPicture:
        """Return one frame."""
        return self.pictures[frame]


@dataclass(frozen=True)
class FrameFiles:
    """Frames in files, or in folders of views."""

    paths: Sequence[Path]

    def picture(self, frame: int) -> IIPicture:
        """Read one frame."""
        path = self.paths[frame]
        return picture_of(find_views(path))[0] if path.is_dir() else IIPicture.load(path)


@checks.checked(pictures=checks.list_of(IIPicture), fps=checks.number)
def video_of(pictures: Sequence[IIPicture], *, fps: float = 24.0) -> IIVideo:
    """II-video of pictures in memory.

    Raises
    ------
    ValueError
        If there are none, they differ in structure or type, or the rate is not positive.
    """
    pictures = list(pictures)
    if not pictures:
        raise ValueError("there are no pictures: at least one is needed")
    for frame, picture in enumerate(pictures):
        try:
            pictures[0].check_same_structure(picture)
        except ValueError as error:
            raise ValueError(f"frame {frame}: {error}") from None
    return IIVideo(len(pictures), fps, Pictures(pictures), blank(pictures[0]))


def blank(picture: IIPicture) -> IIPicture:
    """The structure of a picture over pixels that take no memory."""
    return picture.with_pixels(np.broadcast_to(np.zeros((), picture.pixels.dtype), picture.pixels.shape))


@checks.checked(source=checks.path, fps=checks.number)
def open_video(source: str | os.PathLike[str], *, fps: float | None = None) -> IIVideo:
    """II-video of a folder: a rendered take, frames ``frame_0000.png`` …, or folders of views ``frame_0000/`` ….

    Parameters
    ----------
    source : path
    fps : float, optional
        In place of the folder's own; 24 where it says none.

    Raises
    ------
    ValueError
        If there are no frames, numbers are missing, an index is damaged, or frames differ in structure.
    OSError
        If a file cannot be read.
    """
    folder = Path(source)
    if not folder.is_dir():
        raise ValueError(f"{folder} is no folder of frames: a folder with frame_0000.png and on is needed")
    found: dict[int, Path] = {}
    for path in folder.iterdir():
        match = FRAME.fullmatch(path.name)
        if match and (match[2] is not None or (path.is_dir() and (path / STRUCTURE).exists())):
            if int(match[1]) in found:
                raise ValueError(f"{path} and {found[int(match[1])].name} are one frame: one of them is needed")
            found[int(match[1])] = path
    if not found:
        raise ValueError(f"{folder} holds no frames: files frame_0000.png and on are needed")
    first, last = min(found), max(found)
    if missing := last - first + 1 - len(found):
        lacking = next(number for number in itertools.count(first) if number not in found)
        raise ValueError(f"{folder} lacks frame {lacking} ({missing} missing of {first}..{last})")
    paths = [found[number] for number in range(first, last + 1)]
    rate, poses = _index(folder, first, len(paths))
    files = FrameFiles(paths)
    return IIVideo(len(paths), rate if fps is None else fps, files, blank(files.picture(0)), poses)


def _index(folder: Path, first: int, count: int) -> tuple[float, NDArray[np.float64] | None]:
    """Rate and poses by the folder's index, or the manifest of its take."""
    for name, kind in ((INDEX, FORMAT), (TAKE_INDEX, TAKE)):
        path = folder / name
        if not os.path.lexists(path):
            continue
        try:
            index = read_json(path)
            if index["format"] != kind:
                continue
            rows = index["poses"] if kind == FORMAT else _take_poses(index["frames"], first, count)
            poses = None if rows is None else np.array(rows, np.float64).reshape(-1, 4, 4)
            if poses is not None and len(poses) != count:
                raise ValueError(f"{len(poses)} poses, {count} frames")
            return float(index["fps"]), poses
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{path} is damaged: {one_line(repr(error))}") from None
    return 24.0, None


def _take_poses(entries: Any, first: int, count: int) -> list[Any] | None:
    """Poses of a take, which may have none of a frame that was killed before its entry."""
    rows = [entries.get(str(first + i), {}).get("pose") for i in range(count)]
    return None if any(row is None for row in rows) else rows


@checks.checked(video=checks.instance(IIVideo), folder=checks.path, progress=checks.callable_)
def write_view_folders(
    video: IIVideo, folder: str | os.PathLike[str], progress: Callable[[int, int], None] | None = None
) -> Path:
    """Every view of every frame: ``frame_0000/view_00_00.png`` …, and ``video.json``, last.

    Raises
    ------
    OSError
        If a file cannot be written.
    """
    folder = _made(folder)
    for frame, picture in enumerate(video):
        write_views(picture, _made(folder / f"frame_{frame:04}"))
        if progress:
            progress(frame + 1, video.frames)
    video.write_index(folder)
    return folder


def _made(folder: str | os.PathLike[str]) -> Path:
    path = Path(folder)
    path.mkdir(parents=True, exist_ok=True)
    return path
