"""Put what was measured into docs/coding.md: ``python -m benchmarks.coding_docs``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from benchmarks.bframes import RESULTS
from benchmarks.coders import ANCHOR, TRIALS, front, table
from benchmarks.readme import filled

PAGE = Path(__file__).parent.parent / "docs" / "coding.md"


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
