"""`si-lf` against the anchors of the benchmark, by quantiser: photographs at their view size, single views, scenes.

    python -m benchmarks run anchors [--photographs FOLDER] [--pictures flowers-5x5,toys-1x1,apples] [--schemes vvenc]

``NAME-5x5`` are the photographs of the benchmark ``photographs``, ``NAME-1x1`` their middle views alone;
``astronaut-1x1`` and its like are photographs of scikit-image. FOLDER has the photographs as NAME.png; their pixels
are compared with the definition. The others are the pictures of `benchmarks.coding.light_field`. Every curve has five
quantisers. ``jplm`` is the 4-D transform mode of JPEG Pleno, as in `benchmarks.coding.jplm`; its programs must be on
the path. Tables go to ``docs/benchmark.md``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from skimage import data

from benchmarks.arguments import command_line
from benchmarks.coding import jplm
from benchmarks.coding.light_field import BY_RGB, FIELDS, OURS, SCENES, pictured, rate_change
from benchmarks.coding.rd import compiled
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin, table
from codec import encode, timed_decode
from ii_core import IIPicture
from metrics.benchmark.anchor_coder import AnchorCoder, versions
from metrics.benchmark.anchors import ANCHORS
from metrics.benchmark.external import External
from metrics.benchmark.profile import profile
from metrics.benchmark.subject import identity
from metrics.measures.batch import measuring
from metrics.measures.ctc import PEAK, codes

RECORDS = Records("anchors", ("benchmarks.coding.anchors", "benchmarks.coding.light_field"))
PHOTOGRAPHS = {reference.name: reference for reference in profile("photographs").pictures}
SINGLE = ("astronaut", "chelsea", "coffee")  # of scikit-image
AVIF = "si-avif:best"
BEST = f"{OURS}:best"
JPLM = "jplm"  # transforms over all views: of flowers, smaller ones were never chosen, and took 17 times as long
QUANTISERS = {
    OURS: (33, 39, 45, 51, 57),
    "si-avif": (12, 22, 32, 42, 52),
    "x265": (16, 21, 26, 31, 36),
    "vvenc": (20, 25, 30, 35, 40),
    "libaom": (14, 24, 34, 44, 54),
    "svtav1": (16, 26, 36, 46, 56),
    "jpegxl": (0.6, 1.5, 4, 9, 15),
    "si-jpeg2000": (2, 1, 0.5, 0.25, 0.12),
    JPLM: jplm.LAMBDAS,
}
BY_RATE = "si-jpeg2000"  # its quantisers are rates in bpp
OF_SINGLE = (29, 34, 39, 44, 49)  # of `si-lf` for a view alone: the first of many is finer than the rest
OTHERS = ("svtav1", "jpegxl", BY_RATE, JPLM)
VIDEO = ("vvenc", "libaom", "x265")
SCHEMES = (OURS, BY_RGB, AVIF, "x265", "vvenc", "libaom")
MEASURES = {"ctc": "q_ctc_psnr", "psnr": "q_global", "ssim": "q_ctc_ssim", "worst": "q_ctc_min", "step": "q_ctc_step"}
LUMA = "luma"  # PSNR of Y in the codes of the common test conditions, mean over views
LABELS = {"ctc": "CTC", LUMA: "luma", "psnr": "RGB"}


def main() -> None:
    """Measure, print, record and fill the page."""
    views = [f"{name}-5x5" for name in PHOTOGRAPHS]
    single = [f"{name}-1x1" for name in (*PHOTOGRAPHS, *SINGLE)]
    parser = command_line(__doc__, pictures=(*views, *single, *SCENES, *FIELDS), schemes=(*SCHEMES, BEST, *OTHERS))
    parser.add_argument("--photographs", type=Path, help="folder of the benchmark's photographs")
    asked = parser.parse_args()
    keys = [{"picture": name, "scheme": scheme} for name in asked.pictures for scheme in asked.schemes]
    RECORDS.run(keys, lambda picture, scheme: curve(subject(picture, asked.photographs), scheme), asked.again)
    publish(tables())


@cache
def subject(name: str, folder: Path | None) -> IIPicture:
    """Return a picture of this benchmark; ValueError if a photograph is missing or has other pixels."""
    whole, _, count = name.rpartition("-")
    if whole in SINGLE:
        pixels = getattr(data, whole)()
        return IIPicture(np.ascontiguousarray(pixels), pixels.shape[1::-1], (1, 1))
    if whole not in PHOTOGRAPHS:
        return pictured(name)
    if folder is None:
        raise ValueError(f"{whole} is a photograph: --photographs names their folder")
    reference = PHOTOGRAPHS[whole]
    picture = reference.part(IIPicture.load(folder / f"{whole}.png"))
    if not reference.matches(identity(whole, picture)["sha256"]):
        raise ValueError(f"{folder / whole}.png has not the pixels of the definition")
    columns, rows = map(int, count.split("x"))
    return replace(reference, views=(columns, rows)).part(picture)


def curve(original: IIPicture, scheme: str) -> dict[str, Any]:
    """Return structure, rate and qualities at each quantiser; versions of an anchor's program."""
    measure: Any = measuring(original, list(MEASURES.values()))
    anchor, points = AnchorCoder(scheme) if scheme in ANCHORS else None, []
    if scheme.startswith((OURS, AVIF, BY_RATE)):
        compiled(scheme, **({"bpp": 1} if scheme == BY_RATE else {"qp": QUANTISERS[OURS][0]}))
    alone = original.ei_pixels == (1, 1) and scheme.startswith(OURS)
    for quantiser in OF_SINGLE if alone else QUANTISERS[scheme.partition(":")[0]]:
        coded, picture, own = at_quantiser(original, scheme, anchor, quantiser)
        found = measure(picture, codes=own)
        quality = {name: found[measured] for name, measured in MEASURES.items()}
        quality[LUMA] = luma_psnr(original, picture, own)
        points.append({"qp": quantiser, "bpp": coded.bpp, **quality, "encode_seconds": coded.encode_seconds})
    structure = {"lenses": list(original.lenses), "ei_pixels": list(original.ei_pixels)}
    return {**structure, "points": points, "program": versions() if anchor else None}


def at_quantiser(
    original: IIPicture, scheme: str, anchor: AnchorCoder | None, quantiser: float
) -> tuple[Any, Any, Any]:
    """Return what was coded, the decoded picture, and the codes that an anchor returned."""
    if scheme == JPLM:
        programs = External(encoder=jplm.encoder(original, "whole", quantiser), decoder=jplm.DECODER, kind="ycbcr")
        stream = programs.encode(original, JPLM, bpp=jplm.MANY_BPP)
        return stream, programs.decode(stream).picture, None
    if anchor is None:
        goal: Any = {"bpp" if scheme == BY_RATE else "qp": quantiser}
        coded = encode(original, scheme, **goal)
        return coded, timed_decode(coded).picture, None
    sequence = anchor.encode_at(original, quantiser)
    answer = anchor.decode(sequence)
    return sequence, answer.picture, answer.codes


def luma_psnr(original: IIPicture, decoded: IIPicture, own: Any = None) -> float:
    """Return the mean over views of the PSNR of Y; ``own`` are codes of 10 bit that the decoder returned."""
    columns, rows = original.ei_pixels
    wanted = codes(original.pixels / 255)[..., 0]
    found = (codes(decoded.pixels / 255) if own is None else own)[..., 0].astype(np.float64)
    error = np.square(found - wanted).reshape(-1, rows, wanted.shape[1] // columns, columns).mean(axis=(0, 2))
    return float((20 * np.log10(PEAK) - 10 * np.log10(np.maximum(error, 1e-6))).mean())


def changes(
    rows: Sequence[Mapping[str, Any]], names: Sequence[str], scheme: str, of: str = OURS
) -> dict[str, dict[str, float]]:
    """Return Bjøntegaard rates of `si-lf`, or of another scheme, against a scheme by measure and picture.

    By CTC and luma `si-lf` is tuned for CTC, by RGB for RGB.
    """
    curves = {(row["picture"], row["scheme"]): row["points"] for row in rows}
    found: dict[str, dict[str, float]] = {}
    for measure, ours in (("ctc", of), (LUMA, of), ("psnr", BY_RGB), ("worst", of)):
        pairs = {name: (curves.get((name, scheme)), curves.get((name, ours))) for name in names}
        rates = {name: rate_change(*pair, measure) for name, pair in pairs.items() if None not in pair}
        found[measure] = {name: rate for name, rate in rates.items() if rate is not None}
    return found


def comparison(
    rows: Sequence[Mapping[str, Any]],
    names: Sequence[str],
    others: Sequence[str],
    labels: Mapping[str, str] = LABELS,
    of: str = OURS,
) -> list[str]:
    """Return a table of Bjøntegaard rates by picture, their mean and the worst; without columns that are empty."""
    measured = {row["picture"]: row for row in rows}
    shown = [name for name in names if name in measured]
    each = {other: changes(rows, shown, other, of) for other in others}
    columns = [(other, measure) for other in others for measure in labels if each[other][measure]]
    heads = [f"{labels[measure]}: `{other}`" for other, measure in columns]
    lines = []
    for name in shown:
        (k, l), (u, v) = measured[name]["lenses"], measured[name]["ei_pixels"]
        cells = [percent(each[other][measure].get(name)) for other, measure in columns]
        lines.append([name.removesuffix(f"-{u}x{v}") if u < 9 else name, f"{u}×{v} of {k}×{l}", *cells])
    for label, of in (("mean", np.mean), ("worst", max)):
        cells = []
        for other, measure in columns:
            values = list(each[other][measure].values())
            some = f" of {len(values)}" if len(values) < len(shown) else ""
            cells.append(percent(float(of(values))) + some)
        lines.append([f"**{label}**", "", *cells])
    return [*table(" | ".join(["picture", "views of pixels", *heads]), lines)]


def by_view(rows: Sequence[Mapping[str, Any]], names: Sequence[str], others: Sequence[str]) -> list[str]:
    """Return a table of what the mean over views hides: rates by the worst view, changes from view to view."""
    curves = {(row["picture"], row["scheme"]): row["points"] for row in rows}
    lines = []
    for other in others:
        found = changes(rows, names, other)
        both = [name for name in names if name in found["ctc"]]
        if not both:
            continue
        steps = [
            float(np.mean([point["step"] for name in both for point in curves[name, scheme]]))
            for scheme in (OURS, other)
        ]
        rates = (
            percent(float(np.mean([found[measure][name] for name in found[measure]]))) for measure in ("ctc", "worst")
        )
        lines.append([f"`{other}`", str(len(both)), *rates, *(f"{step:.2f}" for step in steps)])
    heads = "anchor | pictures | rate by mean view | rate by worst view | change, `si-lf`, dB | change, anchor, dB"
    return [*table(heads, lines)]


def percent(rate: float | None) -> str:
    """Return a rate as text; a dash without one."""
    return "–" if rate is None else f"{rate:+.1f} %".replace("-", "−")


def tables() -> Tables:
    """Return the tables of docs/benchmark.md."""
    rows = RECORDS.rows()
    kinds = {
        "anchors-photographs": ([f"{name}-5x5" for name in PHOTOGRAPHS], VIDEO),
        "anchors-others": ([f"{name}-5x5" for name in PHOTOGRAPHS], OTHERS),
        "anchors-single": ([f"{name}-1x1" for name in (*PHOTOGRAPHS, *SINGLE)], ("libaom", AVIF)),
        "anchors-scenes": ([*SCENES, *FIELDS], VIDEO),
    }
    found = {}
    for mark, (names, others) in kinds.items():
        compared = {row["picture"] for row in rows if row["scheme"] in others}
        used = [row for row in rows if row["picture"] in compared.intersection(names)]
        labels = {"ctc": "CTC"} if others == OTHERS else LABELS
        lines = [*comparison(used, names, others, labels), "", origin(used)] if used else ["Not measured yet."]
        found["docs/benchmark.md", mark] = lines
    names, others = kinds["anchors-photographs"]
    found["docs/benchmark.md", "anchors-views"] = by_view(rows, names, others)
    best = {row["picture"] for row in rows if row["scheme"] == BEST}
    used = [row for row in rows if row["picture"] in best and row["scheme"] in (BEST, OURS, *others)]
    labels = {measure: LABELS[measure] for measure in ("ctc", LUMA)}
    lines = [*comparison(used, names, (OURS, *others), labels, of=BEST), "", origin(used)]
    found["docs/benchmark.md", "anchors-best"] = lines
    return found
