"""Arrangement of a grid of views: horizontal axis, directions and disparity, from file names and pictures.

Views of other programs have two numbers (a, b). Their meaning is estimated from the pictures:

- **The horizontal number.** Between neighbours along it the scene moves sideways; along the other it moves
vertically.
- **The relative direction.** With numbers from left to right and from top to bottom, a point has the same disparity
  along both. If one number is reversed, the disparities have opposite signs.
- **The absolute direction** has no effect on shifts: a grid reversed along both axes shows the same shifts of a scene
  with inverted depth. Left to right is assumed, and the sign of the disparity is reported. If known depths contradict
  it, flip both axes.

Disparity is in view pixels per step. It is positive if a point moves to the left as the camera moves to the right (up
as it moves down): the point is nearer than the plane of zero disparity. This is the sign of the HCI benchmark.
"""

from __future__ import annotations

from collections.abc import Callable, Set
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.colour import KB, KG, KR

Floats = NDArray[np.float32]
Read = Callable[[int, int], NDArray[Any]]

SEARCHED_SIDE = 384  # pixels; larger views are shrunk to about this side
REACH = 0.25  # of the side: search range; matches at its end are rejected
FAR = 2  # pixels: sufficient disparity; below it, views farther apart are compared
BLOCK = 8
FEW = 12  # least number of moving blocks for an estimate
CLEAR = 1.0  # 8-bit codes: a block's best shift must beat its median by this plus twice its own cost
LEAN = 0.25  # relative difference of gains along the axes that decides between them


@dataclass(frozen=True, kw_only=True)
class Arrangement:
    """Meaning of the two numbers (a, b) of a view.

    Parameters
    ----------
    transposed : bool
        True if a is horizontal and b vertical.
    flip_down, flip_across : bool
        True if the vertical (horizontal) number counts from the bottom (from the right).
    disparity : (float, float) or None
        5th and 95th percentile of the disparity, pixels per step; None if not measurable.
    basis : str
        Which parts were given, estimated or assumed.
    """

    transposed: bool = False
    flip_down: bool = False
    flip_across: bool = False
    disparity: tuple[float, float] | None = None
    basis: str = "assumed"

    def grid(self, shape: tuple[int, int]) -> tuple[int, int]:
        """Return (columns, rows) of a grid of that many views along a and b."""
        return shape if self.transposed else (shape[1], shape[0])

    def place(self, a: int, b: int, shape: tuple[int, int]) -> tuple[int, int]:
        """Return the (row, column) of view (a, b) in the camera array, from the top left."""
        cols, rows = self.grid(shape)
        row, col = (b, a) if self.transposed else (a, b)
        return rows - 1 - row if self.flip_down else row, cols - 1 - col if self.flip_across else col

    def describe(self, grid: tuple[int, int] = (2, 2)) -> str:
        """Return the arrangement of a grid of (columns, rows), its basis and the disparity in one line."""
        across = "right to left" if self.flip_across else "left to right"
        down = "bottom to top" if self.flip_down else "top to bottom"
        first, second = (across, down) if self.transposed else (down, across)
        order = down if grid[0] == 1 else across if grid[1] == 1 else f"{first}, then {second}"
        line = f"numbers run {order} ({self.basis})"
        if self.disparity is None:
            return line
        low, high = self.disparity
        side = "behind" if high <= 0 else "before" if low >= 0 else "on both sides of"
        return f"{line}; disparity {low:+.2f} … {high:+.2f} px a step, {side} the plane where views agree"


def estimate(read: Read, shape: tuple[int, int], given: Arrangement, fixed: Set[str] = frozenset()) -> Arrangement:
    """Estimate the arrangement of a grid of views from some views around its middle.

    Parameters
    ----------
    read : callable
        Returns view (a, b) as (T, S, 3).
    shape : (int, int)
        Number of views along a and b.
    given : Arrangement
        Values where no estimate is possible.
    fixed : set of str
        Names among "transposed", "flip_down" and "flip_across" that are not estimated.
    """
    pairs = {axis: _pair(read, shape, axis) for axis in (0, 1) if shape[axis] > 1}
    seen: list[str] = []
    gains = {axis: (_moves(a, b)[2], _moves(a.T, b.T)[2]) for axis, (a, b, _) in pairs.items()}
    made = given
    if "transposed" not in fixed:
        # (a across, b down) against (a down, b across)
        swapped, straight = (sum(pair[axis ^ turn] for axis, pair in gains.items()) for turn in (0, 1))
        if abs(swapped - straight) > LEAN * (swapped + straight):
            made = replace(made, transposed=swapped > straight)
            seen.append("which runs across")
    across = 0 if made.transposed else 1
    maps = {axis: _map(a, b, scale, upright=axis == across) for axis, (a, b, scale) in pairs.items()}
    if (sign := _agreement(maps)) and not {"flip_down", "flip_across"} <= set(fixed):
        backwards = sign < 0
        if "flip_down" in fixed:
            made = replace(made, flip_across=made.flip_down ^ backwards)
        else:
            made = replace(made, flip_down=made.flip_across ^ backwards)
        seen.append("that one runs backwards" if backwards else "that both run the same way")
    free = [part for part in ("transposed", "flip_down", "flip_across") if part not in fixed]
    basis = f"seen: {', '.join(seen)}" if seen else "assumed" if free else "given"
    if seen and len(fixed & {"flip_down", "flip_across"}) == 0:
        basis += "; from the left is assumed"
    return replace(made, disparity=_range(maps, made, across), basis=basis)


def _pair(read: Read, shape: tuple[int, int], axis: int) -> tuple[Floats, Floats, float]:
    """Return two grey views along an axis with sufficient disparity, and view pixels per step of one grey pixel."""
    at = [count // 2 for count in shape]
    shrink = max(1, round(max(read(*at).shape[:2]) / SEARCHED_SIDE))

    def view(index: int) -> Floats:
        place = (index, at[1]) if axis == 0 else (at[0], index)
        return _grey(read(*place), shrink)

    step, widest = 1, shape[axis] - 1
    while True:
        first = min(at[axis], widest - step)
        a, b = view(first), view(first + step)
        if 2 * step > widest or max(_typical_motion(a, b), _typical_motion(a.T, b.T)) >= FAR:
            return a, b, shrink / step
        step *= 2


def _grey(view: NDArray[Any], shrink: int) -> Floats:
    """Return luma in 8-bit codes, averaged over squares of pixels."""
    grey = view.astype(np.float32) @ np.array([KR, KG, KB], np.float32)
    grey *= np.float32(255 if view.dtype.kind == "f" else 255 / np.iinfo(view.dtype).max)
    height, width = (side // shrink for side in grey.shape)
    return grey[: height * shrink, : width * shrink].reshape(height, shrink, width, shrink).mean((1, 3))


def _typical_motion(a: Floats, b: Floats) -> float:
    moved, weight, _ = _moves(a, b)
    return float(np.percentile(np.abs(moved[weight > 0]), 80)) if (weight > 0).any() else 0.0


def _moves(a: Floats, b: Floats) -> tuple[Floats, Floats, float]:
    """Return the shift to the left of each block of ``a`` in ``b``, its weight, and the gain of all shifts."""
    reach = int(max(1, min(a.shape[1] * REACH, a.shape[1] - 1)))
    block = [min(BLOCK, side) for side in a.shape]
    rows, cols = (side // size for side, size in zip(a.shape, block, strict=True))
    shifts = np.arange(-reach, reach + 1)
    costs = np.empty((len(shifts), rows, cols), np.float32)
    columns = np.arange(a.shape[1])
    for cost, shift in zip(costs, shifts, strict=True):
        difference = np.abs(a - b[:, np.clip(columns - shift, 0, a.shape[1] - 1)])
        tiles = difference[: rows * block[0], : cols * block[1]].reshape(rows, block[0], cols, block[1])
        cost[:] = tiles.mean((1, 3))
    least = costs.min(0)
    weight = np.median(costs, axis=0) - least
    moved = shifts[costs.argmin(0)].astype(np.float32)
    weight[(weight < CLEAR + 2 * least) | (np.abs(moved) == reach)] = 0
    moving = (weight > 0) & (moved != 0)
    gain = float((costs[reach] - least)[moving].sum()) if moving.sum() >= FEW else 0.0
    return moved, weight, gain


def _map(a: Floats, b: Floats, scale: float, *, upright: bool) -> tuple[Floats, Floats]:
    """Return the disparity of each block along its axis, pixels per step, and its weight, both upright."""
    moved, weight, _ = _moves(a, b) if upright else _moves(a.T, b.T)
    return (moved * scale, weight) if upright else (moved.T * scale, weight.T)


def _agreement(maps: dict[int, tuple[Floats, Floats]]) -> int:
    """Return 1 if the disparities along the two numbers agree, −1 if they are opposite, 0 if undecided."""
    if len(maps) < 2:
        return 0
    (p, wp), (q, wq) = maps[0], maps[1]
    weight = wp * wq
    energy = float(np.sqrt((weight * p**2).sum() * (weight * q**2).sum()))
    product = float((weight * p * q).sum())
    return int(np.sign(product)) if abs(product) > LEAN * energy else 0


def _range(maps: dict[int, tuple[Floats, Floats]], made: Arrangement, across: int) -> tuple[float, float] | None:
    for axis, flipped in ((across, made.flip_across), (1 - across, made.flip_down)):
        if axis in maps:
            d, weight = maps[axis]
            if (weight > 0).any():
                low, high = np.percentile(d[weight > 0], (5, 95))
                return (-float(high), -float(low)) if flipped else (float(low), float(high))
    return None
