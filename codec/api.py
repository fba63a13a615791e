"""Coding and decoding of II-pictures, and the ``.ii`` file."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ii_core import IIPicture
from ii_core.base import checks
from ii_core.base.files import one_line
from ii_core.base.foreign import ForeignError, foreign_errors
from ii_core.base.progress import reporter
from ii_core.camera.camera import whole_pair

from . import container, file_header
from .checks import check_type, whole
from .clock import cpu_seconds, interruptible
from .contract import (
    MAX_DECODED_PIXELS,
    MAX_PIXELS,
    Coder,
    Goal,
    Options,
    RemovedScheme,
    Value,
    check_picture,
    checked_goal,
    checked_options,
    find,
    fractions,
    given_options,
    is_number,
)
from .progress import Report, reported
from .search import Axis, CodingResult, Run, meet_size, within

Result = TypeVar("Result")
Progress = Callable[[int, int, str], None] | bool | None


def check_coded(coded: Any) -> None:
    """Check the fields that coded pictures and coded takes share; fill in the options that are not given.

    Raises
    ------
    TypeError, ValueError
        If a field is of another type or out of range; the message names it.
    """
    coder = find(coded.scheme)
    check_type("options", coded.options, Mapping, "a dict")
    object.__setattr__(coded, "options", checked_options(coder, coded.options))
    if not isinstance(coded.dtype, str) or coded.dtype not in coder.dtypes:
        raise ValueError(f"dtype is {coded.dtype!r}: scheme {coder.name} takes {', '.join(coder.dtypes)}")
    check_type("structure", coded.structure, Mapping, "a dict")
    try:
        blank_picture(coded.structure, coded.dtype)
    except (TypeError, KeyError) as error:
        raise ValueError(f"structure is no structure of a picture: {one_line(error)}") from None
    for name in ("target_bpp", "qp", "quality", "runs", "encode_seconds", "codec_seconds"):
        value = getattr(coded, name)
        if value is not None:
            checks.within(name, value, 0.0, sys.float_info.max)


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Encoded:
    """A coded II-picture.

    Parameters
    ----------
    scheme : str
        Name of the coder.
    options : mapping
        Every option of the scheme.
    payload : bytes
        Input of the scheme's decoder, stream headers included. Messages of the encoder that no decoder needs are left
        out.
    structure : mapping
        `IIPicture.structure_json` of the picture.
    dtype : str
        Pixel type of the picture.
    target_bpp : float or None
        The target rate, if there was one.
    qp : int or None
        The given quantiser, if there was one.
    quality : float or None
        The given quality, if there was one.
    reached : bool
        False if the rate misses ``target_bpp`` by more than 2 %; it is then the nearest that the coder reaches.
    runs : int
        Number of encoder runs. None if read from a file.
    encode_seconds : float or None
        CPU time of `encode`: rearrangement and all runs, in the calling thread and the encoder's own threads. None if
        read from a file.
    codec_seconds : float or None
        CPU time inside the encoder, for the run that was kept (5.16). None if read from a file.
    versions : mapping
        Versions of the libraries in use. Empty if read from a file.

    Raises
    ------
    TypeError, ValueError
        If a field is of another type or out of range; the message names it.
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
    runs: int | None = None
    encode_seconds: float | None = None
    codec_seconds: float | None = None
    versions: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_coded(self)
        check_type("payload", self.payload, bytes, "bytes")
        check_type("reached", self.reached, (bool, np.bool_), "True or False")
        check_type("versions", self.versions, Mapping, "a dict")

    def __repr__(self) -> str:
        missed = "" if self.reached else f", {self.target_bpp:g} bpp not reached"
        spent = "" if self.encode_seconds is None else f", {self.encode_seconds:.2g} CPU s"
        return f"Encoded({self.scheme}, {self.bpp:.4g} bpp, {self.nbytes} bytes{missed}{spent})"

    @property
    def nbytes(self) -> int:
        """Size in bytes of the ``.ii`` file that `save` writes: payload, header and checksum."""
        return self.overhead + len(self.payload)

    @property
    def overhead(self) -> int:
        """Bytes of the file beyond the payload: structure, camera, scheme, options, lengths and checksum."""
        return container.overhead(file_header.values(self), len(self.payload))

    @property
    def size(self) -> tuple[int, int]:
        """(M, N) of the picture."""
        (k, l), (u, v) = self.structure["lenses"], self.structure["ei_pixels"]
        return k * u, l * v

    @property
    def bpp(self) -> float:
        """Bits of the whole file per pixel of the picture, 8·nbytes/(M·N) (5.8)."""
        width, height = self.size
        return 8 * self.nbytes / (width * height)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write an ``.ii`` file that `decode` reads, whole or not at all, and return its path.

        Raises
        ------
        TypeError
            If ``path`` is no path.
        OSError
            If the file cannot be written.
        """
        checks.path("path", path)
        return container.write(path, file_header.values(self), self.payload)

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
        check_type("path", path, (str, os.PathLike), "a path")
        header, payload = container.read(path)
        try:
            return _from_file(header, payload)
        except RemovedScheme as error:
            raise RemovedScheme(f"{os.fspath(path)}: {error}") from None
        except (ValueError, TypeError, OverflowError) as error:
            raise ValueError(f"{os.fspath(path)} is damaged: {one_line(error)}") from None


def _from_file(header: container.Header, payload: bytes) -> Encoded:
    fields = file_header.fields(header)
    structure = blank_picture(fields["structure"], fields["dtype"]).structure_json()
    coded = Encoded(**fields | {"structure": structure}, payload=payload)
    return coded if "reached" in fields else replace(coded, reached=_reached(coded))


def _reached(coded: Encoded) -> bool:
    width, height = coded.size
    return coded.target_bpp is None or within(coded.nbytes, coded.target_bpp * width * height / 8)


def encode(
    picture: IIPicture,
    scheme: str,
    *,
    bpp: float | None = None,
    qp: int | None = None,
    quality: float | None = None,
    progress: Progress = None,
    **options: Value,
) -> Encoded:
    """Code an II-picture at a rate, a quantiser or a quality, or lossless.

    Exactly one of ``bpp``, ``qp`` and ``quality`` is needed, none of them for lossless coding.

    Parameters
    ----------
    picture : IIPicture
        Of a pixel type that the scheme takes.
    scheme : str
        ``name`` or ``name:preset,option=value,…``; see `schemes` and `options`.
    bpp : float
        Target: bits of the ``.ii`` file per pixel of the II-picture. `Encoded.reached` is whether it was met within
        2 %.
    qp : int
        Quantiser, in the scheme's range and on its scale.
    quality : float
        Quality, in the scheme's range and on its scale.
    progress : callable or bool, optional
        ``progress(done, total, text)`` with the frames or encoder runs done, in any thread; True prints a line.
    **options
        Options of the scheme, as ``gop=32``. ``preset`` names a preset of the scheme, as ``preset="best"``; any other
        value of it is the encoder's own option ``preset``.

    Raises
    ------
    ValueError
        If an argument is unknown or out of range, or the scheme cannot take the picture; before any long work.
    """
    started = cpu_seconds()
    report = _report(progress, "encode")
    coder, given = given_options(scheme, **options)
    settings = checked_options(coder, given)
    goal = checked_goal(coder, settings, bpp, qp, quality)
    if goal.bpp is not None:
        settings = checked_options(coder, {**coder.rated, **given})
    with foreign_errors(f"scheme {coder.name} failed to encode", coder):
        check_picture(coder, settings, picture)
        coded = Encoded(
            scheme=coder.name,
            options=settings,
            payload=b"",
            structure=picture.structure_json(),
            dtype=picture.pixels.dtype.name,
            target_bpp=goal.bpp,
            qp=goal.qp,
            quality=goal.quality,
            versions=coder.versions,
        )
        asked = _payload_goal(goal, coded)
        searched = asked.bpp is not None and not coder.rate_control
        run = partial(_at_rate, coder) if searched else partial(_run, coder)
        result = interruptible(lambda: _reporting(report, lambda: run(picture, settings, asked)))
    coded = replace(coded, payload=result.run.payload, runs=result.runs)
    return replace(
        coded,
        reached=_reached(coded),
        encode_seconds=cpu_seconds() - started,
        codec_seconds=result.run.codec_seconds,
    )


def _report(progress: Progress, title: str) -> Report | None:
    if progress is not None:
        checks.progress("progress", progress)
    return reporter(progress, title)


def _reporting(report: Report | None, call: Callable[[], Result]) -> Result:
    with reported(report):  # in the thread of the call
        return call()


def _run(coder: Coder, picture: IIPicture, options: Options, goal: Goal) -> CodingResult:
    """Return what a coder makes of a picture, if it is a result with bytes."""
    result = coder.encode(picture, options, goal)
    if not isinstance(result, CodingResult) or not isinstance(result.run.payload, bytes):
        raise ForeignError(f"scheme {coder.name} encoded to {_kind(result)}: a CodingResult with bytes is needed")
    return result


def _pixels(coder: Coder, answer: Any, blank: IIPicture) -> tuple[IIPicture, float]:
    """Return the picture and the seconds that a decoder answers, if they are of the picture's shape and type."""
    pixels: Any
    seconds: Any
    pixels, seconds = answer if isinstance(answer, tuple) and len(answer) == 2 else (answer, None)
    wanted = blank.pixels
    if not isinstance(pixels, np.ndarray) or pixels.shape != wanted.shape or pixels.dtype != wanted.dtype:
        raise ForeignError(
            f"scheme {coder.name} decoded to {_kind(pixels)}: pixels {wanted.shape} of {wanted.dtype} are needed"
        )
    if not is_number(seconds):
        raise ForeignError(f"scheme {coder.name} decoded in {_kind(seconds)}: a number of CPU seconds is needed")
    return blank.with_pixels(pixels), float(seconds)


def _kind(value: Any) -> str:
    return f"an array {value.shape} of {value.dtype}" if isinstance(value, np.ndarray) else type(value).__name__


# Doublings of the size over a coder's scale, as a first guess: 51 quantisers of H.264 are 8.5.
SCALE_OCTAVES = 8


def _at_rate(coder: Coder, picture: IIPicture, options: Options, goal: Goal) -> CodingResult:
    """Search the scale of a coder without rate control for the size nearest to a rate."""
    name, bounds = ("qp", coder.qp_range) if coder.qp_range is not None else ("quality", coder.quality_range)
    assert bounds is not None and goal.bpp is not None  # `checked_goal` has seen to it
    low, high = bounds
    whole_numbers = not fractions(bounds)

    def run(setting: float) -> Run:
        value = Goal(qp=int(setting)) if name == "qp" else Goal(quality=int(setting) if whole_numbers else setting)
        return _run(coder, picture, options, value).run

    octave = (high - low) / SCALE_OCTAVES * (-1 if name == "qp" else 1)
    axis = Axis(low=low, high=high, start=(low + high) / 2, octave=octave, step=1 if whole_numbers else 0)
    width, height = picture.size
    return meet_size(run, goal.bpp * width * height / 8, axis)


# Target of the payload where the header alone takes more than the target of the file.
LEAST_BPP = 1e-9


def _payload_goal(goal: Goal, coded: Encoded) -> Goal:
    """Return the goal for the payload: a target rate counts the whole file."""
    if goal.bpp is None:
        return goal
    width, height = coded.size
    target = min(goal.bpp * width * height / 8, float(1 << 62))
    header = container.overhead(file_header.values(coded), int(target))
    return Goal(bpp=max(goal.bpp - 8 * header / (width * height), min(goal.bpp, LEAST_BPP)))


@dataclass(frozen=True, kw_only=True)
class Decoding:
    """A decoded picture and its cost.

    ``seconds`` is the CPU time of all of it, ``codec_seconds`` that inside the decoder (5.16).
    """

    picture: IIPicture
    seconds: float
    codec_seconds: float


def decode(
    coded: Encoded | str | os.PathLike[str], *, max_pixels: int = MAX_DECODED_PIXELS, progress: Progress = None
) -> IIPicture:
    """Decode a coded picture or an ``.ii`` file, with its structure and camera.

    Parameters
    ----------
    coded : Encoded or path
    max_pixels : int
        Largest number of pixels to decode, 2²⁷ by default, 2³¹ at most. It bounds the memory that a forged file can
        take: up to 10 bytes per pixel.
    progress : callable or bool, optional
        ``progress(done, total, text)`` with the frames done, in any thread; True prints a line.

    Raises
    ------
    TypeError
        If ``coded`` is neither a coded picture nor a path.
    ValueError
        If the bytes are not a whole coded picture, or the picture has more than ``max_pixels``.
    OSError
        If the file cannot be read.
    """
    return timed_decode(coded, max_pixels=max_pixels, progress=progress).picture


def timed_decode(
    coded: Encoded | str | os.PathLike[str], *, max_pixels: int = MAX_DECODED_PIXELS, progress: Progress = None
) -> Decoding:
    """Decode as `decode` does, and measure CPU time."""
    started = cpu_seconds()
    report = _report(progress, "decode")
    check_type("coded", coded, (Encoded, str, os.PathLike), "a coded picture or a path")
    path = None
    if not isinstance(coded, Encoded):
        path, coded = os.fspath(coded), Encoded.load(coded)
    name = path or "the coded picture"
    coder = find(coded.scheme)
    payload, settings, blank = coded.payload, coded.options, blank_picture(coded.structure, coded.dtype)
    width, height = blank.size
    if width * height > whole("max_pixels", max_pixels, 1, MAX_PIXELS):
        raise ValueError(
            f"{name} has {width}×{height} pixels: at most {max_pixels} are decoded, raise max_pixels (--max-pixels)"
        )
    try:
        with foreign_errors(f"scheme {coder.name} failed to decode", coder):
            answer = interruptible(lambda: _reporting(report, lambda: coder.decode(payload, blank, settings)))
    except ValueError as error:
        raise ValueError(f"{name} is damaged: {one_line(error)}") from None
    picture, codec_seconds = _pixels(coder, answer, blank)
    return Decoding(picture=picture, seconds=cpu_seconds() - started, codec_seconds=codec_seconds)


def blank_picture(structure: Any, dtype: str) -> IIPicture:
    """Return a picture of a structure whose pixels are zero, read-only and take no memory."""
    lenses, ei_pixels = (
        structure.get(key) if isinstance(structure, Mapping) else None for key in ("lenses", "ei_pixels")
    )
    (k, l), (u, v) = whole_pair("lenses", lenses), whole_pair("ei_pixels", ei_pixels)
    if k * u * l * v > MAX_PIXELS:
        raise ValueError(f"a picture of {k * u}×{l * v} pixels is stated: at most {MAX_PIXELS} are allowed")
    return IIPicture.from_structure_json(np.broadcast_to(np.zeros((), dtype), (l * v, k * u, 3)), dict(structure))
