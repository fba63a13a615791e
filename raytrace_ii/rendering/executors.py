"""Execution of the tiles of a picture by threads, processes or a dask cluster; see `ii_core.base.executors`."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from functools import lru_cache
from typing import Any

from ii_core.base.executors import in_order, lost
from ii_core.base.identity import library_versions, source_hash

from .job import Block, Job

Tile = tuple[slice, slice]
PACKAGES, LIBRARIES = ("ii_core", "raytrace_ii"), ("numpy", "numba", "embreex")  # what pixels depend on


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
    try:
        yield from in_order(job.tile, tiles, identity=identity, workers=workers, executor=executor)
    except BaseException as error:
        job.stop()  # after an error, Ctrl-C or an early end: threads leave their blocks
        if isinstance(error, Exception) and (reason := lost(error, executor)) is not None:
            raise OSError(f"{reason} while it rendered: the picture is not finished") from error
        raise


@lru_cache(maxsize=1)
def identity() -> dict[str, str]:
    """Return the hash of the code of this process, and the versions of the libraries that pixels depend on."""
    versions = library_versions(LIBRARIES)
    return {"code": source_hash(PACKAGES)[:12], **{name: versions.get(name, "none") for name in LIBRARIES}}
