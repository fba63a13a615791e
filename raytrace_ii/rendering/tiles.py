"""Tiles of a picture, and the order of rays within a tile.

Rays from one position under 4×4 neighbouring lenses have equal directions and origins one lens pitch apart; rays from
4×4 neighbouring pixels under one lens start close together and spread with distance. Those that are closer at the
content form a packet, see `nearness`. Tiles and order depend on camera and scene alone, so that all workers trace
the same packets.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ii_core import Camera
from ii_core.camera.lattice import Lattice

SIDE = 4  # lenses or pixels along each axis of a packet of 16 rays
# From this number of pixels per lens on, 4×4 neighbouring pixels are closer than pixels under 4×4 lenses.
LARGE_LENS = 96

Tile = tuple[slice, slice]
Integers = NDArray[np.int64]


class Order(NamedTuple):
    """Pixels of a tile in the order of their rays: C-order number, row and column; and the ray of each pixel."""

    pixels: NDArray[np.int32]
    rows: NDArray[np.int32]
    columns: NDArray[np.int32]
    rays: NDArray[np.int32]

    def in_place(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return values (n, ...) of rays in the order of the pixels: a take is 4 × as fast as writing by index."""
        return np.take(values, self.rays, axis=0, mode="clip")


def tiles(camera: Camera, rays: int, block: Tile | None = None, *, whole_lenses: bool = False) -> Iterator[Tile]:
    """Return tiles of at most ``most`` rays, in rows of tiles; those of a regular camera hold whole packets.

    They cover the picture, or a block of it. ``whole_lenses`` keeps the pixels under one lens of a regular camera in
    one tile, even if they are more.
    """
    down, right = block or (slice(0, camera.pixels[1]), slice(0, camera.pixels[0]))
    columns, rows = right.stop - right.start, down.stop - down.start
    cells = _regular_cells(camera) or (1, 1)
    across = min(columns, max(1, math.isqrt(rays)))
    height = _span(min(rows, max(1, rays // across)), cells[1], whole_lenses)
    width = _span(min(columns, max(1, rays // height)), cells[0], whole_lenses)
    for top in range(down.start, down.stop, height):
        for left in range(right.start, right.stop, width):
            yield slice(top, min(top + height, down.stop)), slice(left, min(left + width, right.stop))


def strips(camera: Camera, rays: int) -> Iterator[Tile]:
    """Return tiles as wide as the picture of a regular camera, of so many rays, or one row of packets at least."""
    columns, rows = camera.pixels
    unit = SIDE * (_regular_cells(camera) or (1, 1))[1]
    height = max(rays // columns // unit, 1) * unit
    for top in range(0, rows, height):
        yield slice(top, min(top + height, rows)), slice(0, columns)


def _span(most: int, cell: int, whole: bool) -> int:
    """Return the largest multiple of a packet's lenses, or of a lens, up to ``most`` pixels."""
    for unit in (SIDE * cell, cell):
        if unit <= most:
            return most // unit * unit
    return cell if whole else most


def ray_order(camera: Camera, rows: slice, cols: slice, by_lens: bool = False) -> Order:
    """Return the order of the rays of a tile: by position under the lens, then by blocks of 4×4 lenses.

    With ``by_lens`` it is lens by lens, along a Morton curve of the pixels under it. Under large lenses, or a single
    one, the order is by blocks of 4×4 pixels; for maps without lenses, by direction and origin.
    """
    shape = rows.stop - rows.start, cols.stop - cols.start
    lattice = _lattice(camera)
    if lattice is None:
        return _order(_along_rays(camera, rows, cols), shape[1])
    if max(lattice.pitch) > LARGE_LENS or lattice.lenses == (1, 1):
        return _in_cells(shape, (rows.start % SIDE, cols.start % SIDE), (1, 1))
    if cells := _regular_cells(camera):
        packet = cells[1] * SIDE, cells[0] * SIDE
        return _in_cells(shape, (rows.start % packet[0], cols.start % packet[1]), cells, by_lens)
    m, n = np.arange(cols.start, cols.stop)[None], np.arange(rows.start, rows.stop)[:, None]
    k, l = lattice.nearest(m, n)
    x, y = lattice.centres(k, l)
    u, v = (
        np.floor(at + 0.5 - centre + pitch / 2).clip(0, math.ceil(pitch) - 1).astype(np.int64)
        for at, centre, pitch in ((m, x, lattice.pitch[0]), (n, y, lattice.pitch[1]))
    )
    return _order((_lens_keys if by_lens else _keys)(k, l, u, v), shape[1])


@lru_cache(maxsize=64)
def _in_cells(shape: tuple[int, int], start: tuple[int, int], cells: tuple[int, int], by_lens: bool = False) -> Order:
    """Return the order of a tile of cells of equal size; its corner lies at ``start`` in the cells of a packet."""
    n, m = np.arange(shape[0])[:, None] + start[0], np.arange(shape[1])[None] + start[1]
    keys = _lens_keys if by_lens else _keys
    return _order(keys(m // cells[0], n // cells[1], m % cells[0], n % cells[1]), shape[1])


def _keys(k: Integers, l: Integers, u: Integers, v: Integers) -> Integers:
    """Return the ranks of pixels by position (u, v) under the lens, then by packet, its quarter and lens (k, l)."""
    across, down = k // SIDE - k.min() // SIDE, l // SIDE - l.min() // SIDE
    packet = down * (across.max() + 1) + across
    place = v * (u.max() + 1) + u
    quarter = l % SIDE // 2 * 2 + k % SIDE // 2  # of the packet: its four lenses share the packet of a few samples
    return ((place * (packet.max() + 1) + packet) * 4 + quarter) * 4 + l % 2 * 2 + k % 2


def _lens_keys(k: Integers, l: Integers, u: Integers, v: Integers) -> Integers:
    """Return the ranks of pixels by lens (k, l), then along a Morton curve of positions (u, v) under it."""
    size = int(max(u.max(), v.max())).bit_length()
    lens = (l - l.min()) * (k.max() - k.min() + 1) + k - k.min()
    place = sum((at >> bit & 1) << (2 * bit + axis) for axis, at in enumerate((u, v)) for bit in range(size))
    return (lens << 2 * size) | place


def _along_rays(camera: Camera, rows: slice, cols: slice) -> Integers:
    """Return the ranks of pixels by coarse direction, origin and fine direction, each along a Morton curve."""
    L, D = camera.rays(rows, cols)
    D = D / np.maximum(np.abs(D).sum(axis=2, keepdims=True), 1e-300)
    axes = np.argsort(np.ptp(L.reshape(-1, 3), axis=0))[1:]  # the two axes along which the origins spread most
    direction, origin = _morton(D[..., :2], 8), _morton(L[..., axes], 8)
    return ((direction >> 6) << 22) | (origin << 6) | (direction & 63)


def _morton(points: NDArray[np.float64], bits: int) -> Integers:
    """Return the ranks of points (h, w, 2) along a Morton curve of 2^bits cells across and down."""
    low, size = points.min(axis=(0, 1)), np.ptp(points, axis=(0, 1))
    cells = ((points - low) / np.where(size > 0, size, 1) * (2**bits - 1e-6)).astype(np.int64)
    return sum((cells[..., axis] >> bit & 1) << (2 * bit + axis) for bit in range(bits) for axis in (0, 1))


def _order(keys: Integers, width: int) -> Order:
    pixels = np.argsort(keys, axis=None, kind="stable")
    rays = np.empty_like(pixels)
    rays[pixels] = np.arange(len(pixels))
    # not made read-only: kernels would be compiled once more for such arrays
    return Order(*(part.astype(np.int32) for part in (pixels, pixels // width, pixels % width, rays)))


def _lattice(camera: Camera) -> Lattice | None:
    """Return the lenses of a camera; none for maps without lenses."""
    if camera.model is not None:
        return camera.model.lens_lattice
    return Lattice(camera.lenses, camera.ei_pixels, (0.0, 0.0), False) if camera.lenses != (1, 1) else None


def lens_cells(camera: Camera) -> tuple[int, int] | None:
    """Return the pixels across and down under one of several lenses, rounded down; None if a lens is large."""
    lenses = _lattice(camera)
    if lenses is None or lenses.lenses == (1, 1) or max(lenses.pitch) > LARGE_LENS:
        return None
    return int(lenses.pitch[0]), int(lenses.pitch[1])


def _regular_cells(camera: Camera) -> tuple[int, int] | None:
    """Return (U, V) of a camera of several lenses over whole pixels."""
    lenses = _lattice(camera)
    regular = lenses is not None and (camera.model is None or camera.model.regular) and camera.lenses != (1, 1)
    return (int(lenses.pitch[0]), int(lenses.pitch[1])) if lenses is not None and regular else None
