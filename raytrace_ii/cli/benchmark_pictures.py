"""Pictures of the benchmark: rendered in memory, or stored in a folder with hashes and a data card.

``FOLDER/PROFILE/NAME.png`` are the pictures, ``manifest.json`` has the hashes of pixels and files, and ``README.md``
is the data card. Pictures that are there and would be the same are not rendered again.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .common import check_outputs
from .progress import progress_bar, say_done
from .words import say

if TYPE_CHECKING:
    from ii_core import IIPicture
    from metrics.benchmark.profile import Profile, Reference

SET, MANIFEST, CARD = "benchmark", "manifest.json", "README.md"
FORM = "ii-benchmark-pictures"


def rendered(reference: Reference) -> IIPicture:
    """Render a reference picture."""
    from raytrace_ii import load_scene, render

    return render(load_scene(reference.scene), reference.made_camera(), **_options(reference), support=()).picture


def stored(profile: Profile, folder: Path) -> Callable[[Reference], IIPicture]:
    """Return a reader of rendered pictures of a profile.

    Raises
    ------
    ValueError
        If a picture of the profile is missing, before any work; the reader also if its pixels are not those of the
        manifest.
    """
    from ii_core import IIPicture
    from metrics.study import picture_json

    place = folder / profile.name
    known = _pixels(_manifest(place, profile))
    for reference in profile.pictures:
        if reference.name not in known:
            raise ValueError(f"{place} has no picture {reference.name}: `raytrace-ii render --set` renders it")

    def read(reference: Reference) -> IIPicture:
        path = place / f"{reference.name}.png"
        picture = IIPicture.load(path)
        if picture_json("", picture)["sha256"] != known[reference.name]:
            raise ValueError(f"{path} has other pixels than its manifest says: `raytrace-ii render --set` repairs it")
        return picture

    return read


def render_profiles(named: str, folder: Path, force: bool, workers: int | None) -> None:
    """Render the pictures of one profile, or of all for no name, and say whether they are those of the definition."""
    from metrics.benchmark.profile import profile, profile_names

    for name in [named] if named else profile_names():
        defined = profile(name)
        manifest = _render(defined, folder / defined.name, force, workers)
        found = _pixels(manifest)
        wrong = [
            reference.name for reference in defined.pictures if reference.matches(found[reference.name]) is False
        ]
        fixed = sum(reference.sha256 is not None for reference in defined.pictures)
        for reference in defined.pictures:
            say(f"{defined.name}/{reference.name}  {found[reference.name]}")
        if wrong:
            say(f"not the pixels of the definition: {', '.join(wrong)}")
        say_done(f"{folder / defined.name}: {fixed - len(wrong)} of {fixed} fixed hashes met, {len(found)} pictures")


def _render(profile: Profile, place: Path, force: bool, workers: int | None) -> dict[str, Any]:
    """Render the pictures that are missing; return the manifest."""
    from functools import partial

    from ii_core import IIPicture
    from ii_core.atomic import atomic_path
    from ii_core.files import write_json
    from ii_core.picture import sidecar
    from metrics.benchmark.card import data_card
    from metrics.study import picture_json

    from ..files.load import load_scene
    from ..rendering.products import Product, commit, is_done, manifest_kept_if_used, record_of
    from ..rendering.render import render_to
    from ..scene.hashing import content_hash

    old = _manifest(place, profile)
    files = [place / f"{reference.name}.png" for reference in profile.pictures]
    strange = [place / CARD, *files, *map(sidecar, files)] if not old else []
    check_outputs([place / MANIFEST], True, make_folder=True)
    check_outputs(strange, force)
    records: dict[str, Any] = dict(old.get("pictures", {}))
    head = {
        "format": FORM, "profile": profile.name, "version": profile.version, "raytrace_ii": version("raytrace-ii"),
        "commit": commit(),
    }  # fmt: skip
    with manifest_kept_if_used(place / MANIFEST), progress_bar(f"render {profile.name}") as bar:
        write_json(place / MANIFEST, {**head, "pictures": records})
        for reference, path in zip(profile.pictures, files, strict=True):
            scene, camera = load_scene(reference.scene), reference.made_camera()
            options = _options(reference)
            key = content_hash("benchmark", head["raytrace_ii"], content_hash(scene), camera, *options.values())
            product = Product((path, sidecar(path)), key, partial(render_to, path, scene, camera, **options))
            if is_done(product, records.get(reference.name)):
                continue
            stats = product.make(progress=partial(_report, bar, path.name), workers=workers)
            pixels = picture_json("", IIPicture.load(path))["sha256"]
            records[reference.name] = {**record_of(product, stats), "pixels": pixels}
            write_json(place / MANIFEST, {**head, "pictures": records})
    manifest = {**head, "pictures": records}
    with atomic_path(place / CARD) as temporary:
        temporary.write_text(data_card(profile, _pixels(manifest)), encoding="utf-8")
    return manifest


def _report(bar: Callable[[int, int, str], None], name: str, done: int, total: int) -> None:
    bar(done, total, name)


def _options(reference: Reference) -> dict[str, Any]:
    from ii_core import camera_pose

    return {"samples": reference.samples, "pose": camera_pose(reference.at_mm)}


def _manifest(place: Path, profile: Profile) -> dict[str, Any]:
    """Return the manifest of the folder; empty if there is none."""
    from ..rendering.products import damaged, is_product, read_manifest

    manifest = read_manifest(place / MANIFEST, FORM, "profile", profile.name)
    pictures = manifest.get("pictures", {})
    if not isinstance(pictures, dict) or not all(
        is_product(record) and isinstance(record.get("pixels"), str) for record in pictures.values()
    ):
        raise damaged(place / MANIFEST)
    return manifest


def _pixels(manifest: dict[str, Any]) -> dict[str, str]:
    """Return the hashes of pixels by the names of pictures."""
    return {name: record["pixels"] for name, record in manifest.get("pictures", {}).items()}
