"""Option ``--dask``: rendering on a cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Annotated, Any

import typer

ANSWER_SECONDS = 5  # until which a scheduler has to answer
Dask = Annotated[str | None, typer.Option(help="Work on the cluster of this dask scheduler: host:port.")]


@contextmanager
def cluster(address: str | None, identity: Callable[[], Mapping[str, str]]) -> Iterator[Any]:
    """Yield a client of a dask scheduler whose workers run this code, closed at the end; None without an address."""
    if address is None:
        yield None
        return
    import logging

    from ii_core.base.executors import check_workers
    from ii_core.base.extras import load

    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # our one line reports a lost scheduler
    load("distributed")
    try:
        _check_address(address)
        client = load("distributed").Client(address, timeout=ANSWER_SECONDS, set_as_default=False)
    except (OSError, ValueError, TypeError, RuntimeError, ImportError) as error:  # also tls:// without certificates
        raise OSError(f"no dask scheduler answers at {address}: {error}") from None
    try:
        client.wait_for_workers(1, timeout=30)
    except TimeoutError:
        client.close()
        raise OSError(f"the dask scheduler at {address} has no workers") from None
    with client:
        check_workers(client, identity)  # before the output is opened
        yield client


def _check_address(address: str) -> None:
    """Raise ValueError for a malformed address: a half-made client would print errors when the process ends."""
    from distributed.comm.addressing import get_address_host_port, parse_address
    from distributed.comm.registry import get_backend
    from distributed.security import Security

    scheme, _ = parse_address(address)
    get_backend(scheme)
    get_address_host_port(address)
    if scheme == "tls" and Security().get_connection_args("client").get("ssl_context") is None:
        raise ValueError("no TLS certificates are configured for dask")


def check_cluster(workers: int | None, dask: str | None, plugin: Any) -> None:
    """Raise ValueError for options of threads and of a cluster that exclude each other."""
    if dask and workers is not None:
        raise ValueError("--workers is for threads of this machine: leave it out with --dask")
    if workers is not None and workers < 1:
        raise ValueError(f"workers is {workers}: at least 1 is needed")
    if dask and plugin:
        raise ValueError("--plugin is for this machine alone: with --dask, install it as a package on all workers")
