"""Measured pictures and figures of the README: ``python -m benchmarks run readme``.

Copies the numbers of ``make demo`` (out/demo) and of ``python examples/demo.py --scale 1 -o out/full`` to
``benchmarks/results``, and fills the tables of README and docs/study.md from there.
"""

from __future__ import annotations

import shutil

from benchmarks.coding import disparity, light_field
from benchmarks.pages.pictures import IMAGES, write_picture
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import ROOT, commit_of, origin, with_commits
from benchmarks.speed import ratios
from metrics import read_study, summary_table

RESULTS = ROOT / "benchmarks" / "results"
SIZES = {"demo": "4096×2048, 256×128 lenses (the demo)", "full": "8192×4096, 512×256 lenses (full `setup1`)"}
SHOWN = ("apples_detail", "apples_view_front")


def main() -> None:
    """Copy measured numbers and pictures, and fill the tables."""
    IMAGES.mkdir(parents=True, exist_ok=True)
    for run in SIZES:
        for study in sorted((ROOT / "out" / run).glob("*_rd.json")):
            shutil.copy(study, RESULTS / f"{run}_{study.name}")
            write_picture(IMAGES / f"{run}_{study.stem}.png", study.with_suffix(".png"))
    for name in SHOWN:
        write_picture(IMAGES / f"{name}.webp", ROOT / "out" / "demo" / f"{name}.png")
    publish(tables())


def tables() -> Tables:
    """Return the tables of the README; one is also on the page of the study."""
    made = {("README.md", "gain"): gain_table(), ("docs/study.md", "gain"): gain_table()}
    made["README.md", "light-field"] = light_field.tables()["docs/lf.md", "lf-against"]
    return {**made, ("README.md", "disparity"): disparity_table(), ("README.md", "speed"): speed_table()}


def gain_table() -> list[str]:
    """Return the gain of pseudo video sequences over JPEG 2000 by scene and size."""
    lines = ["| scene | picture | SI-PVS | RI-PVS | EI-PVS |", "|---|---|---|---|---|"]
    commits = []
    for path in sorted(RESULTS.glob("*_*_rd.json")):
        run, scene, _ = path.stem.split("_")
        study = read_study(path)
        gains = {row["scheme"]: row["gain"] for row in summary_table(study, anchor="jpeg2000")}
        cells = " | ".join(gains[f"{kind}-h264"] for kind in ("si", "ri", "ei"))
        lines.append(f"| {scene} | {SIZES[run]} | {cells} |")
        commits.append(commit_of(study))
    told = origin({"commit": commit} for commit in commits)
    return [*with_commits(lines, [[commit] for commit in commits]), "", told]


def disparity_table() -> list[str]:
    """Return disparity and occlusion between neighbouring sub-images."""
    head = (
        "| scene | lenses | median disparity | 90th percentile | beyond motion range | occluded "
        "| step between pixels |"
    )
    rows = disparity.RECORDS.rows()
    lines = [head, "|---|---|---|---|---|---|---|"] + [
        f"| {row['scene']} | {512 // row['scale']}×{256 // row['scale']} | {row['median_px']:.1f} px | "
        f"{row['p90_px']:.1f} px | {row['beyond_motion_range']:.0%} | {row['without_partner']:.0%} | "
        f"{row['detail']:.1f} codes |"
        for row in rows
    ]
    return [*with_commits(lines, [[row["commit"]] for row in rows]), "", origin(rows)]


def speed_table() -> list[str]:
    """Return the ratios of `benchmarks.speed.ratios` beside their targets."""
    rows = ratios.measured()
    lines = ["| | target | median | from … to |", "|---|---|---|---|"] + [
        f"| {row['what']} | {row['target']} | {row['median']:.2f} | {min(row['all']):.2f} … {max(row['all']):.2f} |"
        for row in rows
    ]
    return [*with_commits(lines, [[row["commit"]] for row in rows]), "", origin(rows)]


if __name__ == "__main__":
    main()
