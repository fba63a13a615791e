"""Records older than the code that they measure, for ``python -m benchmarks list --stale``.

The code of a benchmark are the modules that it imports, directly or not. A record is stale if one of them computes
otherwise than at the record's commit: docstrings, comments, imports and places of files do not count. Coders are
found by the names of schemes, so a benchmark that imports `codec` depends on all of it.
"""

from __future__ import annotations

import ast
import hashlib
import subprocess
from collections import Counter
from collections.abc import Iterator
from functools import cache, lru_cache
from pathlib import Path

from benchmarks.records import PACKAGES, ROOT
from benchmarks.registry import Benchmark, entry, newest

ROOMS = ("benchmarks", "examples", *PACKAGES)
WHOLE = ("codec",)
SIDE_WORK = (
    "benchmarks.pages",
    "benchmarks.records",
    "benchmarks.registry",
    "benchmarks.arguments",
    "ii_core.base.jit",  # how kernels are compiled and cached, not what they compute
)  # measure nothing


def report(benchmark: Benchmark) -> str:
    """Return a line on the stale records of a benchmark; empty if there are none."""
    files = [path for path in benchmark.result_files() if ".jsonl" in path.suffixes]
    records = [record for path in files for record in newest(path)]
    needed = imported(entry(benchmark.module)) if records else frozenset()
    names = sorted(str(path.relative_to(ROOT)) for path in needed)
    changed: Counter[str] = Counter()
    stale = 0
    for record in records:
        then = set(codes((record["git"] or {}).get("commit", "")).values())
        other = [name for name in names if codes(None)[name] not in then]
        stale += bool(other)
        changed.update(other)
    if not stale:
        return ""
    spent = benchmark.minutes()
    cost = "cost unknown" if spent is None else f"{spent[0]:.0f} min"
    most = ", ".join(name for name, _ in changed.most_common(3))
    return f"{benchmark.name}: {stale} of {len(records)} records, {cost}; {len(changed)} files, such as {most}"


@lru_cache(maxsize=256)
def codes(commit: str | None) -> dict[str, str]:
    """Return a hash of what each Python file computes, at a commit or, for None, on disk; none at unknown commits."""
    if commit is None:
        paths = (path for room in ROOMS for path in (ROOT / room).rglob("*.py"))
        return {str(path.relative_to(ROOT)): code_hash(path.read_bytes()) for path in paths}
    try:
        listed = _git("ls-tree", "-r", commit, "--", *ROOMS).decode()
    except subprocess.CalledProcessError:
        return {}
    blobs = {name: line.split()[2] for line, name in (row.split("\t", 1) for row in listed.splitlines())}
    return {name: blob_hash(blob) for name, blob in blobs.items() if name.endswith(".py")}


@cache
def blob_hash(blob: str) -> str:
    """Return the hash of what a file of git computes."""
    return code_hash(_git("cat-file", "blob", blob))


def code_hash(source: bytes) -> str:
    """Return a hash of Python code without comments, docstrings and imports."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [part for part in body if not _silent(part)]  # type: ignore[attr-defined]
    return hashlib.sha256(ast.dump(tree).encode()).hexdigest()


def _silent(node: ast.AST) -> bool:
    return isinstance(node, ast.Import | ast.ImportFrom) or (
        isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
    )


@cache
def imported(module: str) -> frozenset[Path]:
    """Return the files of this tree that a module needs, its own included, without those that only write pages."""
    found: set[Path] = set()
    waiting = [module]
    while waiting:
        name = waiting.pop()
        path = file_of(name)
        if path is None or path in found or name.startswith(SIDE_WORK):
            continue
        found.add(path)
        if name in WHOLE:
            found.update((ROOT / name).rglob("*.py"))
        waiting += _imports(name, path)
    return frozenset(path for path in found if path.name != "__init__.py")


def file_of(module: str) -> Path | None:
    """Return the file of a module; None for modules of others."""
    if module.partition(".")[0] not in ROOMS:
        return None
    path = ROOT.joinpath(*module.split("."))
    for file in (path.with_suffix(".py"), path / "__init__.py"):
        if file.exists():
            return file
    return None


def _imports(module: str, path: Path) -> Iterator[str]:
    """Yield the modules that a module imports anywhere, each name of a package as the module that defines it."""
    for base, name in _names(module, path):
        yield _home(base, name)


@cache
def _names(module: str, path: Path) -> tuple[tuple[str, str], ...]:
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    found = []
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            found += [(alias.name, "") for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            parts = package.split(".")
            above = ".".join(parts[: len(parts) - node.level + 1]) if node.level else ""
            base = ".".join(filter(None, (above, node.module)))
            found += [(base, alias.name) for alias in node.names]
    return tuple(found)


def _home(base: str, name: str) -> str:
    """Return the module of a name that is imported from a module or package."""
    path = file_of(base)
    if not name or path is None or base in WHOLE:
        return base
    if file_of(f"{base}.{name}"):
        return f"{base}.{name}"
    if path.name == "__init__.py":
        for inner, known in _names(base, path):
            if known == name and inner != base:
                return _home(inner, name)
    return base


def _git(*words: str) -> bytes:
    return subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True).stdout
