"""Threads: the number of cores, and work on rows or items shared among them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any, TypeVar

Item = TypeVar("Item")


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def over_rows(work: Callable[[int, int], Any], rows: int, *, workers: int | None = None, step: int = 1) -> None:
    """Call ``work(first, last)`` on consecutive ranges of rows, one range a thread.

    The threads are Python's. On some platforms numba's own threads abort when two callers meet.

    Parameters
    ----------
    work : callable
        A kernel that releases the interpreter lock, or a function of numpy.
    rows : int
        Number of rows; ``last`` is at most this.
    workers : int, optional
        Number of threads; `cores` if not given.
    step : int
        Ranges start at multiples of it.

    Raises
    ------
    Exception
        The first one that ``work`` raises.
    """
    steps = -(-rows // step)
    count = max(1, min(cores() if workers is None else workers, steps))
    bounds = [min(steps * i // count * step, rows) for i in range(count + 1)]
    if count == 1:
        work(0, rows)
        return
    with ThreadPoolExecutor(count) as pool:
        for done in [pool.submit(work, first, last) for first, last in pairwise(bounds)]:
            done.result()


def for_each(work: Callable[[Item], Any], items: Iterable[Item], *, workers: int | None = None) -> None:
    """Call ``work`` on every item in threads; an error or an interrupt drops the items not yet begun.

    Parameters
    ----------
    work : callable
    items : iterable
    workers : int, optional
        Number of threads; `cores` if not given.

    Raises
    ------
    Exception
        The first one that ``work`` raises, in the order of the items.
    """
    pool = ThreadPoolExecutor(cores() if workers is None else workers)
    try:
        for future in [pool.submit(work, item) for item in items]:
            future.result()
    finally:
        pool.shutdown(cancel_futures=True)
