"""Rendered pictures that several test files use, made once in each process."""

from functools import cache

from ii_core import preset
from raytrace_ii import Shot, load_scene, render


@cache
def shot(scene: str = "apples", camera: str = "setup1", scale: int = 16) -> Shot:
    """Return a packaged scene's picture with depth; arrays cannot be written, as tests share them."""
    made = render(load_scene(scene), preset(camera, scale=scale), support=("depth",))
    for array in (made.picture.pixels, made.depth):
        array.setflags(write=False)
    return made
