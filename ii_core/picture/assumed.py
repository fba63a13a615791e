"""Assumed camera of a picture without one, marked by its name: lengths in mm are nominal."""

from __future__ import annotations

import math
from dataclasses import replace

from ..base.checks import checked, instance, length, number
from ..camera.camera import ASSUMED, IICamera
from .picture import IIPicture

ASSUMED_ANGLE_DEG = 20.0


def is_nominal(picture: IIPicture) -> bool:
    """Return whether a picture's camera was assumed."""
    return picture.camera is not None and picture.camera.name == ASSUMED


@checked(picture=instance(IIPicture), angle_deg=number)
def with_assumed_camera(
    picture: IIPicture, angle_deg: float = ASSUMED_ANGLE_DEG, *, aspect: float | None = None
) -> IIPicture:
    """Return the picture with its camera, or with an assumed one of 1 mm pixels and this viewing angle.

    ``aspect`` is the width of a view over its height; if not given, its pixels are square.

    Raises
    ------
    TypeError
        If an argument has a wrong type.
    ValueError
        If the angle is not between 0 and 180°, or the aspect not positive.
    """
    if picture.camera is not None:
        return picture
    if not 0 < angle_deg < 180:
        raise ValueError(f"angle is {angle_deg:g}°: an angle between 0 and 180° is needed")
    (k, l), (u, v), tangent = picture.lenses, picture.ei_pixels, math.tan(math.radians(angle_deg / 2))
    down = u if aspect is None else u * k / (l * length("aspect", aspect))
    camera = IICamera(
        name=ASSUMED, pixels=picture.size, lenses=picture.lenses, pixel_pitch_mm=1.0, gap_mm=u / 2 / tangent,
        lens_pitch_mm=(u, down), packed=u != v or down != u,
    )  # fmt: skip
    return replace(picture, camera=camera)
