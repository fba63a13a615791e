"""Where blocks of a picture are rendered: threads, the processes of an executor, the workers of a dask cluster.

The scene goes once to each process and Embree's trees are built there. Threads share it; a dask cluster gets it as a
task of its own, which its workers hand on among themselves and do again if the one that had it dies; the processes of
any other executor read it from a file, so they must share this machine's files.

Workers must run the code and the library versions of the process that renders, or blocks of one picture would not fit
together. Those of a cluster are compared before the first block; each block is refused by a worker that differs.
"""

from __future__ import annotations

import os
import pickle
import tempfile
import threading
import uuid
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, ThreadPoolExecutor
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

from ii_core.identity import library_versions, source_hash

from .job import Block, Job

Tile = tuple[slice, slice]
AHEAD = 3  # blocks under way for every worker: none waits, and few are kept until those before them are done
PACKAGES, LIBRARIES = ("ii_core", "raytrace_ii"), ("numpy", "numba", "embreex")  # what pixels depend on

_opened: dict[str, Job] = {}
_opening = threading.Lock()


def cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def check_executor(executor: Any, workers: int | None) -> None:
    """Raise ValueError unless this is something that runs calls, and workers are not given as well."""
    if executor is None:
        return
    if workers is not None:
        raise ValueError(f"workers is {workers}: an executor has its own, give one of the two")
    if not isinstance(executor, Executor) and _client(executor) is None:
        raise ValueError(f"executor is {executor!r}: a concurrent.futures executor or a dask client is needed")


def run(
    job: Job, tiles: Sequence[Tile], *, workers: int | None = None, executor: Any = None
) -> Generator[Block, None, None]:
    """Render blocks and yield them in their order.

    Raises
    ------
    OSError
        If worker processes die and the executor cannot replace them, if a worker runs other code, or if the scheduler
        of a cluster is lost.
    """
    with _crew(job, workers, executor) as (submit, width):
        waiting: deque[Any] = deque()
        todo = iter(tiles)
        try:
            while True:
                while len(waiting) < AHEAD * width and (tile := next(todo, None)) is not None:
                    waiting.append(submit(tile))
                if not waiting:
                    return
                yield waiting.popleft().result()
        except Exception as error:
            if isinstance(error, BrokenExecutor) or type(error).__name__ == "KilledWorker":
                raise OSError(
                    f"worker processes died while they rendered, out of memory or killed: the picture is not "
                    f"finished ({' '.join(str(error).split())})"
                ) from error
            if _client(executor) is not None and (
                isinstance(error, CancelledError) or type(error).__name__ in ("CommClosedError", "ClosedClientError")
            ):
                raise OSError("the dask scheduler was lost while it rendered: the picture is not finished") from error
            raise
        finally:
            for future in waiting:
                future.cancel()


@contextmanager
def _crew(job: Job, workers: int | None, executor: Any) -> Iterator[tuple[Callable[[Tile], Any], int]]:
    """How to have one block rendered, and how many are rendered at a time."""
    client = _client(executor)
    if executor is None:
        width = cores() if workers is None else workers
        with ThreadPoolExecutor(width) as pool:
            yield lambda tile: pool.submit(job.tile, *tile), width
    elif client is not None:
        check_workers(client)
        shared, ours = _shared(client, job), identity()
        width = max(1, sum(client.nthreads().values()))
        yield lambda tile: client.submit(_tile_of, shared, tile, ours, pure=False), width
    elif isinstance(executor, ThreadPoolExecutor):
        yield lambda tile: executor.submit(job.tile, *tile), executor._max_workers
    else:
        with tempfile.TemporaryDirectory(prefix="raytrace-ii-") as folder:
            file = Path(folder) / f"{uuid.uuid4().hex}.job"
            file.write_bytes(pickle.dumps(job, pickle.HIGHEST_PROTOCOL))
            width, ours = getattr(executor, "_max_workers", None) or cores(), identity()
            yield lambda tile: executor.submit(_tile_from, str(file), tile, ours), width


@lru_cache(maxsize=1)
def identity() -> dict[str, str]:
    """Return the hash of the code of this process, and the versions of the libraries that pixels depend on."""
    versions = library_versions(LIBRARIES)
    return {"code": source_hash(PACKAGES)[:12], **{name: versions.get(name, "none") for name in LIBRARIES}}


def check_workers(client: Any) -> None:
    """Raise OSError if a worker of a cluster runs other code or other versions of libraries."""
    for worker, theirs in client.run(identity, on_error="return").items():
        if isinstance(theirs, BaseException):
            raise OSError(f"dask worker {worker} is refused: it runs other code ({type(theirs).__name__}: {theirs})")
        check_identity(theirs, identity(), f"dask worker {worker}")


def check_identity(theirs: Mapping[str, str], ours: Mapping[str, str], worker: str) -> None:
    """Raise OSError unless the code and libraries of a worker are those of the process that renders."""
    if differ := [name for name in ours if theirs.get(name) != ours[name]]:
        each = ", ".join(f"{name} {theirs.get(name)} there, {ours[name]} here" for name in differ)
        raise OSError(f"{worker} is refused: {each}; the same code and libraries are needed on all workers")


def _client(executor: Any) -> Any:
    """The dask client that this is, or that stands behind it; None for others."""
    own = getattr(executor, "_client", executor)
    return own if hasattr(own, "scheduler_info") and hasattr(own, "nthreads") else None


def _shared(client: Any, job: Job) -> Any:
    """The job as a task, which dask can do again where `scatter`ed data would be lost with its worker."""
    data = pickle.dumps(job, pickle.HIGHEST_PROTOCOL)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Sending large graph")  # once, and then never more
        return client.submit(pickle.loads, data, pure=False)


def _tile_of(job: Job, tile: Tile, ours: Mapping[str, str]) -> Block:
    from distributed import get_worker

    check_identity(identity(), ours, f"dask worker {get_worker().address}")  # which may have joined late
    return job.tile(*tile)


def _tile_from(file: str, tile: Tile, ours: Mapping[str, str]) -> Block:
    """A block of the job in a file, which is read when this process first hears of it."""
    check_identity(identity(), ours, f"worker process {os.getpid()}")
    with _opening:
        if file not in _opened:
            _opened.clear()  # of the last picture
            try:
                _opened[file] = pickle.loads(Path(file).read_bytes())
            except FileNotFoundError:
                raise FileNotFoundError(
                    f"a worker process cannot read {file}: the processes of an executor must share the files of "
                    "the machine that renders"
                ) from None
        job = _opened[file]
    return job.tile(*tile)
