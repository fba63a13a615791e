"""Where the views of a light field really are: each one's departure from its place on the lattice.

Cameras of an array stand beside their places, and look aside. A view's entry has eight numbers: how far its camera
stands across and down from its place, so that disparity leads elsewhere; how far its picture is shifted across and
down; and how this shift grows across and down the picture, as by a turn of the camera. Entries count from the middle
view, which has zeros. The shift is constant within squares of 32×32 samples, as blocks are.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ii_core.base.jit import lean_kernel

from .arithmetic import code_number, code_raw, finish, new_contexts, overrun, reader, writer
from .transform import LARGEST

FIELDS = 8
ACROSS, DOWN, SHIFT, GROWTH = 0, 1, 2, 4  # places of an entry; two numbers of shift, four of its growth
PLACE_UNIT = 4  # of positions, in 2^-10 of a view
SHIFT_UNIT = 8  # of shifts, and of their growth over half the longer side of a view, in 2^-8 samples
MOST = 1 << 11  # of a number
DIGITS = 12
KINDS = np.array([0, 0, 1, 1, 2, 2, 2, 2])


class Rig(NamedTuple):
    """Departures of all views as they are used.

    Parameters
    ----------
    places : ndarray of int64, (J, 2)
        Of cameras across and down, in 2^-10 of a view.
    shifts : ndarray of int64, (J, 2 · squares)
        Of each square's samples across and down, in 2^-8 samples; nothing if all views are in their places.
    """

    places: NDArray[np.int64]
    shifts: NDArray[np.int64]


@lean_kernel
def _code_entries(coder, entries, middle):
    """Write or read all numbers but those of the middle view, by rows of one kind."""
    for k in range(entries.shape[1]):
        first = KINDS[k] * DIGITS
        for at in range(entries.shape[0]):
            if at != middle:
                size = code_number(coder, first, DIGITS, 0, abs(entries[at, k]))
                negative = code_raw(coder, 1 if entries[at, k] < 0 else 0) if size else 0
                entries[at, k] = -size if negative else size


def pack(entries: NDArray[np.int64], middle: int) -> bytes:
    """Return the bytes of a table of entries (J, `FIELDS`)."""
    coder = writer(new_contexts(3 * DIGITS), 8 * entries.size + 64)
    _code_entries(coder, entries.copy(), middle)
    return finish(coder)


def unpack(data: bytes, views: int, middle: int) -> NDArray[np.int64]:
    """Return the table of so many views.

    Raises
    ------
    ValueError
        If it ends early, or holds numbers that no encoder writes.
    """
    coder = reader(new_contexts(3 * DIGITS), data)
    entries = np.zeros((views, FIELDS), np.int64)
    _code_entries(coder, entries, middle)
    if overrun(coder) or abs(entries).max() > MOST:
        raise ValueError("the places of its views are damaged")
    return entries


def rig(entries: NDArray[np.int64], height: int, width: int) -> Rig:
    """Return departures of views of these sides from a table of entries."""
    side = max(height, width)
    down, across = (2 * np.arange(0, length, LARGEST) + LARGEST - length for length in (height, width))
    shifts = []
    for axis in (0, 1):
        start, by_x, by_y = (
            entries[:, field, None, None] for field in (SHIFT + axis, GROWTH + 2 * axis, GROWTH + 2 * axis + 1)
        )
        total = SHIFT_UNIT * (start * side + by_x * across[None, None, :] + by_y * down[None, :, None])
        shifts.append((total + side // 2) // side)
    return Rig(PLACE_UNIT * entries[:, : DOWN + 1], np.stack(shifts, axis=-1).reshape(len(entries), -1))


def departing(rows: NDArray[np.int64], own: int, numbers: Any, found: Rig) -> NDArray[np.int64]:
    """Return rows (R, 3) of references of a view with their departures from it, and columns of its shifts (R, 3 + …).

    ``own`` and ``numbers`` are the rig's indices of the view and of the references.
    """
    moved = rows.copy()
    moved[:, 1:3] += found.places[numbers] - found.places[own]
    return np.concatenate([moved, found.shifts[numbers] - found.shifts[own]], axis=1)
