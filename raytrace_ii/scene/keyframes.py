"""Keyframes: values over time, and poses of moving cameras."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

HOW = ("linear", "smooth", "step")


@dataclass(frozen=True, eq=False)
class Track:
    """Keyframes of one value.

    Parameters
    ----------
    frames : (n,)
        Frame numbers, growing, not necessarily whole.
    values : (n, w)
        Numbers at these frames. Before the first and after the last keyframe theirs hold.
    how : {"linear", "smooth", "step"}
        Straight lines; cubic Hermite splines at rest at both ends, with the slope between its neighbours at every
        other keyframe (Catmull–Rom); or each value until the next keyframe.

    Raises
    ------
    ValueError
        If there is no keyframe, frames do not grow, values do not fit them, or ``how`` is unknown.
    """

    frames: Any
    values: Any
    how: str = "linear"

    def __post_init__(self) -> None:
        if self.how not in HOW:
            raise ValueError(f"unknown how {self.how!r}: known are {', '.join(HOW)}")
        widths = {len(value) for value in self.values}
        if not len(self.frames) or len(self.values) != len(self.frames) or len(widths) != 1:
            raise ValueError(
                f"{len(self.frames)} frames, {len(self.values)} values of {sorted(widths)} numbers: "
                "a value for each of at least one frame is needed, all of one length"
            )
        frames = np.asarray(self.frames, np.float64)
        if not (np.diff(frames) > 0).all():
            raise ValueError(f"frames are {list(self.frames)}: growing numbers are needed")
        object.__setattr__(self, "frames", frames)
        object.__setattr__(self, "values", np.asarray(self.values, np.float64))

    def at(self, frame: float) -> NDArray[np.float64]:
        """Value at a frame number, (w,)."""
        after = int(np.searchsorted(self.frames, frame, side="right"))
        if after == 0 or after == len(self.frames):
            return np.asarray(self.values[min(after, len(self.frames) - 1)])
        first, a, b = after - 1, self.values[after - 1], self.values[after]
        if self.how == "step":
            return np.asarray(a)
        step = self.frames[after] - self.frames[first]
        s = (frame - self.frames[first]) / step
        if self.how == "linear":
            return np.asarray((1 - s) * a + s * b)
        start, end = step * self._slope(first), step * self._slope(after)
        s2, s3 = s * s, s * s * s
        return np.asarray(
            (2 * s3 - 3 * s2 + 1) * a + (s3 - 2 * s2 + s) * start + (3 * s2 - 2 * s3) * b + (s3 - s2) * end
        )

    def _slope(self, i: int) -> Any:
        if i in (0, len(self.frames) - 1):
            return np.zeros(self.values.shape[1])
        return (self.values[i + 1] - self.values[i - 1]) / (self.frames[i + 1] - self.frames[i - 1])


def looking_pose(position_mm: ArrayLike, look_at_mm: ArrayLike, roll_deg: float = 0.0) -> NDArray[np.float64]:
    """Pose (4, 4) of a camera at a place, its z towards a point, its x level.

    ``roll_deg`` turns it about its z, x towards y.

    Raises
    ------
    ValueError
        If the point is at the place, or straight above or below it.
    """
    place, target = np.asarray(position_mm, np.float64), np.asarray(look_at_mm, np.float64)
    ahead = target - place
    right = np.cross((0.0, 1.0, 0.0), ahead)
    away, aside = float(np.linalg.norm(ahead)), float(np.linalg.norm(right))
    if not aside > 1e-9 * away:
        raise ValueError(
            f"a camera at {place.tolist()} looks at {target.tolist()}: another place, not straight above or below, "
            "is needed"
        )
    ahead, right = ahead / away, right / aside
    c, s = np.cos(np.radians(roll_deg)), np.sin(np.radians(roll_deg))
    up = np.cross(ahead, right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([c * right + s * up, c * up - s * right, ahead], axis=1)
    pose[:3, 3] = place
    return pose


def turned_pose(position_mm: ArrayLike, rotation: Sequence[Any] | NDArray[np.float64]) -> NDArray[np.float64]:
    """Pose (4, 4) of a place and a rotation matrix."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, position_mm
    return pose
