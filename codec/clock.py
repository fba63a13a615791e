"""CPU time of a thread and of the encoders it drives, some of which work in threads of their own."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable

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

    Parameters
    ----------
    start : callable
        Opens the encoder.
    """

    def __init__(self, start: Callable[[], object]) -> None:
        self._process = time.process_time() - time.thread_time()
        with _opening:
            before = _threads()
            start()
            python = {thread.native_id for thread in threading.enumerate()}
            self._ids = _threads() - before - python

    def end(self) -> None:
        """Count what they took; to be called while they still live, that is before the encoder is closed."""
        if os.path.isdir(TASKS):
            # A Python thread that was just starting then had no number yet to know it by.
            ours = self._ids - {thread.native_id for thread in threading.enumerate()}
            seconds = sum(_seconds_of(number) for number in ours)
        else:
            seconds = time.process_time() - time.thread_time() - self._process
        spent_elsewhere(seconds)


def _seconds_of(number: int) -> float:
    """CPU seconds of a thread; none of one that has ended, which was not the encoder's then."""
    try:
        # The identity of a Linux thread's CPU clock: its complemented number, "per thread", "scheduler's".
        return time.clock_gettime(~number << 3 | 6)
    except OSError:
        return 0.0


def _threads() -> set[int]:
    return {int(name) for name in os.listdir(TASKS)} if os.path.isdir(TASKS) else set()
