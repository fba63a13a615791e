"""How kernels are compiled: once, lazily, kept on disk, without the GIL.

numba's cache watches only a kernel's own file: a kernel that called one of another file would miss an edit there.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any

import numba
from numba.core.caching import FunctionCache


class Cache(FunctionCache):
    """numba's disk cache, with kernels compiled again where it cannot be read and left uncached where not written.

    A file may be cut short, name modules that have been renamed since (its time stamp is the source file's, which a
    renamed folder leaves as it was), or lie on a full disk. Unpickling fails in as many ways as there are bytes.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled kernel of a signature, None if there is none that can be read."""
        try:
            return super().load_overload(sig, target_context)
        except Exception:
            with contextlib.suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a compiled kernel if the disk takes it."""
        with contextlib.suppress(OSError):
            super().save_overload(sig, data)


def kernel(function: Callable[..., Any], **options: Any) -> Any:
    """Compile on first call and keep the result, or just compile where nothing can be kept."""
    compiled = numba.njit(nogil=True, **options)(function)
    with contextlib.suppress(RuntimeError):  # no folder to keep it in can be written
        compiled._cache = Cache(function)  # as numba's own enable_caching does
    return compiled


def lean_kernel(function: Callable[..., Any], **options: Any) -> Any:
    """A kernel that makes no arrays, and so need not count references to those it is given.

    Where a function with several ways out is called, that counting is a locked instruction an array: 36 ns for a
    branch of 4. Nor is a division by zero caught: it gives infinity or NaN, as in numpy. A product and the sum that
    takes it may be one instruction, rounded once: a tenth of the time of shading.
    """
    return kernel(function, _nrt=False, error_model="numpy", fastmath={"contract"}, **options)


def exact_kernel(function: Callable[..., Any]) -> Any:
    """A lean kernel that rounds after every operation: the same to the bit on every CPU."""
    return kernel(function, _nrt=False, error_model="numpy")


def inline_kernel(function: Callable[..., Any]) -> Any:
    """A kernel's own helper, copied into its caller."""
    return numba.njit(nogil=True, inline="always")(function)


def inner_kernel(function: Callable[..., Any]) -> Any:
    """A lean kernel whose machine code is copied into its callers': no call in the inmost loop.

    Unlike `inline_kernel`, which numba copies as source before it knows types, it may have several ways out.
    """
    return lean_kernel(function, forceinline=True)
