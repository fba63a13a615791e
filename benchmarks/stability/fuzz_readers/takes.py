"""Cases of the readers of takes: animation blocks, manifests, folders of frames, coded takes."""

from __future__ import annotations

import json
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator

from codec import Plan, encode_take, open_take
from codec.takes.api import _values
from codec.takes.container import head, write
from ii_core import IIPicture, open_video, video_of
from raytrace_ii import load_take
from raytrace_ii.rendering.render_take import _read_manifest

from . import seeds
from .containers import bytes_changed
from .readers import Read, _as_file, _companions, _fresh, _json, reader
from .trees import json_text, mutated, pick, toml_text

ANIMATION = seeds.DATA["ANIMATION"]
TRACKS = ANIMATION["track"]
STILL = np.eye(4).tolist()
FRAME = {"key": "0" * 64, "pose": STILL, "files": {"frame_0000.png": seeds.FILE}, "seconds": 1.5, "rays": {}}
MANIFEST = {
    "format": "ii-take",
    "version": 1,
    "take": "apples",
    "length": 3,
    "fps": 24,
    "frames": {str(number): FRAME for number in range(3)},
    "claims": [f"frame_{number:04}.png" for number in range(3)],
}
INDEX = {"format": "ii-video", "version": 1, "frames": 3, "fps": 24, "poses": [np.eye(4).tolist()] * 3}


@reader("animation")
def animation(rng: Generator, folder: Path) -> Read:
    """A scene that moves; scene and pose at instants within and outside the keyframes."""
    _companions(folder)
    tree = {**seeds.SCENES[0], "animation": mutated(ANIMATION, rng, TRACKS)}
    if rng.random() < 0.1:
        tree = mutated({**tree, "animation": ANIMATION}, rng, TRACKS)
    path = folder / "take.toml"
    path.write_bytes(_as_file(toml_text(tree), rng))

    def read() -> None:
        take = load_take(path)
        for seconds in (0.0, 0.1, take.seconds):
            take.scene_at(seconds)
            take.pose_at(seconds)

    return read


@reader("take manifest")
def take_manifest(rng: Generator, folder: Path) -> Read:
    """Frames with the manifest of their take or the index of an II-video, and another take's run into them."""
    case = _fresh(folder)
    names = [f"frame_{number:04}.png" for number in range(3)]
    if rng.random() < 0.3:
        others = ("frame_0007.png", "frame_1.png", "frame_.png", "frame_99999999999999999999.png", "frame_٣.png", "")
        names[int(rng.integers(3))] = pick(rng, others)
    for name in filter(None, names):
        (case / name).write_bytes(_frame())
        (case / f"{name}.json").write_bytes(json_text(_structure()).encode())
    index, name = pick(rng, ((MANIFEST, "manifest.json"), (INDEX, "video.json")))
    (case / name).write_bytes(_json(index, rng, (MANIFEST, INDEX)))
    fps = pick(rng, (None, None, 0, -1, 1e308))

    def read() -> None:
        if name == "manifest.json":
            _read_manifest(case, "apples")
        video = open_video(case, fps=fps)
        video.view(video.frames - 1, (0, 0, -100))

    return read


@lru_cache
def _frame() -> bytes:
    return seeds.encoded("PNG")


def _structure() -> dict[str, Any]:
    return dict(seeds.structures()[1])


@lru_cache
def _coded() -> tuple[list[Any], tuple[bytes, ...]]:
    """Header and segments of a small take."""
    rng = np.random.default_rng(0)
    pictures = [IIPicture(rng.integers(0, 256, (64, 64, 3), np.uint8), (32, 32), (2, 2)) for _ in range(4)]
    coded = encode_take(video_of(pictures), "si-h264:rate=cq", qp=40, plan=Plan(span=2))
    return _values(coded), tuple(coded.segments)


@reader("coded take")
def coded_take(rng: Generator, folder: Path) -> Read:
    """A coded take with a changed header and a correct checksum, or with damaged bytes."""
    values, segments = _coded()
    path = folder / "case.ii"
    write(path, values, segments)
    if rng.random() < 0.4:
        path.write_bytes(bytes_changed(path.read_bytes(), rng))
    else:
        parts = list(segments)
        if rng.random() < 0.3:
            at = int(rng.integers(len(parts)))
            parts[at] = bytes_changed(parts[at], rng)
        try:
            changed = json.loads(json_text(mutated(values, rng, [values])))
            head(changed)
            write(path, changed, parts)
        except (ValueError, OverflowError, RecursionError, TypeError):
            path.write_bytes(b"")  # values that no header can store are no case of this reader
    return partial(_last_frame, path, rng.random() < 0.3)


def _last_frame(path: Path, partially: bool) -> object:
    video = open_take(path, partial=partially)
    video.component(0, "si", (0, 0))
    return video[video.frames - 1]
