"""Model of an integral-imaging display: a panel of emitters behind a lens array, with faults of real ones."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from ..base.checks import MOST_MM, instance, length, one_of, place, within
from ..camera.camera import IICamera
from ..camera.optics import Grin, Lenslet, LensModel, Lenticular, Pinhole

LAYOUTS = ("square", "rgb-stripe", "pentile")


@dataclass(frozen=True, kw_only=True)
class DisplayModel:
    """A display for II-pictures of one camera: the camera's pixels emit, and its lens array sends the light back.

    With the defaults the display reverses the camera's rays. Other values model faults or choices of the display.

    Parameters
    ----------
    camera : IICamera
        Structure of the pictures shown, and the panel: pixels, pixel pitch, and the lens array they are made for.
        It is regular and has no lens in front of the array.
    lens_pitch_mm : float or (float, float), optional
        Pitch of the display's own lens array; the camera's if not given.
    gap_mm : float, optional
        g, from the panel to the lens plane, which stays in place; the camera's Λ if not given.
    shift_mm : (x, y)
        Shift of the lens array against the panel.
    turn_deg : float
        Rotation of the lens array against the panel, counter-clockwise as the viewer sees it with x to the right.
    layout : {"square", "rgb-stripe", "pentile"}
        Sub-pixels: one emitter of all colours, three upright stripes, or alternately red and blue beside green.
    fill : float
        Share of a sub-pixel's area that emits, (0, 1]. The panel's mean light is independent of it and of the layout.
    lobe : float
        n: radiance falls as cosⁿ of the angle to the panel's normal; 0 is the same in all directions.
    brightness : float
        Factor on all light.
    black : float
        Light of a black pixel as a share of white's, [0, 1).
    crosstalk : float
        Share of a pixel's light that comes from its four neighbours' signals, [0, 1).

    Raises
    ------
    ValueError
        If a value is out of range, or the camera has an element that the model lacks.
    """

    camera: IICamera
    lens_pitch_mm: tuple[float, float] = None  # type: ignore[assignment]  # filled in below
    gap_mm: float = None  # type: ignore[assignment]
    shift_mm: tuple[float, float] = (0.0, 0.0)
    turn_deg: float = 0.0
    layout: str = "square"
    fill: float = 1.0
    lobe: float = 0.0
    brightness: float = 1.0
    black: float = 0.0
    crosstalk: float = 0.0

    def __post_init__(self) -> None:
        def put(field: str, value: Any) -> None:
            object.__setattr__(self, field, value)

        instance(IICamera)("camera", self.camera)
        given = self.camera.lens_pitch_mm if self.lens_pitch_mm is None else self.lens_pitch_mm
        both = tuple(given) if isinstance(given, tuple | list) else (given, given)
        if len(both) != 2:
            raise ValueError(f"lens_pitch_mm is {given!r}: one length, or two, across and down, are needed")
        put("lens_pitch_mm", tuple(length("lens_pitch_mm", pitch) for pitch in both))
        put("gap_mm", length("gap_mm", self.camera.gap_mm if self.gap_mm is None else self.gap_mm))
        put("brightness", within("brightness", self.brightness, 1e-9, 1e9))
        put("shift_mm", place("shift_mm", self.shift_mm, 2))
        put("turn_deg", within("turn_deg", self.turn_deg, -MOST_MM, MOST_MM))
        one_of(*LAYOUTS)("layout", self.layout)
        for field, low, high in (("lobe", 0.0, 1000.0), ("black", 0.0, 1.0), ("crosstalk", 0.0, 1.0)):
            if not low <= within(field, getattr(self, field), -MOST_MM, MOST_MM) < high:
                raise ValueError(f"{field} is {getattr(self, field)}: at least {low:g} and below {high:g} is needed")
        if not 0 < within("fill", self.fill, -MOST_MM, MOST_MM) <= 1:
            raise ValueError(f"fill is {self.fill}: a share above 0, up to 1, is needed")
        self._check_camera()

    def _check_camera(self) -> None:
        if not self.camera.regular:
            raise ValueError(
                "camera has lenses that cover no whole number of pixels: a regular structure is needed, "
                "raytrace-ii regular makes it"
            )
        if self.camera.front:
            raise ValueError(f"camera has a {self.camera.front[0].kind} before its lens array: the display has none")
        known = (Pinhole, Grin, Lenticular, Lenslet)
        if not isinstance(self.optics, known):
            names = ", ".join(kind.kind for kind in known)
            raise ValueError(f"camera has a {self.optics.kind} over every lens: the display models {names}")
        if isinstance(self.optics, Lenslet) and not isinstance(self.optics.focal_mm, float | int):
            raise ValueError("camera has lenses of several focal lengths: the display has one")

    @property
    def optics(self) -> LensModel:
        """Kind of element over every lens."""
        return self.camera.lens_model

    @property
    def ei_pitch_mm(self) -> tuple[float, float]:
        """Width and height of an elementary image on the panel."""
        u, v = self.camera.ei_pixels
        return u * self.camera.pixel_pitch_mm, v * self.camera.pixel_pitch_mm

    @property
    def axes(self) -> tuple[float, float]:
        """Cosine and sine of the lens array's turn."""
        turn = math.radians(self.turn_deg)
        return (math.cos(turn), math.sin(turn)) if turn else (1.0, 0.0)
