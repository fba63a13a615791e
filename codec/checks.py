"""Checks of arguments, with messages that name them."""

from __future__ import annotations

import operator
from collections.abc import Iterable
from typing import Any


def check_type(name: str, value: Any, allowed: type | tuple[type, ...], needed: str) -> None:
    """Raise TypeError unless an argument is of one of the types."""
    if not isinstance(value, allowed):
        raise TypeError(f"{name} is {_said(value)}: {needed} is needed")


def whole(name: str, value: Any, low: int, high: int) -> int:
    """Return a whole number within bounds.

    Raises
    ------
    TypeError
        If it is none, or a truth value.
    ValueError
        If it is out of bounds.
    """
    try:
        number = operator.index(value)
    except TypeError:
        number = None
    if number is None or isinstance(value, bool):
        raise TypeError(f"{name} is {_said(value)}: a whole number is needed")
    if not low <= number <= high:
        raise ValueError(f"{name} is {number}: a whole number from {low} to {high} is needed")
    return number


def whole_pair(name: str, value: Any) -> tuple[int, int]:
    """Return two whole numbers, or raise TypeError."""
    try:
        a, b = (operator.index(number) for number in value)
    except (TypeError, ValueError):
        raise TypeError(f"{name} is {_said(value)}: two whole numbers are needed") from None
    return a, b


def texts(name: str, values: Any) -> list[str]:
    """Return a list of texts, or raise TypeError."""
    if isinstance(values, str) or not isinstance(values, Iterable) or getattr(values, "ndim", 1) == 0:
        raise TypeError(f"{name} is {_said(values)}: a list of names is needed")
    found = list(values)
    for value in found:
        check_type(f"{name} holds a value that", value, str, "a name")
    return found


def _said(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 40 else f"of type {type(value).__name__}"
