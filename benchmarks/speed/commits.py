"""CPU time of this code and of earlier commits on the same bands of full ``setup1``, in turn, one process for each.

    python -m benchmarks run commits [--scenes apples,cuboid]

One thread, one sample, no support images. ``load`` says how busy the machine was: ratios of turns count, not times.
"""

from __future__ import annotations

import math
import os
from contextlib import ExitStack
from pathlib import Path
from statistics import median

from benchmarks.arguments import command_line
from benchmarks.records import ROOT, Records
from benchmarks.speed import before
from benchmarks.speed.before import process, worktree

RECORDS = Records("commits", ("benchmarks.speed.commits", "benchmarks.speed.before"))
SCENES = ("apples", "twins", "car", "cuboid", "objects", "dolphin", "hairdo", "mountains")
COMMITS = ("cf408e1", "23f840d", before.COMMIT)  # before lanes; of the targets of lanes; before packets
BANDS = (7,)  # in the middle of the picture
REPEATS = 7


def main() -> None:
    """Measure, print and record."""
    asked = command_line(__doc__, scenes=SCENES).parse_args()
    for key in RECORDS.todo([{"scene": name} for name in asked.scenes], asked.again):
        found = RECORDS.measure(key, lambda key=key: compare(**key))["result"]
        print(key["scene"], {name: round(value, 2) for name, value in found.items()}, flush=True)
    rows = RECORDS.rows()
    for commit in COMMITS if rows else ():
        mean = math.exp(sum(math.log(row[f"times {commit}"]) for row in rows) / len(rows))
        print(f"geometric mean of {len(rows)} scenes: {mean:.2f} times the speed of {commit}")


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


if __name__ == "__main__":
    main()
