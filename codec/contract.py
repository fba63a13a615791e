"""What a coder is, what it is asked for, and how one is found by name."""

from __future__ import annotations

import operator
import sys
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ii_core import IIPicture

from .checks import check_type
from .rate import Run

Value = int | float | str
Options = Mapping[str, Value]
Pixels = NDArray[np.uint8] | NDArray[np.uint16]

# Pixels of a picture: six gigabytes.
MAX_PIXELS = 1 << 31
# Pixels of a picture that is decoded without an explicit limit: 16384×8192, four times the full setup 1. Decoders
# take up to 10 bytes a pixel, SPERR 22 (docs/structure.md, cost).
MAX_DECODED_PIXELS = 1 << 27


@dataclass(frozen=True, kw_only=True)
class Option:
    """One option of a scheme: a choice among names, or a number, a whole one unless its bounds are floats."""

    about: str
    default: Value
    choices: tuple[str, ...] = ()
    low: float = 0
    high: float = 0

    @property
    def allowed(self) -> str:
        """What a value may be, for messages."""
        return "one of " + ", ".join(self.choices) if self.choices else _allowed((self.low, self.high))

    def parse(self, name: str, value: Any) -> Value:
        """The value of text or of JSON, or a ValueError that says what is allowed."""
        bounds = self.low, self.high
        if self.choices:
            # A number is as good as its text: options have become choices that were numbers in older files.
            found: Value | None = str(value) if str(value) in self.choices else None
        else:
            found = _within(_number(value, bounds) if isinstance(value, str) else value, bounds)
        if found is None:
            raise ValueError(f"option {name} is {value!r}: {self.allowed} is needed")
        return found


@dataclass(frozen=True, kw_only=True)
class Goal:
    """What a picture is to be coded for: one of these, or none for lossless coding."""

    bpp: float | None = None
    qp: int | None = None
    quality: float | None = None


@dataclass(frozen=True, kw_only=True)
class Coding:
    """What a coder hands back: the run it keeps, and how many it took to get there."""

    run: Run
    runs: int = 1


class Coder(ABC):
    """The contract every coder keeps.

    A coder turns the pixels of an II-picture into bytes and back. It is stateless: everything it needs to decode is
    in the bytes, the structure and type of the picture, and the options. It must

    - take any structure of K×L lenses over U×V pixels from 1×1 up that `check` lets pass, in the pixel types of
      ``dtypes``, and refuse the rest with a ValueError before any long work;
    - encode the same picture with the same options to the same bytes, always, also beside itself in another thread;
    - meet ``bpp`` within 2 % where it can, and else return the nearest it can reach;
    - return the very pixels where `lossless` says so;
    - raise ValueError, in bounded memory, from bytes that are not a whole stream of its own for that picture;
    - return pixels of the shape and type it was given;
    - count nothing for free: `encode`'s payload is all that `decode` reads besides structure, type and options;
    - decode what it wrote in earlier versions: an option that is added later has, for the decoder, the default that
      means what was done before.

    Attributes
    ----------
    name : str
        What the scheme is called.
    about : str
        One line on what it does.
    options : mapping of str to Option
    presets : mapping of str to options
        Names for settings, each a few options: ``scheme:name``.
    dtypes : tuple of str
        Pixel types it takes with some of its options; `check` refuses those that do not go with the options given.
    rate_control : bool
        Whether it takes ``bpp``.
    qp_range : (int, int) or None
        The quantisers it takes, on its own scale, larger is coarser.
    quality_range : (number, number) or None
        The qualities it takes, on its own scale; whole numbers only, unless the bounds are floats.
    scale_about : str
        What the numbers of ``qp`` or ``quality`` are.
    versions : mapping of str to str
        The libraries that do the work.
    """

    name: str
    about: str
    options: ClassVar[Mapping[str, Option]] = {}
    presets: ClassVar[Mapping[str, Options]] = {}
    dtypes: ClassVar[tuple[str, ...]] = ("uint8",)
    rate_control: ClassVar[bool] = True
    qp_range: ClassVar[tuple[int, int] | None] = None
    quality_range: ClassVar[tuple[float, float] | None] = None
    scale_about: ClassVar[str] = ""

    @property
    @abstractmethod
    def versions(self) -> dict[str, str]:
        """Name to version."""

    def lossless(self, options: Options) -> bool:
        """Whether these options code to the bit; then neither rate nor quantiser nor quality can be asked for."""
        return bool(options.get("lossless", 0))

    @abstractmethod
    def check(self, picture: IIPicture, options: Options) -> None:
        """Raise ValueError for a structure or pixel type this coder cannot take with these options."""

    @abstractmethod
    def encode(self, picture: IIPicture, options: Options, goal: Goal) -> Coding:
        """``goal`` holds one number, within its range, or none if `lossless`."""

    @abstractmethod
    def decode(self, payload: bytes, blank: IIPicture, options: Options) -> tuple[Pixels, float]:
        """Pixels, and the seconds of CPU time spent inside the decoder.

        ``blank`` has the structure and pixel type, and no pixels to speak of: memory for those is taken only once
        the stream has shown that it holds such a picture.
        """


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
    """Return the coder of a name; for an unknown one raise ValueError with the known."""
    check_type("scheme", name, str, "a name")
    if name not in _CODERS:
        raise ValueError(f"unknown scheme {name!r}: known are {', '.join(sorted(_CODERS))}")
    return _CODERS[name]


def schemes() -> dict[str, str]:
    """Name of every scheme to one line on what it does, and its named settings."""
    return {
        name: ". ".join([coder.about, *(["Presets: " + ", ".join(coder.presets)] if coder.presets else [])])
        for name, coder in sorted(_CODERS.items())
    }


def options(scheme: str) -> dict[str, str]:
    """What can be asked of a scheme: bpp, qp or quality, options as ``name=default``, presets.

    Raises
    ------
    ValueError
        If the scheme is unknown.
    """
    coder = find(scheme)
    lines = {"bpp": "bits per pixel of the II-picture"} if coder.rate_control else {}
    for name, bounds in (("qp", coder.qp_range), ("quality", coder.quality_range)):
        if bounds is not None:
            lines[name] = f"{coder.scale_about}; {_allowed(bounds)}"
    for name, option in coder.options.items():
        lines[f"{name}={option.default}"] = f"{option.about}; {option.allowed}"
    for name, values in coder.presets.items():
        lines[name] = "for " + ",".join(f"{key}={value}" for key, value in values.items())
    return lines


def parse_scheme(scheme: str) -> tuple[Coder, dict[str, Value]]:
    """A coder and its options from ``name`` or ``name:preset,option=value,option=value``.

    Raises
    ------
    ValueError
        If the name, a preset or an option is unknown, or a value is not allowed.
    """
    if not isinstance(scheme, str):
        raise ValueError(f"scheme is {scheme!r}: a name is needed")
    name, colon, text = scheme.partition(":")
    coder = find(name)
    given: dict[str, Value] = {}
    preset: Options | None = None
    for item in text.split(",") if colon else ():
        key, equals, value = item.partition("=")
        if not equals:
            if key not in coder.presets:
                known = ", ".join(coder.presets) or "none"
                raise ValueError(f"scheme {scheme!r}: {item!r} is no option=value and no preset: known are {known}")
            if preset is not None:
                raise ValueError(f"scheme {scheme!r}: {item!r} is a second preset")
            preset = coder.presets[key]
            continue
        if key in given:
            raise ValueError(f"scheme {scheme!r}: option {key} is given twice")
        given[key] = value
    return coder, checked_options(coder, {**(preset or {}), **given})


def checked_options(coder: Coder, given: Mapping[str, Any]) -> dict[str, Value]:
    """All options of a coder: those given, checked, and the others' defaults."""
    if unknown := set(given) - set(coder.options):
        known = ", ".join(coder.options) or "none"
        raise ValueError(f"scheme {coder.name} has no option {', '.join(sorted(unknown))}: known are {known}")
    return {
        key: option.parse(key, given[key]) if key in given else option.default
        for key, option in coder.options.items()
    }


def checked_goal(coder: Coder, options: Options, bpp: Any, qp: Any, quality: Any) -> Goal:
    """The goal, or a ValueError: exactly one number of those the coder takes, none if it is lossless."""
    given = {name: value for name, value in (("bpp", bpp), ("qp", qp), ("quality", quality)) if value is not None}
    takes = {"bpp": coder.rate_control, "qp": coder.qp_range is not None, "quality": coder.quality_range is not None}
    if coder.lossless(options):
        takes = {}
    known = [name for name, taken in takes.items() if taken]
    if foreign := set(given) - set(known):
        instead = f"give {' or '.join(known)} instead" if known else "it codes lossless, nothing is asked for"
        raise ValueError(f"scheme {coder.name} takes no {', '.join(sorted(foreign))} here: {instead}")
    if len(given) != (1 if known else 0):
        exactly = known[0] if len(known) == 1 else f"exactly one of {' and '.join(known)}"
        told = " and ".join(f"{name} is {given.get(name)}" for name in known)
        raise ValueError(f"{told}: {exactly} is needed")
    if bpp is not None:
        if not is_number(bpp) or not 0 < bpp <= sys.float_info.max:
            raise ValueError(f"bpp is {bpp!r}: a positive number is needed")
        return Goal(bpp=float(bpp))
    for name, value, bounds in (("qp", qp, coder.qp_range), ("quality", quality, coder.quality_range)):
        if value is not None and bounds is not None:
            if (number := _within(value, bounds)) is None:
                raise ValueError(f"{name} is {value!r}: {_allowed(bounds)} is needed")
            return Goal(qp=int(number)) if name == "qp" else Goal(quality=number)
    return Goal()


def check_picture(coder: Coder, options: Options, picture: Any) -> None:
    """Raise ValueError for what is no picture, or none that the coder takes."""
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
    coder.check(picture, options)


def _fractions(bounds: tuple[float, float]) -> bool:
    return any(isinstance(bound, float) for bound in bounds)


def _allowed(bounds: tuple[float, float]) -> str:
    low, high = bounds
    return f"a {'' if _fractions(bounds) else 'whole '}number from {low:g} to {high}"


def _number(text: str, bounds: tuple[float, float]) -> float | None:
    try:
        return float(text) if _fractions(bounds) else int(text)
    except ValueError:
        return None


def _within(value: Any, bounds: tuple[float, float]) -> float | None:
    """The number, a float or an int as the bounds are, if it is one within them."""
    if not is_number(value) or not bounds[0] <= value <= bounds[1]:
        return None
    if _fractions(bounds):
        return float(value)
    try:
        return operator.index(value)
    except TypeError:
        return None


def is_number(value: Any) -> bool:
    """Whether a value is a number and no truth value."""
    return isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
