"""Command measure-depth: errors of an estimated disparity."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .common import app, check_outputs, columns, load_any

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ii_core import IIPicture


@app.command("measure-depth")
def measure_depth(
    estimate: Annotated[Path, typer.Argument(help="Disparity of a view in px: .pfm, .exr or .tif.")],
    truth: Annotated[Path, typer.Argument(help="True disparity, likewise.")],
    field: Annotated[
        Path | None, typer.Option(help="The II-picture: errors by region, and of angles if it has a camera.")
    ] = None,
    view: Annotated[str | None, typer.Option(help="View of the maps, U,V; the middle one by default.")] = None,
    millimetres: Annotated[
        bool, typer.Option("--mm", help="Both maps are z in mm; disparity follows from the camera of --field.")
    ] = False,
    border: Annotated[int, typer.Option(help="Pixels at each side that do not count.")] = 15,
    json: Annotated[Path | None, typer.Option(help="Write the errors as JSON.")] = None,
    force: bool = typer.Option(False, "--force", help="Replace existing files."),
) -> None:
    """Measure the error of a disparity as the 4D Light Field Benchmark does: BadPix, MSE×100, Q25, median angles.

    A pixel without disparity is bad. Maps of the size of the II-picture count at the pixels of the view.
    """
    from ii_core.base.files import write_json
    from metrics import depth_errors, depth_regions

    check_outputs([json] if json else [], force)
    if millimetres and field is None:
        raise ValueError("--mm needs the camera of --field")
    shown = None if field is None else load_any(field)
    if view is not None and shown is None:
        raise ValueError("view is that of an II-picture: --field is needed")
    at = _view(view, shown)
    found, true = (_map(path, shown, at, millimetres) for path in (estimate, truth))
    options: dict[str, Any] = {"border": border}
    if shown is not None:
        from ii_core import sub_images

        pixels = sub_images(shown)[at[1], at[0]]
        if pixels.shape[:2] != true.shape:
            raise ValueError(
                f"{truth} has {true.shape[1]}×{true.shape[0]} px, a view {pixels.shape[1]}×{pixels.shape[0]}"
            )
        options["regions"] = depth_regions(true, pixels)
        if shown.camera is not None and shown.camera.viewer_mm is not None:
            options["camera"] = shown.camera
    errors = depth_errors(found, true, **options)
    columns({name: f"{value:.4g}" for name, value in errors.items()})
    if json is not None:
        write_json(json, errors)


def _view(text: str | None, shown: IIPicture | None) -> tuple[int, int]:
    if shown is None:
        return (0, 0)
    u, v = shown.ei_pixels
    if text is None:
        return (u // 2, v // 2)
    try:
        a, b = (int(part) for part in text.split(","))
    except ValueError:
        raise ValueError(f"view is {text!r}: two whole numbers U,V are needed") from None
    if not (0 <= a < u and 0 <= b < v):
        raise ValueError(f"view is {text!r}: columns 0–{u - 1} and rows 0–{v - 1} are there")
    return a, b


def _map(path: Path, shown: IIPicture | None, at: tuple[int, int], millimetres: bool) -> NDArray[Any]:
    """Return the disparity of the view in a file."""
    from ii_core import disparity_of_depth
    from ii_core.base.files import read_depth
    from ii_core.formats.pfm import read_pfm
    from ii_core.picture.view import camera_of

    values = read_pfm(path) if path.suffix == ".pfm" else read_depth(path)
    if shown is not None and values.shape == shown.pixels.shape[:2]:
        u, v = shown.ei_pixels
        values = values[at[1] :: v, at[0] :: u]
    return disparity_of_depth(camera_of(shown), values) if millimetres and shown is not None else values
