"""Command retarget: a light field through another II-camera."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .common import Angle, Force, Workers, app, check_outputs, image_file, load_any, picture_files, with_camera
from .plugins import Plugins, load_plugins
from .progress import progress_bar, say_done

if TYPE_CHECKING:
    from ii_core import IIPicture

GREYS = (0, 128, 255)  # of the mask: outside, filled, seen


@app.command()
def retarget(
    field: Annotated[Path, typer.Argument(help="An II-picture of regular structure, or a coded file.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="The II-picture of the other camera.")],
    camera: Annotated[str, typer.Option(help="The other camera: a name, a .json file, or an II-picture.")],
    scale: Annotated[int, typer.Option(help="Divide the numbers of its lenses by this.")] = 1,
    depth: Annotated[
        Path | None,
        typer.Option(help="Map of z in mm, of the middle view or of the whole picture; estimated if not given."),
    ] = None,
    mask: Annotated[
        Path | None, typer.Option(help="Write a picture: white is seen, grey filled, black outside the field.")
    ] = None,
    samples: Annotated[int, typer.Option(help="Rays across a pixel, 1 to 16.")] = 1,
    refine: Annotated[
        bool,
        typer.Option("--refine", help="Halve the directions of the field first, for finer pixels of the camera."),
    ] = False,
    angle: Angle = None,
    workers: Workers = None,
    plugin: Plugins = None,
    force: Force = False,
) -> None:
    """Convert a light field to another camera or display at the same place: other lenses, pixels, gap, upright.

    Rays of the other camera end where the depth of the field says; holes are filled by what lies behind.
    """
    import numpy as np

    from ii_core import preset
    from ii_core import retarget as converted
    from ii_core.base.files import write_image

    load_plugins(plugin)
    target = preset(camera, scale=scale)
    shown = with_camera(load_any(field), str(field), angle)
    files = [*picture_files(output, shown.pixels.dtype.name), *image_file(mask, "uint8")]
    check_outputs(files, force)
    with progress_bar(f"retarget {field.name}") as report:
        disparity = _disparity(shown, depth, workers, report)
        made = converted(shown, target, disparity, samples=samples, refine=refine, workers=workers, progress=report)
    made.picture.save(output)
    if mask is not None:
        write_image(mask, np.asarray(GREYS, np.uint8)[made.mask])
    seen, filled, outside = made.shares
    say_done(f"{output}: {made.picture.about}; {seen:.1%} seen, {filled:.1%} filled, {outside:.1%} outside")


def _disparity(picture: IIPicture, depth: Path | None, workers: int | None, report: Any) -> Any:
    """Return the disparity of all views, from a file or estimated."""
    from ii_core import estimate_depth
    from ii_core.base.files import read_depth
    from ii_core.depth.all_views import disparity_of_views
    from ii_core.picture.disparity import disparity_of_depth
    from ii_core.picture.view import camera_of

    (k, l), (u, v) = picture.lenses, picture.ei_pixels
    if depth is None:
        found = estimate_depth(picture, workers=workers, progress=report)
        return disparity_of_views(picture, found.disparity, found.view)
    z = read_depth(depth)
    if z.shape == (l, k):
        known = disparity_of_depth(camera_of(picture), z)
        return disparity_of_views(picture, known, (u // 2, v // 2))
    if z.shape == picture.pixels.shape[:2]:
        known = disparity_of_depth(camera_of(picture), z)
        return known.reshape(l, v, k, u).transpose(1, 3, 0, 2)
    size = f"{z.shape[1]}×{z.shape[0]}"
    raise ValueError(f"{depth} has {size} px: {k}×{l} of a view or {k * u}×{l * v} of the picture are needed")
