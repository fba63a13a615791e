"""Threads that share the views of a batch."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
from typing import Any, TypeVar

from ... import clock

Result = TypeVar("Result")


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
        clock.spent_elsewhere(sum(seconds for _, seconds in timed))
        return [result for result, _ in timed]


def _timed(function: Callable[..., Result], row: tuple[Any, ...]) -> tuple[Result, float]:
    started = time.thread_time()
    return function(*row), time.thread_time() - started
