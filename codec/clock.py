"""CPU time of a thread and of the encoders it drives, some of which work in threads of their own."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

TASKS = "/proc/self/task"

_elsewhere = threading.local()
_opening = threading.Lock()


def cpu_seconds() -> float:
    """CPU seconds of the calling thread, and of the encoders' threads that worked for it until `OwnThreads.end`."""
    return time.thread_time() + getattr(_elsewhere, "seconds", 0.0)


def spent_elsewhere(seconds: float) -> None:
    """Count CPU seconds that something else took for the calling thread."""
    _elsewhere.seconds = getattr(_elsewhere, "seconds", 0.0) + seconds


class OwnThreads:
    """The threads that an encoder starts when it is opened, watched for the CPU time they take.

    Linux tells the time of each thread. Elsewhere the process, less the calling thread, is taken for it.

    SVT-AV1, if it may, as root may, makes its threads and the one that calls it real-time tasks of the highest
    priority, for good: whatever else the machine does starves. They are put back.

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
        """Count what they took; to be called while they still live, that is before the encoder is closed."""
        if os.path.isdir(TASKS):
            # A Python thread that was just starting then had no number yet to know it by.
            ours = self._ids - {thread.native_id for thread in threading.enumerate()}
            seconds = sum(_seconds_of(number) for number in ours)
        else:
            seconds = time.process_time() - time.thread_time() - self._process
        spent_elsewhere(seconds)


@contextmanager
def _usual_priority() -> Iterator[set[int]]:
    """Give the calling thread, and those whose numbers are put in, the priority back that it has now."""
    if not hasattr(os, "sched_setscheduler"):
        yield set()
        return
    usual = os.sched_getscheduler(0), os.sched_getparam(0)
    others: set[int] = set()
    try:
        yield others
    finally:
        for number in {0, *others}:
            with suppress(ProcessLookupError, PermissionError):  # it has ended; a sandbox allows no such call at all
                os.sched_setscheduler(number, *usual)


def _seconds_of(number: int) -> float:
    """CPU seconds of a thread; none of one that has ended, which was not the encoder's then."""
    try:
        # The identity of a Linux thread's CPU clock: its complemented number, "per thread", "scheduler's".
        return time.clock_gettime(~number << 3 | 6)
    except OSError:
        return 0.0


def _threads() -> set[int]:
    return {int(name) for name in os.listdir(TASKS)} if os.path.isdir(TASKS) else set()
