"""Pictures of docs/display.md: an eye's views of displays with one fault each, and viewing zones.

    python -m benchmarks run display_pictures

*Apples* through setup1 at ``scale=4``, 4 samples a pixel.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.pages.pictures import IMAGES, write_picture
from benchmarks.study.sheets import enlarged, sheet
from ii_core import DisplayModel, Eye, IICamera, IIPicture, eye_image, five_viewpoints, preset, viewing_zone
from ii_core.base.colour import LINEAR
from ii_core.picture.view import camera_of
from metrics.plots.rd_chart import COLOURS, new_figure, save
from raytrace_ii import load_scene, render

SCALE, TIMES = 4, 2


def main() -> None:
    """Render a picture, compute the views and write them."""
    picture = render(load_scene("apples"), preset("setup1", scale=SCALE), samples=4, support=()).picture
    images = faults(picture)
    write_picture(IMAGES / "display_eye.webp", sheet([*images.values()], 3, [*images]))
    path = IMAGES / "display_zones.png"
    save(zones(), path)
    write_picture(path, path)


def faults(picture: IIPicture) -> dict[str, NDArray[np.uint8]]:
    """Return views of an eye by the property of display or eye that is varied."""
    camera = camera_of(picture)
    place: Any = tuple(map(float, five_viewpoints(camera)["front"]))
    point, eye = Eye(position_mm=place), Eye(position_mm=place, pupil_mm=4.0)

    def seen(viewer: Eye, **change: Any) -> NDArray[np.uint8]:
        return enlarged(eye_image(picture, DisplayModel(camera=camera, **change), viewer).pixels, TIMES)

    left, right = point.pair()
    near = Eye(position_mm=place, pupil_mm=4.0, focus_mm=0.8 * (camera.gap_mm - place[2]))
    period = viewing_zone(DisplayModel(camera=camera), camera.gap_mm - place[2]).period_mm[0]
    beside = Eye(position_mm=(place[0] + 0.5 * period, 0.0, place[2]), pupil_mm=4.0)
    return {
        "point pupil: the view image": seen(point),
        "pupil of 4 mm": seen(eye),
        "colour stripes, point pupil": seen(point, layout="rgb-stripe"),
        "pentile, fill 0.5, pupil of 4 mm": seen(eye, layout="pentile", fill=0.5),
        "lens array turned by 0.3°": seen(eye, turn_deg=0.3),
        "lens pitch 0.2 % less": seen(eye, lens_pitch_mm=0.998 * camera.lens_pitch_mm[0]),
        "gap 20 % more": seen(eye, gap_mm=1.2 * camera.gap_mm),
        "focused at 0.8 of the distance": seen(near),
        "left eye": seen(left),
        "right eye": seen(right),
        "crosstalk 0.5, black level 0.1": seen(eye, crosstalk=0.5, black=0.1),
        "half a zone aside": seen(beside),
    }


def zones() -> Any:
    """Draw the share of lenses with their own elementary image over the eye's place, and the zone in closed form."""
    camera = preset("setup1", scale=16)
    (k, _), (u, _) = camera.lenses, camera.ei_pixels
    pixels = np.zeros((camera.pixels[1], camera.pixels[0], 3), np.uint8)
    pixels[..., 0] = np.arange(camera.pixels[0]) // u * 4 + 8
    picture = IIPicture(pixels, camera.lenses, camera.ei_pixels, camera)
    own = LINEAR[np.arange(k) * 4 + 8]
    distance = camera.gap_mm - five_viewpoints(camera)["front"][2]
    places = np.linspace(-110, 110, 441)
    figure = new_figure(8.5, 3.6)
    axes = figure.subplots()
    for i, (label, display) in enumerate(zone_displays(camera, float(distance)).items()):
        shares = []
        for x in places:
            eye = Eye(position_mm=(float(x), 0.0, camera.gap_mm - float(distance)))
            light = eye_image(picture, display, eye).light[camera.lenses[1] // 2, :, 0]
            shares.append(float((light == own).mean()))
        axes.plot(places, shares, color=COLOURS[i], label=label)
        zone = viewing_zone(display, float(distance))
        for side in (-1, 1):
            axes.axvline(zone.centre_mm[0] + side * zone.size_mm[0] / 2, color=COLOURS[i], linestyle=":", linewidth=1)
    axes.set(xlabel="eye, mm to the right of the axis", ylabel="lenses with own image [share]")
    axes.set_ylim(-0.02, 1.05)
    axes.grid(True, color="0.92", linewidth=0.8)
    axes.spines[["top", "right"]].set_visible(False)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
    return figure


def zone_displays(camera: IICamera, distance: float) -> dict[str, DisplayModel]:
    """Return displays by their fault."""
    meeting = camera.lens_pitch_mm[0] / (1 + camera.gap_mm / distance)
    return {
        "matched arrays": DisplayModel(camera=camera),
        "lens pitch P/(1 + g/d)": DisplayModel(camera=camera, lens_pitch_mm=(meeting, meeting)),
        "gap 30 % more": DisplayModel(camera=camera, gap_mm=1.3 * camera.gap_mm),
    }
