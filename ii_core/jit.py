"""How kernels are compiled: once, lazily, kept on disk, without the GIL.

numba's cache watches only a kernel's own file: a kernel that called one of another file would miss an edit there.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba


def kernel(function: Callable[..., Any], **options: Any) -> Any:
    """Compile on first call and keep the result, or just compile where nothing can be kept."""
    try:
        return numba.njit(cache=True, nogil=True, **options)(function)
    except RuntimeError:  # no folder to keep it in can be written
        return numba.njit(nogil=True, **options)(function)


def lean_kernel(function: Callable[..., Any], **options: Any) -> Any:
    """A kernel that makes no arrays, and so need not count references to those it is given.

    Where a function with several ways out is called, that counting is a locked instruction an array: 36 ns for a
    branch of 4. Nor is a division by zero caught: it gives infinity or NaN, as in numpy. A product and the sum that
    takes it may be one instruction, rounded once: a tenth of the time of shading.
    """
    return kernel(function, _nrt=False, error_model="numpy", fastmath={"contract"}, **options)


def inline_kernel(function: Callable[..., Any]) -> Any:
    """A kernel's own helper, copied into its caller."""
    return numba.njit(nogil=True, inline="always")(function)


def inner_kernel(function: Callable[..., Any]) -> Any:
    """A lean kernel whose machine code is copied into its callers': no call in the inmost loop.

    Unlike `inline_kernel`, which numba copies as source before it knows types, it may have several ways out.
    """
    return lean_kernel(function, forceinline=True)
