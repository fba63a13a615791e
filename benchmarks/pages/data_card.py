"""Data card of the benchmark's pictures, from the profiles alone, for ``docs/benchmark.md``."""

from __future__ import annotations

from benchmarks.pages.tables import Tables, publish
from metrics.benchmark.card import CAPTION, card_table
from metrics.benchmark.profile import profile, profile_names


def main() -> None:
    """Fill the page."""
    publish(tables())


def tables() -> Tables:
    """Return one table for each profile of the package, with one caption."""
    lines: list[str] = []
    for name in profile_names():
        lines += [f"**{name}**", "", *card_table(profile(name))[:-2], ""]
    return {("docs/benchmark.md", "data-card"): [*lines, CAPTION]}
