"""Assumed camera of a picture without one, marked by its name: lengths in mm are nominal."""

from __future__ import annotations

import math
from dataclasses import replace

from ..base.checks import checked, instance, number
from ..camera.camera import IICamera
from .picture import IIPicture

ASSUMED = "nominal"  # name of such a camera, also in files
ASSUMED_ANGLE_DEG = 20.0


def is_nominal(picture: IIPicture) -> bool:
    """Return whether a picture's camera was assumed."""
    return picture.camera is not None and picture.camera.name == ASSUMED


@checked(picture=instance(IIPicture), angle_deg=number)
def with_assumed_camera(picture: IIPicture, angle_deg: float = ASSUMED_ANGLE_DEG) -> IIPicture:
    """Return the picture with its camera, or with an assumed one of 1 mm pixels and this viewing angle.

    Raises
    ------
    TypeError
        If an argument has a wrong type.
    ValueError
        If the angle is not between 0 and 180°.
    """
    if picture.camera is not None:
        return picture
    if not 0 < angle_deg < 180:
        raise ValueError(f"angle is {angle_deg:g}°: an angle between 0 and 180° is needed")
    gap = picture.ei_pixels[0] / 2 / math.tan(math.radians(angle_deg / 2))
    camera = IICamera(pixels=picture.size, lenses=picture.lenses, pixel_pitch_mm=1.0, gap_mm=gap, name=ASSUMED)
    return replace(picture, camera=camera)


def shown_pitch_mm(camera: IICamera) -> tuple[float, float]:
    """Return the lens pitch at which a picture is shown: that of an assumed camera is the same across and down.

    Pixels of foreign views are square, and views of a row of cameras have one pixel under each lens down.
    """
    across, down = camera.lens_pitch_mm
    return across, across if camera.name == ASSUMED else down


def parallax_down(camera: IICamera) -> bool:
    """Return whether views differ down: not under lenticular lenses, nor in one row of assumed cameras."""
    return camera.lens_model.vertical_parallax and not (camera.name == ASSUMED and camera.ei_pixels[1] == 1)
