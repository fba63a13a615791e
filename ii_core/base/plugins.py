"""Loading of plugins: coders and measures that installed packages name by entry points."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from importlib.metadata import entry_points
from types import ModuleType
from typing import Any

from .interrupt import STOPS


def load_plugins(group: str, kind: str, register: Callable[[Any], object]) -> None:
    """Register what the entry points of a group name; an entry point that fails is a warning.

    Parameters
    ----------
    group : str
        Group of entry points, each an object for ``register``, its class, a list of them, or a module that
        registers its own.
    kind : str
        Kind of plugin, for the warning.
    register : callable
    """
    for entry in entry_points(group=group):
        try:
            found = entry.load()
            if isinstance(found, ModuleType):  # it has registered its own
                continue
            for one in found if isinstance(found, list | tuple) else [found]:
                register(one() if isinstance(one, type) else one)
        except STOPS:
            raise
        except BaseException as error:  # whatever a foreign package raises, SystemExit too, must not stop the others
            warnings.warn(f"{kind} plugin {entry.name} ({entry.value}) is not loaded: {error}", stacklevel=4)
