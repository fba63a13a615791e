"""Animation at the head of the README: ``python -m benchmarks run hero``.

*Apples* through full *setup1* with 16 samples per pixel, seen along an ellipse in the viewing zone, as in
`raytrace-ii display`. Rendering takes three minutes of CPU time.
"""

from __future__ import annotations

import os

from benchmarks.pages.pictures import IMAGES
from ii_core import IIPicture, preset
from ii_core.display.film import write_animation
from ii_core.display.look import focused_view, viewpoints_around
from raytrace_ii import load_scene, render

PATH = IMAGES / "apples.webp"
SIZE, DEPTH_MM = (720, 360), 37.0  # pixels of a frame; focus on the apples in front
FRAMES, FPS = 20, 10


def main() -> None:
    """Render and write."""
    film(render(load_scene("apples"), preset("setup1"), samples=16, support=()).picture, PATH)


def film(picture: IIPicture, path: str | os.PathLike[str]) -> None:
    """Write the film of views along the ellipse."""
    places = viewpoints_around(picture, FRAMES)
    write_animation(path, (focused_view(picture, place, size=SIZE, depth_mm=DEPTH_MM) for place in places), fps=FPS)
