"""`si-lf` against the other schemes: rate at equal quality, gain of each tool, CPU time.

    python -m benchmarks run light_field [--pictures car,car-9x9] [--schemes si-lf] [--flower FOLDER]
        [--photographs stegosaurus.png bottle.png …]

Pictures are four scenes through `setup1` at scale 8, and two light fields of 9×9 views of 120×56 pixels with
disparity of both signs, rendered with four samples per pixel: the camera's gap is 32/3 of that of `setup1`, and each
view is cropped one column or row further on than its neighbour. ``--flower`` adds the middle 96×64 pixels of 10×10
views of a light field camera from a folder (alone: ``--pictures flower``), ``--photographs`` the middle 128×96 pixels
of the middle 9×9 views of imported pictures, such as those of the benchmark ``photographs``. Every scheme is run at
five quantisers, and lossless. Quality is PSNR-YUV of JPEG Pleno's test conditions, for which `si-lf` is tuned, and
PSNR of RGB, for which its second curve is. Numbers go to ``benchmarks/results/light_field.jsonl``, tables to
``docs/lf.md``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.arguments import command_line
from benchmarks.coding.rd import compiled
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin, table
from codec import encode, timed_decode
from ii_core import IIPicture, preset
from ii_core.formats.find import find_views, picture_of
from metrics import bd_rate, q_ctc_psnr, q_global
from metrics.rates.rd import UndefinedDifference
from raytrace_ii import load_scene, render

RECORDS = Records("light_field", ("benchmarks.coding.light_field",))
SCENES = ("apples", "twins", "car", "cuboid")
FIELDS = ("car-9x9", "apples-9x9")
IMPORTED = "flower"
OURS, BY_RGB = "si-lf", "si-lf:tune=rgb"
PHOTOGRAPHS = ("flowers", "stegosaurus", "bottle", "toys")
CUT, MIDDLE = (128, 96), 9  # pixels and views of a photograph
TOOLS = {
    "si-lf:sources=0": "synthesis off",
    "si-lf:cross=0": "colours not predicted",
    "si-lf:skip=0": "always transformed",
}
QUANTISERS = {
    "si-lf": (22, 30, 38, 44, 50),
    "si-avif:best": (18, 28, 38, 48, 58),
    "si-hevc:best": (14, 20, 26, 32, 38),
}
OTHERS = ("si-avif:best", "si-hevc:best")
LOSSLESS = ("si-lf:lossless=1", "si-ffv1", "jpegxl:lossless=1")
VIEWS, GAP = 9, 6  # views per side; factor on disparity, by a larger gap


def main() -> None:
    """Measure, print, record and fill the page."""
    parser = command_line(__doc__, pictures=SCENES + FIELDS, schemes=(*OTHERS, OURS, BY_RGB, *TOOLS, *LOSSLESS))
    parser.add_argument("--flower", help="folder of the views of a light field camera")
    parser.add_argument("--photographs", nargs="+", default=[], help="imported pictures, named by their files")
    asked = parser.parse_args()
    photographs = {Path(file).stem: file for file in asked.photographs}
    names = dict.fromkeys([*asked.pictures, *([IMPORTED] if asked.flower else []), *photographs])
    keys = [{"picture": name, "scheme": scheme} for scheme in asked.schemes for name in names]

    def measure(picture: str, scheme: str) -> dict[str, Any]:
        cut = picture in photographs
        return measured(middle(photographs[picture]) if cut else pictured(picture, asked.flower), scheme)

    RECORDS.run(keys, measure, asked.again)
    publish(tables())


@cache
def pictured(name: str, flower: str | None = None) -> IIPicture:
    """Return a picture of this benchmark."""
    if name == IMPORTED:
        whole, _ = picture_of(find_views(str(flower)))
        (width, height), (cols, rows) = whole.lenses, whole.ei_pixels
        left, top = (width - 96) // 2, (height - 64) // 2
        cut = whole.pixels[top * rows : (top + 64) * rows, left * cols : (left + 96) * cols]
        return IIPicture(np.ascontiguousarray(cut), (96, 64), (cols, rows))
    if name in SCENES:
        return render(load_scene(name), preset("setup1", scale=8)).picture
    camera = preset("setup1", scale=4)
    k, l = camera.lenses
    camera = replace(
        camera,
        pixels=(VIEWS * k, VIEWS * l),
        pixel_pitch_mm=camera.pixel_pitch_mm * 16 / VIEWS,
        gap_mm=camera.gap_mm * GAP * 16 / VIEWS,
    )
    field = render(load_scene(name.removesuffix("-9x9")), camera, samples=4).picture.pixels
    field = field.reshape(l, VIEWS, k, VIEWS, 3)
    half = VIEWS // 2
    rows, cols = l - 2 * half, k - 2 * half
    cut = np.empty((rows, VIEWS, cols, VIEWS, 3), np.uint8)
    for v in range(VIEWS):
        for u in range(VIEWS):
            cut[:, v, :, u] = field[v : v + rows, v, u : u + cols, u]
    return IIPicture(cut.reshape(rows * VIEWS, cols * VIEWS, 3), (cols, rows), (VIEWS, VIEWS))


@cache
def middle(file: str) -> IIPicture:
    """Return the middle of a photograph: `CUT` pixels of at most `MIDDLE` × `MIDDLE` views."""
    whole = IIPicture.load(file)
    (width, height), (cols, rows) = whole.lenses, whole.ei_pixels
    pixels = whole.pixels.reshape(height, rows, width, cols, 3)
    for axis, count in enumerate((CUT[1], MIDDLE, CUT[0], MIDDLE)):
        first = max(0, pixels.shape[axis] - count) // 2
        pixels = pixels.take(range(first, min(first + count, pixels.shape[axis])), axis)
    height, rows, width, cols, _ = pixels.shape
    return IIPicture(pixels.reshape(height * rows, width * cols, 3), (width, height), (cols, rows))


def measured(original: IIPicture, scheme: str) -> dict[str, Any]:
    """Return a curve, or the rate of a lossless scheme."""
    if scheme not in LOSSLESS:
        return curve(original, scheme)
    compiled(scheme)
    coded = encode(original, scheme)
    decoding = timed_decode(coded)
    if not np.array_equal(decoding.picture.pixels, original.pixels):
        raise RuntimeError(f"{scheme} is not lossless")
    pixels = original.pixels.size / 3
    seconds = {"encode_us": 1e6 * (coded.encode_seconds or 0) / pixels, "decode_us": 1e6 * decoding.seconds / pixels}
    return {"bpp": coded.bpp, **seconds}


def curve(original: IIPicture, scheme: str) -> dict[str, Any]:
    """Return rate, both qualities and CPU microseconds per pixel at each quantiser."""
    width, height = original.size
    points = []
    compiled(scheme, qp=QUANTISERS[OURS][0])
    for qp in QUANTISERS[scheme if scheme in QUANTISERS else scheme.partition(":")[0]]:
        coded = encode(original, scheme, qp=qp)
        decoding = timed_decode(coded)
        quality = {"psnr": q_global(original, decoding.picture), "ctc": q_ctc_psnr(original, decoding.picture).mean}
        seconds = {"encode_us": coded.encode_seconds or 0, "decode_us": decoding.seconds}
        times = {name: 1e6 * value / (width * height) for name, value in seconds.items()}
        points.append({"qp": qp, "bpp": coded.bpp, **quality, **times})
    return {"points": points}


def tables() -> Tables:
    """Return the tables of docs/lf.md."""
    rows = RECORDS.rows()
    curves = {(row["picture"], row["scheme"]): row["points"] for row in rows if "points" in row}
    exact = {(row["picture"], row["scheme"]): row["bpp"] for row in rows if "bpp" in row}
    names = [name for name in (*SCENES, *FIELDS, IMPORTED, *PHOTOGRAPHS) if (name, OURS) in curves]
    against, tools = [], []
    for name in names:
        ours = curves[name, OURS]
        by_rgb = ours_by_rgb(curves, name)
        cells = [difference(curves.get((name, other)), ours, "ctc") for other in OTHERS]
        cells += [difference(curves.get((name, other)), by_rgb) for other in OTHERS]
        times = [f"{np.median([point[key] for point in ours]):.1f}" for key in ("encode_us", "decode_us")]
        against.append([name, *cells, *times])
        measure = "ctc" if "ctc" in ours[0] else "psnr"  # records of versions without `tune` have PSNR of RGB alone
        without = [difference(ours, curves.get((name, tool)), measure) for tool in TOOLS]
        rates = [exact.get((name, scheme)) for scheme in LOSSLESS]
        without += ["–" if rate is None else f"{rate:.2f}" for rate in rates]
        if set(without) != {"–"}:
            tools.append([name, *without])
    heads = [*TOOLS.values(), *(f"`{scheme}`, bpp" for scheme in LOSSLESS)]
    made = {
        "lf-against": table(
            " | ".join(
                [
                    "picture",
                    *(f"{way}: `{other}`" for way in ("CTC", "RGB") for other in OTHERS),
                    "encode µs | decode µs",
                ]
            ),
            against,
        ),
        "lf-tools": table(" | ".join(["picture", *heads]), tools),
    }
    return {("docs/lf.md", mark): [*lines, "", origin(rows)] for mark, lines in made.items()}


def ours_by_rgb(curves: Mapping[tuple[str, str], Any], name: str) -> Any:
    """Return our curve that is tuned for RGB: of versions that had no other tuning, the only one; else None."""
    tuned, only = curves.get((name, BY_RGB)), curves.get((name, OURS))
    return tuned or (None if only and "ctc" in only[0] else only)


def difference(anchor: Any, tested: Any, quality: str = "psnr") -> str:
    """Return the Bjøntegaard rate of ``tested`` as text."""
    rate = None if anchor is None or tested is None else rate_change(anchor, tested, quality)
    return "–" if rate is None else _percent(rate)


def rate_change(anchor: Any, tested: Any, quality: str = "psnr") -> float | None:
    """Return the Bjøntegaard rate of ``tested`` in per cent; None if the curves hardly overlap, or are of old records
    without this quality.
    """
    if any(quality not in point for points in (anchor, tested) for point in points):
        return None
    try:
        return bd_rate(*((_column(points, key)) for points in (anchor, tested) for key in ("bpp", quality)))
    except UndefinedDifference:
        return None


def _percent(rate: float) -> str:
    return f"{rate:+.0f} %".replace("-", "−")


def _column(points: list[dict[str, float]], key: str) -> list[float]:
    return [point[key] for point in points]
