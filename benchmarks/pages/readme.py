"""Measured pictures and figures of README, tutorial and other pages: ``python -m benchmarks run readme``.

Copies pictures of ``make demo`` (out/demo) to ``docs/images``. Fills tables from records: the peers of the README and
the ratios of docs/speed_accuracy.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

from benchmarks.accuracy import povray
from benchmarks.coding import anchors, coders, jplm, light_field
from benchmarks.coding.light_field import BY_RGB, IMPORTED, OURS, SCENES, rate_change
from benchmarks.pages.pictures import IMAGES, write_picture
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import ROOT, origin
from benchmarks.speed import mitsuba, ratios
from benchmarks.speed.before import COMMIT, MENDED
from ii_core import preset
from raytrace_ii import scene_names

SHOWN = {  # pictures of the demo, on the page of the tutorial
    "apples_detail.png": "apples_detail.webp",
    "apples_view_front.png": "apples_view_front.webp",
    "apples_rd.png": "demo_apples_rd.png",
}
PEERS = {"si-avif:best": "AV1", "si-hevc:best": "HEVC"}
TIMED = "AV1"  # the peer whose CPU times are compared, too
SMALL = 8  # scale of the scenes of `light_field`
ANCHORS = {"vvenc": "VVC", "libaom": "AV1", "x265": "HEVC"}  # those of users, by the common test conditions
MEASURES = {"ctc": "PSNR-YUV", "psnr": "PSNR of RGB"}
LARGE = (1, 4)  # scales of `coders`; each peer is shown at the first that it was measured at
TIMES = {"encoding": ("encode_us", "codec_seconds"), "decoding": ("decode_us", "decode_seconds")}
NONE = "–"

Row = Mapping[str, Any]
Pairs = Mapping[str, tuple[Row, Row]]


def main() -> None:
    """Copy pictures, and fill the tables."""
    for name, target in SHOWN.items():
        write_picture(IMAGES / target, ROOT / "out" / "demo" / name)
    publish(tables())


def tables() -> Tables:
    """Return the tables of all pages."""
    return {
        ("README.md", "peers"): peers_table(),
        ("docs/speed_accuracy.md", "before"): before_table(),
        ("docs/speed_accuracy.md", "speed"): speed_table(),
    }


def peers_table() -> list[str]:
    """Return `render` and `si-lf` against programs of others, a line for each claim."""
    speed, pictures, coded = mitsuba.RECORDS.rows(scale=1), povray.RECORDS.rows(scale=povray.SCALE), meetings()
    version = " and ".join(dict.fromkeys(row["mitsuba"] for row in speed))
    times = [factors([1 / row[name] for row in speed]) for name in ("ratio", "robust_ratio")]
    psnr = [part["POV-Ray / ours, dB"] for row in pictures for part in row["rows"] if part["seen"] == "all"]
    claims = [
        ("`render`: CPU time", f"Mitsuba {version}", "512×256", times[0], NONE),
        ("`render`: CPU time", "robust Mitsuba", "512×256", times[1], NONE),
        ("`render`: PSNR", "POV-Ray", NONE, span([f"{value:.0f} dB" for value in sorted(psnr)]), NONE),
    ]
    lines, compared = anchor_claims()
    claims += lines
    for peer, scale, pairs in coded:
        if scale == SMALL and peer in PEERS.values():
            continue  # anchors tell of these
        change = {name: rate_change(theirs["points"], ours["points"]) for name, (theirs, ours) in pairs.items()}
        claims.append(
            (f"`{OURS}`: rate by {MEASURES['psnr']}", peer, views(scale), *(percents(some) for some in split(change)))
        )
    for what, keys in TIMES.items():
        for peer, scale, pairs in coded:
            if peer == TIMED:
                ratio = {name: cpu(ours, keys) / cpu(theirs, keys) for name, (theirs, ours) in pairs.items()}
                cells = (factors(some) for some in split(ratio))
                claims.append((f"`{OURS}`: CPU time of {what}", peer, views(scale), *cells))
    head = ["| measure | against | view | scenes | photographs |", "|---|---|---|---|---|"]
    used = [*speed, *pictures, *compared, *(row for _, _, pairs in coded for pair in pairs.values() for row in pair)]
    return [*head, *(f"| {' | '.join(claim)} |" for claim in claims), "", origin(used)]


def anchor_claims() -> tuple[list[tuple[str, ...]], list[Row]]:
    """Return `si-lf` against each anchor by each measure, and the rows that say it: mean, and the worst picture."""
    rows = anchors.RECORDS.rows()
    groups = (*light_field.SCENES, *light_field.FIELDS), [f"{name}-5x5" for name in anchors.PHOTOGRAPHS]
    claims: list[tuple[str, ...]] = []
    for measure, label in MEASURES.items():
        for scheme, peer in ANCHORS.items():
            cells = [mean_and_worst(anchors.changes(rows, group, scheme)[measure]) for group in groups]
            claims.append(
                (f"`{OURS}`: rate by {label}", peer, "[own](docs/benchmark.md#results-on-photographs)", *cells)
            )
    shown = {*groups[0], *groups[1]}, {*ANCHORS, OURS, BY_RGB}
    return claims, [row for row in rows if row["picture"] in shown[0] and row["scheme"] in shown[1]]


def mean_and_worst(rates: Mapping[str, float]) -> str:
    """Return the mean of rates by picture; in brackets the greatest, and the number of pictures."""
    if not rates:
        return NONE
    mean, worst = (
        f"{value:+.0f}".replace("-", "−") for value in (sum(rates.values()) / len(rates), max(rates.values()))
    )
    return f"{mean} % ({worst}, {len(rates)})"


def meetings() -> list[tuple[str, int, Pairs]]:
    """Return peer, scale of the scenes, and its rows beside those of `si-lf` by picture."""
    small = {(row["picture"], row["scheme"]): row for row in light_field.RECORDS.rows() if "points" in row}
    found = []
    for scheme, name in PEERS.items():
        found.append((name, SMALL, paired(small, scheme)))
        for scale in LARGE:
            large = {(row["scene"], row["scheme"]): row for row in coders.RECORDS.rows(scale=scale)}
            if pairs := paired(large, scheme):
                found.append((name, scale, pairs))
                break
    pleno: dict[str, dict[str, Row]] = {}
    for row in jplm.RECORDS.rows():
        pleno.setdefault(row["picture"], {})[row["setting"]] = row
    best = {name: each[jplm.best({key: row["points"] for key, row in each.items()})] for name, each in pleno.items()}
    known = small | {(name, "jplm"): row for name, row in best.items()}
    return [*found, ("JPEG Pleno, 4-D transform", SMALL, paired(known, "jplm"))]


def paired(rows: Mapping[tuple[str, str], Row], scheme: str) -> Pairs:
    """Return the rows of a scheme beside those of `si-lf`; none unless both are there for every scene."""
    found = {}
    for name in (*SCENES, IMPORTED):
        ours = rows.get((name, BY_RGB), rows.get((name, OURS)))
        if ours is not None and (name, scheme) in rows and not _tuned_otherwise(ours):
            found[name] = rows[name, scheme], ours
    return found if {*SCENES} <= {*found} else {}


def _tuned_otherwise(row: Row) -> bool:
    """Return whether a curve of `si-lf` is tuned for another measure than PSNR of RGB, as since version 7."""
    return row.get("scheme") == OURS and any("ctc" in point for point in row["points"])


def split(values: Mapping[str, Any]) -> tuple[list[Any], list[Any]]:
    """Return the values of the scenes and those of the photograph."""
    return [values[name] for name in SCENES], [values[name] for name in values if name == IMPORTED]


def cpu(row: Row, keys: Sequence[str]) -> float:
    """Return the median over a curve of the CPU times under one of these names."""
    return median(next(point[key] for key in keys if key in point) for point in row["points"])


def views(scale: int) -> str:
    """Return the size of a view through `setup1`."""
    columns, rows = preset("setup1", scale=scale).lenses
    return f"{columns}×{rows}"


def percents(values: Sequence[float | None]) -> str:
    """Return changes in per cent, the least first."""
    known = [value for value in values if value is not None]
    text = [f"{value:+.0f} %".replace("-", "−") for value in sorted(known, reverse=True)]
    return span(text) if len(known) == len(values) else NONE


def factors(values: Sequence[float]) -> str:
    """Return factors with two digits at least."""
    return span([f"{value:.{0 if value >= 10 else 1 if value >= 0.995 else 2}f} ×" for value in sorted(values)])


def span(texts: Sequence[str]) -> str:
    """Return the first and the last of these texts with one unit."""
    ends = list(dict.fromkeys((texts[0], texts[-1]) if texts else ()))
    return " to ".join([*(text.rpartition(" ")[0] for text in ends[:-1]), *ends[-1:]]) or NONE


def before_table() -> list[str]:
    """Return speed and pixels against earlier commits and Embree's single rays, scene by scene."""
    rows, plain = {row["what"]: row for row in ratios.measured()}, ratios.PLAIN
    columns = {
        "speed": f": speed / {COMMIT}",
        "without filter": f"{plain}: speed / {COMMIT}",
        "unlike, %": f"{plain}: pixels unlike {MENDED}, %",
        "by more than 1 code, %": f"{plain}: pixels unlike {MENDED} by more than 1 code, %",
        "time / Embree": ": CPU time / EmbreeScene.run",
    }
    lines = [f"| scene | target | {' | '.join(columns)} |", "|---" * (len(columns) + 2) + "|"]
    used = []
    for name in (*(f" {scene}" for scene in scene_names()), ", mean of all"):
        found = [rows.get(f"render{name}{column}") for column in columns.values()]
        cells = [NONE if row is None else with_range(row) for row in found]
        lines.append(f"| {name.strip(' ,')} | {found[0]['target'] if found[0] else ''} | {' | '.join(cells)} |")
        used += [row for row in found if row]
    return [*lines, "", origin(used)]


def with_range(row: Row) -> str:
    """Return a median, and the range if values differ."""
    least, most = (f"{end(row['all']):.2f}" for end in (min, max))
    return f"{row['median']:.2f}" + (f" ({least}–{most})" if least != most else "")


def speed_table() -> list[str]:
    """Return the other ratios of `benchmarks.speed.ratios` beside their targets."""
    by_scene = (COMMIT, MENDED, "EmbreeScene.run")
    rows = [row for row in ratios.measured() if not any(name in row["what"] for name in by_scene)]
    lines = ["| | target | median |", "|---|---|---|"]
    lines += [f"| {row['what']} | {row['target']} | {with_range(row)} |" for row in rows]
    return [*lines, "", origin(rows)]


if __name__ == "__main__":
    main()
