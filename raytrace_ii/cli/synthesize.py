"""Commands that synthesize: scenes, cameras, camera, render."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .common import Force, Workers, app, check_output, check_picture, columns, progress_bar, spinner

if TYPE_CHECKING:
    from ..rendering import Shot


@app.command()
def scenes() -> None:
    """List the scenes that come with the package."""
    from ..load import scene_names

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
    from ii_core.maps import check_format

    check_format(format)
    if solve is not None:
        _print_solution(solve)
        return
    if not name:
        raise ValueError("no camera is named: see raytrace-ii cameras")
    arrays = preset_cameras(name, scale=scale)
    if output is None or report:
        from ii_core.properties import report as describe

        print("\n\n".join(describe(array) for array in arrays))
    if output is not None:
        check_output(output / "camera.json", force, make_folder=True)
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
    from ii_core.properties import solve

    given: dict[str, Any] = {}
    for item in text.split(","):
        key, _, value = item.partition("=")
        try:
            given[MEASURES[key.strip()]] = float(value)
        except (KeyError, ValueError):
            raise ValueError(f"{item!r} is no measure: {', '.join(MEASURES)} = number are known") from None
    columns({key: f"{value:.6g}" for key, value in solve(**given).items()})


@app.command()
def render(
    scene: Annotated[str, typer.Argument(help="A scene's name, or a .toml file.")],
    output: Annotated[Path, typer.Option("-o", "--output", help=".png, .tif (8 or 16 bit) or .exr (linear float).")],
    camera: Annotated[str, typer.Option(help="A camera's name, a .json file, or a folder of maps.")] = "setup1",
    scale: Annotated[int, typer.Option(help="Divides the number of lenses, at the same pixels per lens.")] = 1,
    at: Annotated[str | None, typer.Option(help="Where the camera stands in the scene, mm: x,y,z.")] = None,
    samples: Annotated[int, typer.Option(help="Rays per pixel.")] = 1,
    seed: Annotated[int, typer.Option(help="Of samples and noise.")] = 0,
    noise: Annotated[float, typer.Option(help="σ of sensor noise, in steps of 8 bits.")] = 0.0,
    bits: Annotated[int, typer.Option(help="8 or 16, for .png and .tif.")] = 8,
    depth: Annotated[Path | None, typer.Option(help="Write z in mm to this .exr.")] = None,
    normal: Annotated[Path | None, typer.Option(help="Write unit normals to this .exr.")] = None,
    object_id: Annotated[Path | None, typer.Option(help="Write object numbers to this .exr, −1 for none.")] = None,
    projection: Annotated[Path | None, typer.Option(help="Write what a 2D camera sees to this .png.")] = None,
    workers: Workers = None,
    force: Force = False,
) -> None:
    """Ray trace a scene through a camera.

    A camera of one lens stands back and gives its picture upright. A camera of several pixel arrays gives as many
    pictures, numbered.
    """
    from ..load import load_scene

    wanted = {"depth": depth, "normal": normal, "object_id": object_id}
    extra = {name: path for name, path in wanted.items() if path is not None}
    if bits not in (8, 16):
        raise ValueError(f"bits is {bits}: 8 or 16 is needed")
    dtype = "float32" if output.suffix == ".exr" else f"uint{bits}"
    arrays = _cameras(camera, scale)
    poses = [_pose(array, at) for array in arrays]
    names = [_numbered(len(arrays), i) for i in range(len(arrays))]
    for numbered in names:
        check_picture(numbered(output), dtype, force)
        for path in extra.values():
            check_picture(numbered(path), "float32", force)
    if projection:
        check_picture(projection, "uint8", force)
    loaded = load_scene(scene)
    options = {"samples": samples, "seed": seed, "noise": noise, "dtype": dtype, "workers": workers}
    for array, pose, numbered in zip(arrays, poses, names, strict=True):
        shot = _shoot(loaded, array, numbered(output).stem, pose=pose, support=tuple(extra), **options)
        with spinner(f"write {numbered(output)}"):
            _save_shot(shot, numbered(output), {name: numbered(path) for name, path in extra.items()})
        _say_stats(shot)
    if projection:
        _save_projection(loaded, arrays[0], projection, workers)


def _cameras(name: str, scale: int) -> Sequence[Any]:
    """The pixel arrays of a camera: by name, from a file, or from a folder of maps."""
    from ii_core import preset_cameras, read_maps

    if not Path(name).is_dir():
        return preset_cameras(name, scale=scale)
    if scale != 1:
        raise ValueError(f"scale is {scale}: maps have the size they have")
    return read_maps(name)


def _pose(camera: Any, at: str | None) -> Any:
    """Where a camera stands: where it is told, or, if it has but one lens, where z = 0 fills its picture."""
    import numpy as np

    from ii_core import stand_back

    if at is None:
        return stand_back(camera.model) if camera.lenses == (1, 1) and camera.model else None
    pose = np.eye(4)
    try:
        pose[:3, 3] = [float(x) for x in at.split(",")]
    except ValueError:
        raise ValueError(f"at is {at!r}: three numbers x,y,z are needed") from None
    return pose


def _numbered(count: int, i: int) -> Callable[[Path], Path]:
    return lambda path: path if count == 1 else path.with_name(f"{path.stem}_{i}{path.suffix}")


def _shoot(scene: Any, camera: Any, title: str, **options: Any) -> Shot:
    from ..rendering import render

    with progress_bar(f"render {title}") as report:
        return render(scene, camera, progress=lambda done, total: report(done, total, ""), **options)


def _save_shot(shot: Shot, output: Path, extra: dict[str, Path]) -> None:
    """The picture and its support images, upright if the camera has but one lens."""
    import numpy as np

    from ii_core import orthoscopic
    from ii_core.files import write_image

    flat = shot.picture.lenses == (1, 1)
    (orthoscopic(shot.picture) if flat else shot.picture).save(output)
    for name, path in extra.items():
        image = getattr(shot, name).astype(np.float32)
        write_image(path, image[::-1, ::-1] if flat else image)


def _save_projection(scene: Any, camera: Any, path: Path, workers: int | None) -> None:
    from ii_core import orthoscopic, projection_camera
    from ii_core.files import write_image

    if camera.model is None:
        raise ValueError("the maps do not say what camera they are of: there is no 2D projection to match")
    pinhole, pose = projection_camera(camera.model, 1024)
    view = _shoot(scene, pinhole, path.stem, samples=4, pose=pose, support=(), workers=workers)
    write_image(path, orthoscopic(view.picture).pixels)


def _say_stats(shot: Shot) -> None:
    s = shot.stats
    counts = ", ".join(f"{count / 1e6:.2f} M {kind}" for kind, count in s.rays.items() if count)
    print(f"{counts} rays in {s.seconds:.1f} s, {s.embree_seconds:.1f} s of {s.cpu_seconds:.1f} CPU s inside Embree")
