"""Command focus: pictures of a light field focused on a plane, a tilted plane or everywhere."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .common import Angle, Force, Workers, app, check_outputs, check_unused, image_file, load_any, with_camera
from .plugins import Plugins, load_plugins
from .progress import progress_bar, say_done
from .words import say

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ii_core import IIPicture

FILMS = (".mp4", ".gif", ".webp")
HIDDEN = 0.05  # linear light: views that differ more from the middle one show something else (all in focus)


@app.command()
def focus(
    context: typer.Context,
    field: Annotated[Path, typer.Argument(help="An II-picture of regular structure, or a coded file.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="A picture; with --stack NAME_1, NAME_2, … or .mp4, .gif, .webp.")
    ],
    at: Annotated[
        str, typer.Option(help="What is in focus: z as 40mm, or disparity as 0.5px. 0px is where views agree.")
    ] = "0px",
    stack: Annotated[
        int | None, typer.Option(help="So many planes, far to near, over the disparities of the field or of --over.")
    ] = None,
    over: Annotated[str | None, typer.Option(help="Stack: disparities LOW,HIGH, px.")] = None,
    all_in_focus: Annotated[
        bool, typer.Option("--all-in-focus", help="Everything in focus, by its estimated depth or --depth.")
    ] = False,
    depth: Annotated[
        Path | None, typer.Option(help="All in focus: map of z in mm of the middle view (.exr).")
    ] = None,
    aperture: Annotated[
        str, typer.Option(help="Pupil: square, circle, hexagon or ring, also circle:0.5; or a grey picture.")
    ] = "square",
    tilt: Annotated[
        str | None, typer.Option(help="Tilt of the plane at --at …mm, degrees farther to the right and up: RIGHT,UP.")
    ] = None,
    bokeh: Annotated[float, typer.Option(help="Power of light when views are averaged: above 1 lights bloom.")] = 1.0,
    fps: Annotated[int, typer.Option(help="Film of a stack: frames per second.")] = 10,
    angle: Angle = None,
    workers: Workers = None,
    plugin: Plugins = None,
    force: Force = False,
) -> None:
    """Focus a light field: add up its views, shifted, in linear light.

    The middle view's pixels stay in place. A pixel is the mean of the views that see its point; the share of the
    pupil at the borders is printed.
    """
    from ii_core.base.files import write_image
    from ii_core.depth.refocus import focused
    from ii_core.display.film import write_animation
    from ii_core.picture.picture import codes8

    load_plugins(plugin)
    _check(context, stack, all_in_focus, tilt, at)
    film = stack is not None and output.suffix in FILMS
    paths = (
        [output] if stack is None or film else [output.with_stem(f"{output.stem}_{i}") for i in range(1, stack + 1)]
    )
    check_outputs(paths if film else [file for path in paths for file in image_file(path, _type(path))], force)
    shown = load_any(field)
    shown.check_regular()
    if at.endswith("mm") or depth is not None or angle is not None:
        shown = with_camera(shown, str(field), angle)
    options = {"weights": _pupil(aperture, shown.ei_pixels), "bokeh": bokeh, "workers": workers}
    with progress_bar(f"focus {field.name}") as report:
        if all_in_focus:
            planes: list[Any] = [_everywhere(shown, depth, workers, report)]
            options["limit"] = HIDDEN
        elif stack is not None:
            planes = _planes(shown, stack, over, workers)
        else:
            planes = [_plane(shown, at, tilt)]
        seen: list[Any] = []

        def pictures() -> Iterator[NDArray[Any]]:
            for done, plane in enumerate(planes, 1):
                light, share = focused(shown, plane, **options)
                seen.append(share)
                report(done, len(planes), "")
                yield light

        if film:
            write_animation(output, (codes8(light) for light in pictures()), fps=fps)
        else:
            for path, light in zip(paths, pictures(), strict=True):
                write_image(path, _codes(light, _type(path)))
    (k, l), share = shown.lenses, min(part.mean() for part in seen)
    least = min(float(part.min()) for part in seen)
    if stack is not None:
        say(f"planes at {', '.join(f'{plane:.3g}' for plane in planes)} px")
    say_done(f"{output}: {k}×{l} px, {share:.1%} of the pupil sees a pixel, at least {least:.0%} at the borders")


def _check(context: typer.Context, stack: int | None, all_in_focus: bool, tilt: str | None, at: str) -> None:
    if stack is not None:
        check_unused(context, "--stack", "at", "tilt", "all_in_focus", "depth")
        if not 1 <= stack <= 1000:
            raise ValueError(f"stack is {stack}: 1 to 1000 planes are needed")
    else:
        check_unused(context, "one picture", "over", "fps")
    if all_in_focus:
        check_unused(context, "--all-in-focus", "at", "tilt")
    else:
        check_unused(context, "a plane", "depth")
    if tilt is not None and not at.endswith("mm"):
        raise ValueError("a tilted plane needs its z: --at as in 40mm")


def _type(path: Path) -> str:
    return "float32" if path.suffix in (".exr", ".hdr", ".tif", ".tiff") else "uint8"


def _codes(light: NDArray[Any], dtype: str) -> NDArray[Any]:
    from ii_core.picture.picture import codes8

    return light if dtype == "float32" else codes8(light)


def _plane(picture: IIPicture, at: str, tilt: str | None) -> Any:
    """Return the disparity of --at and --tilt."""
    from ii_core.depth.refocus import plane_disparity
    from ii_core.picture.disparity import disparity_of_depth
    from ii_core.picture.view import camera_of

    try:
        value, unit = float(at[:-2]), at[-2:]
    except ValueError:
        value, unit = 0.0, ""
    if unit not in ("mm", "px"):
        raise ValueError(f"at is {at!r}: z as in 40mm or disparity as in 0.5px is needed")
    if unit == "px":
        return value
    if tilt is None:
        camera = camera_of(picture)
        disparity = float(disparity_of_depth(camera, value))
        if math.isnan(disparity) and camera.front:
            raise ValueError(
                f"at is {at}: more is needed, the lens before the array ends at {camera.front[-1].end_mm:g} mm"
            )
        return disparity
    try:
        right, up = (float(part) for part in tilt.split(","))
    except ValueError:
        raise ValueError(f"tilt is {tilt!r}: two angles RIGHT,UP in degrees are needed") from None
    return plane_disparity(picture, value, right_deg=right, up_deg=up)


def _planes(picture: IIPicture, count: int, over: str | None, workers: int | None) -> Any:
    """Return the disparities of a stack, the farthest first."""
    import numpy as np

    from ii_core.depth.estimate import field_range

    if over is None:
        low, high = field_range(picture, workers=workers)
    else:
        try:
            low, high = (float(part) for part in over.split(","))
        except ValueError:
            raise ValueError(f"over is {over!r}: two disparities LOW,HIGH in px are needed") from None
    return np.linspace(low, high, count) if count > 1 else [(low + high) / 2]


def _everywhere(picture: IIPicture, depth: Path | None, workers: int | None, report: Any) -> Any:
    """Return the disparity of the middle view, of a file or estimated."""
    from ii_core import estimate_depth
    from ii_core.base.files import read_depth
    from ii_core.picture.disparity import disparity_of_depth
    from ii_core.picture.view import camera_of

    if depth is None:
        return estimate_depth(picture, workers=workers, progress=report).disparity
    return disparity_of_depth(camera_of(picture), read_depth(depth, size=picture.lenses))


def _pupil(text: str, views: tuple[int, int]) -> Any:
    """Return the weights of views by the name and size of a shape, or from a grey picture."""
    import numpy as np

    from ii_core.base.files import IMAGE_TYPES, read_image
    from ii_core.depth.refocus import pupil_weights
    from ii_core.picture.picture import peak

    if Path(text).suffix.lower() in IMAGE_TYPES:
        from PIL import Image

        given = read_image(Path(text))
        grey = given.astype(np.float64).mean(axis=2) / peak(given.dtype)
        return np.asarray(Image.fromarray(grey.astype(np.float32)).resize(views, Image.Resampling.BOX), np.float64)
    shape, _, size = text.partition(":")
    try:
        return pupil_weights(views, shape, float(size) if size else 1.0)
    except ValueError as error:
        raise ValueError(f"aperture is {text!r}: {error}") from None
