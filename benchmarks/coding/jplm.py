"""`si-lf` against the 4-D transform mode of JPEG Pleno: rate at equal PSNR.

    python -m benchmarks run jplm [--pictures car,car-9x9] [--settings whole] [--flower FOLDER]

Pictures and PSNR are those of ``light_field``, and so are the curves of `si-lf` and HEVC. The programs
``jpl-encoder-bin`` and ``jpl-decoder-bin`` of JPEG Pleno's reference software must be on the path. They get YCbCr
codes of 10 bit. Their encoder searches the partition of each block into transforms, within a setting: "whole" has
transforms over all views, "split" over at most half of the rows and columns of views, down to single views. The table
has the better one for each picture. ``--flower`` is that of ``light_field``. Numbers go to
``benchmarks/results/jplm.jsonl``, the table to ``docs/lf.md``.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from benchmarks.arguments import command_line
from benchmarks.coding.light_field import (
    BY_RGB,
    FIELDS,
    IMPORTED,
    OURS,
    SCENES,
    difference,
    ours_by_rgb,
    pictured,
    rate_change,
)
from benchmarks.coding.light_field import RECORDS as OTHERS
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin
from ii_core import IIPicture
from metrics import q_global
from metrics.benchmark.external import External

RECORDS = Records("jplm", ("benchmarks.coding.jplm", "benchmarks.coding.light_field"))
LAMBDAS = (50, 250, 1000, 4000, 16000)  # squared error, in codes of 10 bit, that a bit may save
SETTINGS = {"whole": "all", "split": "half, down to one"}  # views in a transform, for the table
SMALLEST = 4  # samples of a view in a transform
PEER = "si-hevc:best"
MANY_BPP = 24.0  # an external command has a target; the Lagrangian multiplier takes its place
DECODER = "jpl-decoder-bin -i {in} -o {out}"


def main() -> None:
    """Measure, print, record and fill the table."""
    parser = command_line(__doc__, pictures=FIELDS + SCENES, settings=tuple(SETTINGS))
    parser.add_argument("--flower", help="folder of the views of a light field camera")
    asked = parser.parse_args()
    if unknown := [name for name in asked.settings if name not in SETTINGS]:
        parser.error(f"no setting {unknown[0]!r}: known are {', '.join(SETTINGS)}")
    names = [*([IMPORTED] if asked.flower else []), *asked.pictures]
    keys = [{"picture": name, "setting": setting} for setting in asked.settings for name in names]
    if todo := RECORDS.todo(keys, asked.again):
        try:
            External(encoder="jpl-encoder-bin {in} {out}", decoder=DECODER)
        except ValueError as error:
            parser.error(f"{error}; the programs of JPEG Pleno's reference software must be on PATH")
    for key in todo:
        original = pictured(key["picture"], asked.flower)
        row = RECORDS.measure(key, partial(measured, original, key["setting"]))
        print(key, f"{row['cpu_seconds']:.0f} s", flush=True)
    publish(tables())


def measured(original: IIPicture, setting: str) -> dict[str, Any]:
    """Return rate, PSNR and CPU microseconds per pixel for each Lagrangian multiplier."""
    pixels = original.pixels.size / 3
    points = []
    for weight in LAMBDAS:
        coder = External(encoder=encoder(original, setting, weight), decoder=DECODER, kind="ycbcr")
        coded = coder.encode(original, "jplm", bpp=MANY_BPP)
        decoding = coder.decode(coded)
        points.append(
            {
                "lambda": weight,
                "bpp": coded.bpp,
                "psnr": q_global(original, decoding.picture),
                "encode_us": 1e6 * coded.encode_seconds / pixels,
                "decode_us": 1e6 * decoding.seconds / pixels,
            }
        )
    return {"points": points}


def encoder(original: IIPicture, setting: str, weight: float) -> str:
    """Return the command of the encoder."""
    words = ["jpl-encoder-bin --part 2 --type 0 --enum-cs YCbCr_2 --number-of-colour-channels 3 --border_policy 1"]
    words.append("--view_width {width} --view_height {height} --number_of_rows {rows} --number_of_columns {columns}")
    for where, (largest, smallest) in transforms(original, setting).items():
        words.append(f"--transform_size_maximum_{where} {largest} --transform_size_minimum_{where} {smallest}")
    return " ".join([*words, f"--lambda {weight:g} --input {{in}} --output {{out}}"])


def transforms(original: IIPicture, setting: str) -> dict[str, tuple[int, int]]:
    """Return the largest and the smallest size of transforms by direction."""
    (columns, rows), (width, height) = original.ei_pixels, original.lenses
    whole = setting == "whole"
    most = 64 if whole else 32
    views = {"vertical": rows, "horizontal": columns}
    samples = {"vertical": height, "horizontal": width}
    inter = {f"inter_view_{d}": (n, n) if whole else (-(-n // 2), 1) for d, n in views.items()}
    return inter | {f"intra_view_{d}": (min(n, most), min(n, SMALLEST)) for d, n in samples.items()}


def tables() -> Tables:
    """Return the table of docs/lf.md."""
    rows = {(row["picture"], row["setting"]): row for row in RECORDS.rows()}
    compared = [row for row in OTHERS.rows() if row["scheme"] in (OURS, BY_RGB, PEER)]
    others = {(row["picture"], row["scheme"]): row["points"] for row in compared}
    names = [name for name in (*SCENES, *FIELDS, IMPORTED) if any((name, setting) in rows for setting in SETTINGS)]
    if not names:
        return {("docs/lf.md", "lf-jplm"): ["Not measured yet."]}
    lines = [f"| picture | views in a transform | `{OURS}` | `{PEER}` | encode µs | decode µs |", "|---" * 6 + "|"]
    for name in names:
        curves = {setting: rows[name, setting]["points"] for setting in SETTINGS if (name, setting) in rows}
        setting = best(curves)
        anchor = curves[setting]
        cells = [difference(anchor, curve) for curve in (ours_by_rgb(others, name), others.get((name, PEER)))]
        ends = [[point[key] for point in anchor] for key in ("encode_us", "decode_us")]
        cells += [f"{min(times):.1f}–{max(times):.1f}" for times in ends]
        lines.append(f"| {name} | {SETTINGS[setting]} | {' | '.join(cells)} |")
    used = [row for row in compared if row["picture"] in names]
    alone = [name for name in names if sum((name, setting) in rows for setting in SETTINGS) < len(SETTINGS)]
    missing = []
    if alone:
        which = "" if alone == names else f" for {', '.join(alone)}"
        missing = [f"Only one of the two settings is measured{which}.", ""]
    return {("docs/lf.md", "lf-jplm"): [*lines, "", *missing, origin([*rows.values(), *used])]}


def best(curves: dict[str, list[dict[str, float]]]) -> str:
    """Return the name of the curve with the least Bjøntegaard rate."""
    anchor = next(iter(curves.values()))
    return min(curves, key=lambda name: rate_change(anchor, curves[name]) or 0.0)


if __name__ == "__main__":
    main()
