"""Commands that convert II-pictures: regular, import, export, components."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .calibrating import FociOption, captured, with_types
from .common import Force, app, check_folder, check_outputs, image_file, load_any, pair, picture_files
from .plugins import Plugins, load_plugins
from .progress import progress_bar, say_done, spinner
from .words import say

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ii_core import Rig

LensTypesOption = Annotated[
    str,
    typer.Option(
        help="Multi-focus arrays: keep, fuse (each pixel from lenses around in best focus) or the number of a type."
    ),
]


@app.command()
def regular(
    picture: Annotated[Path, typer.Argument(help="An II-picture of a hexagonal, non-integer or shifted structure.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="The regular II-picture.")],
    method: Annotated[
        str, typer.Option(help="rectangle (no pixel changes) or resample (centred on lenses).")
    ] = "resample",
    deshift: Annotated[
        bool, typer.Option("--deshift", help="Resample: remove the half-lens shift of odd rows of a hexagonal array.")
    ] = False,
    lens_types: LensTypesOption = "keep",
    mask: Annotated[
        Path | None, typer.Option(help="Write a .png with white pixels where a lens owns the pixel.")
    ] = None,
    force: Force = False,
) -> None:
    """Convert an II-picture to a regular structure, which coding and views need."""
    import numpy as np

    from ii_core import IIPicture, resampled, smallest_rectangle
    from ii_core.base.files import write_image

    methods = {"rectangle": smallest_rectangle, "resample": resampled}
    if method not in methods:
        raise ValueError(f"unknown method {method!r}: known are {', '.join(methods)}")
    if deshift and method != "resample":
        raise ValueError(f"deshift is no option of method {method}: use --method resample")
    original = IIPicture.load(picture)
    files = [*picture_files(output, original.pixels.dtype.name), *image_file(mask, "uint8")]
    check_outputs(files, force)
    if lens_types != "keep":
        original = with_types(original, lens_types)
    with spinner(f"{method} {picture.name}"):
        made, owned = resampled(original, deshift=True) if deshift else methods[method](original)
        made.save(output)
        if mask:
            write_image(mask, owned.astype(np.uint8) * 255)
    (k, l), (u, v) = made.lenses, made.ei_pixels
    say_done(f"{output}: {k}×{l} lenses of {u}×{v} px, {owned.mean():.1%} of the pixels owned by their lens")


@app.command("import")
def import_(
    source: Annotated[
        Path,
        typer.Argument(
            help="A folder of views, .mat, .h5, a quilt (name_qsCxRaA.png), a lenslet picture, .lfp, .lfr, .raw."
        ),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="The II-picture: .png, .tif or .exr.")],
    ei_pixels: Annotated[
        str | None, typer.Option(help="U×V pixels under each lens of a lenslet picture, such as 15x15.")
    ] = None,
    grid: Annotated[
        str | None, typer.Option(help="Columns × rows of views, such as 9x9, if names do not contain them.")
    ] = None,
    middle: Annotated[
        str | None, typer.Option(help="Take only the middle views, of the first × the second number, such as 5x5.")
    ] = None,
    transposed: Annotated[
        bool | None, typer.Option("--transposed/--not-transposed", help="The first number is horizontal.")
    ] = None,
    flip_down: Annotated[
        bool | None, typer.Option("--flip-down/--no-flip-down", help="Views are numbered from bottom to top.")
    ] = None,
    flip_across: Annotated[
        bool | None, typer.Option("--flip-across/--no-flip-across", help="Views are numbered from right to left.")
    ] = None,
    camera: Annotated[
        str | None, typer.Option(help="Camera of the II-picture: a name, a .json file, or another II-picture.")
    ] = None,
    baseline_mm: Annotated[float | None, typer.Option(help="Distance of neighbouring cameras of an array.")] = None,
    focal_mm: Annotated[float | None, typer.Option(help="Focal length of each camera.")] = None,
    sensor_mm: Annotated[float | None, typer.Option(help="Longer side of each sensor.")] = None,
    focus_mm: Annotated[
        float | None,
        typer.Option(help="Distance of the plane of zero disparity from the cameras; infinity by default."),
    ] = None,
    whites: Annotated[
        Path | None,
        typer.Option(
            help="White picture of a raw one, or the camera's calibration data to choose from: a folder, .tar."
        ),
    ] = None,
    lens_types: LensTypesOption = "keep",
    foci: FociOption = None,
    depth: Annotated[
        Path | None, typer.Option(help="Write z in mm (.exr) of every pixel, where an .h5 of the HCI has GT_DEPTH.")
    ] = None,
    force: Force = False,
) -> None:
    """Import a light field of other programs as an II-picture.

    The arrangement of views is estimated from the pictures and printed. Names with the places of cameras, as in the
    Stanford archive (out_04_07_-435.23_1123.45.png), settle it and give --baseline-mm. The camera is read from the
    parameters.cfg of an HCI folder, or given: --camera, or --baseline-mm, --focal-mm and --sensor-mm.
    """
    from ii_core import IIPicture, find_views, load_mosaic, picture_of, preset
    from ii_core.base.files import check_type, image_types, write_image
    from ii_core.picture.assumed import ASSUMED_ANGLE_DEG, with_assumed_camera
    from ii_core.picture.picture import sidecar

    types = image_types(output)
    check_outputs([output, sidecar(output), *([depth] if depth else [])], force)
    true = None if depth is None else _true_depth(source, depth, ei_pixels or grid or middle or whites)
    if whites is not None or source.suffix.lower() in (".lfp", ".lfr", ".raw"):
        _import_raw(source, whites, output, 8 if "uint8" in types else 16, lens_types, foci)
        return
    if foci is not None or lens_types != "keep":
        raise ValueError("foci and lens-types are for raw pictures: give --whites")
    views = None if ei_pixels is not None else find_views(source, grid=None if grid is None else pair("grid", grid))
    if middle is not None:
        if views is None:
            raise ValueError("middle is for folders of views: leave it out with --ei-pixels")
        views = views.middle(pair("middle", middle))
    if baseline_mm is None and focal_mm is not None and views is not None and views.positions is not None:
        baseline_mm = views.positions.baseline_mm
    rig = _rig(camera, baseline_mm, focal_mm, sensor_mm, focus_mm)
    known = None if camera is None else preset(camera)
    if views is None:
        assert ei_pixels is not None
        made, order = load_mosaic(source, pair("ei-pixels", ei_pixels)), None
    else:
        with spinner(f"import {source.name}"):
            made, order = picture_of(views, transposed=transposed, flip_down=flip_down, flip_across=flip_across)
    if rig is not None:
        known = rig.camera(made.ei_pixels, made.lenses)
    if known is not None:
        made = IIPicture(made.pixels, known.lenses, known.ei_pixels, known, known.erect)
    check_type(output, made.pixels.dtype.name)
    nominal = made.camera is None and (views is None or views.structure is None)
    if nominal:
        made = with_assumed_camera(made, aspect=None if views is None else views.aspect)
    made.save(output)
    if true is not None and depth is not None:
        write_image(depth, true)
    (k, l), (u, v) = made.lenses, made.ei_pixels
    say_done(f"{output}: {k}×{l} lenses of {u}×{v} px, {made.pixels.dtype}")
    if order is not None:
        say(order.describe((u, v)))
    if nominal:
        say(
            f"no camera is known: a nominal one of {ASSUMED_ANGLE_DEG:g}°, with pixels of 1 mm, is written; "
            f"raytrace-ii camera {output} --set … replaces it"
        )


def _true_depth(source: Path, output: Path, arranged: object) -> NDArray[np.float32]:
    """Return z in mm of every pixel from an old file of the HCI."""
    from ii_core.base.files import check_type
    from ii_core.formats.arrays import array_depth

    check_type(output, "float32")
    if arranged:
        raise ValueError("depth is that of a whole file: leave out --ei-pixels, --grid, --middle and --whites")
    metres = array_depth(source) if source.suffix.lower() in (".h5", ".hdf5") else None
    if metres is None:
        raise ValueError(f"{source} has no GT_DEPTH: leave out --depth")
    return 1000 * metres


def _import_raw(
    source: Path, whites: Path | None, output: Path, bits: int, lens_types: str, foci: str | None
) -> None:
    """Write the regular II-picture of a raw picture of a lenslet camera."""
    from ii_core import resampled
    from ii_core.base.files import check_type

    check_type(output, f"uint{bits}")
    with progress_bar(f"import {source.name}") as report:
        shot = captured(source, white=whites, bits=bits, foci=foci, report=report)
    picture = shot.picture if lens_types == "keep" else with_types(shot.picture, lens_types)
    kept = lens_types == "keep" and shot.found.foci is not None  # the mean of two lenses would be of two types
    with spinner(f"resample {source.name}"):
        made, owned = resampled(picture, deshift=shot.found.grid.lattice.hexagonal and not kept)
        made.save(output)
    (k, l), (u, v) = made.lenses, made.ei_pixels
    say(shot.found.describe())
    say(shot.told())
    say_done(f"{output}: {k}×{l} lenses of {u}×{v} px, {owned.mean():.1%} of the pixels owned by their lens")


def _rig(
    camera: str | None, baseline_mm: float | None, focal_mm: float | None, sensor_mm: float | None,
    focus_mm: float | None,
) -> Rig | None:  # fmt: skip
    """Return the array of cameras of the options; raise ValueError if a parameter is missing."""
    from ii_core import Rig

    needed = {"baseline-mm": baseline_mm, "focal-mm": focal_mm, "sensor-mm": sensor_mm}
    missing = [name for name, value in needed.items() if value is None]
    if len(missing) == len(needed) and focus_mm is None:
        return None
    if missing or camera is not None:
        what = f"{missing[0]} is missing" if missing else "camera is given, too"
        raise ValueError(f"{what}: an array of cameras needs baseline-mm, focal-mm and sensor-mm, or camera instead")
    assert baseline_mm is not None and focal_mm is not None and sensor_mm is not None
    return Rig(baseline_mm=baseline_mm, focal_mm=focal_mm, sensor_mm=sensor_mm, focus_mm=focus_mm)


CAMERA_PARTS = {  # of `camera FIELD --set`: all of one line are needed, but focus
    ("angle",): "viewing angle in degrees; pixels of 1 mm",
    ("pixel", "gap"): "pixel pitch and gap in mm",
    ("baseline", "focal", "sensor", "focus"): "of an array of cameras, in mm",
}


def set_camera(field: Path, text: str) -> None:
    """Replace the camera in a regular II-picture's sidecar; parts are as in ``baseline=20,focal=50,sensor=35``."""
    from dataclasses import replace

    from ii_core import IICamera, IIPicture, Rig, with_assumed_camera
    from ii_core.base.files import read_json, write_json
    from ii_core.picture.picture import sidecar

    parts: dict[str, float] = {}
    for part in text.split(","):
        name, _, number = part.strip().partition("=")
        try:
            parts[name] = float(number)
        except ValueError:
            raise ValueError(f"--set has {part.strip()!r}: a name and a number as in angle=30 are needed") from None
    form = next((form for form in CAMERA_PARTS if {*form} - {"focus"} <= {*parts} <= {*form}), None)
    if form is None:
        known = "; ".join(f"{','.join(f'{name}=…' for name in form)}: {what}" for form, what in CAMERA_PARTS.items())
        raise ValueError(f"--set is {text!r}: known are {known}")
    picture = IIPicture.load(field)
    picture.check_regular()
    if form == ("angle",):
        camera = with_assumed_camera(replace(picture, camera=None), parts["angle"]).camera
    elif "gap" in form:
        packed = picture.camera is not None and picture.camera.packed  # a row of cameras: its lenses stay square
        camera = IICamera(
            name=field.stem, pixels=picture.size, lenses=picture.lenses, pixel_pitch_mm=parts["pixel"],
            gap_mm=parts["gap"], packed=packed,
            lens_pitch_mm=picture.ei_pixels[0] * parts["pixel"] if packed else None,  # type: ignore[arg-type]
        )  # fmt: skip
    else:
        rig = Rig(**{f"{name}_mm": value for name, value in parts.items()})
        camera = rig.camera((picture.ei_pixels[0], picture.ei_pixels[1]), picture.lenses)
    assert camera is not None
    path = sidecar(field)
    write_json(path, {**read_json(path), "camera": camera.to_json()})
    say_done(f"{path}: camera {camera.name}, viewing angle {camera.view_angle_deg:.4g}°")


LAYOUTS = ("views", "hci", "quilt", "mosaic", "mat", "h5")


@app.command()
def export(
    picture: Annotated[Path, typer.Argument(help="An II-picture of regular structure, or a coded file.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="A folder, or a file for a quilt or mosaic.")],
    to: Annotated[str, typer.Option(help="views, hci, quilt, mosaic, mat or h5.")] = "views",
    depth: Annotated[Path | None, typer.Option(help="Map of z in mm (.exr), for the disparity map of hci.")] = None,
    row: Annotated[
        int | None, typer.Option(help="Row of views for a quilt, from 0; the middle one by default.")
    ] = None,
    plugin: Plugins = None,
    force: Force = False,
) -> None:
    """Export an II-picture for other light-field programs."""
    from ii_core import write_hci, write_quilt, write_views
    from ii_core.base.atomic import atomic_folder
    from ii_core.base.files import read_depth, write_image
    from ii_core.formats.arrays import write_array
    from ii_core.formats.quilt import quilt_path

    load_plugins(plugin)
    if to not in LAYOUTS:
        raise ValueError(f"unknown layout {to!r}: known are {', '.join(LAYOUTS)}")
    if depth is not None and to != "hci":
        raise ValueError(f"depth is no option of layout {to}: use --to hci")
    original = load_any(picture)
    if to in ("views", "hci"):
        check_folder(output, force)
        with spinner(f"export {picture.name}"), atomic_folder(output) as folder:
            if to == "views":
                write_views(original, folder)
            else:
                z = None if depth is None else read_depth(depth, size=original.size)
                write_hci(original, folder, depth=z)
        (k, l), (u, v) = original.lenses, original.ei_pixels
        say_done(f"{output}: {u * v} views of {k}×{l} px")
        return
    if to in ("mat", "h5"):
        if output.suffix.lower() != f".{to}":
            raise ValueError(f"{output} does not end in .{to}, which --to {to} writes")
        check_outputs([output], force)
        with spinner(f"export {picture.name}"):
            write_array(original, output)
        say_done(f"{output}: LF[v, u, y, x, c] and the camera")
        return
    target = quilt_path(output, original) if to == "quilt" else output
    check_outputs(image_file(target, original.pixels.dtype.name), force)
    if to == "quilt":
        write_quilt(original, target, row=row)
    else:
        write_image(target, original.pixels)
    say(target)  # a result: the command chose the name


@app.command()
def components(
    picture: Annotated[Path, typer.Argument(help="An II-picture of regular structure, or a coded file.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="A folder for the component images.")],
    type: Annotated[str, typer.Option(help="ei, si or ri.")] = "si",
    sheet: Annotated[
        Path | None, typer.Option(help="Write all of them into one picture, with lines between.")
    ] = None,
    plugin: Plugins = None,
    force: Force = False,
) -> None:
    """Write the elementary, sub- or ray-space images of an II-picture.

    Their names are ei_LENSROW_LENSCOLUMN, si_V_U and ri_V_LENSROW.
    """
    import numpy as np

    from ii_core import component_images
    from ii_core.base.atomic import atomic_folder
    from ii_core.base.files import write_image
    from ii_core.picture.component import KINDS

    load_plugins(plugin)
    if type not in KINDS:
        raise ValueError(f"unknown component image {type!r}: known are {', '.join(KINDS)}")
    original = load_any(picture)
    stack = component_images(original, type)
    rows, cols, height, width, _ = stack.shape
    suffix = ".exr" if stack.dtype.kind == "f" else ".png"
    digits = len(str(max(rows, cols) - 1))
    names = [output / f"{type}_{row:0{digits}}_{col:0{digits}}{suffix}" for row, col in np.ndindex(rows, cols)]
    check_outputs([*image_file(sheet, stack.dtype.name), *names], force, make_folder=True)
    check_folder(output, force)
    with progress_bar(f"write {output}") as report, atomic_folder(output) as folder:
        for i, (name, image) in enumerate(zip(names, stack.reshape(-1, height, width, 3), strict=True)):
            write_image(folder / name.name, image)
            report(i + 1, rows * cols, "")
    if sheet:
        lined = np.zeros((rows, height + 1, cols, width + 1, 3), stack.dtype)
        lined[:, :-1, :, :-1] = stack.transpose(0, 2, 1, 3, 4)
        write_image(sheet, lined.reshape(rows * (height + 1), cols * (width + 1), 3)[:-1, :-1])
    say_done(f"{output}: {rows}×{cols} images of {width}×{height} px")
