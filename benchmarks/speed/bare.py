"""CPU time of the encoder library alone: same parameters, frames prepared beforehand."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from codec import parse_scheme
from codec.coders.video import Video, new_frame, open_encoder
from ii_core import IIPicture


def bare_encoder(picture: IIPicture, scheme: str, qp: int) -> Callable[[], int]:
    """Return a function that encodes prepared frames with PyAV."""
    coder, options = parse_scheme(scheme)
    assert isinstance(coder, Video)
    film = coder.film(picture, options)
    settings = coder.constant(qp, film, options)
    context = open_encoder(coder, film, settings)
    frames: list[Any] = []
    size = np.dtype(film.format.dtype).itemsize
    planes = film.batch([plane.line_size // size for plane in new_frame(film, context).planes])
    for count in film.gathered(np.ascontiguousarray(picture.pixels), planes):
        for index in range(count):
            frame = new_frame(film, context)
            frame.pts = len(frames)
            for target, values in zip(frame.planes, planes, strict=True):
                np.frombuffer(target, film.format.dtype)[:] = values[index].ravel()
            frames.append(frame)

    def encode() -> int:
        context = open_encoder(coder, film, settings)
        return sum(packet.size for frame in [*frames, None] for packet in context.encode(frame))

    return encode
