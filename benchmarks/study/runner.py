"""Steps, and their records: what is there is not done again, and nothing that was found is overwritten."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import math
import os
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

from ii_core.files import atomic_path
from metrics import provenance

FORMAT, VERSION = "ii-study-step", 1
ROOT = Path(__file__).parents[2]
# What the numbers come from, besides a step's own file. The page and its charts may change without undoing hours.
PACKAGES = ("ii_core", "raytrace_ii", "codec", "metrics", "assets")
SOURCES = (".py", ".toml", ".json", ".png", ".jpg")


@dataclass(frozen=True, kw_only=True)
class Step:
    """One experiment.

    Parameters
    ----------
    name : str
        What ``--only`` calls it, and its record is called.
    shows : str
        Which figures or tables it is for.
    run : callable
        ``run(folder, **parameters)`` gives a dict of plain values and may leave pictures in the folder, called
        NAME.png or NAME_more.png after the step. Values that are times have a name with ``seconds`` in it.
    parameters : dict
        Plain values.
    uses : tuple of str
        Modules of ``benchmarks`` that the result comes from besides the one that holds ``run``.
    """

    name: str
    shows: str
    run: Callable[..., dict[str, Any]]
    parameters: Mapping[str, Any] = field(default_factory=dict)
    uses: tuple[str, ...] = ()


def perform(steps: Iterable[Step], folder: Path, *, force: bool = False) -> list[dict[str, Any]]:
    """Do the steps that have not been done, one after the other, and say so; the records of those that were done now.

    Interrupted, it leaves the records of all steps that had ended.
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
        append(folder, record)
        made.append(record)
        again = {True: ", the same to the bit", False: ", NOT the same as before", None: ""}[record.get("repeats")]
        print(f"  {record['seconds']:.0f} s{again}", flush=True)
    return made


def performed(step: Step, folder: Path) -> dict[str, Any]:
    """Run a step; its record."""
    started, cpu, when = time.perf_counter(), cpu_seconds(), datetime.now(UTC).isoformat(timespec="seconds")
    for path in pictures_of(step, folder):
        path.unlink()  # what an earlier version left is not this one's
    result = step.run(folder, **step.parameters)
    return {
        "format": FORMAT,
        "version": VERSION,
        "step": step.name,
        "shows": step.shows,
        "parameters": plain(step.parameters),
        "code": code_of(step),
        **provenance(),
        "when": when,
        "seconds": round(time.perf_counter() - started, 1),
        "cpu_seconds": round(cpu_seconds() - cpu, 1),
        "pictures": {path.name: digest_of(path) for path in pictures_of(step, folder)},
        "result": plain(result),
    }


def cpu_seconds() -> float:
    """Of this process and of those it has waited for."""
    return sum(os.times()[:4])


def pictures_of(step: Step, folder: Path) -> list[Path]:
    """What it has left: NAME.png and NAME_more.png."""
    return sorted({*folder.glob(f"{step.name}.png"), *folder.glob(f"{step.name}_*.png")})


def digest_of(path: Path) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def append(folder: Path, record: Mapping[str, Any]) -> None:
    """Add a line to the step's file, which is whole at every moment."""
    path = folder / f"{record['step']}.jsonl"
    before = path.read_text(encoding="utf-8") if path.exists() else ""
    with atomic_path(path) as temporary:
        temporary.write_text(before + json.dumps(record, ensure_ascii=False) + "\n", encoding="utf-8")


def records(folder: Path, name: str) -> list[dict[str, Any]]:
    """All records of a step, oldest first.

    Raises
    ------
    ValueError
        If a line is no record.
    """
    path = folder / f"{name}.jsonl"
    if not path.exists():
        return []
    found = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        try:
            record = json.loads(line)
        except ValueError as error:
            raise ValueError(f"{path}, line {number}: {error}") from None
        if not isinstance(record, dict) or (record.get("format"), record.get("version")) != (FORMAT, VERSION):
            raise ValueError(f'{path}, line {number}: no record: needs "format": "{FORMAT}", "version": {VERSION}')
        found.append(record)
    return found


def known(step: Step, folder: Path) -> dict[str, Any] | None:
    """The last record of this step by the same code, with the same parameters and versions; None if there is none.

    A record whose pictures are gone, or are others now, does not count.
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
    """What must be the same when a step is done again: pictures and numbers, but for times."""
    return {"pictures": record["pictures"], "result": timeless(record["result"])}


def timeless(value: Any) -> Any:
    """The value without anything named seconds."""
    if isinstance(value, dict):
        return {key: timeless(item) for key, item in value.items() if "seconds" not in key}
    return [timeless(item) for item in value] if isinstance(value, list) else value


def code_of(step: Step) -> str:
    """A hash of all that a step's result comes from: the packages and the files of the step itself."""
    digest = hashlib.sha256(_packages().encode())
    for module in (step.run.__module__, *step.uses):
        found = importlib.util.find_spec(module)
        if found is None or found.origin is None:
            raise ValueError(f"step {step.name} comes from {module}, which is not there")
        origin = Path(found.origin)
        for path in sorted(origin.parent.glob("*.py")) if origin.name == "__init__.py" else [origin]:
            digest.update(path.read_bytes())
    return digest.hexdigest()


@lru_cache(maxsize=1)
def _packages() -> str:
    digest = hashlib.sha256()
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*")):
            if path.suffix in SOURCES and path.is_file():
                digest.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def plain(value: Any) -> Any:
    """As JSON gives it back: lists for tuples, text for infinities, None for what is not a number."""
    return json.loads(json.dumps(_spelt(value)))


def _spelt(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _spelt(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_spelt(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else str(value)
    return value


def number(value: Any) -> float:
    """A number that `plain` has spelt."""
    return math.nan if value is None else float(value)
