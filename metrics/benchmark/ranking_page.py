"""Page of a ranking to hand out: Markdown, CSV, LaTeX and a chart as SVG.

Every table names measure, view size, bit depth and noise, and has the worst picture beside the mean. Times are in the
results alone: they hold for an idle machine.
"""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ii_core.base.atomic import atomic_paths
from ii_core.display.figure import COLOURS, LINES, MARKERS, new_figure, plain_text, save

from ..measures.measure import measure_of
from ..plots.rd_chart import set_rate_axis
from .correlation import rank_correlations
from .profile import Profile
from .ranking import Result, check_comparable, ranked, worst

Rows = Sequence[Mapping[str, Any]]
Table = list[list[str]]


def page_paths(page: Path) -> list[Path]:
    """Return the paths of a page, and of its numbers, table and chart beside it."""
    return [page, *(page.with_suffix(end) for end in (".csv", ".tex", ".svg"))]


def write_page(path: str | os.PathLike[str], profile: Profile, results: Sequence[tuple[str, Result]]) -> list[Path]:
    """Write the ranking as Markdown; all points as CSV, the table as LaTeX, and a chart as SVG beside it.

    Raises
    ------
    ValueError
        If results cannot be compared; see `check_comparable`.
    """
    check_comparable(profile, results)
    paths = page_paths(Path(path))
    rows = ranked(profile, [result for _, result in results])
    with atomic_paths(paths) as (text, numbers, table, chart):
        text.write_text(_page(profile, rows, paths[3].name), encoding="utf-8")
        _write_numbers(numbers, profile, rows)
        table.write_text(_latex(profile, rows), encoding="utf-8")
        drawn = chart.with_name(f"{chart.name}.svg")
        save(_chart(profile, rows), drawn)
        os.replace(drawn, chart)
    return paths


def conditions(profile: Profile, rows: Rows) -> str:
    """Return view sizes, bit depth, noise, targets and definition of all tables in one paragraph."""
    pictures = rows[0]["result"]["pictures"]
    views: dict[str, list[str]] = {}
    for row in pictures:
        (u, v), (k, l) = row["ei_pixels"], row["lenses"]
        views.setdefault(f"{u}×{v} views of {k}×{l} pixels", []).append(row["name"])
    sizes = "; ".join(f"{size}: {', '.join(names)}" for size, names in views.items())
    depth = ", ".join(sorted({{"uint8": "8", "uint16": "16"}.get(row["dtype"], row["dtype"]) for row in pictures}))
    photographs = any(reference.source for reference in profile.pictures)
    noise = "that of the cameras" if photographs else "none, rendered pictures"
    rates = ", ".join(f"{rate:g}" for rate in profile.rates_bpp)
    count, whole = len(pictures), len(profile.pictures)
    some = "" if count == whole else f"; only {count} of its {whole} pictures"
    return (
        f"{sizes}. Depth: {depth} bit. Noise: {noise}. Targets: {rates} bpp; a file at most "
        f"{profile.rate_tolerance:.0%} larger meets one. Definition: {profile.name} version {profile.version}, "
        f"SHA-256 {profile.digest[:12]}{some}."
    )


def _table(profile: Profile, rows: Rows) -> Table:
    """Return the ranking: a row per coder, with Bjøntegaard rates by every measure, mean and worst picture."""
    measures = [measure_of(name) for name in profile.measures]
    head = ["", "coder", "targets met", *(f"mean {measure.name}" for measure in measures)]
    growing = [measure for measure in measures if measure.higher_is_better]
    head += [f"BD rate by {measure.name}: mean; worst picture" for measure in growing]
    table = [head]
    for place, row in enumerate(rows, 1):
        cells = [str(place), str(row["coder"]), f"{row['met']} of {row['targets']}"]
        for measure in measures:
            value = row["means"][measure.name]
            cells.append("–" if math.isnan(value) else measure.shown(value))
        cells += [_differences(row["differences"][measure.name], profile) for measure in growing]
        table.append(cells)
    return table


def _differences(differences: Mapping[str, float], profile: Profile) -> str:
    """Return mean and worst Bjøntegaard rate, and of how many pictures."""
    if (found := worst(differences)) is None:
        return "–"
    count = len(differences)
    of = "" if count == len(profile.pictures) else f" ({count} of {len(profile.pictures)})"
    return f"{np.mean(list(differences.values())):+.1f} %{of}; {found[1]:+.1f} % {found[0]}"


def _pictures(profile: Profile, rows: Rows) -> Table:
    """Return the Bjøntegaard rates by the measure of the ranking: a row per coder, a column per picture."""
    names = [picture["name"] for picture in rows[0]["result"]["pictures"]]
    table = [["coder", *names]]
    for row in rows:
        found = row["differences"][profile.rank_by]
        table.append([str(row["coder"]), *(f"{found[name]:+.1f} %" if name in found else "–" for name in names)])
    return table


def _access(rows: Rows) -> Table:
    """Return the share of the file that the middle view needs, mean and worst, of coders that state it."""
    table = [["coder", "mean share", "worst share"]]
    for row in rows:
        points = [point for picture in row["result"]["pictures"] for point in picture["points"]]
        shares = [point["view_nbytes"] / point["nbytes"] for point in points if "view_nbytes" in point]
        if len(shares) == len(points):
            table.append([str(row["coder"]), f"{np.mean(shares):.1%}", f"{max(shares):.1%}"])
    return table


def _page(profile: Profile, rows: Rows, chart: str) -> str:
    told = conditions(profile, rows)
    names = [f"- `{name}`: {measure_of(name).caption}" for name in profile.measures]
    lines = [f"# Benchmark {profile.name}, version {profile.version}", "", profile.about, "", "Measures:", "", *names]
    lines += [
        "",
        f"**Ranking** by {profile.rank_by}. Means are over the targets met; Bjøntegaard (BD) rates are against",
    ]
    lines += [
        f"{profile.anchor}, over the pictures whose curves overlap enough. {told}",
        "",
        *_markdown(_table(profile, rows)),
    ]
    lines += ["", f"**BD rate of every picture** against {profile.anchor} by {profile.rank_by}. {told}", ""]
    lines += _markdown(_pictures(profile, rows))
    if len(access := _access(rows)) > 1:
        lines += [
            "",
            "**Access to one view**: bytes that decoding of the middle view alone reads, as a share of the file,",
        ]
        lines += [f"the mean over all points and the worst. {told}", "", *_markdown(access)]
    if correlations := rank_correlations(profile, [row["result"] for row in rows]):
        head = [["measure", *profile.measures]]
        body = [[one, *(_number(correlations[one, other]) for other in profile.measures)] for one in profile.measures]
        lines += [
            "",
            "**Rank correlation of measures** (Spearman): how alike they order the coders, the mean over pictures",
        ]
        lines += [f"and targets. {told}", "", *_markdown(head + body)]
    lines += ["", "**Coders**", "", *_markdown([["coder", "measured", "settings"], *map(_origin, rows)])]
    pictures = [row for one in rows for row in one["result"]["pictures"]]
    if unsure := sorted({row["name"] for row in pictures if row.get("as_defined") is False}):
        lines += ["", f"**Not the pixels of the definition:** {', '.join(map(_cell, unsure))}."]
    return "\n".join([*lines, "", f"![{measure_of(profile.rank_by).text} over rate]({chart})", ""])


def _number(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.2f}"


def _origin(row: Mapping[str, Any]) -> list[str]:
    """Return coder, date, version and commit of its measurement, and its commands."""
    result = row["result"]
    git = result["git"] or {}
    commit = str(git.get("commit", ""))[:7] + ("+" if git.get("dirty") else "")
    libraries = " ".join(f"{name} {version}" for name, version in sorted(result["versions"].items()))
    measured = " ".join(filter(None, (str(result["date"])[:10], commit, libraries)))
    return [str(row["coder"]), measured, "; ".join(map(str, result.get("commands") or ()))]


def _markdown(table: Table) -> list[str]:
    head, *body = ([_cell(cell) for cell in row] for row in table)
    return [f"| {' | '.join(head)} |", "|" + "---|" * len(head), *(f"| {' | '.join(row)} |" for row in body)]


def _cell(text: str) -> str:
    return " ".join(str(text).split()).replace("|", "\\|")


def _latex(profile: Profile, rows: Rows) -> str:
    """Return the ranking as a LaTeX table with its conditions as caption."""
    head, *body = _table(profile, rows)
    lines = [r"\begin{table}", r"\begin{tabular}{" + "rl" + "c" * (len(head) - 2) + "}", r"\hline"]
    for number, row in enumerate((head, *body)):
        lines += [" & ".join(map(_escaped, row)) + r" \\", *([r"\hline"] if number == 0 else [])]
    caption = f"Benchmark {profile.name}, ranked by {profile.rank_by}; BD rates against {profile.anchor}. "
    lines += [
        r"\hline",
        r"\end{tabular}",
        rf"\caption{{{_escaped(caption + conditions(profile, rows))}}}",
        r"\end{table}",
        "",
    ]
    return "\n".join(lines)


ESCAPED = {
    "\\": r"\textbackslash ", "&": r"\&", "%": r"\%", "_": r"\_", "#": r"\#", "$": r"\$", "{": r"\{", "}": r"\}",
    "~": r"\textasciitilde ", "^": r"\textasciicircum ", "×": r"$\times$", "–": "--",
}  # fmt: skip


def _escaped(text: str) -> str:
    return "".join(ESCAPED.get(character, character) for character in text)


def _write_numbers(path: Path, profile: Profile, rows: Rows) -> None:
    """Write all points as CSV."""
    with path.open("w", newline="", encoding="utf-8") as file:
        keys = [
            "target_bpp",
            "bpp",
            "nbytes",
            "reached",
            *dict.fromkeys(("q_global", *profile.measures, "view_nbytes")),
        ]
        writer = csv.writer(file)
        writer.writerow(["profile", "profile_sha256", "coder", "picture", "picture_sha256", *keys])
        for row in rows:
            for picture in row["result"]["pictures"]:
                whose = [profile.name, profile.digest, row["coder"], picture["name"], picture["sha256"]]
                for point in picture["points"]:
                    writer.writerow([*whose, *(point.get(key, "") for key in keys)])


def _chart(profile: Profile, rows: Sequence[Mapping[str, Any]]) -> Any:
    """Return the figure: a panel per picture, a line per coder."""
    count, measure = len(rows[0]["result"]["pictures"]), measure_of(profile.rank_by)
    across = min(3, count)
    down = -(-count // across)
    figure = new_figure(4.2 * across, 3.4 * down + 0.4)
    panels = np.atleast_1d(figure.subplots(down, across)).ravel()
    for i, panel in enumerate(panels):
        if i >= count:
            panel.set_axis_off()
            continue
        every = [row["result"]["pictures"][i]["points"] for row in rows]
        set_rate_axis(panel, [point for points in every for point in points])
        panel.set_title(plain_text(rows[0]["result"]["pictures"][i]["name"]))
        panel.set_ylabel(measure.axis)
        for j, (row, points) in enumerate(zip(rows, every, strict=True)):
            finite = [p for p in points if math.isfinite(p[profile.rank_by])]
            panel.plot(
                [p["bpp"] for p in finite],
                [p[profile.rank_by] for p in finite],
                LINES[j // len(COLOURS) % len(LINES)],
                color=COLOURS[j % len(COLOURS)],
                marker=MARKERS[j % len(MARKERS)],
                label=plain_text(row["coder"]) if i == 0 else None,
            )
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    return figure
