"""Cameras by name, from the JSON files of ``assets/cameras``, and from files of the user's own."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import assets

from . import checks
from .camera import IICamera
from .files import one_line, read_json
from .optics import Scaling, scaled_chain

ALIASES = {"setup2": "setup2-16"}


def camera_names() -> dict[str, str]:
    """Names of the cameras that come with the package, each with a line on what it is."""
    return {path.stem: str(_read(path).get("about", "")) for path in _folder().glob("*.json")}


@checks.checked(name=checks.path, scale=checks.number)
def preset(name: str | os.PathLike[str], *, scale: int = 1) -> IICamera:
    """A camera by name, or from a JSON file.

    Parameters
    ----------
    name : str or path
        One of `camera_names`; ``setup2`` is ``setup2-16``. Or a file that ends in ``.json``.
    scale : int
        Divides the number of lenses (of pixels, for a camera of one lens) along both axes. Sensor size,
        pixels per elementary image, viewing angle and the scene planes in focus stay, so pixel pitch, lens pitch,
        gap and apertures grow by ``scale``, focal lengths follow from them (see `scaled`), and a scene looks the
        same, coarser, at every scale.

    Raises
    ------
    ValueError
        If the name is unknown, the file is wrong, the scale does not divide the lenses, or the name stands for
        several cameras.
    OSError
        If the file is missing.
    """
    cameras = preset_cameras(name, scale=scale)
    if len(cameras) > 1:
        raise ValueError(f"camera {str(name)!r} is a set of {len(cameras)}: preset_cameras gives them all")
    return cameras[0]


@checks.checked(name=checks.path, scale=checks.number)
def preset_cameras(name: str | os.PathLike[str], *, scale: int = 1) -> tuple[IICamera, ...]:
    """All cameras of a name: one, or those of a camera array, of moving lenslets or of stacked sensors.

    Parameters and errors are those of `preset`.
    """
    path = Path(name)
    if path.suffix != ".json":
        stem = ALIASES.get(str(name), str(name))
        path = _folder() / f"{stem}.json"
        if not path.is_file() or os.sep in stem:
            known = ", ".join([*sorted(camera_names()), *ALIASES])
            raise ValueError(f"unknown camera {str(name)!r}: known are {known}, or give a .json file")
    data = _read(path)
    try:
        members = data["cameras"] if data.get("kind") == "set" else [data]
        return tuple(scaled(IICamera.from_json({"name": path.stem, **member}), scale) for member in members)
    except (ValueError, TypeError, KeyError, AttributeError, ArithmeticError) as error:
        raise ValueError(f"{path if Path(name).suffix else name}: {one_line(error)}") from None


def scaled(camera: IICamera, scale: int) -> IICamera:
    """The camera with ``scale`` times as large, fewer lenslets, or pixels if it has one lens.

    Pixel pitch, lens pitch, lens offset, gap and apertures grow by s = ``scale``. The scene stands still, so every
    plane in it that the optics single out must stand still too, while the lens plane moves from Λ to sΛ, by
    d = (s − 1)Λ. What this asks of each element:

    Pinholes, GRIN rods, lenticular lenses
        Nothing. They image no plane.
    Lenslets, of one or several focal lengths
        Image the plane b before the lens plane, 1/b = 1/f − 1/Λ (2.3). The same plane then lies b − d before it:
        1/f' = 1/(sΛ) + 1/(b − d). Λ = f, depth priority, stays sΛ = f'.
    Spherical lenslets
        The same with the paraxial plane: the radius solves for it.
    First lens in front: depth-control lens, main lens
        Keeps place and rim, which make the viewpoint and the parallax of what the scene shows, and the scene plane
        that it images onto the lens array. That plane is in focus in a plenoptic 1.0 camera and lies on the display
        behind a depth-control lens. With a from the lens plane to the lens, 1/f' = 1/f + 1/(a − d) − 1/a.
    Lenslets behind a lens in front
        Keep the scene plane that they image through it. At the lens the vergence 1/(a − b) of their plane changes
        as the lens's own power does; solved for b, 1/b' = (a²/b − d)/(a − d)².
    Further lenses in front
        Keep place and focal length.

    Apertures grow with the lens pitch, so the blur off the focus is as many lens pitches wide: views of the picture
    are blurred alike, in their own pixels. The field of view behind a main lens widens by a/(a − d).

    Raises
    ------
    ValueError
        If the scale does not divide the lenses and pixels, or the lens plane would pass a plane in focus or a lens
        in front.
    """
    single = camera.lenses == (1, 1)
    divided, what = (camera.pixels, "pixels") if single else (camera.lenses, "lenses")
    if not isinstance(scale, int) or scale < 1 or any(n % scale for n in (*divided, *camera.pixels)):
        raise ValueError(
            f"scale {scale} does not divide the {divided[0]}×{divided[1]} {what} and "
            f"{camera.pixels[0]}×{camera.pixels[1]} pixels: a whole number that divides all is needed"
        )
    if scale == 1:
        return camera
    pixels = camera.pixels[0] // scale, camera.pixels[1] // scale
    pitch = camera.pixel_pitch_mm * scale
    if single:
        return replace(camera, pixels=pixels, pixel_pitch_mm=pitch)
    # The depth of a sensor in its stack grows with the gap; where a camera stands among others does not.
    forward = camera.origin_mm[2] * (scale - 1)
    scaling = Scaling(
        factor=scale,
        gap_mm=camera.gap_mm,
        cell_mm=camera.lens_pitch_mm,
        forward_mm=camera.gap_mm * (scale - 1) + forward,
        front_mm=camera.front[0].z_mm - camera.gap_mm if camera.front else None,
    )
    try:
        optics = scaled_chain(camera.optics, scaling, nearer_mm=forward)
    except ValueError as error:
        raise ValueError(f"scale {scale}: {error}") from None
    return replace(
        camera,
        pixels=pixels,
        lenses=(camera.lenses[0] // scale, camera.lenses[1] // scale),
        pixel_pitch_mm=pitch,
        gap_mm=camera.gap_mm * scale,
        lens_pitch_mm=_times(camera.lens_pitch_mm, scale),
        lens_offset_mm=_times(camera.lens_offset_mm, scale),
        origin_mm=(*camera.origin_mm[:2], camera.origin_mm[2] + forward),
        optics=optics,
    )


def _times(lengths: tuple[float, ...], scale: int) -> Any:
    return tuple(x * scale for x in lengths)


def _folder() -> Path:
    return Path(str(files(assets) / "cameras"))


def _read(path: Path) -> Mapping[str, Any]:
    data = read_json(path)
    if not isinstance(data, Mapping):
        raise ValueError(f"{path}: no camera: an object is needed")
    return data
