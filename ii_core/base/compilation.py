"""Notice of the compilation of kernels, from numba's events."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import event
from numba.core.caching import FunctionCache


class _First(event.Listener):
    """Listener for the first compilation."""

    def __init__(self, tell: Callable[[bool], None]) -> None:
        self.tell: Callable[[bool], None] | None = tell

    def on_start(self, event: Any) -> None:
        """Tell, once; numba has not found the kernel on the disk."""
        tell, self.tell = self.tell, None
        if tell is not None:
            tell(isinstance(event.data["dispatcher"]._cache, FunctionCache))

    def on_end(self, event: Any) -> None:
        """Do nothing."""


@contextmanager
def compilation_told(tell: Callable[[bool], None]) -> Iterator[None]:
    """Call ``tell(kept)`` when the block compiles its first kernel; ``kept`` is whether the disk will hold it."""
    listener = _First(tell)
    event.register("numba:compile", listener)
    try:
        yield
    finally:
        event.unregister("numba:compile", listener)
