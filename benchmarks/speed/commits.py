"""CPU time of this code and of earlier commits on full ``setup1``, in turn, one process for each.

    python -m benchmarks run commits [--scenes apples,cuboid] [--psnr 32]

One thread, one sample, no support images. ``load`` says how busy the machine was: ratios of turns count, not times.
``--psnr`` compares whole fronts of time and PSNR at that scale of ``setup1``: fixed and adaptive samples, and samples
by edges, which earlier codes have not. Each code has its own reference of 256 samples.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from benchmarks.arguments import command_line
from benchmarks.records import ROOT, Records
from benchmarks.speed import before
from benchmarks.speed.before import process, worktree
from benchmarks.speed.pareto import band, front
from benchmarks.speed.shots import shots
from ii_core import preset

RECORDS = Records("commits", ("benchmarks.speed.commits", "benchmarks.speed.before"))
SCENES = ("apples", "twins", "car", "cuboid", "objects", "dolphin", "hairdo", "mountains")
COMMITS = "23f840d", before.COMMIT  # of the targets of lanes; before packets
BANDS = range(16)  # all: what a picture costs at once is not to be charged to a part of it
REPEATS = 2
PSNR = 34.0, 42.0  # dB
FIXED, ADAPTIVE = (1, 2, 4, 6, 9, 12, 16), (8.0, 4.0, 2.0, 1.0, 0.5)  # samples; errors with 4 to 16
BY_EDGES = (12.0, 8.0, 6.0, 4.0, 3.0, 2.0, 1.5)  # errors
TURNS = 3


def main() -> None:
    """Measure, print and record."""
    parser = command_line(__doc__, scenes=SCENES)
    parser.add_argument("--psnr", type=int, metavar="SCALE", help="compare at equal PSNR at this scale")
    asked = parser.parse_args()
    if asked.psnr:
        for key in RECORDS.todo([{"scene": name, "scale": asked.psnr} for name in asked.scenes], asked.again):
            found = RECORDS.measure(key, partial(at_equal_psnr, **key))["result"]
            print(key["scene"], {name: round(found[f"times {name}"], 2) for name in COMMITS}, flush=True)
    else:
        measure_whole(asked)
    for scale in {row.get("scale") for row in RECORDS.rows()}:
        rows = [row for row in RECORDS.rows() if row.get("scale") == scale]
        for commit in COMMITS:
            mean = math.exp(sum(math.log(row[f"times {commit}"]) for row in rows) / len(rows))
            where = "one sample at full size" if scale is None else f"equal PSNR at scale {scale}"
            print(f"{where}, geometric mean of {len(rows)} scenes: {mean:.2f} times the speed of {commit}")


def measure_whole(asked: Any) -> None:
    """Measure one sample at full size."""
    for key in RECORDS.todo([{"scene": name} for name in asked.scenes], asked.again):
        found = RECORDS.measure(key, partial(compare, **key))["result"]
        print(key["scene"], {name: round(value, 2) for name, value in found.items()}, flush=True)


def compare(scene: str) -> dict[str, float]:
    """Return median CPU nanoseconds per pixel of all codes, and medians of the ratios of each turn."""
    script, pixels = Path(before.__file__), 8192 * before.BAND * len(BANDS)
    times: dict[str, list[float]] = {"now": [], **{commit: [] for commit in COMMITS}}
    with ExitStack() as stack:
        codes = {name: ROOT if name == "now" else worktree(name) for name in times}
        ask = {
            name: stack.enter_context(process(code, script, scene, *map(str, BANDS))) for name, code in codes.items()
        }
        for turn in range(REPEATS + 1):  # the first compiles kernels
            for name, measure in ask.items():
                nanoseconds = float(measure("render")) / pixels * 1e9
                times[name] += [nanoseconds] if turn else []
    ratios = {
        f"times {name}": median(a / b for a, b in zip(times[name], times["now"], strict=True)) for name in COMMITS
    }
    return {**{name: median(found) for name, found in times.items()}, **ratios, "load": os.getloadavg()[0]}


def at_equal_psnr(scene: str, scale: int) -> dict[str, Any]:
    """Return fronts of time and PSNR of all codes, and the ratios of their times at equal PSNR."""
    codes = {"now": ROOT, **{commit: worktree(commit) for commit in COMMITS}}
    camera = json.dumps(band(preset("setup1", scale=scale)).to_json())
    found: dict[str, dict[str, tuple[float, float]]] = {name: {} for name in codes}
    settings: list[dict[str, Any]] = [{"samples": number} for number in FIXED]
    settings += [{"samples": [4, 16], "error": error} for error in ADAPTIVE]
    settings += [{"samples": "edges", "error": error} for error in BY_EDGES]
    with ExitStack() as stack:
        shoot = {name: stack.enter_context(shots(code, scene, camera, [1.0])) for name, code in codes.items()}
        for render, facts in shoot.values():
            render(cut=1.0, depth=facts["max_depth"], repeats=1, options={"samples": 256, "seed": 1})
        for options in settings:
            for _ in range(TURNS):
                for name, (render, facts) in shoot.items():
                    if name == "now" or options["samples"] != "edges":
                        seconds, psnr = render(
                            cut=1.0, depth=facts["max_depth"], repeats=1, options={**options, "workers": 1}
                        )
                        best = found[name].get(str(options), (math.inf, psnr))
                        found[name][str(options)] = min(best, (seconds, psnr))
    rows = {name: [{"seconds": s, "psnr": p} for s, p in each.values()] for name, each in found.items()}
    ratios = {f"times {name}": times_at_equal_psnr(rows[name], rows["now"]) for name in COMMITS}
    return {
        **ratios,
        "fronts": {name: [each[i] for i in front(each)] for name, each in rows.items()},
        "load": os.getloadavg()[0],
    }


def times_at_equal_psnr(earlier: Sequence[dict[str, Any]], now: Sequence[dict[str, Any]]) -> float:
    """Return the geometric mean of the ratios of times on two fronts, over the PSNR that both reach within `PSNR`.

    Between settings the logarithm of the time is interpolated.
    """
    (old, old_times), (new, new_times) = (
        np.array([(rows[i]["psnr"], math.log(rows[i]["seconds"])) for i in front(rows)]).T for rows in (earlier, now)
    )
    psnr = np.linspace(max(PSNR[0], old.min(), new.min()), min(PSNR[1], old.max(), new.max()), 65)
    return float(np.exp(np.mean(np.interp(psnr, old, old_times) - np.interp(psnr, new, new_times))))


if __name__ == "__main__":
    main()
