"""Built-in measures: PSNR and SSIM of the picture, its sub-images, its views and its depth layers."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from .angle import SCALES, angle_ssim, angle_ycbcr
from .ctc import ctc_psnr, ctc_ssim
from .global_angle import angle_psnr, global_psnr
from .measure import MEASURES, Measure, Needs, register_measure
from .q_depth import depth_quality
from .view import WINDOW, view_quality

__all__ = ["MEASURES"]

ANGLES = Needs(regular=True)
ALL_ANGLES = Needs(regular=True, all_pixels=True)
VIEWS = Needs(regular=True, camera=True, lenses=WINDOW)
DEPTH = Needs(regular=True, camera=True, depth=True)
SSIM, MS_SSIM = partial(angle_ssim, scales=1), partial(angle_ssim, scales=len(SCALES))


def _mean(quality: Any) -> float:
    return quality.mean


def _worst(quality: Any) -> float:
    return quality.worst


def _named(name: str, sub: str = "") -> str:
    return rf"$Q_\mathrm{{{name}}}$" + (f", {sub}" if sub else "")


def _db(name: str, needs: Needs, compute: Any, value: Callable[[Any], float], label: str, text: str) -> None:
    register_measure(
        Measure(name=name, needs=needs, compute=compute, value=value, label=label, text=text, unit="dB", digits=2)
    )


def _share(name: str, needs: Needs, compute: Any, value: Callable[[Any], float], label: str, text: str) -> None:
    register_measure(Measure(name=name, needs=needs, compute=compute, value=value, label=label, text=text, digits=4))


_db("q_global", Needs(), global_psnr, float, _named("global"), "PSNR of the whole picture")
_db("q_angle_mean", ANGLES, angle_psnr, _mean, _named("angle", "mean"), "mean of the sub-images' PSNRs")
_db("q_angle_min", ANGLES, angle_psnr, _worst, _named("angle", "worst"), "PSNR of the worst sub-image")
_db("q_ycbcr", ALL_ANGLES, angle_ycbcr, _mean, "YCbCr 6:1:1 PSNR", "mean of the sub-images' YCbCr 6:1:1 PSNRs")
_db(
    "q_ctc_psnr",
    ALL_ANGLES,
    ctc_psnr,
    _mean,
    "PSNR-YUV of the CTC",
    "mean of the views' PSNR-YUV by JPEG Pleno's CTC",
)
_db(
    "q_ctc_min",
    ALL_ANGLES,
    ctc_psnr,
    _worst,
    "PSNR-YUV of the CTC, worst view",
    "PSNR-YUV of the worst view by JPEG Pleno's CTC",
)
register_measure(
    Measure(
        name="q_ctc_step",
        needs=ALL_ANGLES,
        compute=ctc_psnr,
        value=lambda quality: quality.step,
        label="change of PSNR-YUV from view to view",
        text="root mean square change of the views' PSNR-YUV along the serpentine path",
        unit="dB",
        digits=2,
        higher_is_better=False,
    )
)
_share(
    "q_ctc_ssim",
    ALL_ANGLES,
    ctc_ssim,
    _mean,
    "SSIM of the CTC",
    "mean of the views' SSIM of luma by JPEG Pleno's CTC",
)
_share(
    "q_ssim",
    Needs(regular=True, all_pixels=True, lenses=WINDOW),
    SSIM,
    _mean,
    "SSIM of sub-images",
    "mean of the sub-images' SSIM",
)
_share(
    "q_ms_ssim",
    Needs(regular=True, all_pixels=True, lenses=WINDOW * 2 ** (len(SCALES) - 1)),
    MS_SSIM,
    _mean,
    "MS-SSIM of sub-images",
    "mean of the sub-images' MS-SSIM over five scales",
)
_share("q_view", VIEWS, view_quality, _mean, _named("view", "mean MSSIM"), "mean of the five views' MSSIM")
_share(
    "q_view_min", VIEWS, view_quality, _worst, _named("view", "worst MSSIM"), "MSSIM of the worst of the five views"
)
_db(
    "q_view_psnr",
    VIEWS,
    view_quality,
    lambda quality: quality.mean_psnr,
    _named("view", "mean PSNR"),
    "mean of the five views' PSNRs",
)
_db(
    "q_view_pooled_psnr",
    VIEWS,
    view_quality,
    lambda quality: quality.pooled_psnr,
    _named("view", "pooled PSNR"),
    "PSNR of all five views together",
)
_db(
    "q_depth_min",
    DEPTH,
    depth_quality,
    lambda quality: quality.min,
    _named("depth", "min"),
    "PSNR of the worst depth layer",
)
_db("q_depth_mean", DEPTH, depth_quality, _mean, _named("depth", "mean"), "mean of the depth layers' PSNRs")
_db(
    "q_depth_max",
    DEPTH,
    depth_quality,
    lambda quality: quality.max,
    _named("depth", "max"),
    "PSNR of the best depth layer",
)
