"""Speed ratios within one run: our functions against the library's bare call or a copy. ``make bench``.

Measurements are interleaved and medians taken, because the speed of machines drifts. Numbers go to
``benchmarks/results/speed.jsonl`` with their commit.
"""

from __future__ import annotations

import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from fnmatch import fnmatch
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.arguments import command_line
from benchmarks.records import Records
from benchmarks.speed.before import COMMIT, MENDED, difference, nanoseconds
from codec import encode, parse_scheme
from codec.coders.video import Video, new_frame, open_encoder
from ii_core import IIPicture, component_images, preset
from raytrace_ii import load_scene, render, scene_names

RECORDS = Records("speed", ("benchmarks.speed.ratios", "benchmarks.speed.before"))
REPEATS = 7
LEAST_GAIN = {"apples": "≥ 2.8", "cuboid": "≥ 2.8"}
PLAIN = " without texture filter"
FIRST_PICTURE = (
    "from ii_core import preset; from raytrace_ii import load_scene, render;"
    "render(load_scene('apples'), preset('setup1', scale=32))"
)
FIRST_CODED = (
    "import numpy as np; from codec import encode; from ii_core import IIPicture;"
    "noise = np.random.default_rng(0).integers(0, 256, (48, 72, 3)).astype(np.uint8);"
    "encode(IIPicture(noise, (24, 16), (3, 3)), 'si-lf', qp=20)"
)


def main() -> None:
    """Measure the chosen ratios, print and record."""
    parser = command_line(__doc__)
    parser.add_argument("--only", default="*", help="ratios by name, * for anything: 'render*,peak*'")
    asked = parser.parse_args()
    wanted = {
        what: call for what, (_, call) in targets().items() if any(fnmatch(what, p) for p in asked.only.split(","))
    }

    def row(what: str) -> dict[str, Any]:
        values = wanted[what]()
        return {"median": statistics.median(values), "all": values, "cpu_flags": cpu_flags()}

    RECORDS.run(({"what": what} for what in wanted), row, asked.again)
    for found in measured():
        span = f"({min(found['all']):.2f} … {max(found['all']):.2f})"
        print(f"{found['what']:<52} {found['target']:>6}  {found['median']:.2f}   {span}")


def measured() -> list[dict[str, Any]]:
    """Return the newest row of each ratio, with its target, in the order of `targets`."""
    rows = {row["what"]: row for row in RECORDS.rows()}
    return [{"target": target, **rows[what]} for what, (target, _) in targets().items() if what in rows]


def targets() -> dict[str, tuple[str, Callable[[], list[float]]]]:
    """Return target and measurement of each ratio."""
    every: dict[str, tuple[str, Callable[[], list[float]]]] = {}
    for kind, now in (("", "now"), (PLAIN, "plain")):
        for name in scene_names():
            least = LEAST_GAIN.get(name, "≥ 1.4")
            every[f"render {name}{kind}: speed / {COMMIT}"] = least, partial(ratio, "before", now, name)
        every[f"render, mean of all{kind}: speed / {COMMIT}"] = "≥ 2.2", partial(means, "before", now)
    for part, by in enumerate(("", " by more than 1 code")):
        for name in scene_names():
            every[f"render {name}{PLAIN}: pixels unlike {MENDED}{by}, %"] = "", partial(unlike, name, part)
    for name in scene_names():
        every[f"render {name}: CPU time / EmbreeScene.run"] = "", partial(ratio, "now", "bare", name)
    for kind, now in (("", "now"), (PLAIN, "plain")):
        every[f"render, mean of all{kind}: CPU time / EmbreeScene.run"] = "≤ 0.6", partial(means, now, "bare")
    for name in ("apples", "cuboid"):
        every[f"render {name}: speed of 2 workers / 1 worker"] = "≥ 1.9", partial(workers_ratio, name)
    every["first picture of apples, nothing compiled, CPU s"] = "≤ 15", partial(first_use, FIRST_PICTURE)
    every["first picture of apples in a new process, CPU s"] = "≤ 2", partial(first_use, FIRST_PICTURE, cached=True)
    every["first picture coded by si-lf, nothing compiled, CPU s"] = "", partial(first_use, FIRST_CODED)
    for kind in ("ei", "si", "ri"):
        every[f"II → {kind.upper()} / numpy copy, setup1"] = "≤ 2", partial(rearrange_ratio, kind)
    for scheme in ("si-h264", "ei-h264", "si-hevc", "si-av1:fast"):
        every[f"encode {scheme} / bare encoder on ready frames"] = "≤ 1.1", partial(encode_ratio, scheme)
    every["peak memory of rendering setup1 at full size, GiB"] = "≤ 0.5", peak_memory
    return every


@lru_cache
def rendered(name: str) -> dict[str, list[float]]:
    """Return CPU nanoseconds per pixel of bands of full setup1, one sample, one thread: see `before.nanoseconds`."""
    return nanoseconds(name, REPEATS)


def ratio(above: str, below: str, name: str) -> list[float]:
    """Return the ratios of two of the CPU times of `before.nanoseconds`, turn by turn."""
    found = rendered(name)
    return [a / b for a, b in zip(found[above], found[below], strict=True)]


def means(above: str, below: str) -> list[float]:
    """Return the geometric means of a ratio over all scenes."""
    each = (ratio(above, below, name) for name in scene_names())
    return [math.prod(turn) ** (1 / len(turn)) for turn in zip(*each, strict=True)]


def unlike(name: str, part: int) -> list[float]:
    """Return one of the percentages of `before.difference`."""
    return [difference(name)[part]]


def workers_ratio(name: str) -> list[float]:
    """Return the wall-clock speed of two workers over that of one, 8 Mpixel."""
    scene, camera = load_scene(name), preset("setup1", scale=2)
    one, two = (lambda n=n: render(scene, camera, workers=n) for n in (1, 2))
    two()
    return [_wall(one) / _wall(two) for _ in range(REPEATS)]


def rearrange_ratio(kind: str) -> list[float]:
    """Return the time of a rearrangement at full setup1 over that of copying the same array."""
    camera = preset("setup1")
    pixels = np.random.default_rng(0).integers(0, 256, (camera.pixels[1], camera.pixels[0], 3), np.uint8)
    picture = IIPicture(pixels, camera.lenses, camera.ei_pixels)
    component_images(picture, kind)
    return [_wall(lambda: component_images(picture, kind)) / _wall(pixels.copy) for _ in range(2 * REPEATS)]


def encode_ratio(scheme: str) -> list[float]:
    """Return the CPU time of `encode` from picture to bytes over that of the encoder alone on prepared frames."""
    scene = load_scene("apples")
    picture = render(scene, preset("setup1", scale=4), noise=1.0, support=()).picture
    bare = bare_encoder(picture, scheme, qp=30)
    encode(picture, scheme, qp=30)
    return [_cpu(lambda: encode(picture, scheme, qp=30)) / _cpu(bare) for _ in range(REPEATS)]


def bare_encoder(picture: IIPicture, scheme: str, qp: int) -> Callable[[], int]:
    """Return a function that encodes prepared frames with the encoder library alone: same parameters, by PyAV."""
    coder, options = parse_scheme(scheme)
    assert isinstance(coder, Video)
    film = coder.film(picture, options)
    settings = coder.constant(qp, film, options)
    context = open_encoder(coder, film, settings)
    frames: list[Any] = []
    size = np.dtype(film.format.dtype).itemsize
    planes = film.batch([plane.line_size // size for plane in new_frame(film, context).planes])
    for count in film.gathered(np.ascontiguousarray(picture.pixels), planes):
        for index in range(count):
            frame = new_frame(film, context)
            frame.pts = len(frames)
            for target, values in zip(frame.planes, planes, strict=True):
                np.frombuffer(target, film.format.dtype)[:] = values[index].ravel()
            frames.append(frame)

    def encode() -> int:
        context = open_encoder(coder, film, settings)
        return sum(packet.size for frame in [*frames, None] for packet in context.encode(frame))

    return encode


def first_use(script: str, *, cached: bool = False) -> list[float]:
    """Return CPU seconds of a process from its start to its end, with kernels compiled before or not."""
    script += "; import time; print(time.process_time())"
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "NUMBA_CACHE_DIR": folder}

        def use() -> float:
            run = subprocess.run(
                [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True
            )
            return float(run.stdout)

        first = use()
        return [use() for _ in range(3)] if cached else [first]


def peak_memory() -> list[float]:
    """Return the peak of resident memory in GiB of a process that renders Apples at full setup1 with depth.

    It is Linux's VmHWM: `getrusage` would include the memory of this process, which starts the other.
    """
    script = (
        "from ii_core import preset; from raytrace_ii import load_scene, render;"
        "shot = render(load_scene('apples'), preset('setup1'), support=('depth',));"
        "marks = dict(line.split(':') for line in open('/proc/self/status'));"
        "print(int(marks['VmHWM'].split()[0]) / 2**20)"
    )
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return [float(run.stdout)]


def cpu_flags() -> list[str]:
    """Return the vector instruction sets of this CPU that Embree and numba use."""
    known = ("sse4_2", "avx", "avx2", "fma", "avx512f", "avx512dq", "avx512bw", "avx512vl")
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        return []
    flags = next((line.split() for line in text.splitlines() if line.startswith("flags")), [])
    return [flag for flag in known if flag in flags]


def _cpu(call: Callable[[], object]) -> float:
    start = time.process_time()
    call()
    return time.process_time() - start


def _wall(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start
