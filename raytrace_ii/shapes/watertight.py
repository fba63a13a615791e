"""Watertightness of meshes, which glass needs: a ray is inside from its entry face to its exit face."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core.extras import load

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
    points, row = np.unique(vertices[loose] + 0.0, axis=0, return_inverse=True)  # of soup, a sixth
    pairs = load("scipy.spatial").cKDTree(points).query_pairs(SAME * np.abs(vertices).max(), output_type="ndarray")
    place = components(len(points), pairs)[row.reshape(-1)]
    number = np.arange(len(vertices))
    number[loose] = loose[np.unique(place, return_index=True)[1]][place]
    return number


def components(count: int, pairs: NDArray[np.integer[Any]]) -> NDArray[np.int64]:
    """Return the number of the connected component of each of ``count`` points, linked in pairs (n, 2).

    Components are numbered in the order of their first points.
    """
    first = np.arange(count)  # of the component, as far as known
    a, b = pairs.T
    while (first[a] != first[b]).any():
        low, high = np.minimum(first[a], first[b]), np.maximum(first[a], first[b])
        np.minimum.at(first, high, low)
        while ((shorter := first[first]) != first).any():
            first = shorter
    return np.unique(first, return_inverse=True)[1].reshape(-1)
