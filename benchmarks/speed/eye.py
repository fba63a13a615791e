"""Speed and memory of an eye's view of a display, beside a view image.

    python -m benchmarks run eye

Random pictures of setup 1 at scales 4, 2 and 1, seen by an eye with a pupil of 4 mm: 64 rays a point. CPU times are
medians of interleaved runs, peaks of memory by `tracemalloc` in runs of their own.
"""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.arguments import command_line
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin, table
from ii_core import DisplayModel, Eye, IIPicture, eye_image, five_viewpoints, preset, view_image

RECORDS = Records("eye", ("benchmarks.speed.eye",))
SCALES, RUNS, PUPIL_MM, RAYS = (4, 2, 1), 9, 4.0, 64


def main() -> None:
    """Measure, keep, fill the page."""
    asked = command_line(__doc__).parse_args()
    RECORDS.run(({"camera": "setup1", "scale": scale} for scale in SCALES), measured, asked.again)
    publish(tables())


def measured(camera: str, scale: int) -> dict[str, Any]:
    """Return CPU seconds and peaks of memory of both views of one picture."""
    of = preset(camera, scale=scale)
    pixels = np.random.default_rng(0).integers(0, 256, (*of.pixels[::-1], 3), np.uint8)
    picture = IIPicture(pixels, of.lenses, of.ei_pixels, of)
    place: Any = tuple(map(float, five_viewpoints(of)["front"]))
    display, eye = DisplayModel(camera=of), Eye(position_mm=place, pupil_mm=PUPIL_MM)
    calls: dict[str, Callable[[], Any]] = {
        "view": lambda: view_image(picture, place),
        "eye": lambda: eye_image(picture, display, eye, rays=RAYS),
    }
    times: dict[str, list[float]] = {name: [] for name in calls}
    for call in calls.values():  # compiles
        call()
    for _ in range(RUNS):
        for name, call in calls.items():
            started = time.process_time()
            call()
            times[name].append(time.process_time() - started)
    found: dict[str, Any] = {"picture_bytes": pixels.nbytes}
    for name, call in calls.items():
        found[f"{name}_seconds"] = float(np.median(times[name]))
        tracemalloc.start()
        call()
        found[f"{name}_peak_bytes"] = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    return found


def tables() -> Tables:
    """Return the table of the display's page: times, their ratio, and memory in pictures, by scale."""
    rows, lines = RECORDS.rows(), []
    for row in rows:
        view, eye = row["view_seconds"], row["eye_seconds"]
        share = row["eye_peak_bytes"] / row["picture_bytes"]
        lines.append(f"{row['scale']} | {1e3 * view:.1f} ms | {1e3 * eye:.1f} ms | {eye / view:.1f} | {share:.2f}")
    heads = "scale | `view_image` | `eye_image` | ratio | peak of memory, pictures"
    return {("docs/display.md", "eye-speed"): [*table(heads, lines), "", origin(rows)]}
