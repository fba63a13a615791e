"""All that can be said about a decoded picture, and why the rest cannot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from numpy.typing import ArrayLike

from ii_core import IIPicture

from .angle import SCALES, q_angle_ssim, q_angle_ycbcr
from .depth.q_depth import DepthQuality, q_depth, told_outside
from .global_angle import angle_axes, mean_q_angle, q_angle, q_global
from .study import spelt
from .view import WINDOW, q_view


@dataclass
class Report:
    """Qualities of a picture, for people and for programs.

    Attributes
    ----------
    rows : dict of str to str
        A line of text by quality, those that cannot be given with the reason after a dash.
    numbers : dict
        The values, plain, infinities as text; what cannot be given is in ``missing`` with its reason.
    depth : DepthQuality, optional
    """

    rows: dict[str, str] = field(default_factory=dict)
    numbers: dict[str, Any] = field(default_factory=dict)
    depth: DepthQuality | None = None

    def add(self, label: str, name: str, reason: str | None, make: Callable[[], tuple[str, Any]]) -> None:
        """Add a quality, or the reason why there is none."""
        if reason is not None:
            self.rows[label] = f"– {reason}"
            self.numbers.setdefault("missing", {})[name] = reason
        else:
            self.rows[label] = ""  # its place, before what it may add itself
            self.rows[label], value = make()
            self.numbers[name] = spelt(value)


def report(
    reference: IIPicture,
    decoded: IIPicture,
    *,
    mask: ArrayLike | None = None,
    ssim: bool = False,
    over_depth: bool = False,
    depth: ArrayLike | None = None,
    layers_mm: ArrayLike | None = None,
    method: str = "dissertation",
) -> Report:
    """Measure what the pictures allow.

    Parameters
    ----------
    reference, decoded : IIPicture
        Of the same structure and type.
    mask : array_like of bool, (N, M), optional
        Which pixels count; see `q_global`. YCbCr and SSIM of sub-images need all and are left out with one.
    ssim : bool
        Also SSIM and MS-SSIM of every sub-image, which take longest.
    over_depth : bool
        Also Q_depth.
    depth, layers_mm, method
        As for `q_depth`.

    Returns
    -------
    Report

    Raises
    ------
    ValueError
        If the pictures differ in structure or type, hold a pixel that counts and is not finite, or a parameter is
        refused.
    """
    made = Report(numbers={"unit": "dB"})
    made.add("Q_global", "q_global", None, lambda: _global(q_global(reference, decoded, mask=mask)))
    regular = None if reference.regular else "the structure is not regular: raytrace-ii regular makes it so"
    whole = regular or (None if mask is None else "needs all pixels, a mask leaves some out")
    made.add("Q_angle", "q_angle", regular, lambda: _angle(reference, decoded, mask))
    made.add("YCbCr 6:1:1", "ycbcr", whole, lambda: _views(q_angle_ycbcr(reference, decoded), " dB", 2))
    if ssim:
        for label, name, scales in (("SSIM", "ssim", 1), ("MS-SSIM", "ms_ssim", len(SCALES))):
            few = whole or _few(reference, WINDOW * 2 ** (scales - 1))
            made.add(label, name, few, partial(_ssim, reference, decoded, scales))
    seen = regular or _unseen(reference)
    made.add("Q_view", "q_view", seen or _few(reference, WINDOW), lambda: _view(made, reference, decoded, mask))
    if over_depth:
        bent = seen
        if not seen and depth is None and reference.camera is not None and reference.camera.front:
            bent = f"a {reference.camera.front[0].kind} before the lenses bends lines of sight: give a depth map"
        options: Any = {"mask": mask, "depth": depth, "layers_mm": layers_mm, "method": method}
        made.add("Q_depth", "q_depth", bent, lambda: _depth(made, q_depth(reference, decoded, **options)))
    return made


def quality_rows(reference: IIPicture, decoded: IIPicture) -> list[tuple[str, str]]:
    """Names and values of Q_global, Q_angle and, where the picture allows, Q_view, for a table beside pictures."""
    angle = q_angle(reference, decoded)
    rows = [
        ("Q_global", f"{q_global(reference, decoded):.2f} dB"),
        ("Q_angle", f"{angle.min():.2f} … {angle.max():.2f} dB"),
    ]
    if not (_unseen(reference) or _few(reference, WINDOW)):
        rows += [(f"Q_view {name}", f"{value:.4f}") for name, value in q_view(reference, decoded).values.items()]
    return rows


def _unseen(picture: IIPicture) -> str | None:
    if picture.camera is not None:
        return None
    return "the picture has no camera: gap and pixel pitch are needed to look through its lenses"


def _few(picture: IIPicture, needed: int) -> str | None:
    k, l = picture.lenses
    return None if min(k, l) >= needed else f"needs at least {needed}×{needed} lenses, the picture has {k}×{l}"


def _global(value: float) -> tuple[str, Any]:
    return f"{value:.2f} dB, pooled over all pixels", value


def _angle(reference: IIPicture, decoded: IIPicture, mask: Any) -> tuple[str, Any]:
    values = q_angle(reference, decoded, mask=mask)
    mean = mean_q_angle(reference, decoded, mask=mask)
    v, u = values.shape
    found: dict[str, Any] = {"values": values.tolist(), "mean": mean, "worst": float(values.min())}
    text = f"{mean:.2f} dB, mean of {u}×{v} angles; worst {values.min():.2f}, best {values.max():.2f}"
    if reference.camera is not None:
        across, down = angle_axes(reference.camera, erect=reference.erect)
        found |= {"u_deg": across.tolist(), "v_deg": down.tolist()}
        text += f"; to ±{abs(across).max():.1f}° across, ±{abs(down).max():.1f}° down"
    return text, found


def _ssim(reference: IIPicture, decoded: IIPicture, scales: int) -> tuple[str, Any]:
    return _views(q_angle_ssim(reference, decoded, scales=scales), "", 4)


def _views(quality: Any, unit: str, digits: int) -> tuple[str, Any]:
    u, v = quality.worst_view
    text = f"{quality.mean:.{digits}f}{unit}, mean of sub-images; worst {quality.worst:.{digits}f} at u {u}, v {v}"
    return text, {"mean": quality.mean, "worst": quality.worst, "worst_view": [u, v]}


def _view(made: Report, reference: IIPicture, decoded: IIPicture, mask: Any) -> tuple[str, Any]:
    view = q_view(reference, decoded, mask=mask)
    each = ", ".join(f"{name} {value:.4f}" for name, value in view.values.items())
    found = {**view.values, "mean": view.mean, "worst_view": view.worst_view}
    psnr = {**view.psnr, "mean": view.mean_psnr, "pooled": view.pooled_psnr}
    made.numbers["q_view_psnr"] = spelt(psnr)
    made.rows["Q_view PSNR"] = f"{view.mean_psnr:.2f} dB, mean of views; {view.pooled_psnr:.2f} pooled"
    return f"{view.mean:.4f}, mean MSSIM of views ({each})", found


def _depth(made: Report, quality: DepthQuality) -> tuple[str, Any]:
    made.depth = quality
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
