"""Triangulation of polygons: fans if convex, ear clipping if concave."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MOST_CORNERS = 4000  # of a concave polygon: the time of ear clipping is quadratic, here seconds
FLAT = 1e-12  # of the squared size of a polygon: corners of smaller turn are straight


def triangulated(places: Array, counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return triangles of polygons in space, in their order and orientation.

    Parameters
    ----------
    places : ndarray, (C, 3)
        Corners of all polygons, one after another.
    counts : ndarray of int, (P,)
        Number of corners of each polygon, at least 3.

    Returns
    -------
    ndarray of int, (T, 3)
        Rows of ``places``.

    Raises
    ------
    ValueError
        If a concave polygon has more than `MOST_CORNERS` corners.

    References
    ----------
    Meisters 1975: every simple polygon has two ears.
    """
    first = np.cumsum(counts) - counts
    triangles, polygon = [], []
    for count in np.unique(counts):
        own = np.flatnonzero(counts == count)
        corners = first[own, None] + np.arange(count)
        convex = np.ones(len(own), bool) if count == 3 else _convex(places[corners])
        fan = np.column_stack([np.zeros(count - 2, int), np.arange(1, count - 1), np.arange(2, count)])
        triangles.append(corners[convex][:, fan].reshape(-1, 3))
        polygon.append(np.repeat(own[convex], count - 2))
        if count > MOST_CORNERS and not convex.all():
            raise ValueError(f"a polygon of {count} corners is not convex: at most {MOST_CORNERS} are cut up")
        for one, row in zip(own[~convex], corners[~convex], strict=True):
            triangles.append(row[_ears(_flattened(places[row]))])
            polygon.append(np.full(count - 2, one))
    if not triangles:
        return np.empty((0, 3), np.int64)
    order = np.argsort(np.concatenate(polygon), kind="stable")
    return np.concatenate(triangles)[order]


def _newell(p: Array) -> Array:
    """Return the normals (P, 3) of polygons (P, n, 3), of twice their area in length (Newell's mean plane)."""
    p = p - p[:, :1]
    return np.asarray(np.cross(p, np.roll(p, -1, axis=1)).sum(axis=1))


def _convex(p: Array) -> NDArray[np.bool_]:
    """Return whether polygons (P, n, 3) are convex: all corners turn to the same side about the normal."""
    normal = _newell(p)
    before, after = p - np.roll(p, 1, axis=1), np.roll(p, -1, axis=1) - p
    turn = np.einsum("pnj,pj->pn", np.cross(before, after), normal)
    size = np.ptp(p, axis=1).max(axis=1) ** 2 * np.linalg.norm(normal, axis=1)
    return np.asarray((turn >= -FLAT * size[:, None]).all(axis=1))


def _flattened(p: Array) -> Array:
    """Return a polygon (n, 3) projected to its mean plane, (n, 2), counter-clockwise, of size 1."""
    normal = _newell(p[None])[0]
    axis = np.eye(3)[np.argmin(np.abs(normal))]
    x = np.cross(axis, normal)
    y = np.cross(normal, x)
    frame = np.stack([v / max(float(np.linalg.norm(v)), 1e-300) for v in (x, y)], axis=1)
    return np.asarray((p - p[0]) @ frame / max(float(np.ptp(p, axis=0).max()), 1e-300))


def _ears(p: Array) -> NDArray[np.int64]:
    """Return triangles (n − 2, 3) of a polygon (n, 2) by ear clipping; an ear has no corner inside."""
    left, triangles, k = list(range(len(p))), [], 0
    failed = 0
    while len(left) > 3:
        k %= len(left)
        a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
        # a self-intersecting polygon may have no ear: clip any corner
        if failed >= len(left) or _is_ear(p, a, b, c, left):
            triangles.append((a, b, c))
            del left[k]
            failed = 0
        else:
            failed += 1
            k += 1
    return np.array([*triangles, left], np.int64)


def _is_ear(p: Array, a: int, b: int, c: int, left: list[int]) -> bool:
    turn = _turn(p[a], p[b], p[c])
    if turn <= FLAT:
        return bool(turn >= -FLAT)  # a straight corner is a triangle without area
    q = p[left]
    inside = (_turn(p[a], p[b], q) >= 0) & (_turn(p[b], p[c], q) >= 0) & (_turn(p[c], p[a], q) >= 0)
    for corner in (p[a], p[b], p[c]):  # the corners themselves, also where a slit to a hole returns to one
        inside &= (q != corner).any(axis=1)
    return not inside.any()


def _turn(a: Array, b: Array, c: Array) -> Array:
    """Return twice the signed area of triangles, positive if counter-clockwise; ``c`` may be many points."""
    return np.asarray((b[0] - a[0]) * (c[..., 1] - a[1]) - (b[1] - a[1]) * (c[..., 0] - a[0]))
