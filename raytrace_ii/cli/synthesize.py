"""Commands that list scenes and cameras and store cameras: scenes, cameras, camera."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from .common import Force, app, check_only, check_outputs, columns, pair
from .progress import progress_bar
from .words import say


@app.command()
def scenes() -> None:
    """List the scenes of the package."""
    from ..files.load import scene_names

    columns(scene_names())


@app.command()
def cameras() -> None:
    """List the cameras."""
    from ii_core import camera_names

    columns(dict(sorted(camera_names().items())))


@app.command()
def camera(
    context: typer.Context,
    name: Annotated[str, typer.Argument(help="A camera's name, a .json file, or an II-picture.")] = "",
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="A folder for L and D maps; with --design a camera file, .json."),
    ] = None,
    scale: Annotated[int, typer.Option(help="Divides the number of lenses.")] = 1,
    format: Annotated[str, typer.Option(help="Format of the maps: png16, png8, exr or hdr.")] = "png16",
    spread: Annotated[
        str | None,
        typer.Option(help="With -o, store point-spread functions, too, for a depth in mm, inf, or a depth .exr."),
    ] = None,
    report: Annotated[bool, typer.Option("--report", help="Print properties and limits of the camera.")] = False,
    design: Annotated[
        str | None,
        typer.Option(
            help="A display: panel=15.6in,pixels=3840x2160,pitch=1mm,distance=600mm; also gap, angle, start, lenses, "
            "enlarge."
        ),
    ] = None,
    solve: Annotated[
        str | None, typer.Option(help="Solve for the missing lengths: pitch=0.39,gap=0.73,pixel=0.0061")
    ] = None,
    set_: Annotated[
        str | None,
        typer.Option(
            "--set",
            help="Replace the camera of an II-picture, given instead of a name: angle=30; pixel=0.01,gap=3; "
            "or baseline=20,focal=50,sensor=35,focus=900.",
        ),
    ] = None,
    force: Force = False,
) -> None:
    """Store a camera as L and D maps, print its properties, design one for a panel, or solve for missing lengths."""
    from ii_core import preset_cameras, write_maps
    from ii_core.camera.maps import check_format, map_files

    check_format(format)
    if set_ is not None:
        from .pictures import set_camera

        check_only(context, "--set replaces the camera of a picture", {"name", "set_"})
        set_camera(Path(name), set_)
        return
    if solve is not None:
        check_only(context, "--solve is all of its command", {"solve"})
        _print_solution(solve)
        return
    if design is not None:
        check_only(context, "--design describes the camera", {"design", "output", "report", "force"})
        _design(design, output, force)
        return
    if not name:
        raise ValueError("a camera is needed: `raytrace-ii cameras` lists cameras")
    if spread is not None and output is None:
        raise ValueError("--spread stores point-spread functions beside camera maps: -o is needed")
    arrays = preset_cameras(name, scale=scale)
    files, maps = map_files(arrays, format), []
    if output is not None:
        if spread is not None:
            from ii_core.waves.spread import spread_maps
            from ii_core.waves.spread_files import spread_files, write_spread

            from .spread import depth_of

            depth = depth_of(spread)
            maps = [spread_maps(array, depth) for array in arrays]
            files += spread_files(len(arrays), format)
        check_outputs([output / file for file in files], force, make_folder=True)
    if output is None or report:
        from ii_core.design.design import report as describe

        say("\n\n".join(describe(array) for array in arrays))
    if output is not None:
        with progress_bar(f"write {output}") as tell:
            write_maps(arrays, output, format=format, progress=lambda done, total: tell(done, total, ""))
            if maps:
                write_spread(maps, output, format=format)


MEASURES = {
    "pitch": "lens_pitch_mm",
    "gap": "gap_mm",
    "pixel": "pixel_pitch_mm",
    "ei": "ei_pixels",
    "angle": "view_angle_deg",
}


def _print_solution(text: str) -> None:
    from ii_core.design.design import solve

    given: dict[str, Any] = {}
    for item in text.split(","):
        key, _, value = item.partition("=")
        try:
            given[MEASURES[key.strip()]] = float(value)
        except (KeyError, ValueError):
            raise ValueError(f"{item!r} is no length: NAME=NUMBER is needed for {', '.join(MEASURES)}") from None
    columns({key: f"{value:.6g}" for key, value in solve(**given).items()})


LENGTHS = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4, '"': 25.4}
NUMBERS = {"angle": "view_angle_deg", "enlarge": "enlarge"}
WISHES = {"pitch": "lens_pitch_mm", "distance": "viewer_mm", "gap": "gap_mm", "start": "start_mm"}


def _design(text: str, output: Path | None, force: bool) -> None:
    """Print a display's report, and write its camera file."""
    from ii_core.base.files import write_json
    from ii_core.design.design import report
    from ii_core.design.panel import panel_display

    wishes: dict[str, Any] = {}
    for item in text.split(","):
        key, _, value = (part.strip() for part in item.partition("="))
        if key in WISHES:
            wishes[WISHES[key]] = _length(key, value)
        elif key == "panel":
            wishes["size_mm"] = _sides(value)
        elif key in ("pixels", "lenses"):
            wishes[key] = pair(key, value)
        elif key in NUMBERS:
            wishes[NUMBERS[key]] = _number(key, value)
        else:
            known = ", ".join(["panel", "pixels", *WISHES, *NUMBERS, "lenses"])
            raise ValueError(f"{item!r} is unknown for --design: known are {known}")
    needed = {"size_mm": "panel", "pixels": "pixels", "lens_pitch_mm": "pitch", "viewer_mm": "distance"}
    if missing := [key for name, key in needed.items() if name not in wishes]:
        raise ValueError(f"the design has no {', '.join(missing)}: {', '.join(needed.values())} are needed")
    if output is not None:
        if output.suffix != ".json":
            raise ValueError(f"{output} is no camera file: .json is needed")
        check_outputs([output], force)
    made = panel_display(**wishes, name="panel" if output is None else output.stem)
    say(report(made.camera))
    for note in made.notes:
        say(f"- {note}")
    if output is not None:
        write_json(output, made.camera.to_json())
        say(f"{output}: raytrace-ii render SCENE --camera {output} --at x,y,z -o PICTURE.png")


def _sides(text: str) -> float | list[float]:
    """Return the length of a diagonal, as 15.6in, or of two sides, as 345x194mm."""
    first, _, second = text.lower().replace("×", "x").partition("x")
    if not (first and second):  # "x" alone
        return _length("panel", text)
    unit = "".join(c for c in second if c not in "0123456789.")
    return [_length("panel", first if first.endswith(unit) else first + unit), _length("panel", second)]


def _length(key: str, text: str) -> float:
    """Return millimetres from a number with a unit; the default unit is mm."""
    unit = next((unit for unit in sorted(LENGTHS, key=len, reverse=True) if text.endswith(unit)), "")
    return _number(key, text.removesuffix(unit)) * LENGTHS.get(unit, 1.0)


def _number(key: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        units = ", ".join(LENGTHS)
        raise ValueError(f"{key} is {text!r}: a number, or a length in {units}, is needed") from None
