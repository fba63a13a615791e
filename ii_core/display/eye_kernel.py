"""Kernel of `eye_image`: rays from the pupil through the lens array to the emitters of the panel.

Lengths are in mm in the camera's frame, places on the panel in pixels from the middle of the first one.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from ..base.jit import exact_kernel, exact_stage_kernel

SQUARE, STRIPES, PENTILE = range(3)  # places of `model.LAYOUTS`
MISSED = -1e9  # no pixel is there


class Gaze(NamedTuple):
    """The eye, the points of its view and the rays to each point."""

    columns: Any  # (width,) x of the points on the lens plane
    rows: Any  # (height,) y
    rays: Any  # (count, 4) places on the pupil and on a point's cell of the lens plane, from their centres
    x: float
    y: float
    blur: float  # 1 − d/F


class Lenses(NamedTuple):
    """The display's lens array, which may be shifted and turned on the panel."""

    columns: int
    rows: int
    pitch_x: float
    pitch_y: float
    half_x: float  # half the size
    half_y: float
    shift_x: float
    shift_y: float
    cos: float
    sin: float


class Panel(NamedTuple):
    """The panel: lens array that its picture is made for, its elementary images, and pixels."""

    pitch_x: float
    pitch_y: float
    half_x: float
    half_y: float
    aside: float  # of an elementary image from the lens it is made for: pixels by the lens's place
    pixel: float
    u: int
    v: int


class Refraction(NamedTuple):
    """The effect of a lens on a ray."""

    to_pixels: float  # offset on the panel by the distance from the ray's start to the centre of the lens
    spread: float  # and by the place on the lens
    slope: float  # tangent behind the lens, by the same two
    bend: float
    radius: float  # of the aperture
    vertical: float  # 0 without vertical parallax


class Emitters(NamedTuple):
    """The emitting areas of pixels or sub-pixels."""

    layout: int
    reach: float  # half the side
    fill: float
    lobe: float
    brightness: float
    black: float
    crosstalk: float


class Path(NamedTuple):
    """A ray from the pupil to the panel."""

    px: float  # where it ends
    py: float
    from_x: float  # from the pupil to the centre of its lens, parallel to the lens plane
    from_y: float
    off_x: float  # from the centre of the lens to its place there
    off_y: float


@exact_kernel
def see(pixels, table, gaze, lenses, panel, lens, emitters, out, seen):
    """Fill ``out`` and ``seen`` of `eye_image`, for every point of the view and every ray to it."""
    count = len(gaze.rays)
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            red, green, blue, met = 0.0, 0.0, 0.0, 0
            for r in range(count):
                path = _path(gaze, lenses, panel, lens, i, j, r)
                m, n = math.floor(path.px + 0.5), math.floor(path.py + 0.5)
                if m < 0 or n < 0 or m >= pixels.shape[1] or n >= pixels.shape[0]:
                    continue
                met += 1
                first, last, gain = _emitter(emitters, path.px + 0.5 - m, path.py + 0.5 - n, (m + n) % 2)
                if gain == 0.0:
                    continue
                weight = emitters.brightness
                if emitters.lobe > 0.0:
                    weight *= _falling(emitters.lobe, lens, path)
                weight = weight * gain / emitters.fill
                for c in range(first, last):
                    value = _shown(pixels, table, n, m, c, emitters.crosstalk)
                    value = weight * (emitters.black + (1.0 - emitters.black) * value)
                    if c == 0:
                        red += value
                    elif c == 1:
                        green += value
                    else:
                        blue += value
            out[i, j, 0], out[i, j, 1], out[i, j, 2] = red / count, green / count, blue / count
            seen[i, j] = met / count


@exact_stage_kernel
def _path(gaze, lenses, panel, lens, i, j, r):
    """Return the path of a ray; it ends at `MISSED` if there is no lens."""
    rays = gaze.rays
    ex, ey = gaze.x + rays[r, 0], gaze.y + rays[r, 1]
    ax = gaze.columns[j] + rays[r, 2] + rays[r, 0] * gaze.blur
    ay = gaze.rows[i] + rays[r, 3] + rays[r, 1] * gaze.blur
    k, l = _lens_at(lenses, ax, ay)
    if k < 0 or l < 0 or k >= lenses.columns or l >= lenses.rows:
        return Path(MISSED, MISSED, 0.0, 0.0, 0.0, 0.0)
    cx, cy = _centre(lenses, k, l)
    from_x, from_y, off_x, off_y = cx - ex, cy - ey, ax - cx, ay - cy
    if off_x * off_x + off_y * off_y > lens.radius * lens.radius:
        return Path(MISSED, MISSED, 0.0, 0.0, 0.0, 0.0)
    # distance in pixels of that lens from the lens that its elementary image is made for
    made_x, made_y = (k + 0.5) * panel.pitch_x - panel.half_x, panel.half_y - (l + 0.5) * panel.pitch_y
    wrong_x, wrong_y = (cx - made_x) / panel.pixel, (cy - made_y) / panel.pixel
    px = k * panel.u + (panel.u - 1) / 2 - from_x * lens.to_pixels - off_x * lens.spread - wrong_x
    px += made_x * panel.aside
    down = from_y * lens.to_pixels + off_y * lens.spread + wrong_y - made_y * panel.aside
    py = l * panel.v + (panel.v - 1) / 2 + down * lens.vertical
    return Path(px, py, from_x, from_y, off_x, off_y)


@exact_stage_kernel
def _falling(lobe, lens, path):
    """Return the light that leaves the panel along a path by that along the normal."""
    tx = path.from_x * lens.slope + path.off_x * lens.bend
    ty = path.from_y * lens.slope + path.off_y * lens.bend
    return (1.0 + tx * tx + ty * ty) ** (-lobe / 2)


@exact_stage_kernel
def _lens_at(lenses, x, y):
    """Return column and row of the lens whose cell holds a place, which may be none of the array's."""
    dx, dy = x - lenses.shift_x, y - lenses.shift_y
    k = math.floor((dx * lenses.cos + dy * lenses.sin + lenses.half_x) / lenses.pitch_x)
    l = math.floor((lenses.half_y - (dy * lenses.cos - dx * lenses.sin)) / lenses.pitch_y)
    return k, l


@exact_stage_kernel
def _centre(lenses, k, l):
    """Return the centre of a lens."""
    x, y = (k + 0.5) * lenses.pitch_x - lenses.half_x, lenses.half_y - (l + 0.5) * lenses.pitch_y
    return (
        x * lenses.cos - y * lenses.sin + lenses.shift_x,
        x * lenses.sin + y * lenses.cos + lenses.shift_y,
    )


@exact_stage_kernel
def _emitter(emitters, across, down, odd):
    """Return first and last channel at a place of a pixel, and their brightness relative to the panel's mean."""
    first, last, gain = 0, 3, 1.0
    if emitters.layout == STRIPES:
        first = min(int(3 * across), 2)
        across, last, gain = 3 * across - first, first + 1, 3.0
    elif emitters.layout == PENTILE:
        right = across >= 0.5
        first = 1 if right else 2 * odd
        across, last = (2 * across - 1 if right else 2 * across), first + 1
        gain = 2.0 if right else 4.0
    if abs(across - 0.5) > emitters.reach or abs(down - 0.5) > emitters.reach:
        gain = 0.0
    return first, last, gain


@exact_stage_kernel
def _shown(pixels, table, n, m, c, crosstalk):
    """Return the linear light that a channel of a pixel shows, with the share of its neighbours."""
    value = _signal(pixels, table, n, m, c)
    if crosstalk > 0.0:
        beside = _signal(pixels, table, n, max(m - 1, 0), c)
        beside += _signal(pixels, table, n, min(m + 1, pixels.shape[1] - 1), c)
        beside += _signal(pixels, table, max(n - 1, 0), m, c)
        beside += _signal(pixels, table, min(n + 1, pixels.shape[0] - 1), m, c)
        value = (1.0 - crosstalk) * value + crosstalk * beside / 4
    return value


@exact_stage_kernel
def _signal(pixels, table, n, m, c):
    """Return the linear light of one code."""
    return table[int(pixels[n, m, c])] if len(table) else pixels[n, m, c]
