"""Assumed camera of a picture without one."""

from __future__ import annotations

import math
from dataclasses import replace

from ..camera.camera import IICamera
from .picture import IIPicture

ASSUMED_ANGLE_DEG = 20.0


def with_assumed_camera(picture: IIPicture) -> IIPicture:
    """Return the picture with its camera, or with an assumed one of 1 mm pixels and a viewing angle of 20°."""
    if picture.camera is not None:
        return picture
    gap = picture.ei_pixels[0] / 2 / math.tan(math.radians(ASSUMED_ANGLE_DEG / 2))
    camera = IICamera(pixels=picture.size, lenses=picture.lenses, pixel_pitch_mm=1.0, gap_mm=gap, name="assumed")
    return replace(picture, camera=camera)
