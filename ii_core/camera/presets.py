"""Cameras by name from ``assets/cameras.json``, or from JSON files of the user."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import assets

from ..base import checks
from ..base.files import one_line, read_json
from .camera import IICamera
from .elements import Scaling
from .optics import scaled_chain
from .prescriptions import placed
from .surfaces import surfaces_of

ALIASES = {"setup2": "setup2-16"}
PACKAGE = Path(str(files(assets) / "cameras.json"))


def camera_names() -> dict[str, str]:
    """Return the names of the cameras of the package with a description in one line."""
    return {name: str(camera.get("about", "")) for name, camera in _read(PACKAGE).items()}


@checks.checked(name=checks.path, scale=checks.number)
def preset(name: str | os.PathLike[str], *, scale: int = 1) -> IICamera:
    """Return a camera by name or from a JSON file.

    Parameters
    ----------
    name : str or path
        One of `camera_names`; ``setup2`` is ``setup2-16``. Or a file that ends in ``.json``, or an II-picture, whose
        own camera it is.
    scale : int
        Divides the number of lenses (of pixels for a camera of one lens) along both axes. Sensor size, pixels per
        elementary image, viewing angle and scene planes in focus do not change. Pixel pitch, lens pitch, gap and
        apertures grow by ``scale``; focal lengths follow (see `scaled`). Scenes look the same, at lower resolution.

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
    """Return all cameras of a name: several for a camera array, moving lenslets or stacked sensors.

    Parameters and errors are those of `preset`.
    """
    path, stem = Path(name), ALIASES.get(str(name), str(name))
    if path.suffix not in ("", ".json") and path.is_file():
        path = path.with_name(f"{path.name}.json")
    if path.suffix == ".json":
        data, stem, folder = _read(path), path.stem, path.parent
        if data.get("format") == "ii-picture":
            if not data.get("camera"):
                raise ValueError(f"{path}: the picture has no camera: `camera --set` gives it one")
            data = data["camera"]
    else:
        if stem not in (known := _read(PACKAGE)):
            names = ", ".join([*known, *ALIASES])
            raise ValueError(
                f"unknown camera {checks.shown(str(name))}: known are {names}, or give a .json file or an II-picture"
            )
        data, folder = known[stem], PACKAGE.parent
    try:
        members = data["cameras"] if data.get("kind") == "set" else [data]
        members = [_with_lenses({"name": stem, **member}, folder) for member in members]
        return tuple(scaled(IICamera.from_json(member), scale) for member in members)
    except (ValueError, TypeError, KeyError, AttributeError, ArithmeticError) as error:
        raise ValueError(f"{path if Path(name).suffix else name}: {one_line(error)}") from None


def scaled(camera: IICamera, scale: int) -> IICamera:
    """Return a camera of fewer lenslets, ``scale`` times as large; with one lens, of fewer pixels.

    Pixel pitch, lens pitch, lens offset, gap and apertures grow by s = ``scale``. The scene and its planes in focus
    do not move, while the lens plane moves from Λ to sΛ, by d = (s − 1)Λ. The elements change accordingly:

    Pinholes, GRIN rods, lenticular lenses
        No change. They image no plane.
    Lenslets of one or several focal lengths
        They image the plane at the distance b in front of the lens plane, 1/b = 1/f − 1/Λ (2.3). Its distance becomes
        b − d, so 1/f' = 1/(sΛ) + 1/(b − d). Depth priority, Λ = f, remains: sΛ = f'.
    Spherical lenslets
        As lenslets, with the paraxial plane; the radius is solved for it.
    First lens in front (depth-control lens, main lens)
        Its position and rim, which set viewpoint and parallax, do not change. It still images the same scene plane
        onto the lens array: the plane in focus of a plenoptic 1.0 camera, or the display plane of a depth-control
        lens. With a the distance from the lens plane to the lens, 1/f' = 1/f + 1/(a − d) − 1/a.
    Lenslets behind a lens in front
        They still image the same scene plane through it. The vergence 1/(a − b) of their plane at the lens changes by
        as much as the power of the lens. Solved for b: 1/b' = (a²/b − d)/(a − d)².
    Further lenses in front
        Position and focal length do not change.
    Lens of surfaces in front
        Its glass cannot change, so the lens plane keeps its place in the scene, d = 0, and the pixel array moves back
        by (s − 1)Λ: ``origin_mm`` is negative. All planes and the field of view stay.

    Start of rays, meeting of viewing zones
        Their positions in the scene do not change. Of an array of cameras, whose rays start there, nor does the lens
        plane; pixels are then `packed`.

    Apertures grow with the lens pitch, so the blur of planes out of focus, in pixels of a view, does not change. The
    field of view of a main lens grows by a/(a − d).

    Raises
    ------
    ValueError
        If the scale does not divide the lenses and pixels, or the lens plane would reach a plane in focus or a lens
        in front.
    """
    single = camera.lenses == (1, 1)
    divided, what = (camera.pixels, "pixels") if single else (camera.lenses, "lenses")
    if not isinstance(scale, int) or scale < 1 or any(n % scale for n in (*divided, *camera.pixels)):
        common = math.gcd(*divided, *camera.pixels)
        fitting = [n for n in range(1, math.isqrt(common) + 1) if common % n == 0]
        fitting = sorted({*fitting, *(common // n for n in fitting)})
        raise ValueError(
            f"scale {scale} does not divide the {divided[0]}×{divided[1]} {what} and "
            f"{camera.pixels[0]}×{camera.pixels[1]} pixels: one of {', '.join(map(str, fitting))} is needed"
        )
    if scale == 1:
        return camera
    pixels = camera.pixels[0] // scale, camera.pixels[1] // scale
    pitch = camera.pixel_pitch_mm * scale
    if single:
        return replace(camera, pixels=pixels, pixel_pitch_mm=pitch)
    nearer = camera.gap_mm * (scale - 1)
    # The depth of a sensor in a stack grows with the gap; the position of a camera in an array does not.
    array = camera.viewer_mm is not None and camera.start_mm == camera.viewer_mm  # of cameras: the plane stays
    kept = array or surfaces_of(camera.front)
    forward = -nearer if kept else camera.origin_mm[2] * (scale - 1)
    viewer = None if camera.viewer_mm is None else camera.viewer_mm + nearer + forward
    start = camera.start_mm + nearer + forward if camera.start_mm else 0.0
    packed = camera.packed or array
    scaling = Scaling(
        factor=scale,
        gap_mm=camera.gap_mm,
        cell_mm=camera.lens_pitch_mm,
        forward_mm=nearer + forward,
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
        lens_pitch_mm=_times(camera.lens_pitch_mm, scale) if viewer is None or packed else None,  # type: ignore[arg-type]
        start_mm=start,
        viewer_mm=viewer,
        packed=packed,
        lens_offset_mm=_times(camera.lens_offset_mm, scale),
        lens_drift_mm=camera.lens_drift_mm and tuple(_times(factors, scale) for factors in camera.lens_drift_mm),
        origin_mm=(*camera.origin_mm[:2], camera.origin_mm[2] + forward),
        optics=optics,
    )


def _with_lenses(camera: Mapping[str, Any], folder: Path) -> Mapping[str, Any]:
    """Return the values of a camera with the surfaces of its prescriptions."""
    optics = camera.get("optics")
    return {**camera, "optics": [placed(e, folder) for e in optics]} if isinstance(optics, list) else camera


def _times(lengths: tuple[float, ...], scale: int) -> Any:
    return tuple(x * scale for x in lengths)


def _read(path: Path) -> Mapping[str, Any]:
    data = read_json(path)
    if not isinstance(data, Mapping):
        raise ValueError(f"{path}: no camera: an object is needed")
    return data
