"""Steps of the study and their records; a step with a record is not repeated."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.records import code_hash, cpu_seconds, plain, stamp
from ii_core.base.json_lines import append_record, read_records
from metrics import provenance

FORMAT, VERSION = "ii-study-step", 1


@dataclass(frozen=True, kw_only=True)
class Step:
    """One experiment.

    Parameters
    ----------
    name : str
        Name for ``--only`` and of its record.
    shows : str
        Figures or tables that it reproduces.
    run : callable
        ``run(folder, **parameters)`` returns a dict of plain values and may write pictures NAME.png or NAME_more.png
        into the folder, named after the step. Names of times contain ``seconds``.
    parameters : dict
        Plain values.
    uses : tuple of str
        Further modules of ``benchmarks`` that the result depends on.
    """

    name: str
    shows: str
    run: Callable[..., dict[str, Any]]
    parameters: Mapping[str, Any] = field(default_factory=dict)
    uses: tuple[str, ...] = ()


def perform(steps: Iterable[Step], folder: Path, *, force: bool = False) -> list[dict[str, Any]]:
    """Run the steps without a record, one after the other; return their records.

    An interrupt keeps the records of finished steps.
    """
    folder.mkdir(parents=True, exist_ok=True)
    made = []
    for step in steps:
        print(f"{step.name}: {step.shows}", flush=True)
        before = known(step, folder)
        if before is not None and not force:
            print(f"  done {before['when']}, {before['seconds']:.0f} s", flush=True)
            continue
        record = performed(step, folder)
        if before is not None:
            record["repeats"] = findings(record) == findings(before)
        append_record(folder / f"{step.name}.jsonl", record)
        made.append(record)
        again = {True: ", the same to the bit", False: ", NOT the same as before", None: ""}[record.get("repeats")]
        print(f"  {record['seconds']:.0f} s{again}", flush=True)
    return made


def performed(step: Step, folder: Path) -> dict[str, Any]:
    """Run a step and return its record."""
    begin, started, cpu = stamp((step.run.__module__, *step.uses)), time.perf_counter(), cpu_seconds()
    for path in pictures_of(step, folder):
        path.unlink()  # remove pictures of an earlier version
    result = step.run(folder, **step.parameters)
    return {
        "format": FORMAT, "version": VERSION, "step": step.name, "shows": step.shows,
        "parameters": plain(step.parameters), **begin, "seconds": round(time.perf_counter() - started, 1),
        "cpu_seconds": round(cpu_seconds() - cpu, 1),
        "pictures": {path.name: digest_of(path) for path in pictures_of(step, folder)}, "result": plain(result),
    }  # fmt: skip


def pictures_of(step: Step, folder: Path) -> list[Path]:
    """Return the pictures of a step: NAME.png and NAME_more.png."""
    return sorted({*folder.glob(f"{step.name}.png"), *folder.glob(f"{step.name}_*.png")})


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def records(folder: Path, name: str) -> list[dict[str, Any]]:
    """Return all records of a step, oldest first.

    Raises
    ------
    ValueError
        If a line is not a record.
    """
    return read_records(folder / f"{name}.jsonl", FORMAT, VERSION)


def known(step: Step, folder: Path) -> dict[str, Any] | None:
    """Return the last record of a step by equal code, parameters and versions; None without one.

    Records with missing or changed pictures are ignored.
    """
    same = {"parameters": plain(step.parameters), "code": code_of(step), "versions": provenance()["versions"]}
    for record in reversed(records(folder, step.name)):
        if all(record[key] == value for key, value in same.items()) and all(
            (folder / name).exists() and digest_of(folder / name) == digest
            for name, digest in record["pictures"].items()
        ):
            return record
    return None


def findings(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return the reproducible part of a record: pictures, and numbers without times."""
    return {"pictures": record["pictures"], "result": timeless(record["result"])}


def timeless(value: Any) -> Any:
    """Return a value without entries named seconds."""
    if isinstance(value, dict):
        return {key: timeless(item) for key, item in value.items() if "seconds" not in key}
    return [timeless(item) for item in value] if isinstance(value, list) else value


def code_of(step: Step) -> str:
    """Return a hash of the code of a step: the packages and its modules."""
    return code_hash((step.run.__module__, *step.uses))
