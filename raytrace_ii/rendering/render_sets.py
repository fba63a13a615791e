"""Render sets: scenes in a folder of pictures, support images, projections, a contact sheet and a manifest.

The manifest holds a hash of the inputs and a hash of the content of every file. Files of the same scene, camera,
options and version are not rendered again, so that an interrupted set continues.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, Unpack

from numpy.typing import ArrayLike

from ii_core import Camera, IICamera, MapCamera, projection_camera
from ii_core.base.files import write_json
from ii_core.picture.picture import sidecar

from ..files.load import load_scene
from ..scene.hashing import content_hash
from ..scene.scene import Scene
from ..tracing.support_images import SUPPORT, SUPPORT_IMAGES
from .contact_sheet import contact_sheet
from .job import check_disparity
from .options import RenderOptions, SetKeywords, check_keywords
from .products import (
    Product,
    commit,
    damaged,
    fingerprint,
    is_done,
    is_product,
    is_same,
    manifest_kept_if_used,
    read_manifest,
    record_of,
)
from .render import render_to

SETS = {"reference": ("apples", "car", "cuboid", "dolphin", "hairdo", "mountains", "objects", "twins")}
MANIFEST, CONTACT = "manifest.json", "contact.png"
PICTURE_OPTIONS = ("samples", "error", "seed", "noise", "dtype", "texture_filter")
FLAT_PIXELS, FLAT_SAMPLES = 1024, 4  # of the 2-D projection: pixels across, samples per pixel

Progress = Callable[[str, int, int], None]


def render_set(
    name: str,
    folder: Path,
    cameras: Sequence[IICamera | MapCamera],
    *,
    poses: Sequence[ArrayLike | None],
    bits: int = 8,
    force: bool = False,
    progress: Progress | None = None,
    **options: Unpack[SetKeywords],
) -> dict[str, Any]:
    """Render a set of scenes, or the rest of it.

    The files of a scene are NAME.png, the II-picture; NAME_support.exr, its support images at the pixels' centres
    (depth, ray length, disparity if the camera has it, normals, object numbers); NAME_flat.png and
    NAME_flat_support.exr, the picture of a 2-D camera. Files of several pixel arrays are numbered.

    Parameters
    ----------
    name : str
        One of `SETS`.
    cameras : sequence
        Pixel arrays of one camera.
    poses : sequence
        Pose of each pixel array.
    bits : {8, 16}
        Bits of the pictures.
    force : bool
        Replace files of these names that are not in the manifest.
    progress : callable, optional
        Called with the name of the file, and the numbers of finished and of all tiles.
    **options
        Fields of `RenderOptions`: ``samples``, ``error``, ``seed``, ``noise``, ``texture_filter``, ``workers`` and
        ``executor``.

    Returns
    -------
    dict
        The manifest, which is also written into the folder.

    Raises
    ------
    ValueError
        If a parameter is out of range, or the folder has the manifest of another set.
    OSError
        If a file cannot be written, or exists and is not in the manifest.
    """
    if name not in SETS:
        raise ValueError(f"unknown set {name!r}: known are {', '.join(SETS)}")
    if cameras[0].model is None:
        raise ValueError("the maps have no camera parameters: a 2-D projection needs them")
    check_keywords(options, SetKeywords)
    wanted = RenderOptions(**options, dtype=f"uint{bits}")
    of_pictures = {field: getattr(wanted, field) for field in PICTURE_OPTIONS}
    old = _read_manifest(folder, name)
    claims = _claims(folder, name, len(cameras), old, force)
    manifest = {**_header(name, cameras, of_pictures), "claims": claims, "scenes": {}, CONTACT: old.get(CONTACT)}
    means = {"workers": wanted.workers, "executor": wanted.executor}
    with manifest_kept_if_used(folder / MANIFEST):
        _write_manifest(folder, manifest, old)
        for title in SETS[name]:
            scene = load_scene(title)
            scene_hash = content_hash(scene)
            entry: dict[str, Any] = {"hash": scene_hash, "products": {}}
            known = old.get("scenes", {}).get(title, {}).get("products", {})
            manifest["scenes"][title] = entry
            for kind, product in _products(folder, title, scene, scene_hash, cameras, poses, of_pictures, means):
                if not is_done(product, known.get(kind)):
                    report = _reporter(progress, product.files[0].name)
                    entry["products"][kind] = record_of(product, product.make(progress=report))
                else:
                    entry["products"][kind] = known[kind]
                _write_manifest(folder, manifest, old)
    _draw_contact(folder, name, manifest)
    write_json(folder / MANIFEST, manifest)
    return manifest


def _products(
    folder: Path, title: str, scene: Scene, scene_hash: str, cameras: Sequence[Any], poses: Sequence[Any],
    options: dict[str, Any], means: dict[str, Any],
) -> Iterator[tuple[str, Product]]:  # fmt: skip
    """Return the renders of a scene."""
    release = version("raytrace-ii")
    for i, (camera, pose) in enumerate(zip(cameras, poses, strict=True)):
        number = "" if len(cameras) == 1 else f"_{i}"
        seen = [release, scene_hash, camera, pose]
        picture, support = folder / f"{title}{number}.png", folder / f"{title}{number}_support.exr"
        images = dict.fromkeys(support_images(camera), support)

        common = {"pose": pose, "upright": camera.lenses == (1, 1), **means}
        shoot = partial(render_to, picture, scene, camera, **options, **common)
        # a single sample: one ray through the centre of every pixel, without shading
        survey = partial(render_to, None, replace(scene, lights=()), camera, support=images, **common)
        yield f"picture{number}", Product((picture,), content_hash("picture", *seen, options), shoot)
        yield f"support{number}", Product((support,), content_hash("support", *seen, list(images)), survey)
    pinhole, pose = projection_camera(cameras[0].model, FLAT_PIXELS)
    flat, behind = folder / f"{title}_flat.png", folder / f"{title}_flat_support.exr"
    images = dict.fromkeys(SUPPORT, behind)
    project = partial(
        render_to, flat, scene, pinhole, pose=pose, upright=True, support=images, samples=FLAT_SAMPLES, **means
    )
    yield "flat", Product((flat, behind), content_hash("flat", release, scene_hash, pinhole, pose), project)


def support_images(camera: Camera) -> list[str]:
    """Return all support images of a camera, except the number of samples and coverage, which takes more rays."""
    names = [name for name in SUPPORT_IMAGES if name not in ("samples", "coverage")]
    try:
        check_disparity(camera)
    except ValueError:
        names.remove("disparity")
    return names


def _reporter(progress: Progress | None, title: str) -> Callable[[int, int], None]:
    return lambda done, total: progress(title, done, total) if progress else None


def _header(name: str, cameras: Sequence[Any], options: dict[str, Any]) -> dict[str, Any]:
    return {
        "format": "ii-picture-set",
        "set": name,
        "raytrace_ii": version("raytrace-ii"),
        "commit": commit(),
        "camera": [camera.model.to_json() for camera in cameras if camera.model],
        "options": options,
    }


def _read_manifest(folder: Path, name: str) -> dict[str, Any]:
    """Return the manifest of the folder; empty if there is none."""
    manifest = read_manifest(folder / MANIFEST, "ii-picture-set", "set", name)
    if manifest and not _is_well_formed(manifest):
        raise damaged(folder / MANIFEST)
    return manifest


def _is_well_formed(manifest: dict[str, Any]) -> bool:
    """Return whether the values of a manifest have the types that this module writes."""
    claims, scenes = manifest.get("claims", []), manifest.get("scenes", {})
    if not isinstance(claims, list) or not isinstance(scenes, dict) or not all(isinstance(c, str) for c in claims):
        return False
    products = [scene.get("products", {}) if isinstance(scene, dict) else None for scene in scenes.values()]
    if not all(isinstance(made, dict) for made in products):
        return False
    records = [record for made in products if made for record in made.values()]
    if manifest.get(CONTACT) is not None:
        records.append(manifest[CONTACT])
    return all(map(is_product, records))


def _write_manifest(folder: Path, manifest: dict[str, Any], old: dict[str, Any]) -> None:
    """Write the manifest of finished renders; keep the entries of other renders."""
    scenes = dict(old.get("scenes", {}))
    for title, entry in manifest["scenes"].items():
        before = scenes.get(title, {}).get("products", {})
        scenes[title] = {**entry, "products": {**before, **entry["products"]}}
    write_json(folder / MANIFEST, {**manifest, "scenes": scenes})


def _claims(folder: Path, name: str, arrays: int, old: dict[str, Any], force: bool) -> list[str]:
    """Return the names of all files of the set; raise FileExistsError if one exists outside the manifest."""
    numbers = [""] if arrays == 1 else [f"_{i}" for i in range(arrays)]
    pictures = [f"{title}{end}.png" for title in SETS[name] for end in (*numbers, "_flat")]
    ours = [file for picture in pictures for file in (picture, sidecar(picture).name, f"{picture[:-4]}_support.exr")]
    ours.append(CONTACT)
    # Older manifests do not list sidecars: a sidecar of a listed picture belongs to the set.
    known = {file for claim in old.get("claims", ()) for file in (claim, sidecar(claim).name)}
    strange = [file for file in ours if (folder / file).exists() and file not in known]
    if strange and not force:
        raise FileExistsError(f"{folder / strange[0]} is there already and not of this set: --force replaces it")
    return ours


def _draw_contact(folder: Path, name: str, manifest: dict[str, Any]) -> None:
    flats = [manifest["scenes"][title]["products"]["flat"] for title in SETS[name]]
    key = content_hash(manifest["raytrace_ii"], [[f["sha256"] for f in flat["files"].values()] for flat in flats])
    record, path = manifest[CONTACT], folder / CONTACT
    if record and record["key"] == key and is_same(path, record["files"].get(CONTACT)):
        return
    contact_sheet(path, [(t, folder / f"{t}_flat.png", folder / f"{t}_flat_support.exr") for t in SETS[name]])
    manifest[CONTACT] = {"key": key, "files": {CONTACT: fingerprint(path)}}
