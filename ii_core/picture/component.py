"""Component images: lossless rearrangements of the II-picture.

With the pixels in picture order, ``pixels.reshape(L, V, K, U, 3)[l, v, k, u]``:

- an elementary image EI_{k,l} is the pixels under one lens (2.12),
- a sub-image SI_{u,v} is one pixel from under every lens: one direction (2.13),
- a ray-space image RI_{v,l} is picture row l·V + v folded to K rows of U pixels (2.14). (§5.5.4 of the dissertation
  gives L rows; (2.14) gives K.)

The first two axes of a stack number the component image.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base import checks
from ..base.jit import kernel
from ..base.parallel import over_rows
from .picture import IIPicture, picture_order

KINDS = ("ei", "si", "ri")
_AXES = {"ei": (0, 2, 1, 3, 4), "si": (1, 3, 0, 2, 4), "ri": (1, 0, 2, 3, 4)}  # of the picture order
KIND = checks.instance(str)
SMALL = 1 << 20  # bytes; below, threads cost more time than they save


@checks.checked(picture=checks.instance(IIPicture))
def elementary_images(picture: IIPicture) -> NDArray[Any]:
    """Return all elementary images as a copy, (L, K, V, U, 3): ``[l, k]`` is EI_{k,l} (2.12)."""
    return component_images(picture, "ei")


@checks.checked(picture=checks.instance(IIPicture))
def sub_images(picture: IIPicture) -> NDArray[Any]:
    """Return all sub-images as a copy, (V, U, L, K, 3): ``[v, u]`` is SI_{u,v} (2.13)."""
    return component_images(picture, "si")


@checks.checked(picture=checks.instance(IIPicture))
def ray_space_images(picture: IIPicture) -> NDArray[Any]:
    """Return all ray-space images as a copy, (V, L, K, U, 3): ``[v, l]`` is RI_{v,l} (2.14)."""
    return component_images(picture, "ri")


@checks.checked(picture=checks.instance(IIPicture), kind=KIND)
def component_images(picture: IIPicture, kind: str) -> NDArray[Any]:
    """Return the stack of one kind: ``"ei"``, ``"si"`` or ``"ri"``; see the function of that name.

    Raises
    ------
    ValueError
        If the kind is unknown.
    """
    _check_kind(kind)
    picture.check_regular()
    return _permute(picture_order(picture.pixels, picture.lenses, picture.ei_pixels), kind, split=True)


@checks.checked(stack=checks.array, kind=KIND)
def picture_pixels(stack: NDArray[Any], kind: str) -> NDArray[Any]:
    """Return the picture pixels (N, M, 3) of a stack of component images: the inverse of `component_images`.

    Raises
    ------
    ValueError
        If the kind is unknown or the stack does not have five axes, the last of three colours.
    """
    _check_kind(kind)
    if stack.ndim != 5 or stack.shape[-1] != 3:
        raise ValueError(f"stack of component images is {stack.shape}: five axes, the last of length 3, are needed")
    field = _permute(stack, kind, split=False)
    l, v, k, u, _ = field.shape
    return field.reshape(l * v, k * u, 3)


def _check_kind(kind: str) -> None:
    if kind not in KINDS:
        raise ValueError(f"unknown component image {kind!r}: known are {', '.join(KINDS)}")


def _permute(source: NDArray[Any], kind: str, *, split: bool) -> NDArray[Any]:
    """Return pixels in picture order [l, v, k, u] as a stack of one kind, or the inverse, computed on all cores."""
    source = np.ascontiguousarray(source)
    order = _AXES[kind] if split else np.argsort(_AXES[kind])
    target = np.empty([source.shape[axis] for axis in order], source.dtype)
    move, a, b = swap_runs, source, target
    if kind == "ei":  # runs of U pixels
        a, b = (x.reshape(*x.shape[:3], -1) for x in (source, target))
    elif kind == "ri":  # runs of whole picture rows
        a, b = (x.reshape(1, *x.shape[:2], -1) for x in (source, target))
    else:
        move = split_si if split else join_si
    rows = a.shape[0] if move is split_si else target.shape[0] if move is join_si else a.shape[1]
    over_rows(partial(move, a, b), rows, workers=None if source.nbytes > SMALL else 1)
    return target


@kernel
def swap_runs(source, target, first, last):
    """target[a, c, b, i] = source[a, b, c, i] for b from first to last; it is its own inverse."""
    for a in range(source.shape[0]):
        for b in range(first, last):
            for c in range(source.shape[2]):
                for i in range(source.shape[3]):
                    target[a, c, b, i] = source[a, b, c, i]


# One picture row stays in cache while the U sub-image rows are written or read.
@kernel
def split_si(field, stack, first, last):
    """stack[v, u, l, k] = field[l, v, k, u] for l from first to last."""
    for l in range(first, last):
        for v in range(field.shape[1]):
            for u in range(field.shape[3]):
                for k in range(field.shape[2]):
                    for c in range(3):
                        stack[v, u, l, k, c] = field[l, v, k, u, c]


@kernel
def join_si(stack, field, first, last):
    """field[l, v, k, u] = stack[v, u, l, k] for l from first to last."""
    for l in range(first, last):
        for v in range(field.shape[1]):
            for u in range(field.shape[3]):
                for k in range(field.shape[2]):
                    for c in range(3):
                        field[l, v, k, u, c] = stack[v, u, l, k, c]
