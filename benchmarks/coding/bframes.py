"""B pictures: gain or loss against none, with one condition of Table 5.5 changed at a time.

``python -m benchmarks run bframes --scale 4`` codes sub-images of four scenes with 0 to 3 and 7 B pictures between P
pictures under several conditions. The result is the Bjøntegaard difference in PSNR to the same condition without B
pictures, one row per scene and condition in ``benchmarks/results/bframes.jsonl``.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from benchmarks.arguments import command_line
from benchmarks.coding.rd import climbing, rd_point
from benchmarks.records import Records, origin, table
from ii_core import IIPicture, preset
from metrics import bd_psnr
from metrics.rates.rd import UndefinedDifference
from raytrace_ii import load_scene, render

RECORDS = Records("bframes", ("benchmarks.coding.bframes", "benchmarks.coding.rd"))
SCALE = 4  # scale on the page
COUNTS = (1, 2, 3, 7)
QUANTISERS = (21, 27, 33, 39, 45)
RATES = (0.1, 0.2, 0.4, 0.8, 1.6)
CQ = [{"qp": quantiser} for quantiser in QUANTISERS]
# Conditions that change little: in the records, not on the page.
LITTLE = (
    "GOP of 32", "order row, not parallel", "an encoder in haste (veryfast)", "constant bit rate",
    "MPEG-2", "HEVC, constant quantiser",
)  # fmt: skip
# Condition: scheme and goals.
CONDITIONS: list[tuple[str, str, list[dict[str, Any]]]] = [
    ("constant quantiser, B coarser by 1.3, 4:2:0", "si-h264:rate=cq,chroma=420", CQ),
    ("the same at 4:4:4", "si-h264:rate=cq", CQ),
    ("B as fine as P", "si-h264:rate=cq,chroma=420,pbratio=1", CQ),
    ("B coarser by 2", "si-h264:rate=cq,chroma=420,pbratio=2", CQ),
    ("B predict B", "si-h264:rate=cq,chroma=420,pyramid=1", CQ),
    ("B predict B, as fine as P", "si-h264:rate=cq,chroma=420,pyramid=1,pbratio=1", CQ),
    ("GOP of 32", "si-h264:rate=cq,chroma=420,gop=32", CQ),
    ("order row, not parallel", "si-h264:rate=cq,chroma=420,order=row", CQ),
    ("an encoder in haste (veryfast)", "si-h264:rate=cq,chroma=420,preset=veryfast", CQ),
    ("constant bit rate", "si-h264:chroma=420,rate=cbr", [{"bpp": bpp} for bpp in RATES]),
    ("rate factor, macroblock tree, B predict B", "si-h264:rate=crf,chroma=420,pyramid=1", CQ),
    ("MPEG-2", "si-mpeg2", [{"qp": quantiser} for quantiser in (2, 4, 8, 14, 22)]),
    ("HEVC, constant quantiser", "si-hevc:rate=cq,preset=medium,chroma=420", CQ),
]


def main() -> None:
    """Measure and record."""
    asked = command_line(__doc__, scale=SCALE, scenes=("apples", "twins", "car", "cuboid")).parse_args()
    conditions = [name for name, *_ in CONDITIONS]
    RECORDS.run(
        ({"scene": scene, "scale": asked.scale, "condition": name} for scene in asked.scenes for name in conditions),
        measured,
        asked.again,
    )


def measured(scene: str, scale: int, condition: str) -> dict[str, Any]:
    """Return the scheme of a condition, and its differences."""
    ((scheme, goals),) = (rest for name, *rest in CONDITIONS if name == condition)
    return {"scheme": scheme, "psnr": differences(pictured(scene, scale), scheme, goals)}


@lru_cache(maxsize=1)
def pictured(scene: str, scale: int) -> IIPicture:
    """Return a scene with sensor noise."""
    return render(load_scene(scene), preset("setup1", scale=scale), noise=1.0, support=()).picture


def conditions_table() -> list[str]:
    """Return the table of differences in dB to no B pictures, by condition and number."""
    rows = [row for row in RECORDS.rows(scale=SCALE) if row["condition"] not in LITTLE]
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    cells, commits = [], []
    for condition in dict.fromkeys(row["condition"] for row in rows):
        own = {row["scene"]: row for row in rows if row["condition"] == condition}
        each = [", ".join(map(_decibel, own[s]["psnr"].values())) if s in own else "–" for s in scenes]
        cells.append([condition, *each])
        commits.append([row["commit"] for row in own.values()])
    return [origin(rows), "", *table(" | ".join([f"`setup1` at scale {SCALE}", *scenes]), cells, commits)]


def _decibel(value: float | None) -> str:
    return "–" if value is None else f"{value:+.2f}"


def differences(picture: IIPicture, scheme: str, asked: list[dict[str, Any]]) -> dict[str, float | None]:
    """Return mean differences in dB to no B pictures by their number; None for undefined differences."""
    most = 3 if "mpeg2" in scheme else max(COUNTS)
    without = curve(picture, scheme, 0, asked)
    out: dict[str, float | None] = {}
    for count in COUNTS:
        if count <= most:
            try:
                out[str(count)] = round(bd_psnr(*without, *curve(picture, scheme, count, asked)), 2)
            except UndefinedDifference:
                out[str(count)] = None
    return out


def curve(
    picture: IIPicture, scheme: str, count: int, asked: list[dict[str, Any]]
) -> tuple[list[float], list[float]]:
    """Return rates and PSNR with a number of B pictures."""
    comma = "," if ":" in scheme else ":"
    points = []
    for goal in asked:
        point = rd_point(picture, f"{scheme}{comma}bframes={count}", **goal)
        points.append({"bpp": point.bpp, "psnr": point.q_global})
    kept = climbing(points)
    return [point["bpp"] for point in kept], [point["psnr"] for point in kept]
