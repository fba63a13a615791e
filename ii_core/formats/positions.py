"""Camera positions in the names of views: order and directions of the grid, and the baseline.

The Stanford archive names views ``out_ROW_COLUMN_V_U.png``: two numbers of the grid, then the vertical and the
horizontal place of the camera in mm. U is taken to grow to the right. This settles which number runs across, in which
direction, and whether the grid is rotated by 180°. V grows upwards or downwards: pictures decide the vertical
direction, and V upwards is the assumption without detail in them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

CLEAR = 4.0  # times: a place changes along one number more than along the other
LEAST = 2  # cameras along both numbers


@dataclass(frozen=True, kw_only=True)
class Positions:
    """Grid of cameras as their places show it.

    Parameters
    ----------
    transposed, flip_across : bool
        As in an `Arrangement`.
    flip_down : bool
        As in an `Arrangement`, if V grows upwards.
    step_mm : (float, float)
        Mean distance from camera to camera, across and down.
    """

    transposed: bool
    flip_across: bool
    flip_down: bool
    step_mm: tuple[float, float]

    @property
    def baseline_mm(self) -> float:
        """Mean of both distances."""
        return float(np.mean(self.step_mm))


def positions(places: NDArray[np.float64]) -> Positions | None:
    """Return the grid of the places (V, U) of cameras, (A, B, 2) mm; None if they show none."""
    if min(places.shape[:2]) < LEAST:
        return None
    # Mean change of V and U along the first and the second number.
    along = np.array([np.diff(places, axis=axis).mean((0, 1)) for axis in (0, 1)])
    size = np.abs(along)
    if size[0, 0] > CLEAR * size[1, 0] and size[1, 1] > CLEAR * size[0, 1]:
        transposed, down, across = False, along[0, 0], along[1, 1]
    elif size[1, 0] > CLEAR * size[0, 0] and size[0, 1] > CLEAR * size[1, 1]:
        transposed, down, across = True, along[1, 0], along[0, 1]
    else:
        return None
    return Positions(
        transposed=transposed,
        flip_across=bool(across < 0),
        flip_down=bool(down > 0),
        step_mm=(float(abs(across)), float(abs(down))),
    )


def named_positions(fields: Sequence[Sequence[str]], at: Sequence[tuple[int, int]]) -> Positions | None:
    """Return the grid of the last two varying numbers with a decimal point in names; None if there are not two.

    Parameters
    ----------
    fields : sequence of sequence of str
        Number by number: its text in all names.
    at : sequence of (int, int)
        Place of every name in the grid.
    """
    decimal = [field for field in fields if all("." in text for text in field) and len(set(field)) > 1]
    if len(decimal) < 2:
        return None
    shape = [1 + max(place[axis] for place in at) for axis in (0, 1)]
    places = np.empty((*shape, 2))
    for n, (a, b) in enumerate(at):
        places[a, b] = float(decimal[-2][n]), float(decimal[-1][n])
    return positions(places)
