"""Encoder and decoder of an anchor: views as frames of 10-bit YCbCr, through FFmpeg of the package imageio-ffmpeg.

Codes are those of the common test conditions. What the decoder returns is compared in these codes, without a detour
over 8-bit RGB. The file is the bare stream; the decoder knows the structure.
"""

from __future__ import annotations

import hashlib
import math
import os
import subprocess
import tempfile
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ii_core import IIPicture
from ii_core.base.colour import of_video_codes
from ii_core.base.extras import load
from ii_core.base.files import one_line
from ii_core.formats.views import camera_views

from ..measures.ctc import codes
from .anchors import ANCHORS, Anchor, level_of
from .subject import Decoded, Subject

QUIET = ("-hide_banner", "-loglevel", "error", "-nostdin", "-y")
LEAST_SIDE = 64  # of a frame: VVenC's smallest, and two blocks of the others
CORRECTIONS = 6  # of reduced chroma; further ones change it by less than a code
MOST = 1023
STEPS_OF_LEVEL = 1  # quantiser steps from a level of the hierarchy to the next finer one


@cache
def program() -> str:
    """Return the path of FFmpeg; `ii_core.base.extras.NotInstalled` if its package is missing."""
    return str(load("imageio_ffmpeg").get_ffmpeg_exe())


def versions() -> dict[str, str]:
    """Return the versions of imageio-ffmpeg and of its FFmpeg."""
    said = subprocess.run([program(), "-version"], stdout=subprocess.PIPE, check=True).stdout.decode()
    return {"imageio-ffmpeg": str(load("imageio_ffmpeg").__version__), "ffmpeg": said.split()[2]}


@dataclass(frozen=True)
class Stream:
    """Coded file of an anchor; ``like`` is what was coded."""

    data: bytes
    bpp: float
    encode_seconds: float
    reached: bool
    like: IIPicture

    @property
    def nbytes(self) -> int:
        """Size of the file."""
        return len(self.data)


@dataclass
class AnchorCoder:
    """Encoder and decoder of an anchor for `metrics.rate_distortion`; runs of one picture are kept for all its rates.

    Parameters
    ----------
    name : str
        One of `ANCHORS`.
    rate_tolerance : float
        Share by which a file may exceed its target to meet it.
    """

    name: str
    rate_tolerance: float = 0.02
    _runs: dict[tuple[str, int], tuple[bytes, float]] = field(default_factory=dict, repr=False)
    _lock: Any = field(default_factory=threading.Lock, repr=False)

    def __post_init__(self) -> None:
        if self.name not in ANCHORS:
            raise ValueError(f"unknown anchor {self.name!r}: known are {', '.join(ANCHORS)}")
        program()

    def __getstate__(self) -> dict[str, Any]:
        return {"name": self.name, "rate_tolerance": self.rate_tolerance, "_runs": {}}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, _lock=threading.Lock())

    @property
    def anchor(self) -> Anchor:
        """Settings."""
        return ANCHORS[self.name]

    def encode(self, subject: Subject, scheme: str, *, bpp: float) -> Stream:
        """Return the largest file of at most the target and its tolerance, or the coarsest.

        Raises
        ------
        ValueError
            If the subject is a video or a picture of floats, or FFmpeg fails.
        """
        key = _hash(picture := _picture(self.name, subject))
        count = math.prod(picture.size)
        limit = bpp * count / 8 * (1 + self.rate_tolerance)
        spent = 0.0

        def size(index: int) -> int:
            nonlocal spent
            data, seconds = self._run(key, picture, index)
            spent += seconds
            return len(data)

        anchor = self.anchor
        found = largest(size, limit, round((anchor.coarsest - anchor.finest) / anchor.step))
        data, _ = self._run(key, picture, found)
        return Stream(data, 8 * len(data) / count, spent, len(data) <= limit, picture)

    def encode_at(self, subject: Subject, quantiser: float) -> Stream:
        """Return the file of the step of the anchor's scale that is nearest to a quantiser; errors as of `encode`."""
        picture, anchor = _picture(self.name, subject), self.anchor
        data, seconds = self._run(_hash(picture), picture, round((anchor.coarsest - quantiser) / anchor.step))
        return Stream(data, 8 * len(data) / math.prod(picture.size), seconds, True, picture)

    def decode(self, coded: Stream) -> Decoded:
        """Return the picture, and its 10-bit YCbCr codes if those were coded."""
        anchor, like = self.anchor, coded.like
        source = [] if anchor.mosaic else ["-f", anchor.muxer]
        target = ["-f", "rawvideo", "-pix_fmt", anchor.pixels, "-"]
        raw, seconds = _answer([program(), *QUIET, *source, "-i", "-", *target], coded.data)
        return _decoded(anchor, like, raw, seconds)

    def _run(self, key: str, picture: IIPicture, index: int) -> tuple[bytes, float]:
        """Return stream and CPU seconds at a quantiser."""
        with self._lock:
            known = self._runs.get((key, index))
        if known is None:
            q = self.anchor.quantiser(index)
            zones = _zones(self.anchor, picture, q)
            command = [program(), *QUIET, *self.anchor.command(_frame_size(self.anchor, picture), q, zones)]
            known = _answer(command, _frames(self.anchor, picture))
            with self._lock:
                self._runs[key, index] = known
        return known


def _picture(name: str, subject: Subject) -> IIPicture:
    if not isinstance(subject, IIPicture) or subject.pixels.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"anchor {name} codes pictures of 8 or 16 bit")
    return subject


def _peak(pixels: NDArray[Any]) -> int:
    return int(np.iinfo(pixels.dtype).max)


def _hash(picture: IIPicture) -> str:
    return hashlib.sha256(np.ascontiguousarray(picture.pixels).data).hexdigest()


def largest(size: Callable[[int], int], limit: float, finest: int) -> int:
    """Return the greatest index from 0 to ``finest`` whose size is within a limit; 0 if none is.

    Sizes grow with the index. Trials follow the logarithm of sizes between the two nearest known ones.
    """
    low, high = 0, finest
    sizes: dict[int, float] = {}

    def fits(index: int) -> bool:
        sizes[index] = math.log(max(size(index), 1))
        return sizes[index] <= math.log(limit)

    trial = finest // 2
    if fits(trial):
        low = trial
    else:
        high = trial - 1
    while low < high:
        below, above = (
            max((i for i in sizes if i <= low), default=None),
            min((i for i in sizes if i > high), default=None),
        )
        if below is not None and above is not None and sizes[above] > sizes[below]:
            share = (math.log(limit) - sizes[below]) / (sizes[above] - sizes[below])
            trial = below + int(share * (above - below))
        else:  # one step of the quantiser changes the rate by about an eighth of an octave of six
            known = next(iter(sizes)) if len(sizes) == 1 else (below if below is not None else above)
            assert known is not None
            slope = (sizes[max(sizes)] - sizes[min(sizes)]) / (max(sizes) - min(sizes)) if len(sizes) > 1 else 0.0
            step = (math.log(limit) - sizes[known]) / (slope if slope > 0 else math.log(2) / max(6, finest // 10))
            trial = known + int(step)
        trial = min(max(trial, low + 1), high)
        if fits(trial):
            low = trial
        else:
            high = trial - 1
    if low not in sizes:
        fits(low)
    return low


def _answer(command: list[str], data: bytes) -> tuple[bytes, float]:
    """Return the output of a command and its CPU seconds."""
    with tempfile.TemporaryFile() as source, tempfile.TemporaryFile() as target, tempfile.TemporaryFile() as said:
        source.write(data)
        source.seek(0)
        process = subprocess.Popen(command, stdin=source, stdout=target, stderr=said)
        try:
            _, status, usage = os.wait4(process.pid, 0)
        except BaseException:
            process.kill()
            process.wait()
            raise
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            said.seek(0)
            raise ValueError(f"FFmpeg ended with code {process.returncode}: {one_line(said.read()[-300:].decode())}")
        target.seek(0)
        return target.read(), usage.ru_utime + usage.ru_stime


def _zones(anchor: Anchor, picture: IIPicture, quantiser: float) -> str:
    """Return x265's zones of a hierarchical order: each level is coded coarser than the one before."""
    if "{zones}" not in anchor.encoder:
        return ""
    columns, rows = picture.ei_pixels
    levels = [level_of(place, rows, columns) for place in anchor.order(rows, columns)]
    zones = []
    for level in dict.fromkeys(levels):
        first, last = levels.index(level), len(levels) - 1 - levels[::-1].index(level)
        zones.append(f"{first},{last},q={min(51, round(quantiser) + level * STEPS_OF_LEVEL)}")
    return ":zones=" + "/".join(zones)


def _view_size(anchor: Anchor, picture: IIPicture) -> tuple[int, int]:
    """Return width and height of a view as coded: even, and not too small for any coder; a mosaic's are its own."""
    width, height = picture.lenses
    return (
        (width, height)
        if anchor.mosaic
        else (max(LEAST_SIDE, width + width % 2), max(LEAST_SIDE, height + height % 2))
    )


def _frame_size(anchor: Anchor, picture: IIPicture) -> tuple[int, int]:
    """Return width and height of a frame."""
    (width, height), (columns, rows) = _view_size(anchor, picture), picture.ei_pixels
    return (width * columns, height * rows) if anchor.mosaic else (width, height)


def _frames(anchor: Anchor, picture: IIPicture) -> bytes:
    """Return the samples of all frames."""
    views = {(row, column): view for row, column, view in camera_views(picture)}
    columns, rows = picture.ei_pixels
    if anchor.mosaic:
        tiled = np.block([[[views[row, column]] for column in range(columns)] for row in range(rows)])
        return (tiled.astype("<u2") * (65535 // _peak(tiled))).tobytes()
    size = _view_size(anchor, picture)
    return b"".join(_frame(anchor, views[place], size) for place in anchor.order(rows, columns))


def _frame(anchor: Anchor, view: NDArray[Any], size: tuple[int, int]) -> bytes:
    """Return the samples of a view; its border is repeated up to the size."""
    margin = (0, size[1] - view.shape[0]), (0, size[0] - view.shape[1])
    planes = [np.pad(plane, margin, mode="edge") for plane in np.moveaxis(codes(view / _peak(view)), 2, 0)]
    if "420" in anchor.pixels:
        planes[1:] = map(reduced, planes[1:])
    return b"".join(np.clip(np.rint(plane), 0, MOST).astype("<u2").tobytes() for plane in planes)


def _decoded(anchor: Anchor, like: IIPicture, raw: bytes, seconds: float) -> Decoded:
    """Return the picture of all frames."""
    (columns, rows), (width, height), peak = like.ei_pixels, _view_size(anchor, like), _peak(like.pixels)
    out = like.with_pixels(np.empty(like.pixels.shape, np.uint16))
    places = {(row, column): view for row, column, view in camera_views(out)}  # views of `out`, in place
    samples = np.frombuffer(raw, "<u2")
    if anchor.mosaic:
        tiles = samples.reshape(rows, height, columns, width, 3)
        for (row, column), view in places.items():
            unit = np.uint32(65535 // peak)
            view[...] = (tiles[row, :, column] + unit // 2) // unit
        return Decoded(like.with_pixels(out.pixels.astype(like.pixels.dtype)), seconds)
    frames = samples.reshape(rows * columns, -1)
    for place, frame in zip(anchor.order(rows, columns), frames, strict=True):
        places[place][...] = _planes(frame, (width, height))[: like.lenses[1], : like.lenses[0]]
    pixels = np.empty_like(like.pixels)
    for before, after in zip(out.pixels, pixels, strict=True):  # row by row, to save memory
        after[...] = np.rint(np.clip(peak * of_video_codes(before), 0, peak))
    return Decoded(like.with_pixels(pixels), seconds, out.pixels)


def _planes(frame: NDArray[Any], size: tuple[int, int]) -> NDArray[Any]:
    """Return Y, Cb and Cr of a frame, (height, width, 3), at full size."""
    width, height = size
    luma, *chroma = np.split(frame, [width * height, width * height + (len(frame) - width * height) // 2])
    half = len(chroma[0]) < len(luma)
    planes = [luma.reshape(height, width)]
    planes += [
        resized(plane.reshape(height // 2, width // 2), size) if half else plane.reshape(height, width)
        for plane in chroma
    ]
    return np.stack([np.clip(np.rint(plane), 0, MOST) for plane in planes], axis=-1)


def reduced(plane: NDArray[Any]) -> NDArray[Any]:
    """Return a plane of half the sides whose enlargement is near to it."""
    whole = plane.shape[1], plane.shape[0]
    half = whole[0] // 2, whole[1] // 2
    small = resized(plane, half)
    for _ in range(CORRECTIONS):
        small = small + resized(plane - resized(small, whole), half)
    return small


def resized(plane: NDArray[Any], size: tuple[int, int]) -> NDArray[Any]:
    """Return a plane of another size (width, height) by a Lanczos filter."""
    return np.asarray(Image.fromarray(plane.astype(np.float32)).resize(size, Image.Resampling.LANCZOS))
