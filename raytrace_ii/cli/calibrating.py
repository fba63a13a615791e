"""Command calibrate: a camera from a raw lenslet picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from .common import Force, app, check_outputs
from .progress import Report, progress_bar, say_done
from .words import say

if TYPE_CHECKING:
    from ii_core import Calibration, IIPicture

FociOption = Annotated[
    str | None,
    typer.Option(
        help="Multi-focus arrays: virtual depth in focus of each lens type, as in 2.1,3.4,9, or the .xml of a "
        "Raytrix camera; found if not given."
    ),
]


@app.command()
def calibrate(
    raw: Annotated[Path, typer.Argument(help="A raw lenslet picture: an image file, .lfp or .lfr, or packed .raw.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="A folder for the camera and the picture.")],
    white: Annotated[
        Path | None,
        typer.Option(
            "--white",
            "--whites",
            help="White image: the same camera before an even surface; or the camera's calibration data, a folder, "
            ".tar or data.C.0, from which the nearest in zoom and focus is taken.",
        ),
    ] = None,
    dark: Annotated[Path | None, typer.Option(help="Dark frame: the same camera without light.")] = None,
    metadata: Annotated[
        Path | None, typer.Option(help="JSON of packed .raw samples, if not RAW.json or RAW.txt.")
    ] = None,
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
    foci: FociOption = None,
    force: Force = False,
) -> None:
    """Estimate the camera of a raw lenslet picture: pitch, rotation, offset and shear of its lens grid.

    Write picture.png, an II-picture with its camera and without vignetting, camera.json, report.json, and
    centres.png, the centres over the picture. `raytrace-ii regular` converts the picture to a regular structure.
    """
    from ii_core import centres_picture
    from ii_core.base.files import write_image, write_json
    from ii_core.picture.picture import sidecar

    picture_file = output / "picture.png"
    files = {name: output / name for name in ("camera.json", "report.json", "centres.png")}
    check_outputs([picture_file, sidecar(picture_file), *files.values()], force, make_folder=True)
    with progress_bar(f"calibrate {raw.name}") as report:
        shot = captured(
            raw, white=white, dark=dark, metadata=metadata, mosaic=mosaic, lattice=lattice, curve=curve,
            pixel_pitch_mm=pixel_pitch_mm, gap_mm=gap_mm, full_scale=full_scale, bits=bits, foci=foci, report=report,
        )  # fmt: skip
        shot.picture.save(picture_file)
        write_json(files["camera.json"], shot.found.camera.to_json())
        write_json(files["report.json"], shot.found.report())
        write_image(files["centres.png"], centres_picture(shot.found, shot.picture))
    say(shot.found.describe())
    say(shot.told())
    say_done(f"{picture_file}: values read as {shot.curve}; run raytrace-ii regular {picture_file} -o … next")


class Captured(NamedTuple):
    """A raw picture that was calibrated."""

    found: Calibration
    picture: IIPicture
    curve: str
    white: str | None  # name of the white picture
    repaired: int  # pixels
    coloured: bool  # by the camera's metadata

    def told(self) -> str:
        """One line on the white picture and colours."""
        white = f"white picture {self.white}, {self.repaired} defective pixels replaced" if self.white else None
        colour = "gains and colour matrix of the metadata" if self.coloured else "colours as the sensor has them"
        return "; ".join(filter(None, (white or "no white picture: shading stays, centres are less sure", colour)))


def captured(
    raw: Path, *, white: Path | None, dark: Path | None = None, metadata: Path | None = None,
    mosaic: str | None = None, lattice: str | None = None, curve: str | None = None,
    pixel_pitch_mm: float | None = None, gap_mm: float | None = None, full_scale: float | None = None, bits: int = 8,
    foci: str | None = None, report: Report,
) -> Captured:  # fmt: skip
    """Read, calibrate and develop a raw picture; see the options of `calibrate`."""
    from dataclasses import replace

    from ii_core import calibrate as find
    from ii_core.calibration.multi_focus import lens_foci, with_foci
    from ii_core.calibration.raw_camera import developed
    from ii_core.formats.lfp import read_raw
    from ii_core.formats.whites import read_white

    depths = None if foci is None else _depths(foci)
    report(0, 4, "read")
    source = read_raw(raw, metadata)
    name, white_picture = (None, None) if white is None else read_white(white, source.setting)
    frames: dict[str, Any] = {
        "white": None if white_picture is None else white_picture.samples,
        "dark": None if dark is None else read_raw(dark).samples,
    }
    mosaic = mosaic or source.mosaic
    curve = curve or ("srgb" if source.samples.dtype.name == "uint8" else "linear")
    report(1, 4, "find lenses")
    found = find(
        source.samples, **frames, mosaic=mosaic, lattice=lattice or source.lattice,
        pixel_pitch_mm=pixel_pitch_mm or source.pixel_pitch_mm, gap_mm=gap_mm or source.gap_mm, name=raw.stem,
    )  # fmt: skip
    report(2, 4, "vignetting, defects, mosaic, colours")
    made, bad = developed(
        found, source.samples, **frames, mosaic=mosaic, curve=curve, bits=bits, colour=source.colour,
        demosaic="directional",
        full_scale=full_scale if full_scale is not None else source.full_scale,
    )  # fmt: skip
    report(3, 4, "lens types")
    known = lens_foci(made, found.types, depths=depths)
    if depths is not None and known is None:
        raise ValueError(f"foci are given, and of lens types there are {found.types.describe()}: they cannot be told")
    if known is not None:
        camera = with_foci(found.camera, known)
        found, made = replace(found, camera=camera, foci=known), replace(made, camera=camera)
    report(4, 4, "")
    return Captured(found, made, curve, name, bad, source.colour is not None)


def _depths(text: str) -> tuple[float, ...]:
    """Return virtual depths of lens types from ``2.1,3.4,9`` or the XML of a Raytrix camera."""
    from ii_core.calibration.multi_focus import virtual_depths

    if text.lower().endswith(".xml"):
        return virtual_depths(text)
    try:
        depths = tuple(float(part) for part in text.split(","))
    except ValueError:
        depths = ()
    if not 2 <= len(depths) <= 4 or not all(1 < d < 1e6 for d in depths):
        raise ValueError(f"foci is {text!r}: 2 to 4 virtual depths beyond 1, as in 2.1,3.4,9, or an .xml are needed")
    return depths


def with_types(picture: IIPicture, text: str) -> IIPicture:
    """Return a picture of a multi-focus array whose lenses are of one focus: `fuse`, or the number of a type."""
    from ii_core.calibration.multi_focus import fused

    if text != "fuse" and not (text.isdecimal() and text.isascii()):
        raise ValueError(f"lens-types is {text!r}: keep, fuse or the number of a type is needed")
    made, taken = fused(picture, only=None if text == "fuse" else int(text[:9]))
    say(f"lens types: {taken.mean():.1%} of the pixels are those of lenses nearby in better focus")
    return made
