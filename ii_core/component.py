"""Component images: lossless rearrangements of the II-picture.

With the picture as a light field ``ii.reshape(L, V, K, U, 3)[l, v, k, u]``:

- an elementary image EI_{k,l} holds what one lens sees (2.12),
- a sub-image SI_{u,v} holds one pixel from under every lens: one direction (2.13),
- a ray-space image RI_{v,l} is picture row l·V + v folded to K rows of U pixels (2.14). (The dissertation's
  §5.5.4 gives it L rows; by (2.14) it is K.)

All are stacks indexed by the component image first.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from .camera import Pair
from .picture import IIPicture

KINDS = ("ei", "si", "ri")


def elementary_images(picture: IIPicture) -> NDArray[Any]:
    """All elementary images, (L, K, V, U, 3), a copy: ``[l, k]`` is EI_{k,l} (2.12)."""
    return component_images(picture, "ei")


def sub_images(picture: IIPicture) -> NDArray[Any]:
    """All sub-images, (V, U, L, K, 3), a copy: ``[v, u]`` is SI_{u,v} (2.13)."""
    return component_images(picture, "si")


def ray_space_images(picture: IIPicture) -> NDArray[Any]:
    """All ray-space images, (V, L, K, U, 3), a copy: ``[v, l]`` is RI_{v,l} (2.14)."""
    return component_images(picture, "ri")


def component_images(picture: IIPicture, kind: str) -> NDArray[Any]:
    """The stack of one kind, ``"ei"``, ``"si"`` or ``"ri"``; see the function named after it.

    Raises
    ------
    ValueError
        If the kind is unknown.
    """
    field = light_field(picture.pixels, picture.lenses, picture.ei_pixels)
    out = np.empty(stack_shape(picture.lenses, picture.ei_pixels, kind), picture.pixels.dtype)
    _SPLIT[kind](field, out)
    return out


def picture_pixels(stack: NDArray[Any], kind: str) -> NDArray[Any]:
    """Picture pixels, (N, M, 3), from a stack of component images: the inverse of `component_images`.

    Raises
    ------
    ValueError
        If the kind is unknown or the stack does not have five axes, the last of three colours.
    """
    _check_kind(kind)
    if stack.ndim != 5 or stack.shape[-1] != 3:
        raise ValueError(f"component images are {stack.shape}: five axes, the last of length 3, are needed")
    a, b, c, d, _ = stack.shape
    l, v, k, u = {"ei": (a, c, b, d), "si": (c, a, d, b), "ri": (b, a, c, d)}[kind]
    out = np.empty((l * v, k * u, 3), stack.dtype)
    _JOIN[kind](np.ascontiguousarray(stack), out.reshape(l, v, k, u, 3))
    return out


def stack_shape(lenses: Pair, ei_pixels: Pair, kind: str) -> tuple[int, int, int, int, int]:
    """Shape of the stack of one kind for a structure of K×L lenses and U×V pixels."""
    _check_kind(kind)
    (k, l), (u, v) = lenses, ei_pixels
    return {"ei": (l, k, v, u, 3), "si": (v, u, l, k, 3), "ri": (v, l, k, u, 3)}[kind]


def light_field(pixels: NDArray[Any], lenses: Pair, ei_pixels: Pair) -> NDArray[Any]:
    """The picture seen as ``[l, v, k, u]``, without copying where memory order allows."""
    (k, l), (u, v) = lenses, ei_pixels
    return np.ascontiguousarray(pixels).reshape(l, v, k, u, 3)


def _check_kind(kind: str) -> None:
    if kind not in KINDS:
        raise ValueError(f"unknown component image {kind!r}: known are {', '.join(KINDS)}")


# Kernels read and write each cache line once: the inner loops run along the rows of both arrays.


@numba.njit(cache=True, nogil=True, parallel=True)
def split_ei(field, out):
    """out[l, k, v, i] = field[l, v, k, i], i running over the U·3 values of a run."""
    for l in numba.prange(field.shape[0]):
        for v in range(field.shape[1]):
            for k in range(field.shape[2]):
                for i in range(field.shape[3]):
                    out[l, k, v, i] = field[l, v, k, i]


@numba.njit(cache=True, nogil=True, parallel=True)
def join_ei(stack, field):
    """field[l, v, k, i] = stack[l, k, v, i], i running over the U·3 values of a run."""
    for l in numba.prange(field.shape[0]):
        for v in range(field.shape[1]):
            for k in range(field.shape[2]):
                for i in range(field.shape[3]):
                    field[l, v, k, i] = stack[l, k, v, i]


@numba.njit(cache=True, nogil=True, parallel=True)
def split_si(field, out):
    """out[v, u, l, k] = field[l, v, k, u]: one picture row stays in cache while U sub-image rows are written."""
    for l in numba.prange(field.shape[0]):
        for v in range(field.shape[1]):
            for u in range(field.shape[3]):
                for k in range(field.shape[2]):
                    for c in range(3):
                        out[v, u, l, k, c] = field[l, v, k, u, c]


@numba.njit(cache=True, nogil=True, parallel=True)
def join_si(stack, field):
    """field[l, v, k, u] = stack[v, u, l, k]."""
    for l in numba.prange(field.shape[0]):
        for v in range(field.shape[1]):
            for u in range(field.shape[3]):
                for k in range(field.shape[2]):
                    for c in range(3):
                        field[l, v, k, u, c] = stack[v, u, l, k, c]


def split_ri(field, out):
    """out[v, l, k, u] = field[l, v, k, u]: whole rows move, which numpy does at memory speed."""
    out[...] = field.transpose(1, 0, 2, 3, 4)


def join_ri(stack, field):
    """field[l, v, k, u] = stack[v, l, k, u]."""
    field[...] = stack.transpose(1, 0, 2, 3, 4)


def _runs(array: NDArray[Any]) -> NDArray[Any]:
    """The last two axes, U pixels of three values, as one."""
    return array.reshape(*array.shape[:3], -1)


_SPLIT: dict[str, Callable[..., None]] = {
    "ei": lambda field, out: split_ei(_runs(field), _runs(out)),
    "si": split_si,
    "ri": split_ri,
}
_JOIN: dict[str, Callable[..., None]] = {
    "ei": lambda stack, field: join_ei(_runs(stack), _runs(field)),
    "si": join_si,
    "ri": join_ri,
}
