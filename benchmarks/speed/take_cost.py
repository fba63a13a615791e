"""Rendering of a take against the sum of its stills: CPU time, and peak memory.

    python -m benchmarks run take_cost [--scale 16] [--takes car,apples]

In *car* bodies move in every frame, in *apples* the camera alone. A still is rendered from a copy of its scene, so
that its trees are built, and its time is that of `render` alone. The time of the take includes models, files, hashes
and manifest. Both alternate in parts, and the ratio is the median over the parts. Memory is the peak of separate
processes.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from copy import copy
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.arguments import command_line
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import ROOT, Records, cpu_seconds, origin
from ii_core import preset
from raytrace_ii import Take, load_take, render, render_take

RECORDS = Records("take_cost", ("benchmarks.speed.take_cost",))
SCALE, TAKES = 16, ("car", "apples")
FRAMES, PART = 48, 8  # frames of a take, and of a part; take and stills alternate after each part
PEAK = """
import resource, sys
from ii_core import preset
from raytrace_ii import load_take, render_take
render_take(load_take({take!r}), {folder!r}, preset("setup1", scale={scale}), frames=range({frames}))
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


def main() -> None:
    """Measure, print and fill the table."""
    asked = command_line(__doc__, scale=SCALE, takes=TAKES).parse_args()
    keys = [{"take": take, "scale": asked.scale} for take in asked.takes]
    for key in RECORDS.todo(keys, asked.again):
        RECORDS.measure(key, lambda key=key: measured(**key))
        print(key, flush=True)
    print("\n".join(table()))
    publish(tables())


def measured(take: str, scale: int) -> dict[str, Any]:
    """Return CPU seconds of parts of the take and of their stills; peak memory in MB of one frame and of all."""
    camera = preset("setup1", scale=scale)
    render(load_take(take).scene_at(0.0), camera)  # compile kernels
    moving, alone = load_take(take), load_take(take)
    of_take, of_stills = [], []
    with tempfile.TemporaryDirectory() as folder:
        for first in range(0, FRAMES, PART):
            numbers = range(first, first + PART)
            started = cpu_seconds()
            render_take(moving, folder, camera, frames=numbers)
            of_take.append(cpu_seconds() - started)
            of_stills.append(sum(still(alone, number / alone.fps, camera) for number in numbers))
    ratios = [a / b for a, b in zip(of_take, of_stills, strict=True)]
    peaks = {f"peak_mb_{frames}_frames": peak(take, scale, frames) for frames in (1, FRAMES)}
    return {
        "frames": FRAMES,
        "take_cpu_seconds": sum(of_take),
        "stills_cpu_seconds": sum(of_stills),
        "ratio": median(ratios),
        "least_ratio": min(ratios),
        "most_ratio": max(ratios),
        "frame_mb": 3 * camera.pixels[0] * camera.pixels[1] / 2**20,
        **peaks,
    }


def still(take: Take, seconds: float, camera: Any) -> float:
    """Return CPU seconds of rendering one instant of a scene that has not been rendered yet."""
    scene, pose = copy(take.scene_at(seconds)), take.pose_at(seconds)
    started = cpu_seconds()
    render(scene, camera, pose=pose)
    return cpu_seconds() - started


def peak(take: str, scale: int, frames: int) -> float:
    """Return the peak memory in MB of a process that renders so many frames."""
    with tempfile.TemporaryDirectory() as folder:
        code = PEAK.format(take=take, scale=scale, frames=frames, folder=str(Path(folder) / "take"))
        done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    return float(done.stdout)


def tables() -> Tables:
    """Return the table of the page of videos."""
    return {("docs/video.md", "takes-cost"): table()}


def table() -> list[str]:
    """Return a table with a row per take: CPU time against its stills, and memory."""
    rows = RECORDS.rows()
    if not rows:
        return ["Not measured yet."]
    lines = [
        "| take | scale | frames | CPU time over the sum of the stills' (range of parts) | peak memory, one frame "
        "| all frames | a frame's pixels |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        spread = f"{row['least_ratio']:.2f}–{row['most_ratio']:.2f}"
        one, all_ = row["peak_mb_1_frames"], row[f"peak_mb_{row['frames']}_frames"]
        lines.append(
            f"| {row['take']} | {row['scale']} | {row['frames']} | {row['ratio']:.2f} ({spread}) | {one:.0f} MB "
            f"| {all_:.0f} MB | {row['frame_mb']:.1f} MB |"
        )
    return [origin(rows), "", *lines]


if __name__ == "__main__":
    main()
