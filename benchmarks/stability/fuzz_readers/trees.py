"""Mutation of trees of plain values, and their text as JSON and TOML."""

from __future__ import annotations

import copy
import json
from collections.abc import Sequence
from typing import Any

from numpy.random import Generator


class Raw(str):
    """Text that is written into a file unchanged."""


class Twin(str):
    """A key that may occur twice in an object: it equals only itself."""

    __hash__ = object.__hash__

    def __eq__(self, other: object) -> bool:
        return self is other


NUMBERS: tuple[Any, ...] = (
    0, -1, 1, 2, 3, 7, 255, 256, 65535, 65536, 10**6, 2**31 - 1, 2**31, 2**32, 2**53 + 1, 2**63, 2**64, 10**19,
    0.5, -0.5, 1.5, 1e-9, 1e-30, 5e-324, 1e9, 1e30, 1e300, 1.7e308, -1e308, float("nan"), float("inf"), -float("inf"),
)  # fmt: skip
TEXTS = (
    "", " ", "\0", "a\nb", "\x1b[31mred", "[bold]", "../../etc/passwd", "/etc/passwd", ".", "..", "é", "\u202e",
    "nan", "1", "a" * 300, "a" * 5000, "data:,", "data:application/octet-stream;base64,AAAA", "#ffffff", "%00",
    "{0}", "%s", "C:\\x",
)  # fmt: skip
LITERALS = (
    "[" * 40 + "]" * 40, "[" * 900 + "]" * 900, "[" * 20000, "[" * 20000 + "]" * 20000,
    '{"a":' * 900 + "1" + "}" * 900, "9" * 19, "9" * 25, "9" * 5000, "1e999", "-1e999", "1e-999", "NaN",
    "-Infinity", "nan", "-inf", "01", "0x10", "1_000", "1979-05-27", "'x'", "tru", "", "\0", "\ud800", "[1,2",
    '"\\ud800"', "1" + "0" * 308 + ".5",
)  # fmt: skip


def pick(rng: Generator, options: Sequence[Any]) -> Any:
    """Return one of the options."""
    return options[int(rng.integers(len(options)))]


def mutated(tree: Any, rng: Generator, strangers: Sequence[Any] = ()) -> Any:
    """Return a copy of a tree after one to four changes; parts of the trees ``strangers`` may be inserted."""
    holder = [copy.deepcopy(tree)]
    for _ in range(1 + int(rng.geometric(0.6)) if rng.random() < 0.5 else 1):
        _change(holder, rng, strangers)
    return holder[0]


def _places(holder: list[Any]) -> list[tuple[Any, Any]]:
    """Return all (container, key) of a tree."""
    found, left = [], [holder]
    while left:
        container: Any = left.pop()
        items = container.items() if isinstance(container, dict) else enumerate(container)
        for key, value in items:
            found.append((container, key))
            if isinstance(value, dict | list):
                left.append(value)
    return found


def _change(holder: list[Any], rng: Generator, strangers: Sequence[Any]) -> None:
    """Change one place; if the change does not apply to its value, insert a hostile value."""
    places = _places(holder)
    container, key = pick(rng, places)
    value = container[key]
    number = isinstance(value, int | float) and not isinstance(value, bool)
    match 10 if number and rng.random() < 0.4 else int(rng.integers(16)):
        case 0 | 1:
            container[key] = pick(rng, NUMBERS)
        case 2:
            container[key] = pick(rng, (None, True, False, [], {}, [[]], [None], {"": 0}))
        case 3:
            container[key] = pick(rng, TEXTS)
        case 4:
            container[key] = Raw(pick(rng, LITERALS))
        case 5 if container is not holder:
            del container[key]
        case 6 if isinstance(container, dict):
            container[Twin(key)] = pick(rng, (value, None, pick(rng, NUMBERS), pick(rng, TEXTS)))
        case 7 if isinstance(container, dict):
            container[pick(rng, (*TEXTS, *container))] = container.pop(key)
        case 8:
            other, there = pick(rng, places)
            if not (_holds(value, other) or _holds(other[there], container)):
                container[key], other[there] = other[there], value
        case 9 if isinstance(value, list):
            container[key] = pick(rng, (value[:-1], value[1:], value * 2, value * 100, value[::-1], [*value, 0]))
        case 10 | 11 if number:
            container[key] = value * pick(rng, (-1, 0, 1e-6, 0.5, 0.999, 1.001, 2, 3, 10, 1000, 10**6, 1e30))
        case 12 if number:
            container[key] = pick(rng, (str(value), float(value), value + 1, value - 1, value + 0.5, [value]))
        case 13:
            container[key] = pick(rng, ([value], {"value": value}, [value, value], str(value)[:200]))
        case 14 if isinstance(value, str):
            container[key] = pick(
                rng, (value + "\0", value.upper(), value[:-1], value + pick(rng, TEXTS), "../" + value)
            )
        case _ if strangers:
            inside, there = pick(rng, _places([pick(rng, strangers)]))
            container[key] = copy.deepcopy(inside[there])
        case _:
            container[key] = pick(rng, NUMBERS)


def _holds(tree: Any, wanted: Any) -> bool:
    """Return whether a container is a tree or part of it."""
    return tree is wanted or any(
        container is wanted or container[key] is wanted for container, key in _places([tree])
    )


def json_text(value: Any) -> str:
    """Return a tree as JSON, with double keys and raw text."""
    if isinstance(value, Raw):
        return str(value)
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(str(key))}: {json_text(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(json_text, value)) + "]"
    return json.dumps(value)


def toml_text(value: Any) -> str:
    """Return a tree as TOML, a line for each key of the root."""
    if not isinstance(value, dict):
        return f"value = {_inline(value)}"
    return "\n".join(f"{_quoted(key)} = {_inline(item)}" for key, item in value.items())


def _inline(value: Any) -> str:
    if isinstance(value, Raw):
        return str(value)
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_quoted(key)} = {_inline(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_inline, value)) + "]"
    if isinstance(value, float):
        return repr(value)
    return _quoted(value) if isinstance(value, str) or value is None else json.dumps(value)


def _quoted(text: Any) -> str:
    return json.dumps(str(text), ensure_ascii=False)
