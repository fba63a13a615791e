"""Progress of coding: encoder runs and frames of one call of `codec.encode` or `codec.decode`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

Report = Callable[[int, int, str], None]


@dataclass
class _Count:
    """Runs so far, and the largest number of runs that the search may take."""

    report: Report
    runs: int = 0
    most: int = 1

    @property
    def run(self) -> str:
        """The current run, and the largest number of runs; empty without a search."""
        return f"run {self.runs} of {self.most}" if self.most > 1 else ""


_current: ContextVar[_Count | None] = ContextVar("progress of coding", default=None)


@contextmanager
def reported(report: Report | None) -> Iterator[None]:
    """Report the runs and frames of this block, in this thread, as ``report(done, total, text)``."""
    token = _current.set(None if report is None else _Count(report))
    try:
        yield
    finally:
        _current.reset(token)


def runs_so_far() -> int:
    """Return the number of encoder runs begun."""
    count = _current.get()
    return 0 if count is None else count.runs


def run_begins(most: int = 0) -> None:
    """Count an encoder run; ``most`` is the largest number of runs, those so far included."""
    if (count := _current.get()) is not None:
        count.runs += 1
        count.most = max(count.most, most, count.runs)
        count.report(count.runs - 1, count.most, count.run)


def frames_done(done: int, total: int) -> None:
    """Report the frames of the current run, or of decoding."""
    if (count := _current.get()) is not None:
        count.report(done, total, ", ".join(filter(None, ["frames", count.run])))
