"""Registry of benchmarks: module, needs, cost by records, outputs."""

from __future__ import annotations

import ast
import importlib
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Any

from benchmarks.records import RESULTS, ROOT, key_of, seconds_in
from ii_core.base.json_lines import lines_of

LEAST = 6.0  # seconds: shorter sums are times of single calls, not of the run
OWN = "NAME.jsonl"  # stands for the file of the benchmark's name


@dataclass(frozen=True)
class Benchmark:
    """One program that measures, or that fills pages.

    Parameters
    ----------
    path : str
        Dotted name of the module or package in ``benchmarks``; its last part is the benchmark's name.
    needs : str
        Programs and files beyond the packages of ``make test``.
    records : str
        Glob pattern of its files in ``benchmarks/results``; `OWN` is ``NAME.jsonl``.
    fills : tuple of str
        Pages whose tables its ``tables()`` returns.
    writes : tuple of str
        Other pages and pictures, as glob patterns from the root.
    tables_in : str
        Module with ``tables()``; that of ``main`` if not given.
    """

    path: str
    _: KW_ONLY
    needs: str = ""
    records: str = ""
    fills: tuple[str, ...] = ()
    writes: tuple[str, ...] = ()
    tables_in: str = ""

    @property
    def module(self) -> str:
        """Dotted name of the module or package."""
        return f"benchmarks.{self.path}"

    @property
    def name(self) -> str:
        """Name on the command line."""
        return self.path.rpartition(".")[2]

    @property
    def room(self) -> str:
        """Folder in ``benchmarks``."""
        return self.path.split(".")[0]

    @property
    def pattern(self) -> str:
        """Glob pattern of its files in ``benchmarks/results``."""
        return f"{self.name}.jsonl" if self.records == OWN else self.records

    @property
    def outputs(self) -> tuple[str, ...]:
        """All pages and pictures that it changes."""
        return self.fills + self.writes

    @property
    def tables(self) -> str:
        """Module with ``tables()``; empty if it fills no page."""
        if not self.fills:
            return ""
        return f"benchmarks.{self.tables_in}" if self.tables_in else entry(self.module)

    def summary(self) -> str:
        """Return the first line of the module's documentation; nothing is imported."""
        text = ast.get_docstring(ast.parse(source(self.module).read_text(encoding="utf-8"))) or ""
        return text.partition("\n")[0].partition(": ``python")[0]

    def result_files(self) -> list[Path]:
        """Return its files in ``benchmarks/results``."""
        return sorted(RESULTS.glob(self.pattern)) if self.records else []

    def minutes(self) -> tuple[float, bool] | None:
        """Return the minutes of its newest records, and whether that is only a lower bound; None without times.

        CPU time if the record has it, else wall-clock time, else the sum of the times in the result, which excludes
        rendering and search.
        """
        total, bound = 0.0, False
        for path in self.result_files():
            if ".jsonl" in path.suffixes:
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
    """Return the last record of each key of a file."""
    return list({key_of(record): record for record in map(json.loads, lines_of(path))}.values())


def entry(module: str) -> str:
    """Return the module with ``main``: that of a package is its ``__main__``."""
    return f"{module}.__main__" if source(module).name == "__init__.py" else module


def source(module: str) -> Path:
    """Return the file of a module of this tree."""
    path = ROOT.joinpath(*module.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


IMAGES = "docs/images"
# Closed experiments, whose figures stay on pages, by the last commit with their scripts and records.
CLOSED: dict[str, tuple[str, ...]] = {
    "018e29e": (
        "accuracy/eye_views", "coding/crossing", "coding/light_field_bounds", "coding/light_field_threads",
        "coding/neighbours", "pages/concepts", "pages/display_pictures", "pages/focus_patterns",
        "pages/make_textures", "speed/before_after", "speed/feature_ablation", "speed/take_cost",
        "speed/texture_filter", "stability/install", "study/reasons", "study/volume_model",
    ),
    "58549fc": (
        "accuracy/camera_in_scene", "accuracy/field_depth", "accuracy/lens_rays", "coding/bframes", "coding/cost",
        "coding/disparity", "coding/headers", "coding/orders", "coding/volume", "pages/metrics_gallery",
        "pages/video", "speed/eye", "speed/viewer", "stability/pictures",
    ),
    "eab643c": ("accuracy/lens_setup1",),
    "85f29ab": ("accuracy/map_precision", "accuracy/waves"),
}  # fmt: skip
# Pictures of closed experiments.
KEPT = (
    *(f"{IMAGES}/concepts/{n}.png" for n in ("components", "maps", "pixels", "rays", "sequence", "views")),
    f"{IMAGES}/display_eye.webp", f"{IMAGES}/display_zones.png", f"{IMAGES}/stability_pictures.webp",
    f"{IMAGES}/stability_pictures_2.webp", f"{IMAGES}/takes_frames.webp", f"{IMAGES}/takes_time.png",
    f"{IMAGES}/waves.png",
    *(f"{IMAGES}/metrics/{n}" for n in ("errors_depth.webp", "errors_views.jpg", "q_angle.png", "q_depth_rate.png",
        "views.webp")),
)  # fmt: skip
STABLE, SPEED = "docs/stability.md", "docs/speed_accuracy.md"
HISTORY = "git history with b1dc540"
# In the order of a whole study: pages after the measurements that they show.
BENCHMARKS = {
    benchmark.name: benchmark
    for benchmark in (
        Benchmark("pages.cameras", writes=("docs/cameras.md", f"{IMAGES}/cameras/*", f"{IMAGES}/scenes.*")),
        Benchmark("accuracy.sample_places", records=OWN, fills=("docs/speed_accuracy.md",)),
        Benchmark("accuracy.edges", records=OWN, fills=("docs/speed_accuracy.md",), writes=(f"{IMAGES}/edges.png",)),
        Benchmark("accuracy.calibration", records=OWN, fills=("docs/calibration.md",)),
        Benchmark(
            "accuracy.moire", records=OWN, fills=("docs/display.md",), writes=(f"{IMAGES}/display_moire.webp",)
        ),
        Benchmark("accuracy.demosaicing", records=OWN, fills=("docs/calibration.md",)),
        Benchmark(
            "accuracy.real_lenses", records=OWN, fills=("docs/real_lenses.md",), writes=(f"{IMAGES}/real_lenses.*",)
        ),
        Benchmark("coding.coders", records=OWN),
        Benchmark("pages.coding_docs", needs="records of coders", fills=("docs/coding.md", SPEED),
            writes=(f"{IMAGES}/coders*",)),
        Benchmark("coding.takes", records=OWN, fills=("docs/video.md",), writes=(f"{IMAGES}/takes_access.*",)),
        Benchmark("coding.light_field", records=OWN, fills=("docs/lf.md",)),
        Benchmark("coding.anchors", needs="imageio-ffmpeg, and the photographs of the benchmark", records=OWN,
            fills=("docs/benchmark.md",)),
        Benchmark("coding.learnt_filter", needs="photographs in JPEG: --pictures FOLDER",
            writes=("assets/learnt_filter.npy",)),
        Benchmark("coding.jplm", needs="jpl-encoder-bin and jpl-decoder-bin", records=OWN, fills=("docs/lf.md",)),
        Benchmark("coding.fuzz", records=OWN, fills=("docs/formats.md",)),
        Benchmark("stability.fuzz_readers", records=OWN, fills=("docs/stability.md",)),
        Benchmark("stability.wrong_calls", records=OWN, fills=("docs/stability.md",)),
        Benchmark("accuracy.depth_truth", records=OWN, fills=("docs/metrics.md",),
            writes=(f"{IMAGES}/depth_truth.*",)),
        Benchmark("accuracy.estimated_depth", records=OWN, fills=("docs/depth.md",),
            writes=(f"{IMAGES}/depth.webp",)),
        Benchmark("accuracy.depth_confidence"),
        Benchmark("accuracy.depth_methods", needs="OpenCV, published fields: optional", records=OWN,
            fills=("docs/depth.md",), writes=(f"{IMAGES}/depth_methods.svg",)),
        Benchmark("accuracy.convergence", records=OWN, writes=(f"{IMAGES}/convergence.*",)),
        Benchmark(
            "accuracy.povray",
            needs="povray",
            records=OWN,
            fills=("docs/stability.md",),
            writes=(f"{IMAGES}/povray.*",),
        ),
        Benchmark(
            "stability",
            needs="records of convergence and depth_truth",
            records=OWN,
            fills=("docs/stability.md",),
            writes=(f"{IMAGES}/stability.*",),
        ),
        Benchmark(
            "speed.pareto",
            records=OWN,
            fills=("docs/speed_accuracy.md",),
            writes=(f"{IMAGES}/pareto.*", f"{IMAGES}/pareto_fine.*"),
        ),
        Benchmark(
            "speed.metrics_speed",
            records=OWN,
            fills=("docs/speed_accuracy.md",),
            writes=(f"{IMAGES}/depth_pareto.*",),
        ),
        Benchmark("speed.ratios", needs=HISTORY, records="speed.jsonl"),
        Benchmark("speed.commits", needs=HISTORY, records="commits.jsonl"),
        Benchmark("speed.mitsuba", needs="Mitsuba 3 and an LLVM library", records=OWN),
        Benchmark("pages.notebooks", needs="the extra notebooks", writes=("examples/*.ipynb",)),
        Benchmark("pages.hero", writes=(f"{IMAGES}/apples.webp",)),
        Benchmark("pages.gallery", writes=("docs/gallery/*",)),
        Benchmark(
            "pages.readme",
            needs="out/demo of examples/demo.py; records of the coders, ratios, Mitsuba and POV-Ray",
            fills=("README.md", "docs/speed_accuracy.md"),
            writes=(f"{IMAGES}/apples_*", f"{IMAGES}/demo_*"),
        ),
        Benchmark(
            "study",
            needs="records of coders",
            records="study.jsonl.gz",
            fills=("docs/study.md",),
            tables_in="study.page",
            writes=(f"{IMAGES}/study/*",),
        ),
        Benchmark("pages.data_card", fills=("docs/benchmark.md",)),
        Benchmark("pages.tables", needs="records of all others"),
    )
}  # fmt: skip
