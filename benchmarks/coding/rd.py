"""Rate–distortion points: a picture coded and decoded once, with its rate, quality and CPU time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np

from codec import encode, timed_decode
from ii_core import IIPicture
from metrics import q_global

Point = TypeVar("Point", bound=Mapping[str, Any])


class RDPoint(NamedTuple):
    """One operating point of a scheme on a picture; times are CPU seconds of a single encoder or decoder run."""

    bpp: float
    q_global: float  # dB
    reached: bool | None  # whether the target rate was met, as in `codec.encode`
    runs: int  # encoder runs until the target rate was met
    encode_seconds: float | None  # with rearrangement and colour conversion
    encoder_seconds: float | None  # inside the encoder alone
    decode_seconds: float
    decoder_seconds: float | None
    picture: IIPicture  # decoded


def rd_point(picture: IIPicture, scheme: str, **goal: Any) -> RDPoint:
    """Code a picture, decode it and measure Q_global.

    Parameters
    ----------
    picture : IIPicture
    scheme : str
        Scheme with options: ``si-h264:rate=cq``.
    goal
        One of ``bpp``, ``qp`` and ``quality``, as `codec.encode` takes them.
    """
    coded = encode(picture, scheme, **goal)
    decoded = timed_decode(coded)
    quality = q_global(picture, decoded.picture)
    return RDPoint(
        coded.bpp, quality, coded.reached, coded.runs, encode_seconds=coded.encode_seconds,
        encoder_seconds=coded.codec_seconds, decode_seconds=decoded.seconds,
        decoder_seconds=decoded.codec_seconds, picture=decoded.picture,
    )  # fmt: skip


def compiled(scheme: str, **goal: Any) -> None:
    """Code a small picture, so that times measured next hold no compilation."""
    pixels = np.random.default_rng(0).integers(0, 256, (32, 64, 3), np.uint8)
    timed_decode(encode(IIPicture(pixels, (16, 8), (4, 4)), scheme, **goal))


def climbing(points: Sequence[Point]) -> list[Point]:
    """Return points by rate, without points whose additional bits do not raise PSNR (4:2:0 limits it)."""
    kept: list[Point] = []
    for point in sorted(points, key=lambda p: p["bpp"]):
        if not kept or (point["psnr"] > kept[-1]["psnr"] + 1e-3 and point["bpp"] > kept[-1]["bpp"]):
            kept.append(point)
    return kept
