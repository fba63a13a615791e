"""Tables of rate–distortion studies: text, CSV and LaTeX."""

from __future__ import annotations

import csv
import html
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ii_core.base import checks
from ii_core.base.files import atomic_path

from ..measures.measure import Measure, measure_of
from ..rates.against_anchor import anchor_of, differences
from ..rates.points import FIELDS, check_measured, check_points, is_study, limit_of, measures_of


@checks.checked(path=checks.path, records=checks.sequence)
def write_csv(path: str | os.PathLike[str], records: Sequence[Mapping[str, Any]]) -> Path:
    """Write records as a CSV table, one row per point; the qualities of single layers are only in the JSON file.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ValueError
        If a record lacks a field.
    OSError
        If the file cannot be written.
    """
    check_points(records)
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        more = [name for name in measures_of(records) if name not in FIELDS]
        more += ["depth_outside"] * all("depth_outside" in record for record in records)
        writer = csv.DictWriter(file, [*FIELDS, *more], extrasaction="ignore")
        writer.writeheader()
        for record in records:
            options = " ".join(f"{key}={value}" for key, value in record["options"].items())
            writer.writerow({**record, "options": options})
    return Path(path)


@checks.checked(study=is_study, anchor=checks.text, measure=checks.text)
def summary_table(
    study: Mapping[str, Any], *, anchor: str | None = None, measure: str = "q_global"
) -> list[dict[str, str]]:
    """Return a study as rows of text, one per scheme, with equal columns.

    Parameters
    ----------
    study : dict
        From `read_study`.
    anchor : str, optional
        Scheme of comparison. If not given, that of the study, else its first scheme.
    measure : str
        Name of a measure that the study holds.

    Returns
    -------
    list of dict
        ``scheme``; one column per target rate with the quality; if the scheme does not meet it, with its least or
        largest rate, or the quality at the nearest rate found; ``gain``, the mean difference to the anchor at the
        target rates, see `differences`; ``BD-rate``,
        and ``BD-PSNR`` for qualities in dB or ``BD-quality`` for others, or the reason why they are undefined.

    Raises
    ------
    ValueError
        If the study lacks the measure.
    """
    points, kind = study["points"], measure_of(measure)
    check_measured(points, measure)
    bd_quality = "BD-PSNR" if kind.unit == "dB" else "BD-quality"
    schemes = list(dict.fromkeys(point["scheme"] for point in points))
    targets = sorted({point["target_bpp"] for point in points})
    by_target = {scheme: {p["target_bpp"]: p for p in points if p["scheme"] == scheme} for scheme in schemes}
    rows = []
    different = differences(study, anchor=anchor, measure=measure) if points else {}
    for scheme in schemes:
        row = {"scheme": scheme}
        for target in targets:
            row[f"{target:g}"] = _cell(by_target[scheme].get(target), points, measure)
        if scheme == anchor_of(study, anchor):
            row |= dict.fromkeys(("gain", "BD-rate", bd_quality), "anchor")
        else:
            row |= _differences(different[scheme], kind, bd_quality)
        rows.append(row)
    return rows


def _differences(found: Mapping[str, Any], kind: Measure, bd_quality: str) -> dict[str, str]:
    """Return the cells of differences to the anchor: values, or the reason why they are undefined."""
    columns = {
        "gain": ("gain", kind.digits, kind.unit),
        "BD-rate": ("bd_rate_percent", 1, "%"),
        bd_quality: ("bd_quality", max(kind.digits - 1, 1), kind.unit),
    }
    cells = {}
    for column, (name, digits, unit) in columns.items():
        value = found[name]
        cells[column] = f"– ({found['why'][name]})" if value is None else _signed(value, digits, unit)
    if found["gain"] is not None:
        cells["gain"] += f" at {found['rates']} rates"
    return cells


def _cell(point: Mapping[str, Any] | None, points: Sequence[Mapping[str, Any]], measure: str) -> str:
    if point is None:
        return ""
    shown = measure_of(measure).shown(point[measure])
    if point["reached"]:
        return shown
    limit = limit_of(point, points)
    return f"– ({limit} {point['bpp']:.3g})" if limit else f"{shown} (nearest {point['bpp']:.3g})"


def _signed(value: float, digits: int, unit: str) -> str:
    return f"{value:+.{digits}f}" + (f" {unit}" if unit else "")


def html_table(rows: Sequence[Mapping[str, str]]) -> str:
    """Return rows of text, all with the same columns, as an HTML table."""

    def line(cells: Sequence[str], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"

    body = "".join(line(list(row.values()), "td") for row in rows)
    return f"<table>{line(list(rows[0]), 'th') if rows else ''}{body}</table>"


# Special characters of LaTeX, and characters that its default fonts lack.
LATEX = {
    "\\": r"\textbackslash{}", "{": r"\{", "}": r"\}", "$": r"\$", "&": r"\&", "#": r"\#", "_": r"\_", "%": r"\%",
    "^": r"\textasciicircum{}", "~": r"\textasciitilde{}", "<": r"\textless{}", ">": r"\textgreater{}",
    "|": r"\textbar{}", '"': "''", "–": "--", "−": "$-$", "×": r"$\times$", "±": r"$\pm$", "°": r"$^\circ$",
    "µ": r"$\mu$", "σ": r"$\sigma$", "≤": r"$\le$", "≥": r"$\ge$", "…": r"\dots{}", "→": r"$\to$",
}  # fmt: skip


def latex_text(text: str) -> str:
    """Return text with the special characters of LaTeX escaped."""
    return "".join(LATEX.get(letter, letter) for letter in text)


@checks.checked(path=checks.path, rows=checks.list_of(Mapping), caption=checks.text)
def write_latex(path: str | os.PathLike[str], rows: Sequence[Mapping[str, str]], caption: str = "") -> Path:
    """Write rows of text as a LaTeX table that needs no package.

    Parameters
    ----------
    path : path
        Replaced whole.
    rows : sequence of dict
        All with the same columns, as from `summary_table`. The first column is aligned left, the others right.
    caption : str

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ValueError
        If there are no rows, or they differ in columns.
    OSError
        If the file cannot be written.
    """
    if not rows or any(list(row) != list(rows[0]) for row in rows):
        raise ValueError("rows of one or more columns, the same in all, are needed")

    def line(cells: Sequence[str]) -> str:
        return " & ".join(map(latex_text, cells)) + r" \\"

    width = len(rows[0])
    body = [line(list(rows[0])), r"\hline", *(line(list(row.values())) for row in rows)]
    lines = [r"\begin{table}", r"\centering", rf"\begin{{tabular}}{{l{'r' * (width - 1)}}}", r"\hline", *body]
    lines += [r"\hline", r"\end{tabular}"]
    lines += [rf"\caption{{{latex_text(caption)}}}"] if caption else []
    with atomic_path(path) as temporary:
        temporary.write_text("\n".join([*lines, r"\end{table}"]) + "\n", encoding="utf-8")
    return Path(path)
