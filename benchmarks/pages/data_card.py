"""Data card and anchors of the benchmark, for ``docs/benchmark.md``."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.pages.tables import Tables, publish
from metrics.benchmark.anchors import ANCHORS
from metrics.benchmark.card import CAPTION, card_table
from metrics.benchmark.profile import profile, profile_names


def main() -> None:
    """Fill the page."""
    publish(tables())


def tables() -> Tables:
    """Return one table for each profile of the package, with one caption, and that of the anchors."""
    lines: list[str] = []
    for name in profile_names():
        if name == "photographs-small":  # parts of the pictures of `photographs`
            continue
        lines += [*short_table(name, card_table(profile(name))[:-2]), ""]
    anchors = ["| anchor | samples | arguments of the encoder |", "|---|---|---|"]
    anchors += [f"| `{name}` | `{anchor.pixels}` | `{anchor.encoder}` |" for name, anchor in ANCHORS.items()]
    found = {"data-card": [*lines, CAPTION], "anchors": anchors}
    return {("docs/benchmark.md", mark): table for mark, table in found.items()}


def short_table(name: str, lines: Sequence[str]) -> list[str]:
    """Return a table under its name; what is the same in all rows is in the heading in place of a column."""
    head, _, *rows = ([cell.strip() for cell in line.strip("|").split("|")] for line in lines)
    columns = list(zip(head, *rows, strict=True))
    same = [f"{title}: {first}" for title, first, *rest in columns if set(rest) == {first}]
    kept = [column for column in columns if len(set(column[1:])) > 1]
    titles, *cells = zip(*kept, strict=True)
    table = [f"| {' | '.join(titles)} |", "|" + "---|" * len(titles), *(f"| {' | '.join(row)} |" for row in cells)]
    return ["; ".join([f"**{name}**", *same]), "", *table]
