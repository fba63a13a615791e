"""Wrong values for every argument, and classification of the outcome of a call."""

from __future__ import annotations

import os
import re
import warnings
from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np

from .calls import Call


class Odd:
    """A class that no function accepts."""


WRONG = [
    *(None, True, 3, -1, 0, 1.5, 1e300, float("nan"), float("inf"), 10**400, "", "text", "\0", "é" * 5000),
    *(np.zeros(3), np.zeros((0, 3)), np.full((2, 2), np.nan), np.array("text"), np.array([None])),
    *((), {}, set(), (1, None), (-1, -1), (10**9, 10**9), ["a", "b"], [[1, 2], [3]], {1: 2}, {"a": None}),
    *(slice("a", None), object(), b"bytes", Odd(), 1j),
]


# Other words of messages for an argument.
SAID = {
    "coded": "coded|path", "options": "options?", "structure": "structure|lenses|ei_pixels",
    "path": "path|text|name|file|known \\w+ type|possible are", "folder": "folder|text|name",
    "source": "source|text|name|holds one view", "bodies": "bodies|object", "size_mm": "size_mm|lens of",
    "lenses": "lenses|lens", "name": "name|camera|scene|lens", "by_mm": "by_mm|z_mm",
    "value": "value|glass|ior", "kind": "kind|component image", "viewpoints": "viewpoint",
    "names": "names|measure", "low": "low|disparity", "high": "high|disparity",
    "kinds": "kinds|component image", "orders": "orders?",
    "data": "data|optical element|camera|picture|structure|lenses|ei_pixels", "dtype": "dtype|pixel type",
    "index": "index|frame", "place": "place|component image", "vertices": "vertices|vertex|object",
    "faces": "faces|face|object", "count": "count|viewpoints", "depth_mm": "depth_mm|depth",
    "views": "views|viewpoints", "cone": "cone|zone", "directions": "directions?|ray",
    "ei_pixels": "ei_pixels|elementary image|lenses of", "qp": "qp|scheme", "bpp": "bpp|scheme",
    "quality": "quality|scheme", "picture": "picture|name|file", "optics": "optics|element|optical",
    "study": "study|points", "regions": "regions?",
}  # fmt: skip
# Valid values that take too long: threads, and samples of 10⁹.
LONG = {"workers", "samples", "across", "runs", "count", "views", "max_depth"}
# Valid values that take seconds: depth from focus over default layers.
DEFAULTS = {("q_depth", "depth"), ("depth_from_focus", "layers_mm"), ("plot_all", "quality"), ("plot_all", "folder")}


def outcome(call: Call, argument: str, value: Any) -> str:
    """Return "taken", "refused", "path", or the fault of the error."""
    if argument in LONG and isinstance(value, int | float) and 1000 < value < float("inf") and value < 10**400:
        return "taken"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            call.function(**{**call.good, argument: value})
    except (TypeError, ValueError) as error:
        named = re.search(rf"\b({SAID.get(argument, argument)})", str(error))
        return "refused" if named else f"not named: {type(error).__name__}: {str(error)[:120]}"
    except IndexError as error:
        return "refused" if ": there are " in str(error) else f"IndexError: {str(error)[:120]}"
    except OSError as error:
        named = isinstance(value, str | os.PathLike | bytes) or value == ["a", "b"] or argument in str(error)
        return "path" if named else f"{type(error).__name__}: {str(error)[:120]}"
    except Exception as error:
        return f"{type(error).__name__}: {str(error)[:120]}"
    return "taken"


GOOD = {"taken", "refused", "path"}


def attack(named: Mapping[str, Call], wrong: list[Any]) -> tuple[Counter[str], list[str]]:
    """Try all values for all arguments; return counts and a line for each accidental error."""
    counts: Counter[str] = Counter()
    findings = []
    for name, call in named.items():
        for argument in call.good:
            for value in wrong:
                if (name, argument) in DEFAULTS and (value is None or (isinstance(value, str) and not value)):
                    continue
                end = outcome(call, argument, value)
                counts[end if end in GOOD else "accidental"] += 1
                if end not in GOOD:
                    shown = (
                        f"{type(value).__name__} {value!r:.30}" if type(value) is not int else f"int {value % 10**9}"
                    )
                    findings.append(f"{name}({argument}={shown}): {end}")
    return counts, findings
