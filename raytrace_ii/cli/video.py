"""Command video: conversion of II-video."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .common import Force, app, check_folder, check_outputs, check_unused, pair, with_camera
from .progress import progress_bar, say_done
from .quilts import SIZE, For, QuiltPlan, Tiles, Whole

if TYPE_CHECKING:
    from ii_core import IIVideo

FILMS = (".mp4", ".mov", ".mkv", ".webm")
TO = ("frames", "views", "quilt", "films", "parallax")
PARALLAX = {"size", "plane", "cone"}
QUILT = {"for_", "tiles", "whole", *PARALLAX}
USED = {"quilt": QUILT, "parallax": PARALLAX}  # options that other forms do not use


@app.command()
def video(
    context: typer.Context,
    source: Annotated[
        Path, typer.Argument(help="A folder of frames, a coded take, or a quilt video: name_qsCxRaA.mp4.")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="A folder; for quilt and parallax an .mp4.")],
    to: Annotated[str, typer.Option(help="frames, views, quilt, films (one per view) or parallax.")] = "parallax",
    fps: Annotated[float | None, typer.Option(help="Frames per second, in place of the source's.")] = None,
    for_: For = None,
    tiles: Tiles = None,
    whole: Whole = False,
    size: Annotated[
        str | None, typer.Option(help="Pixels of a tile or of a frame of parallax; 800x400 by default.")
    ] = None,
    plane: Annotated[
        float | None,
        typer.Option(help="Quilt, parallax: z in mm of the scene plane that appears in the plane of the display."),
    ] = None,
    cone: Annotated[
        float | None,
        typer.Option(help="Quilt, parallax: share of the viewing zone; 0.9 by default, or the display's."),
    ] = None,
    force: Force = False,
) -> None:
    """Convert II-video to folders of frames or views, quilt videos, films of each view or of a moving viewer."""
    from ii_core import IIVideo, write_view_folders
    from ii_core.base.atomic import atomic_folder
    from ii_core.display.look import viewpoints_around
    from ii_core.display.video import write_path_film, write_quilt_video, write_view_films

    if to not in TO:
        raise ValueError(f"unknown form {to!r}: known are {', '.join(TO)}")
    check_unused(context, f"--to {to}", *QUILT - USED.get(to, set()))
    plan = QuiltPlan(for_, tiles, size, cone, whole) if to == "quilt" else None
    pixels = pair("size", SIZE if size is None else size)
    shown = opened(source, fps)
    if to in ("quilt", "parallax"):
        target = output if plan is None else plan.path(output)
        if target.suffix.lower() != ".mp4" and not (to == "parallax" and target.suffix in (".gif", ".webp")):
            raise ValueError(f"{output} is no film: .mp4 is needed")
        check_outputs([target], force)
    else:
        check_folder(output, force)
    made = output
    with progress_bar(f"video {source.name}") as report:

        def told(done: int, total: int) -> None:
            report(done, total, "")

        if plan is not None:
            options = plan.options(with_camera(shown.structure, str(source)), plane)
            made = write_quilt_video(shown, output, plan.tiles, progress=told, **options)
        elif to == "parallax":
            share = 0.9 if cone is None else cone
            places = viewpoints_around(with_camera(shown.structure, str(source)), shown.frames, cone=share)
            made = write_path_film(shown, output, places, size=pixels, depth_mm=plane, progress=told)
        else:
            writers: dict[str, Any] = {"frames": IIVideo.save, "views": write_view_folders, "films": write_view_films}
            with atomic_folder(output) as folder:
                writers[to](shown, folder, progress=told)
    say_done(f"{made}: {shown.frames} frames, {shown.fps:g} a second")


def is_take_source(path: Path) -> bool:
    """Return whether a path is an II-video: a folder, a film, or a coded take by any name."""
    from ii_core.base.files import IMAGE_TYPES

    if path.suffix.lower() in (*IMAGE_TYPES, *FILMS) or not path.is_file():
        return path.is_dir() or path.suffix.lower() in FILMS
    from codec import is_take

    return is_take(path)


def compared_takes(source: Path, compare: Path | None) -> tuple[IIVideo, IIVideo | None, dict[str, Any]]:
    """Return both takes, and table and labels of their comparison in the viewer."""
    original = opened(source)
    if compare is None:
        return original, None, {}
    if not is_take_source(compare):
        raise ValueError(f"{compare} is no take, but {source} is: a folder of frames or a coded take is needed")
    from metrics import measure_take

    decoded = opened(compare)
    if decoded.frames != original.frames:
        raise ValueError(
            f"{compare} has {decoded.frames} frames, {source} {original.frames}: the same number is needed"
        )
    with progress_bar(f"measure {compare.name}") as report:
        quality = measure_take(original, decoded, progress=lambda done, total: report(done, total, ""))
    rows = [
        ("Q_global", f"{quality.pooled_psnr:.2f} dB"),
        ("Q_global worst frame", f"{quality.worst_psnr:.2f} dB"),
        ("flicker", f"{quality.mean_flicker:.3f} 8-bit steps"),
    ]
    label = ", ".join([*coding(compare), rows[0][1]])
    return original, decoded, {"quality_rows": rows, "labels": ("original", label)}


def coding(path: Path) -> list[str]:
    """Return scheme and rate of a coded picture or take, or the name of a picture or folder."""
    from ii_core.base.files import IMAGE_TYPES

    if path.is_dir() or path.suffix.lower() in (*IMAGE_TYPES, *FILMS):
        return [path.stem]
    from codec import Encoded, EncodedTake, is_take

    coded = (EncodedTake if is_take(path) else Encoded).load(path)
    return [coded.scheme, f"{coded.bpp:.3g} bpp"]


def opened(source: Path, fps: float | None = None) -> IIVideo:
    """Open a folder, a coded take or a quilt video as II-video."""
    from ii_core import open_video

    if source.suffix != ".ii" and (source.is_dir() or not is_take_source(source)):
        return open_video(source, fps=fps)
    from ii_core.base.files import check_file

    check_file(source)
    if source.suffix.lower() in FILMS:
        from ii_core.display.video import open_quilt_video

        return _at(open_quilt_video(source), fps)
    from codec import open_take

    return _at(open_take(source), fps)


def _at(video: IIVideo, fps: float | None) -> IIVideo:
    """Return the same frames at another, checked rate."""
    return video if fps is None else replace(video, fps=fps)
