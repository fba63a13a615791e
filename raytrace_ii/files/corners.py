"""Corners of triangles: smooth normals where a file gives none, equal vertices merged."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ii_core.base.extras import Lazy

from ..scene.scene import unit_rows
from ..shapes.primitives import Mesh

csgraph, sparse = Lazy("scipy.sparse.csgraph"), Lazy("scipy.sparse")

Array = NDArray[np.float64]
Rows = NDArray[np.int64]
CREASE_DEG = 60.0  # edges of greater angle are sharp: those of a cube, not those of a six-sided pipe
FLIP = np.array([1.0, 1.0, -1.0])  # right-handed with −z ahead to left-handed with z ahead


class Table(NamedTuple):
    """Values, and their row for each corner (F, 3) of the faces; −1 for none."""

    values: Array
    rows: Rows


def joined(
    places: Array, faces: Rows, *, uv: Table | None = None, normals: Table | None = None,
    colours: Array | None = None, groups: Rows | None = None,
) -> Mesh:  # fmt: skip
    """Return a mesh in the scene's frame; corners of equal position, normal and (u, v) share a vertex.

    Parameters
    ----------
    places : ndarray, (V, 3)
        In the file's frame, right-handed.
    faces : ndarray of int, (F, 3)
    uv, normals : Table, optional
        (u, v) are used if every corner has them. Corners without a normal, or with one of length 0, get a smooth one;
        see `smooth_corners`.
    colours : ndarray, (V, 3), optional
    groups : ndarray of int, (F,), optional
        As in `smooth_corners`.
    """
    values, which = np.empty((0, 3)), np.full(faces.shape, -1, np.int64)
    if normals is not None and len(normals.values):
        values = unit_rows(normals.values)
        pointing = np.any(values != 0, axis=1)
        which = np.where((normals.rows >= 0) & pointing[normals.rows], normals.rows, -1)
    if (which < 0).any():
        smooth, rows = smooth_corners(places, faces, groups)
        which = np.where(which < 0, len(values) + rows, which)
        values = np.concatenate([values, smooth])
    over = uv if uv is not None and (uv.rows >= 0).all() else None
    key = faces if over is None else faces * len(over.values) + over.rows
    _, key = np.unique(key, return_inverse=True)  # renumbered, so that products stay small
    _, one, vertex = np.unique(
        key.reshape(-1) * len(values) + which.reshape(-1), return_index=True, return_inverse=True
    )
    at = faces.reshape(-1)[one]
    return Mesh(
        places[at] * FLIP,
        vertex.reshape(-1, 3)[:, ::-1],
        values[which.reshape(-1)[one]] * FLIP,
        None if over is None else over.values[over.rows.reshape(-1)[one]],
        None if colours is None else colours[at],
    )


def smooth_corners(places: Array, faces: Rows, groups: Rows | None = None) -> tuple[Array, Rows]:
    """Return the unit normals (n, 3) of the smooth surface of a mesh, and their row for each corner (F, 3).

    Corners at one position share a normal if smooth edges connect their faces. It is the mean of the faces' normals
    weighted by the angle at the corner (Thürmer and Wüthrich 1998). Doubled vertices at one position count as one, so
    that seams of texture coordinates are invisible.

    Parameters
    ----------
    groups : ndarray of int, (F,), optional
        OBJ's smoothing groups. Edges within a group above 0 are smooth; edges of group 0 and between groups are
        sharp. Edges of group −1 (no group), and all edges if groups are not given, are smooth up to `CREASE_DEG`.
    """
    _, place = np.unique(places + 0.0, axis=0, return_inverse=True)
    at = place.reshape(-1)[faces]
    p = places[faces]
    normal = unit_rows(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]))
    linked = _linked(at, normal, np.full(len(faces), -1) if groups is None else groups)
    count, label = csgraph.connected_components(linked, directed=False)
    rows = label.reshape(-1, 3).astype(np.int64)
    total = np.zeros((count, 3))
    for corner in range(3):
        before, after = p[:, corner - 1] - p[:, corner], p[:, corner - 2] - p[:, corner]
        angle = np.arctan2(np.linalg.norm(np.cross(before, after), axis=1), np.einsum("ij,ij->i", before, after))
        np.add.at(total, rows[:, corner], normal * angle[:, None])
    return unit_rows(total), rows


def _linked(at: Rows, normal: Array, groups: Rows) -> Any:
    """Return the corners (3 F) that smooth edges connect, from the positions (F, 3) of corners."""
    face = np.tile(np.arange(len(at)), 3)
    start, end = np.concatenate([np.arange(3 * len(at)).reshape(-1, 3)[:, [i, (i + 1) % 3]] for i in range(3)]).T
    place = at.reshape(-1)
    turned = place[start] > place[end]
    low, high = np.where(turned, end, start), np.where(turned, start, end)
    order = np.lexsort([place[high], place[low]])
    low, high, face = low[order], high[order], face[order]
    same = (place[low][1:] == place[low][:-1]) & (place[high][1:] == place[high][:-1])
    one, other = face[:-1], face[1:]
    cosine = np.einsum("ij,ij->i", normal[one], normal[other])
    flat = ~(
        normal[one].any(axis=1) & normal[other].any(axis=1)
    )  # faces without area have no angle to their neighbours
    within = (groups[one] == groups[other]) & (groups[one] != 0)
    smooth = same & within & ((groups[one] > 0) | flat | (cosine >= np.cos(np.radians(CREASE_DEG)) - 1e-9))
    pairs = np.concatenate([np.stack([tip[:-1][smooth], tip[1:][smooth]], axis=1) for tip in (low, high)])
    return sparse.coo_matrix((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(at.size, at.size))
