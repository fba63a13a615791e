"""Commands depth, focus and retarget: where things are in a light field, and pictures made with it."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .common import Angle, Force, Workers, app, check_outputs, image_file, load_any, with_camera
from .plugins import Plugins, load_plugins
from .progress import progress_bar, say_done

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ii_core import IIPicture


MILLIMETRES = 65535  # of a 16-bit PNG


@app.command()
def depth(
    field: Annotated[Path, typer.Argument(help="An II-picture of regular structure, or a coded file.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Map: .exr, .tif, .pfm, or .png of whole mm, 0 for unknown.")
    ],
    disparity: Annotated[
        bool, typer.Option("--disparity", help="Disparity in pixels a step between views instead of z in mm.")
    ] = False,
    points: Annotated[Path | None, typer.Option(help="Point cloud with colours, .ply.")] = None,
    confidence: Annotated[Path | None, typer.Option(help="Map of confidence from 0 to 1: .exr, .tif, .pfm.")] = None,
    preview: Annotated[Path | None, typer.Option(help="Picture in false colours with a scale.")] = None,
    view: Annotated[
        str | None,
        typer.Option(
            help="View whose depth is estimated, U,V from the upper left, or all; the middle one by default."
        ),
    ] = None,
    range_: Annotated[
        str | None, typer.Option("--range", help="Range of disparities LOW,HIGH, px; found if not given.")
    ] = None,
    angle: Angle = None,
    workers: Workers = None,
    plugin: Plugins = None,
    force: Force = False,
) -> None:
    """Estimate the depth of a view from all views.

    With --view all, the map has the size of the II-picture: the middle view's disparity moved to all others, as
    `view --depth` and `export --depth` need it.
    """
    from ii_core import estimate_depth
    from ii_core.base.files import write_image
    from ii_core.depth.all_views import disparity_of_views
    from ii_core.depth.points import view_points, write_ply
    from ii_core.picture.disparity import depth_of_disparity

    load_plugins(plugin)
    if disparity and output.suffix == ".png":
        raise ValueError(f"{output} holds whole mm of depth: --disparity needs .exr, .tif or .pfm")
    if points is not None and points.suffix != ".ply":
        raise ValueError(f"{points} is no point cloud: .ply is needed")
    files = [
        *_map_files(output),
        *_map_files(confidence),
        *image_file(preview, "uint8"),
        *([points] if points else []),
    ]
    check_outputs(files, force)
    whole, at = view == "all", None if view in (None, "all") else _two("view", str(view), int)
    low, high = (None, None) if range_ is None else _two("range", range_, float)
    shown = load_any(field)
    if not disparity or points is not None or angle is not None:
        shown = with_camera(shown, str(field), angle)
    with progress_bar(f"depth of {field.name}") as report:
        found = estimate_depth(shown, view=at, low=low, high=high, workers=workers, progress=report)
    values = found.disparity if disparity else found.depth_mm
    assert values is not None
    if preview is not None:
        write_image(preview, _false_colours(shown, found.disparity, in_mm=not disparity))
    if whole:
        moved = _as_picture(disparity_of_views(shown, found.disparity, found.view))
        values = moved if disparity or shown.camera is None else depth_of_disparity(shown.camera, moved)
    _write_map(output, values)
    if confidence is not None:
        _write_map(confidence, found.confidence)
    if points is not None:
        assert found.depth_mm is not None
        write_ply(points, *view_points(shown, found.depth_mm, found.view))
    say_done(f"{output}: {_about(values, 'px' if disparity else 'mm')}; {(found.confidence >= 0.9).mean():.0%} sure")


def _false_colours(field: IIPicture, disparity: NDArray[Any], *, in_mm: bool) -> NDArray[Any]:
    """Return the preview of a map, whose scale is in pixels or in mm."""
    from ii_core import depth_of_disparity
    from ii_core.depth.preview import preview

    camera = field.camera
    if camera is None:
        return preview(disparity, "px a view")
    told, unit = (partial(depth_of_disparity, camera), "mm") if in_mm else (float, "px a view")
    return preview(disparity, unit, told=told, pixel=camera.lens_pitch_mm)


def _about(values: NDArray[Any], unit: str) -> str:
    import numpy as np

    from ii_core.depth.preview import four_digits

    known = values[np.isfinite(values)]
    size = f"{values.shape[1]}×{values.shape[0]} px"
    if not known.size:
        return f"{size}, nothing tells depths apart"
    low, high = map(four_digits, np.quantile(known, [0.01, 0.99]))
    return f"{size}, {low} … {high} {unit} (1–99 %)"


def _as_picture(views: NDArray[Any]) -> NDArray[Any]:
    """Return values of views, (V, U, L, K), in the order of the II-picture, (N, M)."""
    v, u, l, k = views.shape
    return views.transpose(2, 0, 3, 1).reshape(l * v, k * u)


def _map_files(path: Path | None) -> list[Path]:
    if path is None:
        return []
    return [path] if path.suffix == ".pfm" else image_file(path, "uint16" if path.suffix == ".png" else "float32")


def _write_map(path: Path, values: NDArray[Any]) -> None:
    import numpy as np

    from ii_core.base.files import write_image
    from ii_core.formats.pfm import write_pfm

    if path.suffix == ".pfm":
        write_pfm(path, np.asarray(values, np.float32))
    elif path.suffix == ".png":
        known = np.where(np.isfinite(values) & (values > 0), values, 0)
        write_image(path, np.rint(np.minimum(known, MILLIMETRES)).astype(np.uint16))
    else:
        write_image(path, np.asarray(values, np.float32))


def _two(name: str, text: str, kind: type) -> tuple[Any, Any]:
    try:
        a, b = (kind(part) for part in text.split(","))
    except ValueError:
        example = "4,4" if kind is int else "-4,2.5"
        raise ValueError(f"{name} is {text!r}: two numbers as in {example} are needed") from None
    return a, b
