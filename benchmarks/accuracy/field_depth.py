"""Depth from focus on fields of converged views, against the disparity of the renderer.

    python -m benchmarks run field_depth [--scenes apples,twins]

Fields have 9×9 views of 128² pixels and content on both sides of the plane where views agree, as those of the profile
``jpeg-pleno``. Beside them stands the same scene through ``setup1`` at scale 8, whose viewing zones are parallel.
Errors are those of the disparity of the middle view, in view pixels a step between views, over its pixels that hit
something; 0.07 px is the threshold of the HCI benchmark. A pixel without a depth is bad.
"""

from __future__ import annotations

import statistics
import textwrap
from typing import Any

import numpy as np

from benchmarks.arguments import command_line
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin, table
from ii_core import IICamera, camera_pose, disparity_of_depth, preset
from ii_core.depth.focus import METHODS
from ii_core.depth.virtual_camera import virtual_camera_pixels
from metrics import depth_from_focus
from raytrace_ii import load_scene, render

RECORDS = Records("field_depth", ("benchmarks.accuracy.field_depth",))
# Place of the cameras before each scene, mm: its middle depth lies near the plane where views agree, 120 mm away.
PLACES = {"apples": 90, "car": 60, "cuboid": 60, "twins": 40, "objects": 60, "dolphin": 60, "mountains": 60}
KINDS = ("converged", "parallel")
BAD = 0.07  # px
SURE = 0.5
WHATS = {"median_px": ".3f", "bad": ".0%", "sure": ".0%", "bad_where_sure": ".0%"}  # on the page, with formats


def main() -> None:
    """Measure, keep and print."""
    asked = command_line(__doc__, scenes=tuple(PLACES)).parse_args()
    keys = [{"scene": name, "kind": kind} for name in asked.scenes for kind in KINDS]
    RECORDS.run(keys, errors, asked.again)
    publish(tables())


def field(views: int = 9, side: int = 128) -> IICamera:
    """Return a camera of converged views, 120 mm before the plane where they agree."""
    # the profile's camera with larger pixels: δL = 0.1 mm · 512/side
    scale = 512 / side
    return IICamera(
        name="field", pixels=(views * side,) * 2, lenses=(side, side), pixel_pitch_mm=0.01085 * scale,
        gap_mm=1.398 * scale, start_mm=120, viewer_mm=120,
    )  # fmt: skip


def errors(scene: str, kind: str) -> dict[str, Any]:
    """Return the errors of both methods, and the range of the true disparity."""
    camera = field() if kind == "converged" else preset("setup1", scale=8)
    pose = camera_pose((0, 0, PLACES[scene] if kind == "converged" else 0))
    shot = render(load_scene(scene), camera, samples=4, pose=pose, support=("depth",))
    assert shot.depth is not None
    true = disparity_of_depth(camera, shot.depth[virtual_camera_pixels(camera)])
    hit = np.isfinite(true)
    row: dict[str, Any] = {
        "pixels": int(hit.sum()),
        "low": float(np.quantile(true[hit], 0.01)),
        "high": float(np.quantile(true[hit], 0.99)),
    }
    for method in METHODS:
        found = depth_from_focus(shot.picture, method=method)
        error = np.abs(disparity_of_depth(camera, found.depth_mm) - true)[hit]
        bad, sure = ~(error <= BAD), found.confidence[hit] > SURE
        row |= {
            f"{method}_median_px": float(np.median(np.where(np.isnan(error), np.inf, error))),
            f"{method}_bad": float(bad.mean()),
            f"{method}_sure": float(sure.mean()),
            f"{method}_bad_where_sure": float(bad[sure].mean()) if sure.any() else None,
        }
    return row


def tables() -> Tables:
    """Return the table of the page of measures: median and range over scenes, by kind of views."""
    if not (measured := RECORDS.rows()):
        return {("docs/metrics.md", "field-depth"): ["No record yet: the command above measures it."]}
    groups = {kind: [row for row in measured if row["kind"] == kind] for kind in KINDS}
    lines = []
    for kind, rows in groups.items():
        cells = []
        for what, form in WHATS.items():
            each = [[row[f"{m}_{what}"] for row in rows if row[f"{m}_{what}"] is not None] for m in METHODS]
            cells.append(" → ".join(f"{statistics.median(x):{form}} ({min(x):{form}}–{max(x):{form}})" for x in each))
        lines.append([kind, *(cell.replace("%", "") for cell in cells)])
    heads = "views | median error, px | error above 0.07 px, % | sure, % | bad where sure, %"
    reach = " and ".join(
        f"{min(row['low'] for row in rows):+.1f} … {max(row['high'] for row in rows):+.1f} px"
        for rows in groups.values()
    )
    told = (
        f"Median (range) of {len(groups[KINDS[0]])} scenes, the dissertation's method → the robust one. Converged: "
        "9×9 views of 128² pixels. Parallel: behind setup1, scale 8. Disparities are "
        f"{reach} (1–99 %). 4 samples a pixel. {origin(measured)}"
    )
    return {
        ("docs/metrics.md", "field-depth"): [
            *table(heads, lines),
            "",
            *textwrap.wrap(told, 100, break_on_hyphens=False),
        ]
    }
