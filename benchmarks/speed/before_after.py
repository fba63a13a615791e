"""Effect of a change of the code on rendered pictures and on the anchor coder.

``python -m benchmarks run before_after -- b1dc540 --scenes twins,hairdo --scale 4`` renders each scene by the code of
that commit, in a work tree of its own, and by the present code. It reports the PSNR of the two pictures, the share of
pixels that differ by more than 8 codes in a channel, and the rate of ``si-h264`` at equal quality (Bjøntegaard).
Pictures for coding have the tables' sensor noise, equal in both; pictures for comparison have none. One row per scene
is appended to ``results/before_after.jsonl``.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.arguments import command_line
from benchmarks.coding.rd import rd_point
from benchmarks.records import ROOT, Records
from ii_core import IIPicture
from ii_core.base.files import read_image
from metrics import bd_rate
from metrics.rates.rd import UndefinedDifference

RECORDS = Records("before_after", ("benchmarks.speed.before_after", "benchmarks.coding.rd"))
SCHEME, QUANTISERS = "si-h264:rate=cq", (21, 26, 31, 36, 41)
VISIBLE = 8  # 8-bit codes


def main() -> None:
    """Render by both, compare, code, print and record."""
    parser = command_line(__doc__, scale=4, scenes=("apples", "twins", "car", "cuboid"))
    parser.add_argument("commit", help="of the code before")
    asked = parser.parse_args()
    scenes = asked.scenes
    keys = RECORDS.todo(
        ({"before": asked.commit, "scene": scene, "scale": asked.scale} for scene in scenes), asked.again
    )
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        before = folder / "code"
        git = ["git", "-C", str(ROOT), "worktree"]
        subprocess.run([*git, "add", "-q", "--detach", before, asked.commit], check=True)
        try:
            for key in keys:
                record = RECORDS.measure(key, lambda key=key: both(key["scene"], key["scale"], before, folder))
                print(key["scene"], json.dumps(record["result"]), flush=True)
        finally:
            subprocess.run([*git, "remove", "--force", before], check=True)


def both(scene: str, scale: int, before: Path, folder: Path) -> dict[str, Any]:
    """Render a scene by the earlier and by the present code, and compare."""
    for code, at in (("before", before), ("after", ROOT)):
        rendered(at, scene, scale, folder / f"{code}.png", folder / f"{code}.exr")
        rendered(at, scene, scale, folder / f"{code}_noisy.png", None)
    return compared(folder)


def rendered(code: Path, scene: str, scale: int, picture: Path, depth: Path | None) -> None:
    """Render a scene by the code in a folder, with depth or with the tables' noise."""
    more = ["--noise", "1"] if depth is None else ["--depth", str(depth)]
    subprocess.run(
        [sys.executable, "-m", "raytrace_ii.cli", "render", scene, "--scale", str(scale), "--force",
         "-o", str(picture), *more],
        cwd=code, env={**os.environ, "PYTHONPATH": str(code)}, check=True, stdout=subprocess.DEVNULL,
    )  # fmt: skip


def compared(folder: Path) -> dict[str, Any]:
    """Return differences of the pictures, over all pixels and over objects, and rates at equal quality."""
    before, after = (read_image(folder / f"{code}.png").astype(float) for code in ("before", "after"))
    objects = np.isfinite(read_image(folder / "after.exr")[..., 0])
    off = np.abs(after - before).max(axis=2) > VISIBLE
    error = float(np.mean((after - before) ** 2))
    curves = [points(IIPicture.load(folder / f"{code}_noisy.png")) for code in ("before", "after")]
    try:
        rate = bd_rate(*curves[0], *curves[1])
    except UndefinedDifference:
        rate = float("nan")
    return {
        "psnr_db": 10 * np.log10(255**2 / error) if error else None,
        "pixels_off_percent": 100 * float(off.mean()),
        "object_pixels_off_percent": 100 * float(off[objects].mean()),
        "bd_rate_percent": rate,
        "before_bpp_db": list(zip(*curves[0], strict=True)),
        "after_bpp_db": list(zip(*curves[1], strict=True)),
    }


def points(picture: IIPicture) -> tuple[list[float], list[float]]:
    """Return rates in bits per pixel and Q_global in dB."""
    found = [rd_point(picture, SCHEME, qp=qp) for qp in QUANTISERS]
    return [point.bpp for point in found], [point.q_global for point in found]


if __name__ == "__main__":
    main()
