"""Command video: conversion of II-video."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .common import Force, app, check_folder, check_outputs, pair, progress_bar
from .words import say

if TYPE_CHECKING:
    from ii_core import IIVideo

TO = ("frames", "views", "quilt", "films", "parallax")


@app.command()
def video(
    source: Annotated[
        Path, typer.Argument(help="A folder of frames, a coded take, or a quilt video: name_qsCxRaA.mp4.")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="A folder; for quilt and parallax an .mp4.")],
    to: Annotated[str, typer.Option(help="frames, views, quilt, films (one a view) or parallax.")] = "parallax",
    fps: Annotated[float | None, typer.Option(help="Frames a second, in place of the source's.")] = None,
    row: Annotated[int | None, typer.Option(help="Quilt: row of views; the middle one if not given.")] = None,
    size: Annotated[str, typer.Option(help="Parallax: pixels of a frame.")] = "800x400",
    depth: Annotated[float | None, typer.Option(help="Parallax: z in mm of what appears in the plane.")] = None,
    cone: Annotated[float, typer.Option(help="Parallax: share of the viewing zone.")] = 0.9,
    force: Force = False,
) -> None:
    """Turn II-video into folders of frames or views, quilt videos, films of each view or of a moving viewer."""
    from ii_core import write_view_folders
    from ii_core.display.look import viewpoints_around, with_assumed_camera
    from ii_core.display.video import write_path_film, write_quilt_video, write_view_films
    from ii_core.formats.quilt import quilt_path

    if to not in TO:
        raise ValueError(f"unknown form {to!r}: known are {', '.join(TO)}")
    pixels = pair("size", size)
    shown = opened(source, fps)
    if to in ("quilt", "parallax"):
        target = quilt_path(output, shown.structure) if to == "quilt" else output
        if target.suffix.lower() != ".mp4" and not (to == "parallax" and target.suffix in (".gif", ".webp")):
            raise ValueError(f"{output} is no film: .mp4 is needed")
        check_outputs([target], force)
    else:
        check_folder(output, force)
    with progress_bar(f"video {source.name}") as report:

        def told(done: int, total: int) -> None:
            report(done, total, "")

        if to == "frames":
            made: Any = shown.save(output, told)
        elif to == "views":
            made = write_view_folders(shown, output, told)
        elif to == "quilt":
            made = write_quilt_video(shown, output, row=row, progress=told)
        elif to == "films":
            made = output
            write_view_films(shown, output, progress=told)
        else:
            places = viewpoints_around(with_assumed_camera(shown.structure), shown.frames, cone=cone)
            made = write_path_film(shown, output, places, size=pixels, depth_mm=depth, progress=told)
    say(f"{made}: {shown.frames} frames, {shown.fps:g} a second")


def opened(source: Path, fps: float | None = None) -> IIVideo:
    """An II-video of a folder, a coded take or a quilt video."""
    from ii_core import open_video

    if source.suffix == ".ii":
        from codec import open_take
        from ii_core.files import check_file

        check_file(source)
        return _at(open_take(source), fps)
    if source.suffix.lower() in (".mp4", ".mov", ".mkv", ".webm"):
        from ii_core.display.video import open_quilt_video
        from ii_core.files import check_file

        check_file(source)
        return _at(open_quilt_video(source), fps)
    return open_video(source, fps=fps)


def _at(video: IIVideo, fps: float | None) -> IIVideo:
    """The same frames at another rate, which is checked."""
    return video if fps is None else replace(video, fps=fps)
