"""Generated tables of README and docs: their owners, publication, and check against the records.

    python -m benchmarks run tables [--check]

A benchmark that owns tables has a function ``tables()``, which makes them from its records alone: a dict from page
and mark to lines. The lines are written between ``<!-- mark -->`` and ``<!-- /mark -->`` of the page.
"""

from __future__ import annotations

import argparse
import importlib
import re
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from textwrap import wrap

from benchmarks.records import ROOT
from benchmarks.registry import BENCHMARKS
from ii_core.base.files import atomic_path

Tables = Mapping[tuple[str, str], list[str]]
OWNERS = tuple(benchmark.tables for benchmark in BENCHMARKS.values() if benchmark.tables)
COLUMNS = 100  # of text on pages
MARK = re.compile(r"^<!-- ([a-z][\w-]*) -->$", re.M)


def main() -> None:
    """Fill all pages, or print the tables that are out of date."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="change nothing, fail if a table differs")
    if parser.parse_args().check:
        if wrong := stale():
            sys.exit("\n".join(wrong))
        return
    for owner in OWNERS:
        publish(tables_of(owner))


def tables_of(owner: str) -> Tables:
    """Return the tables of a module."""
    tables: Tables = importlib.import_module(owner).tables()
    return tables


def publish(tables: Tables, root: Path = ROOT) -> None:
    """Put tables on their pages."""
    for page in dict.fromkeys(page for page, _ in tables):
        text = (root / page).read_text(encoding="utf-8")
        for (where, mark), lines in tables.items():
            if where == page:
                text = filled(text, mark, lines)
        with atomic_path(root / page) as temporary:
            temporary.write_text(text, encoding="utf-8")


def filled(text: str, mark: str, lines: list[str]) -> str:
    """Return the text with these lines, sentences wrapped, between ``<!-- mark -->`` and ``<!-- /mark -->``.

    Raises
    ------
    ValueError
        If the text lacks a mark.
    """
    begin, end = f"<!-- {mark} -->\n", f"<!-- /{mark} -->"
    if begin not in text or end not in text:
        raise ValueError(f"the page has no {begin.strip()} … {end}")
    before, after = text.index(begin) + len(begin), text.index(end)
    wrapped = [part for line in lines for part in ([line] if line.startswith(("|", "!", "#")) else _wrapped(line))]
    return "\n".join([text[:before], *wrapped, "", text[after:]])


def _wrapped(line: str) -> list[str]:
    indent = "  " if line.startswith("- ") else ""
    return wrap(line, COLUMNS, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False) or [line]


def fill(path: Path, mark: str, lines: list[str]) -> None:
    """Put lines between the marks of a document on disk."""
    path.write_text(filled(path.read_text(encoding="utf-8"), mark, lines), encoding="utf-8")


def stale(owners: Iterable[str] = OWNERS, root: Path = ROOT) -> list[str]:
    """Return the tables that differ from the present records, and marks that no benchmark fills; one line each."""
    wrong, owned = [], set()
    for owner in owners:
        for (page, mark), lines in tables_of(owner).items():
            owned.add((page, mark))
            text = (root / page).read_text(encoding="utf-8")
            if filled(text, mark, lines) != text:
                wrong.append(f"{page}: table {mark} differs from the records: type python -m benchmarks run tables")
    pages = [root / "README.md", *sorted((root / "docs").rglob("*.md"))]
    marks = {(p.relative_to(root).as_posix(), mark) for p in pages for mark in MARK.findall(p.read_text("utf-8"))}
    return wrong + [f"{page}: no benchmark fills {mark}" for page, mark in sorted(marks - owned)]


if __name__ == "__main__":
    main()
