"""Plates of dots that test whether an observer distinguishes red from green.

Figure and ground of a plate differ in the signal of one kind of cone alone, of long waves (protan) or of middle ones
(deutan), and every dot has a brightness of its own. A control plate differs in brightness. This separates observers
in a test of pictures; it is no medical examination.

References
----------
Viénot, Brettel and Mollon 1999: signals of the cones from linear sRGB.
"""

from __future__ import annotations

import io
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from ii_core.base.colour import srgb

CONES = np.array([[17.8824, 43.5161, 4.11935], [3.45565, 27.1554, 3.86714], [0.0299566, 0.184309, 1.46709]])
KINDS = ("control", "protan", "deutan", "protan", "deutan")
SIDE, TIMES = 260, 3  # side of a plate in pixels; plates are drawn three times as large, then reduced
DOTS, RADII = 2500, (3.0, 8.0)  # dots tried, and their least and largest radius
GROUND = np.array([0.24, 0.22, 0.10])  # linear light
# Difference of figure and ground in red linear light; a control plate's figure is darker by three times this share.
CONTRAST = 0.24


class Plate(NamedTuple):
    """One plate: the digit in it and a PNG."""

    digit: int
    png: bytes


@lru_cache(maxsize=4)
def plates(seed: int = 0) -> tuple[Plate, ...]:
    """Make a plate of each of `KINDS` with different digits."""
    generator = np.random.default_rng(seed)
    digits = generator.choice(np.arange(2, 10), len(KINDS), replace=False)
    drawn = zip(digits.tolist(), KINDS, strict=True)
    return tuple(Plate(digit, _drawn(digit, kind, generator)) for digit, kind in drawn)


def colours(kind: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the linear light of figure and ground."""
    if kind == "control":
        return GROUND * (1 - 3 * CONTRAST), GROUND
    along = np.linalg.inv(CONES)[:, ("protan", "deutan").index(kind)]
    along = along / along[0] * CONTRAST / 2
    return GROUND * 1.2 + along, GROUND * 1.2 - along


def _drawn(digit: int, kind: str, generator: np.random.Generator) -> bytes:
    shape = Image.new("L", (SIDE, SIDE))
    font = ImageFont.load_default(size=SIDE * 0.8)
    ImageDraw.Draw(shape).text((SIDE / 2, SIDE / 2), str(digit), 255, font=font, anchor="mm", stroke_width=5)
    inside = np.asarray(shape) > 127
    plate = Image.new("RGB", (SIDE * TIMES, SIDE * TIMES), (128, 128, 128))
    draw = ImageDraw.Draw(plate)
    for x, y, r in _dots(generator):
        light = colours(kind)[0 if inside[int(y), int(x)] else 1] * generator.uniform(0.75, 1.25)
        red, green, blue = np.rint(255 * srgb(np.clip(light, 0, 1))).astype(int).tolist()
        box = [TIMES * (x - r), TIMES * (y - r), TIMES * (x + r), TIMES * (y + r)]
        draw.ellipse(box, fill=(red, green, blue))
    out = io.BytesIO()
    plate.resize((SIDE, SIDE), Image.Resampling.BOX).save(out, "PNG", optimize=True)
    return out.getvalue()


def _dots(generator: np.random.Generator) -> NDArray[np.float64]:
    """Dots in a disk that do not overlap: x, y and radius, pixels."""
    placed = np.empty((0, 3))
    for x, y, r in zip(*generator.random((2, DOTS)) * SIDE, generator.uniform(*RADII, DOTS), strict=True):
        if np.hypot(x - SIDE / 2, y - SIDE / 2) + r > SIDE / 2:
            continue
        room = (np.hypot(placed[:, 0] - x, placed[:, 1] - y) - placed[:, 2]).min(initial=r) - 0.5
        if room >= RADII[0]:
            placed = np.vstack([placed, (x, y, min(r, room))])
    return placed
