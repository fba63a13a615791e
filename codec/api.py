"""Coded pictures: making one, keeping it in a file, decoding it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ii_core import IIPicture
from ii_core.camera import whole_pair

from . import container
from .coders.clock import cpu_seconds
from .contract import MAX_PIXELS, Value, check_picture, checked_goal, checked_options, find, parse_scheme
from .rate import within


@dataclass(frozen=True, eq=False, kw_only=True)
class Encoded:
    """A coded II-picture.

    Parameters
    ----------
    scheme : str
        Name of the coder.
    options : mapping
        Every option of the scheme.
    payload : bytes
        What the scheme's decoder reads: stream headers included; structure, camera and options are not, and neither
        are messages of the encoder to the reader that no decoder needs.
    structure : mapping
        `IIPicture.structure_json` of the picture.
    dtype : str
        Pixel type of the picture.
    target_bpp : float or None
        The rate asked for, if one was.
    qp : int or None
        The quantiser asked for, if one was.
    quality : float or None
        The quality asked for, if one was.
    reached : bool
        False if the rate misses ``target_bpp`` by more than 2 %: it lies beyond what the coder can do here, and this
        is the nearest.
    runs : int
        How many times the encoder ran to meet the rate.
    encode_seconds : float or None
        CPU time of all of `encode`, rearrangement and every run: that of the calling thread and of an encoder's own
        threads. None if read from a file.
    codec_seconds : float or None
        The part of it inside the encoder, for the run that was kept alone: the coder's own time (5.16).
    versions : mapping
        Libraries that did the work.
    """

    scheme: str
    options: Mapping[str, Value]
    payload: bytes = field(repr=False)
    structure: Mapping[str, Any]
    dtype: str = "uint8"
    target_bpp: float | None = None
    qp: int | None = None
    quality: float | None = None
    reached: bool = True
    runs: int = 1
    encode_seconds: float | None = None
    codec_seconds: float | None = None
    versions: Mapping[str, str]

    @property
    def nbytes(self) -> int:
        """Size of the payload in bytes."""
        return len(self.payload)

    @property
    def size(self) -> tuple[int, int]:
        """(M, N) of the picture."""
        (k, l), (u, v) = self.structure["lenses"], self.structure["ei_pixels"]
        return k * u, l * v

    @property
    def bpp(self) -> float:
        """Bits of payload per pixel of the picture, 8·nbytes/(M·N) (5.8)."""
        width, height = self.size
        return 8 * self.nbytes / (width * height)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write an ``.ii`` file that `decode` reads, whole or not at all.

        Raises
        ------
        OSError
            If it cannot be written.
        """
        header = {name: getattr(self, name) for name in _HEADER}
        container.write(
            path, {key: dict(v) if isinstance(v, Mapping) else v for key, v in header.items()}, self.payload
        )

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Encoded:
        """Read an ``.ii`` file without decoding it.

        Raises
        ------
        ValueError
            If the file is foreign, truncated or damaged.
        OSError
            If it cannot be read.
        """
        header, payload = container.read(path)
        try:
            return _from_header(header, payload)
        except (ValueError, TypeError, OverflowError) as error:
            raise ValueError(f"{os.fspath(path)} is damaged: {error}") from None


_HEADER = ("scheme", "options", "structure", "dtype", "target_bpp", "qp", "quality", "reached", "runs", "versions")
# What the first files did not say.
_LATER = {"dtype": "uint8", "quality": None}


def _from_header(header: dict[str, Any], payload: bytes) -> Encoded:
    header = {**_LATER, **header}
    if set(header) != set(_HEADER):
        raise ValueError(f"its header has {', '.join(sorted(header)) or 'nothing'}: needed are {', '.join(_HEADER)}")
    if not isinstance(header["scheme"], str) or not isinstance(header["options"], dict):
        raise ValueError("its header names no scheme with options")
    coder = find(header["scheme"])
    options = checked_options(coder, header["options"])
    if header["dtype"] not in coder.dtypes:
        raise ValueError(f"its pixels are {header['dtype']!r}: scheme {coder.name} takes {', '.join(coder.dtypes)}")
    structure = blank_picture(header["structure"], header["dtype"]).structure_json()
    return Encoded(**{**header, "options": options, "structure": structure}, payload=payload)


def encode(
    picture: IIPicture,
    scheme: str,
    *,
    bpp: float | None = None,
    qp: int | None = None,
    quality: float | None = None,
) -> Encoded:
    """Code an II-picture at a rate, a quantiser or a quality, or to the bit with a lossless scheme.

    Parameters
    ----------
    picture : IIPicture
        Of a pixel type the scheme takes.
    scheme : str
        ``name`` or ``name:preset,option=value,…``; see `schemes` and `options`.
    bpp : float
        Bits per pixel of the II-picture; `Encoded.reached` tells whether it was met within 2 %.
    qp : int
        Quantiser, in the scheme's range and on its scale.
    quality : float
        Quality, in the scheme's range and on its scale. Exactly one of the three is needed, none of them with what
        codes lossless.

    Raises
    ------
    ValueError
        If an argument is unknown or out of range, or the scheme cannot take the picture; before any long work.
    """
    started = cpu_seconds()
    coder, options = parse_scheme(scheme)
    goal = checked_goal(coder, options, bpp, qp, quality)
    check_picture(coder, options, picture)
    coding = coder.encode(picture, options, goal)
    width, height = picture.size
    size = len(coding.run.payload)
    return Encoded(
        scheme=coder.name,
        options=options,
        payload=coding.run.payload,
        structure=picture.structure_json(),
        dtype=picture.pixels.dtype.name,
        target_bpp=goal.bpp,
        qp=goal.qp,
        quality=goal.quality,
        reached=goal.bpp is None or within(size, goal.bpp * width * height / 8),
        runs=coding.runs,
        encode_seconds=cpu_seconds() - started,
        codec_seconds=coding.run.codec_seconds,
        versions=coder.versions,
    )


@dataclass(frozen=True, kw_only=True)
class Decoding:
    """A decoded picture and what it cost, in seconds of CPU time.

    ``seconds`` is all of it, ``codec_seconds`` the part inside the decoder (5.16); the rest is rearrangement.
    """

    picture: IIPicture
    seconds: float
    codec_seconds: float


def decode(coded: Encoded | str | os.PathLike[str]) -> IIPicture:
    """The picture of a coded one, or of an ``.ii`` file, with its structure and camera.

    Raises
    ------
    ValueError
        If the bytes are not a whole coded picture.
    OSError
        If the file cannot be read.
    """
    return timed_decode(coded).picture


def timed_decode(coded: Encoded | str | os.PathLike[str]) -> Decoding:
    """`decode`, with its cost."""
    started = cpu_seconds()
    path = None
    if not isinstance(coded, Encoded):
        path, coded = os.fspath(coded), Encoded.load(coded)
    coder = find(coded.scheme)
    blank = blank_picture(coded.structure, coded.dtype)
    try:
        pixels, codec_seconds = coder.decode(coded.payload, blank, coded.options)
    except ValueError as error:
        raise ValueError(f"{path or 'the coded picture'} is damaged: {error}") from None
    picture = blank.with_pixels(pixels)
    return Decoding(picture=picture, seconds=cpu_seconds() - started, codec_seconds=codec_seconds)


def blank_picture(structure: Any, dtype: str) -> IIPicture:
    """A picture of that structure whose pixels take no memory, all zero and read-only."""
    lenses, ei_pixels = (
        structure.get(key) if isinstance(structure, Mapping) else None for key in ("lenses", "ei_pixels")
    )
    (k, l), (u, v) = whole_pair("lenses", lenses), whole_pair("ei_pixels", ei_pixels)
    if k * u * l * v > MAX_PIXELS:
        raise ValueError(f"a picture of {k * u}×{l * v} pixels is claimed: at most {MAX_PIXELS} are allowed")
    return IIPicture.from_structure_json(np.broadcast_to(np.zeros((), dtype), (l * v, k * u, 3)), dict(structure))
