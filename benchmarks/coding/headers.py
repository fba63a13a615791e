"""Header portions, measured and predicted, and the best kind of component image at equal rates.

    python -m benchmarks run headers [--scale 4] [--scene apples] [--schemes si-hevc,...] [--sides 16,64]

The pictures are those of ``setup2`` with fewer lenses and elementary images of 16² to 256² pixels. For every scheme
and structure, a black picture and the scene are coded at the coarsest quantiser. For streams that are parsed, the
bits of parameter sets and slice headers are counted. For H.264, PSNR of sub-images, elementary images and ray-space
images at equal rates is compared with the predictions (5.14) and (5.15). Every scheme with every structure is a row
of ``benchmarks/results/headers.jsonl``; tables go into ``docs/structure.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from functools import lru_cache
from typing import Any

import numpy as np

from benchmarks.arguments import command_line
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin, table
from codec import decode, encode, schemes
from codec.inspect.header_bits import coarsest, floor, frames, parts, si_below_ei, si_below_ri
from ii_core import IIPicture, preset
from metrics import q_global
from raytrace_ii import load_scene, render

RECORDS = Records("headers", ("benchmarks.coding.headers",))
SCENE, SCALE = "apples", 4  # conditions of the page
SIDES = (16, 32, 64, 128, 256)
SHOWN = (16, 64, 256)  # sides in the table of bits
RATES = (0.05, 0.1, 0.2, 0.4, 0.8, 1.6)
KINDS = ("si", "ei", "ri")


def main() -> None:
    """Measure, print, record and fill the tables."""
    parser = command_line(__doc__, scale=SCALE, schemes=schemes())
    parser.add_argument("--scene", default=SCENE)
    parser.add_argument("--sides", default=",".join(map(str, SIDES)))
    asked = parser.parse_args()
    picture_of = {"scene": asked.scene, "scale": asked.scale}
    keys: list[dict[str, Any]] = []
    for side in map(int, asked.sides.split(",")):
        keys += [{"part": "floor", **picture_of, "side": side, "scheme": scheme} for scheme in asked.schemes]
        if asked.schemes == parser.get_default("schemes"):
            keys.append({"part": "duel", **picture_of, "side": side})
    RECORDS.run(keys, measured, asked.again)
    publish(tables())


def measured(part: str, scene: str, scale: int, side: int, scheme: str = "") -> dict[str, Any]:
    """Return the floor of a scheme, or the duel of the kinds."""
    picture = pictured(scene, scale, side)
    return lowest(scheme, picture) if part == "floor" else duel(picture)


@lru_cache(maxsize=1)
def pictured(scene: str, scale: int, side: int) -> IIPicture:
    """Return a scene with sensor noise through elementary images of a size."""
    return render(load_scene(scene), preset(f"setup2-{side}", scale=scale), support=(), noise=1.0).picture


def lowest(scheme: str, picture: IIPicture) -> dict[str, Any]:
    """Return the least rates of a scheme for a structure: of a black picture, and of this picture."""
    found: dict[str, Any] = {}
    try:
        black = floor(scheme, picture.lenses, picture.ei_pixels)
        real = coarsest(picture, scheme)
    except ValueError as error:
        return {"refused": str(error)}
    kind = scheme.partition("-")[0]
    if kind in KINDS and "-" in scheme:
        found["frames"] = frames(kind, picture.lenses, picture.ei_pixels)
    found |= {"black_bpp": black.bpp, "floor_bpp": real.bpp, "floor_db": q_global(picture, decode(real))}
    try:
        bits = parts(black.coded)
    except ValueError:
        return found
    return {**found, "parts": asdict(bits)}


def duel(picture: IIPicture) -> dict[str, Any]:
    """Return PSNR of the three kinds at equal rates, H.264 at constant bit rate, without missed rates."""
    psnr: dict[str, dict[float, float]] = {}
    for kind in KINDS:
        psnr[kind] = {}
        for rate in RATES:
            coded = encode(picture, f"{kind}-h264:rate=cbr", bpp=rate)
            if coded.reached:
                psnr[kind][rate] = q_global(picture, decode(coded))
    structure = picture.lenses, picture.ei_pixels
    black = {kind: floor(f"{kind}-h264", *structure).bits for kind in KINDS}
    found: dict[str, Any] = {
        "psnr": {kind: {f"{r:g}": q for r, q in points.items()} for kind, points in psnr.items()}
    }
    for other, predicted in (("ei", si_below_ei(*structure)), ("ri", si_below_ri(*structure))):
        both = psnr["si"].keys() & psnr[other].keys()
        found[other] = {
            "predicted": predicted,
            "fewer_header_bits": black["si"] < black[other],
            "gain_db": float(np.mean([psnr["si"][r] - psnr[other][r] for r in both])) if both else None,
            "rates_both": sorted(both),
            "lowest": {kind: min(psnr[kind], default=None) for kind in ("si", other)},
        }
    return found


def tables() -> Tables:
    """Return the tables of the page of structures."""
    floors, duels = (RECORDS.rows(part=part, scene=SCENE, scale=SCALE) for part in ("floor", "duel"))
    floors.sort(key=lambda row: (row["scheme"], row["side"]))
    page = "docs/structure.md"
    return {
        (page, "floors"): [origin(floors)],  # a chart has the numbers: `benchmarks.pages.floors_chart`
        (page, "parts"): [origin(floors), "", *part_table(floors)],
        (page, "duels"): [origin(duels), "", *duel_table(duels)],
    }


def part_table(rows: list[dict[str, Any]]) -> list[str]:
    """Return the bits per frame of a black picture by purpose, over the structures."""
    shown = [row for row in rows if "parts" in row and row["side"] in SHOWN]
    lines, commits = [], []
    for scheme in dict.fromkeys(row["scheme"] for row in shown):
        own = [row for row in shown if row["scheme"] == scheme]
        bits = [_per_frame(row["parts"], row["frames"]) for row in own]
        cells = ["(in data)" if None in some else _range(some) for some in zip(*bits, strict=True)]
        lines.append([f"`{scheme}`", *cells])
        commits.append([row["commit"] for row in own])
    heads = "scheme | start codes, lengths | parameter sets | slice headers | data | bits per frame"
    return table(heads, lines, commits)


def _per_frame(p: dict[str, Any], frames: int) -> list[float | None]:
    """Return bits of framing, parameter sets, slice headers (None if in the data), data, and all, per frame."""
    data = p["data"] + p["messages"]
    total = p["framing"] + p["parameters"] + (p["headers"] or 0) + data
    sums = (p["framing"], p["parameters"], p["headers"], data, total)
    return [None if bits is None else bits / frames for bits in sums]


def _range(values: Sequence[float]) -> str:
    """Return the least and the greatest value, once if they look alike."""
    return "–".join(dict.fromkeys(f"{value:.1f}" for value in (min(values), max(values))))


def duel_table(rows: list[dict[str, Any]]) -> list[str]:
    """Return gains of SI over EI and RI and the lowest rates that were reached."""
    lines = []
    for row in rows:
        reached = (row["ei"]["lowest"]["si"], row["ei"]["lowest"]["ei"], row["ri"]["lowest"]["ri"])
        lowest = ", ".join("–" if rate is None else f"{rate:g}" for rate in reached)
        lines.append([f"{row['side']}²", gain(row["ei"]), gain(row["ri"]), lowest])
    heads = "EI | over EI, dB | over RI, dB | lowest rate SI, EI, RI, bpp"
    return table(heads, lines, [[row["commit"]] for row in rows])


def gain(row: dict[str, Any]) -> str:
    """Return a gain in dB with the number of rates."""
    return "–" if row["gain_db"] is None else f"{row['gain_db']:+.1f} ({len(row['rates_both'])} rates)"
