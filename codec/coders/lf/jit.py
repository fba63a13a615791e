"""Compilation of this folder's kernels; their disk cache is valid while no file of the folder changes.

numba compares the time stamp of a kernel's own file with that in its cache. The kernels here call each other across
files, and the machine code of a callee is part of its caller's. The hash of all files with kernels and that of the
kernel's own file, which may be elsewhere, stand in for the time stamp.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from ii_core.base import jit

MARK = b"from .jit import"


@cache
def _folder_stamp() -> str:
    digest = hashlib.sha256()
    for file in sorted(Path(__file__).parent.glob("*.py")):
        text = file.read_bytes()
        if MARK in text:
            digest.update(text)
    return digest.hexdigest()


def _stamped(dispatcher: Any) -> Any:
    index: Any = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)
    if hasattr(index, "_source_stamp"):
        own = Path(dispatcher.py_func.__code__.co_filename)
        index._source_stamp = _folder_stamp() + hashlib.sha256(own.read_bytes()).hexdigest()
    return dispatcher


def kernel(function: Callable[..., Any]) -> Any:
    """A kernel that may make arrays."""
    return _stamped(jit.kernel(function, error_model="numpy"))


def lean(function: Callable[..., Any]) -> Any:
    """A kernel that makes no arrays; see `ii_core.base.jit.lean_kernel`."""
    return _stamped(jit.lean_kernel(function))


def inner(function: Callable[..., Any]) -> Any:
    """A lean kernel copied into its callers."""
    return _stamped(jit.inner_kernel(function))
