"""Contract, options and registry of coders."""

from __future__ import annotations

import operator
import sys
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ii_core import IIPicture
from ii_core.base.extras import NotInstalled
from ii_core.base.plugins import load_plugins

from .checks import check_type
from .search import CodingResult

Value = int | float | str
Options = Mapping[str, Value]
Pixels = NDArray[np.uint8] | NDArray[np.uint16]

# Largest number of pixels of a picture: 6 GiB of RGB with 8 bit.
MAX_PIXELS = 1 << 31
# Largest number of pixels that is decoded by default: 16384×8192, four times the full setup 1. Decoders take up to
# 10 bytes per pixel (docs/structure.md, cost).
MAX_DECODED_PIXELS = 1 << 27


@dataclass(frozen=True, kw_only=True)
class Option:
    """Option of a scheme: a choice among names, or a number; a whole number unless its bounds are floats."""

    about: str
    default: Value
    choices: tuple[str, ...] = ()
    low: float = 0
    high: float = 0

    @property
    def allowed(self) -> str:
        """Allowed values, for messages."""
        return "one of " + ", ".join(self.choices) if self.choices else _allowed((self.low, self.high))

    def parse(self, name: str, value: Any) -> Value:
        """Return the value of a text, of JSON or of a keyword.

        Raises
        ------
        ValueError
            If it is not allowed.
        """
        bounds = self.low, self.high
        if isinstance(value, bool) and bounds == (0, 1) and not self.choices:
            value = int(value)
        if self.choices:
            # Numbers are accepted for their text: some choices were numbers in older files.
            found: Value | None = str(value) if str(value) in self.choices else None
        else:
            found = _within(_number(value, bounds) if isinstance(value, str) else value, bounds)
        if found is None:
            raise ValueError(f"option {name} is {value!r}: {self.allowed} is needed")
        return found


@dataclass(frozen=True, kw_only=True)
class Goal:
    """Target of coding: exactly one of rate, quantiser and quality, or none for lossless coding."""

    bpp: float | None = None
    qp: int | None = None
    quality: float | None = None


class Coder(ABC):
    """Contract of coders: pixels of an II-picture to bytes and back.

    A coder is stateless. It decodes from the payload, the structure, the pixel type and the options alone. It must

    - take every structure of K×L lenses over U×V pixels that `check` accepts, in the pixel types of ``dtypes``, and
      refuse others with a ValueError before long work;
    - write the same bytes for the same picture and options, also in several threads at once;
    - meet ``bpp`` within 2 % if it can, else return the nearest size it reaches;
    - return the original pixels where `lossless` is true;
    - raise ValueError, in bounded memory, for bytes that are no whole stream of this coder for this picture;
    - return pixels of the shape and type of the picture;
    - put everything that `decode` reads into the payload, except structure, pixel type and options;
    - decode streams of earlier versions: the default of a later option means the earlier behaviour.

    Attributes
    ----------
    name : str
        Name of the scheme.
    about : str
        Description in one line.
    options : mapping of str to Option
    presets : mapping of str to options
        Named sets of options: ``scheme:name``.
    dtypes : tuple of str
        Pixel types that some options accept; `check` refuses types that the given options do not accept.
    rate_control : bool
        Whether the coder takes ``bpp`` in `Goal`. For other coders with a scale of quantisers or qualities, `encode`
        searches the scale for a rate.
    qp_range : (int, int) or None
        Range of quantisers on the coder's own scale; larger is coarser.
    quality_range : (number, number) or None
        Range of qualities on the coder's own scale; whole numbers unless the bounds are floats.
    scale_about : str
        Meaning of ``qp`` or ``quality``.
    rated : mapping of str to options
        Options for a target rate where they are not given, since their defaults cost quality.
    kind : str
        Kind of component images that the scheme codes: "ei", "si" or "ri"; empty for the whole picture.
    components_alone : bool
        Whether `decode_component` decodes one component image without all others.
    versions : mapping of str to str
        Names and versions of the libraries in use.
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
    rated: ClassVar[Options] = {}
    kind: str = ""
    components_alone: ClassVar[bool] = False

    @property
    def takes_rate(self) -> bool:
        """Whether `encode` takes a rate for this coder: by its own rate control, or by a search of its scale."""
        return self.rate_control or self.qp_range is not None or self.quality_range is not None

    @property
    def missing(self) -> str:
        """Name of a library that coding needs and this installation lacks; empty if there is none."""
        return ""

    @property
    @abstractmethod
    def versions(self) -> dict[str, str]:
        """Name to version."""

    def lossless(self, options: Options) -> bool:
        """Return whether coding with these options is lossless; it then takes no goal."""
        return bool(options.get("lossless", 0))

    @abstractmethod
    def check(self, picture: IIPicture, options: Options) -> None:
        """Raise ValueError for a structure or pixel type that the coder cannot take with these options."""

    @abstractmethod
    def encode(self, picture: IIPicture, options: Options, goal: Goal) -> CodingResult:
        """Code a picture. ``goal`` holds one number within its range, or none if `lossless`; no ``bpp`` without
        `rate_control`.
        """

    @abstractmethod
    def decode(self, payload: bytes, blank: IIPicture, options: Options) -> tuple[Pixels, float]:
        """Return pixels, and the seconds of CPU time inside the decoder.

        ``blank`` has the structure and pixel type of the picture; its pixels are zeros that take no memory. A decoder
        takes memory for the pixels only after the stream has shown that it holds such a picture.
        """

    def frame_order(self, rows: int, cols: int, options: Options) -> NDArray[np.int64]:
        """Return the place of each frame on the grid of component images, counted row by row."""
        return np.arange(rows * cols)

    def decode_component(self, payload: bytes, blank: IIPicture, options: Options, index: int) -> Pixels:
        """Return one component image (T, S, 3), equal to that of the whole decoded picture.

        ``index`` counts the grid row by row. A coder that implements this sets ``kind`` and ``components_alone``.
        """
        raise NotImplementedError(f"scheme {self.name} decodes no component image alone")


ENTRY_POINTS = "raytrace_ii.coders"

_CODERS: dict[str, Coder] = {}

# Schemes of earlier versions and what there is instead. Files name them; see `codec.bitstream.compact`.
REMOVED = {"si-sperr": "versions until 2026-11-22 decode its files, si-jp3d codes volumes"}


class RemovedScheme(ValueError):
    """A scheme that only earlier versions had."""


def register(coder: Coder) -> None:
    """Add a coder to the known schemes, under its name.

    Installed packages register coders by entry points of the group ``raytrace_ii.coders``, each a `Coder`, its
    class, a list of them, or a module that calls `register`.

    Raises
    ------
    TypeError
        If ``coder`` is no `Coder`.
    ValueError
        If the name is taken.
    """
    check_type("coder", coder, Coder, "an instance of codec.Coder")
    if coder.name in _CODERS:
        raise ValueError(f"scheme {coder.name!r} is registered already")
    _CODERS[coder.name] = coder


@cache
def _load_plugins() -> None:
    """Register the coders of installed packages, once."""
    load_plugins(ENTRY_POINTS, "coder", register)


def find(name: str) -> Coder:
    """Return the coder of a scheme.

    Raises
    ------
    TypeError, ValueError
        If the name is no text, or unknown; `RemovedScheme` if it was known to earlier versions.
    """
    check_type("scheme", name, str, "a name")
    if name not in _CODERS:
        _load_plugins()
    if name not in _CODERS:
        if name in REMOVED:
            raise RemovedScheme(f"scheme {name} is no longer there: {REMOVED[name]}")
        raise ValueError(f"unknown scheme {name!r}: known are {', '.join(sorted(_CODERS))}")
    return _CODERS[name]


def schemes() -> dict[str, str]:
    """Return the name of every scheme and its description in one line, presets and missing libraries included."""
    _load_plugins()
    return {name: _line(coder) for name, coder in sorted(_CODERS.items())}


def _line(coder: Coder) -> str:
    presets = ["Presets: " + ", ".join(coder.presets)] if coder.presets else []
    return ". ".join([coder.about, *presets, *([f"NOT INSTALLED: {coder.missing}"] if coder.missing else [])])


def check_installed(coder: Coder) -> None:
    """Raise NotInstalled if a library of a coder is missing; the message names schemes of its kind that work."""
    if not coder.missing:
        return
    others = (other for _, other in sorted(_CODERS.items()) if other.kind == coder.kind and other.name != coder.name)
    names = ", ".join(other.name for other in others if not other.missing)
    raise NotInstalled(
        f"scheme {coder.name} needs {coder.missing}, which is not installed"
        + (f": take one of {names}" if names else "")
    )


# Schemes that take any picture of several views, and any picture, the smallest files first.
OF_VIEWS, OF_PICTURES = ("si-lf", "si-hevc", "si-avif"), ("jpeg2000", "jpegxl", "jpeg")


def general_scheme(picture: IIPicture, bpp: Any = None, qp: Any = None, quality: Any = None) -> str:
    """Return the scheme with the smallest files that takes a picture and a goal.

    It is one for light fields if the picture has 2×2 views or more, else one for plain pictures.

    Raises
    ------
    ValueError
        If none takes them; the message is that of the first scheme.
    """
    check_type("picture", picture, IIPicture, "an IIPicture")
    refused: Exception | None = None
    for name in (*(OF_VIEWS if min(picture.ei_pixels) >= 2 else ()), *OF_PICTURES):
        coder, settings = parse_scheme(name)
        try:
            check_installed(coder)
            checked_goal(coder, settings, bpp, qp, quality)
            check_picture(coder, settings, picture)
        except (ValueError, NotInstalled) as error:
            refused = refused or error
        else:
            return name
    assert refused is not None
    raise refused


def options(scheme: str) -> dict[str, str]:
    """Return what a scheme takes: bpp, qp or quality, options as ``name=default``, presets.

    Raises
    ------
    ValueError
        If the scheme is unknown.
    """
    coder = find(scheme)
    lines = {"bpp": "bits per pixel of the II-picture"} if coder.takes_rate else {}
    for name, bounds in (("qp", coder.qp_range), ("quality", coder.quality_range)):
        if bounds is not None:
            lines[name] = f"{coder.scale_about}; {_allowed(bounds)}"
    for name, option in coder.options.items():
        lines[f"{name}={option.default}"] = f"{option.about}; {option.allowed}"
    for name, values in coder.presets.items():
        lines[name] = "for " + ",".join(f"{key}={value}" for key, value in values.items())
    return lines


def parse_scheme(scheme: str, **options: Value) -> tuple[Coder, dict[str, Value]]:
    """Return a coder and all its options; see `given_options`."""
    coder, given = given_options(scheme, **options)
    return coder, checked_options(coder, given)


def given_options(scheme: str, **options: Value) -> tuple[Coder, dict[str, Value]]:
    """Return a coder and its given options, those of a preset included.

    Parameters
    ----------
    scheme : str
        ``name`` or ``name:preset,option=value,option=value``.
    **options
        Options by name. ``preset`` names a preset of the scheme; any other value of it is the encoder's own option
        ``preset``, as in ``si-hevc:preset=veryslow``.

    Raises
    ------
    ValueError
        If the name, a preset or an option is unknown or given twice, or a value is not allowed.
    """
    if not isinstance(scheme, str):
        raise ValueError(f"scheme is {scheme!r}: a name is needed")
    name, colon, text = scheme.partition(":")
    coder = find(name)
    given: dict[str, Value] = {}
    presets: list[str] = []
    for item in text.split(",") if colon else ():
        key, equals, value = item.partition("=")
        if equals and key in given:
            raise ValueError(f"scheme {scheme!r}: option {key} is given twice")
        if equals:
            given[key] = value
        else:
            presets.append(item)
    for key, keyword in options.items():
        if key == "preset" and isinstance(keyword, str) and (keyword in coder.presets or key not in coder.options):
            presets.append(keyword)
        elif key in given:
            raise ValueError(f"scheme {scheme!r}: option {key} is given twice")
        else:
            given[key] = keyword
    for item in presets:
        if item not in coder.presets:
            known = ", ".join(coder.presets) or "none"
            raise ValueError(f"scheme {scheme!r}: {item!r} is no option=value and no preset: known are {known}")
    if len(presets) > 1:
        raise ValueError(f"scheme {scheme!r}: {presets[1]!r} is a second preset")
    return coder, {**(coder.presets[presets[0]] if presets else {}), **given}


def checked_options(coder: Coder, given: Mapping[str, Any]) -> dict[str, Value]:
    """Return all options of a coder: the given ones, checked, and defaults for the others."""
    if unknown := set(given) - set(coder.options):
        known = ", ".join(coder.options) or "none"
        names = ", ".join(sorted(map(str, unknown)))
        raise ValueError(f"scheme {coder.name} has no option {names}: known are {known}")
    return {
        key: option.parse(key, given[key]) if key in given else option.default
        for key, option in coder.options.items()
    }


def checked_goal(coder: Coder, options: Options, bpp: Any, qp: Any, quality: Any) -> Goal:
    """Return the goal; raise ValueError unless one number is given that the coder takes, or none if lossless."""
    given = {name: value for name, value in (("bpp", bpp), ("qp", qp), ("quality", quality)) if value is not None}
    takes = {"bpp": coder.takes_rate, "qp": coder.qp_range is not None, "quality": coder.quality_range is not None}
    if coder.lossless(options):
        takes = {}
    known = [name for name, taken in takes.items() if taken]
    if foreign := set(given) - set(known):
        instead = f"give {' or '.join(known)} instead" if known else "it codes lossless, leave it out"
        raise ValueError(f"scheme {coder.name} takes no {', '.join(sorted(foreign))} here: {instead}")
    if len(given) != (1 if known else 0):
        exactly = known[0] if len(known) == 1 else f"exactly one of {' and '.join(known)}"
        several = " and ".join(f"{name} is {value}" for name, value in given.items())
        state = several or f"no {' or '.join(known)} is given"
        raise ValueError(f"{state}: {exactly} is needed")
    if bpp is not None:
        if not is_number(bpp) or not 0 < bpp <= sys.float_info.max:
            raise ValueError(f"bpp is {bpp!r}: a positive number is needed")
        return Goal(bpp=float(bpp))
    for name, value, bounds in (("qp", qp, coder.qp_range), ("quality", quality, coder.quality_range)):
        if value is not None and bounds is not None:
            if (number := _within(value, bounds)) is None:
                about = f" ({coder.scale_about})" if coder.scale_about else ""
                raise ValueError(f"{name} is {value!r}: {_allowed(bounds)} is needed{about}")
            return Goal(qp=int(number)) if name == "qp" else Goal(quality=number)
    return Goal()


def check_picture(coder: Coder, options: Options, picture: Any) -> None:
    """Raise ValueError unless the argument is a picture that the coder takes."""
    if not isinstance(picture, IIPicture):
        raise ValueError(f"picture is {type(picture).__name__}: an IIPicture is needed")
    if picture.pixels.dtype.name not in coder.dtypes:
        raise ValueError(
            f"pixels are {picture.pixels.dtype.name}: scheme {coder.name} takes {', '.join(coder.dtypes)}"
        )
    check_installed(coder)
    picture.check_regular()
    width, height = picture.size
    if width * height > MAX_PIXELS:
        raise ValueError(f"the picture has {width}×{height} pixels: at most {MAX_PIXELS} are allowed")
    coder.check(picture, options)


def fractions(bounds: tuple[float, float]) -> bool:
    """Return whether a range holds numbers that are not whole: one of its bounds is a float."""
    return any(isinstance(bound, float) for bound in bounds)


def _allowed(bounds: tuple[float, float]) -> str:
    low, high = bounds
    return f"a {'' if fractions(bounds) else 'whole '}number from {low:g} to {high}"


def _number(text: str, bounds: tuple[float, float]) -> float | None:
    try:
        return float(text) if fractions(bounds) else int(text)
    except ValueError:
        return None


def _within(value: Any, bounds: tuple[float, float]) -> float | None:
    """Return the number within bounds, a float or an int as the bounds are; None if it is outside."""
    if not is_number(value) or not bounds[0] <= value <= bounds[1]:
        return None
    if fractions(bounds):
        return float(value)
    try:
        return operator.index(value)
    except TypeError:
        return None


def is_number(value: Any) -> bool:
    """Return whether a value is a number and no truth value."""
    return isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
