"""Kernels of `demosaiced`: pixels of a colour from neighbours under the same lens."""

from __future__ import annotations

from typing import Any

from ..base.jit import exact_kernel, exact_stage_kernel

ROWS, COLS = (0, 0, 1, -1), (1, -1, 0, 0)  # directions: right, left, down, up


@exact_stage_kernel
def _inside(lens: Any, i: int, j: int) -> bool:
    return 0 <= i < lens.shape[0] and 0 <= j < lens.shape[1]


@exact_stage_kernel
def _same(lens: Any, i: int, j: int, me: int) -> bool:
    return 0 <= i < lens.shape[0] and 0 <= j < lens.shape[1] and lens[i, j] == me


@exact_kernel
def mean_of_neighbours(raw: Any, lens: Any, colours: Any, first: int, last: int, out: Any) -> None:
    """Fill rows: bilinear, or the mean of any neighbours where the lens has none of the colour."""
    for i in range(first, last):
        for j in range(raw.shape[1]):
            me, own = lens[i, j], colours[i % 2, j % 2]
            for channel in range(3):
                if channel == own:
                    out[i, j, channel] = raw[i, j]
                    continue
                total, weight, every, weights = 0.0, 0.0, 0.0, 0.0
                for down in range(-1, 2):
                    for right in range(-1, 2):
                        row, col = i + down, j + right
                        if _inside(lens, row, col) and colours[row % 2, col % 2] == channel:
                            share = 0.5 / (down * down + right * right)
                            every += share * raw[row, col]
                            weights += share
                            if lens[row, col] == me:
                                total += share * raw[row, col]
                                weight += share
                out[i, j, channel] = total / weight if weight > 0 else every / max(weights, 1e-9)


@exact_kernel
def green_by_direction(raw: Any, lens: Any, colours: Any, least: float, first: int, last: int, out: Any) -> None:
    """Fill green of rows; ``least`` is added to differences, so that noise does not choose a direction."""
    for i in range(first, last):
        for j in range(raw.shape[1]):
            if colours[i % 2, j % 2] == 1:
                out[i, j, 1] = raw[i, j]
                continue
            me, value = lens[i, j], raw[i, j]
            total, weight, near, nears, every, anys = 0.0, 0.0, 0.0, 0, 0.0, 0
            for way in range(4):
                row, col = i + ROWS[way], j + COLS[way]
                if not _inside(lens, row, col):
                    continue
                every += raw[row, col]
                anys += 1
                if lens[row, col] != me:
                    continue
                near += raw[row, col]
                nears += 1
                further, along = i + 2 * ROWS[way], j + 2 * COLS[way]
                if not _same(lens, further, along, me):
                    continue
                change = abs(value - raw[further, along])
                back, left = i - ROWS[way], j - COLS[way]
                if _same(lens, back, left, me):
                    change += abs(raw[row, col] - raw[back, left])
                share = 1.0 / (change + least) ** 2
                total += share * (raw[row, col] + 0.5 * (value - raw[further, along]))
                weight += share
            if weight > 0:
                out[i, j, 1] = total / weight
            elif nears > 0:
                out[i, j, 1] = near / nears
            else:
                out[i, j, 1] = every / max(anys, 1)


@exact_kernel
def red_and_blue(raw: Any, lens: Any, colours: Any, first: int, last: int, out: Any) -> None:
    """Fill red and blue of rows: green plus the mean difference of the neighbours from their green."""
    for i in range(first, last):
        for j in range(raw.shape[1]):
            me, own = lens[i, j], colours[i % 2, j % 2]
            for channel in range(0, 3, 2):
                if channel == own:
                    out[i, j, channel] = raw[i, j]
                    continue
                total, weight, every, weights = 0.0, 0.0, 0.0, 0.0
                for down in range(-1, 2):
                    for right in range(-1, 2):
                        row, col = i + down, j + right
                        if _inside(lens, row, col) and colours[row % 2, col % 2] == channel:
                            every += raw[row, col] - out[row, col, 1]
                            weights += 1
                            if lens[row, col] == me:
                                total += raw[row, col] - out[row, col, 1]
                                weight += 1
                difference = total / weight if weight > 0 else every / max(weights, 1.0)
                out[i, j, channel] = out[i, j, 1] + difference
