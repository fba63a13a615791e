"""Checks of arguments: rules by kind of value, and a decorator that applies them."""

from __future__ import annotations

import inspect
import operator
import os
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from typing import Any, TypeVar

import numpy as np

Pair = tuple[int, int]
Rule = Callable[[str, Any], Any]  # raises TypeError or ValueError that names the argument
LEAST_MM, MOST_MM = 1e-9, 1e9  # of a length: a hundredth of an atom, and a thousand kilometres
VIEW_BYTES = 64  # of a pixel of a view: colours as floats, places, weights
Function = TypeVar("Function", bound=Callable[..., Any])


def checked(**rules: Rule) -> Callable[[Function], Function]:
    """Decorate a public function: check each named argument by its rule before the call.

    An argument that is its default, such as None, is not checked. The function itself refuses wrong values of the
    right type.
    """

    def decorate(function: Function) -> Function:
        signature = inspect.signature(function)
        defaults = {name: parameter.default for name, parameter in signature.parameters.items()}

        @wraps(function)
        def call(*args: Any, **kwargs: Any) -> Any:
            for name, value in signature.bind(*args, **kwargs).arguments.items():
                if name in rules and value is not defaults[name]:
                    rules[name](name, value)
            return function(*args, **kwargs)

        return call  # type: ignore[return-value]

    return decorate


def shown(value: Any) -> str:
    """Return a value for a message, at most 60 characters."""
    try:
        text = repr(value)
    except ValueError:  # an integer of more digits than Python prints
        text = "an integer of thousands of digits"
    return text if len(text) <= 60 else f"{text[:59]}…"


def refuse(name: str, value: Any, needed: str) -> TypeError:
    """Return a TypeError with the name, value and type of an argument and the needed kind."""
    return TypeError(f"{name} is {shown(value)}, a {type(value).__name__}: {needed} is needed")


def instance(*kinds: type) -> Rule:
    """Rule: an object of one of these classes."""
    names = " or ".join(kind.__name__ for kind in kinds)

    def rule(name: str, value: Any) -> None:
        if not isinstance(value, kinds):
            raise TypeError(f"{name} is a {type(value).__name__}: an {names} is needed")

    return rule


def path(name: str, value: Any) -> None:
    """Rule: text that is not empty, which would be the working folder, or a path object."""
    if not isinstance(value, str | os.PathLike):
        raise refuse(name, value, "a path")
    if value == "" or "\0" in os.fspath(value):
        raise ValueError(f"{name} is {shown(value)}: a path is needed")


def text(name: str, value: Any) -> None:
    """Rule: text."""
    if not isinstance(value, str):
        raise refuse(name, value, "text")


def one_of(*known: str) -> Rule:
    """Rule: one of these names."""

    def rule(name: str, value: Any) -> None:
        if not isinstance(value, str) or value not in known:
            raise ValueError(f"unknown {name} {shown(value)}: known are {', '.join(known)}")

    return rule


def number(name: str, value: Any) -> float:
    """Rule: a real number within the range of floats; return it."""
    if not isinstance(value, int | float | np.integer | np.floating) and not (
        isinstance(value, np.ndarray) and value.ndim == 0 and value.dtype.kind in "fiu"
    ):
        raise refuse(name, value, "a number")
    try:
        return float(value)
    except OverflowError:
        raise ValueError(f"{name} is too large: a number below {np.finfo(float).max:.3g} is needed") from None


def whole(name: str, value: Any) -> int:
    """Rule: a whole number of 64 bits; return it."""
    if isinstance(value, float) and not value.is_integer():
        raise ValueError(f"{name} is {value:g}: a whole number is needed")
    if not isinstance(value, int | np.integer):
        raise refuse(name, value, "a whole number")
    if not -(2**63) <= value < 2**63:
        raise ValueError(f"{name} is too large: a whole number of 64 bits is needed")
    return int(value)


def whole_from(least: int, most: int) -> Rule:
    """Rule: a whole number within bounds; a truth value is none."""

    def rule(name: str, value: Any) -> None:
        if isinstance(value, bool):
            raise refuse(name, value, "a whole number")
        if not least <= whole(name, value) <= most:
            raise ValueError(f"{name} is {value}: a whole number from {least} to {most} is needed")

    return rule


def number_from(least: float, most: float) -> Rule:
    """Rule: a number within bounds."""

    def rule(name: str, value: Any) -> None:
        within(name, value, least, most)

    return rule


def indices(name: str, value: Any) -> Pair:
    """Rule: two whole numbers, counted from 0; return them.

    Raises
    ------
    TypeError
        If the value is none; the message names the argument.
    """
    try:
        a, b = (operator.index(number) for number in value)
    except (TypeError, ValueError):
        raise refuse(name, value, "a pair of whole numbers") from None
    return a, b


def numbers(name: str, value: Any) -> None:
    """Rule: an array of real numbers, or values that numpy converts to one."""
    try:
        array = np.asarray(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise TypeError(f"{name} is {shown(value)}, no array of numbers: {error}") from None
    if array.dtype.kind not in "bfiu":
        raise refuse(name, value, "an array of numbers")


def numbers_in_a_row(name: str, value: Any) -> None:
    """Rule: a list of numbers."""
    numbers(name, value)
    if np.ndim(value) != 1:
        raise refuse(name, value, "a list of numbers")


def array(name: str, value: Any) -> None:
    """Rule: a numpy array of numbers."""
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "bfiu":
        raise refuse(name, value, "an array of numbers")


def sequence(name: str, value: Any) -> None:
    """Rule: a list; text is none."""
    if isinstance(value, str | bytes) or not isinstance(value, Sequence):
        raise refuse(name, value, "a list")


def list_of(*kinds: type) -> Rule:
    """Rule: a list of objects of these classes; it may be empty."""
    names = " or ".join(kind.__name__ for kind in kinds)

    def rule(name: str, value: Any) -> None:
        sequence(name, value)
        if not all(isinstance(item, kinds) for item in value):
            raise refuse(name, value, f"a list of {names}")

    return rule


def flag(name: str, value: Any) -> None:
    """Rule: true or false."""
    if not isinstance(value, bool | np.bool_ | int):
        raise refuse(name, value, "true or false")


def block(name: str, value: Any) -> None:
    """Rule: a slice of rows or columns."""
    parts = (value.start, value.stop, value.step) if isinstance(value, slice) else ("",)
    if not all(part is None or isinstance(part, int | np.integer) for part in parts):
        raise refuse(name, value, "a slice of whole numbers")


def check_fields(owner: Any, **rules: Rule) -> None:
    """Check fields of an object by their rules; None is not checked, where it is the default."""
    for name, rule in rules.items():
        value = getattr(owner, name)
        if value is not None or getattr(type(owner), name, 0) is not None:
            rule(name, value)


def mapping(name: str, value: Any) -> None:
    """Rule: a dict."""
    if not isinstance(value, Mapping):
        raise refuse(name, value, "a dict")


def callable_(name: str, value: Any) -> None:
    """Rule: a function."""
    if not callable(value):
        raise refuse(name, value, "a function")


def progress(name: str, value: Any) -> None:
    """Rule: a function, or True for a printed line and False for none."""
    if not callable(value) and not isinstance(value, bool):
        raise refuse(name, value, "a function, True or False")


def within(name: str, value: Any, least: float, most: float, needed: str = "number", unit: str = "") -> float:
    """Return a number within bounds.

    Raises
    ------
    TypeError, ValueError
        If the value is none; the message names the argument.
    """
    given = number(name, value)
    if not least <= given <= most:
        raise ValueError(f"{name} is {given:g}: a {needed} from {least:g} to {most:g}{unit} is needed")
    return given


def length(name: str, value: Any) -> float:
    """Return a length from `LEAST_MM` to `MOST_MM`; squares and quotients of lengths are finite and not zero."""
    return within(name, value, LEAST_MM, MOST_MM, "length", " mm")


def place(name: str, value: Any, count: int, most: float = MOST_MM) -> tuple[float, ...]:
    """Return a tuple of ``count`` coordinates in mm, each at most ``most`` in size.

    Raises
    ------
    TypeError, ValueError
        If the value is none; the message names the argument.
    """
    needed = f"{count} numbers from {-most:g} to {most:g} mm"
    if (
        isinstance(value, str | bytes)
        or not isinstance(value, Sequence | np.ndarray)
        or getattr(value, "ndim", 1) == 0
    ):
        raise refuse(name, value, needed)
    found = tuple(number(name, x) for x in value)
    if len(found) != count or not all(-most <= x <= most for x in found):
        raise ValueError(f"{name} is {shown(value)}: {needed} are needed")
    return found


def whole_pair(name: str, value: Any) -> Pair:
    """Return a pair of whole numbers of at least 1, across and down.

    Raises
    ------
    ValueError
        If the value is none; the message names the argument.
    """
    try:
        a, b = value
        across, down = int(a), int(b)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{name} is {shown(value)}: two whole numbers are needed") from None
    if (across, down) != (a, b) or across < 1 or down < 1:
        raise ValueError(f"{name} is {a}×{b}: two whole numbers of at least 1 are needed")
    return across, down


def view_size(name: str, value: Any, count: int = 1) -> Pair:
    """Return the size of a view in pixels, of which ``count`` fit into memory with the arrays of its computation.

    Raises
    ------
    ValueError
        If the value is no pair of whole numbers, or too large; the message names the argument.
    """
    from .files import memory_bytes

    width, height = whole_pair(name, value)
    if count * width * height * VIEW_BYTES > (memory := memory_bytes()):
        raise ValueError(
            f"{name} is {width}×{height}: at most {memory // VIEW_BYTES / count:.2g} pixels fit into the "
            f"{memory / 1e9:.1f} GB of memory of this machine"
        )
    return width, height
