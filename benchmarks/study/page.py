"""Page docs/study.md: tables and charts of our results beside those of Olsson 2008."""

from __future__ import annotations

import gzip
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.coding.rd import climbing
from benchmarks.pages.pictures import write_picture
from benchmarks.pages.tables import Tables, filled
from benchmarks.records import ROOT, table
from ii_core.base.files import atomic_path
from ii_core.base.json_lines import lines_of, read_records
from metrics import bd_rate
from metrics.rates.rd import UndefinedDifference

from . import beside, theirs
from .charts import LABELS, draw_all
from .claims import Claim, Results, claims, gain, of_scenes, shown, type_table
from .coding import SCENES
from .rates import APART, BFRAMES, GOPS, MODEL, REFERENCE, SI, VOLUME
from .runner import FORMAT, VERSION, digest_of
from .theirs import said

PAGE, IMAGES = ROOT / "docs" / "study.md", ROOT / "docs" / "images" / "study"
MEANT_SMALL = ("plane-", "types-2008-", "component-images", "other-cameras")  # steps
KEPT = ROOT / "benchmarks/results/study.jsonl.gz"  # compressed to a sixth of its size
PHOTOGRAPHS = {"component-images": ".jpg", "other-cameras": ".jpg", "artefacts-": ".webp", "equal-": ".webp"}


def publish(folder: Path, *, page: Path = PAGE, images: Path = IMAGES, kept: Path = KEPT) -> None:
    """Add the records of a folder to the kept ones, copy its pictures, draw the charts and fill the page."""
    images.mkdir(parents=True, exist_ok=True)
    keep(sorted(folder.glob("*.jsonl")), kept)
    everything = published(kept)
    best = {name: largest(some) for name, some in everything.items()}
    for path in draw_all({name: record["result"] for name, record in best.items()}, images):
        write_picture(path, path)
    text = page.read_text(encoding="utf-8")
    copy_pictures(folder, images, best, text)
    for (_, mark), lines in tables(kept).items():
        text = filled(text, mark, lines)
    with atomic_path(page) as temporary:
        temporary.write_text(text, encoding="utf-8")


def tables(kept: Path = KEPT) -> Tables:
    """Return all tables of the page from the kept records."""
    everything = published(kept)
    best = {name: largest(some) for name, some in everything.items()}
    results = {name: record["result"] for name, record in best.items()}
    made = {
        **shown_tables(results, best),
        "gain-by-size": sizes(everything),
    }
    return {("docs/study.md", mark): lines for mark, lines in made.items()}


def copy_pictures(folder: Path, images: Path, best: Mapping[str, Mapping[str, Any]], text: str) -> None:
    """Copy the pictures of the shown records that are in this folder and on the page of this text."""
    for record in best.values():
        for name, digest in record["pictures"].items():
            there = page_name(name) in text and (folder / name).exists()
            if there and digest_of(folder / name) == digest:
                write_picture(images / page_name(name), folder / name)


def page_name(name: str) -> str:
    """Return the name of a picture on the page: photographs are JPEG, those of coded pictures WebP."""
    return next((name.replace(".png", end) for kind, end in PHOTOGRAPHS.items() if name.startswith(kind)), name)


def published(kept: Path) -> dict[str, list[dict[str, Any]]]:
    """Return the published records of every step, by its name."""
    found: dict[str, list[dict[str, Any]]] = {}
    for record in read_records(kept, FORMAT, VERSION):
        found.setdefault(record["step"], []).append(record)
    return dict(sorted(found.items()))


def keep(new: Iterable[Path], kept: Path) -> None:
    """Append the lines of files that another, compressed one lacks; equal lines make an equal file."""
    lines = dict.fromkeys(lines_of(kept) if kept.exists() else [])
    lines |= dict.fromkeys(line for path in new for line in lines_of(path))
    with atomic_path(kept) as temporary:
        temporary.write_bytes(gzip.compress(b"".join(lines), mtime=0))


def largest(some: Sequence[Mapping[str, Any]]) -> Mapping[str, Any]:
    """Return the last record of a step with the largest pictures."""
    scales = [record["parameters"].get("scale", 1) for record in some]
    return [record for record, scale in zip(some, scales, strict=True) if scale == min(scales)][-1]


def sizes(everything: Mapping[str, Sequence[Mapping[str, Any]]]) -> list[str]:
    """Return a table of the gain of SI-PVS over JPEG 2000 by number of lenses, below full size."""
    found: dict[tuple[str, int], str] = {}
    for scene in SCENES:
        for record in everything.get(f"rates-{scene}", ()):
            points = record["result"]["points"]
            pair = (gain(points, scheme, REFERENCE) for scheme in (SI, "si-h264"))
            found[scene, record["parameters"]["scale"]] = " · ".join(shown(value, "+.1f") for value in pair)
    scales = sorted({scale for _, scale in found if scale > 1}, reverse=True)
    lines = ["| lenses | " + " | ".join(SCENES) + " |", "|---" * (len(SCENES) + 1) + "|"]
    for scale in scales:
        cells = [found.get((scene, scale), "") for scene in SCENES]
        lines.append(f"| {512 // scale}×{256 // scale} | " + " | ".join(cells) + " |")
    return lines


def smaller(best: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return a sentence with the steps that have no result at full size."""
    small = [name for name, record in best.items() if record["parameters"].get("scale", 1) > 1]
    named = [f"`{name}`" for name in small if name == "plane-apples-1" or not name.startswith(MEANT_SMALL)]
    return [f"Not at full size yet: {', '.join(named)}." if named else "All at full size."]


def shown_tables(results: Results, best: Mapping[str, Mapping[str, Any]]) -> dict[str, list[str]]:
    """Return the lines of each mark of the page."""
    made = claims(results)
    return {
        "agreement": [*summary(made), "", *smaller(best)],
        **beside.tables(made),
        "table-types": types_beside(results),
        "volume-model": volume_table(results),
        "artefact-rates": artefact_table(results),
        "records": origins(best),
    }


def called(figure: str) -> str:
    """Return the name of a figure or table."""
    return figure if figure.startswith("Table") else f"Fig. {figure}"


def summary(made: Sequence[Claim]) -> list[str]:
    """Return a table of agreement, one row per figure."""
    lines = []
    for figure in dict.fromkeys(claim.figure for claim in made):
        own = [claim.verdict for claim in made if claim.figure == figure]
        totals = [
            tuple(sum(numbers) for numbers in zip(*(getattr(v, kind) for v in own), strict=True))
            for kind in ("sign", "order", "size")
        ]
        lines.append([called(figure), *(said(good, of) for good, of in totals)])
    return table("Olsson 2008 | sign | order | size", lines)


def types_beside(results: Results) -> list[str]:
    """Return Table 5.5, theirs and ours."""
    if "types-apples" not in results:
        return []
    lines = []
    ours = type_table(results["types-apples"])
    referenced = results.get("types-as-references-apples")
    refs = type_table(referenced, "pyramid=1") if referenced else [[None] * len(BFRAMES)] * len(GOPS)
    for i, gop in enumerate(GOPS):
        cells = []
        for j in range(len(BFRAMES)):
            cell = f"{shown(theirs.TYPES[i][j], '+.2f')} · {shown(ours[i][j], '+.2f')}"
            cells.append(cell + (f" · {shown(refs[i][j], '+.2f')}" if j else ""))
        lines.append([gop or "J", *cells])
    return table(" | ".join(["GOP", *(f"I{'B' * count}P" for count in BFRAMES)]), lines)


def volume_table(results: Results) -> list[str]:
    """Return a table of the Bjøntegaard rate of our volume against the verification model with separate colours."""
    coded, made = of_scenes(results, "volume"), of_scenes(results, "rates")
    scenes = [scene for scene in coded if scene in made]
    lines = []
    for what, source, scheme in (("each colour alone", coded, APART), ("colours turned", made, VOLUME)):
        cells = []
        for scene in scenes:
            model = [p for p in coded[scene]["points"] if p["scheme"] == MODEL]
            own = [p for p in source[scene]["points"] if p["scheme"] == scheme]
            cells.append(rate_cell(pairs(model), pairs(own)))
        lines.append([what, *cells])
    return table(" | ".join(["our volume", *scenes]), lines) if scenes else []


def artefact_table(results: Results) -> list[str]:
    """Return PSNR of the front view and Q_view of the pictures of Figures 5.13 to 5.18, with a rate not reached."""
    steps = {"setup 1, apples": "artefacts-setup1", **{f"setup 3, {s}": f"artefacts-{s}" for s in SCENES}}
    there = {what: results[step] for what, step in steps.items() if step in results}
    if not there:
        return []
    schemes = [p["scheme"] for p in next(iter(there.values()))["points"]]
    lines = ["| | " + " | ".join(LABELS[s] for s in schemes) + " |", "|---" * (len(schemes) + 1) + "|"]
    for what, result in there.items():
        cells = [
            f"{p['front_db']:.1f} · {p['q_view']:.3f}" + ("" if p["reached"] else f" ({p['bpp']:.2f} bpp)")
            for p in result["points"]
        ]
        lines.append(f"| {what} | " + " | ".join(cells) + " |")
    return lines


def pairs(points: Sequence[Mapping[str, Any]]) -> list[tuple[float, float]]:
    """Return (rate, PSNR) of a rising curve, from either form of points."""
    same = [{"bpp": p["bpp"], "psnr": p["psnr"] if "psnr" in p else float(p["q_global"])} for p in points]
    return [(p["bpp"], p["psnr"]) for p in climbing(same)]


def rate_cell(anchor: Sequence[tuple[float, float]], curve: Sequence[tuple[float, float]]) -> str:
    """Return the Bjøntegaard rate in percent, or a dash if it is undefined."""
    try:
        return shown(bd_rate(*zip(*anchor, strict=True), *zip(*curve, strict=True)), "+.0f")
    except (UndefinedDifference, TypeError):
        return "–"


def origins(best: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return the commits of the shown records, and how many of the repeated ones were equal."""
    again = [record["repeats"] for record in best.values() if record.get("repeats") is not None]
    git = (record["git"] or {"commit": "none", "dirty": False} for record in best.values())
    commits = dict.fromkeys(f"`{one['commit'][:7]}{'+' * one['dirty']}`" for one in git)
    return [f"Measured by {', '.join(commits)}; {sum(again)} of {len(again)} repeated steps gave the same bits."]
