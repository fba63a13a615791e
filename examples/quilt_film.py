"""Film of quilts for a Looking Glass display, with a camera around the scene.

python examples/quilt_film.py [--scene apples] [--scale 4] [--frames 24] [--tiles 8x6] [-o film_qs8x6a1.5.mp4]
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ii_core import camera_pose, preset
from ii_core.base.progress import reporter
from ii_core.display.film import write_animation
from ii_core.display.quilt import quilt
from raytrace_ii import load_scene, render


def main() -> None:
    """Write the film."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", default="apples")
    parser.add_argument("--scale", type=int, default=4, help="divides setup1's lenses")
    parser.add_argument("--frames", type=int, default=24)
    parser.add_argument("--tiles", default="8x6", help="columns x rows of views")
    parser.add_argument("--size", default="240x160", help="pixels of a view")
    parser.add_argument("--swing", type=float, default=12.0, help="degrees to either side")
    parser.add_argument("-o", "--output", type=Path, default=Path("film_qs8x6a1.5.mp4"))
    arguments = parser.parse_args()
    (columns, rows), (width, height) = (map(int, text.split("x")) for text in (arguments.tiles, arguments.size))
    camera, scene = preset("setup1", scale=arguments.scale), load_scene(arguments.scene)
    middle = np.array([0.0, 0.0, 60.0])  # pivot of the camera, mm
    report = reporter(True, "frames")

    def frames() -> Iterator[Any]:
        for i in range(arguments.frames):
            angle = np.radians(arguments.swing) * np.sin(2 * np.pi * i / arguments.frames)
            place = middle - 60.0 * np.array([np.sin(angle), 0.0, np.cos(angle)])
            pose = camera_pose(place, look_at_mm=middle)
            picture = render(scene, camera, pose=pose, support=()).picture
            yield quilt(picture, (columns, rows), size=(width, height), depth_mm=60.0)
            if report is not None:
                report(i + 1, arguments.frames)

    write_animation(arguments.output, frames(), fps=25)
    print(f"{arguments.output}: {arguments.frames} quilts of {columns}×{rows} views")


if __name__ == "__main__":
    main()
