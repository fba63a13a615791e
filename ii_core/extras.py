"""Libraries of optional extras, imported on first use.

The wheel installs without them; an error names the extra that holds a missing one.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

# The extra of pyproject.toml that installs a library, and the library's name for pip.
EXTRAS = {
    "matplotlib": ("charts", "matplotlib"),
    "bjontegaard": ("charts", "bjontegaard"),
    "imagecodecs": ("coders", "imagecodecs"),
    "distributed": ("dask", "dask"),
}


class NotInstalled(ImportError):
    """A library of an extra is missing."""


def load(name: str) -> Any:
    """Return a module of a library in `EXTRAS`.

    Raises
    ------
    NotInstalled
        If the library is missing.
    """
    library = name.partition(".")[0]
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != library:
            raise
        extra, package = EXTRAS[library]
        raise NotInstalled(f"{package} is not installed: pip install 'raytrace-ii[{extra}]'") from None


class Lazy:
    """Module of a library in `EXTRAS`; its attributes load it."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, attribute: str) -> Any:
        return getattr(load(self._name), attribute)
