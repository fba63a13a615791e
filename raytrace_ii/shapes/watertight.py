"""Watertightness of meshes, which glass needs: a ray is inside from its entry face to its exit face."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

SAME = 1e-6  # of the largest coordinate: nearer corners are equal, as in single precision


def flaw(vertices: NDArray[Any], faces: NDArray[Any]) -> str | None:
    """Return the reason why a mesh is not watertight; None if it is, with outward faces.

    In a closed mesh, faces run through every edge equally often in both directions; bodies may touch along an edge.
    Corners at one position count as one, so that seams of texture coordinates do not matter.
    """
    vertices, faces = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
    open_edges = _open_edges(faces)
    if len(open_edges):
        faces = _merged(vertices, np.unique(open_edges))[faces]
        open_edges = _open_edges(faces)
    if len(open_edges):
        return f"{len(open_edges)} of its edges are open, or between a face and one that is turned over"
    a, b, c = (vertices[faces[:, i]] - vertices.mean(axis=0) for i in range(3))
    return "its faces look inwards" if np.einsum("ij,ij->", a, np.cross(b, c)) < 0 else None


def _open_edges(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the edges (n, 2), low corner first, with unequal numbers of faces in both directions."""
    start, end = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    span = int(faces.max()) + 1
    up, ups = np.unique((start * span + end)[start < end], return_counts=True)
    down, downs = np.unique((end * span + start)[end < start], return_counts=True)  # start = end: a face without area
    _, i, j = np.intersect1d(up, down, assume_unique=True, return_indices=True)
    paired = ups[i] == downs[j]
    return np.column_stack(np.divmod(np.union1d(np.delete(up, i[paired]), np.delete(down, j[paired])), span))


def _merged(vertices: NDArray[np.float64], loose: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return a number for every vertex, equal for vertices of ``loose`` at one position."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    points, row = np.unique(vertices[loose] + 0.0, axis=0, return_inverse=True)  # of soup, a sixth
    pairs = cKDTree(points).query_pairs(SAME * np.abs(vertices).max(), output_type="ndarray")
    linked = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points), len(points)))
    place = connected_components(linked)[1][row.reshape(-1)]
    number = np.arange(len(vertices))
    number[loose] = loose[np.unique(place, return_index=True)[1]][place]
    return number
