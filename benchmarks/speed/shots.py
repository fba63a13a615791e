"""Pictures of one scene rendered by the code of any commit, setting by setting, in a process of its own.

As a script, ``python shots.py SCENE CAMERA CUTS``, camera and tessellations in JSON, it is this process: a line of
input is a setting in JSON, the line of output its CPU seconds, and its PSNR in dB against the first picture. The line
"facts" asks for facts of the scene.
"""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

if __name__ != "__main__":  # the process has the code of an earlier tree
    from benchmarks.speed.before import process


class Shots(Protocol):
    """Renders with ``options`` of `render` and returns CPU seconds, the least of ``repeats``, and PSNR in dB."""

    def __call__(self, *, cut: float, depth: int, repeats: int, options: dict[str, Any]) -> tuple[float, float]: ...


@contextmanager
def shots(code: Path, scene: str, camera: str, cuts: list[float]) -> Iterator[tuple[Shots, dict[str, Any]]]:
    """Start the process with the code of a tree; return the function that renders, and facts of the scene.

    Parameters
    ----------
    cuts : list of float
        Tessellations of the scene, as factors of its file's.
    """
    with process(code, Path(__file__), scene, camera, json.dumps(cuts)) as ask:

        def shoot(*, cut: float, depth: int, repeats: int, options: dict[str, Any]) -> tuple[float, float]:
            seconds, psnr = json.loads(ask(json.dumps([cut, depth, repeats, options])))
            return seconds, psnr

        yield shoot, json.loads(ask("facts"))


def _serve(scene: str, camera_json: str, cuts_json: str) -> None:
    ii_core, raytrace_ii = importlib.import_module("ii_core"), importlib.import_module("raytrace_ii")
    q_global = importlib.import_module("metrics").q_global
    tessellation: Any = _first_of("benchmarks.speed.tessellation", "benchmarks.speed.pareto", "benchmarks.pareto")
    camera = ii_core.IICamera.from_json(json.loads(camera_json))
    scenes = {cut: tessellation.cut_scene(scene, cut) for cut in json.loads(cuts_json)}
    truth = None
    for line in map(str.strip, sys.stdin):
        if line == "facts":
            faces = {str(cut): sum(len(body.faces) for body in one.bodies) for cut, one in scenes.items()}
            print(json.dumps({"faces": faces, "max_depth": scenes[1.0].max_depth}), flush=True)
            continue
        cut, depth, repeats, options = json.loads(line)
        if isinstance(options["samples"], list):
            options["samples"] = tuple(options["samples"])
        of = tessellation.at_depth(scenes[cut], depth)
        made = [raytrace_ii.render(of, camera, dtype="uint16", support=(), **options) for _ in range(repeats)]
        truth = made[0].picture if truth is None else truth
        seconds = min(shot.stats.cpu_seconds for shot in made)
        print(json.dumps([seconds, float(q_global(truth, made[0].picture))]), flush=True)


def _first_of(*modules: str) -> Any:
    """Import the first module that the code has: earlier ones have others."""
    for name in modules[:-1]:
        try:
            return importlib.import_module(name)
        except ModuleNotFoundError:
            continue
    return importlib.import_module(modules[-1])


if __name__ == "__main__":
    _serve(*sys.argv[1:])
