"""Encoder command for `raytrace-ii benchmark`: JPEG Pleno's 4-D transform mode at a target size.

python examples/jplm_encoder.py FOLDER FILE BYTES ROWS COLUMNS WIDTH HEIGHT
FOLDER holds views as YCbCr in PGX (``--views ycbcr``). The program ``jpl-encoder-bin`` of JPEG Pleno's reference
software must be on the path. It has a Lagrangian multiplier, no target: bisection finds the least one with at most
BYTES bytes. Transforms cover all views.
"""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

LEAST, MOST, RUNS = 0.01, 1e8, 12  # the multiplier is found to 0.6 %


def main() -> None:
    """Write the largest file within the target."""
    if len(sys.argv) != 8:
        raise SystemExit(__doc__)
    folder, file, limit, *sizes = sys.argv[1:]
    low, high = LEAST, MOST
    if encoded(folder, file, MOST, sizes) > int(limit):
        raise SystemExit(f"{limit} bytes are too few: the smallest file has {Path(file).stat().st_size}")
    last = MOST
    for _ in range(RUNS):
        last = math.sqrt(low * high)
        low, high = (low, last) if encoded(folder, file, last, sizes) <= int(limit) else (last, high)
    if last != high:
        encoded(folder, file, high, sizes)


def encoded(folder: str, file: str, multiplier: float, sizes: list[str]) -> int:
    """Write a file; return its length in bytes."""
    rows, columns, width, height = sizes
    words = ["jpl-encoder-bin", "--part", "2", "--type", "0", "--enum-cs", "YCbCr_2", "--border_policy", "1"]
    words += ["--number_of_rows", rows, "--number_of_columns", columns]
    words += ["--view_width", width, "--view_height", height]
    ends = {
        "inter_view_vertical": (rows, rows),
        "inter_view_horizontal": (columns, columns),
        "intra_view_vertical": (min(int(height), 64), 4),
        "intra_view_horizontal": (min(int(width), 64), 4),
    }
    for name, (largest, smallest) in ends.items():
        words += [f"--transform_size_maximum_{name}", str(largest), f"--transform_size_minimum_{name}", str(smallest)]
    Path(file).unlink(missing_ok=True)
    subprocess.run([*words, "--lambda", f"{multiplier:g}", "-i", folder, "-o", file], check=True, capture_output=True)
    return Path(file).stat().st_size


if __name__ == "__main__":
    main()
