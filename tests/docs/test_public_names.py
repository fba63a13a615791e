"""Public names of the packages and their parameters: programs written for 1.0 run with every 1.x."""

from __future__ import annotations

import inspect
from pathlib import Path

import codec
import ii_core
import metrics
import raytrace_ii

LIST = Path(__file__).parent / "public_names.txt"
LISTED = LIST.read_text(encoding="utf-8").splitlines()


def signature(value):
    """Return the parameters that a caller can name, optional ones with an equals sign; constants have none."""
    if not callable(value):
        return ""
    try:
        parameters = inspect.signature(value).parameters.values()
    except ValueError:
        return "()"
    named = [p for p in parameters if not p.name.startswith("_")]
    stars = {inspect.Parameter.VAR_POSITIONAL: "*", inspect.Parameter.VAR_KEYWORD: "**"}
    keyword, words = False, []
    for p in named:
        if p.kind == inspect.Parameter.KEYWORD_ONLY and not keyword:
            keyword = True
            words.append("*")
        words.append(stars.get(p.kind, "") + p.name + ("=" if p.default is not inspect.Parameter.empty else ""))
    return f"({', '.join(words)})"


def test_public_names_and_their_parameters_are_those_listed():
    """A name that goes, or a parameter that moves, breaks programs of users: that needs 2.0.

    New names and new optional parameters are added to the list.
    """
    packages = (ii_core, raytrace_ii, codec, metrics)
    found = [
        f"{package.__name__}.{name}{signature(getattr(package, name))}"
        for package in packages
        for name in sorted(package.__all__)
    ]
    assert found == LISTED
