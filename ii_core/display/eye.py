"""Model of an eye in front of an integral-imaging display: light of the panel, averaged over the pupil."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.checks import MOST_MM, Pair, checked, instance, length, place, view_size, whole, within
from ..base.colour import linear, srgb
from ..camera.camera import IICamera
from ..camera.optics import Lenslet, unit_disk
from ..picture.picture import IIPicture
from ..picture.view import lens_array_mm, pixels_aside
from .eye_kernel import Emitters, Gaze, Lenses, Panel, Refraction, see
from .model import LAYOUTS, DisplayModel

RAYS = 64  # rays per point of the view, for a pupil that is no point
MOST_RAYS = 1 << 16
EYES_APART_MM = 63.0


@dataclass(frozen=True, kw_only=True)
class Eye:
    """A viewer's eye.

    Parameters
    ----------
    position_mm : (x, y, z)
        Centre of the pupil in camera coordinates; a display's viewer stands at z < 0.
    pupil_mm : float
        Diameter of the pupil, which is parallel to the lens plane; 0 is a point.
    focus_mm : float, optional
        Distance along z from the eye to the plane in focus; the lens plane if not given.

    Raises
    ------
    ValueError
        If a value is out of range.
    """

    position_mm: tuple[float, float, float]
    pupil_mm: float = 0.0
    focus_mm: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "position_mm", place("position_mm", self.position_mm, 3))
        if not within("pupil_mm", self.pupil_mm, -MOST_MM, MOST_MM) >= 0:
            raise ValueError(f"pupil_mm is {self.pupil_mm}: a diameter in mm, 0 for a point, is needed")
        if self.focus_mm is not None:
            length("focus_mm", self.focus_mm)

    def pair(self, apart_mm: float = EYES_APART_MM) -> tuple[Eye, Eye]:
        """Return the left and the right eye of a viewer whose nose is here."""
        x, y, z = self.position_mm
        half = length("apart_mm", apart_mm) / 2
        return replace(self, position_mm=(x - half, y, z)), replace(self, position_mm=(x + half, y, z))


class EyeImage(NamedTuple):
    """View of an eye.

    Attributes
    ----------
    light : ndarray of float32, (height, width, 3)
        Linear light, 1 for white of brightness 1; red, green and blue of sRGB's primaries.
    seen : ndarray of float32, (height, width)
        Share of the rays that meet a lens and, through it, the panel.
    """

    light: NDArray[np.float32]
    seen: NDArray[np.float32]

    @property
    def pixels(self) -> NDArray[np.uint8]:
        """As 8-bit sRGB, light above white clipped."""
        return np.rint(255 * srgb(np.clip(self.light.astype(np.float64), 0, 1))).astype(np.uint8)


@checked(picture=instance(IIPicture), display=instance(DisplayModel), eye=instance(Eye), rays=whole)
def eye_image(
    picture: IIPicture, display: DisplayModel, eye: Eye, *, size: Pair | None = None, rays: int | None = None
) -> EyeImage:
    """Return the view of an eye of a display: the mean over its pupil of the light from the panel.

    A ray from a point of the pupil meets the lens plane under the lens of its cell. Through a lens with centre c it
    ends on the panel at q = c + (c − e)·g/d, e being the point of the pupil and d its distance from the lens plane. A
    thin lens adds (a − c)(1 + g/d − g/f), a being the place on the lens. The panel shows each elementary image turned
    by 180° about the lens it is made for, c₀, so that its pixel is the one at 2c₀ − q of the picture. With pinholes,
    a point pupil and matched arrays this is (4.1), and the result is `view_image`'s with ``"nearest"`` to the bit;
    outside the viewing zone, too, lenses show the elementary images that `view_image` takes.

    Parameters
    ----------
    picture : IIPicture
        Of the structure of the display's camera. Integers are sRGB, floats linear light.
    display : DisplayModel
    eye : Eye
    size : (width, height), optional
        Points of the view, spread over the lens array; one per lens if not given.
    rays : int, optional
        Rays per point, spread over the pupil and over the point's cell on the lens plane. If not given, 1 for a point
        pupil and `RAYS` for others. A single ray joins the centres.

    Returns
    -------
    EyeImage
        Light of rays that miss the lenses or the panel is 0.

    Raises
    ------
    ValueError
        If the structures differ, the eye is not before the lens plane, or a number is out of range.

    Notes
    -----
    The picture is read in place: memory is that of the result.
    """
    picture.check_regular()
    camera = display.camera
    if (picture.lenses, picture.ei_pixels) != (camera.lenses, camera.ei_pixels):
        raise ValueError(
            f"picture has {picture.lenses} lenses of {picture.ei_pixels} pixels, the display {camera.lenses} of "
            f"{camera.ei_pixels}: the same structure is needed"
        )
    count = (RAYS if eye.pupil_mm > 0 else 1) if rays is None else rays
    if not 1 <= count <= MOST_RAYS:
        raise ValueError(f"rays is {rays!r}: a whole number from 1 to {MOST_RAYS} is needed")
    width, height = camera.lenses if size is None else view_size("size", size)
    half = _half(display)
    step = 2 * half / (width, height)
    light, seen = np.empty((height, width, 3), np.float32), np.empty((height, width), np.float32)
    distance = _distance(camera, eye)
    gaze = Gaze(
        columns=(np.arange(width) + 0.5) * step[0] - half[0],
        rows=half[1] - (np.arange(height) + 0.5) * step[1],
        rays=pupil_rays(count, eye.pupil_mm, step),
        x=float(eye.position_mm[0] - camera.origin_mm[0]),
        y=float(eye.position_mm[1] - camera.origin_mm[1]),
        blur=0.0 if eye.focus_mm is None else 1 - distance / eye.focus_mm,
    )
    sign = -1.0 if picture.erect else 1.0
    lens = _refraction(display, distance, sign)
    table, emitters = _table(picture.pixels.dtype), _emitters(display)
    see(picture.pixels, table, gaze, _lenses(display, half), _panel(camera, sign), lens, emitters, light, seen)
    return EyeImage(light, seen)


def _distance(camera: IICamera, eye: Eye) -> float:
    """Return the distance of the eye from the lens plane."""
    z, base = eye.position_mm[2], camera.origin_mm[2]
    distance = camera.gap_mm - (z - base)
    if not distance > 0:
        plane = base + camera.gap_mm
        raise ValueError(f"eye is at z {z:g} mm, not before the lens plane at {plane:g} mm: z < {plane:g} is needed")
    return distance


def _half(display: DisplayModel) -> NDArray[np.float64]:
    """Return half the size of the lens array; to the bit the panel's if pitches match, as in `view_positions`."""
    camera = display.camera
    own = zip(lens_array_mm(camera), camera.lens_pitch_mm, display.lens_pitch_mm, camera.lenses, strict=True)
    return np.array([(size if pitch == made else count * pitch) / 2 for size, made, pitch, count in own])


def _lenses(display: DisplayModel, half: NDArray[np.float64]) -> Lenses:
    """Return the lens array; ``half`` is half its size."""
    (columns, rows), (pitch_x, pitch_y) = display.camera.lenses, display.lens_pitch_mm
    (shift_x, shift_y), (cos, sin) = display.shift_mm, display.axes
    return Lenses(
        columns=columns, rows=rows, pitch_x=pitch_x, pitch_y=pitch_y, half_x=half[0], half_y=half[1],
        shift_x=shift_x, shift_y=shift_y, cos=cos, sin=sin,
    )  # fmt: skip


def _panel(camera: IICamera, sign: float) -> Panel:
    """Return the panel of a camera's pixels; ``sign`` is −1 for erect elementary images."""
    (pitch_x, pitch_y), (width, height), (u, v) = camera.lens_pitch_mm, lens_array_mm(camera), camera.ei_pixels
    return Panel(
        pitch_x=float(pitch_x), pitch_y=float(pitch_y), half_x=width / 2, half_y=height / 2,
        aside=pixels_aside(camera, sign), pixel=float(camera.pixel_pitch_mm), u=u, v=v,
    )  # fmt: skip


def _refraction(display: DisplayModel, distance: float, sign: float) -> Refraction:
    """Return the effect of a lens on rays from so far; ``sign`` is −1 for erect elementary images."""
    lens, gap, pitch = display.optics, display.gap_mm, display.camera.pixel_pitch_mm
    spread, bend, radius = 0.0, 0.0, math.inf
    if isinstance(lens, Lenslet):
        spread = 1 + gap / distance - gap / float(lens.focal_mm)  # type: ignore[arg-type]  # one, by DisplayModel
        bend = (spread - 1) / gap
        radius = lens.aperture_mm / 2 if lens.aperture_mm else math.inf
    return Refraction(
        to_pixels=sign * gap / (distance * pitch), spread=spread / pitch, slope=1 / distance, bend=bend,
        radius=float(radius), vertical=float(display.camera.vertical_parallax),
    )  # fmt: skip


def _emitters(display: DisplayModel) -> Emitters:
    """Return the emitting areas of the panel."""
    return Emitters(
        layout=LAYOUTS.index(display.layout), reach=math.sqrt(display.fill) / 2, fill=float(display.fill),
        lobe=float(display.lobe), brightness=float(display.brightness), black=float(display.black),
        crosstalk=float(display.crosstalk),
    )  # fmt: skip


def _table(dtype: np.dtype[Any]) -> NDArray[np.float32]:
    """Return the linear light of every code; an empty table for floats, which are linear."""
    if dtype.kind == "f":
        return np.empty(0, np.float32)
    top = np.iinfo(dtype).max
    return linear(np.arange(top + 1) / top).astype(np.float32)


def pupil_rays(count: int, pupil_mm: float, step: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return places on the pupil and on a point's cell of the lens plane, mm from their centres, (count, 4)."""
    if count == 1:
        return np.zeros((1, 4))
    # Roberts's low-discrepancy sequence in four dimensions: powers of the root of x⁵ = x + 1
    root = 1.1673039782614187
    unit = (0.5 + np.arange(count)[:, None] * root ** -np.arange(1.0, 5.0)) % 1
    on_pupil = np.stack(unit_disk(unit[:, :2]), axis=-1) * (pupil_mm / 2)
    return np.concatenate([on_pupil, (unit[:, 2:] - 0.5) * step], axis=1)
