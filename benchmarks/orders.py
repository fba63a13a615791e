"""What every order of every kind of component image promises, on the coding scenes, before anything is coded.

    python -m benchmarks.orders [--scale 2] [--scenes apples,twins,car,cuboid]

Correlation of consecutive frames, its spread, and residual energy, (5.3)–(5.7). Numbers go to
``benchmarks/results/orders.json``, the table into ``docs/structure.md``.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from benchmarks.readme import filled
from codec.inspect.order_analysis import analyse_orders
from codec.order import ORDERS
from ii_core import preset
from ii_core.files import write_json
from metrics import provenance
from raytrace_ii import load_scene, render

RESULTS = Path(__file__).parent / "results"
DOCS = Path(__file__).parent.parent / "docs" / "structure.md"


def main() -> None:
    """Measure, print, keep and fill the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scale", type=int, default=2)
    parser.add_argument("--scenes", default="apples,twins,car,cuboid")
    arguments = parser.parse_args()
    rows: list[dict[str, Any]] = []
    for name in arguments.scenes.split(","):
        shot = render(load_scene(name), preset("setup1", scale=arguments.scale), support=(), noise=1.0)
        rows += [{"scene": name, **analysis.to_json()} for analysis in analyse_orders(shot.picture)]
    lines = table(rows)
    print("\n".join(lines))
    write_json(RESULTS / "orders.json", {**provenance(), "camera": "setup1", "scale": arguments.scale, "rows": rows})
    DOCS.write_text(filled(DOCS.read_text(encoding="utf-8"), "orders", lines), encoding="utf-8")


def table(rows: list[dict[str, Any]]) -> list[str]:
    """A row a scene and kind; a column an order: mean correlation, its spread, energy a sample."""
    lines = ["| scene | images | " + " | ".join(ORDERS) + " |", "|---|---|" + "---|" * len(ORDERS)]
    for scene, kind in dict.fromkeys((row["scene"], row["kind"]) for row in rows):
        those = {row["order"]: row for row in rows if (row["scene"], row["kind"]) == (scene, kind)}
        best = max(those, key=lambda order: those[order]["correlation_mean"])
        cells = []
        for order in ORDERS:
            r = those[order]
            cell = f"{r['correlation_mean']:.3f} ± {r['correlation_sigma']:.3f}, {r['energy_per_sample']:.0f}"
            cells.append(f"**{cell}**" if order == best else cell)
        lines.append(f"| {scene} | {kind.upper()} | " + " | ".join(cells) + " |")
    return lines


if __name__ == "__main__":
    main()
