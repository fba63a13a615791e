"""Scenes, rendered pictures and frozen files that several tests use, made once in each process.

Archives of frozen files in ``tests/golden`` hold later versions to decode what earlier ones wrote.
``coders.zip`` has one file a scheme, ``SCHEME.ii``, and the pixels that it decodes to, ``SCHEME.png``: coded once by
the version that introduced the scheme, and never replaced; ``compact-header`` and ``first-header`` hold both headers.
``pytest -n 0 tests/codec/test_golden.py --make-golden`` adds those of new schemes, and to ``defaults.json`` every
option's default, which files leave out. ``lf.zip`` has streams of `si-lf` of versions 3 to 12.
"""

import atexit
import shutil
import tempfile
import zipfile
from functools import cache
from pathlib import Path

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


@cache
def unpacked(name: str) -> Path:
    """Return a folder with the files of an archive of ``tests/golden``; it is removed when Python ends."""
    folder = Path(tempfile.mkdtemp(prefix="golden-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    with zipfile.ZipFile(Path(__file__).parents[1] / "golden" / name) as archive:
        archive.extractall(folder)
    return folder
