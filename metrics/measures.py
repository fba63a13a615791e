"""Which qualities there are, by name: what a study measures, charts and compares."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from ii_core import IIPicture
from ii_core.view import camera_of

from .angle import q_angle_ssim, q_angle_ycbcr
from .depth.focus import FocusDepth, depth_from_focus
from .depth.q_depth import q_depth
from .global_angle import q_angle, q_global
from .view import WINDOW, q_view


@dataclass(frozen=True)
class Measure:
    """A quality as charts and tables name it; ``unit`` is empty for shares, ``digits`` are those worth printing."""

    label: str
    unit: str
    digits: int
    text: str

    @property
    def axis(self) -> str:
        """Label of a chart's axis."""
        return f"{self.label} [{self.unit}]" if self.unit else self.label

    def shown(self, value: float) -> str:
        """The number as a table has it."""
        return f"{value:.{self.digits}f}"


def _named(name: str, sub: str = "") -> str:
    return rf"$Q_\mathrm{{{name}}}$" + (f", {sub}" if sub else "")


MEASURES = {
    "q_global": Measure(_named("global"), "dB", 2, "PSNR of the whole picture"),
    "q_angle_mean": Measure(_named("angle", "mean"), "dB", 2, "mean of the sub-images' PSNRs"),
    "q_angle_min": Measure(_named("angle", "worst"), "dB", 2, "PSNR of the worst sub-image"),
    "q_ycbcr": Measure("YCbCr 6:1:1 PSNR", "dB", 2, "mean of the sub-images' YCbCr 6:1:1 PSNRs"),
    "q_ssim": Measure("SSIM of sub-images", "", 4, "mean of the sub-images' SSIM"),
    "q_ms_ssim": Measure("MS-SSIM of sub-images", "", 4, "mean of the sub-images' MS-SSIM over five scales"),
    "q_view": Measure(_named("view", "mean MSSIM"), "", 4, "mean of the five views' MSSIM"),
    "q_view_min": Measure(_named("view", "worst MSSIM"), "", 4, "MSSIM of the worst of the five views"),
    "q_view_psnr": Measure(_named("view", "mean PSNR"), "dB", 2, "mean of the five views' PSNRs"),
    "q_view_pooled_psnr": Measure(_named("view", "pooled PSNR"), "dB", 2, "PSNR of all five views together"),
    "q_depth_min": Measure(_named("depth", "min"), "dB", 2, "PSNR of the worst depth layer"),
    "q_depth_mean": Measure(_named("depth", "mean"), "dB", 2, "mean of the depth layers' PSNRs"),
    "q_depth_max": Measure(_named("depth", "max"), "dB", 2, "PSNR of the best depth layer"),
}
"""The qualities that studies and charts know, by name."""


def measure_of(name: str) -> Measure:
    """The measure of a name; ValueError with the known names if there is none."""
    if name not in MEASURES:
        raise ValueError(f"unknown measure {name!r}: known are {', '.join(MEASURES)}")
    return MEASURES[name]


def measuring(
    reference: IIPicture,
    names: Sequence[str],
    *,
    depth: ArrayLike | FocusDepth | None = None,
    layers_mm: ArrayLike | None = None,
    method: str = "dissertation",
) -> Callable[[IIPicture], dict[str, Any]]:
    """What measures a decoded picture against this reference; what can be found beforehand, is.

    Parameters
    ----------
    reference : IIPicture
    names : sequence of str
        Of MEASURES.
    depth, layers_mm, method
        As for `q_depth`, if it is among the names. Depth to be estimated is, once, here.

    Returns
    -------
    callable
        ``measure(decoded)`` gives a dict: every name's value; with a name of Q_depth also ``q_depth``, its value in
        every layer, ``depth_mm``, the layers, and ``depth_outside``, the share of view pixels in no layer.

    Raises
    ------
    ValueError
        If a name is unknown, or the reference does not allow what it names: no camera, not regular, too few lenses.
    """
    for name in names:
        measure_of(name)
    wanted = set(names)
    groups = {group: sorted(n for n in wanted if n.startswith(group)) for group in ("q_angle", "q_view", "q_depth")}
    if wanted - {"q_global"}:
        reference.check_regular()
    if groups["q_view"] or groups["q_depth"]:
        camera_of(reference)
    for group, lenses in (("q_view", WINDOW), ("q_ssim", WINDOW), ("q_ms_ssim", 16 * WINDOW)):
        if (groups.get(group) or group in wanted) and min(reference.lenses) < lenses:
            k, l = reference.lenses
            raise ValueError(f"{group} needs at least {lenses}×{lenses} lenses, the picture has {k}×{l}")
    if groups["q_depth"] and depth is None:
        depth = depth_from_focus(reference, layers_mm=layers_mm, method=method)

    def measure(decoded: IIPicture) -> dict[str, Any]:
        found: dict[str, Any] = {}
        if "q_global" in wanted:
            found["q_global"] = q_global(reference, decoded)
        if groups["q_angle"]:
            angle = q_angle(reference, decoded)
            found |= {"q_angle_mean": float(angle.mean()), "q_angle_min": float(angle.min())}
        if "q_ycbcr" in wanted:
            found["q_ycbcr"] = q_angle_ycbcr(reference, decoded).mean
        for name, scales in (("q_ssim", 1), ("q_ms_ssim", 5)):
            if name in wanted:
                found[name] = q_angle_ssim(reference, decoded, scales=scales).mean
        if groups["q_view"]:
            view = q_view(reference, decoded)
            found |= {"q_view": view.mean, "q_view_min": view.worst}
            found |= {"q_view_psnr": view.mean_psnr, "q_view_pooled_psnr": view.pooled_psnr}
        kept = {name: found[name] for name in names if name in found}
        if groups["q_depth"]:
            layers = q_depth(reference, decoded, depth=depth, layers_mm=layers_mm)
            extremes = {"q_depth_min": layers.min, "q_depth_mean": layers.mean, "q_depth_max": layers.max}
            kept |= {name: extremes[name] for name in groups["q_depth"]}
            kept |= {"q_depth": layers.values.tolist(), "depth_mm": layers.depth_mm.tolist()}
            kept["depth_outside"] = layers.outside_share
        return kept

    return measure
