"""Correlation and residual energy of every order of component images, before coding.

    python -m benchmarks run orders [--scale 2] [--scenes apples,twins,car,cuboid]

Results are mean and standard deviation of the correlation of consecutive frames, and residual energy, (5.3)–(5.7).
Numbers go to ``benchmarks/results/orders.jsonl``, the table into ``docs/structure.md``.
"""

from __future__ import annotations

from typing import Any

from benchmarks.arguments import command_line
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin, table
from codec.inspect.order_analysis import analyse_orders
from codec.order import ORDERS
from ii_core import preset
from raytrace_ii import load_scene, render

RECORDS = Records("orders", ("benchmarks.coding.orders",))
SCALE = 2  # scale on the page


def main() -> None:
    """Measure, print, record and fill the table."""
    asked = command_line(__doc__, scale=SCALE, scenes=("apples", "twins", "car", "cuboid")).parse_args()
    RECORDS.run(({"scene": name, "scale": asked.scale} for name in asked.scenes), analysed, asked.again)
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
    return {("docs/structure.md", "orders"): orders_table(measured(SCALE))}


def orders_table(rows: list[dict[str, Any]]) -> list[str]:
    """Return a table of scenes and kinds by orders: mean correlation ± deviation, energy per sample."""
    cells, commits = [], []
    for scene, kind in dict.fromkeys((row["scene"], row["kind"]) for row in rows):
        those = {row["order"]: row for row in rows if (row["scene"], row["kind"]) == (scene, kind)}
        best = max(those, key=lambda order: those[order]["correlation_mean"])
        each = {
            order: f"{r['correlation_mean']:.3f} ± {r['correlation_sigma']:.3f}, {r['energy_per_sample']:.0f}"
            for order, r in those.items()
        }
        each[best] = f"**{each[best]}**"
        cells.append([scene, kind.upper(), *(each[order] for order in ORDERS)])
        commits.append([row["commit"] for row in those.values()])
    return [origin(rows), "", *table(" | ".join(["scene | images", *ORDERS]), cells, commits)]
