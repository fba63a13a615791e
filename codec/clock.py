"""CPU time of the calling thread and of the threads of its encoder."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from types import TracebackType
from typing import Any, TypeVar

from ii_core.base import interrupt

TASKS = "/proc/self/task"
Result = TypeVar("Result")

_elsewhere = threading.local()
_opening = threading.Lock()


def cpu_seconds() -> float:
    """Return CPU seconds of the calling thread and of encoders' threads, the latter up to `OwnThreads.end`."""
    return time.thread_time() + getattr(_elsewhere, "seconds", 0.0)


def spent_elsewhere(seconds: float) -> None:
    """Add CPU seconds of another thread or process to those of the calling thread."""
    _elsewhere.seconds = getattr(_elsewhere, "seconds", 0.0) + seconds


def interruptible(call: Callable[[], Result]) -> Result:
    """Call a function as `ii_core.base.interrupt.interruptible` does; its CPU time counts for the calling thread."""
    caller = threading.get_ident()

    def timed() -> tuple[Result, float]:
        result = call()
        return result, 0.0 if threading.get_ident() == caller else cpu_seconds()

    result, seconds = interrupt.interruptible(timed)
    spent_elsewhere(seconds)
    return result


class OwnThreads:
    """Threads that an encoder starts when it is opened, with their CPU time.

    Linux has a clock for each thread. Elsewhere the time of the process less the calling thread is used.

    As root, SVT-AV1 makes its threads and the calling thread real-time tasks of the highest priority, which starves
    other processes. `OwnThreads` restores the priority.

    Parameters
    ----------
    start : callable
        Opens the encoder.
    """

    def __init__(self, start: Callable[[], object]) -> None:
        self._process = time.process_time() - time.thread_time()
        with _opening, _usual_priority() as raised:
            before = _threads()
            start()
            python = {thread.native_id for thread in threading.enumerate()}
            self._ids = _threads() - before - python
            raised |= self._ids

    def end(self) -> None:
        """Add the CPU time of the threads; call it before the encoder is closed."""
        if os.path.isdir(TASKS):
            # Leave out Python threads that had no native id when the encoder was opened.
            ours = self._ids - {thread.native_id for thread in threading.enumerate()}
            seconds = sum(_seconds_of(number) for number in ours)
        else:
            seconds = time.process_time() - time.thread_time() - self._process
        spent_elsewhere(seconds)


class Workers:
    """Threads, or the calling thread alone if there is to be one. The result does not depend on their number."""

    def __init__(self, threads: int) -> None:
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None

    def __enter__(self) -> Workers:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._pool:
            self._pool.shutdown(cancel_futures=True)

    def map(self, function: Callable[..., Result], *columns: Iterable[Any]) -> list[Result]:
        """Return the function's results in order; CPU time counts as that of the calling thread."""
        if self._pool is None:
            return [function(*row) for row in zip(*columns, strict=True)]
        timed = list(self._pool.map(lambda *row: _timed(function, row), *columns))
        spent_elsewhere(sum(seconds for _, seconds in timed))
        return [result for result, _ in timed]


def _timed(function: Callable[..., Result], row: tuple[Any, ...]) -> tuple[Result, float]:
    started = time.thread_time()
    return function(*row), time.thread_time() - started


@contextmanager
def _usual_priority() -> Iterator[set[int]]:
    """Restore the present priority of the calling thread, also for the thread numbers added to the yielded set."""
    if not hasattr(os, "sched_setscheduler"):
        yield set()
        return
    usual = os.sched_getscheduler(0), os.sched_getparam(0)
    others: set[int] = set()
    try:
        yield others
    finally:
        for number in {0, *others}:
            with suppress(ProcessLookupError, PermissionError):  # the thread has ended, or a sandbox forbids the call
                os.sched_setscheduler(number, *usual)


def _seconds_of(number: int) -> float:
    """Return CPU seconds of a thread; 0 for a thread that has ended, which is none of the encoder's."""
    try:
        # The identity of a Linux thread's CPU clock: its complemented number, "per thread", "scheduler's".
        return time.clock_gettime(~number << 3 | 6)
    except OSError:
        return 0.0


def _threads() -> set[int]:
    return {int(name) for name in os.listdir(TASKS)} if os.path.isdir(TASKS) else set()
