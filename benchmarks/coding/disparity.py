"""Disparity and occlusion between neighbouring sub-images, scene by scene.

    python -m benchmarks run disparity [--scale 2] [--scenes apples,cuboid]

The results follow from the depth map: a point at distance z' from the lenses moves by δP·z'/(Λ·δL) pixels from one
sub-image to the next. It has no partner there if it leaves the picture or is occluded. Numbers go to
``benchmarks/results/disparity.jsonl``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.arguments import command_line
from benchmarks.records import Records
from ii_core import IICamera, preset, sub_images
from raytrace_ii import load_scene, render

RECORDS = Records("disparity", ("benchmarks.coding.disparity",))
MOTION_RANGE = 16  # pixels, the coders' default


def main() -> None:
    """Measure and record."""
    parser = command_line(__doc__, scenes=("apples", "cuboid"))
    parser.add_argument("--scale", type=int, nargs="+", default=[1, 2])
    asked = parser.parse_args()
    keys = [{"scene": name, "scale": scale} for name in asked.scenes for scale in asked.scale]
    RECORDS.run(keys, analyse, asked.again)


def analyse(scene: str, scale: int) -> dict[str, float]:
    """Return disparities and partners between horizontal neighbours in the middle row of sub-images."""
    camera = preset("setup1", scale=scale)
    shot = render(load_scene(scene), camera, support=("depth",))
    assert shot.depth is not None
    middle = camera.ei_pixels[1] // 2
    pixels = sub_images(shot.picture)[middle].astype(np.float32)
    depth = sub_images(shot.picture.with_pixels(np.repeat(shot.depth[..., None], 3, axis=2)))[middle, ..., 0]
    moved = disparity(camera, depth[:-1])
    hit = np.isfinite(depth[:-1])
    partner = has_partner(depth, moved)
    return {
        "median_px": float(np.median(moved[hit])),
        "p90_px": float(np.percentile(moved[hit], 90)),
        "beyond_motion_range": float((moved[hit] > MOTION_RANGE).mean()),
        "without_partner": float(1 - partner.mean()),
        "detail": float(np.abs(np.diff(pixels, axis=2)).mean()),
    }


def disparity(camera: IICamera, depth: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the shift of a point at z to the right from SI_u to SI_u+1, in pixels."""
    return (
        camera.pixel_pitch_mm * (depth.astype(np.float64) - camera.gap_mm) / (camera.gap_mm * camera.lens_pitch_mm[0])
    )


def has_partner(depth: NDArray[np.float32], moved: NDArray[Any]) -> NDArray[np.bool_]:
    """Return whether the next sub-image shows the same point: equal depth within 3 % at its position."""
    steps, rows, columns = moved.shape
    hit = np.isfinite(moved)
    there = np.rint(np.arange(columns) + np.where(hit, moved, 0)).astype(int)
    inside = (there >= 0) & (there < columns)
    s, r, _ = np.meshgrid(np.arange(steps), np.arange(rows), np.arange(columns), indexing="ij")
    other = depth[1:][s, r, np.clip(there, 0, columns - 1)]
    same = np.where(hit, np.abs(other - depth[:-1]) < 0.03 * depth[:-1], np.isnan(other))
    return inside & same
