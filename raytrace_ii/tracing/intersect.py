"""Rays against triangles, by Embree. The only place that knows embreex.

What embreex leaves to its caller is settled here: float32 C-order arrays, finite vertices, one geometry whose
primitive number is the row of the face, and a second tree of opaque faces for shadow rays.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray


class Intersector:
    """Embree trees over (F, 3, 3) float32 face corners, of which the first ``opaque`` faces block light wholly.

    ``robust`` keeps rays from slipping between faces that share an edge.
    """

    def __init__(self, corners: NDArray[np.float32], opaque: int, *, robust: bool = True) -> None:
        self.opaque = opaque
        self._all = _tree(corners, robust)
        if opaque == len(corners):
            self._opaque, self._clear = self._all, None
        else:
            self._opaque = _tree(corners[:opaque], robust) if opaque else None
            self._clear = _tree(corners[opaque:], robust)

    def nearest(self, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> tuple[dict[str, Any], float]:
        """Nearest hit of every ray: ``primID`` (face row, −1 on a miss), ``u``, ``v``, ``tfar``; and CPU seconds."""
        start = time.thread_time()
        hits = self._all.run(origins, directions, query="INTERSECT", output=True)
        return hits, time.thread_time() - start

    def blocked(
        self, origins: NDArray[np.float32], directions: NDArray[np.float32], reach: NDArray[np.float32]
    ) -> tuple[NDArray[np.int32], float]:
        """0 where an opaque face lies within ``reach`` lengths of the direction, −1 where not; and CPU seconds."""
        if self._opaque is None:
            return np.full(len(origins), -1, np.int32), 0.0
        start = time.thread_time()
        found = self._opaque.run(origins, directions, dists=reach, query="OCCLUDED")
        return found, time.thread_time() - start

    def nearest_clear(
        self, origins: NDArray[np.float32], directions: NDArray[np.float32], reach: NDArray[np.float32] | None = None
    ) -> tuple[dict[str, Any], float]:
        """Nearest hit within ``reach`` with a face that lets light through; ``primID`` counts from their first."""
        assert self._clear is not None
        start = time.thread_time()
        hits = self._clear.run(origins, directions, dists=reach, query="INTERSECT", output=True)
        return hits, time.thread_time() - start


def _tree(corners: NDArray[np.float32], robust: bool) -> EmbreeScene:
    tree = EmbreeScene(robust=robust)
    vertices = np.ascontiguousarray(corners.reshape(-1, 3), np.float32)
    TriangleMesh(tree, vertices, np.arange(len(vertices), dtype=np.int32).reshape(-1, 3))
    return tree
