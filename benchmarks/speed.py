"""How fast, as ratios taken within one run: ours against the library's bare call or a copy. ``make bench``.

Everything is interleaved and the median taken, because machines drift. Numbers go to
``benchmarks/results/speed.jsonl`` with the commit they were taken on.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from fnmatch import fnmatch
from typing import Any

import numpy as np

from benchmarks.bare import bare_encoder
from benchmarks.records import Records, add_again
from codec import encode
from ii_core import IIPicture, component_images, preset
from raytrace_ii import Scene, load_scene, render, scene_names
from raytrace_ii.rendering.render import SUPPORT
from raytrace_ii.tracing.intersect import Intersector

RECORDS = Records("speed", ("benchmarks.speed", "benchmarks.bare"))
REPEATS = 7


def main() -> None:
    """Measure what is asked for, print and keep."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="*", help="ratios by name, * for anything: 'render*,peak*'")
    add_again(parser)
    asked = parser.parse_args()
    wanted = {
        what: call for what, (_, call) in targets().items() if any(fnmatch(what, p) for p in asked.only.split(","))
    }
    for key in RECORDS.todo(({"what": what} for what in wanted), asked.again):

        def row(call: Callable[[], list[float]] = wanted[key["what"]]) -> dict[str, Any]:
            values = call()
            return {"median": statistics.median(values), "all": values}

        RECORDS.measure(key, row)
    for found in measured():
        span = f"({min(found['all']):.2f} … {max(found['all']):.2f})"
        print(f"{found['what']:<52} {found['target']:>6}  {found['median']:.2f}   {span}")


def measured() -> list[dict[str, Any]]:
    """Return the newest row of each ratio, with its target, in the order of `targets`."""
    rows = {row["what"]: row for row in RECORDS.rows()}
    return [{"target": target, **rows[what]} for what, (target, _) in targets().items() if what in rows]


def targets() -> dict[str, tuple[str, Callable[[], list[float]]]]:
    """Return target and measurement of each ratio."""
    every: list[tuple[str, str, Callable[[], list[float]]]] = [
        *(
            (f"render {name}, depth: CPU time / EmbreeScene.run", "≤ 1.2", lambda name=name: render_ratio(name))
            for name in scene_names()
        ),
        ("the same of apples with normals and ids too", "", lambda: render_ratio("apples", SUPPORT)),
        ("render apples: speed of 2 workers / 1 worker", "≥ 1.9", lambda: workers_ratio("apples")),
        ("render cuboid: speed of 2 workers / 1 worker", "≥ 1.9", lambda: workers_ratio("cuboid")),
        ("first picture of apples, nothing compiled, CPU s", "≤ 15", lambda: first_picture(cached=False)),
        ("first picture of apples in a new process, CPU s", "", lambda: first_picture(cached=True)),
        ("II → EI / numpy copy, setup1", "≤ 2", lambda: rearrange_ratio("ei")),
        ("II → SI / numpy copy, setup1", "≤ 2", lambda: rearrange_ratio("si")),
        ("II → RI / numpy copy, setup1", "≤ 2", lambda: rearrange_ratio("ri")),
        ("encode si-h264 / bare encoder on ready frames", "≤ 1.1", lambda: encode_ratio("si-h264")),
        ("encode ei-h264 / bare encoder on ready frames", "≤ 1.1", lambda: encode_ratio("ei-h264")),
        ("encode si-hevc / bare encoder on ready frames", "≤ 1.1", lambda: encode_ratio("si-hevc")),
        ("encode si-av1:fast / bare encoder on ready frames", "≤ 1.1", lambda: encode_ratio("si-av1:fast")),
        ("peak memory of rendering setup1 at full size, GiB", "≤ 1.5", peak_memory),
    ]
    return {what: (target, call) for what, target, call in every}


def render_ratio(name: str, support: tuple[str, ...] = ("depth",)) -> list[float]:
    """CPU time of a render against that of Embree on the very same rays, 2 Mpixel at one sample."""
    scene, camera = load_scene(name), preset("setup1", scale=4)

    def shoot() -> Any:
        return render(scene, camera, workers=1, support=support)

    calls = recorded_calls(scene, shoot)
    ratios = []
    for _ in range(REPEATS):
        whole = _cpu(shoot)
        ratios.append(whole / _cpu(lambda: [call() for call in calls]))
    return ratios


def recorded_calls(scene: Scene, run: Callable[[], object]) -> list[Callable[[], object]]:
    """The calls of ``EmbreeScene.run`` that ``run`` makes, with copies of their rays, ready to be made again."""
    calls: list[Callable[[], object]] = []
    intersector = scene.packed.intersector

    class Recorder:
        def __init__(self, tree: Any) -> None:
            self.tree = tree

        def run(self, *arrays: Any, **options: Any) -> Any:
            rays = [array.copy() for array in arrays]
            kept = {k: v.copy() if isinstance(v, np.ndarray) else v for k, v in options.items()}
            calls.append(lambda: self.tree.run(*rays, **kept))
            return self.tree.run(*arrays, **options)

    trees = {name: tree for name, tree in vars(intersector).items() if hasattr(tree, "run")}
    assert isinstance(intersector, Intersector) and trees
    try:
        for name, tree in trees.items():
            setattr(intersector, name, Recorder(tree))
        run()
    finally:
        for name, tree in trees.items():
            setattr(intersector, name, tree)
    return calls


def workers_ratio(name: str) -> list[float]:
    """Wall-clock speed of two workers against one, 8 Mpixel."""
    scene, camera = load_scene(name), preset("setup1", scale=2)
    render(scene, preset("setup1", scale=32))
    one, two = (lambda n=n: render(scene, camera, workers=n) for n in (1, 2))
    return [_wall(one) / _wall(two) for _ in range(REPEATS)]


def rearrange_ratio(kind: str) -> list[float]:
    """Time of a rearrangement at full setup1 against copying the same array."""
    camera = preset("setup1")
    pixels = np.random.default_rng(0).integers(0, 256, (camera.pixels[1], camera.pixels[0], 3), np.uint8)
    picture = IIPicture(pixels, camera.lenses, camera.ei_pixels)
    component_images(picture, kind)
    return [_wall(lambda: component_images(picture, kind)) / _wall(pixels.copy) for _ in range(2 * REPEATS)]


def encode_ratio(scheme: str) -> list[float]:
    """CPU time of `encode` from picture to bytes against the encoder alone on frames that lie ready."""
    scene = load_scene("apples")
    picture = render(scene, preset("setup1", scale=4), noise=1.0, support=()).picture
    bare = bare_encoder(picture, scheme, qp=30)
    encode(picture, scheme, qp=30)
    return [_cpu(lambda: encode(picture, scheme, qp=30)) / _cpu(bare) for _ in range(REPEATS)]


def first_picture(*, cached: bool) -> list[float]:
    """CPU seconds of a process from its start to a small picture, with kernels compiled before or not."""
    script = (
        "import time; from ii_core import preset; from raytrace_ii import load_scene, render;"
        "render(load_scene('apples'), preset('setup1', scale=32)); print(time.process_time())"
    )
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "NUMBA_CACHE_DIR": folder}

        def shoot() -> float:
            run = subprocess.run(
                [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True
            )
            return float(run.stdout)

        first = shoot()
        return [shoot() for _ in range(3)] if cached else [first]


def peak_memory() -> list[float]:
    """GiB resident at most in a process that renders Apples at full setup1 and keeps picture and depth.

    Linux's own mark: `getrusage` would begin with what this process holds, from which the other is started.
    """
    script = (
        "from ii_core import preset; from raytrace_ii import load_scene, render;"
        "shot = render(load_scene('apples'), preset('setup1'), support=('depth',));"
        "marks = dict(line.split(':') for line in open('/proc/self/status'));"
        "print(int(marks['VmHWM'].split()[0]) / 2**20)"
    )
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return [float(run.stdout)]


def _cpu(call: Callable[[], object]) -> float:
    start = time.process_time()
    call()
    return time.process_time() - start


def _wall(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


if __name__ == "__main__":
    main()
