"""Films of views: MP4, GIF and WebP."""

from __future__ import annotations

import os
from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ..base.files import atomic_path

ANIMATIONS = (".mp4", ".gif", ".webp")
QUALITY_CRF = 18  # x264's constant rate factor: no visible loss


def write_animation(path: str | os.PathLike[str], frames: Iterable[NDArray[np.uint8]], *, fps: float = 25) -> Path:
    """Write frames as a film (H.264 in MP4) or as an endless animation (GIF, WebP).

    Parameters
    ----------
    path : path
        With the suffix .mp4, .gif or .webp; replaced whole.
    frames : iterable of ndarray of uint8, (height, width, 3)
        sRGB, all of one size. MP4 drops the last row or column of odd sides, since its colours are 4:2:0.
    fps : float
        Frames per second, 1 to 240; in MP4, the nearest fraction of at most 1001.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ValueError
        If the suffix is unknown, ``fps`` is not from 1 to 240, or there is no frame.
    OSError
        If the file cannot be written.
    """
    kind = Path(path).suffix.lower()
    if kind not in ANIMATIONS:
        raise ValueError(f"{path} is no known film type: known are {', '.join(ANIMATIONS)}")
    if not 1 <= fps <= 240:
        raise ValueError(f"fps is {fps}: a number from 1 to 240 is needed")
    with atomic_path(path) as temporary:
        count = _film(temporary, frames, fps) if kind == ".mp4" else _picture(temporary, frames, fps, kind)
        if not count:
            raise ValueError("there are no frames: at least one is needed")
    return Path(path)


def _film(path: Path, frames: Iterable[NDArray[np.uint8]], fps: float) -> int:
    count, stream = 0, None
    with av.open(str(path), "w", format="mp4") as file:
        for frame in frames:
            height, width = (n - n % 2 for n in frame.shape[:2])
            if stream is None:
                stream = _stream(file, width, height, fps)
            picture = av.VideoFrame.from_ndarray(np.ascontiguousarray(frame[:height, :width]), "rgb24")
            file.mux(stream.encode(picture))
            count += 1
        if stream is not None:
            file.mux(stream.encode(None))
    return count


def _stream(file: Any, width: int, height: int, fps: float) -> Any:
    if min(width, height) < 2:
        raise ValueError(f"frames have {width}×{height} pixels: MP4 needs at least 2×2")
    stream: Any = file.add_stream("libx264", rate=Fraction(fps).limit_denominator(1001))
    stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
    stream.options = {"crf": str(QUALITY_CRF)}
    return stream


def _picture(path: Path, frames: Iterable[NDArray[np.uint8]], fps: float, kind: str) -> int:
    images = [Image.fromarray(frame) for frame in frames]
    if not images:
        return 0
    options: dict[str, Any] = {"quality": 90} if kind == ".webp" else {"optimize": False}
    duration = round(1000 / fps)
    images[0].save(
        path, kind[1:].upper(), save_all=True, append_images=images[1:], duration=duration, loop=0, **options
    )
    return len(images)
