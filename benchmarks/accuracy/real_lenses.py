"""Disparity errors of real main lenses over the field: ``python -m benchmarks run real_lenses``.

A plenoptic 1.0 camera behind a real lens, and its ideal twin: a thin lens of the same magnification between the same
planes. Points of the plane in focus have disparity 0 through the twin at every field. Through the real lens the rays
of one lenslet spread over this plane: their slope against the pixel is a disparity error (field curvature), their
bend is coma.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.arguments import command_line
from benchmarks.pages.pictures import IMAGES, write_picture
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin
from ii_core import IICamera, preset
from ii_core.camera.elements import Bundle
from ii_core.camera.optics import Lens
from ii_core.camera.prescriptions import lens
from ii_core.design.properties import through_front_mm
from ii_core.display.figure import new_figure, save

RECORDS = Records("real_lenses", ("benchmarks.accuracy.real_lenses",))
LENSES = {"double-gauss": 0.5, "triplet": 1.0}  # enlarged to f = 50 mm
FIELDS = 25
CHART = IMAGES / "real_lenses.png"


def real_camera(name: str) -> IICamera:
    """Return the plenoptic 1.0 camera of a lens: image half as large as the scene, micro-images that just touch."""
    base, placed = preset("plenoptic1-double-gauss"), lens(name).at(0.0, enlarge=LENSES[name])
    matrix, pupil = placed.paraxial(), placed.pupil()
    assert pupil is not None
    z, diameter = pupil
    behind = -matrix.d / matrix.c + placed.focal_mm / 2  # of the lens plane: back focus and f times magnification
    gap = base.lens_pitch_mm[0] * (z + behind) / diameter
    field = Lens(z_mm=gap + 0.2, focal_mm=z + behind)
    return replace(base, gap_mm=gap, optics=(base.optics[0], field, placed.moved(gap + behind)), name=name)


def ideal_twin(camera: IICamera) -> IICamera:
    """Return the camera with a thin lens that images the same planes at the same magnification."""
    gap, opening = camera.gap_mm, camera.front[1].pupil()
    assert opening is not None
    focus = through_front_mm(camera, gap)
    ahead = (focus - gap) / (1 + magnification(camera))
    behind = focus - gap - ahead
    width = opening[1] / (opening[0] - gap) * ahead
    main = Lens(z_mm=gap + ahead, focal_mm=ahead * behind / (ahead + behind), diameter_mm=width)
    return replace(camera, optics=(camera.optics[0], Lens(z_mm=gap + 0.2, focal_mm=ahead), main))


def magnification(camera: IICamera) -> float:
    """Return the size of the plane in focus over that of its image on the lenses, near the axis."""
    x, _ = spread(camera, 1e-3, 0)
    return -float(x[len(x) // 2]) / 1e-3


def spread(camera: IICamera, field_mm: float, axis: int, z_mm: float | None = None) -> tuple[Any, Any]:
    """Return where rays of the lenslet at (field, 0) meet a plane, by default that in focus, and their weights.

    The rays come from 33 points under the lenslet, in a row along an axis of the sensor.
    """
    offset = np.linspace(-0.5, 0.5, 33) * camera.lens_pitch_mm[0]
    step = [np.zeros_like(offset), np.zeros_like(offset)]
    step[axis] = -offset
    zero = np.zeros_like(offset)
    rays = Bundle(zero + field_mm, zero, zero + camera.gap_mm, step[0], step[1], zero + camera.gap_mm)
    for element in camera.front:
        rays = element.pass_on(rays)
    z = through_front_mm(camera, camera.gap_mm) if z_mm is None else z_mm
    along = (z - rays.lz) / rays.dz
    place = (rays.lx + rays.dx * along, rays.ly + rays.dy * along)[axis]
    return place, np.broadcast_to(1.0 if rays.weight is None else rays.weight, offset.shape) > 0


def slope(camera: IICamera, field_mm: float, axis: int, z_mm: float | None = None) -> tuple[float, float, float]:
    """Return the disparity in lens pitches a view step, the rms left by the line, and the share of rays that pass."""
    place, on = spread(camera, field_mm, axis, z_mm)
    if on.sum() < 4:
        return np.nan, np.nan, float(on.mean())
    pitch = camera.lens_pitch_mm[0]
    views = np.linspace(-0.5, 0.5, on.size) * pitch / camera.pixel_pitch_mm
    shown = place / (pitch * magnification(camera))
    line = np.polyfit(views[on], shown[on], 1)
    left = shown[on] - np.polyval(line, views[on])
    return float(line[0]), float(np.sqrt((left**2).mean())), float(on.mean())


def field_errors(name: str) -> dict[str, Any]:
    """Return disparity error, bend and depth error over the field, of a real lens and its twin."""
    camera = real_camera(name)
    twin, fields = ideal_twin(camera), np.linspace(0, camera.size_mm[0] / 2, FIELDS)
    focus = through_front_mm(twin, twin.gap_mm)
    per_mm = (slope(twin, 0.0, 0, focus + 1)[0] - slope(twin, 0.0, 0, focus - 1)[0]) / 2
    rows = []
    for x in fields:
        row: dict[str, Any] = {"field_mm": float(x)}
        for axis, which in enumerate(("tangential", "sagittal")):
            error, bend, share = slope(camera, float(x), axis)
            row[which] = {"disparity": error, "bend": bend, "passing": share, "depth_mm": error / per_mm}
        row["twin"] = max(abs(slope(twin, float(x), axis)[0]) for axis in (0, 1))
        rows.append(row)
    return {"focus_mm": focus, "disparity_per_mm": per_mm, "fields": rows}


def main() -> None:
    arguments = command_line(__doc__).parse_args()
    keys = [{"part": "field", "lens": name} for name in LENSES]
    RECORDS.run(keys, lambda part, lens: field_errors(lens), arguments.again)
    draw()
    publish(tables())


def draw() -> None:
    """Draw the chart from the records."""
    figure = new_figure(11, 3.6)
    panels = figure.subplots(1, 3)
    for colour, row in zip(("C0", "C1"), RECORDS.rows(part="field"), strict=False):
        fields = row["fields"]
        x = [point["field_mm"] for point in fields]
        for which, style in (("tangential", "-"), ("sagittal", "--")):
            for panel, what in zip(panels, ("disparity", "depth_mm", "bend"), strict=True):
                values = [np.nan if p[which][what] is None else p[which][what] for p in fields]
                panel.plot(x, values, style, color=colour, label=f"{row['lens']}, {which}")
    titles = (
        ("field curvature as disparity", "disparity error [view pixels a view]"),
        ("the same as depth", "depth error [mm]"),
        ("coma and higher orders", "rms left by a line [view pixels]"),
    )
    for panel, (title, label) in zip(panels, titles, strict=True):
        panel.set(title=title, xlabel="field on the lens array [mm]", ylabel=label)
        panel.axhline(0, color="0.6", linewidth=0.8)
        panel.grid(alpha=0.3)
    panels[0].legend(fontsize=8)
    save(figure, CHART)
    write_picture(CHART, CHART)


def tables() -> Tables:
    """Return the table of errors at two fields."""
    rows = RECORDS.rows(part="field")
    lines = [
        "| lens | field | light | disparity error, tangential · sagittal | depth error | bend |",
        "|---" * 6 + "|",
    ]
    for row in rows:
        for point in row["fields"][:: (FIELDS - 1) // 2][1:]:
            t, s = point["tangential"], point["sagittal"]
            lines.append(
                f"| {row['lens']} | {point['field_mm']:.1f} mm | {t['passing']:.0%} | {t['disparity']:+.4f} · "
                f"{s['disparity']:+.4f} | {t['depth_mm']:+.2f} · {s['depth_mm']:+.2f} mm | "
                f"{t['bend']:.4f} · {s['bend']:.4f} |"
            )
    return {("docs/real_lenses.md", "field"): [*lines, "", origin(rows)]}


if __name__ == "__main__":
    main()
