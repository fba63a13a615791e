"""Data card of a profile: purpose, scene, camera and hash of each picture."""

from __future__ import annotations

from collections.abc import Mapping

from .profile import Profile, Reference

CAPTION = "SHA-256 is that of the pixels (rows of R, G, B, one byte each, frame after frame); z is in mm."
HEAD = ("picture", "what it is for", "scene", "camera", "lenses, pixels under each", "samples", "SHA-256")
PHOTOGRAPHS = ("picture", "camera", "views, pixels of each", "repository", "licence", "SHA-256")


def card_table(profile: Profile, found: Mapping[str, str] | None = None) -> list[str]:
    """Return the table of a data card in Markdown.

    Parameters
    ----------
    profile : Profile
    found : mapping of str to str, optional
        Hashes of rendered pixels by name, which the table shows instead of those of the definition.
    """
    head = PHOTOGRAPHS if any(reference.source for reference in profile.pictures) else HEAD
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    for reference in profile.pictures:
        sha256 = reference.sha256 if found is None else found.get(reference.name)
        about = () if reference.source else (reference.use,)
        cells = (reference.name, *about, *_origin(reference), f"`{sha256[:12]}`" if sha256 else "not fixed")
        lines.append(f"| {' | '.join(cells)} |")
    return [*lines, "", CAPTION]


def data_card(profile: Profile, found: Mapping[str, str]) -> str:
    """Return the data card of rendered pictures as a page of Markdown."""
    wrong = [name for reference in profile.pictures if reference.matches(found[name := reference.name]) is False]
    told = f"**Not the pixels of the definition:** {', '.join(wrong)}." if wrong else "All fixed hashes are met."
    lines = [
        f"# Data of benchmark {profile.name}, version {profile.version}",
        "",
        profile.about,
        "",
        *card_table(profile, found),
        "",
        told,
        "",
        "Pictures are rendered from scenes of this package, 8 bit, sRGB, without sensor noise, seed 0. They suit",
        "comparisons of coders. They do not show noise, blur or errors of real cameras.",
        "",
    ]
    return "\n".join(lines)


def _origin(reference: Reference) -> tuple[str, ...]:
    """Return scene, camera, structure and samples of a rendered picture; camera, views, place, licence of another."""
    if (source := reference.source) is not None and reference.views and reference.view_pixels:
        views, size = (f"{across}×{down}" for across, down in (reference.views, reference.view_pixels))
        link = f"{source.repository}/tree/{source.commit}/{_escaped(source.path)}"
        return source.camera, f"{views}, {size}", f"[{source.repository.split('/', 3)[-1]}]({link})", source.licence
    camera = reference.made_camera()
    (k, l), (u, v) = camera.lenses, camera.ei_pixels
    return _scene(reference), _camera(reference), f"{k}×{l}, {u}×{v}", str(reference.samples)


def _escaped(path: str) -> str:
    return path.replace("(", "%28").replace(")", "%29")


def _scene(reference: Reference) -> str:
    """Return the name of a scene, and which frames of its take are used."""
    return reference.scene + (f", frames 0–{reference.frames - 1}" if reference.frames else "")


def _camera(reference: Reference) -> str:
    """Return the name of a camera, its scale and its place."""
    name = "converged views" if not isinstance(reference.camera, str) else f"`{reference.camera}`"
    scale = f", scale {reference.scale}" if reference.scale != 1 else ""
    return f"{name}{scale}" + (f" at z = {reference.at_mm[2]:g}" if any(reference.at_mm) else "")
