"""Animations of glTF: clips by name, values of nodes at an instant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .container import GltfFile
from .tables import Animation, Channel, KeyframeSampler

Array = NDArray[np.float64]
WIDTHS = {"translation": 3, "rotation": 4, "scale": 3}  # of node keys; morph weights have one number a target
Keys = dict[tuple[int, str], Array]  # values by node and key


@dataclass(frozen=True, eq=False)
class Curve:
    """Keyframes of one key of one node: ``values`` (n, w), or (n, 3, w) with tangents for cubic splines."""

    node: int
    path: str
    times: Array
    values: Array
    interpolation: str

    def at(self, seconds: float) -> Array:
        """Value at an instant; before the first and after the last keyframe theirs."""
        cubic = self.interpolation == "CUBICSPLINE"
        points = self.values[:, 1] if cubic else self.values
        after = int(np.searchsorted(self.times, seconds, side="right"))
        if after == 0 or after == len(self.times):
            value = points[min(after, len(points) - 1)]
        elif self.interpolation == "STEP":
            value = points[after - 1]
        else:
            step = self.times[after] - self.times[after - 1]
            s = (seconds - self.times[after - 1]) / step
            a, b = points[after - 1], points[after]
            if cubic:
                value = _hermite(a, step * self.values[after - 1, 2], b, step * self.values[after, 0], s)
            else:
                value = _slerp(a, b, s) if self.path == "rotation" else (1 - s) * a + s * b
        return value / max(np.linalg.norm(value), 1e-300) if self.path == "rotation" else value


class Clip:
    """One animation of a file, its arrays checked.

    Raises
    ------
    ValueError
        If an accessor does not fit, times do not grow, or a node has a matrix in place of the animated keys.
    """

    def __init__(self, file: GltfFile, index: int) -> None:
        animation: Animation = file.at("animations", index, "animations")
        self.curves: list[Curve] = []
        self.left_out: list[str] = []
        for i, channel in enumerate(animation.channels):
            where = f"animations.{index}.channels.{i}"
            if channel.target.path not in (*WIDTHS, "weights") or channel.target.node is None:
                self.left_out.append(f"animation of {channel.target.path}")
                continue
            if channel.sampler >= len(animation.samplers):
                raise ValueError(f"{where}: sampler {channel.sampler} is named, there are {len(animation.samplers)}")
            self.curves.append(_curve(file, channel, animation.samplers[channel.sampler], where))
        self.seconds = max((float(curve.times[-1]) for curve in self.curves), default=0.0)

    def at(self, seconds: float) -> Keys:
        """Animated keys at an instant; the clip is repeated without end."""
        inside = seconds % self.seconds if self.seconds > 0 and seconds > self.seconds else seconds
        return {(curve.node, curve.path): curve.at(inside) for curve in self.curves}


def clip_names(file: GltfFile) -> list[str]:
    """Names of a file's animations; those without one are numbered."""
    return [animation.name or f"clip {i}" for i, animation in enumerate(file.tables.animations)]


def _curve(file: GltfFile, channel: Channel, sampler: KeyframeSampler, where: str) -> Curve:
    node, path = channel.target.node, channel.target.path
    assert node is not None
    shown = file.at("nodes", node, where)
    if path != "weights" and shown.matrix is not None:
        raise ValueError(f"{where}: nodes.{node} has a matrix, whose {path} cannot be animated")
    times = file.array(sampler.input, f"{where}.input").astype(np.float64)
    if times.shape[1] != 1 or times[0, 0] < 0 or not (np.diff(times[:, 0]) > 0).all():
        raise ValueError(f"{where}.input: times that grow from at least 0 are needed")
    values: NDArray[Any] = file.array(sampler.output, f"{where}.output").astype(np.float64)
    rows = len(times) * (3 if sampler.interpolation == "CUBICSPLINE" else 1)
    width = WIDTHS.get(path) or max(1, len(values) // rows)
    if values.size != rows * width or values.shape[1] != (1 if path == "weights" else width):
        raise ValueError(
            f"{where}.output: has {len(values)} rows of {values.shape[1]}: {rows} of {width} are needed for "
            f"{len(times)} times"
        )
    shape = (len(times), 3, width) if sampler.interpolation == "CUBICSPLINE" else (len(times), width)
    values = values.reshape(shape)
    if path == "rotation":
        values = _unit_keys(values, where)
    return Curve(node, path, times[:, 0], values, sampler.interpolation)


def _unit_keys(values: Array, where: str) -> Array:
    """Return quaternions scaled to unit length, with the tangents of cubic splines scaled by the same factor.

    Stored quaternions are rounded: of 8 bits, they are up to 1 % from unit length, and slerp needs unit length.
    """
    points = values[:, 1:2] if values.ndim == 3 else values
    lengths = np.linalg.norm(points, axis=-1, keepdims=True)
    if not (lengths > 0).all():
        raise ValueError(f"{where}.output: a quaternion of length 0")
    return np.asarray(values / lengths)


def _hermite(a: Array, a_slope: Array, b: Array, b_slope: Array, s: float) -> Array:
    """Cubic through a and b with these tangents, times the interval, at s from 0 to 1."""
    s2, s3 = s * s, s * s * s
    return (
        (2 * s3 - 3 * s2 + 1) * a + (s3 - 2 * s2 + s) * a_slope + (3 * s2 - 2 * s3) * b + (s3 - s2) * b_slope
    )  # fmt: skip


def _slerp(a: Array, b: Array, s: float) -> Array:
    """Quaternion on the shorter great arc from a to b."""
    dot = float(a @ b)
    b, dot = (-b, -dot) if dot < 0 else (b, dot)
    angle = np.arccos(min(dot, 1.0))
    if angle < 1e-6:
        return (1 - s) * a + s * b
    return np.asarray((np.sin((1 - s) * angle) * a + np.sin(s * angle) * b) / np.sin(angle))
