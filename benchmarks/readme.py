"""Put measured pictures and figures where the README shows them: ``python -m benchmarks.readme``.

Takes the studies of ``make demo`` (out/demo) and of ``python -m benchmarks.demo --scale 1 -o out/full``, keeps their
numbers in ``benchmarks/results`` and fills the tables between the marks of README and docs/study.md from what is
kept there.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

from metrics import read_study, summary_table

ROOT = Path(__file__).parent.parent
RESULTS = ROOT / "benchmarks" / "results"
IMAGES = ROOT / "docs" / "images"
SIZES = {"demo": "4096×2048, 256×128 lenses (the demo)", "full": "8192×4096, 512×256 lenses (full `setup1`)"}
SHOWN = ("apples_detail.png", "apples_view_front.png", "apples_projection.png", "cuboid_projection.png")


def main() -> None:
    """Copy what was measured and fill the tables."""
    IMAGES.mkdir(parents=True, exist_ok=True)
    for run in SIZES:
        for study in sorted((ROOT / "out" / run).glob("*_rd.json")):
            shutil.copy(study, RESULTS / f"{run}_{study.name}")
            shutil.copy(study.with_suffix(".png"), IMAGES / f"{run}_{study.stem}.png")
    for name in SHOWN:
        shutil.copy(ROOT / "out" / "demo" / name, IMAGES / name)
    readme = ROOT / "README.md"
    text = readme.read_text(encoding="utf-8")
    for mark, lines in (("gain", gain_table()), ("disparity", disparity_table()), ("speed", speed_table())):
        text = filled(text, mark, lines)
    readme.write_text(text, encoding="utf-8")
    fill(ROOT / "docs" / "study.md", "gain", gain_table())


def filled(text: str, mark: str, lines: list[str]) -> str:
    """The text with these lines between ``<!-- mark -->`` and ``<!-- /mark -->``."""
    begin, end = f"<!-- {mark} -->\n", f"<!-- /{mark} -->"
    before, after = text.index(begin) + len(begin), text.index(end)
    return "\n".join([text[:before], *lines, "", text[after:]])


def fill(path: Path, mark: str, lines: list[str]) -> None:
    """Put lines between the marks of a document on disk."""
    path.write_text(filled(path.read_text(encoding="utf-8"), mark, lines), encoding="utf-8")


def gain_table() -> list[str]:
    """Gain of the pseudo video sequences over JPEG 2000, by scene and size."""
    lines = ["| scene | picture | SI-PVS | RI-PVS | EI-PVS |", "|---|---|---|---|---|"]
    for path in sorted(RESULTS.glob("*_*_rd.json")):
        run, scene, _ = path.stem.split("_")
        gains = {row["scheme"]: row["gain"] for row in summary_table(read_study(path))}
        cells = " | ".join(gains[f"{kind}-h264"] for kind in ("si", "ri", "ei"))
        lines.append(f"| {scene} | {SIZES[run]} | {cells} |")
    return lines


def disparity_table() -> list[str]:
    """What moves and what vanishes between neighbouring sub-images."""
    head = (
        "| scene | lenses | median disparity | 90 % below | beyond motion range | no partner | step between pixels |"
    )
    return [head, "|---|---|---|---|---|---|---|"] + [
        f"| {row['scene']} | {512 // row['scale']}×{256 // row['scale']} | {row['median_px']:.1f} px | "
        f"{row['p90_px']:.1f} px | {row['beyond_motion_range']:.0%} | {row['without_partner']:.0%} | "
        f"{row['detail']:.1f} codes |"
        for row in _load("disparity.json")["rows"]
    ]


def speed_table() -> list[str]:
    """The ratios of `benchmarks.speed` beside their targets."""
    lines = ["| | target | median | from … to |", "|---|---|---|---|"]
    return lines + [
        f"| {row['what']} | {row['target']} | {row['median']:.2f} | {min(row['all']):.2f} … {max(row['all']):.2f} |"
        for row in _load("speed.json")["rows"]
    ]


def _load(name: str) -> Any:
    return json.loads((RESULTS / name).read_text(encoding="utf-8"))


if __name__ == "__main__":
    main()
