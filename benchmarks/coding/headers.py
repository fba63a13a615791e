"""Header portions, measured and predicted, and the best kind of component image at equal rates.

    python -m benchmarks run headers [--scale 4] [--scene apples] [--schemes si-hevc,...] [--sides 16,64]

The pictures are those of ``setup2`` with fewer lenses and elementary images of 16² to 256² pixels. For every scheme
and structure, a black picture and the scene are coded at the coarsest quantiser. For streams that are parsed, the
bits of parameter sets and slice headers are counted. For H.264, PSNR of sub-images, elementary images and ray-space
images at equal rates is compared with the predictions (5.14) and (5.15). Every scheme with every structure is a row
of ``benchmarks/results/headers.jsonl``; tables go into ``docs/structure.md``.
"""

from __future__ import annotations

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
    """Return PSNR of the three kinds at equal rates, H.264 with defaults, without missed rates."""
    psnr: dict[str, dict[float, float]] = {}
    for kind in KINDS:
        psnr[kind] = {}
        for rate in RATES:
            coded = encode(picture, f"{kind}-h264", bpp=rate)
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
    return {
        ("docs/structure.md", mark): [origin(rows), "", *made(rows)]
        for mark, made, rows in (
            ("floors", floor_table, floors), ("parts", part_table, floors), ("duels", duel_table, duels)
        )
    }  # fmt: skip


def floor_table(rows: list[dict[str, Any]]) -> list[str]:
    """Return rates of black / scene at the coarsest quantiser, bpp, one column per structure."""
    lines, commits = [], []
    for scheme in dict.fromkeys(row["scheme"] for row in rows):
        those = {row["side"]: row for row in rows if row["scheme"] == scheme}
        lines.append([f"`{scheme}`", *(floor_cell(those[side]) if side in those else "" for side in SIDES)])
        commits.append([row["commit"] for row in those.values()])
    return table(" | ".join(["scheme", *(f"{side}²" for side in SIDES)]), lines, commits)


def floor_cell(row: dict[str, Any]) -> str:
    """Return rates of black / scene, and the PSNR of the scene."""
    if "refused" in row:
        return "–"
    quality = "lossless" if row["floor_db"] is None else f"{row['floor_db']:.1f}"
    return f"{row['black_bpp']:.2g} / {row['floor_bpp']:.2g} ({quality})"


def part_table(rows: list[dict[str, Any]]) -> list[str]:
    """Return the bits per frame of a black picture by purpose."""
    lines = []
    shown = [row for row in rows if "parts" in row and row["side"] in (16, 64, 256)]
    for row in shown:
        p, j = row["parts"], row["frames"]
        headers = "(in data)" if p["headers"] is None else f"{p['headers'] / j:.1f}"
        total = sum(p[name] or 0 for name in ("framing", "parameters", "messages", "headers", "data"))
        lines.append(
            f"`{row['scheme']}` | {row['side']}² | {j} | {p['framing'] / j:.1f} | {p['parameters'] / j:.1f} | "
            f"{headers} | {(p['data'] + p['messages']) / j:.1f} | {total / j:.1f}"
        )
    heads = "scheme | EI | frames | start codes, lengths | parameter sets | slice headers | data | bits per frame"
    return table(heads, lines, [[row["commit"]] for row in shown])


def duel_table(rows: list[dict[str, Any]]) -> list[str]:
    """Return predictions and results of SI against EI and RI."""
    lines = []
    for row in rows:
        ei, ri = row["ei"], row["ri"]
        cells = [yes(ei["predicted"]), yes(ei["fewer_header_bits"]), gain(ei)]
        cells += [f"{ei['lowest']['si'] or '–'}, {ei['lowest']['ei'] or '–'}"]
        cells += [yes(ri["predicted"]), yes(ri["fewer_header_bits"]), gain(ri), f"{ri['lowest']['ri'] or '–'}"]
        lines.append([f"{row['side']}²", *cells])
    heads = (
        "EI | SI before EI by (5.14) | fewer bits black | mean gain | lowest rate SI, EI | SI before RI by (5.15) "
        "| fewer bits black | mean gain | lowest rate RI"
    )
    return table(heads, lines, [[row["commit"]] for row in rows])


def yes(value: bool) -> str:
    """Return yes or no for a table."""
    return "yes" if value else "no"


def gain(row: dict[str, Any]) -> str:
    """Return a gain in dB with the number of rates."""
    return "–" if row["gain_db"] is None else f"{row['gain_db']:+.1f} dB ({len(row['rates_both'])} rates)"
