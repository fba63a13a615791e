"""Correlation and residual energy of every order of component images, before coding.

    python -m benchmarks run orders [--scale 2] [--scenes apples,twins,car,cuboid]

Results are mean and standard deviation of the correlation of consecutive frames, and residual energy, (5.3)–(5.7).
Numbers go to ``benchmarks/results/orders.jsonl``, the table into ``docs/structure.md``.
"""

from __future__ import annotations

from typing import Any

from benchmarks.arguments import command_line
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin, with_commits
from codec.inspect.order_analysis import analyse_orders
from codec.order import ORDERS
from ii_core import preset
from raytrace_ii import load_scene, render

RECORDS = Records("orders", ("benchmarks.coding.orders",))
SCALE = 2  # scale on the page


def main() -> None:
    """Measure, print, record and fill the table."""
    asked = command_line(__doc__, scale=SCALE, scenes=("apples", "twins", "car", "cuboid")).parse_args()
    keys = [{"scene": name, "scale": asked.scale} for name in asked.scenes]
    for key in RECORDS.todo(keys, asked.again):
        RECORDS.measure(key, lambda key=key: analysed(**key))
    print("\n".join(table(measured(asked.scale))))
    publish(tables())


def analysed(scene: str, scale: int) -> dict[str, Any]:
    """Return results of all orders of all kinds of component images of one scene."""
    shot = render(load_scene(scene), preset("setup1", scale=scale), support=(), noise=1.0)
    return {"orders": [analysis.to_json() for analysis in analyse_orders(shot.picture)]}


def measured(scale: int) -> list[dict[str, Any]]:
    """Return one row per order from the newest records of a scale."""
    return [
        {"scene": row["scene"], "commit": row["commit"], **one}
        for row in RECORDS.rows(scale=scale)
        for one in row["orders"]
    ]


def tables() -> Tables:
    """Return the table of the page of structures."""
    return {("docs/structure.md", "orders"): table(measured(SCALE))}


def table(rows: list[dict[str, Any]]) -> list[str]:
    """Return a table of scenes and kinds by orders: mean correlation ± deviation, energy per sample."""
    lines = ["| scene | images | " + " | ".join(ORDERS) + " |", "|---|---|" + "---|" * len(ORDERS)]
    commits = []
    for scene, kind in dict.fromkeys((row["scene"], row["kind"]) for row in rows):
        those = {row["order"]: row for row in rows if (row["scene"], row["kind"]) == (scene, kind)}
        best = max(those, key=lambda order: those[order]["correlation_mean"])
        cells = []
        for order in ORDERS:
            r = those[order]
            cell = f"{r['correlation_mean']:.3f} ± {r['correlation_sigma']:.3f}, {r['energy_per_sample']:.0f}"
            cells.append(f"**{cell}**" if order == best else cell)
        lines.append(f"| {scene} | {kind.upper()} | " + " | ".join(cells) + " |")
        commits.append([row["commit"] for row in those.values()])
    return [origin(rows), "", *with_commits(lines, commits)]
