"""Ranking of results of the benchmark: a Markdown page with a table and a chart.

Coders are ranked by the number of targets that they meet, then by their mean quality at these targets. Bjøntegaard
differences refer to the profile's anchor, if its result is among those ranked.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ii_core.base.atomic import atomic_paths
from ii_core.base.files import one_line
from ii_core.display.figure import COLOURS, LINES, MARKERS, new_figure, plain_text, save

from ..measures.measure import measure_of
from ..plots.rd_chart import set_rate_axis
from ..rates.rd import bd_rate
from .profile import Profile

Result = Mapping[str, Any]


def check_comparable(profile: Profile, results: Sequence[tuple[str, Result]]) -> None:
    """Raise ValueError unless all results are of the profile and of the same pictures, each coder once.

    Parameters
    ----------
    results : sequence of (str, Result)
        File names and results.
    """
    if not results:
        raise ValueError("no result: at least one file is needed")
    first, hashes = results[0][0], _hashes(results[0][1])
    seen: dict[str, str] = {}
    for name, result in results:
        of = result["profile"]
        if (of["name"], of["version"], of["sha256"]) != (profile.name, profile.version, profile.digest):
            raise ValueError(
                f"{name} is of profile {one_line(of['name'])} version {of['version']}, {of['sha256'][:12]}: "
                f"{profile.name} version {profile.version}, {profile.digest[:12]}, is needed"
            )
        if _hashes(result) != hashes:
            raise ValueError(f"{name} has other pictures than {first}: results of the same pixels are ranked")
        for row in result["pictures"]:
            if [point["target_bpp"] for point in row["points"]] != list(profile.rates_bpp):
                raise ValueError(f"{name}: {row['name']} is not measured at the rates of the profile")
            if not all(isinstance(point.get(profile.rank_by), float) for point in row["points"]):
                raise ValueError(f"{name}: {row['name']} has no {profile.rank_by} at every rate: a number is needed")
        if result["coder"] in seen:
            raise ValueError(
                f"{name} and {seen[result['coder']]} are both of {result['coder']}: one of them is needed"
            )
        seen[result["coder"]] = name


def _hashes(result: Result) -> list[tuple[str, str]]:
    return [(row["name"], row["sha256"]) for row in result["pictures"]]


def ranked(profile: Profile, results: Sequence[Result]) -> list[dict[str, Any]]:
    """Return a row per result, the best first.

    Returns
    -------
    list of dict
        ``coder``, ``met`` and ``targets`` (numbers), ``quality`` (mean of the measure of the ranking over the targets
        met), ``bd_rate`` (mean over pictures, %; NaN without an anchor), ``compared`` (pictures that it is the mean
        of), ``encode_seconds`` and ``decode_seconds`` (CPU seconds of all points), ``result``.
    """
    anchor = next((result for result in results if result["coder"] == profile.anchor), None)
    better = 1 if measure_of(profile.rank_by).higher_is_better else -1
    rows = []
    for result in results:
        points = [point for row in result["pictures"] for point in row["points"]]
        met = [point[profile.rank_by] for point in points if point["reached"]]
        differences = _differences(profile, anchor, result)
        rows.append(
            {
                "coder": result["coder"],
                "met": len(met),
                "targets": len(points),
                "quality": float(np.mean(met)) if met else math.nan,
                "bd_rate": float(np.mean(differences)) if differences else math.nan,
                "compared": len(differences),
                "encode_seconds": sum(point["encode_seconds"] for point in points),
                "decode_seconds": sum(point["decode_seconds"] for point in points),
                "result": result,
            }
        )

    def order(row: Mapping[str, Any]) -> tuple[float, float, str]:
        return -row["met"], -better * row["quality"] if row["met"] else 0.0, row["coder"]

    return sorted(rows, key=order)


def _differences(profile: Profile, anchor: Result | None, result: Result) -> list[float]:
    """Return the Bjøntegaard differences of all pictures for which they are defined."""
    found = []
    for one, other in zip(anchor["pictures"] if anchor else (), result["pictures"], strict=False):
        curves = [_curve(row, profile.rank_by) for row in (one, other)]
        try:
            found.append(bd_rate(*curves[0], *curves[1]))
        except ValueError:  # too few points, or curves that hardly overlap
            continue
    return found


def _curve(row: Mapping[str, Any], measure: str) -> tuple[list[float], list[float]]:
    points = sorted({(p["bpp"], p[measure]) for p in row["points"] if math.isfinite(p[measure])})
    return [bpp for bpp, _ in points], [value for _, value in points]


def write_page(path: str | os.PathLike[str], profile: Profile, results: Sequence[tuple[str, Result]]) -> list[Path]:
    """Write the ranking as Markdown, and its chart as a PNG beside it.

    Raises
    ------
    ValueError
        If results cannot be compared; see `check_comparable`.
    """
    check_comparable(profile, results)
    page = Path(path)
    rows = ranked(profile, [result for _, result in results])
    with atomic_paths([page, chart_path(page)]) as (text, chart):
        text.write_text(_page(profile, rows, chart_path(page).name), encoding="utf-8")
        drawn = chart.with_name(f"{chart.name}.png")
        save(_chart(profile, rows), drawn)
        os.replace(drawn, chart)
    return [page, chart_path(page)]


def chart_path(page: Path) -> Path:
    """Return the path of a page's chart."""
    return page.with_suffix(".png")


def _page(profile: Profile, rows: Sequence[Mapping[str, Any]], chart: str) -> str:
    measure = measure_of(profile.rank_by)
    lines = [
        f"# Benchmark {profile.name}, version {profile.version}",
        "",
        profile.about,
        "",
        f"Targets: {', '.join(f'{rate:g}' for rate in profile.rates_bpp)} bpp on "
        f"{', '.join(picture.name for picture in profile.pictures)}. A target is met by a file at most "
        f"{profile.rate_tolerance:.0%} larger. Quality is the {measure.caption}, the mean over all targets met.",
        "",
        f"|  | coder | targets met | quality | BD rate against {profile.anchor} | encoder | decoder | measured |",
        "|---:|---|---:|---:|---:|---:|---:|---|",
    ]
    for place, row in enumerate(rows, 1):
        difference = "–" if math.isnan(row["bd_rate"]) else f"{row['bd_rate']:+.1f} % ({row['compared']})"
        seconds = [f"{row[key]:.3g} s" for key in ("encode_seconds", "decode_seconds")]
        met, quality = f"{row['met']} of {row['targets']}", measure.shown(row["quality"]) if row["met"] else "–"
        cells = [str(place), _cell(row["coder"]), met, quality, difference, *seconds, _origin(row["result"])]
        lines.append(f"| {' | '.join(cells)} |")
    lines += ["", "In brackets: pictures whose curves overlap enough. Times are CPU seconds of all points."]
    pictures = [row for one in rows for row in one["result"]["pictures"]]
    unsure = sorted({row["name"] for row in pictures if row.get("as_defined") is False})
    if unsure:
        lines += ["", f"**Not the pixels of the definition:** {', '.join(map(_cell, unsure))}."]
    return "\n".join([*lines, "", f"![{measure.text} over rate]({chart})", ""])


def _origin(result: Result) -> str:
    git = result["git"] or {}
    commit = str(git.get("commit", ""))[:7] + ("+" if git.get("dirty") else "")
    version = result["versions"].get("raytrace-ii", "")
    return _cell(" ".join(filter(None, (str(result["date"])[:10], version, commit))))


def _cell(text: str) -> str:
    return " ".join(str(text).split()).replace("|", "\\|")


def _chart(profile: Profile, rows: Sequence[Mapping[str, Any]]) -> Any:
    """Return the figure: a panel per picture, a line per coder."""
    count, measure = len(profile.pictures), measure_of(profile.rank_by)
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
