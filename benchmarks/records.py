"""Append-only records of benchmarks: every row has its own commit, machine, versions and date.

A record is a line of JSON in ``benchmarks/results/NAME.jsonl``. The script that measures a row appends it when its
measurement ends, and no line is changed afterwards. Readers take the newest record of each key; `prune` removes the
older ones, which git keeps. `check` verifies these rules.
"""

from __future__ import annotations

import gzip
import hashlib
import importlib.util
import json
import math
import os
import subprocess
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from ii_core.base.atomic import atomic_path
from ii_core.base.identity import source_hash
from ii_core.base.json_lines import append_record, lines_of, read_records
from metrics import provenance

Record = dict[str, Any]
FORMAT, VERSION = "ii-record", 1
ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "benchmarks" / "results"
STAMP = ("code", "git", "machine", "versions", "when")
FIELDS = ("key", *STAMP, "seconds", "result")
# Packages that determine every number, besides the modules of the benchmark itself; pages and charts are excluded.
PACKAGES = ("ii_core", "raytrace_ii", "codec", "metrics", "assets")
SOURCES = (".py", ".toml", ".json", ".png", ".jpg")
NAMED = 6  # commits that a page names one by one
CHANGED, MISSING, ALL = AGAIN = ("changed", "missing", "all")


@dataclass(frozen=True)
class Records:
    """The records of one benchmark.

    Parameters
    ----------
    name : str
        Name of the file in ``benchmarks/results``, without its ending.
    modules : tuple of str
        Modules of ``benchmarks`` that compute the results.
    """

    name: str
    modules: tuple[str, ...]

    @property
    def path(self) -> Path:
        """Path of the file."""
        return RESULTS / f"{self.name}.jsonl"

    def measure(self, key: Mapping[str, Any], call: Callable[[], Mapping[str, Any]]) -> Record:
        """Run a measurement and append its record; values that are not finite become null.

        Raises
        ------
        RuntimeError
            If sources changed on disk meanwhile: the commit at the start is not that of all code that ran.
        """
        begin, started, cpu = stamp(self.modules), time.perf_counter(), cpu_seconds()
        result = json.loads(json.dumps(_stored(call(), lambda _: None)))
        record = {
            "format": FORMAT,
            "version": VERSION,
            "key": plain(key),
            **begin,
            "seconds": round(time.perf_counter() - started, 2),
            "cpu_seconds": round(cpu_seconds() - cpu, 2),
            "result": result,
        }
        stamp(self.modules)  # again after the measurement: its child processes may have loaded code later
        append_record(self.path, record)
        return record

    def run(self, keys: Iterable[Mapping[str, Any]], call: Callable[..., Mapping[str, Any]], again: str) -> None:
        """Measure the keys of `todo` by ``call(**key)``, one after the other, and print each with its time."""
        for key in self.todo(keys, again):
            record = self.measure(key, partial(call, **key))
            print(f"{self.name}, {', '.join(map(str, key.values()))}: {record['seconds']:.0f} s", flush=True)

    def todo(self, keys: Iterable[Mapping[str, Any]], again: str = CHANGED) -> list[dict[str, Any]]:
        """Return the keys that are to be measured.

        Parameters
        ----------
        keys : iterable of mapping
        again : {"changed", "missing", "all"}
            "changed": keys without a record by the present code and libraries; "missing": keys without a record by
            any code; "all": every key.
        """
        there = {key_of(record): record for record in self.newest()}
        now = {"code": code_hash(self.modules), "versions": provenance()["versions"]}

        def wanted(key: Mapping[str, Any]) -> bool:
            record = there.get(key_of({"key": plain(key)}))
            if again == ALL or record is None or "unsure" in record:
                return True
            return again == CHANGED and any(record[name] != value for name, value in now.items())

        return [dict(key) for key in keys if wanted(key)]

    def newest(self, *, unsure: bool | None = None, **only: Any) -> list[Record]:
        """Return the newest record of each key, in the order in which keys first appear.

        Parameters
        ----------
        unsure : bool, optional
            Only records of unknown commit, or only those of a known one.
        only
            Values that the keys must have.
        """
        found: dict[str, Record] = {}
        for record in read_records(self.path, FORMAT, VERSION):
            name = key_of(record)
            if unsure is not None and ("unsure" in record) is not unsure:
                continue
            if _counts_more(record, found.get(name, record)):
                found[name] = record
        return [record for record in found.values() if only.items() <= record["key"].items()]

    def by(self, name: str, values: Iterable[str], **only: Any) -> dict[str, dict[str, Any]]:
        """Return the row of each of these values of a key, in their order; values without a row are left out."""
        rows = {row[name]: row for row in self.rows(**only) if name in row}
        return {value: rows[value] for value in values if value in rows}

    def rows(self, *, unsure: bool | None = None, **only: Any) -> list[dict[str, Any]]:
        """Return key and result of the newest records as one dict each, with the ``commit`` of `commit_of`."""
        return [{**r["key"], **r["result"], "commit": commit_of(r)} for r in self.newest(unsure=unsure, **only)]


def cpu_seconds() -> float:
    """Return the CPU seconds of this process and of the child processes it has waited for."""
    return sum(os.times()[:4])


def stamp(modules: Sequence[str]) -> dict[str, Any]:
    """Return code hash, commit, machine and versions at the first measurement of this process, and the present time.

    Raises
    ------
    RuntimeError
        If sources have changed on disk since the first measurement.
    """
    begin, now = _at_start(tuple(modules)), code_hash(modules)
    if now != begin["code"]:
        raise RuntimeError(
            "sources changed on disk since this process began to measure: start it again, "
            "best from a worktree in which nobody works"
        )
    return {**begin, "when": datetime.now(UTC).isoformat(timespec="seconds")}


@lru_cache(maxsize=8)
def _at_start(modules: tuple[str, ...]) -> dict[str, Any]:
    return {"code": code_hash(modules), **provenance()}


def code_hash(modules: Sequence[str]) -> str:
    """Return the SHA-256 of the packages and of these modules' files.

    Raises
    ------
    ValueError
        If a module does not exist.
    """
    digest = hashlib.sha256(source_hash(PACKAGES, SOURCES).encode())
    for module in modules:
        found = importlib.util.find_spec(module)
        if found is None or found.origin is None:
            raise ValueError(f"there is no module {module}: results cannot come from it")
        origin = Path(found.origin)
        parts = (path for path in origin.parent.iterdir() if path.suffix in SOURCES)
        for path in sorted(parts) if origin.name == "__init__.py" else [origin]:
            digest.update(path.read_bytes())
    return digest.hexdigest()


def commit_of(record: Mapping[str, Any]) -> str:
    """Return the commit as a page shows it: seven digits, ``+`` if its code was changed, ``unsure``, or ``none``."""
    if "unsure" in record:
        return "unsure"
    git = record["git"]
    return "none" if git is None else git["commit"][:7] + "+" * git["dirty"]


def origin(rows: Iterable[Mapping[str, Any]]) -> str:
    """Return a sentence with the commits that measured these rows; of many, the first and how many there are."""
    commits = list(dict.fromkeys(row["commit"] for row in rows))
    named = [f"`{commit}`" for commit in commits if commit != "unsure"]
    known = ", ".join(named)
    if len(named) > NAMED:
        known = f"{named[0]} and {len(named) - 1} other commits, which the records in `benchmarks/results` name"
    if "unsure" not in commits:
        return f"Measured by {known}."
    if not known:
        return "The commits that measured these rows are unknown."
    return f"Measured by {known}; the commits that measured the rows without one are unknown."


def by_scene(scenes: Mapping[str, Any]) -> str:
    """Return a sentence with the commits and the scenes that each measured."""
    commits: dict[str, list[str]] = {}
    for name, one in scenes.items():
        commits.setdefault(one["commit"], []).append(name)
    if len(commits) == 1:
        return origin(scenes.values())
    return "Measured by " + ", ".join(f"`{commit}` ({', '.join(names)})" for commit, names in commits.items()) + "."


def table(
    heads: str, rows: Iterable[str | Sequence[object]], commits: Sequence[Iterable[str]] | None = None
) -> list[str]:
    """Return a Markdown table; heads and cells are separated by " | ", or rows are lists of cells.

    Parameters
    ----------
    heads : str
    rows : iterable of str or of sequence
    commits : sequence of iterables of str, optional
        Commits of each row's records, as for `with_commits`.
    """
    lines = [head := f"| {heads} |", "|---" * (head.count("|") - 1) + "|"]
    lines += [f"| {row if isinstance(row, str) else ' | '.join(map(str, row))} |" for row in rows]
    return lines if commits is None else with_commits(lines, commits)


def with_commits(lines: Sequence[str], commits: Sequence[Iterable[str]]) -> list[str]:
    """Return a Markdown table, with a column of commits unless a single commit measured all rows.

    Parameters
    ----------
    lines : sequence of str
        Head, rule and rows.
    commits : sequence of iterables of str
        Commits of each row's records.
    """
    each = [list(dict.fromkeys(some)) for some in commits]
    if len({commit for some in each for commit in some}) < 2:
        return list(lines)
    cells = [", ".join(f"`{commit}`" for commit in some if commit != "unsure") for some in each]
    head, rule, *body = lines
    return [f"{head} commit |", f"{rule}---|", *(f"{a} {b} |" for a, b in zip(body, cells, strict=True))]


def _counts(line: str) -> bool:
    """Return whether a committed line must stay: its provenance is known, and its commit is in this history."""
    git = json.loads(line).get("git")
    return '"unsure":' not in line and (git is None or exists(git["commit"]))


def check(path: Path) -> list[str]:
    """Return the faults of a file of records, one line each.

    Every record needs all fields and an existing commit, if this checkout has a history. Two records of different
    commits must not have the same measured seconds, unless the seconds of their whole measurements differ, too: short
    times are rounded to milliseconds and may be equal by chance. Committed lines must not be changed, or removed
    without a newer record of the same key, unless their commit is unknown. Records converted from an earlier file
    format have no code hash and no date. Records marked ``unsure`` have no commit either: several commits measured
    them, but their file named only one.
    """
    wrong, seen, newest = [], dict[tuple[float, ...], Record](), dict[str, str]()
    for number, record in enumerate(read_records(path, FORMAT, VERSION), 1):
        where = f"{path.name}, line {number}"
        if missing := [name for name in FIELDS if name not in record]:
            wrong.append(f"{where}: no {', '.join(missing)}")
            continue
        optional = {"unsure": (*STAMP, "seconds"), "converted": ("code", "when", "seconds")}
        may = {name for kind, names in optional.items() if kind in record for name in names}
        if empty := [name for name in FIELDS if record[name] is None and name not in may]:
            wrong.append(f"{where}: {', '.join(empty)} is null")
        git = record["git"]
        if git is not None and not exists(git["commit"]):
            wrong.append(f"{where}: commit {git['commit']} is not in this history")
        seconds = tuple(seconds_in(record["result"]))
        if any(seconds) and _copied(seen.setdefault(seconds, record), record):
            first = commit_of(seen[seconds])
            wrong.append(f"{where}: seconds identical to a row of {first}, stamped {commit_of(record)}")
        newest[key_of(record)] = max(newest.get(key_of(record), ""), record["when"] or "")
    lines = set(path.read_text(encoding="utf-8").splitlines())
    lost = [line for line in committed(path) if line not in lines and _counts(line) and not _replaced(line, newest)]
    return wrong + [f"{path.name}: a committed row was changed or removed"] * bool(lost)


def _replaced(line: str, newest: Mapping[str, str]) -> bool:
    """Return whether a newer record of the same key is there; dates by key."""
    record = json.loads(line)
    return newest.get(key_of(record), "") > (record["when"] or "")


def _counts_more(record: Record, before: Record) -> bool:
    """Return whether a record counts instead of one of its key on a line before: merged files have any order."""
    if "unsure" in record or "unsure" in before:
        return "unsure" in before
    return bool((record.get("when") or "") >= (before.get("when") or ""))


def prune(path: Path) -> int:
    """Remove all but the newest record of each key from a file; return the number of removed lines."""
    lines, newest = lines_of(path), dict[str, tuple[Record, bytes]]()
    for line in lines:
        record = json.loads(line)
        if _counts_more(record, newest.get(key_of(record), (record,))[0]):
            newest[key_of(record)] = record, line
    data = b"".join(line for _, line in newest.values())
    if len(newest) < len(lines):
        with atomic_path(path) as temporary:
            temporary.write_bytes(gzip.compress(data, mtime=0) if path.suffix == ".gz" else data)
    return len(lines) - len(newest)


def key_of(record: Mapping[str, Any]) -> str:
    """Return the key of a record as text; that of the study has a step and its parameters."""
    names = ("key",) if "key" in record else ("step", "parameters")
    return json.dumps([record[name] for name in names], sort_keys=True)


def _copied(first: Record, second: Record) -> bool:
    """Return whether one of two records with equal times is a copy of the other under another commit."""
    whole = (first["seconds"], second["seconds"])
    return commit_of(first) != commit_of(second) and (None in whole or whole[0] == whole[1])


def committed(path: Path) -> list[str]:
    """Return all lines that a file ever had in this checkout's history; none without a history."""
    if not path.is_relative_to(ROOT):
        return []
    found = []
    try:
        versions = _git("log", "--format=%H:", "--", str(path)).stdout.split()
        for commit in versions:
            found += _git("show", commit + path.relative_to(ROOT).as_posix()).stdout.splitlines()
    except (OSError, subprocess.SubprocessError):
        return []
    return found


def _git(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["git", "-C", str(ROOT), *arguments], capture_output=True, text=True, timeout=30)


@lru_cache(maxsize=1024)
def exists(commit: str) -> bool:
    """Return whether a commit is an ancestor of HEAD; True without a history. Commits of rebased branches are not."""
    try:
        before = _ancestors()
        return (
            before is None or commit in before or not _git("merge-base", "--is-ancestor", commit, "HEAD").returncode
        )
    except (OSError, subprocess.SubprocessError):
        return True


@lru_cache
def _ancestors() -> set[str] | None:
    """Return the commits before HEAD, read once; None if the history is not whole."""
    shallow = _git("rev-parse", "--is-shallow-repository").stdout.strip() != "false"
    return None if shallow else set(_git("rev-list", "HEAD").stdout.split())


def seconds_in(value: Any) -> Iterable[float]:
    """Yield all measured times of a result: fractional numbers under a name with ``seconds`` in it."""
    if isinstance(value, Mapping):
        for name, item in value.items():
            if "seconds" in name and isinstance(item, float):
                yield item
            else:
                yield from seconds_in(item)
    elif isinstance(value, list):
        for item in value:
            yield from seconds_in(item)


def plain(value: Any) -> Any:
    """Return a value as JSON can store it: lists for tuples, text for infinities, None for NaN."""
    return json.loads(json.dumps(_stored(value, str)))


def _stored(value: Any, infinity: Callable[[float], Any]) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _stored(item, infinity) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_stored(item, infinity) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else infinity(value)
    return value


def number(value: Any) -> float:
    """Return the number of a value from `plain`."""
    return math.nan if value is None else float(value)
