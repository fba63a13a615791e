"""Libraries imported on first use: those of optional extras, and modules that take long to import.

The wheel installs without the extras; an error names the one that holds a missing library.
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
    "h5py": ("arrays", "h5py"),
    "imageio_ffmpeg": ("anchors", "imageio-ffmpeg"),
}


class NotInstalled(ImportError):
    """A library of an extra is missing."""


def load(name: str) -> Any:
    """Return a module.

    Raises
    ------
    NotInstalled
        If its library is in `EXTRAS`, and missing.
    """
    library = name.partition(".")[0]
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if library not in EXTRAS or (error.name or "").partition(".")[0] != library:
            raise
        extra, package = EXTRAS[library]
        raise NotInstalled(f"{package} is not installed: pip install 'raytrace-ii[{extra}]'") from None


class Lazy:
    """Module whose attributes load it."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, attribute: str) -> Any:
        return getattr(load(self._name), attribute)
