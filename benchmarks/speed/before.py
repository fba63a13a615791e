"""CPU time of this code and of an earlier commit on the same pictures, interleaved within one run.

Two processes, one for each code, render the same bands of full ``setup1`` with one thread, in turn, never at the same
time. The earlier code comes from a git worktree in a temporary folder. Its process also repeats the calls of
``EmbreeScene.run`` of its render, on the same rays in the same order: this is Embree's bare time.

The earlier code reads image textures at points. The present code therefore renders twice: as by default, with its
textures filtered, and with the filter off, which is the earlier code's picture but for mended vertex normals. Pixels
are compared with the commit `MENDED`, which mended them and is else the earlier code: what `difference` counts there
are ties.

As a script, ``python before.py SCENE BAND …``, it is one of these processes: a line of input is a task, "render",
"plain" for a render without the filter, "bare", or "save FILE" for the pixels of "plain"; the line of output its CPU
seconds.
"""

from __future__ import annotations

import atexit
import importlib
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

COMMIT = "b1dc540"  # the last commit that traced single rays in rows of pixels
MENDED = "a0d34f9"  # the same with vertex normals of length 1
ROOT = Path(__file__).parents[2]
BAND = 256  # rows of full setup1 per band
BANDS = {"hairdo": (7,)}  # one band of hair costs as much as four of other scenes
USUAL_BANDS = (2, 7, 12)


def nanoseconds(scene: str, repeats: int) -> dict[str, list[float]]:
    """Return CPU nanoseconds per pixel of ``now``, ``plain`` (now, without texture filter), ``before``, and ``bare``.

    ``bare`` are the Embree calls of the earlier code.
    """
    bands = BANDS.get(scene, USUAL_BANDS)
    pixels = 8192 * BAND * len(bands)
    found: dict[str, list[float]] = {"now": [], "plain": [], "before": [], "bare": []}
    arguments = (Path(__file__), scene, *map(str, bands))
    with process(ROOT, *arguments) as now, process(worktree(), *arguments) as before:
        for measure in (now, before):
            measure("render")  # compiles the kernels
        for _ in range(repeats):
            for name, measure, task in (
                ("now", now, "render"),
                ("plain", now, "plain"),
                ("before", before, "render"),
                ("bare", before, "bare"),
            ):
                found[name].append(float(measure(task)) / pixels * 1e9)
    return found


@cache
def difference(scene: str) -> tuple[float, float]:
    """Return percentages of pixels in which the picture without texture filter is not that of `MENDED`.

    Those that differ, and those that differ by more than one 8-bit code in a channel.
    """
    bands = BANDS.get(scene, USUAL_BANDS)
    with tempfile.TemporaryDirectory() as folder:
        pictures = []
        for code in (ROOT, worktree(MENDED)):
            file = Path(folder) / f"{len(pictures)}.npy"
            with process(code, Path(__file__), scene, *map(str, bands)) as measure:
                measure(f"save {file}")
            pictures.append(np.load(file))
    off = np.abs(pictures[0].astype(np.int16) - pictures[1]).max(axis=-1)
    return 100 * float((off > 0).mean()), 100 * float((off > 1).mean())


@cache
def worktree(commit: str = COMMIT) -> Path:
    """Return a work tree of an earlier code, kept until this process ends, so that its kernels are compiled once."""
    folder = tempfile.mkdtemp()
    tree = Path(folder) / commit
    subprocess.run(["git", "-C", str(ROOT), "worktree", "add", "-q", "--detach", str(tree), commit], check=True)

    def remove() -> None:
        subprocess.run(["git", "-C", str(ROOT), "worktree", "remove", "--force", str(tree)], check=True)
        shutil.rmtree(folder)

    atexit.register(remove)
    return tree


@contextmanager
def process(code: Path, script: Path, *arguments: str) -> Iterator[Callable[[str], str]]:
    """Start a script with the code of a tree; return a function that sends it a line and returns its answer."""
    run = subprocess.Popen(
        [sys.executable, str(script), *arguments],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=code,
        env={**os.environ, "PYTHONPATH": str(code), "PYTHONSAFEPATH": "1"},
    )  # fmt: skip
    assert run.stdin is not None and run.stdout is not None
    to, back = run.stdin, run.stdout

    def ask(task: str) -> str:
        print(task, file=to, flush=True)
        line = back.readline()
        if not line:
            raise RuntimeError(f"the process with the code of {code} died on the task {task!r}")
        return line

    try:
        yield ask
    finally:
        to.close()
        run.wait()


def _serve(scene_name: str, bands: list[int]) -> None:
    ii_core, raytrace_ii = importlib.import_module("ii_core"), importlib.import_module("raytrace_ii")
    try:
        job: Any = importlib.import_module("raytrace_ii.rendering.job")
    except ModuleNotFoundError:  # the earlier code
        job = importlib.import_module("raytrace_ii.job")
    filters = "texture_filter" in job.Job.__annotations__
    unfiltered: dict[str, Any] = {"texture_filter": False} if filters else {}
    whole = job.Job.tiles
    job.Job.tiles = lambda self: [tile for tile in whole(self) if tile[0].start // BAND in bands]
    scene, camera = raytrace_ii.load_scene(scene_name), ii_core.preset("setup1")

    def shoot(**options: Any) -> Any:
        return raytrace_ii.render(scene, camera, workers=1, support=(), **options).picture.pixels

    calls: list[Callable[[], object]] = []
    for task in map(str.strip, sys.stdin):
        if task == "bare" and not calls:
            calls = importlib.import_module("benchmarks.speed").recorded_calls(scene, shoot)
        start = time.process_time()
        if task == "bare":
            for call in calls:
                call()
        elif task == "render":
            shoot()
        else:
            pixels = shoot(**unfiltered)
            if task != "plain":
                rows = pixels.reshape(-1, BAND, *pixels.shape[1:])[bands]
                np.save(task.removeprefix("save "), rows)
        print(time.process_time() - start, flush=True)


if __name__ == "__main__":
    _serve(sys.argv[1], [int(band) for band in sys.argv[2:]])
