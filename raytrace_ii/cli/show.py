"""Commands that show II-pictures: view in a browser, display for 3-D displays and films."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .common import (
    Angle,
    Force,
    app,
    check_outputs,
    check_page,
    check_unused,
    image_file,
    load_any,
    pair,
    with_camera,
)
from .plugins import Plugins, load_plugins
from .progress import progress_bar, say_done, spinner
from .quilts import SIZE, For, QuiltPlan, Tiles, Whole
from .video import coding, compared_takes, is_take_source

if TYPE_CHECKING:
    from ii_core import IIPicture

ACROSS = {"plane", "cone"}  # options of views over the viewing zone
USED = {
    "quilt": {"for_", "tiles", "whole", *ACROSS},
    "lenticular": {"pitch", "slope", "centre", "calibration", "whole", *ACROSS},
    "simulation": {"at", "fill"},
    "parallax": {"frames", "fps", *ACROSS},
}


@app.command()
def view(
    picture: Annotated[
        Path,
        typer.Argument(
            help="An II-picture with its sidecar, a coded file, or a take: folder of frames, coded take, quilt video."
        ),
    ],
    output: Annotated[Path | None, typer.Option("-o", "--output", help="The page, .html.")] = None,
    compare: Annotated[
        Path | None, typer.Option(help="A decoded II-picture or take, or a coded file, to compare.")
    ] = None,
    depth: Annotated[Path | None, typer.Option(help="Map of z in mm (.exr) for focusing by a click.")] = None,
    angle: Angle = None,
    lossless: Annotated[bool, typer.Option("--lossless", help="Lossless pixels, in a larger page.")] = False,
    serve: Annotated[
        bool, typer.Option("--serve", help="Serve the page on this machine instead of writing it.")
    ] = False,
    port: Annotated[int, typer.Option(help="Port of --serve; 0 for any free one.")] = 0,
    plugin: Plugins = None,
    force: Force = False,
) -> None:
    """Write a viewer page for a browser: parallax, focus, comparison, stereo, playback of takes."""
    from ii_core.base.files import read_depth
    from ii_core.display.viewer import JPEG_QUALITY, write_viewer, write_viewer_folder

    load_plugins(plugin)
    check_page(output, serve, port, force)
    is_take = is_take_source(picture)
    if depth is not None and is_take:
        raise ValueError(f"--depth is the map of one picture, {picture} is a take: leave it out")
    if angle is not None and is_take:
        raise ValueError(f"--angle is that of a picture, {picture} is a take: leave it out")
    options: dict[str, Any] = {"title": picture.stem, "quality": None if lossless else JPEG_QUALITY}
    original, decoded, more = compared_takes(picture, compare) if is_take else _compared(picture, compare, angle)
    options |= more
    if depth is not None:
        options["depth"] = read_depth(depth, size=original.size)
    with progress_bar(f"view {picture.name}") as report:
        options["progress"] = lambda done, total: report(done, total, "")
        if output is not None:
            size = write_viewer(output, original, decoded, **options)
            say_done(f"{output}: {size / 2**20:.1f} MB")
            return
        import tempfile

        from .server import serve_folder

        folder = tempfile.TemporaryDirectory(prefix="raytrace-ii-")
        write_viewer_folder(folder.name, original, decoded, **options)
    with folder:
        serve_folder(folder.name, port)


def _compared(
    picture: Path, compare: Path | None, angle: float | None
) -> tuple[IIPicture, IIPicture | None, dict[str, Any]]:
    """Return both pictures, and table and labels of their comparison."""
    from metrics import quality_rows

    original = with_camera(load_any(picture), str(picture), angle)
    if compare is None:
        return original, None, {}
    decoded = load_any(compare)
    rows = quality_rows(original, decoded)
    label = ", ".join([*coding(compare), rows[0][1]])
    return original, decoded, {"quality_rows": rows, "labels": ("original", label)}


@app.command()
def display(
    context: typer.Context,
    picture: Annotated[Path, typer.Argument(help="An II-picture with its sidecar, or a coded file.")],
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            help="A picture, for parallax .mp4, .gif or .webp.",
        ),
    ],
    kind: Annotated[str, typer.Option("--as", help="quilt, lenticular, simulation or parallax.")] = "parallax",
    for_: For = None,
    size: Annotated[
        str | None,
        typer.Option(help="Pixels of a tile, of the panel, of the eye's picture or of a frame; 800x400 by default."),
    ] = None,
    plane: Annotated[
        float | None, typer.Option(help="z in mm of the scene plane that appears in the plane of the display.")
    ] = None,
    cone: Annotated[
        float | None,
        typer.Option(help="Share of the viewing zone that the views cover; 0.9 by default, or the display's."),
    ] = None,
    angle: Angle = None,
    tiles: Tiles = None,
    whole: Whole = False,
    pitch: Annotated[float, typer.Option(help="Lenticular: lens pitch in pixels.")] = 5.0,
    slope: Annotated[float, typer.Option(help="Lenticular: shift of lenses to the left per row, in pixels.")] = 0.0,
    centre: Annotated[
        float, typer.Option(help="Lenticular: column of a border between lenses, in the top row.")
    ] = 0.0,
    calibration: Annotated[
        Path | None, typer.Option(help="Lenticular: visual.json of a Looking Glass, for its panel's own picture.")
    ] = None,
    at: Annotated[str | None, typer.Option(help="Simulation: position of the eye, mm: x,y,z.")] = None,
    fill: Annotated[float, typer.Option(help="Simulation: diameter of a lens over the pitch.")] = 1.0,
    frames: Annotated[int, typer.Option(help="Parallax: views around the viewing zone, at most 3000.")] = 60,
    fps: Annotated[int, typer.Option(help="Parallax: frames per second.")] = 25,
    force: Force = False,
) -> None:
    """Write pictures for other displays, and films with parallax.

    quilt: tiles for Looking Glass displays; lenticular: views interlaced for slanted cylindrical lenses; simulation:
    the integral-imaging display seen from one position; parallax: a film around the viewing zone.
    """
    from ii_core.base.files import write_image
    from ii_core.display.lenticular import lenticular
    from ii_core.display.quilt import quilt
    from ii_core.display.simulate import display_simulation

    if is_take_source(picture):
        raise ValueError(f"{picture} is a take: raytrace-ii video {picture} shows takes, as quilts and films")
    if kind not in USED:
        raise ValueError(f"unknown kind {kind!r}: known are {', '.join(USED)}")
    check_unused(context, f"--as {kind}", *set().union(*USED.values()) - USED[kind])
    if calibration is not None:
        check_unused(context, "--calibration", "size", "pitch", "slope", "centre")
        _native(picture, output, calibration, plane, cone, whole, angle, force)
        return
    if kind == "lenticular":
        check_unused(context, "--as lenticular without --calibration", "whole")
    plan = QuiltPlan(for_, tiles, size, cone, whole) if kind == "quilt" else None
    pixels, share = pair("size", SIZE if size is None else size), 0.9 if cone is None else cone
    if plan is not None:
        output = plan.path(output)
    if kind == "parallax":
        check_outputs([output], force)
        _film(with_camera(load_any(picture), str(picture), angle), output, pixels, plane, share, frames, fps)
        return
    check_outputs(image_file(output, "uint8"), force)
    original = with_camera(load_any(picture), str(picture), angle)
    options: dict[str, Any] = {"size": pixels, "depth_mm": plane, "cone": share}
    with spinner(f"{kind} of {picture.name}"):
        if plan is not None:
            made = quilt(original, plan.tiles, **plan.options(original, plane))
        elif kind == "lenticular":
            made = lenticular(original, pitch_px=pitch, slope=slope, centre_px=centre, **options)
        else:
            made = display_simulation(original, _eye(original, at), size=pixels, fill=fill)
        write_image(output, made)
    say_done(f"{output}: {made.shape[1]}×{made.shape[0]} px")


def _native(
    picture: Path, output: Path, calibration: Path, plane: float | None, cone: float | None, whole: bool,
    angle: float | None, force: bool,
) -> None:  # fmt: skip
    """Write the picture of a Looking Glass's own panel."""
    from ii_core.base.files import write_image
    from ii_core.display.looking_glass import native_picture, read_looking_glass

    check_outputs(image_file(output, "uint8"), force)
    display = read_looking_glass(calibration)
    original = with_camera(load_any(picture), str(picture), angle)
    with spinner(f"panel picture of {picture.name}"):
        write_image(output, native_picture(original, display, depth_mm=plane, cone=cone, whole=whole))
    say_done(f"{output}: {display.size[0]}×{display.size[1]} px, for the display of {calibration.name} alone")


def _film(
    original: IIPicture, output: Path, size: tuple[int, int], depth: float | None, cone: float, count: int, fps: int
) -> None:
    from ii_core.display.film import write_animation
    from ii_core.display.look import focused_view, viewpoints_around

    places = viewpoints_around(original, count, cone=cone)
    with progress_bar(f"film {output.name}") as report:

        def frames() -> Iterator[Any]:
            for done, place in enumerate(places, 1):
                yield focused_view(original, place, size=size, depth_mm=depth)
                report(done, count, "")

        write_animation(output, frames(), fps=fps)
    say_done(f"{output}: {count} frames of {size[0]}×{size[1]} px")


def _eye(picture: Any, at: str | None) -> Any:
    """Return the given position of the eye, by default the front viewpoint."""
    from ii_core import five_viewpoints

    if at is None:
        return five_viewpoints(picture.camera)["front"]
    try:
        x, y, z = (float(n) for n in at.split(","))
    except ValueError:
        raise ValueError(f"at is {at!r}: three numbers x,y,z are needed") from None
    return x, y, z
