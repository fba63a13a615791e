"""Mutants of the packages' code, and whether the tests notice them.

``python -m tests.support.mutants`` changes one place at a time in a copy of the checkout and runs the tests of its
room. A mutant is killed if they fail. ``mutants.toml`` lists the places; every line of code in it stands once in its
file, which a test of the fast set checks.

    python -m tests.support.mutants                         all; hours on two cores
    python -m tests.support.mutants --only metrics          those of files whose path contains the word
    python -m tests.support.mutants --propose 6 FILE …      print random places for the list, by a fixed seed
"""

from __future__ import annotations

import argparse
import ast
import json
import random
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Queue
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[2]
LIST = Path(__file__).with_name("mutants.toml")
SECONDS = 600  # a mutant whose tests take longer counts as killed
NO_TESTS = 5  # pytest's exit code
SWAPS: dict[type[ast.AST], tuple[str, str]] = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Lt: ("<", "<="),
    ast.LtE: ("<=", "<"),
    ast.Gt: (">", ">="),
    ast.GtE: (">=", ">"),
    ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="),
    ast.And: (" and ", " or "),
    ast.Or: (" or ", " and "),
    ast.BitAnd: ("&", "|"),
    ast.BitOr: ("|", "&"),
}


class Mutant(NamedTuple):
    """A change of one place: the text ``old``, which stands once in the file, becomes ``new``."""

    file: str
    old: str
    new: str
    tests: list[str]

    def apply(self, folder: Path) -> None:
        """Change the file below a folder; ValueError if the text does not stand there once."""
        path = folder / self.file
        text = path.read_text(encoding="utf-8")
        if text.count(self.old) != 1:
            raise ValueError(f"{self.file}: {self.old!r} stands there {text.count(self.old)} times: once is needed")
        path.write_text(text.replace(self.old, self.new), encoding="utf-8")


def mutants(only: str = "") -> list[Mutant]:
    """Return the mutants of the list whose file contains a word, with the tests of their room."""
    data = tomllib.loads(LIST.read_text(encoding="utf-8"))
    return [
        Mutant(file, old, new, room["tests"])
        for room in data["room"]
        for file, old, new in room["mutants"]
        if only in file
    ]


def outcome(mutant: Mutant | None, copy: Path, tests: list[str]) -> str:
    """Run tests in a copy of the checkout, with a mutant applied: "killed", "survived". Fast tests come first."""
    original = None if mutant is None else (copy / mutant.file).read_text(encoding="utf-8")
    if mutant is not None:
        mutant.apply(copy)
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-n", "0", "-p", "no:cacheprovider", *tests]
    seconds = None if mutant is None else SECONDS
    try:
        for marks in ("not browser and not slow", "not browser and slow"):
            done = subprocess.run([*command, "-m", marks], cwd=copy, capture_output=True, text=True, timeout=seconds)
            if done.returncode not in (0, 1, 2, NO_TESTS):
                raise RuntimeError(done.stdout[-2000:] + done.stderr[-2000:])
            if done.returncode in (1, 2):
                return "killed"
        return "survived"
    except subprocess.TimeoutExpired:
        return "killed"
    finally:
        if mutant is not None and original is not None:
            (copy / mutant.file).write_text(original, encoding="utf-8")


def checkout_copy(folder: Path) -> Path:
    """Copy the files that git tracks, and their uncommitted changes."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in filter(None, listed.split("\0")):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
    return folder


def run(todo: list[Mutant], workers: int) -> list[dict[str, Any]]:
    """Return the outcome of every mutant, as its run ends also printed. The tests pass without mutants first."""
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder, ThreadPoolExecutor(workers) as pool:
        copies: Queue[Path] = Queue()
        for i in range(workers):
            (Path(folder) / str(i)).mkdir()
            copies.put(checkout_copy(Path(folder) / str(i)))

        def one(mutant: Mutant | None, tests: list[str]) -> str:
            copy = copies.get()
            try:
                return outcome(mutant, copy, tests)
            finally:
                copies.put(copy)

        rooms = {tuple(mutant.tests) for mutant in todo}
        for tests, found in zip(rooms, pool.map(lambda tests: one(None, list(tests)), rooms), strict=True):
            if found != "survived":
                raise SystemExit(f"tests fail without a mutant: {' '.join(tests)}")
        rows = []
        for mutant, found in zip(todo, pool.map(lambda m: one(m, m.tests), todo), strict=True):
            rows.append({"file": mutant.file, "old": mutant.old, "new": mutant.new, "outcome": found})
            print(json.dumps(rows[-1], ensure_ascii=False), flush=True)
    return rows


def proposals(path: Path, count: int, seed: int = 0) -> Iterator[tuple[str, str]]:
    """Yield lines of a file and their mutations, at random places of its functions."""
    text = path.read_text(encoding="utf-8")
    lines = text.splitlines()
    places: list[tuple[int, int, int, str, str]] = []
    for node in ast.walk(ast.parse(text)):
        pairs: list[tuple[ast.AST, ast.AST, ast.AST]] = []
        if isinstance(node, ast.BinOp):
            pairs = [(node.op, node.left, node.right)]
        elif isinstance(node, ast.Compare):
            pairs = [(node.ops[0], node.left, node.comparators[0])]
        elif isinstance(node, ast.BoolOp):
            pairs = [(node.op, node.values[0], node.values[1])]
        for op, left, right in pairs:
            a: Any = left
            b: Any = right
            if type(op) in SWAPS and a.end_lineno == b.lineno:
                places.append((a.end_lineno - 1, a.end_col_offset, b.col_offset, *SWAPS[type(op)]))
    random.Random(seed).shuffle(places)
    for row, start, end, old, new in places:
        line = lines[row].encode()
        between = line[start:end].decode()
        if between.count(old) == 1 and text.count(lines[row].strip()) == 1 and count > 0:
            count -= 1
            yield (
                lines[row].strip(),
                (line[:start].decode() + between.replace(old, new) + line[end:].decode()).strip(),
            )


def main() -> None:
    """Run the mutants, or propose some."""
    parser = argparse.ArgumentParser(description="Run the tests on changed code.")
    parser.add_argument("--only", default="", help="files whose path contains this")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--propose", type=int, help="print as many places of each file")
    parser.add_argument("files", nargs="*", type=Path)
    given = parser.parse_args()
    if given.propose:
        for path in given.files:
            for old, new in proposals(path, given.propose):
                print(
                    f"  [{json.dumps(str(path))}, {json.dumps(old, ensure_ascii=False)}, "
                    f"{json.dumps(new, ensure_ascii=False)}],"
                )
        return
    rows = run(mutants(given.only), given.workers)
    survived = [row for row in rows if row["outcome"] == "survived"]
    print(f"{len(rows) - len(survived)} of {len(rows)} killed")


if __name__ == "__main__":
    main()
