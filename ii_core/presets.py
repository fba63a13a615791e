"""Cameras by name: the dissertation's coding setups and its 2D pinhole camera (Tables 3.1, 5.1, 5.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from .camera import IICamera, Pair

PIXEL_PITCH_MM = 0.0061
# The dissertation gives f for setup 3 only; its viewing angle (2.1) is kept for the other setups.
VIEW_ANGLE_DEG = math.degrees(2 * math.atan(0.39 / (2 * 0.73)))


@dataclass(frozen=True)
class Preset:
    """The structure of a named camera and what it is for."""

    pixels: Pair
    lenses: Pair
    about: str


PRESETS = {
    "setup1": Preset((8192, 4096), (512, 256), "coding setup 1: many small elementary images, 16×16 px"),
    **{
        f"setup2-{ei}": Preset(
            (8192, 4096), (8192 // ei, 4096 // ei), f"coding setup 2 with {ei}×{ei} px elementary images"
        )
        for ei in (16, 32, 64, 128, 256)
    },
    "setup3": Preset((4096, 4096), (64, 64), "coding setup 3: as many lenses as pixels per lens"),
    "pinhole2d": Preset((8192, 4608), (1, 1), "a 2D camera: one pinhole"),
}
ALIASES = {"setup2": "setup2-16"}


def preset(name: str, *, scale: int = 1) -> IICamera:
    """A camera by name.

    Parameters
    ----------
    name : str
        One of `PRESETS`; ``setup2`` is ``setup2-16``.
    scale : int
        Divides the number of lenses (of pixels, for a camera of one lens) along both axes. Sensor size,
        pixels per elementary image and viewing angle stay, so pixel pitch, lens pitch and gap grow by ``scale``
        and a scene looks the same, coarser, at every scale.

    Raises
    ------
    ValueError
        If the name is unknown or the scale does not divide the lenses.
    """
    try:
        p = PRESETS[ALIASES.get(name, name)]
    except KeyError:
        raise ValueError(f"unknown camera {name!r}: known are {', '.join([*PRESETS, *ALIASES])}") from None
    divided, what = (p.pixels, "pixels") if p.lenses == (1, 1) else (p.lenses, "lenses")
    if not isinstance(scale, int) or scale < 1 or divided[0] % scale or divided[1] % scale:
        raise ValueError(
            f"scale {scale} does not divide the {divided[0]}×{divided[1]} {what} of {name}: "
            "a whole number that divides both is needed"
        )
    lenses = p.lenses if p.lenses == (1, 1) else (p.lenses[0] // scale, p.lenses[1] // scale)
    pitch = PIXEL_PITCH_MM * scale
    pixels = p.pixels[0] // scale, p.pixels[1] // scale
    lens_width = pixels[0] // lenses[0] * pitch
    return IICamera(
        name=name,
        pixels=pixels,
        lenses=lenses,
        pixel_pitch_mm=pitch,
        gap_mm=lens_width / (2 * math.tan(math.radians(VIEW_ANGLE_DEG) / 2)),
    )
