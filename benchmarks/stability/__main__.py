"""Limits of the methods, measured: ``python -m benchmarks run stability [-- case ...]``.

Every case sweeps one parameter up to failure; cases can be run one by one. Numbers go to
``benchmarks/results/stability.jsonl``, the chart to ``docs/images``, tables to ``docs/stability.md``,
with those of ``benchmarks.accuracy.convergence``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from benchmarks.accuracy import convergence
from benchmarks.arguments import command_line
from benchmarks.pages.pictures import tidy, write_chart
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin
from benchmarks.records import table as markdown
from benchmarks.stability import curves, depth, geometry, light, picture
from benchmarks.stability.excerpts import EXCERPTS, Excerpt
from benchmarks.stability.geometry import Row
from ii_core.depth.focus import METHODS
from ii_core.display.figure import COLOURS, new_figure

ACCURACY = tuple(f"benchmarks.accuracy.{name}" for name in ("analytic", "depth_truth"))
RECORDS = Records("stability", ("benchmarks.stability", *ACCURACY))
CASES: dict[str, Callable[[], list[Row]]] = {
    case.__name__: case
    for case in (
        geometry.lift, geometry.scales, geometry.coplanar, geometry.contact_shadow, geometry.bad_faces,
        geometry.huge_beside_tiny, light.terminator, light.covered, light.grazing, light.camera_in_glass,
        light.camera_in_body, light.lamp_at_surface, light.bounces, picture.view_borders, picture.rate_ends,
        picture.tiny_frames, depth.depth_contrast,
        depth.depth_kinds, depth.depth_two_layers, depth.depth_highlight, depth.depth_of_views, curves.bd_overlap,
        curves.bd_dents,
        curves.bd_points,
    )
}  # fmt: skip
# Tables with a column for every value of a field: row heads, that field, and content of a cell.
PIVOTS = {
    "rate_ends": (("asked, bit/pixel",), "scheme", ("got, bit/pixel", "PSNR, dB", "said reached")),
    "tiny_frames": (("lenses", "pixels a lens"), "scheme", ("got, bit/pixel", "PSNR, dB")),
    "depth_kinds": (("seen", "pixels"), "noise, steps", ("dissertation", "robust")),
}


def main() -> None:
    """Run all or the chosen cases, record, draw, fill the page."""
    parser = command_line(__doc__)
    parser.add_argument("cases", nargs="*", metavar="case", help=f"all, or some of: {', '.join(CASES)}")
    arguments = parser.parse_args()
    asked = arguments.cases or list(CASES)
    if unknown := set(asked) - set(CASES):
        parser.error(f"unknown case {', '.join(sorted(unknown))}: known are {', '.join(CASES)}")
    RECORDS.run(({"case": name} for name in asked), lambda case: {"rows": CASES[case]()}, arguments.again)
    cases = {name: row["rows"] for name, row in measured().items()}
    if missing := set(CASES) - set(cases):
        print(f"the page lacks results of {', '.join(sorted(missing))}")
        return
    write_chart(chart(cases), "stability.png", dpi=150)
    publish(tables())


def measured() -> dict[str, dict[str, Any]]:
    """Return the newest row of every case, in the order of CASES."""
    return RECORDS.by("case", CASES)


def tables() -> Tables:
    """Return the tables of the page of stability."""
    page, cases = "docs/stability.md", measured()
    parts = {name: excerpt(name, row["rows"]) for name, row in cases.items()}
    made = {**parts, "convergence": orders(), "origins": origins(cases)}
    return {(page, name): lines for name, lines in made.items()}


def excerpt(name: str, rows: list[Row]) -> list[str]:
    """Return the table of a case's shown part."""
    shown = EXCERPTS.get(name, Excerpt(across=False))
    part = shown.of(rows)
    return table(part, PIVOTS.get(name)) if not shown.across else table(across(part))


def across(rows: list[Row]) -> list[Row]:
    """Return a row for each column but the first, whose values become columns."""
    first, *rest = rows[0]
    return [{first: name, **{number(row[first]): row.get(name) for row in rows}} for name in rest]


def origins(cases: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return a sentence with the commit of most cases, then the others'."""
    by_commit: dict[str, list[str]] = {}
    for name, row in cases.items():
        by_commit.setdefault(row["commit"], []).append(name)
    most, *others = sorted(by_commit, key=lambda commit: -len(by_commit[commit]))
    rest = [f"{', '.join(f'`{name}`' for name in by_commit[commit])} by `{commit}`" for commit in others]
    return ["; ".join([f"Cases are measured by `{most}`", *rest]) + "."]


def orders() -> list[str]:
    """Return fitted and expected orders of convergence, and the lens images."""
    found = convergence.measured()
    first, last = found["rows"][0], found["rows"][-1]
    lines = []
    for name, expected in found["expected"].items():
        values = [name.replace("_", ", "), *map(number, (first[name], last[name], found["orders"][name]))]
        lines.append(f"{' | '.join(values)} ({expected})")
    for kind, expected in (("flat", 1), ("smooth", 2)):
        ends = [number(found["lenses"][i][kind]) for i in (0, -1)]
        lines.append(f"ball lens, {kind} | {ends[0]} | {ends[1]} | {number(found['lens_orders'][kind])} ({expected})")
    worst = max(abs(row["off"]) for row in found["images"])
    heads = f"error | {first['segments']} segments | {last['segments']} segments | order"
    told = f"Images of a ball lens lie where Gauss puts them to {worst:.1g} of their distance."
    return [*markdown(heads, lines), "", origin(found["parts"]), told]


def table(rows: list[Row], pivot: Any = None) -> list[str]:
    """Return rows as Markdown: all of them, or one cell for every value of a column."""
    if pivot is None:
        return markdown(" | ".join(rows[0]), ([number(row.get(head)) for head in rows[0]] for row in rows))
    index, column, shown = pivot
    columns = list(dict.fromkeys(row[column] for row in rows))
    heads = [*index, *(f"{name}: {', '.join(shown)}" if i == 0 else str(name) for i, name in enumerate(columns))]
    grid: dict[tuple[Any, ...], dict[Any, str]] = {}
    for row in rows:
        cell = " · ".join(number(row[key]) for key in shown)
        grid.setdefault(tuple(row[key] for key in index), {})[row[column]] = cell
    body = ([*map(number, key), *(cells.get(name, "") for name in columns)] for key, cells in grid.items())
    return markdown(" | ".join(heads), body)


def number(value: Any) -> str:
    """Return a value as text of a cell."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.3g}"
    return str(value)


# Panels of the chart: case, abscissa, ordinate, logarithmic axis, title.
PANELS: list[tuple[str, str, list[str], str, str]] = [
    ("lift", "lift", ["0 radii off", "10 radii off", "1000 radii off"], "x", "lit points that a ball shades itself"),
    ("scales", "radii off", ["form off, radii"], "xy", "form error of a ball far off"),
    ("coplanar", "gap / distance", ["far wall seen"], "x", "rays that take the wrong of two walls"),
    ("bad_faces", "share of faces", ["glass, turned", "glass, missing", "mirror, missing"], "x", "broken meshes, dB"),
    ("huge_beside_tiny", "floor, mm", ["shadows there"], "x", "shadows of 0.02 mm grains on a floor"),
    ("covered", "height, sagittas", ["in shadow"], "", "shadow of a sheet over a smooth face"),
    ("grazing", "angle, rad", ["place off by, mm"], "xy", "hits at grazing angles, mm off"),
    ("view_borders", "of half the viewing angle", ["PSNR of linear light, dB"], "", "views from aside, dB"),
    ("bounces", "depth", ["light missing"], "y", "light missing in a room of mirrors"),
    ("depth_contrast", "contrast, steps", [f"{method}, σ {sigma}" for method in METHODS for sigma in (0, 1)], "x",
     "depth of a wall found, share"),
    ("depth_two_layers", "of the light from behind", [f"mirror, robust: {what}" for what in ("wall", "behind")], "",
     "depth in a half mirror, share"),
    ("depth_highlight", "strength", ["dissertation", "robust"], "", "depth under a highlight, share"),
    ("bd_overlap", "curves share", ["off the whole curves', median", "off what they share, median"], "y",
     "BD-rate of curves cut apart, % off"),
    ("bd_points", "points a curve", ["akima, most", "cubic, most"], "y", "BD-rate by points, % off"),
]  # fmt: skip


def chart(cases: Mapping[str, list[Row]]) -> Any:
    """Draw one panel per sweep."""
    figure = new_figure(8.5, 16.6)
    for axes, (case, across, names, logarithmic, title) in zip(figure.subplots(7, 2).flat, PANELS, strict=True):
        rows = [row for row in cases[case] if row[across] is not None]
        smallest = min(row[across] for row in rows if row[across] > 0)
        for i, name in enumerate(names):
            chosen = [row for row in rows if row.get(name) is not None]
            # a logarithmic axis has no 0: draw it a third of a decade before the rest
            x = [row[across] if row[across] > 0 or "x" not in logarithmic else smallest / 3 for row in chosen]
            axes.plot(x, [row[name] for row in chosen], "os^D"[i] + "-", color=COLOURS[i], markersize=5, label=name)
        if "x" in logarithmic:
            axes.set_xscale("log")
        if "y" in logarithmic:
            axes.set_yscale("log")
        axes.set_title(title, loc="left", fontsize=10)
        axes.set_xlabel(across)
        tidy(axes)
        if len(names) > 1:
            axes.legend(frameon=False, fontsize=9)
    return figure
