"""Pose of a camera: position, direction of view and rotation."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import checks
from ..base.checks import MOST_MM


@checks.checked(at_mm=checks.numbers, look_at_mm=checks.numbers, up=checks.numbers, turn_deg=checks.numbers)
def camera_pose(
    at_mm: ArrayLike = (0.0, 0.0, 0.0),
    *,
    look_at_mm: ArrayLike | None = None,
    up: ArrayLike = (0.0, 1.0, 0.0),
    turn_deg: ArrayLike = (0.0, 0.0, 0.0),
) -> NDArray[np.float64]:
    """Return the pose of a camera, for `raytrace_ii.render`.

    Parameters
    ----------
    at_mm : array_like, (3,)
        Where the middle of the pixel array stands in the scene.
    look_at_mm : array_like, (3,), optional
        A point of the scene on the camera's z axis. The camera looks along the scene's z if not given.
    up : array_like, (3,)
        Direction in the scene to which the top of the camera points, as near as it can.
    turn_deg : array_like, (3,)
        Turns about the middle of the pixel array, degrees, one after the other: to the right, upwards, and clockwise
        as the camera sees it, so that its top goes to the right.

    Returns
    -------
    ndarray of float64, (4, 4)
        From the camera's frame to the scene's.

    Raises
    ------
    ValueError
        If a value is not three finite numbers, a coordinate is beyond 10⁹ mm, the camera looks at its own place, or
        along ``up``.
    """
    given = {"at_mm": at_mm, "up": up, "turn_deg": turn_deg}
    given |= {} if look_at_mm is None else {"look_at_mm": look_at_mm}
    vectors = {name: np.asarray(value, np.float64) for name, value in given.items()}
    for name, vector in vectors.items():
        if vector.shape != (3,) or not np.isfinite(vector).all():
            raise ValueError(f"{name} is {given[name]!r}: three finite numbers are needed")
        if name in ("at_mm", "look_at_mm") and np.abs(vector).max() > MOST_MM:
            raise ValueError(f"{name} is {vector.tolist()}: coordinates up to {MOST_MM:g} mm are needed")
    ahead = vectors["look_at_mm"] - vectors["at_mm"] if "look_at_mm" in vectors else np.array([0.0, 0.0, 1.0])
    pose = np.eye(4)
    pose[:3, :3] = _facing(ahead, vectors["up"]) @ _turned(*np.radians(vectors["turn_deg"]))
    pose[:3, 3] = vectors["at_mm"]
    return pose


def _facing(ahead: NDArray[np.float64], up: NDArray[np.float64]) -> NDArray[np.float64]:
    """Axes of the camera, as columns: x to the right, y up, z ahead."""
    if not ahead.any():
        raise ValueError("at_mm and look_at_mm are one point: two are needed")
    z = ahead / np.linalg.norm(ahead)
    x = np.cross(up, z)
    if np.linalg.norm(x) <= 1e-9 * np.linalg.norm(up):
        raise ValueError(f"up is {up.tolist()}: a direction other than that of sight is needed")
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


def _turned(right: float, upwards: float, clockwise: float) -> NDArray[np.float64]:
    (c, s), (d, t), (e, u) = ((np.cos(angle), np.sin(angle)) for angle in (right, upwards, clockwise))
    yaw = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    pitch = np.array([[1, 0, 0], [0, d, t], [0, -t, d]])
    roll = np.array([[e, u, 0], [-u, e, 0], [0, 0, 1]])
    return yaw @ pitch @ roll
