"""Ray–triangle intersection by Embree: in packets if its library can be called directly, else one by one by embreex.

What Embree leaves to its caller is settled here: float32 C-order arrays, finite vertices, one geometry whose
primitive number is the row of the face, places of hits that are the same for every kind of call, one winner of faces
in the same place, and a second tree of opaque faces for shadow rays.
"""

from __future__ import annotations

import time

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from .embree import Tree, lane_masks, library, with_spare
from .kernels.arrays import Hits
from .kernels.lanes import BLOCK
from .kernels.packets import NO_CALLS, Tools, place_hits

Floats = NDArray[np.float32]
_BLOCK = 1 << 18  # faces hashed at a time
_MIX = np.uint64(0x9E3779B97F4A7C15)  # an odd factor with evenly spread bits
_NO_REACH, _NO_FACES = np.empty(0, np.float32), np.empty(0, np.int32)


class Intersector:
    """Embree trees over (F, 3, 3) float32 face corners, of which the first ``opaque`` faces block light wholly.

    ``robust`` keeps rays from slipping between faces that share an edge. ``about`` says what traces the rays, and
    ``corners`` are the trees' own: a caller needs no second copy.
    """

    def __init__(self, corners: Floats, opaque: int, *, robust: bool = True) -> None:
        self.opaque = opaque
        self.corners = corners = with_spare(corners)
        embree = library()
        self.about = embree if isinstance(embree, str) else embree.about

        def tree(corners: Floats) -> Tree | SingleRays:
            return SingleRays(corners, robust) if isinstance(embree, str) else Tree(embree, corners, robust)

        self._all = tree(corners)
        self._opaque: Tree | SingleRays | None
        self._clear: Tree | SingleRays | None
        if opaque == len(corners):
            self._opaque, self._clear = self._all, None
        else:
            self._opaque = tree(corners[:opaque]) if opaque else None
            self._clear = tree(corners[opaque:])
        self._first = first_of_same(corners)
        self._first_clear = first_of_same(corners[opaque:]) if self._clear is not None else None

    def nearest(self, origins: Floats, directions: Floats, placed: bool = True) -> tuple[Hits, float]:
        """Nearest hit of every ray, and CPU seconds inside Embree; ``placed`` by float64, else by Embree."""
        return _nearest(self._all, self._first, origins, directions, _NO_REACH, placed)

    def distances(self, origins: Floats, directions: Floats) -> Floats:
        """Distances of the nearest hits of a few rays, to Embree's precision; NaN on a miss."""
        if isinstance(self._all, Tree):
            faces, _, _, found = self._all.few("rtcIntersect", origins, directions, np.inf)
        else:
            faces, _, _, found = self.nearest(origins, directions)[0]
        return np.where(faces >= 0, found, np.float32(np.nan))

    def tools(self, packet: Floats) -> Tools:
        """Return what a kernel calls Embree with itself, for packets in memory of one thread."""
        active, chosen = lane_masks()
        nearest, stop, clear = (
            tree.calls(function, active, packet) if isinstance(tree, Tree) else NO_CALLS
            for tree, function in (
                (self._all, "rtcIntersect"), (self._opaque, "rtcOccluded"), (self._clear, "rtcOccluded")
            )
        )  # fmt: skip
        return Tools(nearest, stop, clear, active, chosen)

    @property
    def width(self) -> int:
        """Rays of a packet."""
        return self._all.library.width if isinstance(self._all, Tree) else BLOCK

    @property
    def first_of_same(self) -> NDArray[np.int32]:
        """Return for each face the first of those in the same place; of no rows if no two are."""
        return _NO_FACES if self._first is None else self._first

    def nearest_clear(self, origins: Floats, directions: Floats, reach: Floats = _NO_REACH) -> tuple[Hits, float]:
        """Nearest hit within ``reach`` with a face that lets light through; faces count from their first."""
        assert self._clear is not None
        return _nearest(self._clear, self._first_clear, origins, directions, reach)

    def blocked(self, origins: Floats, directions: Floats, reach: Floats) -> tuple[NDArray[np.int32], float]:
        """0 where an opaque face lies within ``reach`` lengths of the direction, −1 where not; and CPU seconds."""
        found = np.full(len(origins), -1, np.int32)
        start = time.thread_time()
        if self._opaque is not None:
            self._opaque.occluded(origins, directions, reach, found)
        return found, time.thread_time() - start


class SingleRays:
    """As `embree.Tree`, by embreex's own calls."""

    def __init__(self, corners: Floats, robust: bool) -> None:
        self.corners = corners
        self._scene = EmbreeScene(robust=robust)
        vertices = np.ascontiguousarray(corners.reshape(-1, 3), np.float32)
        TriangleMesh(self._scene, vertices, np.arange(len(vertices), dtype=np.int32).reshape(-1, 3))

    def nearest(self, origins: Floats, directions: Floats, reach: Floats, out: Hits) -> None:
        dists = reach.copy() if len(reach) else None  # embreex overwrites it
        found = self._scene.run(origins, directions, dists=dists, query="INTERSECT", output=True)
        for array, name in zip(out, ("primID", "u", "v", "tfar"), strict=True):
            array[:] = found[name]

    def occluded(self, origins: Floats, directions: Floats, reach: Floats, out: NDArray[np.int32]) -> None:
        out[:] = self._scene.run(origins, directions, dists=reach.copy(), query="OCCLUDED")


def _nearest(
    tree: Tree | SingleRays,
    first: NDArray[np.int32] | None,
    origins: Floats,
    directions: Floats,
    reach: Floats,
    placed: bool = True,
) -> tuple[Hits, float]:
    n = len(origins)
    hits = Hits(np.empty(n, np.int32), *(np.empty(n, np.float32) for _ in range(3)))
    start = time.thread_time()
    tree.nearest(origins, directions, reach, hits)
    if first is not None:
        hits.faces[:] = np.where(hits.faces >= 0, first[hits.faces], -1)
    if placed:
        place_hits(origins, directions, tree.corners, *hits)
    return hits, time.thread_time() - start


def first_of_same(corners: NDArray[np.float32]) -> NDArray[np.int32] | None:
    """Return for each face the first one with the same corners, in any order; None if no two faces are alike.

    Which of them a ray meets hangs on the width of its packet. Faces that only overlap in a plane are not told apart.

    Parameters
    ----------
    corners : (F, 3, 3) float32
        Finite.

    Returns
    -------
    (F,) int32 or None
    """
    hashes = np.concatenate(
        [_corner_keys(corners[i : i + _BLOCK]).sum(axis=1) for i in range(0, len(corners), _BLOCK)] or [[]]
    )
    ordered = np.sort(hashes)
    often = ordered[1:][ordered[1:] == ordered[:-1]]
    if not len(often):
        return None
    alike = np.flatnonzero(np.isin(hashes, often))
    order = np.argsort(_corner_keys(corners[alike]), axis=1)
    rows = np.take_along_axis(corners[alike] + np.float32(0), order[:, :, None], axis=1).reshape(-1, 9)
    _, first, which = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    if len(first) == len(alike):
        return None
    found = np.arange(len(corners), dtype=np.int32)
    found[alike] = alike[first[which.reshape(-1)]]
    return found


def _corner_keys(corners: NDArray[np.float32]) -> NDArray[np.uint64]:
    """Return a number of each corner, (F, 3): equal for equal corners, of either sign of zero."""
    bits = np.ascontiguousarray(corners + np.float32(0)).view(np.uint32).astype(np.uint64)
    keys = np.zeros(bits.shape[:2], np.uint64)
    for axis in range(3):
        keys = (keys ^ bits[:, :, axis]) * _MIX
        keys ^= keys >> np.uint64(29)
    return keys
