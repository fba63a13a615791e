"""Moiré of a Looking Glass: what an eye sees of pictures made with its own calibration, and with others.

    python -m benchmarks run moire

The eye model sees the panel through the slanted lenses of one display; pictures for the panel are made with that
display's calibration and with wrong ones. Views are even greys from left to right, so that the light at every point
is known: that of its direction. Its error is moiré, the mean over the points within the cone. A scene is drawn.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.arguments import command_line
from benchmarks.pages.pictures import IMAGES, enlarged, sheet, write_picture
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin, table
from ii_core import Eye, preset
from ii_core.base.colour import linear
from ii_core.display.eye import EyeImage
from ii_core.display.looking_glass import LookingGlass, native_eye_image, native_picture, view_numbers
from raytrace_ii import load_scene, render

RECORDS, PAGE = Records("moire", ("benchmarks.accuracy.moire",)), "docs/display.md"
# Lenses and panel of an 8.9-inch display, as in surf-visualization/looking-glass, a part of 768×512 px.
DISPLAY = LookingGlass(size=(768, 512), pitch=52.6, slope=-7.1, centre=0.8, dpi=324.0)
CALIBRATIONS = {
    "its own": {},
    "pitch + 0.1 %": {"pitch": 1.001 * DISPLAY.pitch},
    "pitch + 1 %": {"pitch": 1.01 * DISPLAY.pitch},
    "slope + 2 %": {"slope": 1.02 * DISPLAY.slope},
}
EYES_MM, AWAY_MM, PUPIL_MM = (-80.0, 0.0, 60.0), 400.0, 4.0
VIEWS, POINTS, RAYS = 48, (96, 64), 128  # a point is 8 px wide, 1.3 lenses
DRAWN = 1536, 1024  # pixels of the panel of the picture
DARKEST, BRIGHTEST, WITHIN = 40, 240, 0.05  # codes of the first and the last view; shares of the cone left out


def main() -> None:
    """Measure, record, fill the page and draw."""
    asked = command_line(__doc__).parse_args()
    RECORDS.run([{"calibration": name} for name in CALIBRATIONS], measured, asked.again)
    publish(tables())
    write_picture(IMAGES / "display_moire.webp", picture())


def measured(calibration: str) -> dict[str, Any]:
    """Return errors of light and colour by the place of the eye, shares of white's light."""
    made = replace(DISPLAY, **CALIBRATIONS[calibration])
    greys = np.rint(DARKEST + view_numbers(made, VIEWS) * ((BRIGHTEST - DARKEST) / (VIEWS - 1))).astype(np.uint8)
    light, colour = [], []
    for x in EYES_MM:
        seen = _seen(greys, x, POINTS, RAYS).light
        share = _shares(x, POINTS)
        within = (share > WITHIN) & (share < 1 - WITHIN)
        view = np.clip(share * VIEWS - 0.5, 0, VIEWS - 1) / (VIEWS - 1)
        expected = linear((DARKEST + view * (BRIGHTEST - DARKEST)) / 255)
        grey = seen.mean(axis=2)
        light.append(float(np.abs(grey - expected)[within].mean()))
        colour.append(float(np.abs(seen - grey[..., None])[within].mean()))
    return {"light": light, "colour": colour}


def _seen(
    panel: NDArray[np.uint8], x: float, points: tuple[int, int], rays: int, display: LookingGlass = DISPLAY
) -> EyeImage:
    eye = Eye(position_mm=(x, 0.0, -AWAY_MM), pupil_mm=PUPIL_MM)
    return native_eye_image(panel, display, eye, size=points, rays=rays)


def _shares(x: float, points: tuple[int, int]) -> NDArray[np.float64]:
    """Return the share of the cone, from the left, in which the eye sees each point."""
    (width, height), pixel = DISPLAY.size, 25.4 / DISPLAY.dpi
    across = ((np.arange(points[0]) + 0.5) / points[0] - 0.5) * width * pixel
    up = (0.5 - (np.arange(points[1])[:, None] + 0.5) / points[1]) * height * pixel
    reach = 2 * AWAY_MM * math.tan(math.radians(DISPLAY.cone_deg / 2))
    return 0.5 + (x - across - up / DISPLAY.slope) / reach


def tables() -> Tables:
    """Return the table of the page of displays."""
    rows = RECORDS.rows()
    if not rows:
        return {(PAGE, "moire"): []}
    lines = [
        " | ".join(
            [row["calibration"], *(f"{100 * v:.2f} %" for v in row["light"]), f"{100 * max(row['colour']):.1f} %"]
        )
        for name in CALIBRATIONS
        for row in rows
        if row["calibration"] == name
    ]
    heads = " | ".join(["calibration", *(f"eye at {x:g} mm" for x in EYES_MM), "colour, at the most"])
    return {(PAGE, "moire"): [*table(heads, lines), "", origin(rows)]}


def picture() -> NDArray[np.uint8]:
    """Return a scene as the eye in front sees it by each calibration."""
    shown = render(load_scene("apples"), preset("setup1", scale=4), samples=4, seed=0).picture
    display, points = replace(DISPLAY, size=DRAWN), (DRAWN[0] // 8, DRAWN[1] // 8)
    seen = []
    for changes in CALIBRATIONS.values():
        panel = native_picture(shown, replace(display, **changes))
        seen.append(enlarged(_seen(panel, 0.0, points, 64, display).pixels, 2))
    return sheet(seen, 2, [f"calibration: {name}" for name in CALIBRATIONS])


if __name__ == "__main__":
    main()
