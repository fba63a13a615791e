"""Data card, anchors and results of the benchmark, for ``docs/benchmark.md``."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.pages.tables import Tables, publish
from benchmarks.records import ROOT
from metrics.benchmark.anchors import ANCHORS
from metrics.benchmark.card import CAPTION, card_table
from metrics.benchmark.profile import profile, profile_names
from metrics.benchmark.ranking import check_comparable, ranked, worst
from metrics.benchmark.ranking_page import conditions
from metrics.benchmark.result import read_result

RESULTS = ROOT / "benchmarks" / "results"


def main() -> None:
    """Fill the page."""
    publish(tables())


def tables() -> Tables:
    """Return one table for each profile of the package, with one caption, and that of the anchors."""
    lines: list[str] = []
    for name in profile_names():
        if all(reference.middle for reference in profile(name).pictures):
            continue
        lines += [*short_table(name, card_table(profile(name))[:-2]), ""]
    anchors = ["| anchor | samples | arguments of the encoder |", "|---|---|---|"]
    anchors += [f"| `{name}` | `{anchor.pixels}` | `{anchor.encoder}` |" for name, anchor in ANCHORS.items()]
    found = {"data-card": [*lines, CAPTION], "anchors": anchors, "photographs-small": results("photographs-small")}
    return {("docs/benchmark.md", mark): table for mark, table in found.items()}


def results(name: str) -> list[str]:
    """Return the Bjøntegaard rates of the stored results of a profile: mean, and worst picture."""
    defined = profile(name)
    read = [(path.name, read_result(path)) for path in sorted((RESULTS / name).glob("*.json"))]
    check_comparable(defined, read)
    rows = ranked(defined, [result for _, result in read])
    lines = [
        "| coder | targets met | by PSNR-YUV (CTC) | by RGB PSNR | by SSIM (CTC) | commit |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        cells = [f"`{row['coder']}`", f"{row['met']} of {row['targets']}"]
        for measure in ("q_ctc_psnr", "q_global", "q_ctc_ssim"):
            each = row["differences"][measure]
            most = worst(each)
            whole = most is not None and len(each) == len(defined.pictures)
            cells.append(
                f"{np.mean(list(each.values())):+.1f} %; {most[1]:+.1f} % {most[0]}" if whole and most else "–"
            )
        lines.append(f"| {' | '.join(cells)} | `{row['result']['git']['commit'][:7]}` |")
    return ["BD rate against `x265`: mean; worst picture. " + conditions(defined, rows), "", *lines]


def short_table(name: str, lines: Sequence[str]) -> list[str]:
    """Return a table under its name; what is the same in all rows is in the heading in place of a column."""
    head, _, *rows = ([cell.strip() for cell in line.strip("|").split("|")] for line in lines)
    columns = list(zip(head, *rows, strict=True))
    same = [f"{title}: {first}" for title, first, *rest in columns if set(rest) == {first}]
    kept = [column for column in columns if len(set(column[1:])) > 1]
    titles, *cells = zip(*kept, strict=True)
    table = [f"| {' | '.join(titles)} |", "|" + "---|" * len(titles), *(f"| {' | '.join(row)} |" for row in cells)]
    return ["; ".join([f"**{name}**", *same]), "", *table]
