"""Pictures of the benchmark: rendered in memory, or stored in a folder with hashes and a data card.

``FOLDER/PROFILE/NAME.png`` are the pictures, folders ``NAME`` the frames of videos. ``manifest.json`` has the hashes
of pixels and files, and ``README.md`` is the data card. What is there and would be the same is not rendered again.
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
    from metrics.benchmark.profile import Profile, Reference
    from metrics.benchmark.subject import Subject

MANIFEST, CARD = "manifest.json", "README.md"
FORM = "ii-benchmark-pictures"


def rendered(reference: Reference) -> Subject:
    """Render a reference picture or video; a photograph raises ValueError."""
    if reference.source is not None:
        raise ValueError(
            f"{reference.name} is a photograph: --pictures names its folder, --list says where it is had"
        )
    from ii_core import video_of
    from raytrace_ii import load_scene, load_take, render

    camera, options = reference.made_camera(), _options(reference)
    if reference.frames is None:
        return render(load_scene(reference.scene), camera, **options, support=()).picture
    take, base = load_take(reference.scene), options.pop("pose")
    instants = [frame / take.fps for frame in range(reference.frames)]
    frames = [
        render(take.scene_at(at), camera, pose=take.pose_at(at) @ base, **options, support=()).picture
        for at in instants
    ]
    return video_of(frames, fps=take.fps)


def stored(profile: Profile, folder: Path) -> Callable[[Reference], Subject]:
    """Return a reader of photographs, and of rendered pictures and videos, of a profile.

    Raises
    ------
    ValueError
        If a picture of the profile is missing, before any work; the reader also if its pixels are not those of the
        manifest, or of the definition for a photograph.
    """
    from metrics.benchmark.subject import identity

    place = folder / profile.name
    known = _pixels(_manifest(place, profile))
    for reference in profile.pictures:
        if reference.source is not None:
            if (wrong := _wrong_photograph(reference, profile, folder)) is not None:
                raise ValueError(f"{wrong}: `raytrace-ii benchmark {profile.name} --list` says where it is had")
            known[reference.name] = str(reference.sha256)
        elif reference.name not in known:
            raise ValueError(f"{place} has no picture {reference.name}: `raytrace-ii render --set` renders it")

    def read(reference: Reference) -> Subject:
        path, subject = _read(
            reference, place if reference.source is None else photograph(reference, profile, folder)
        )
        if identity("", subject)["sha256"] != known[reference.name]:
            raise ValueError(f"{path} has other pixels than its manifest says: `raytrace-ii render --set` repairs it")
        return subject

    return read


def photograph(reference: Reference, profile: Profile, folder: Path) -> Path:
    """Return the folder of a photograph: that of the profile's name inside ``folder``, or ``folder`` itself."""
    inside = folder / profile.name
    return inside if (inside / f"{reference.name}.png").is_file() else folder


def _wrong_photograph(reference: Reference, profile: Profile, folder: Path) -> str | None:
    """Return what is wrong with a photograph in a folder; None if it has the pixels of the definition."""
    from metrics.benchmark.subject import identity

    place = photograph(reference, profile, folder)
    if not (place / f"{reference.name}.png").is_file():
        return f"{folder} has no picture {reference.name}"
    path, subject = _read(reference, place)
    if reference.matches(identity("", subject)["sha256"]):
        return None
    return f"{path} has other pixels than profile {profile.name} fixes"


def listing(profile: Profile, folder: Path | None) -> list[str]:
    """Return a line per picture of a profile; of a photograph also where it is had and the command that makes it."""
    lines = []
    for reference in profile.pictures:
        if (source := reference.source) is None:
            lines.append(f"{reference.name}: rendered from scene {reference.scene}")
            continue
        wrong = "not looked for, --pictures names a folder" if folder is None else None
        wrong = wrong or (folder and _wrong_photograph(reference, profile, folder)) or "there, pixels as defined"
        (columns, rows), (width, height) = reference.views or (0, 0), reference.view_pixels or (0, 0)
        lines += [
            f"{reference.name}: {wrong}",
            f"  {source.camera}, {columns}×{rows} views of {width}×{height} px",
            f"  {source.repository} at {source.commit}: {source.path}; licence: {source.licence}",
            f"  {source.command(reference.name, str(folder or 'DIR'))}",
        ]
    return lines


def render_profiles(named: str, folder: Path, force: bool, workers: int | None) -> None:
    """Render the pictures of one profile, or of all for no name, and say whether they are those of the definition."""
    from metrics.benchmark.profile import profile, profile_names

    for name in [named] if named else profile_names():
        defined = profile(name)
        if any(reference.source is not None for reference in defined.pictures):
            if named:
                raise ValueError(
                    f"{name} has photographs: `raytrace-ii benchmark {name} --list` says where they are had"
                )
            continue
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
    from ii_core.base.atomic import atomic_path
    from ii_core.base.files import write_json
    from ii_core.picture.picture import sidecar
    from metrics.benchmark.card import data_card
    from metrics.benchmark.subject import identity

    from ..rendering.products import commit, manifest_kept_if_used

    old = _manifest(place, profile)
    files = [place / f"{reference.name}.png" for reference in profile.pictures if reference.frames is None]
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
        for reference in profile.pictures:
            before = records.get(reference.name)
            make = _made_picture if reference.frames is None else _made_video
            record = make(reference, place, before, force, bar, workers)
            if record is not before:
                records[reference.name] = {**record, "pixels": identity("", _read(reference, place)[1])["sha256"]}
                write_json(place / MANIFEST, {**head, "pictures": records})
    manifest = {**head, "pictures": records}
    with atomic_path(place / CARD) as temporary:
        temporary.write_text(data_card(profile, _pixels(manifest)), encoding="utf-8")
    return manifest


def _made_picture(
    reference: Reference, place: Path, before: dict[str, Any] | None, force: bool, bar: Any, workers: int | None
) -> dict[str, Any]:
    """Render a picture unless it is there; return its record, ``before`` if nothing changed."""
    from functools import partial

    from ii_core.picture.picture import sidecar

    from ..files.load import load_scene
    from ..rendering.products import Product, is_done, record_of
    from ..rendering.render import render_to
    from ..scene.hashing import content_hash

    path = place / f"{reference.name}.png"
    scene, camera, options = load_scene(reference.scene), reference.made_camera(), _options(reference)
    key = content_hash("benchmark", version("raytrace-ii"), content_hash(scene), camera, *options.values())
    product = Product((path, sidecar(path)), key, partial(render_to, path, scene, camera, **options))
    if before is not None and is_done(product, before):
        return before
    return record_of(product, product.make(progress=partial(_report, bar, path.name), workers=workers))


def _made_video(
    reference: Reference, place: Path, before: dict[str, Any] | None, force: bool, bar: Any, workers: int | None
) -> dict[str, Any]:
    """Render the frames of a video that are not there; return the record of its files."""
    from ..files.take import load_take
    from ..rendering.products import fingerprint
    from ..rendering.render_take import render_take

    folder, frames = place / reference.name, range(reference.frames or 0)

    def report(frame: int, done: int, total: int) -> None:
        bar(done, total, f"{reference.name}, frame {frame}")

    render_take(
        load_take(reference.scene), folder, reference.made_camera(), frames=frames, force=force, progress=report,
        workers=workers, **_options(reference),
    )  # fmt: skip
    files = [folder / f"frame_{frame:04}.png" for frame in frames]
    record = {"key": folder.name, "files": {path.name: fingerprint(path) for path in files}}
    same = before is not None and before["files"] == record["files"]
    return before if same and before is not None else record


def _read(reference: Reference, place: Path) -> tuple[Path, Subject]:
    """Return the path and the content of a stored picture or video."""
    from ii_core import IIPicture, open_video

    if reference.frames is None:
        path = place / f"{reference.name}.png"
        return path, reference.part(IIPicture.load(path))
    path = place / reference.name
    video = open_video(path)
    if video.frames != reference.frames:
        raise ValueError(f"{path} has {video.frames} frames: {reference.frames} are needed")
    return path, video


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
