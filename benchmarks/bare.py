"""What the encoder library alone needs: the same parameters, on frames that lie ready."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import av
import numpy as np

from codec import parse_scheme
from codec.sequence import gathered
from codec.video import H264, _encoder, _parameters
from ii_core import IIPicture


def bare_encoder(picture: IIPicture, scheme: str, qp: int) -> Callable[[], int]:
    """A call that encodes ready frames with PyAV and returns the bytes it made."""
    coder, options = parse_scheme(scheme)
    assert isinstance(coder, H264)
    shape = coder._layout(picture)
    frames: list[Any] = []
    planes = shape.batch(_frame(shape).planes[0].line_size)
    for count in gathered(np.ascontiguousarray(picture.pixels), shape, str(options["order"]), planes):
        for rows in planes[:count].reshape(count, 3, -1):
            frame = _frame(shape)
            frame.pts = len(frames)
            for plane, values in zip(frame.planes, rows, strict=True):
                np.frombuffer(plane, np.uint8)[:] = values
            frames.append(frame)

    def encode() -> int:
        context = _encoder(shape, _parameters(options, f"qp={qp}"), 25)
        return sum(packet.size for frame in [*frames, None] for packet in context.encode(frame))

    return encode


def _frame(shape: Any) -> Any:
    frame: Any = av.VideoFrame(shape.width, shape.height, "yuv444p")
    frame.color_range = av.video.reformatter.ColorRange.JPEG
    return frame
