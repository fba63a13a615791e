"""Command calibrate: a camera from a raw lenslet picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from .common import Force, app, check_outputs
from .progress import say_done, spinner
from .words import say


@app.command()
def calibrate(
    raw: Annotated[Path, typer.Argument(help="A raw lenslet picture: an image file, .lfp or .lfr, or packed .raw.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="A folder for the camera and the picture.")],
    white: Annotated[Path | None, typer.Option(help="White image: the same camera before an even surface.")] = None,
    dark: Annotated[Path | None, typer.Option(help="Dark frame: the same camera without light.")] = None,
    metadata: Annotated[Path | None, typer.Option(help="JSON of packed .raw samples, if not RAW.json.")] = None,
    mosaic: Annotated[str | None, typer.Option(help="Colours of the sensor: rggb, bggr, grbg or gbrg.")] = None,
    lattice: Annotated[str | None, typer.Option(help="rectangular or hexagonal; detected if not given.")] = None,
    pixel_pitch_mm: Annotated[float | None, typer.Option(help="Pixel pitch of the sensor; not measured.")] = None,
    gap_mm: Annotated[float | None, typer.Option(help="Gap from sensor to lenses; not measured.")] = None,
    curve: Annotated[
        str | None,
        typer.Option(help="Tone curve of the values: linear or srgb; by default srgb for 8 bit."),
    ] = None,
    full_scale: Annotated[float | None, typer.Option(help="Raw value above dark of white.")] = None,
    bits: Annotated[int, typer.Option(help="Bits of the picture: 8, which all coders accept, or 16.")] = 8,
    force: Force = False,
) -> None:
    """Estimate the camera of a raw lenslet picture: pitch, rotation, offset and shear of its lens grid.

    Write picture.png, an II-picture with its camera and without vignetting, camera.json, report.json, and
    centres.png, the centres over the picture. `raytrace-ii regular` converts the picture to a regular structure.
    """
    from ii_core import calibrate as find
    from ii_core import calibrated_picture, centres_picture
    from ii_core.base.files import write_image, write_json
    from ii_core.formats.lfp import read_raw
    from ii_core.picture.picture import sidecar

    picture_file = output / "picture.png"
    files = {name: output / name for name in ("camera.json", "report.json", "centres.png")}
    check_outputs([picture_file, sidecar(picture_file), *files.values()], force, make_folder=True)
    source = read_raw(raw, metadata)
    frames: dict[str, Any] = {
        name: None if file is None else read_raw(file).samples for name, file in (("white", white), ("dark", dark))
    }
    mosaic = mosaic or source.mosaic
    curve = curve or ("srgb" if source.samples.dtype.name == "uint8" else "linear")
    with spinner(f"calibrate {raw.name}"):
        found = find(
            source.samples, **frames, mosaic=mosaic, lattice=lattice or source.lattice,
            pixel_pitch_mm=pixel_pitch_mm or source.pixel_pitch_mm, gap_mm=gap_mm or source.gap_mm, name=raw.stem,
        )  # fmt: skip
        made = calibrated_picture(
            found, source.samples, **frames, mosaic=mosaic, curve=curve,
            full_scale=full_scale if full_scale is not None else source.full_scale, bits=bits,
        )  # fmt: skip
        made.save(picture_file)
        write_json(files["camera.json"], found.camera.to_json())
        write_json(files["report.json"], found.report())
        write_image(files["centres.png"], centres_picture(found, made))
    say(found.describe())
    say_done(f"{picture_file}: values read as {curve}; run raytrace-ii regular {picture_file} -o … next")
