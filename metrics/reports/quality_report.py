"""Report of all measures that a pair of pictures allows, and reasons for the missing ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from numpy.typing import ArrayLike

from ii_core import IIPicture
from ii_core.base import checks

from ..measures.measure import Measure, known_measures, measure_of
from ..measures.pair import Compared, PicturePair, Structure, picture_pair
from ..measures.quality import AngleQuality, DepthQuality, ViewQuality, told_outside
from ..rates.points import spelt


@dataclass
class Report:
    """Qualities of a picture, for people and for programs.

    Attributes
    ----------
    rows : dict of str to str
        A line of text by quality. A quality that is missing has its reason after a dash.
    numbers : dict
        The values, plain, infinities as text. ``missing`` holds the reasons of the qualities that are missing.
    depth : DepthQuality, optional
    """

    rows: dict[str, str] = field(default_factory=dict)
    numbers: dict[str, Any] = field(default_factory=dict)
    depth: DepthQuality | None = None

    def add(self, row: Row, pair: PicturePair) -> None:
        """Add a quality, or the reason why it is missing."""
        measure = measure_of(row.measure)
        reason = measure.needs.unmet(pair)
        if reason is not None:
            self.rows[row.label] = f"– {reason}"
            self.numbers.setdefault("missing", {})[row.name] = reason
            return
        quality = measure.result(pair)
        if isinstance(quality, DepthQuality):
            self.depth = quality
        self.rows[row.label], value = row.describe(quality)
        self.numbers[row.name] = spelt(value)
        if row.more is not None:
            label, name, describe = row.more
            self.rows[label], value = describe(quality)
            self.numbers[name] = spelt(value)


Describe = Callable[[Any], tuple[str, Any]]


@dataclass(frozen=True)
class Row:
    """A line of the report: label, name among the numbers, the measure it needs and computes, text and values."""

    label: str
    name: str
    measure: str
    describe: Describe
    more: tuple[str, str, Describe] | None = None


@checks.checked(ssim=checks.flag, over_depth=checks.flag, method=checks.text)
def report(
    reference: Compared,
    decoded: Compared,
    *,
    mask: ArrayLike | None = None,
    ssim: bool = False,
    over_depth: bool = False,
    depth: ArrayLike | None = None,
    layers_mm: ArrayLike | None = None,
    method: str = "dissertation",
    structure: Structure | None = None,
) -> Report:
    """Compute all measures that the pictures allow.

    Parameters
    ----------
    reference, decoded : IIPicture
        Of the same structure and type.
    mask : array_like of bool, (N, M), optional
        Which pixels count; see `q_global`. YCbCr and SSIM of sub-images need all pixels and are missing with a mask.
    ssim : bool
        Also SSIM, MS-SSIM and the measures of JPEG Pleno's conditions of every sub-image, which take longest.
    over_depth : bool
        Also Q_depth.
    depth, layers_mm, method
        As for `q_depth`.
    structure : IIPicture, IICamera or dict, optional
        Structure of pictures given as arrays (N, M, 3): that of a picture or a camera, or
        ``{"lenses": (K, L), "ei_pixels": (U, V)}``.

    Returns
    -------
    Report

    Raises
    ------
    TypeError
        If reference or decoded is no `IIPicture`.
    ValueError
        If the pictures differ in structure or type, hold a pixel that counts and is not finite, or a parameter is
        refused.
    """
    pair = picture_pair(reference, decoded, structure, mask=mask, depth=depth, layers_mm=layers_mm, method=method)
    made = Report(numbers={"unit": "dB"})
    for row in ROWS:
        if (ssim or row not in SLOW) and (over_depth or row is not DEPTH):
            made.add(row, pair)
    described = {measure_of(row.measure).compute for row in ROWS}
    for measure in known_measures().values():
        if measure.compute not in described and (over_depth or not measure.needs.depth):
            made.add(_plain_row(measure), pair)
    return made


def quality_rows(reference: IIPicture, decoded: IIPicture) -> list[tuple[str, str]]:
    """Return names and values of Q_global, Q_angle and, if possible, Q_view, for a table beside pictures."""
    pair = PicturePair(reference, decoded)
    angle = measure_of("q_angle_mean").compute(pair)
    rows = [
        ("Q_global", f"{measure_of('q_global').compute(pair):.2f} dB"),
        ("Q_angle", f"{angle.worst:.2f} … {angle.best:.2f} dB"),
    ]
    view = measure_of("q_view")
    if view.needs.unmet(pair) is None:
        rows += [(f"Q_view {name}", f"{value:.4f}") for name, value in view.compute(pair).values.items()]
    return rows


def _plain_row(measure: Measure) -> Row:
    """A row of a measure from outside: its number and what it is."""

    def describe(quality: Any) -> tuple[str, Any]:
        value = measure.number(quality)
        unit = f" {measure.unit}" if measure.unit else ""
        lower = "" if measure.higher_is_better else ", lower is better"
        return f"{measure.shown(value)}{unit}, {measure.text}{lower}", value

    return Row(measure.name, measure.name, measure.name, describe)


def _global(value: float) -> tuple[str, Any]:
    return f"{value:.2f} dB, pooled over all pixels", value


def _angle(quality: AngleQuality) -> tuple[str, Any]:
    v, u = quality.values.shape
    found: dict[str, Any] = {"values": quality.values.tolist(), "mean": quality.mean, "worst": quality.worst}
    text = f"{quality.mean:.2f} dB, mean of {u}×{v} angles; worst {quality.worst:.2f}, best {quality.best:.2f}"
    if quality.u_deg is not None and quality.v_deg is not None:
        found |= {"u_deg": quality.u_deg.tolist(), "v_deg": quality.v_deg.tolist()}
        text += f"; to ±{abs(quality.u_deg).max():.1f}° across, ±{abs(quality.v_deg).max():.1f}° down"
    return text, found


def _ycbcr(quality: AngleQuality) -> tuple[str, Any]:
    return _sub_images(quality, " dB", 2)


def _ssim(quality: AngleQuality) -> tuple[str, Any]:
    return _sub_images(quality, "", 4)


def _sub_images(quality: AngleQuality, unit: str, digits: int) -> tuple[str, Any]:
    u, v = quality.worst_view or (0, 0)  # they have values: these measures take no mask
    text = f"{quality.mean:.{digits}f}{unit}, mean of sub-images; worst {quality.worst:.{digits}f} at u {u}, v {v}"
    return text, {"mean": quality.mean, "worst": quality.worst, "worst_view": [u, v]}


def _view(quality: ViewQuality) -> tuple[str, Any]:
    each = ", ".join(f"{name} {value:.4f}" for name, value in quality.values.items())
    found = {**quality.values, "mean": quality.mean, "worst_view": quality.worst_view}
    return f"{quality.mean:.4f}, mean MSSIM of views ({each})", found


def _view_psnr(quality: ViewQuality) -> tuple[str, Any]:
    text = f"{quality.mean_psnr:.2f} dB, mean of views; {quality.pooled_psnr:.2f} pooled"
    return text, {**quality.psnr, "mean": quality.mean_psnr, "pooled": quality.pooled_psnr}


def _depth(quality: DepthQuality) -> tuple[str, Any]:
    held = int((quality.counts > 0).sum())
    text = f"no depth found; depth: {quality.source}"
    if held:
        text = (
            f"{quality.mean:.2f} dB, mean of {held} layers; worst {quality.min:.2f}, best {quality.max:.2f}; "
            f"depth: {quality.source}"
        )
    found = {name: getattr(quality, name).tolist() for name in ("depth_mm", "values", "counts")}
    single = ("min", "mean", "max", "outside", "outside_share", "missing", "source")
    found |= {name: getattr(quality, name) for name in single}
    text += f"; {told_outside(quality.outside_share)}"
    return text, found


DEPTH = Row("Q_depth", "q_depth", "q_depth_mean", _depth)
SLOW = (
    Row("SSIM", "ssim", "q_ssim", _ssim),
    Row("MS-SSIM", "ms_ssim", "q_ms_ssim", _ssim),
    Row("CTC PSNR-YUV", "ctc_psnr", "q_ctc_psnr", _ycbcr),
    Row("CTC SSIM of luma", "ctc_ssim", "q_ctc_ssim", _ssim),
)
ROWS = (
    Row("Q_global", "q_global", "q_global", _global),
    Row("Q_angle", "q_angle", "q_angle_mean", _angle),
    Row("YCbCr 6:1:1", "ycbcr", "q_ycbcr", _ycbcr),
    *SLOW,
    Row("Q_view", "q_view", "q_view", _view, ("Q_view PSNR", "q_view_psnr", _view_psnr)),
    DEPTH,
)
