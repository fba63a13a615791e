"""Rendering of takes into a folder: pictures and support images per frame, and a manifest.

The manifest holds two hashes per frame: of its inputs (scene, pose, camera, options) and of its files. Frames with
unchanged hashes are not rendered again: an interrupted take continues, and a changed keyframe renders only the frames
that it changes.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ii_core import IICamera, MapCamera
from ii_core.base import checks
from ii_core.base.files import IMAGE_TYPES, write_json
from ii_core.picture.picture import sidecar

from ..files.take import Take
from ..scene.hashing import SceneHashes, content_hash
from ..scene.scene import Scene
from ..tracing.tracer import rigid
from .options import RenderOptions, SetKeywords, check_keywords
from .products import Product, commit, damaged, is_done, is_product, manifest_kept_if_used, read_manifest, record_of
from .render import render_to

FORMAT, VERSION, MANIFEST = "ii-take", 1, "manifest.json"
PICTURE_OPTIONS = ("samples", "error", "seed", "noise", "dtype", "texture_filter")

Progress = Callable[[int, int, int], None]


def render_take(
    take: Take,
    folder: str | os.PathLike[str],
    camera: IICamera | MapCamera,
    *,
    frames: Sequence[int] | None = None,
    pose: ArrayLike | None = None,
    support: Mapping[str, Sequence[str]] | None = None,
    suffix: str = ".png",
    dtype: str = "uint8",
    force: bool = False,
    progress: Progress | None = None,
    **options: Unpack[SetKeywords],
) -> dict[str, Any]:
    """Render frames of a take, or the rest of them.

    The files of frame τ are ``frame_TTTT.png`` with its sidecar, and ``frame_TTTT_NAME`` for each file of support
    images. A frame is kept if its manifest entry has the same scene, pose, camera, options and version, and its files
    are unchanged. Each frame is recorded when it is done: a killed run loses one frame at most.

    Parameters
    ----------
    folder : path
        Created if missing.
    camera : IICamera or MapCamera
        One pixel array.
    frames : sequence of int, optional
        Frame numbers, from 0; all if not given.
    pose : array_like, (4, 4), optional
        Pose of the camera; the motion in the take multiplies it from the left.
    support : mapping, optional
        Names of files, as ``support.exr``, to the support images in each.
    suffix : str
        Type of the pictures: .png, .tif or .exr.
    force : bool
        Replace files of these names that are not in the manifest.
    progress : callable, optional
        Called with the frame number, and the numbers of blocks done and of all blocks.
    **options
        ``samples``, ``error``, ``seed``, ``noise``, ``texture_filter``, ``workers``, ``executor``: `RenderOptions`.

    Returns
    -------
    dict
        The manifest: ``frames`` by number, each with key, pose, files, seconds and rays; the take's frame rate.

    Raises
    ------
    TypeError, ValueError
        If an argument is of the wrong type or out of range, or the folder holds another take.
    FileExistsError
        If a file exists that is not in the manifest, without ``force``.
    OSError
        If a file cannot be written.
    """
    check_keywords(options, SetKeywords)
    _check(take, folder, camera, support, suffix, progress)
    checks.flag("force", force)
    numbers, base = _numbers(take, frames), rigid(pose)
    wanted = RenderOptions(dtype=dtype, pose=pose, **options)
    of_pictures = {field: getattr(wanted, field) for field in PICTURE_OPTIONS}
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    old = _read_manifest(folder, take.name)
    manifest = {**_header(take, camera, of_pictures), "frames": dict(old.get("frames", {}))}
    means = {"workers": wanted.workers, "executor": wanted.executor}
    hashes = SceneHashes()
    manifest["claims"] = _claims(folder, numbers, support or {}, suffix, old, force)
    with manifest_kept_if_used(folder / MANIFEST):
        write_json(folder / MANIFEST, manifest)
        for number in numbers:
            scene, stands = take.scene_at(number / take.fps), take.pose_at(number / take.fps) @ base
            scene_hash = hashes.of(scene)
            product = _product(
                folder, number, scene, (manifest["raytrace_ii"], scene_hash), stands, camera, support or {}, suffix,
                of_pictures, means,
            )  # fmt: skip
            if is_done(product, manifest["frames"].get(str(number))):
                continue
            report = partial(progress, number) if progress else None
            made = record_of(product, product.make(progress=report))
            manifest["frames"][str(number)] = {"pose": stands.tolist(), **made}
            write_json(folder / MANIFEST, manifest)
    return manifest


def frame_file(folder: Path, number: int, suffix: str) -> Path:
    """Return the path of a frame's picture."""
    return folder / f"frame_{number:04}{suffix}"


def _product(
    folder: Path, number: int, scene: Scene, made_by: tuple[str, str], pose: Any, camera: Any,
    support: Mapping[str, Sequence[str]], suffix: str, options: dict[str, Any], means: dict[str, Any],
) -> Product:  # fmt: skip
    """Return a frame's files and the hash of their inputs; ``made_by`` holds program version and scene hash."""
    picture = frame_file(folder, number, suffix)
    images: dict[str, list[Path]] = {}
    for name, kinds in support.items():
        for kind in kinds:
            images.setdefault(kind, []).append(_beside(picture, name))
    files = (picture, *dict.fromkeys(path for paths in images.values() for path in paths))
    key = content_hash(
        "frame", *made_by, camera, pose, options, suffix,
        {name: list(kinds) for name, kinds in support.items()},
    )  # fmt: skip
    make = partial(
        render_to, picture, scene, camera, pose=pose, upright=camera.lenses == (1, 1), support=images, **options,
        **means,
    )  # fmt: skip
    return Product(files, key, make)


def _beside(picture: Path, name: str) -> Path:
    return picture.with_name(f"{picture.stem}_{name}")


def _check(take: Any, folder: Any, camera: Any, support: Any, suffix: Any, progress: Any) -> None:
    """Raise TypeError or ValueError for an argument of a wrong type, or a suffix of no picture type."""
    checks.instance(Take)("take", take)
    checks.path("folder", folder)
    checks.instance(IICamera, MapCamera)("camera", camera)
    if support is not None:
        checks.mapping("support", support)
        for name, kinds in support.items():
            checks.text("support has a name that", name)
            checks.list_of(str)(f"support[{name!r}]", kinds)
    checks.one_of(*IMAGE_TYPES)("suffix", suffix)
    if progress is not None:
        checks.callable_("progress", progress)


def _numbers(take: Take, frames: Sequence[int] | None) -> list[int]:
    if frames is not None:
        checks.sequence("frames", frames)
    numbers = list(range(take.frames) if frames is None else frames)
    if not numbers:
        raise ValueError("frames is empty: at least one number is needed")
    for number in numbers:
        if not isinstance(number, int | np.integer) or not 0 <= number < take.frames:
            raise ValueError(f"frames holds {number!r}: {take.name} has {take.frames}, from 0 to {take.frames - 1}")
    return numbers


def _claims(
    folder: Path, numbers: Sequence[int], support: Mapping[str, Any], suffix: str, old: Mapping[str, Any], force: bool
) -> list[str]:
    """Return the names of all files of the take; raise FileExistsError if one exists outside the manifest."""
    known = set(old.get("claims", ()))
    ours = [path.name for number in numbers for path in _files(folder, number, support, suffix)]
    strange = [name for name in ours if name not in known and (folder / name).exists()]
    if strange and not force:
        raise FileExistsError(f"{folder / strange[0]} is there already and not of this take: --force replaces it")
    return sorted(known | set(ours))


def _files(folder: Path, number: int, support: Mapping[str, Any], suffix: str) -> Iterator[Path]:
    picture = frame_file(folder, number, suffix)
    yield from (picture, sidecar(picture), *(_beside(picture, name) for name in support))


def _header(take: Take, camera: Any, options: dict[str, Any]) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "version": VERSION,
        "take": take.name,
        "length": take.frames,
        "fps": take.fps,
        "raytrace_ii": version("raytrace-ii"),
        "commit": commit(),
        "camera": camera.model.to_json() if camera.model else None,
        "options": options,
    }


def _read_manifest(folder: Path, name: str) -> dict[str, Any]:
    """Return the manifest of the folder; empty if there is none."""
    manifest = read_manifest(folder / MANIFEST, FORMAT, "take", name)
    entries, claims = manifest.get("frames"), manifest.get("claims")
    sound = isinstance(claims, list) and isinstance(entries, dict) and all(map(is_product, entries.values()))
    if manifest and not sound:
        raise damaged(folder / MANIFEST)
    return manifest
