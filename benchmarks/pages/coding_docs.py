"""Tables and charts of coders for docs/coding.md and docs/speed_accuracy.md."""

from __future__ import annotations

import statistics
from typing import Any

from benchmarks.coding.coders import (
    ANCHOR,
    NEAR,
    TRIALS,
    chart,
    front,
    rate_table,
    recommended,
    shortened,
    studied,
    summary,
)
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import origin, table

SCALE = 4  # scale of the large study; the small study is at full size


def main() -> None:
    """Fill the pages and draw the chart from the records."""
    publish(tables())
    chart(studied(SCALE), SCALE, "coders.png")


def tables() -> Tables:
    """Return all tables of schemes."""
    coders, full = studied(SCALE), studied(1)
    others = [row for row in coders if row["scheme"] not in TRIALS]
    page = "docs/coding.md"
    return {
        (page, "which"): which(others),
        (page, "coders"): [*size(SCALE, others), "", *rate_table(others, shortened(summary(others)))],
        (page, "full"): [*size(1, full), "", *rate_table(full)],
        ("docs/speed_accuracy.md", "coding"): [*size(SCALE, others), "", *front_table(coders)],
    }


# Purposes, and the scheme for each; rates and times come from the records.
CHOICES = {
    "the smallest file, whatever it takes": "si-lf",
    "a small file by a standard, whatever it takes": "si-avif:best",
    "a small file in seconds": "si-hevc:balanced",
    "speed": "si-h264:fast",
    "one codestream with every view on its own": "si-jpeg2000",
    "numbers to compare with the dissertation's": ANCHOR,
    "a plain picture, for comparison": "jpeg2000",
}


def which(rows: list[dict[str, Any]]) -> list[str]:
    """Return a table of schemes by purpose; conditions and commits are those of the table of all schemes."""
    known = {row["scheme"]: row for row in summary(rows)}
    lines = []
    for wish, scheme in CHOICES.items():
        row = known[scheme]
        rate = "curves share too little" if row["mean"] is None else f"{1 + row['mean'] / 100:.2f} ×"
        lines.append(f"{wish} | `{scheme}` | {rate} | {row['seconds']:.2f}")
    return table("you want | take | rate at equal PSNR | CPU s", lines)


def front_table(rows: list[dict[str, Any]]) -> list[str]:
    """Return the Pareto front as a table, the recommended setting in bold."""
    lines = []
    pick = recommended(rows)["scheme"]
    for row in front([row for row in rows if row["scheme"] not in TRIALS]):
        points = [point for one in rows if one["scheme"] == row["scheme"] for point in one["points"]]
        decode = statistics.mean(point["decode_seconds"] for point in points)
        name = f"**`{row['scheme']}`**" if row["scheme"] == pick else f"`{row['scheme']}`"
        lines.append(f"{name} | {1 + row['mean'] / 100:.2f} × | {row['seconds']:.2f} | {decode:.2f}")
    heads = "scheme | rate at equal PSNR | encoder, CPU s | decoder, CPU s"
    return [
        *table(heads, lines),
        "",
        f"Bold: the fastest scheme whose rate is within {100 * NEAR:.0f} % of the least.",
    ]


def size(scale: int, rows: list[dict[str, Any]]) -> list[str]:
    """Return conditions of the table: pictures, times, commits."""
    conditions = f"Pictures of `setup1` at scale {scale}; CPU seconds of one run, mean over qualities and scenes."
    return [conditions, origin(rows)]
