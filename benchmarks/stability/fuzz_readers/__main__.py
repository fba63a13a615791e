"""Structure-aware fuzzing of every reader.

    python -m benchmarks run fuzz_readers [--cases 20000] [--workers 2] [--readers "sidecar;PLY"] [--seed 0]
    python -m benchmarks run fuzz_readers --reader PLY --only 4711 --keep FOLDER

A case is made from (reader, seed, number) alone: a valid file whose values, lengths, counts, types, lines or bytes
are changed. Reading it must end in a valid object or in one line of ValueError, OSError, or a TypeError that our own
code raises, in 10 s of CPU time and 2 GB of memory. Anything else is a finding, kept with its number. Cases run in
worker processes, so that crashes are recorded. A row per reader is appended to
``benchmarks/results/fuzz_readers.jsonl``.
"""

from __future__ import annotations

import argparse
import json
import logging
import resource
import tempfile
import traceback
import warnings
import zlib
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.arguments import command_line
from benchmarks.coding.fuzz import cpu_seconds
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import ROOT, Records, origin
from benchmarks.workers import cases

from . import captured as captured  # registers its readers
from . import measurements as measurements  # registers its readers
from . import takes as takes  # registers its readers
from .readers import READERS, Read

RECORDS = Records(
    "fuzz_readers", ("benchmarks.stability.fuzz_readers", "benchmarks.coding.fuzz", "benchmarks.workers")
)
GOOD = "object", "refused"
SLOW_SECONDS, MANY_MEGABYTES = 1, 50  # readers have a row of their own on the page from these on
MOST_SECONDS = 10  # CPU seconds per case
MOST_BYTES = 2 << 30  # bytes of memory per case
MOST_TEXT = 1000  # characters of a message
MOST_FINDINGS = 50  # findings of a reader after which no new worker is started


def main() -> None:
    """Run all readers, or one case."""
    parser = command_line(__doc__)
    parser.add_argument("--cases", type=int, default=20000, help="of each reader")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--readers", help="names, separated by semicolons; all if not given")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--reader", choices=READERS, help="run in this process, without records")
    parser.add_argument("--range", type=int, nargs=2, help=argparse.SUPPRESS)
    parser.add_argument("--only", type=int, help="one case of --reader, with its traceback")
    parser.add_argument("--keep", type=Path, help="folder for the files of this case")
    arguments = parser.parse_args()
    if arguments.only is not None:
        with tempfile.TemporaryDirectory() as folder:
            kept = arguments.keep or Path(folder)
            kept.mkdir(parents=True, exist_ok=True)
            print(case(arguments.reader, arguments.seed, arguments.only, kept)())
        return
    if arguments.reader:
        work(arguments.reader, arguments.seed, *arguments.range)
        return
    names = arguments.readers.split(";") if arguments.readers else list(READERS)
    if unknown := set(names) - set(READERS):
        parser.error(f"no reader {min(unknown)!r}: known are {', '.join(READERS)}")
    keys = [{"reader": name, "seed": arguments.seed, "cases": arguments.cases} for name in names]

    def row(key: dict[str, Any]) -> None:
        record = RECORDS.measure(key, lambda: watched(key["reader"], key["seed"], key["cases"]))
        print(f"{key['reader']}: {record['result']}", flush=True)

    pool = ThreadPoolExecutor(arguments.workers)
    try:
        for future in [pool.submit(row, key) for key in RECORDS.todo(keys, arguments.again)]:
            future.result()
    finally:
        pool.shutdown(cancel_futures=True)
    publish(tables())


def tables() -> Tables:
    """Return the table of the page of stability."""
    rows = {row["reader"]: row for row in RECORDS.rows()}  # the newest number of cases of each reader
    if not rows:
        return {("docs/stability.md", "fuzz-readers"): []}
    usual = max(sum(row["counts"].values()) for row in rows.values())
    lines = ["| reader | findings | longest, CPU s | most memory, MB |", "|---|---|---|---|"]
    rest = []
    for reader, row in rows.items():
        cases = sum(row["counts"].values())
        findings = cases - sum(row["counts"].get(kind, 0) for kind in GOOD)
        name = reader if cases == usual else f"{reader} ({cases} cases)"
        seconds, megabytes = row["longest_seconds"], row["most_megabytes"]
        if findings or seconds >= SLOW_SECONDS or megabytes >= MANY_MEGABYTES:
            lines.append(f"| {name} | {findings} | {seconds:.2f} | {megabytes:.0f} |")
        else:
            rest.append(name)
    said = f"No findings, less than {SLOW_SECONDS} s and {MANY_MEGABYTES} MB: {'; '.join(rest)}."
    lines += ["", said, f"{usual} cases a reader. {origin(rows.values())}"]
    return {("docs/stability.md", "fuzz-readers"): lines}


def watched(name: str, seed: int, count: int) -> dict[str, Any]:
    """Run all cases of a reader; a worker that dies is started again."""
    counts: Counter[str] = Counter()
    findings: list[dict[str, Any]] = []
    longest, most = 0.0, 0.0
    for end in cases("benchmarks.stability.fuzz_readers", ("--reader", name, "--seed", str(seed)), count):
        counts[end.what.partition(":")[0]] += 1
        longest, most = max(longest, end.seconds), max(most, end.megabytes)
        if end.what not in GOOD:
            findings.append(end.finding)
        if end.said is not None and len(findings) > MOST_FINDINGS:
            break
    return {"counts": dict(counts), "longest_seconds": longest, "most_megabytes": most, "findings": findings}


def work(name: str, seed: int, first: int, last: int) -> None:
    """Run cases by number, a line of JSON for each; the system kills the process at a limit of CPU time."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with tempfile.TemporaryDirectory() as folder:
        for number in range(-2, 0):  # unrecorded first cases: imports and compilation count for no case
            outcome(case(name, seed, number, Path(folder)))
        room = _address_space() + MOST_BYTES
        resource.setrlimit(resource.RLIMIT_AS, (room, room))
        for number in range(first, last):
            read = case(name, seed, number, Path(folder))
            before, started = _peak(reset=True), cpu_seconds()
            resource.setrlimit(resource.RLIMIT_CPU, (int(started) + 1 + MOST_SECONDS, resource.RLIM_INFINITY))
            what = outcome(read)
            took, more = cpu_seconds() - started, (_peak() - before) / 1e6
            print(json.dumps([number, what, round(took, 3), round(more, 1)]), flush=True)


def case(name: str, seed: int, number: int, folder: Path) -> Read:
    """Write the files of a case into a folder and return the call that reads them."""
    rng = np.random.default_rng((seed, zlib.crc32(name.encode()), number + 2))
    return READERS[name](rng, folder)


class _Printed(logging.Handler):
    """Collect the lines that `logging` would print without a handler."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Store a line."""
        self.lines.append(f"{record.name}: {record.getMessage()[:150]}")


def outcome(read: Read) -> str:
    """Return "object", "refused", or a finding: an error, or a line of a library's log on the screen."""
    before, logging.lastResort = logging.lastResort, (printed := _Printed())
    try:
        end = _end(read)
    finally:
        logging.lastResort = before
    return f"printed: {printed.lines[0]}" if printed.lines else end


def _end(read: Read) -> str:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            read()
    except (ValueError, OSError) as error:
        return _worded(error)
    except TypeError as error:
        frame = traceback.extract_tb(error.__traceback__)[-1]
        ours = (frame.line or "").startswith("raise TypeError") and Path(frame.filename).is_relative_to(ROOT)
        return _worded(error) if ours else f"error: {_said(error)}"
    except Exception as error:
        return f"error: {_said(error)}"
    return "object"


def _worded(error: Exception) -> str:
    text = str(error)
    if "\n" in text or not text.strip():
        return f"wording: {_said(error)}"
    return f"long: {_said(error)}" if len(text) > MOST_TEXT else "refused"


def _said(error: Exception) -> str:
    frame = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__} in {Path(frame.filename).name}, {frame.name}: {str(error)[:150]!r}"


def _address_space() -> int:
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()


def _peak(*, reset: bool = False) -> int:
    """Return the process's peak of resident memory, bytes, since it was last reset."""
    if reset:
        Path("/proc/self/clear_refs").write_text("5")
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmHWM:")[2].split()[0]) * 1024


if __name__ == "__main__":
    main()
