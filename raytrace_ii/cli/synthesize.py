"""Commands that list scenes and cameras and store cameras: scenes, cameras, camera."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from .common import Force, app, check_outputs, columns, progress_bar
from .words import say


@app.command()
def scenes() -> None:
    """List the scenes that come with the package."""
    from ..files.load import scene_names

    columns(scene_names())


@app.command()
def cameras() -> None:
    """List the cameras."""
    from ii_core import camera_names

    columns(dict(sorted(camera_names().items())))


@app.command()
def camera(
    name: Annotated[str, typer.Argument(help="A camera's name, or a .json file.")] = "",
    output: Annotated[Path | None, typer.Option("-o", "--output", help="A folder for L and D maps.")] = None,
    scale: Annotated[int, typer.Option(help="Divides the number of lenses.")] = 1,
    format: Annotated[str, typer.Option(help="Of the maps: png16, png8, exr or hdr.")] = "png16",
    report: Annotated[
        bool, typer.Option("--report", help="Print what the camera can do, and what limits it.")
    ] = False,
    solve: Annotated[str | None, typer.Option(help="Find what is missing: pitch=0.39,gap=0.73,pixel=0.0061")] = None,
    force: Force = False,
) -> None:
    """Store a camera as L and D maps, report on it, or solve for a missing measure."""
    from ii_core import preset_cameras, write_maps
    from ii_core.maps import check_format, map_files

    check_format(format)
    if solve is not None:
        _print_solution(solve)
        return
    if not name:
        raise ValueError("no camera is named: see raytrace-ii cameras")
    arrays = preset_cameras(name, scale=scale)
    if output is None or report:
        from ii_core.design import report as describe

        say("\n\n".join(describe(array) for array in arrays))
    if output is not None:
        check_outputs([output / file for file in map_files(arrays, format)], force, make_folder=True)
        with progress_bar(f"write {output}") as tell:
            write_maps(arrays, output, format=format, progress=lambda done, total: tell(done, total, ""))


MEASURES = {
    "pitch": "lens_pitch_mm",
    "gap": "gap_mm",
    "pixel": "pixel_pitch_mm",
    "ei": "ei_pixels",
    "angle": "view_angle_deg",
}


def _print_solution(text: str) -> None:
    from ii_core.design import solve

    given: dict[str, Any] = {}
    for item in text.split(","):
        key, _, value = item.partition("=")
        try:
            given[MEASURES[key.strip()]] = float(value)
        except (KeyError, ValueError):
            raise ValueError(f"{item!r} is no measure: {', '.join(MEASURES)} = number are known") from None
    columns({key: f"{value:.6g}" for key, value in solve(**given).items()})
