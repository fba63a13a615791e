"""Put what was measured of coders into docs/coding.md and speed_accuracy.md: ``python -m benchmarks.coding_docs``."""

from __future__ import annotations

import json
import statistics
from pathlib import Path
from typing import Any

from benchmarks.bframes import RESULTS
from benchmarks.coders import ANCHOR, NEAR, TRIALS, chart, front, recommended, table
from benchmarks.readme import fill, filled

DOCS = Path(__file__).parent.parent / "docs"
PAGE, SPEED = DOCS / "coding.md", DOCS / "speed_accuracy.md"


def main() -> None:
    """Fill the page from coders.json, coders_full.json and bframes.json."""
    text = PAGE.read_text(encoding="utf-8")
    names = ("coders.json", "coders_full.json", "bframes.json")
    coders, full, bframes = (json.loads((RESULTS / name).read_text()) for name in names)
    trials = [row for row in coders["rows"] if row["scheme"] in {*TRIALS, ANCHOR}]
    others = [row for row in coders["rows"] if row["scheme"] not in TRIALS]
    best = ", ".join(f"`{row['scheme']}`" for row in front(others))
    for mark, lines in (
        ("coders", [size(coders), "", *table(others), "", f"Nothing quicker is better than: {best}."]),
        ("full", [size(full), "", *table(full["rows"])]),
        ("trials", [size(coders), "", *table(trials)]),
        ("bframes", bframes_table(bframes)),
    ):
        text = filled(text, mark, lines)
    PAGE.write_text(text, encoding="utf-8")
    for study, name in ((coders, "coders.png"), (full, "coders_full.png")):
        for folder in (RESULTS, DOCS / "images"):
            chart(study["rows"], study["scale"], folder / name)
    fill(SPEED, "coding", [size(coders), "", *front_table(coders["rows"])])


def front_table(rows: list[dict[str, Any]]) -> list[str]:
    """What nothing quicker beats, the recommended setting in bold."""
    lines = ["| take | rate at equal PSNR | CPU s of a run | CPU s to decode |", "|---|---|---|---|"]
    pick = recommended(rows)["scheme"]
    for row in front([row for row in rows if row["scheme"] not in TRIALS]):
        points = [point for one in rows if one["scheme"] == row["scheme"] for point in one["points"]]
        decode = statistics.mean(point["decode_seconds"] for point in points)
        name = f"**`{row['scheme']}`**" if row["scheme"] == pick else f"`{row['scheme']}`"
        lines.append(f"| {name} | {1 + row['mean'] / 100:.2f} × | {row['seconds']:.2f} | {decode:.2f} |")
    return [*lines, "", f"In bold the quickest whose rate is within {NEAR:.0%} of the least."]


def size(study: dict[str, Any]) -> str:
    """What was coded, and what the seconds are."""
    return f"Pictures of `setup1` at scale {study['scale']}; CPU seconds of one run, mean over qualities and scenes."


def bframes_table(study: dict[str, Any]) -> list[str]:
    """Difference in dB against no B pictures, by condition and number."""
    scenes = list(dict.fromkeys(row["scene"] for row in study["rows"]))
    lines = [f"| `setup1` at scale {study['scale']} | {' | '.join(scenes)} |", "|---" * (len(scenes) + 1) + "|"]
    for condition in dict.fromkeys(row["condition"] for row in study["rows"]):
        own = {row["scene"]: row["psnr"] for row in study["rows"] if row["condition"] == condition}
        cells = [" · ".join(map(_decibel, own.get(scene, {}).values())) or "–" for scene in scenes]
        lines.append(f"| {condition} | {' | '.join(cells)} |")
    return lines


def _decibel(value: float | None) -> str:
    return "–" if value is None else f"{value:+.2f}"


if __name__ == "__main__":
    main()
