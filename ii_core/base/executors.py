"""Execution of calls by threads, processes of an executor, or workers of a dask cluster.

The work, a callable with its data, goes once to each process. Threads share it; a dask cluster gets it as a task of
its own, which its workers hand on among themselves and do again if the one that had it dies; the processes of any
other executor read it from a file, so they must share this machine's files.

Workers must run the code and the library versions of the process that gives the calls, or results would not fit
together. Workers of a cluster are compared before the first call; each call is refused by a worker that differs.
"""

from __future__ import annotations

import os
import pickle
import queue
import tempfile
import threading
import uuid
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures import BrokenExecutor, CancelledError, Executor, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from .extras import load
from .parallel import cores

Work = Callable[..., Any]
Identity = Callable[[], Mapping[str, str]]  # code and libraries of a process; a function of a module
AHEAD = 3  # calls under way for every worker: none waits, and few are kept until those before them are done

_opened: dict[str, Work] = {}
_opening = threading.Lock()


def check_executor(executor: Any, workers: int | None) -> None:
    """Raise ValueError unless this is something that runs calls, and workers are not given as well."""
    if executor is None:
        return
    if workers is not None:
        raise ValueError(f"workers is {workers}: an executor has its own, give one of the two")
    if not isinstance(executor, Executor) and client_of(executor) is None:
        raise ValueError(f"executor is {executor!r}: a concurrent.futures executor or a dask client is needed")


def in_order(
    work: Work, items: Iterable[tuple[Any, ...]], *, identity: Identity, workers: int | None, executor: Any
) -> Generator[Any, None, None]:
    """Yield ``work(*item)`` for every item, in order; few calls are under way at a time.

    Raises
    ------
    OSError
        If a worker runs other code. What the work raises comes through, and what the executor raises: see `lost`.
    """
    with crew(work, workers, executor, identity) as (submit, width):
        waiting: deque[Any] = deque()
        todo = iter(items)
        try:
            while True:
                while len(waiting) < AHEAD * width and (item := next(todo, None)) is not None:
                    waiting.append(submit(item))
                if not waiting:
                    return
                yield waiting.popleft().result()
        finally:
            for future in waiting:
                future.cancel()


def as_they_come(
    work: Work, items: Iterable[tuple[Any, ...]], *, identity: Identity, workers: int | None, executor: Any
) -> Generator[tuple[int, Any], None, None]:
    """Yield the number of an item and ``work(*item)``, whichever is done first; errors as of `in_order`."""
    with crew(work, workers, executor, identity) as (submit, width):
        done: queue.SimpleQueue[int] = queue.SimpleQueue()
        running: dict[int, Any] = {}
        todo = iter(enumerate(items))
        try:
            while True:
                while len(running) < AHEAD * width and (numbered := next(todo, None)) is not None:
                    number, item = numbered
                    running[number] = submit(item)
                    running[number].add_done_callback(lambda _, number=number: done.put(number))
                if not running:
                    return
                number = done.get()
                yield number, running.pop(number).result()
        finally:
            for future in running.values():
                future.cancel()


def lost(error: Exception, executor: Any) -> str | None:
    """Return what became of the workers, in words, if an error of the executor says so; None for other errors."""
    if isinstance(error, BrokenExecutor) or type(error).__name__ == "KilledWorker":
        return f"worker processes died, out of memory or killed ({' '.join(str(error).split())})"
    gone = isinstance(error, CancelledError) or type(error).__name__ in ("CommClosedError", "ClosedClientError")
    return "the dask scheduler was lost" if gone and client_of(executor) is not None else None


@contextmanager
def crew(
    work: Work, workers: int | None, executor: Any, identity: Identity
) -> Iterator[tuple[Callable[[tuple[Any, ...]], Any], int]]:
    """Function that submits one item, and the number of items in work at a time."""
    client = client_of(executor)
    if executor is None:
        width = cores() if workers is None else workers
        pool = ThreadPoolExecutor(width)
        try:
            yield lambda item: pool.submit(work, *item), width
        finally:  # at the end no call is under way; Ctrl-C and errors wait for none
            pool.shutdown(wait=False, cancel_futures=True)
    elif client is not None:
        check_workers(client, identity)
        shared, ours = _shared(client, work), identity()
        width = max(1, sum(client.nthreads().values()))
        yield lambda item: client.submit(_on_cluster, shared, item, identity, ours, pure=False), width
    elif isinstance(executor, ThreadPoolExecutor):
        yield lambda item: executor.submit(work, *item), executor._max_workers
    else:
        with tempfile.TemporaryDirectory(prefix="raytrace-ii-") as folder:
            file = Path(folder) / f"{uuid.uuid4().hex}.job"
            file.write_bytes(pickle.dumps(work, pickle.HIGHEST_PROTOCOL))
            width, ours = getattr(executor, "_max_workers", None) or cores(), identity()
            yield lambda item: executor.submit(in_process, str(file), item, identity, ours), width


def check_workers(client: Any, identity: Identity) -> None:
    """Raise OSError if a worker of a cluster runs other code or other versions of libraries."""
    for worker, theirs in client.run(identity, on_error="return").items():
        if isinstance(theirs, BaseException):
            raise OSError(f"dask worker {worker} is refused: it runs other code ({type(theirs).__name__}: {theirs})")
        check_identity(theirs, identity(), f"dask worker {worker}")


def check_identity(theirs: Mapping[str, str], ours: Mapping[str, str], worker: str) -> None:
    """Raise OSError unless the code and libraries of a worker are those of the process that gives the calls."""
    if differ := [name for name in ours if theirs.get(name) != ours[name]]:
        each = ", ".join(f"{name} {theirs.get(name)} there, {ours[name]} here" for name in differ)
        raise OSError(f"{worker} is refused: {each}; the same code and libraries are needed on all workers")


def client_of(executor: Any) -> Any:
    """The dask client that this is, or that stands behind it; None for others."""
    own = getattr(executor, "_client", executor)
    return own if hasattr(own, "scheduler_info") and hasattr(own, "nthreads") else None


def _shared(client: Any, work: Work) -> Any:
    """The work as a task, which dask can do again where `scatter`ed data would be lost with its worker."""
    data = pickle.dumps(work, pickle.HIGHEST_PROTOCOL)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Sending large graph")  # once, and then never more
        return client.submit(pickle.loads, data, pure=False)


def _on_cluster(work: Work, item: tuple[Any, ...], identity: Identity, ours: Mapping[str, str]) -> Any:
    check_identity(
        identity(), ours, f"dask worker {load('distributed').get_worker().address}"
    )  # which may have joined late
    return work(*item)


def in_process(file: str, item: tuple[Any, ...], identity: Identity, ours: Mapping[str, str]) -> Any:
    """Call the work in a file, which is read when this process first gets it."""
    check_identity(identity(), ours, f"worker process {os.getpid()}")
    with _opening:
        if file not in _opened:
            _opened.clear()  # of the last run
            try:
                _opened[file] = pickle.loads(Path(file).read_bytes())
            except FileNotFoundError:
                raise FileNotFoundError(
                    f"a worker process cannot read {file}: the processes of an executor must share the files of "
                    "the machine that gives the calls"
                ) from None
        work = _opened[file]
    return work(*item)
