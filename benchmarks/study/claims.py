"""Comparison of our numbers with those of Olsson 2008."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Any

import numpy as np

from benchmarks.records import number

from . import theirs
from .coding import SCENES
from .rates import APART, BFRAMES, CONTROLS, GOPS, MODEL, RANGES, REFERENCE, SI, VOLUME, types
from .theirs import Verdict, compare

Points = Sequence[Mapping[str, Any]]
Results = Mapping[str, Mapping[str, Any]]
NAMES = {
    REFERENCE: "JPEG 2000",
    VOLUME: "PVI",
    "si-h264:chroma=420": "SI",
    "ei-h264:chroma=420": "EI",
    "ri-h264:chroma=420": "RI",
}
EVEN_VIEW = 0.02  # tolerance of MSSIM: one point in the chart of the dissertation


@dataclass(frozen=True)
class Claim:
    """One result of the dissertation and ours: numbers as text, by name.

    ``scene`` is empty if the names are scenes. ``theirs`` is empty if the dissertation gives ranks or signs only.
    """

    figure: str
    what: str
    scene: str
    theirs: Mapping[str, str]
    ours: Mapping[str, str]
    verdict: Verdict


def claims(results: Results) -> list[Claim]:
    """Return all comparisons that the results allow, in the order of the dissertation."""
    coding = (gains, models, floors, factors, orders, duels, picture_types, ranges, controls, times)
    found: list[Claim] = []
    for part in (*coding, views, depths):
        found += part(results)
    return found


def of_scenes(results: Results, step: str) -> dict[str, Mapping[str, Any]]:
    """Return the results of a step by scene."""
    return {scene: results[f"{step}-{scene}"] for scene in SCENES if f"{step}-{scene}" in results}


def gain(points: Points, scheme: str, other: str, quality: str = "q_global") -> float | None:
    """Return the mean difference in quality over target rates that both meet; None without any."""
    mine, its = (at_targets(points, name, quality) for name in (scheme, other))
    both = mine.keys() & its.keys()
    return fmean(mine[rate] - its[rate] for rate in sorted(both)) if both else None


def at_targets(points: Points, scheme: str, quality: str = "q_global") -> dict[float, float]:
    """Return the quality by target rate, for met targets."""
    return {p["target_bpp"]: number(p[quality]) for p in points if p["scheme"] == scheme and p["reached"]}


def gains(results: Results) -> Iterator[Claim]:
    """Compare Figure 5.10: SI-PVS over the others, 4:2:0 and 4:4:4."""
    made = of_scenes(results, "rates")
    for what, numbers, other in (
        ("JPEG 2000", theirs.GAIN_JPEG2000, (REFERENCE, REFERENCE)),
        ("SI-PVI", theirs.GAIN_VOLUME, (VOLUME, VOLUME)),
        ("EI-PVS", theirs.GAIN_EI, ("ei-h264:chroma=420", "ei-h264")),
    ):
        for scheme, against in zip((SI, "si-h264"), other, strict=True):
            ours = {scene: gain(result["points"], scheme, against) for scene, result in made.items()}
            if ours:
                yield claim("5.10", f"SI-PVS over {what}, dB", numbers, ours, "+.1f")


def models(results: Results) -> Iterator[Claim]:
    """Compare Figure 5.10: SI-PVS over the volume by the verification model, and by ours with each colour alone."""
    made, coded = of_scenes(results, "rates"), of_scenes(results, "volume")
    for how, volume in (("by the verification model", MODEL), ("of ours, each colour alone", APART)):
        for scheme in (SI, "si-h264"):  # 4:2:0, 4:4:4
            ours = {s: lead(made[s]["points"], scheme, coded[s]["points"], volume) for s in made if s in coded}
            if ours:
                yield claim("5.10", f"SI-PVS over SI-PVI {how}, dB", theirs.GAIN_VOLUME, ours, "+.1f")


def lead(points: Points, scheme: str, others: Points, other: str) -> float | None:
    """Return the mean difference in quality at the rates of the other scheme, within the range of this one."""
    rates, quality = zip(*((math.log(p["bpp"]), number(p["q_global"])) for p in by_rate(points, scheme)), strict=True)
    found = [
        float(np.interp(math.log(p["bpp"]), rates, quality)) - number(p["q_global"])
        for p in by_rate(others, other)
        if rates[0] <= math.log(p["bpp"]) <= rates[-1]
    ]
    return fmean(found) if found else None


def by_rate(points: Points, scheme: str) -> list[Mapping[str, Any]]:
    """Return the points of a scheme by rate."""
    return sorted((p for p in points if p["scheme"] == scheme), key=lambda p: p["bpp"])


def claim(
    figure: str,
    what: str,
    numbers: Mapping[str, float],
    ours: Mapping[str, float | None],
    form: str,
    *,
    scene: str = "",
    **rules: Any,
) -> Claim:
    """Return the comparison of numbers by name, for the names of ours."""
    numbers = {name: value for name, value in numbers.items() if name in ours}
    return Claim(figure, what, scene, texts(numbers, form), texts(ours, form), compare(numbers, ours, **rules))


def ranked(
    figure: str,
    what: str,
    ranks: Mapping[str, float],
    ours: Mapping[str, float | None],
    form: str,
    *,
    scene: str,
    only: str = "order",
    even: float = 0.0,
) -> Claim:
    """Return the comparison of our numbers with ranks or signs."""
    return Claim(figure, what, scene, {}, texts(ours, form), compare(ranks, ours, only=only, even=even))


def texts(numbers: Mapping[str, float | None], form: str) -> dict[str, str]:
    """Return numbers as text, by name."""
    return {name: shown(value, form) for name, value in numbers.items()}


def shown(value: float | None, form: str) -> str:
    """Return a number with a minus sign, or a dash if it is missing."""
    return "–" if value is None or math.isnan(value) else format(value, form).replace("-", "−")


def floors(results: Results) -> Iterator[Claim]:
    """Compare the lowest rate of EI-PVS, of a black picture."""
    if "floors" in results:
        ours = {"EI-PVS": results["floors"]["bpp"]["ei-h264:chroma=420"]}
        yield claim("5.10", "lowest rate of a black picture, bpp", theirs.EI_FLOOR, ours, ".2f", only="size")


def factors(results: Results) -> Iterator[Claim]:
    """Compare the ratios of rate to SI-PVS at equal quality."""
    made = of_scenes(results, "rates")
    ours = {s: rate_ratio(made[s]["points"], SI, REFERENCE, None) for s in theirs.RATE_JPEG2000 if s in made}
    if ours:
        what = "rate of JPEG 2000 over SI-PVS's, at JPEG 2000's best quality up to 1 bpp, times"
        yield claim("5.10", what, theirs.RATE_JPEG2000, ours, ".0f", only="size")
    ours = {s: rate_ratio(made[s]["points"], SI, VOLUME, 30.0) for s in made}
    if ours:
        yield claim(
            "5.10", "rate of SI-PVI over SI-PVS's at 30 dB, times", theirs.RATE_VOLUME, ours, ".1f", only="size"
        )


def rate_ratio(points: Points, scheme: str, other: str, quality: float | None) -> float | None:
    """Return the ratio of rates of another scheme and of a scheme at one quality, by default the other's at 1 bpp.

    If the scheme's lowest point is better already, its rate is used and the ratio is a lower bound. None if a curve
    does not reach the quality.
    """
    mine, its = (rising([p for p in points if p["scheme"] == name]) for name in (scheme, other))
    if len(mine) < 2 or len(its) < 2:
        return None
    if quality is None:
        quality = float(np.interp(0.0, *zip(*((math.log(r), q) for r, q in its), strict=True)))
        if mine[0][1] > quality:
            return 1.0 / mine[0][0]
    rates = [log_rate_at(curve, quality) for curve in (mine, its)]
    return None if None in rates else math.exp(rates[1] - rates[0])  # type: ignore[operator]


def rising(points: Points) -> list[tuple[float, float]]:
    """Return (rate, quality) by rate, without points whose additional bits do not raise quality."""
    kept: list[tuple[float, float]] = []
    for rate, quality in sorted({(p["bpp"], number(p["q_global"])) for p in points}):
        if not kept or quality > kept[-1][1]:
            kept.append((rate, quality))
    return kept


def log_rate_at(curve: Sequence[tuple[float, float]], quality: float) -> float | None:
    """Return the logarithm of the rate at a quality; None beyond the ends of the curve."""
    if not curve[0][1] <= quality <= curve[-1][1]:
        return None
    return float(np.interp(quality, [q for _, q in curve], [math.log(r) for r, _ in curve]))


def orders(results: Results) -> Iterator[Claim]:
    """Compare Figure 5.11: orders of sub-images."""
    for scene, result in of_scenes(results, "orders").items():
        ours = {
            order: gain(result["points"], f"{SI},order={order}", f"{SI},order=parallel") for order in theirs.ORDERS
        }
        yield ranked("5.11", "orders", theirs.ORDERS, ours, "+.2f", scene=scene)


def duels(results: Results) -> Iterator[Claim]:
    """Compare Figure 5.12: the better kind by size of elementary image."""
    for scene in ("apples", "car"):
        if f"plane-{scene}-1" not in results:
            continue
        made = results[f"plane-{scene}-1"]["duels"]
        ours = {str(duel["side"]): advantage(duel) for duel in made}
        verdict = compare({side: theirs.DUELS[side] for side in ours}, ours, only="sign")
        signs = {side: "+" if value > 0 else "−" for side, value in theirs.DUELS.items()}
        yield Claim("5.12", "lead", scene, signs, {str(duel["side"]): words(duel) for duel in made}, verdict)


def advantage(duel: Mapping[str, Any], other: str = "ei") -> float | None:
    """Return the mean gain of SI in dB; without a common rate, ±: the sign of the kind with the lower rate."""
    if duel[other]["gain_db"] is not None:
        return float(duel[other]["gain_db"])
    lowest = duel[other]["lowest"]
    mine, its = (lowest[kind] if lowest[kind] is not None else math.inf for kind in ("si", other))
    return None if mine == its else math.copysign(1.0, its - mine)


def words(duel: Mapping[str, Any]) -> str:
    """Return the gain, or the only kind."""
    if duel["ei"]["gain_db"] is not None:
        return shown(duel["ei"]["gain_db"], "+.1f")
    value = advantage(duel)
    return "–" if value is None else "SI alone" if value > 0 else "EI alone"


def type_table(result: Mapping[str, Any], *more: str) -> list[list[float | None]]:
    """Return our Table 5.5."""
    flat = [gain(result["points"], scheme, types()[0]) for scheme in types(*more)]
    return [flat[i : i + len(BFRAMES)] for i in range(0, len(flat), len(BFRAMES))]


def picture_types(results: Results) -> Iterator[Claim]:
    """Compare Table 5.5, without and with B pictures as references."""
    numbers = {f"{i}{j}": theirs.TYPES[i][j] for i in range(len(GOPS)) for j in range(len(BFRAMES))}
    for step, what, more in (
        ("types-apples", "picture types", ()),
        ("types-as-references-apples", "picture types, B predict B", ("pyramid=1",)),
    ):
        if step not in results:
            continue
        table = type_table(results[step], *more)
        ours = {f"{i}{j}": table[i][j] for i in range(len(GOPS)) for j in range(len(BFRAMES))}
        yield claim("Table 5.5", what, numbers, ours, "+.2f", scene="apples")


def ranges(results: Results) -> Iterator[Claim]:
    """Compare Table 5.6."""
    schemes = [f"{SI},merange={r}" for r in RANGES]
    for scene in ("apples", "twins"):
        if f"ranges-{scene}" not in results:
            continue
        points = results[f"ranges-{scene}"]["points"]
        names = [str(r) for r in RANGES]
        ours = {n: gain(points, scheme, schemes[0]) for n, scheme in zip(names, schemes, strict=True)}
        numbers = dict(zip(names, theirs.RANGE_DB[scene], strict=True))
        yield claim("Table 5.6", "dB", numbers, ours, "+.2f", scene=scene)
        took = {
            n: seconds(points, scheme) / seconds(points, schemes[0]) for n, scheme in zip(names, schemes, strict=True)
        }
        numbers = dict(zip(names, theirs.RANGE_TIME[scene], strict=True))
        yield claim("Table 5.6", "times", numbers, took, ".1f", scene=scene, only="order size")


def seconds(points: Points, scheme: str, what: str = "encode_seconds") -> float:
    """Return the mean CPU seconds over met rates, or over all if unknown."""
    own = [p[what] for p in points if p["scheme"] == scheme and p.get("reached", True)]
    return fmean(own) if own else math.nan


def controls(results: Results) -> Iterator[Claim]:
    """Compare Table 5.7."""
    for scene in ("apples", "twins"):
        if f"control-{scene}" not in results:
            continue
        points = results[f"control-{scene}"]["points"]
        first = f"{SI},rate={CONTROLS[0]}"
        schemes = {name: f"{SI},rate={name}" for name in CONTROLS[1:]}
        better = {name: gain(points, scheme, first) for name, scheme in schemes.items()}
        yield claim("Table 5.7", "dB", theirs.CONTROL_DB[scene], better, "+.2f", scene=scene)
        took = {name: seconds(points, scheme) / seconds(points, first) for name, scheme in schemes.items()}
        numbers = theirs.CONTROL_TIME[scene]
        yield claim("Table 5.7", "times", numbers, took, ".2f", scene=scene, only="order size")


MODEL_TIME = "SI-PVI by the verification model"
TIMED = {
    "SI-PVS": SI,
    "JPEG 2000": REFERENCE,
    "SI-PVI": VOLUME,
    "EI-PVS": "ei-h264:chroma=420",
    "RI-PVS": "ri-h264:chroma=420",
}


def times(results: Results) -> Iterator[Claim]:
    """Compare Table 5.8: encoding, against SI-PVS."""
    for scene, result in of_scenes(results, "rates").items():
        own = {name: seconds(result["points"], scheme) for name, scheme in TIMED.items()}
        ours = {name: value / own["SI-PVS"] for name, value in own.items() if name != "SI-PVS"}
        column = list(SCENES).index(scene)
        numbers = {name: theirs.ENCODE[name][column] / theirs.ENCODE["SI-PVS"][column] for name in ours}
        yield claim("Table 5.8", "times", numbers, ours, ".3g", scene=scene, only="order size")
    volumes, made = of_scenes(results, "volume"), of_scenes(results, "rates")
    both = [scene for scene in volumes if scene in made]
    if both:
        ours = {s: seconds(volumes[s]["points"], MODEL) / seconds(made[s]["points"], SI) for s in both}
        columns = {scene: list(SCENES).index(scene) for scene in both}
        numbers = {s: theirs.ENCODE["SI-PVI"][i] / theirs.ENCODE["SI-PVS"][i] for s, i in columns.items()}
        yield claim("Table 5.8", MODEL_TIME, numbers, ours, ".3g", only="order size")


def views(results: Results) -> Iterator[Claim]:
    """Compare Figure 5.19: ranks at 0.15 bpp."""
    for scene, result in of_scenes(results, "artefacts").items():
        places = theirs.VIEW_PLACES[scene]
        ranks = {name: float(-place) for place, names in enumerate(places) for name in names}
        ours = {NAMES[p["scheme"]]: p["q_view"] for p in result["points"] if p["reached"]}
        yield ranked("5.19", "Q_view", ranks, ours, ".3f", scene=scene, even=EVEN_VIEW)


def depths(results: Results) -> Iterator[Claim]:
    """Compare Figures 5.20 to 5.23, which the dissertation has for *Apples* alone."""
    for scene, result in of_scenes(results, "equal").items():
        rows = {NAMES[row["scheme"]]: row for row in result["rows"]}
        if scene == "apples":
            ours = {name: rows[name]["bpp"] for name in theirs.RATE_28_DB}
            yield claim("5.20", "bpp for 28 dB", theirs.RATE_28_DB, ours, ".2f", scene=scene, only="order size")
        for key, held, how in (
            ("q_depth", "depth_pixels", "true depth"),
            ("q_depth_focus", "focus_pixels", "depth by focus"),
        ):
            if held not in result:
                continue
            pixels = np.array(result[held])
            layers = {name: np.array([number(v) for v in row[key]]) for name, row in rows.items()}
            lost = {name: decline(layers[name], pixels) for name in theirs.DECLINE}
            yield ranked("5.21", f"decline, {how}", theirs.DECLINE, lost, "+.1f", scene=scene)
            spread = {name: fluctuation(layers[name], pixels) for name in theirs.FLUCTUATION}
            yield ranked("5.21", f"fluctuation, {how}", theirs.FLUCTUATION, spread, ".1f", scene=scene)
    for scene, result in of_scenes(results, "views").items():
        for quality, word in (("q_depth_mean", "mean"), ("q_depth_min", "least")):
            for chroma, scheme in (("4:2:0", SI), ("4:4:4", "si-h264")):
                ours = {scene: gain(result["points"], scheme, REFERENCE, quality)}
                yield ranked("5.23", f"{word}, {chroma}", {scene: 1.0}, ours, "+.1f", scene=scene, only="sign")


def pooled(values: np.ndarray, pixels: np.ndarray) -> float:
    """Return the PSNR of the pooled errors of several layers, without empty ones."""
    held = (pixels > 0) & np.isfinite(values)
    return float(-10 * np.log10(np.sum(pixels[held] * 10 ** (-values[held] / 10)) / pixels[held].sum()))


def decline(values: np.ndarray, pixels: np.ndarray) -> float:
    """Return the PSNR of the nearer half of the pixels minus that of the farther half."""
    near = np.cumsum(pixels) <= pixels.sum() / 2
    return pooled(values, np.where(near, pixels, 0)) - pooled(values, np.where(near, 0, pixels))


def fluctuation(values: np.ndarray, pixels: np.ndarray) -> float:
    """Return the standard deviation over layers with pixels."""
    return float(np.std(values[(pixels > 0) & np.isfinite(values)]))
