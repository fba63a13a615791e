"""Wrong calls of every public function: each argument in turn is of another type or out of range.

    python -m benchmarks run wrong_calls [--only q_global]

A call must succeed, or raise TypeError or ValueError that names the argument, or OSError if the value is a path.
Other errors are accidental: raised inside, about a value that the caller did not write. A row is
appended to ``benchmarks/results/wrong_calls.jsonl``.
"""

from __future__ import annotations

import inspect
import os
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import codec
import ii_core
import metrics
import raytrace_ii
from benchmarks.arguments import command_line
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin
from ii_core.camera import glass, optics, prescriptions, surfaces
from ii_core.waves import spread, spread_files, wave
from metrics import observers
from metrics.observers import simulated
from metrics.plots import opinion_chart

from .attack import WRONG, attack
from .coding import codec_calls
from .core import core_calls
from .displays import display_calls
from .good import Call
from .lenses import lens_calls
from .moving import take_calls
from .people import observer_calls
from .quality import metrics_calls
from .tracing import raytrace_calls

RECORDS = Records("wrong_calls", ("benchmarks.stability.wrong_calls",))
PACKAGES = (ii_core, codec, metrics, raytrace_ii, observers)
# Modules with a page of the API, besides the packages.
MODULES = (wave, spread, spread_files, optics, surfaces, glass, prescriptions, simulated, opinion_chart)
# Classes that nobody makes: results, bases, errors, elements without values. Functions that get checked elements.
UNTRIED = {
    "chain", "placed", "scaled_chain", "surfaces_of", "unit_disk",
    "AccessCost", "AngleQuality", "Audit", "Calibration", "Camera", "Coder", "CodingResult", "DamagedTake",
    "DecodedView", "DepthQuality", "EmbeddedViewer", "EyeImage", "FocusDepth", "Goal", "Grin", "Judged", "Lenticular",
    "MapCamera", "NoLenses", "Observer", "OpinionScores", "PairScale", "PanelDesign", "Paraxial", "Pinhole",
    "Prediction", "Prescription", "Report", "Results", "Rig", "Run", "Shot", "SpreadMaps", "Stage", "Stats", "Take",
    "TakeFloor", "TakeQuality", "Verdict", "ViewQuality", "ViewingZone",
}  # fmt: skip


def calls(folder: Path) -> dict[str, Call]:
    """Return a good call of every public function, class and method by name; files are in a folder."""
    return {
        **core_calls(folder), **display_calls(), **codec_calls(folder), **metrics_calls(folder),
        **raytrace_calls(folder), **take_calls(folder), **lens_calls(folder), **observer_calls(folder),
    }  # fmt: skip


def untried(named: Mapping[str, Call]) -> list[str]:
    """Return the public functions and their arguments that no call has."""
    tried = [(call.function, set(call.good)) for call in named.values()]
    missing = []
    for name, function in public():
        if name in UNTRIED:
            continue
        if inspect.isfunction(function):
            wanted = {p.name for p in inspect.signature(function).parameters.values() if p.kind is not p.VAR_KEYWORD}
            known = set().union(*(good for tried_one, good in tried if tried_one == function))
            missing += [f"{name}({argument})" for argument in sorted(wanted - known)]
        elif all(one is not function for one, _ in tried):
            missing.append(name)
    return missing


def public() -> Iterator[tuple[str, Any]]:
    """Yield name and object of each public function and class: those of the packages, and of the pages of the API."""
    for package in PACKAGES:
        yield from ((name, getattr(package, name)) for name in package.__all__ if callable(getattr(package, name)))
    for module in MODULES:
        for name, found in vars(module).items():
            own = not name.startswith("_") and getattr(found, "__module__", "") == module.__name__
            if own and (inspect.isfunction(found) or inspect.isclass(found)):
                yield name, found


def main() -> None:
    """Attack all, print accidental errors, append the row."""
    parser = command_line(__doc__)
    parser.add_argument("--only", help="one function, without a record")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)  # relative names write here
        named = calls(Path(folder))
        if arguments.only:
            named = {name: call for name, call in named.items() if name == arguments.only}
        found: list[str] = []

        def measure() -> dict[str, Any]:
            counts, lines = attack(named, WRONG)
            found.extend(lines)
            return {"functions": len(named), "counts": dict(counts), "findings": lines[:50]}

        if arguments.only:
            print(measure()["counts"])
        for key in [] if arguments.only else RECORDS.todo([{"values": len(WRONG)}], arguments.again):
            print(RECORDS.measure(key, measure)["result"]["counts"])
        os.chdir("/")
    print("\n".join(found))
    if not arguments.only:
        publish(tables())


def tables() -> Tables:
    """Return the sentence of the page of stability."""
    rows = RECORDS.rows()[-1:]
    if not rows:
        return {("docs/stability.md", "wrong-calls"): []}
    counts = rows[0]["counts"]
    line = (
        f"{rows[0]['functions']} functions, classes and methods, each argument with {len(WRONG)} wrong values: "
        f"{sum(counts.values())} calls, {counts.get('refused', 0)} refused by name, {counts.get('path', 0)} missing "
        f"files, {counts.get('taken', 0)} values that were right, {counts.get('accidental', 0)} accidental errors."
    )
    return {("docs/stability.md", "wrong-calls"): [line, "", origin(rows)]}
