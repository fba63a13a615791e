"""Takes: animated scenes, from ``[animation]`` of a scene file or from a glTF clip."""

from __future__ import annotations

import copy
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core.base.checks import text, within

from ..scene.keyframes import Track, looking_pose, turned_pose
from ..scene.scene import Scene
from ..shapes.primitives import rotation
from .load import (
    GLTF_TYPES,
    MeshFiles,
    SceneLoader,
    built,
    fitting,
    is_mesh,
    mesh_scene,
    scene_path,
    warn_of,
    working_place,
)
from .toml_schema import ObjectTable, TrackTable, check_shape, checked_tables, raw_tables

DEFAULT_FPS = 24.0
MOST_SECONDS = 1e9
CAMERA_KEYS = {"position_mm": 3, "look_at_mm": 3, "rotate_deg": 3}
TABLES = ("scene", "background", "fog", "light.NUMBER", "material.NAME", "texture.NAME", "object.NAME", "camera")


@dataclass(frozen=True, eq=False)
class _Motion:
    """A track, and the tables or the camera whose key it sets."""

    of: tuple[str, ...]
    key: str
    track: Track


class Take:
    """A scene that moves, and the camera's pose in it.

    Attributes
    ----------
    name : str
    frames : int
        Number T of frames.
    fps : float
        Frames a second: frame τ is at τ/fps seconds.

    See Also
    --------
    load_take
    """

    def __init__(
        self, path: Path, *, clip: str | None = None, fps: float | None = None,
        rotate_deg: Sequence[float] = (0.0, 0.0, 0.0), fit: str = "*",
    ) -> None:  # fmt: skip
        self.name, self._path, self._clip = path.stem, path, clip
        self._fitting = fitting(path, rotate_deg, fit)
        self._files = MeshFiles()
        self._motions: list[_Motion] = []
        self._latest: tuple[Any, Scene] | None = None
        if is_mesh(path):
            self._begin_mesh(DEFAULT_FPS if fps is None else fps)
        else:
            self._begin_file(fps)
        warn_of(path, self.scene_at(0.0), self._files)

    @property
    def seconds(self) -> float:
        """Length: of T frames, each 1/fps."""
        return self.frames / self.fps

    def scene_at(self, seconds: float) -> Scene:
        """Scene at an instant; the very same object as before if nothing in it has moved since.

        Raises
        ------
        ValueError
            If the instant is no finite number, or a value between keyframes is none that its table takes.
        """
        instant = self._instant(seconds)
        if is_mesh(self._path):
            key: Any = instant if self._clip is not None else 0.0
        else:
            data = self._data_at(instant)
            key = data, instant if self._has_clips else 0.0
        if self._latest is None or self._latest[0] != key:
            self._latest = key, self._made(instant, key)
        return self._latest[1]

    def pose_at(self, seconds: float) -> NDArray[np.float64]:
        """Pose (4, 4) from the camera's frame to the scene's; the identity if the camera does not move.

        ``look_at_mm`` aims z, with x level; ``rotate_deg`` turns about x, y, z as that of an object. Beside
        ``look_at_mm`` only its third number is used, which rolls the camera.
        """
        frame = self._instant(seconds) * self.fps
        keys = {m.key: m.track.at(frame) for m in self._motions if "camera" in m.of}
        place, turn = keys.get("position_mm", np.zeros(3)), keys.get("rotate_deg", np.zeros(3))
        if "look_at_mm" in keys:
            try:
                return looking_pose(place, keys["look_at_mm"], turn[2])
            except ValueError as error:
                raise ValueError(f"{self._path}: frame {frame:g}: {error}") from None
        x, y, z = (float(angle) for angle in turn)
        return turned_pose(place, rotation((x, y, z)))

    def _begin_file(self, fps: float | None) -> None:
        self._data = built(self._path, lambda: raw_tables(self._path.read_text(encoding="utf-8")))
        tables = built(self._path, checked_tables, self._data)
        if self._clip is not None:
            raise ValueError(f"clip {self._clip!r}: a scene file names the clips of its objects itself")
        if tables.animation is None:
            raise ValueError(f"{self._path}: the scene does not move: an [animation] is needed")
        self.frames, self.fps = tables.animation.frames, tables.animation.fps if fps is None else _rate(fps)
        self._has_clips = any((value.model_extra or {}).get("clip") for value in tables.object)
        self._loader = SceneLoader(self._path, self._files, moves=True)
        self._motions = built(self._path, self._checked_tracks, tables.animation.track)
        for frame in sorted({float(f) for motion in self._motions for f in motion.track.frames}):
            built(self._path, self._check_frame, frame)

    def _begin_mesh(self, fps: float) -> None:
        if self._path.suffix.lower() not in GLTF_TYPES:
            raise ValueError(f"{self._path} does not move: a glTF file with animations, or a scene file is needed")
        from .gltf.nodes import GltfScene

        scene = GltfScene(self._path)
        if self._clip is None:
            if not scene.clips:
                raise ValueError(f"{self._path} does not move: it has no animations")
            self._clip = scene.clips[0]
        try:
            seconds = scene.clip(self._clip).seconds
        except ValueError as error:
            raise ValueError(f"{self._path.name}: {error}") from None
        self.fps = _rate(fps)
        self.frames = max(1, math.ceil(seconds * self.fps - 1e-6))
        self._place = working_place(self._path, self._files.model(self._path, self._clip, 0.0), self._fitting)

    def _checked_tracks(self, tracks: list[TrackTable]) -> list[_Motion]:
        motions: list[_Motion] = []
        seen: set[tuple[int, str]] = set()
        for i, table in enumerate(tracks):
            try:
                motion = _Motion(tuple(table.of), table.key, Track(table.frames, table.values, table.how))
                if "camera" in motion.of:
                    _check_camera_key(motion)
                sets = {(id(table), motion.key) for of in motion.of for table in self._targets(of)}
                if sets & seen:
                    raise ValueError(f"{motion.key} of {', '.join(motion.of)} is set by another track, too")
                seen |= sets
            except ValueError as error:
                raise ValueError(f"animation.track.{i}: {error}") from None
            motions.append(motion)
        return motions

    def _targets(self, of: str) -> list[Any]:
        return [CAMERA_KEYS] if of == "camera" else _tables(self._data, of)

    def _check_frame(self, frame: float) -> None:
        try:
            file = checked_tables(self._data_at(frame / self.fps))
            for i, value in enumerate(file.object):
                _check_object(i, value)
        except ValueError as error:
            raise ValueError(f"frame {frame:g}: {error}") from None

    def _instant(self, seconds: float) -> float:
        return within("seconds", seconds, 0.0, MOST_SECONDS, "time", " s")

    def _data_at(self, seconds: float) -> dict[str, Any]:
        """The file's tables with the animated keys set."""
        data = copy.deepcopy(self._data)
        data.pop("animation", None)
        for motion in self._motions:
            value = motion.track.at(seconds * self.fps).tolist()
            for of in motion.of:
                for table in _tables(data, of) if of != "camera" else ():
                    table[motion.key] = value[0] if len(value) == 1 else list(value)
        return data

    def _made(self, seconds: float, key: Any) -> Scene:
        if is_mesh(self._path):
            return mesh_scene(self._path, self._files.model(self._path, self._clip, seconds), self._place)
        return built(self._path, self._loader.scene, checked_tables(key[0]), seconds)


def load_take(
    name: str | os.PathLike[str], *, clip: str | None = None, fps: float | None = None,
    rotate_deg: Sequence[float] = (0.0, 0.0, 0.0), fit: str = "*",
) -> Take:  # fmt: skip
    """A scene that moves: by its name, from a scene file with ``[animation]``, or a glTF file with animations.

    Parameters
    ----------
    name : str or path
        As for `load_scene`.
    clip : str, optional
        Of a glTF file alone: the name of its animation; the first if not given.
    fps : float, optional
        Frames a second in place of the file's, with the same keyframes; 24 of a glTF file.
    rotate_deg, fit
        As for `load_scene`, of the model at the clip's start.

    Returns
    -------
    Take

    Raises
    ------
    TypeError, ValueError, OSError
        As `load_scene`; or if nothing moves, or a keyframe names what is not there.
    """
    if clip is not None:
        text("clip", clip)
    return Take(scene_path(name), clip=clip, fps=fps, rotate_deg=rotate_deg, fit=fit)


def _check_object(i: int, value: ObjectTable) -> None:
    try:
        check_shape(value.model_extra or {})
    except ValueError as error:
        raise ValueError(f"object.{i} ({value.name}): {error}") from None


def _rate(fps: float) -> float:
    if not isinstance(fps, int | float) or not 0 < fps <= 1000:
        raise ValueError(f"fps is {fps!r}: a number above 0, at most 1000, is needed")
    return float(fps)


def _check_camera_key(motion: _Motion) -> None:
    if motion.key not in CAMERA_KEYS:
        raise ValueError(f"key {motion.key!r} of the camera: known are {', '.join(CAMERA_KEYS)}")
    if motion.track.values.shape[1] != CAMERA_KEYS[motion.key]:
        raise ValueError(f"{motion.key} of the camera: values of {CAMERA_KEYS[motion.key]} numbers are needed")


def _tables(data: Mapping[str, Any], of: str) -> list[dict[str, Any]]:
    """The tables that a track names; names of objects may hold ``*`` and ``?``."""
    kind, _, name = of.partition(".")
    if of == "scene":
        return [data]  # type: ignore[list-item]
    if kind in ("background", "fog") and not name:
        if kind not in data:
            raise ValueError(f"of is {of!r}: the file has no [{kind}]")
        return [data[kind]]
    if kind == "light" and name.isdigit():
        lights = data.get("light", [])
        if int(name) >= len(lights):
            raise ValueError(f"of is {of!r}: the file has {len(lights)} lights, from 0")
        return [lights[int(name)]]
    if kind in ("material", "texture") and name:
        if name not in data.get(kind, {}):
            raise ValueError(f"of is {of!r}: known are {', '.join(data.get(kind, {})) or 'none'}")
        return [data[kind][name]]
    if kind == "object" and name:
        found = [table for table in data.get("object", []) if fnmatchcase(str(table.get("name", "")), name)]
        if not found:
            known = ", ".join(str(table["name"]) for table in data.get("object", []) if table.get("name"))
            raise ValueError(f"of is {of!r}: no object has this name, known are {known or 'none'}")
        return found
    raise ValueError(f"of is {of!r}: known are {', '.join(TABLES)}")
