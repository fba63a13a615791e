"""Registry of benchmarks: module, needs, cost by its records, and what each writes."""

from __future__ import annotations

import ast
import importlib
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.records import RESULTS, ROOT, seconds_in

LEAST = 6.0  # seconds: a shorter sum is of single calls, not of the run


@dataclass(frozen=True, kw_only=True)
class Benchmark:
    """One program that measures, or that fills pages.

    Parameters
    ----------
    module : str
        Dotted name; its last part is the benchmark's name, that of a package its own.
    needs : str
        Programs and files beyond the packages of ``make test``.
    records : str
        Glob pattern of its files in ``benchmarks/results``.
    writes : tuple of str
        Pages and pictures, as glob patterns from the root.
    tables : str
        Module with ``tables()``, if it fills tables of pages.
    """

    module: str
    needs: str = ""
    records: str = ""
    writes: tuple[str, ...] = ()
    tables: str = ""

    @property
    def name(self) -> str:
        """Name on the command line."""
        return self.module.rpartition(".")[2]

    @property
    def room(self) -> str:
        """Folder in ``benchmarks``."""
        return self.module.split(".")[1]

    def summary(self) -> str:
        """Return the first line of the module's documentation; nothing is imported."""
        text = ast.get_docstring(ast.parse(source(self.module).read_text(encoding="utf-8"))) or ""
        return text.partition("\n")[0].partition(": ``python")[0]

    def result_files(self) -> list[Path]:
        """Return its files in ``benchmarks/results``."""
        return sorted(RESULTS.glob(self.records)) if self.records else []

    def minutes(self) -> tuple[float, bool] | None:
        """Return the minutes of its newest records, and whether that is only a lower bound; None without times.

        CPU time where a record has it, else the time by the clock of the row, else the sum of times that the row
        itself reports, which leaves out rendering and searching.
        """
        total, bound = 0.0, False
        for path in self.result_files():
            if path.suffix == ".jsonl":
                for record in newest(path):
                    spent = record.get("cpu_seconds") or record.get("seconds")
                    bound |= spent is None
                    total += sum(seconds_in(record["result"])) if spent is None else spent
        return (total / 60, bound) if total > LEAST else None

    def run(self, arguments: Sequence[str]) -> None:
        """Run its ``main`` with a command line."""
        before = sys.argv
        sys.argv = [f"python -m benchmarks run {self.name}", *arguments]
        try:
            importlib.import_module(entry(self.module)).main()
        finally:
            sys.argv = before


def newest(path: Path) -> list[Mapping[str, Any]]:
    """Return the last record of each key of a file, of each step and size for those of the study."""
    found = {}
    for line in path.read_text(encoding="utf-8").splitlines():
        record = json.loads(line)
        found[json.dumps(record.get("key", record.get("parameters")), sort_keys=True)] = record
    return list(found.values())


def entry(module: str) -> str:
    """Return the module with ``main``: that of a package is its ``__main__``."""
    return f"{module}.__main__" if source(module).name == "__init__.py" else module


def source(module: str) -> Path:
    """Return the file of a module of this tree."""
    path = ROOT.joinpath(*module.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


HISTORY, BROWSER = "git history with b1dc540", "chromium and playwright"
IMAGES = "docs/images"
# In the order in which the whole study runs them: pages after the measurements that they show.
BENCHMARKS = {
    benchmark.name: benchmark
    for benchmark in (
        Benchmark(
            module="benchmarks.pages.cameras", writes=("docs/cameras.md", f"{IMAGES}/cameras/*", f"{IMAGES}/scenes.*")
        ),
        Benchmark(module="benchmarks.pages.concepts", writes=(f"{IMAGES}/concepts/*",)),
        Benchmark(
            module="benchmarks.accuracy.camera_in_scene",
            records="camera_in_scene.jsonl",
            writes=(f"{IMAGES}/camera_in_scene.*",),
        ),
        Benchmark(module="benchmarks.coding.disparity", records="disparity.jsonl"),
        Benchmark(
            module="benchmarks.coding.orders",
            records="orders.jsonl",
            writes=("docs/structure.md",),
            tables="benchmarks.coding.orders",
        ),
        Benchmark(
            module="benchmarks.coding.headers",
            records="headers.jsonl",
            writes=("docs/structure.md",),
            tables="benchmarks.coding.headers",
        ),
        Benchmark(
            module="benchmarks.coding.cost",
            records="cost.jsonl",
            writes=("docs/structure.md",),
            tables="benchmarks.coding.cost",
        ),
        Benchmark(module="benchmarks.coding.coders", records="coders.jsonl"),
        Benchmark(module="benchmarks.coding.bframes", records="bframes.jsonl"),
        Benchmark(
            module="benchmarks.pages.coding_docs",
            needs="records of coders and bframes",
            writes=(
                "docs/coding.md",
                "docs/speed_accuracy.md",
                f"{IMAGES}/coders*",
            ),
            tables="benchmarks.pages.coding_docs",
        ),
        Benchmark(
            module="benchmarks.coding.volume",
            records="volume.jsonl",
            writes=("docs/volume.md",),
            tables="benchmarks.coding.volume",
        ),
        Benchmark(
            module="benchmarks.coding.light_field",
            records="light_field.jsonl",
            writes=("docs/lf.md",),
            tables="benchmarks.coding.light_field",
        ),
        Benchmark(
            module="benchmarks.coding.fuzz",
            records="fuzz.jsonl",
            writes=("docs/formats.md",),
            tables="benchmarks.coding.fuzz",
        ),
        Benchmark(module="benchmarks.pages.make_textures", writes=("assets/textures/*",)),
        Benchmark(
            module="benchmarks.stability.fuzz_readers",
            records="fuzz_readers.jsonl",
            writes=("docs/stability.md",),
            tables="benchmarks.stability.fuzz_readers.__main__",
        ),
        Benchmark(module="benchmarks.pages.focus_patterns", writes=(f"{IMAGES}/focus_patterns.*",)),
        Benchmark(
            module="benchmarks.pages.metrics_gallery", records="metrics_study.json", writes=(f"{IMAGES}/metrics/*",)
        ),
        Benchmark(
            module="benchmarks.accuracy.depth_truth",
            records="depth_truth.jsonl",
            writes=(
                "docs/metrics.md",
                f"{IMAGES}/depth_truth.*",
            ),
            tables="benchmarks.accuracy.depth_truth",
        ),
        Benchmark(
            module="benchmarks.accuracy.map_precision",
            records="map_precision.jsonl",
            writes=(f"{IMAGES}/map_precision.*",),
        ),
        Benchmark(
            module="benchmarks.accuracy.convergence",
            records="convergence.jsonl",
            writes=(f"{IMAGES}/convergence.*",),
        ),
        Benchmark(
            module="benchmarks.accuracy.povray",
            needs="povray",
            records="povray.jsonl",
            writes=(
                "docs/stability.md",
                f"{IMAGES}/povray.*",
            ),
            tables="benchmarks.accuracy.povray",
        ),
        Benchmark(
            module="benchmarks.stability",
            needs="records of convergence, map_precision and depth_truth",
            records="stability.jsonl",
            writes=(
                "docs/stability.md",
                f"{IMAGES}/stability*",
            ),
            tables="benchmarks.stability.__main__",
        ),
        Benchmark(
            module="benchmarks.speed.pareto",
            needs="records of map_precision",
            records="pareto.jsonl",
            writes=(
                "docs/speed_accuracy.md",
                f"{IMAGES}/pareto.*",
            ),
            tables="benchmarks.speed.pareto",
        ),
        Benchmark(
            module="benchmarks.speed.needs",
            records="needs.jsonl",
            writes=(
                "docs/speed_accuracy.md",
                f"{IMAGES}/needs.*",
            ),
            tables="benchmarks.speed.needs",
        ),
        Benchmark(
            module="benchmarks.speed.texture_filter",
            records="texture_filter.jsonl",
            writes=("docs/speed_accuracy.md", f"{IMAGES}/texture_filter.*"),
            tables="benchmarks.speed.texture_filter",
        ),
        Benchmark(
            module="benchmarks.speed.metrics_speed",
            records="metrics_speed.jsonl",
            writes=(
                "docs/metrics.md",
                "docs/speed_accuracy.md",
                f"{IMAGES}/depth_cost.*",
                f"{IMAGES}/depth_pareto.*",
            ),
            tables="benchmarks.speed.metrics_speed",
        ),
        Benchmark(module="benchmarks.speed.ratios", needs=HISTORY, records="speed.jsonl"),
        Benchmark(module="benchmarks.speed.before_after", needs="git history", records="before_after.jsonl"),
        Benchmark(module="benchmarks.speed.viewer", needs=BROWSER, records="viewer.json", writes=("docs/viewer.md",)),
        Benchmark(module="benchmarks.pages.gallery", needs=f"{BROWSER} for --stills", writes=("docs/gallery/*",)),
        Benchmark(
            module="benchmarks.pages.readme",
            needs="out/demo and out/full of examples/demo.py; records of disparity and ratios",
            records="*_rd.json",
            writes=(
                "README.md",
                "docs/study.md",
                f"{IMAGES}/apples_*",
                f"{IMAGES}/cuboid_*",
                f"{IMAGES}/demo_*",
                f"{IMAGES}/full_*",
            ),
            tables="benchmarks.pages.readme",
        ),
        Benchmark(
            module="benchmarks.study",
            needs="records of coders",
            records="study/*.jsonl",
            writes=(
                "docs/study.md",
                f"{IMAGES}/study/*",
            ),
            tables="benchmarks.study.page",
        ),
        Benchmark(module="benchmarks.pages.tables", needs="records of all others"),
    )
}
