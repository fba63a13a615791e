"""Viewing zones of an integral-imaging display and cross-talk across their borders, in closed form."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..base.checks import MOST_MM, checked, instance, length, number, within
from .model import DisplayModel


class ViewingZone(NamedTuple):
    """Viewing zone at one distance, across and up: every lens shows its own elementary image there.

    Attributes
    ----------
    centre_mm : (x, y)
        Centre of the zone, from the display's axis.
    size_mm : (width, height)
        Size of the zone; negative if there is none, since some lenses show their neighbours' images everywhere. The
        height is infinite without vertical parallax.
    period_mm : (x, y)
        Distance to the neighbouring side zones, in which lenses show their neighbours' images.
    """

    centre_mm: tuple[float, float]
    size_mm: tuple[float, float]
    period_mm: tuple[float, float]


@checked(display=instance(DisplayModel), distance_mm=number)
def viewing_zone(display: DisplayModel, distance_mm: float) -> ViewingZone:
    """Return the viewing zone at a distance from the lens plane.

    A lens at c, whose elementary image of width P at e is made for a lens at c₀, shows it to an eye at x while
    |c − e + (c − x)·g/d| ≤ P/2: over c + (c − e)·d/g ± P·d/2g. Where e = c₀ + c₀·Λ/D stands on the panel, D being the
    camera's ``viewer_mm``; c − e changes its sign if the camera's elementary images are erect. The zone is the
    intersection of these ranges for the lenses in the corners of the array.

    Parameters
    ----------
    display : DisplayModel
    distance_mm : float
        d, from the eye to the lens plane.

    Raises
    ------
    ValueError
        If the distance is not positive.
    """
    far = length("distance_mm", distance_mm) / display.gap_mm
    cos, sin = display.axes
    counts = np.array(display.camera.lenses) - 1
    corners = np.array([[i, j] for i in (-0.5, 0.5) for j in (-0.5, 0.5)]) * counts
    made, lens = corners * display.camera.lens_pitch_mm, corners * display.lens_pitch_mm
    place = lens @ np.array([[cos, sin], [-sin, cos]]) + display.shift_mm
    middle = place + ((place - made) * _side(display) - made * _aside(display)) * far
    period = np.array(display.ei_pitch_mm) * far
    low, high = middle.max(axis=0) - period / 2, middle.min(axis=0) + period / 2
    centre, size = (low + high) / 2, high - low
    if not display.camera.vertical_parallax:
        centre[1], size[1], period[1] = 0, math.inf, math.inf
    return ViewingZone(*((float(a[0]), float(a[1])) for a in (centre, size, period)))


@checked(display=instance(DisplayModel))
def converging_distance(display: DisplayModel) -> tuple[float, float]:
    """Return the distance from the lens plane at which the zones of all lenses coincide, across and up, mm.

    d = g·p/(P − p), P being the pitch of elementary images on the panel and p that of lenses: P = p(1 + g/d).
    Infinite if the pitches are equal.

    Raises
    ------
    ValueError
        If elementary images are closer to each other than lenses: the zones then diverge.
    """
    found = []
    for made, lens in zip(display.camera.lens_pitch_mm, display.lens_pitch_mm, strict=True):
        apart = (made - lens) * _side(display) + made * _aside(display)
        image = lens + apart
        if apart < -1e-9 * image:
            raise ValueError(
                f"zones never converge: lens_pitch_mm is {lens:g}, elementary images are {image:g} mm wide, and no "
                f"less than the lens pitch is needed"
            )
        found.append(display.gap_mm * lens / apart if apart > 1e-9 * image else math.inf)
    return found[0], found[1]


def _side(display: DisplayModel) -> int:
    """−1 if elementary images are erect: the panel's pixels are then seen turned by 180° about the lens's axis."""
    return -1 if display.camera.erect else 1


def _aside(display: DisplayModel) -> float:
    """Distance of an elementary image from its lens as a share of the lens's place, if viewing zones meet."""
    camera = display.camera
    return 0.0 if camera.viewer_mm is None else camera.gap_mm / camera.viewer_mm


@checked(pupil_mm=number, border_mm=number)
def crosstalk(pupil_mm: float, border_mm: float) -> float:
    """Return the share of an eye's light that comes from beyond the straight border of a zone or view.

    The light on either side of the border is uniform. A segment of the pupil's disk lies beyond the border; its share
    is (arccos t − t√(1 − t²))/π with t = 2b/D.

    Parameters
    ----------
    pupil_mm : float
        D, diameter of the pupil; 0 is a point.
    border_mm : float
        b, from the centre of the pupil to the border; negative if the centre is beyond it.

    Raises
    ------
    ValueError
        If the diameter is negative or a number is not finite.
    """
    pupil, border = within("pupil_mm", pupil_mm, -MOST_MM, MOST_MM), within("border_mm", border_mm, -MOST_MM, MOST_MM)
    if pupil < 0:
        raise ValueError(f"pupil_mm is {pupil:g}: a diameter in mm, 0 for a point, is needed")
    if abs(2 * border) >= pupil:
        return 0.5 if border == 0 else float(border < 0)
    t = 2 * border / pupil
    return (math.acos(t) - t * math.sqrt(1 - t * t)) / math.pi
