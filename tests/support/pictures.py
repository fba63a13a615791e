"""Scenes and rendered pictures that several tests use, made once in each process."""

from functools import cache

from ii_core import preset
from raytrace_ii import Scene, Shot, load_scene, render


@cache
def scene(name: str) -> Scene:
    """Return a packaged scene."""
    return load_scene(name)


@cache
def shot(name: str = "apples", camera: str = "setup1", scale: int = 16) -> Shot:
    """Return a packaged scene's picture with depth; arrays cannot be written, as tests share them."""
    made = render(scene(name), preset(camera, scale=scale), support=("depth",))
    for array in (made.picture.pixels, made.depth):
        array.setflags(write=False)
    return made
