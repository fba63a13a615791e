"""Time-first against view-first by speed of the camera and lens pitch; prediction of the crossing by correlations.

    python -m benchmarks run crossing [--again missing]

The still scene of the take *apples* is seen by a camera that moves sideways at a constant speed, through lenses of
three pitches over the same pixels and gap. The Bjøntegaard rate of both orders is compared with the mean correlation
(5.3) and residual energy (5.7) of sub-images that are neighbours in time, and in view: without and with motion
compensation by `benchmarks.coding.neighbours`. Orders have one reference: with 8, the references of a time-first walk
of 4 instants include the last view, and there is no crossing. Rows without ``refs`` have 8.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.arguments import command_line
from benchmarks.coding.neighbours import Floats, compensated, neighbours
from benchmarks.coding.takes import ONE_WAY, difference, points
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin
from codec import Plan
from ii_core import IIVideo, preset, video_of
from raytrace_ii import load_take, render

RECORDS = Records(
    "crossing", ("benchmarks.coding.crossing", "benchmarks.coding.neighbours", "benchmarks.coding.takes")
)
SCALE, INSTANTS = 8, 4
PITCHES = (8, 16, 32)  # lens pitches in pixels; `setup1` has 16
SPEEDS = (0.2, 0.8, 3.2, 12.8)  # mm per frame
REFS = 1


def main() -> None:
    """Measure, print the table and fill the page."""
    asked = command_line(__doc__).parse_args()
    keys = [
        {"scale": SCALE, "pitch_px": pitch, "mm_per_frame": speed, "refs": REFS}
        for pitch in PITCHES
        for speed in SPEEDS
    ]
    for key in RECORDS.todo(keys, asked.again):
        RECORDS.measure(key, lambda key=key: measured(**key))
        print(key, flush=True)
    print("\n".join(table()))
    publish(tables())


def measured(scale: int, pitch_px: int, mm_per_frame: float, refs: int) -> dict[str, Any]:
    """Return points of both one-way orders, and correlations."""
    video = moving(scale, pitch_px, mm_per_frame)
    curves = {name: points(video, Plan(walk=name, span=INSTANTS), f"si-h264:rate=cq,refs={refs}") for name in ONE_WAY}
    now, last = neighbours(video)
    predictions = {name: compensated(now, image, 0.0)[0] for name, image in last.items()}
    plain = {name: likeness(now, image) for name, image in last.items()}
    moved = {name: likeness(now, image) for name, image in predictions.items()}
    return {"curves": curves, "plain": plain, "compensated": moved}


def moving(scale: int, pitch_px: int, mm_per_frame: float) -> IIVideo:
    """Return instants around the middle of the path, through lenses of so many pixels."""
    camera = preset("setup1", scale=scale)
    across, down = (n // pitch_px for n in camera.pixels)
    camera = replace(camera, lenses=(across, down), lens_pitch_mm=None)
    scene = load_take("apples").scene_at(0.0)
    pictures = []
    for instant in range(INSTANTS):
        pose = np.eye(4)
        pose[0, 3] = mm_per_frame * (instant - (INSTANTS - 1) / 2)
        pictures.append(render(scene, camera, pose=pose).picture)
    return video_of(pictures, fps=24)


def likeness(images: Floats, others: Floats) -> dict[str, float]:
    """Return mean correlation (5.3) and mean residual energy per pixel (5.7) of pairs of images."""
    a, b = (group.reshape(len(group), -1).astype(np.float64) for group in (images, others))
    energy = float(np.square(a - b).mean())
    a, b = (group - group.mean(axis=1, keepdims=True) for group in (a, b))
    lengths = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
    return {"correlation": float(((a * b).sum(axis=1) / np.maximum(lengths, 1e-12)).mean()), "energy": energy}


def ratios(row: dict[str, Any], kind: str) -> tuple[float, float]:
    """Return ratios time over view of decorrelation 1 − c and residual energy; 1 is the predicted crossing."""
    time, view = row[kind]["time"], row[kind]["view"]
    return (1 - time["correlation"]) / (1 - view["correlation"]), time["energy"] / view["energy"]


def rows() -> list[dict[str, Any]]:
    """Return the rows with ``rate``, the rate of time-first against view-first in percent, by pitch and speed."""
    found = [
        {"refs": 8, **row, "rate": difference(*(row["curves"][name] for name in ONE_WAY))} for row in RECORDS.rows()
    ]
    return sorted(found, key=lambda row: (row["refs"], row["pitch_px"], row["mm_per_frame"]))


def tables() -> Tables:
    """Return the commits behind the chart of the page of videos, which has the numbers of the table."""
    found = rows()
    return {("docs/video.md", "takes-crossing"): [origin(found) if found else "Not measured yet."]}


def table() -> list[str]:
    """Return a table with a row per pitch and speed: ratios of decorrelation and energy, and the rate."""
    found = rows()
    if not found:
        return ["Not measured yet."]
    lines = [
        "| references | lens pitch | mm a frame | lenses a frame | 1 − c, time over view | e, time over view | "
        "1 − c, compensated | e, compensated | time-first against view-first |",
        "|" + "---|" * 9,
    ]
    for row in found:
        lenses = row["mm_per_frame"] / (preset("setup1", scale=row["scale"]).pixel_pitch_mm * row["pitch_px"])
        values = [*ratios(row, "plain"), *ratios(row, "compensated")]
        off = "–" if row["rate"] is None else f"{row['rate']:+.1f} %"
        lines.append(
            f"| {row['refs']} | {row['pitch_px']} px | {row['mm_per_frame']:g} | {lenses:.2g} | "
            + " | ".join(f"{value:.3g}" for value in values)
            + f" | {off} |"
        )
    return [origin(found), "", *lines]


if __name__ == "__main__":
    main()
