"""`si-lf` by threads: wall time of coding and decoding, and peak memory beside the picture.

    python -m benchmarks run light_field_threads [--scale 4] [--scenes apples] [--schemes si-lf:fast] [--runs 3]

A small picture is coded first, to compile the kernels. Then one thread and two take turns ``runs`` times, at
quantiser 38; the table has medians of the ratio. The bytes must be the same. The machine must be idle: other programs
take time from two threads, not from one. Numbers go to ``benchmarks/results/light_field_threads.jsonl``, the table to
``docs/lf.md``.
"""

from __future__ import annotations

import time
from functools import partial
from statistics import median
from typing import Any

import numpy as np

from benchmarks.arguments import command_line
from benchmarks.coding.cost import peak, reset_peak
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin
from codec import decode, encode
from ii_core import IIPicture, preset
from raytrace_ii import load_scene, render

RECORDS = Records("light_field_threads", ("benchmarks.coding.light_field_threads", "benchmarks.coding.cost"))
SCENES, SCHEMES, SCALE, RUNS, THREADS, QP = ("apples", "cuboid"), ("si-lf",), 4, 3, (1, 2), 38


def main() -> None:
    """Measure, print, record and fill the table."""
    parser = command_line(__doc__, scale=SCALE, scenes=SCENES, schemes=SCHEMES)
    parser.add_argument("--runs", type=int, default=RUNS)
    asked = parser.parse_args()
    shared = {"scale": asked.scale, "runs": asked.runs}
    keys = [{"scene": scene, "scheme": scheme, **shared} for scheme in asked.schemes for scene in asked.scenes]
    for key in RECORDS.todo(keys, asked.again):
        picture = render(load_scene(key["scene"]), preset("setup1", scale=key["scale"])).picture
        print(RECORDS.measure(key, partial(measured, picture, key["scheme"], key["runs"]))["result"], flush=True)
    publish(tables())


def measured(picture: IIPicture, scheme: str, runs: int) -> dict[str, Any]:
    """Return seconds of each run by number of threads, and peaks of memory in pictures."""
    small = render(load_scene("apples"), preset("setup1", scale=32)).picture
    joint = "," if ":" in scheme else ":"
    named = {threads: f"{scheme}{joint}threads={threads}" for threads in THREADS}
    for name in named.values():
        decode(encode(small, name, qp=QP))
    found: dict[str, Any] = {}
    coded = {}
    for _ in range(runs):
        for threads, name in named.items():
            before, started = reset_peak(), time.perf_counter()
            coded[threads] = encode(picture, name, qp=QP)
            middle, grown = time.perf_counter(), peak() - before
            pixels = decode(coded[threads]).pixels
            found.setdefault(f"encode_{threads}", []).append(middle - started)
            found.setdefault(f"decode_{threads}", []).append(time.perf_counter() - middle)
            found[f"encode_peak_{threads}"] = max(
                found.get(f"encode_peak_{threads}", 0), grown / picture.pixels.nbytes
            )
            del pixels
    first = coded[THREADS[0]]
    if any(other.payload != first.payload for other in coded.values()):
        raise RuntimeError(f"{scheme}: the bytes depend on the number of threads")
    return {"bpp": first.bpp, "pixels": int(np.prod(picture.size)), **found}


def tables() -> Tables:
    """Return the table of docs/lf.md."""
    rows = RECORDS.rows()
    if not rows:
        return {("docs/lf.md", "lf-threads"): ["Not measured yet."]}
    lines = ["| picture | scheme | Mpixel | encode | decode | memory, pictures |", "|---|---|---|---|---|---|"]
    for row in rows:
        gains = [
            median(one / two for one, two in zip(row[f"{what}_1"], row[f"{what}_2"], strict=True))
            for what in ("encode", "decode")
        ]
        times = " | ".join(f"{gain:.2f}×" for gain in gains)
        peaks = f"{row['encode_peak_1']:.1f}, {row['encode_peak_2']:.1f}"
        lines.append(f"| {row['scene']} | `{row['scheme']}` | {row['pixels'] / 1e6:.1f} | {times} | {peaks} |")
    return {("docs/lf.md", "lf-threads"): [*lines, "", origin(rows)]}


if __name__ == "__main__":
    main()
