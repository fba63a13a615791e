"""Nearest faces of camera rays that are parallel from lens to lens: views, rasterised instead of traced.

Embree takes 30–60 ns for a camera ray of a picture of 512×256 lenses, and some 900 in hair. The rays of one place
under all lenses are parallel where a camera is even, and stand on a lattice: `kernels.raster` finds their nearest
faces as a renderer of triangles does.
"""

from __future__ import annotations

import math
import mmap
import threading
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .kernels.lanes import BLOCK, aligned
from .kernels.raster import CHUNK, GROUP, LENSES, MOST_FACES, OFFSET, ROOM, SLOPE, draw_faces, list_faces, read_faces

# Largest deviation of an even camera's rays: of origins in lens pitches, of directions in lengths of a ray a lens.
EVEN_PLACE, EVEN_WAY = 1e-7, 1e-11
_SPARE = 6  # chunks behind a line of the buffer: lines of a power of two would share few places of the cache
_NOWHERE = 1e12  # lens pitches off: of views that fill up a room

# Costs in rows of faces, each drawn in all views of a row of lenses in 100 ns. A face that is looked at takes 80 ns;
# Embree takes 110 ns for a ray where packets spread, and 1.3 ns more for each face whose box in the view the ray
# meets: 1200 in hair (CPU time of eight scenes at scales 2–16 of setup1, beside other jobs, 2026-11-26).
ROWS_OF_FACE, MOST_ROWS, ROWS_OF_BOX = 0.8, 1.1, 0.013

Floats = NDArray[np.float64]
_NONE = np.empty(0)


class Views(NamedTuple):
    """Camera rays as views: offsets and slopes of columns (across) and rows (down) of a lens, see `kernels.raster`.

    Those of pixels' centres come first, then those of each plane: one place in each pixel under a lens, ``planes``
    (N, U) and (N, V), in pixels from the centres; the centres if there are none. Planes lie at most ``spread`` (2, 2)
    from the centres: offsets and slopes, across and down. ``turn`` (12,) leads from the scene's millimetres to lenses
    across and down and lengths of a ray.
    """

    across: list[Floats]
    down: list[Floats]
    planes: tuple[Floats, Floats] | tuple[()]
    spread: Floats
    places: tuple[int, int]
    lenses: tuple[int, int]
    turn: Floats


def parallel_views(
    rays: tuple[Floats, ...], lenses: tuple[int, int], pose: Floats, planes: tuple[Floats, Floats] | tuple[()] = (),
    steps: Floats = _NONE,
) -> Views | None:  # fmt: skip
    """Return the views of a camera; None if its rays of one place are not parallel, or off an even lattice.

    Parameters
    ----------
    rays : tuple of ndarray
        Those of `IICamera.separable_rays`.
    lenses : (int, int)
        Lenses across and down.
    pose : (4, 4) float
        Rigid transform from the camera's frame to the scene's.
    planes : pair of (N, U) and (N, V) float, optional
        As in `Views`.
    steps : (2, 2) float
        How the coordinates of a ray's start and direction grow by a pixel, across and down.
    """
    x, y, (start, ahead) = rays
    rooms: list[list[Floats]] = []
    places, turn, spread = [], np.empty((3, 4)), np.zeros((2, 2))
    for axis, (coordinates, count) in enumerate(zip((x, y), lenses, strict=True)):
        if count < 2 or len(coordinates) % count or not ahead:
            return None
        table = coordinates.reshape(count, -1, 2)
        first, pitch = table[0], (table[-1, :, 0] - table[0, :, 0]).mean() / (count - 1)
        even = first[:, 0] + pitch * np.arange(count)[:, None]
        if not (
            np.abs(table[:, :, 0] - even).max() <= EVEN_PLACE * abs(pitch)
            and np.abs(table[:, :, 1] - first[:, 1]).max() <= EVEN_WAY * abs(ahead)
            and pitch
        ):
            return None
        moved = [first + place[:, None] * steps[axis] for place in planes[axis]] if planes else [first]
        spread[axis] = np.max(np.abs(np.array(moved) - first), axis=(0, 1)) / abs(pitch)
        rooms.append([_room(views / pitch) for views in (first, *moved)])
        places.append(len(first))
        turn[axis] = _row(pose, axis, 0.0, pitch)
    turn[2] = _row(pose, 2, start, ahead)
    return Views(rooms[0], rooms[1], planes, spread, (places[0], places[1]), lenses, turn.reshape(-1))


def _room(views: Floats) -> Floats:
    """Return rooms for views of given offsets and slopes (views, 2)."""
    room = np.zeros((-(-len(views) // BLOCK), ROOM // BLOCK, BLOCK))
    of_views = np.full((2, room.shape[0] * BLOCK), [[_NOWHERE], [0.0]])
    of_views[:, : len(views)] = views.T
    room[:, [OFFSET // BLOCK, SLOPE // BLOCK]] = of_views.reshape(2, -1, BLOCK).swapaxes(0, 1)
    return room.reshape(-1)


def _row(pose: Floats, axis: int, start: float, unit: float) -> Floats:
    """Return what leads from the scene's coordinates to the camera's along an axis, from a start, in a unit."""
    way = pose[:3, axis]
    return np.append(way, -(way @ pose[:3, 3]) - start) / unit


def _pages(count: int) -> mmap.mmap:
    """Return room for numbers that goes back to the system, not to the heap, when it is let go."""
    if hasattr(mmap, "MADV_DONTNEED"):
        return mmap.mmap(-1, 4 * max(count, 1), flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    return mmap.mmap(-1, 4 * max(count, 1))


def _moved(pages: mmap.mmap, start: int, end: int) -> NDArray[np.uint32]:
    """Return numbers of the pages in pages of their own; those that held nothing else are given back at once."""
    own = np.frombuffer(_pages(end - start), np.uint32)[: end - start]
    own[:] = np.frombuffer(pages, np.uint32)[start:end]
    first, last = -(-4 * start // mmap.PAGESIZE) * mmap.PAGESIZE, 4 * end // mmap.PAGESIZE * mmap.PAGESIZE
    if hasattr(mmap, "MADV_DONTNEED") and last > first:
        pages.madvise(mmap.MADV_DONTNEED, first, last - first)
    return own


class Raster:
    """Nearest faces of the rays of a picture, found view by view.

    `pays` tells whether that is faster than to trace them, from counts alone: the same on every machine. Only then
    can it return `faces`, for each of its ``planes``.

    Parameters
    ----------
    views : Views
    corners : (F, 3, 3) float32
        Of faces, in mm.
    first_of_same : (F,) or (0,) int32
        The face that counts of those in the same place.
    """

    def __init__(self, views: Views, corners: NDArray[np.float32], first_of_same: NDArray[np.int32]) -> None:
        self.views, self._corners, self._first_of_same = views, corners.reshape(-1), first_of_same
        rays, (columns, _) = math.prod(views.lenses) * math.prod(views.places), views.places
        self.planes = len(views.across) - 1
        # samples of a pixel are nearer to each other, the more there are; faces are looked at once for all planes
        most, looks = MOST_ROWS / self.planes**0.5, ROWS_OF_FACE * len(corners) / self.planes
        self.pays = len(corners) < MOST_FACES and looks <= most * rays
        if not self.pays:
            return
        self._groups, self._views_down = -(-views.lenses[1] // GROUP), len(views.down[0]) // ROOM * BLOCK
        self._ends = np.zeros(self._groups * self._views_down, np.int64)
        rows, boxes = self._list(self._ends, np.empty(0, np.uint32))
        rows *= len(views.across[0]) // ROOM
        self.pays = rows + looks <= most * rays + ROWS_OF_BOX * boxes * columns
        self._lists: dict[int, NDArray[np.uint32]] = {}
        self._unseen = dict.fromkeys(range(self._groups), 0)
        self._lock = threading.Lock()

    def _list(self, places: NDArray[np.int64], entries: NDArray[np.uint32]) -> tuple[int, int]:
        views, counts = self.views, np.zeros(2, np.int64)
        list_faces(
            self._corners, self._first_of_same, views.turn, views.across[0].copy(), views.down[0].copy(),
            views.spread, views.lenses, places, entries, counts,
        )  # fmt: skip
        return int(counts[0]), int(counts[1])

    def _entries(self, group: int) -> NDArray[np.uint32]:
        """Return the lists of a group of rows of lenses, one after the other; all are made when one is missing."""
        with self._lock:
            if group not in self._lists:
                starts = np.append(0, np.cumsum(self._ends))
                every = _pages(int(starts[-1]))
                self._list(starts[:-1].copy(), np.frombuffer(every, np.uint32))
                of_groups = starts[:: self._views_down].tolist()
                for i in range(self._groups):
                    rows = min(self.views.lenses[1] - i * GROUP, GROUP)
                    self._lists[i] = _moved(every, of_groups[i], of_groups[i + 1])
                    self._unseen[i] = rows * self.planes
            return self._lists[group]

    def _used(self, group: int, rows: int) -> None:
        """Let go of the lists of a group after all its rows and planes: the picture takes their memory."""
        with self._lock:
            self._unseen[group] -= rows
            if self._unseen[group] <= 0:
                self._lists.pop(group, None)

    def faces(self, rows: slice, plane: int = 0) -> NDArray[np.int32]:
        """Return the nearest face at the place of a plane in each pixel of some rows, (rows, columns); −1 if none."""
        (columns, down), wide = self.views.places, self.views.lenses[0]
        top, bottom = rows.start // down, -(-rows.stop // down)
        out = np.empty((bottom - top, down, wide * columns), np.int32)
        across, chosen = self.views.across[1 + plane].copy(), np.empty(BLOCK + 1, np.int64)
        of_rows = self.views.down[1 + plane].reshape(-1, ROOM // BLOCK, BLOCK)
        offsets, slopes = (of_rows[:, part // BLOCK].reshape(-1) for part in (OFFSET, SLOPE))
        stride = CHUNK * (-(-wide // LENSES) + _SPARE)
        lines = len(across) // ROOM * BLOCK * stride
        buffer = aligned(min(GROUP, bottom - top) * lines)
        chunks = buffer.reshape(-1, 2, LENSES)
        chunks[:, 0], chunks.view(np.int32)[:, 1] = np.inf, -1
        for group in range(top // GROUP, (bottom - 1) // GROUP + 1):
            start = group * GROUP
            some = max(top - start, 0), min(bottom - start, GROUP)
            entries, lengths = self._entries(group), self._ends.reshape(self._groups, -1)[group]
            for v in range(down):
                of_list = slice(lengths[:v].sum(), lengths[: v + 1].sum())
                for i, room in enumerate(across.reshape(-1, ROOM)):
                    draw_faces(
                        self._corners, self.views.turn, entries[of_list], some, start,
                        (offsets[v], slopes[v]), room, wide, chosen, i * BLOCK * stride, lines, stride, buffer,
                    )  # fmt: skip
                into = out[start + some[0] - top : start + some[1] - top, v]
                read_faces(buffer, buffer.view(np.int32), wide, stride, columns, into)
            self._used(group, some[1] - some[0])
        return out.reshape(-1, wide * columns)[rows.start - top * down :][: rows.stop - rows.start]
