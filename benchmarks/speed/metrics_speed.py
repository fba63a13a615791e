"""CPU time of the metrics at the full size of setup1 (33.5 Mpixel).

    python -m benchmarks run metrics_speed

Times are CPU seconds of the process, which depend little on other processes. Memory is the peak of numpy's
allocations during a call, beyond the two pictures; for Q_depth it is the growth of the process.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np
from skimage.metrics import structural_similarity

from benchmarks.arguments import command_line
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import ROOT, Records, origin, table
from ii_core import IIPicture, five_viewpoints, preset
from metrics import q_angle, q_global, q_view
from metrics.measures.view import LUMA, view_pair

RECORDS = Records("metrics_speed", ("benchmarks.speed.metrics_speed",))
REPEATS = 7


def main() -> None:
    """Measure all, record and fill the page."""
    asked = command_line(__doc__).parse_args()
    RECORDS.run(({"what": what} for what in TARGETS), lambda what: {"value": value_of(what)}, asked.again)
    publish(tables())


# Rows of the table, and their targets.
TARGETS = {
    "q_global / numpy subtract and square": "≤ 3",
    "q_global: MiB allocated at most": "",
    "q_angle / numpy subtract and square": "≤ 3",
    "q_angle: MiB allocated at most": "",
    "q_view: CPU s beyond SSIM's own": "≤ 1",
    "q_depth, 250 layers, 25 + 25 EIs: CPU s / 2 cores": "≤ 30",
    "q_depth: GiB over the pictures": "≤ 1",
    "q_depth, robust: CPU s / 2 cores": "",
    "q_depth, robust: GiB over the pictures": "",
}


def value_of(what: str) -> float:
    """Measure one row."""
    if what.startswith("q_depth"):
        seconds, gib = q_depth_at_full_size("robust" if "robust" in what else "dissertation")
        return gib if "GiB" in what else seconds / 2
    a, b = full_size()
    if what.startswith("q_view"):
        return view_seconds(a, b)
    metric = {"q_global": q_global, "q_angle": q_angle}[what.replace(":", " ").split()[0]]
    metric(a, b)
    return _peak(lambda: metric(a, b)) if "MiB" in what else against_numpy(metric, a, b)


def tables() -> Tables:
    """Return the table of the records."""
    rows = RECORDS.by("what", TARGETS)
    lines = [f"{what} | {TARGETS[what]} | {row['value']:.3g}" for what, row in rows.items()]
    cost = table("| target | measured", lines, [[row["commit"]] for row in rows.values()])
    return {("docs/metrics.md", "speed"): [*cost, "", origin(rows.values())]}


def full_size() -> tuple[IIPicture, IIPicture]:
    """Return two pictures of noise that differ by noise."""
    camera = preset("setup1")
    rng = np.random.default_rng(0)
    blocks = [rng.integers(0, 250, (256, 512, 3), dtype=np.uint8) for _ in range(2)]
    blocks[1] = blocks[0] + blocks[1] % 5
    a, b = (IIPicture(np.tile(x, (16, 16, 1)), camera.lenses, camera.ei_pixels, camera) for x in blocks)
    return a, b


def against_numpy(metric: Callable[[IIPicture, IIPicture], object], a: IIPicture, b: IIPicture) -> float:
    """Return the CPU time of a measure over that of numpy's subtraction and square of bytes."""

    def plain() -> None:
        difference = np.subtract(a.pixels, b.pixels)  # of bytes, with wraparound: a lower bound of numpy's time
        np.square(difference, out=difference)

    return statistics.median([_cpu(lambda: metric(a, b)) / _cpu(plain) for _ in range(REPEATS)])


def view_seconds(a: IIPicture, b: IIPicture) -> float:
    """Return the CPU time of q_view minus that of scikit-image's SSIM on the same five pairs of views."""
    pairs = []
    for viewpoint in five_viewpoints(a.camera).values():  # type: ignore[arg-type]
        x, y, _ = view_pair(a, b, viewpoint)
        pairs.append((x @ LUMA, y @ LUMA))
    options: Any = {"data_range": 255, "gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False}

    def ssim() -> None:
        for x, y in pairs:
            structural_similarity(x, y, **options)

    q_view(a, b)
    return statistics.median([_cpu(lambda: q_view(a, b)) - _cpu(ssim) for _ in range(REPEATS)])


def q_depth_at_full_size(method: str) -> tuple[float, float]:
    """Return CPU seconds and memory growth in GiB of the second q_depth; the first one compiles."""
    script = f"""
import time
from benchmarks.speed.metrics_speed import full_size
from metrics import linear_layers, q_depth
from ii_core import IIPicture, preset
small = preset("setup1", scale=32)
a, b = full_size()
tiny = IIPicture(a.pixels[: small.pixels[1], : small.pixels[0]].copy(), small.lenses, small.ei_pixels, small)
q_depth(tiny, tiny, method={method!r}, layers_mm=linear_layers(small))
def most():  # not `getrusage`, which would begin with what the process that started this one holds
    return int(dict(line.split(":") for line in open("/proc/self/status"))["VmHWM"].split()[0])
before, started = most(), time.process_time()
q_depth(a, b, method={method!r}, layers_mm=linear_layers(a.camera))
print(time.process_time() - started, (most() - before) / 2**20)
"""
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, cwd=ROOT)
    seconds, gib = map(float, run.stdout.split())
    return seconds, gib


def _cpu(call: Callable[[], object]) -> float:
    started = time.process_time()
    call()
    return time.process_time() - started


def _peak(call: Callable[[], object]) -> float:
    """Return the peak MiB allocated by Python and numpy during a call."""
    tracemalloc.start()
    try:
        call()
        return tracemalloc.get_traced_memory()[1] / 2**20
    finally:
        tracemalloc.stop()
