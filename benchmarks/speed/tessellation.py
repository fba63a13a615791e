"""Reference scenes with another tessellation or recursion depth."""

from __future__ import annotations

import re
import shutil
import tempfile
from importlib.resources import files
from pathlib import Path

from raytrace_ii import Scene, load_scene
from raytrace_ii.tracing.packing import share


def at_depth(scene: Scene, depth: int) -> Scene:
    """Return the scene with another recursion depth and the same acceleration structure."""
    other = scene.with_depth(depth)
    share(scene, other)
    return other


def scene_text(name: str) -> str:
    return Path(str(files("assets") / "scenes" / f"{name}.toml")).read_text(encoding="utf-8")


def sizes(text: str) -> list[str]:
    """Return the objects of a scene file with a tessellation."""
    return [block for block in re.split(r"(?m)^(?=\[\[object\]\])", text) if _cut(block, 2.0) != block]


def _cut(block: str, factor: float) -> str:
    """Return an object with ``factor`` times the tessellation."""
    if re.search(r'(?m)^shape = "(sphere|cylinder|revolve)"', block):
        if not re.search(r"(?m)^segments", block):
            block = re.sub(r"(?m)^shape = .*$", r"\g<0>\nsegments = 96", block, count=1)
        if '"revolve"' in block and not re.search(r"(?m)^steps", block):
            block = re.sub(r"(?m)^shape = .*$", r"\g<0>\nsteps = 64", block, count=1)
        block = re.sub(
            r"(?m)^(segments|steps) = (\d+)", lambda m: f"{m[1]} = {max(4, round(int(m[2]) * factor))}", block
        )
    return re.sub(r"(?m)^cell_mm = ([\d.]+)", lambda m: f"cell_mm = {float(m[1]) / factor:g}", block)


def cut_scene(name: str, factor: float) -> Scene:
    """Return a reference scene with ``factor`` times the tessellation, where its file sets one."""
    if factor == 1:
        return load_scene(name)
    blocks = re.split(r"(?m)^(?=\[\[object\]\])", scene_text(name))
    with tempfile.TemporaryDirectory() as folder:
        shutil.copytree(Path(str(files("assets") / "textures")), Path(folder) / "textures")
        (Path(folder) / "scenes").mkdir()
        path = Path(folder) / "scenes" / f"{name}.toml"
        path.write_text("".join(_cut(block, factor) for block in blocks), encoding="utf-8")
        return load_scene(path)
