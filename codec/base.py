"""What a coder is, what it makes, and how one is found by name."""

from __future__ import annotations

import math
import operator
import os
import time
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ii_core import IIPicture
from ii_core.camera import whole_pair

from . import container
from .rate import Run, within

Value = int | str
Options = Mapping[str, Value]

# Six gigabytes of pixels; whatever claims more is taken for damage or mischief.
MAX_PIXELS = 1 << 31


@dataclass(frozen=True, kw_only=True)
class Option:
    """One option of a scheme: a choice among names, or a whole number within bounds."""

    about: str
    default: Value
    choices: tuple[str, ...] = ()
    low: int = 0
    high: int = 0

    @property
    def allowed(self) -> str:
        """What a value may be, for messages."""
        return (
            "one of " + ", ".join(self.choices) if self.choices else f"a whole number from {self.low} to {self.high}"
        )

    def parse(self, name: str, value: Any) -> Value:
        """The value of text or of JSON, or a ValueError that says what is allowed."""
        if self.choices:
            if value in self.choices:
                return str(value)
        else:
            try:
                number = int(value) if isinstance(value, str) else operator.index(value)
            except (TypeError, ValueError):
                number = None
            if number is not None and not isinstance(value, bool) and self.low <= number <= self.high:
                return number
        raise ValueError(f"option {name} is {value!r}: {self.allowed} is needed")


@dataclass(frozen=True, kw_only=True)
class Coding:
    """What a coder hands back: the run it keeps, and how many it took to get there."""

    run: Run
    runs: int = 1


class Coder(ABC):
    """The contract every coder keeps.

    A coder turns the pixels of an II-picture into bytes and back. It is stateless: everything it needs to decode is
    in the bytes, the structure of the picture and the options. It must

    - take any structure of K×L lenses over U×V pixels from 1×1 up that `check` lets pass, in the pixel types of
      ``dtypes``, and refuse the rest with a ValueError before any long work;
    - encode the same picture with the same options to the same bytes, always, also beside itself in another thread;
    - meet ``bpp`` within 2 % where it can, and else return the nearest it can reach;
    - raise ValueError, in bounded memory, from bytes that are not a whole stream of its own for that picture;
    - return pixels of the shape and type it was given;
    - count nothing for free: `encode`'s payload is all that `decode` reads besides structure and options.

    Attributes
    ----------
    name : str
        What the scheme is called.
    about : str
        One line on what it does.
    options : mapping of str to Option
    dtypes : tuple of str
        Pixel types it takes.
    qp_range : (int, int) or None
        The constant quantisers it takes; None if it takes only ``bpp``.
    versions : mapping of str to str
        The libraries that do the work.
    """

    name: str
    about: str
    options: ClassVar[Mapping[str, Option]] = {}
    dtypes: ClassVar[tuple[str, ...]] = ("uint8",)
    qp_range: ClassVar[tuple[int, int] | None] = None

    @property
    @abstractmethod
    def versions(self) -> dict[str, str]:
        """Name to version."""

    @abstractmethod
    def check(self, picture: IIPicture) -> None:
        """Raise ValueError for a structure this coder cannot take."""

    @abstractmethod
    def encode(self, picture: IIPicture, options: Options, *, bpp: float | None, qp: int | None) -> Coding:
        """Exactly one of ``bpp`` and ``qp`` is given, within its range."""

    @abstractmethod
    def decode(self, payload: bytes, blank: IIPicture, options: Options) -> tuple[NDArray[np.uint8], float]:
        """Pixels, and the seconds of CPU time spent inside the decoder.

        ``blank`` has the structure and no pixels to speak of: memory for those is taken only once the stream has
        shown that it holds such a picture.
        """


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
    target_bpp : float or None
        The rate asked for, if one was.
    qp : int or None
        The constant quantiser asked for, if one was.
    reached : bool
        False if the rate misses ``target_bpp`` by more than 2 %: it lies beyond what the coder can do here, and this
        is the nearest.
    runs : int
        How many times the encoder ran to meet the rate.
    encode_seconds : float or None
        CPU time of the calling thread for all of `encode`, rearrangement and every run. None if read from a file.
    codec_seconds : float or None
        The part of it inside the encoder, for the run that was kept alone: the coder's own time (5.16).
    versions : mapping
        Libraries that did the work.
    """

    scheme: str
    options: Mapping[str, Value]
    payload: bytes = field(repr=False)
    structure: Mapping[str, Any]
    target_bpp: float | None
    qp: int | None
    reached: bool
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


_HEADER = ("scheme", "options", "structure", "target_bpp", "qp", "reached", "runs", "versions")


def _from_header(header: dict[str, Any], payload: bytes) -> Encoded:
    if set(header) != set(_HEADER):
        raise ValueError(f"its header has {', '.join(sorted(header)) or 'nothing'}: needed are {', '.join(_HEADER)}")
    if not isinstance(header["scheme"], str) or not isinstance(header["options"], dict):
        raise ValueError("its header names no scheme with options")
    coder = find(header["scheme"])
    options = checked_options(coder, header["options"])
    structure = _blank(header["structure"]).structure_json()
    return Encoded(**{**header, "options": options, "structure": structure}, payload=payload)


_CODERS: dict[str, Coder] = {}


def register(coder: Coder) -> None:
    """Make a coder known by its name.

    Raises
    ------
    ValueError
        If the name is taken.
    """
    if coder.name in _CODERS:
        raise ValueError(f"scheme {coder.name!r} is registered already")
    _CODERS[coder.name] = coder


def find(name: str) -> Coder:
    """The coder of a name, or a ValueError that lists the known."""
    if name not in _CODERS:
        raise ValueError(f"unknown scheme {name!r}: known are {', '.join(sorted(_CODERS))}")
    return _CODERS[name]


def schemes() -> dict[str, str]:
    """Name of every scheme to one line on what it does and its options with their defaults."""
    lines = {}
    for name, coder in sorted(_CODERS.items()):
        options = [
            f"{key}={option.default} ({option.about}; {option.allowed})" for key, option in coder.options.items()
        ]
        lines[name] = ". ".join([coder.about, *(["Options: " + "; ".join(options)] if options else [])])
    return lines


def parse_scheme(scheme: str) -> tuple[Coder, dict[str, Value]]:
    """A coder and its options from ``name`` or ``name:option=value,option=value``.

    Raises
    ------
    ValueError
        If the name or an option is unknown, or a value is not allowed.
    """
    if not isinstance(scheme, str):
        raise ValueError(f"scheme is {scheme!r}: a name is needed")
    name, colon, text = scheme.partition(":")
    coder = find(name)
    given: dict[str, str] = {}
    for item in text.split(",") if colon else ():
        key, equals, value = item.partition("=")
        if not equals:
            raise ValueError(f"scheme {scheme!r}: {item!r} is no option=value")
        if key in given:
            raise ValueError(f"scheme {scheme!r}: option {key} is given twice")
        given[key] = value
    return coder, checked_options(coder, given)


def checked_options(coder: Coder, given: Mapping[str, Any]) -> dict[str, Value]:
    """All options of a coder: those given, checked, and the others' defaults."""
    if unknown := set(given) - set(coder.options):
        known = ", ".join(coder.options) or "none"
        raise ValueError(f"scheme {coder.name} has no option {', '.join(sorted(unknown))}: known are {known}")
    return {
        key: option.parse(key, given[key]) if key in given else option.default
        for key, option in coder.options.items()
    }


def encode(picture: IIPicture, scheme: str, *, bpp: float | None = None, qp: int | None = None) -> Encoded:
    """Code an II-picture at a rate or at a constant quantiser.

    Parameters
    ----------
    picture : IIPicture
        Of a pixel type the scheme takes.
    scheme : str
        ``name`` or ``name:option=value,…``; see `schemes`.
    bpp : float
        Bits per pixel of the II-picture; `Encoded.reached` tells whether it was met within 2 %.
    qp : int
        Constant quantiser, in the scheme's range. Exactly one of ``bpp`` and ``qp`` is needed.

    Raises
    ------
    ValueError
        If an argument is unknown or out of range, or the scheme cannot take the picture; before any long work.
    """
    started = time.thread_time()
    coder, options = parse_scheme(scheme)
    rate, quantiser = _checked_rate(coder, bpp, qp)
    _check_picture(coder, picture)
    coding = coder.encode(picture, options, bpp=rate, qp=quantiser)
    width, height = picture.size
    target = None if rate is None else rate * width * height / 8
    return Encoded(
        scheme=coder.name,
        options=options,
        payload=coding.run.payload,
        structure=picture.structure_json(),
        target_bpp=rate,
        qp=quantiser,
        reached=target is None or within(len(coding.run.payload), target),
        runs=coding.runs,
        encode_seconds=time.thread_time() - started,
        codec_seconds=coding.run.codec_seconds,
        versions=coder.versions,
    )


@dataclass(frozen=True, kw_only=True)
class Decoding:
    """A decoded picture and what it cost, in seconds of CPU time of the calling thread.

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
    started = time.thread_time()
    path = None
    if not isinstance(coded, Encoded):
        path, coded = os.fspath(coded), Encoded.load(coded)
    coder = find(coded.scheme)
    blank = _blank(coded.structure)
    try:
        pixels, codec_seconds = coder.decode(coded.payload, blank, coded.options)
    except ValueError as error:
        raise ValueError(f"{path or 'the coded picture'} is damaged: {error}") from None
    picture = blank.with_pixels(pixels)
    return Decoding(picture=picture, seconds=time.thread_time() - started, codec_seconds=codec_seconds)


def _checked_rate(coder: Coder, bpp: float | None, qp: int | None) -> tuple[float | None, int | None]:
    if coder.qp_range is None and qp is not None:
        raise ValueError(f"scheme {coder.name} has no constant quantiser: give bpp instead of qp")
    if (bpp is None) == (qp is None):
        needed = "bpp" if coder.qp_range is None else "exactly one of bpp and qp"
        raise ValueError(f"bpp is {bpp} and qp is {qp}: {needed} is needed")
    if bpp is not None:
        if not _is_number(bpp) or not 0 < bpp < math.inf:
            raise ValueError(f"bpp is {bpp!r}: a positive number is needed")
        return float(bpp), None
    low, high = coder.qp_range or (0, 0)
    if isinstance(qp, bool) or not isinstance(qp, int | np.integer) or not low <= qp <= high:
        raise ValueError(f"qp is {qp!r}: a whole number from {low} to {high} is needed")
    return None, int(qp)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)


def _check_picture(coder: Coder, picture: IIPicture) -> None:
    if not isinstance(picture, IIPicture):
        raise ValueError(f"picture is {type(picture).__name__}: an IIPicture is needed")
    if picture.pixels.dtype.name not in coder.dtypes:
        raise ValueError(
            f"pixels are {picture.pixels.dtype.name}: scheme {coder.name} takes {', '.join(coder.dtypes)}"
        )
    picture.check_regular()
    width, height = picture.size
    if width * height > MAX_PIXELS:
        raise ValueError(f"the picture has {width}×{height} pixels: at most {MAX_PIXELS} are allowed")
    coder.check(picture)


def _blank(structure: Any) -> IIPicture:
    """A picture of that structure whose pixels take no memory, all zero and read-only."""
    lenses, ei_pixels = (
        structure.get(key) if isinstance(structure, Mapping) else None for key in ("lenses", "ei_pixels")
    )
    (k, l), (u, v) = whole_pair("lenses", lenses), whole_pair("ei_pixels", ei_pixels)
    if k * u * l * v > MAX_PIXELS:
        raise ValueError(f"a picture of {k * u}×{l * v} pixels is claimed: at most {MAX_PIXELS} are allowed")
    return IIPicture.from_structure_json(np.broadcast_to(np.uint8(0), (l * v, k * u, 3)), dict(structure))
