"""Benchmarks with pages of their own, run as steps of the study."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

from benchmarks.records import ROOT
from benchmarks.registry import BENCHMARKS, entry

from .runner import Step

DEMO = "examples.demo"
# Script, purpose, arguments. The order matters: `coding_docs` and `readme` use results of others.
SCRIPTS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("cameras", "Figures 3.6, 3.7, 5.9: every camera with its maps, all scenes", ()),
    ("camera_in_scene", "Table 3.2: a camera of glass inside the scene", ()),
    ("demo", "the tutorial's chart and pictures", ()),
    ("demo", "the same at full size", ("--scale", "1", "-o", "out/full")),
    ("disparity", "occlusion and texture of scenes against their gain", ("--scenes", "apples,twins,car,cuboid")),
    ("orders", "Table 5.4", ()),
    ("headers", "(5.11) to (5.15): header portions", ()),
    ("cost", "(5.16), Table 5.8: time and memory of every scheme", ()),
    ("coders", "every scheme and setting at equal quality", ("--workers", "2")),
    ("bframes", "why B pictures hurt in Table 5.5", ()),
    ("coding_docs", "tables of docs/coding.md", ()),
    ("volume", "gain of the volume", ("--scenes", "apples,twins,car,cuboid")),
    ("metrics_gallery", "Figure 4.9; Q_angle, views and Q_depth of one picture", ()),
    ("depth_truth", "Figure 4.6 ff.: depth from focus against true depth", ()),
    ("map_precision", "(3.11), (3.12): storing a camera as pictures", ()),
    ("convergence", "accuracy of triangle meshes", ()),
    ("stability", "where methods fail", ()),
    ("pareto", "speed against accuracy of rendering", ()),
    ("metrics_speed", "cost of metrics", ()),
    ("ratios", "ratios to bare libraries", ()),
    ("readme", "tables of the README, gains, speed ratios", ()),
)


def steps(scale: int) -> list[Step]:
    """Return all scripts for the full study, none for smaller ones: their pages have fixed sizes."""
    if scale != 1:
        return []
    names = [name for name, *_ in SCRIPTS]
    return [
        Step(
            name=f"script-{name}" + ("-full" if names[:i].count(name) else ""),
            shows=shows,
            run=script,
            parameters={"script": name, "arguments": arguments},
            uses=(DEMO if name == "demo" else entry(BENCHMARKS[name].module),),
        )
        for i, (name, shows, arguments) in enumerate(SCRIPTS)
    ]


def script(_folder: Path, *, script: str, arguments: tuple[str, ...]) -> dict[str, Any]:
    """Run a script, which has a record file and a page of its own."""
    program = ["examples/demo.py"] if script == "demo" else ["-m", "benchmarks", "run", script]
    command = [*program, *arguments]
    subprocess.run([sys.executable, *command], cwd=ROOT, check=True)
    return {"command": " ".join(["python", *command])}
