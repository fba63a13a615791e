"""Commands look, the view image from a place, and eye, the view of an eye in front of a display."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .common import Angle, Force, app, check_outputs, check_unused, image_file, load_any, pair, with_camera
from .plugins import Plugins, load_plugins
from .progress import say_done, spinner

if TYPE_CHECKING:
    from ii_core import DisplayModel, Eye, IIPicture


@app.command()
def look(
    picture: Annotated[Path, typer.Argument(help="An II-picture of regular structure, or a coded file.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="A picture; of several places NAME_1, NAME_2, …")],
    at: Annotated[
        list[str] | None,
        typer.Option(help="Place of the viewer: x,y,z in mm, z < 0, or front, up, down, left, right; repeatable."),
    ] = None,
    interpolation: Annotated[str, typer.Option(help="Between pixels under a lens: linear or nearest.")] = "linear",
    angle: Angle = None,
    plugin: Plugins = None,
    force: Force = False,
) -> None:
    """Write the view image from a place: one pixel through each lens.

    The five named places look from the front and from the borders of the viewing zone.
    """
    from ii_core import DisplayModel, Eye, five_viewpoints, view_image
    from ii_core.base.files import write_image
    from ii_core.picture.view import camera_of

    load_plugins(plugin)
    texts = at or ["front"]
    numbers = [f"_{i}" for i in range(1, len(texts) + 1)] if len(texts) > 1 else [""]
    paths = [output.with_stem(output.stem + number) for number in numbers]
    shown = with_camera(load_any(picture), str(picture), angle)
    check_outputs([file for path in paths for file in image_file(path, shown.pixels.dtype.name)], force)
    camera = camera_of(shown)
    named = {name: tuple(map(float, place)) for name, place in five_viewpoints(camera).items()}
    places = [named[text] if text in named else _numbers("at", text, 3) for text in texts]
    views = [view_image(shown, place, interpolation=interpolation) for place in places]
    for path, place, (pixels, valid) in zip(paths, places, views, strict=True):
        write_image(path, pixels)
        where = _zone(DisplayModel(camera=camera), Eye(position_mm=(place[0], place[1], place[2])))
        say_done(f"{path}: {pixels.shape[1]}×{pixels.shape[0]} px, {valid.mean():.1%} seen; {where}")


@app.command()
def eye(
    context: typer.Context,
    picture: Annotated[
        Path, typer.Argument(help="An II-picture with its sidecar, which names its camera, or a coded file.")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="A picture; with --both NAME_left and NAME_right.")],
    at: Annotated[str | None, typer.Option(help="Position of the eye, mm: x,y,z; in front if not given.")] = None,
    pupil: Annotated[float, typer.Option(help="Diameter of the pupil, mm; 0 is a point.")] = 3.0,
    focus: Annotated[
        float | None, typer.Option(help="Distance in focus from the eye, mm; the lens plane if not given.")
    ] = None,
    angle: Angle = None,
    rays: Annotated[int | None, typer.Option(help="Rays per point; 64 with a pupil if not given.")] = None,
    both: Annotated[bool, typer.Option("--both", help="Two eyes, left and right of --at.")] = False,
    apart: Annotated[float, typer.Option(help="Distance between the eyes, mm.")] = 63.0,
    size: Annotated[str | None, typer.Option(help="Points of the view, as 800x400; default: one per lens.")] = None,
    layout: Annotated[str, typer.Option(help="Sub-pixels: square, rgb-stripe or pentile.")] = "square",
    fill: Annotated[float, typer.Option(help="Share of a sub-pixel that emits.")] = 1.0,
    lobe: Annotated[float, typer.Option(help="Power of the cosine of the angle to the panel's normal.")] = 0.0,
    brightness: Annotated[float, typer.Option(help="Factor on all light.")] = 1.0,
    black: Annotated[float, typer.Option(help="Light of black as a share of white's.")] = 0.0,
    crosstalk: Annotated[float, typer.Option(help="Share of a pixel's light from its four neighbours.")] = 0.0,
    lens_pitch_mm: Annotated[float | None, typer.Option(help="Pitch of the display's lens array.")] = None,
    gap_mm: Annotated[float | None, typer.Option(help="Gap from panel to lens plane.")] = None,
    shift: Annotated[str, typer.Option(help="Shift of the lens array on the panel, mm: x,y.")] = "0,0",
    turn: Annotated[float, typer.Option(help="Rotation of the lens array on the panel, degrees.")] = 0.0,
    spread: Annotated[
        str | None,
        typer.Option(help="Spread light of pixels: auto, by the camera's lenses and the eye, or a folder of maps."),
    ] = None,
    calibration: Annotated[
        Path | None, typer.Option(help="visual.json of a Looking Glass, whose panel shows the picture: no sidecar.")
    ] = None,
    force: Force = False,
) -> None:
    """Compute the view of an eye of a display: pupil, focus, sub-pixels, misaligned lenses.

    A point pupil, square pixels and the camera's own lens array give the view image.
    """
    from ii_core import DisplayModel, Eye, eye_image, five_viewpoints
    from ii_core.base.files import write_image
    from ii_core.picture.view import camera_of

    sides = ("left", "right") if both else ("",)
    paths = [output.with_stem(f"{output.stem}_{side}") if side else output for side in sides]
    check_outputs([file for path in paths for file in image_file(path, "uint8")], force)
    points = None if size is None else pair("size", size)
    if calibration is not None:
        unused = "focus", "angle", "layout", "fill", "lobe", "brightness", "black", "crosstalk", "lens_pitch_mm"
        check_unused(context, "--calibration", *unused, "gap_mm", "shift", "turn", "spread")
        if at is None:
            raise ValueError("at is missing: x,y,z of the eye in mm from the middle of the panel, z < 0, is needed")
        x, y, z = _numbers("at", at, 3)
        _panel(picture, calibration, paths, Eye(position_mm=(x, y, z), pupil_mm=pupil), apart, points, rays)
        return
    across, up = _numbers("shift", shift, 2)
    shown = with_camera(load_any(picture), str(picture), angle)
    camera = camera_of(shown)
    display = DisplayModel(
        camera=camera, lens_pitch_mm=lens_pitch_mm, gap_mm=gap_mm, shift_mm=(across, up), turn_deg=turn,  # type: ignore[arg-type]
        layout=layout, fill=fill, lobe=lobe, brightness=brightness, black=black, crosstalk=crosstalk,
    )  # fmt: skip
    place: tuple[float, ...] = _numbers("at", at, 3) if at else tuple(map(float, five_viewpoints(camera)["front"]))
    viewer = Eye(position_mm=(place[0], place[1], place[2]), pupil_mm=pupil, focus_mm=focus)
    for path, one in zip(paths, viewer.pair(apart) if both else (viewer,), strict=True):
        with spinner(f"eye {picture.name}"):
            seen = eye_image(_spread(shown, display, one, spread), display, one, size=points, rays=rays)
            write_image(path, seen.pixels)
        say_done(f"{path}: {seen.seen.mean():.1%} of the rays meet the panel; {_zone(display, one)}")


def _panel(
    picture: Path, calibration: Path, paths: list[Path], viewer: Eye, apart: float, points: tuple[int, int] | None,
    rays: int | None,
) -> None:  # fmt: skip
    """Write the views of a panel's picture through the lenses of a Looking Glass."""
    from ii_core.base.files import read_image, write_image
    from ii_core.display.eye import RAYS
    from ii_core.display.looking_glass import native_eye_image, read_looking_glass

    display = read_looking_glass(calibration)
    pixels = read_image(picture, size=display.size)[..., :3]
    for path, one in zip(paths, viewer.pair(apart) if len(paths) > 1 else (viewer,), strict=True):
        with spinner(f"eye {picture.name}"):
            seen = native_eye_image(pixels, display, one, size=points, rays=RAYS if rays is None else rays)
            write_image(path, seen.pixels)
        say_done(f"{path}: {seen.light.shape[1]}×{seen.light.shape[0]} px")


def _spread(picture: IIPicture, display: DisplayModel, eye: Eye, text: str | None) -> IIPicture:
    """Return the light of every pixel, spread by the lenses towards the eye."""
    import numpy as np

    from ii_core.camera.optics import Lenslet
    from ii_core.waves.spread import spread_picture

    from .spread import AUTO, maps_of

    if text is None:
        return picture
    maps = maps_of(text, display.camera, 0, eye.position_mm[2])
    if text == AUTO and isinstance(display.optics, Lenslet):  # `eye_image` traces its defocus
        maps = maps._replace(defocus_mm=np.zeros_like(maps.defocus_mm))
    return spread_picture(picture, maps)


def _zone(display: DisplayModel, eye: Eye) -> str:
    """Return whether the eye is in the viewing zone, in words."""
    from ii_core import viewing_zone

    x, y, z = (a - b for a, b in zip(eye.position_mm, display.camera.origin_mm, strict=True))
    zone = viewing_zone(display, display.camera.gap_mm - z)
    off = [abs(place - centre) for place, centre in zip((x, y), zone.centre_mm, strict=True)]
    inside = all(2 * distance <= size for distance, size in zip(off, zone.size_mm, strict=True))
    width, height = (max(0.0, size) for size in zone.size_mm)
    return f"{'inside' if inside else 'outside'} the viewing zone of {width:.0f}×{height:.0f} mm"


def _numbers(name: str, text: str, count: int) -> tuple[float, ...]:
    """Return the numbers of a text separated by commas."""
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != count:
        raise ValueError(f"{name} is {text!r}: {count} numbers separated by commas are needed")
    return numbers
