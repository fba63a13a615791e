"""Errors of disparity maps, as the toolkit of the 4D Light Field Benchmark defines them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ii_core import IICamera, depth_of_disparity
from ii_core.base import checks
from ii_core.base.colour import KB, KG, KR
from ii_core.base.extras import Lazy

ndimage = Lazy("scipy.ndimage")
BORDER = 15  # px at each side that do not count
THRESHOLDS = (0.01, 0.03, 0.07)  # px
FINE = 0.15  # px by which thin things are too fat or too thin
# Our regions where the benchmark has masks: jump in disparity, px; window, px; codes of luma; thin things, px; bend
# of a surface, px per px².
JUMP, AROUND, EVEN, THIN, BENT = 0.2, 5, 2.0, 7, 2e-4
Mask = NDArray[np.bool_]
SCHARR = np.array([[3.0, 10, 3], [0, 0, 0], [-3, -10, -3]]) / 64


@checks.checked(
    disparity=checks.numbers, truth=checks.numbers, border=checks.whole_from(0, 1 << 16), regions=checks.mapping,
    camera=checks.instance(IICamera),
)  # fmt: skip
def depth_errors(
    disparity: ArrayLike,
    truth: ArrayLike,
    *,
    border: int = BORDER,
    regions: dict[str, Mask] | None = None,
    camera: IICamera | None = None,
) -> dict[str, float]:
    """Return the errors of a disparity map by name.

    Parameters
    ----------
    disparity, truth : array_like, (rows, columns)
        Pixels a step between views. Pixels without truth (NaN) do not count, pixels without disparity are bad.
    border : int
        Pixels at each side that do not count.
    regions : dict of str to ndarray of bool, optional
        Masks, such as `depth_regions` finds; ``badpix_007_NAME`` is that of a region, ``mae_NAME`` the angle error.
    camera : IICamera, optional
        Of converged views; angle errors of ``planes`` and ``surfaces`` need it.

    Returns
    -------
    dict
        ``badpix_001``, ``badpix_003``, ``badpix_007``: percentage with an error above 0.01, 0.03, 0.07 px.
        ``mse_100``: mean squared error times 100. ``q_25``: 25th percentile of the error times 100. ``unknown``:
        percentage without disparity. For thin things ``fine_fattening`` and ``fine_thinning``: percentage around
        them nearer, on them farther, than the truth by 0.15 px. NaN for a region without pixels.

    References
    ----------
    Honauer et al., A dataset and evaluation methodology for depth estimation on 4D light fields, ACCV 2016; the
    benchmark's evaluation toolkit. It counts pixels without disparity as good; here they are bad.
    """
    found, true = np.asarray(disparity, np.float64), np.asarray(truth, np.float64)
    if found.ndim != 2 or found.shape != true.shape:
        raise ValueError(
            f"disparity is of shape {found.shape}, truth of {true.shape}: two maps of one size are needed"
        )
    counts = np.isfinite(true)
    inner = np.zeros_like(counts)
    inner[border : found.shape[0] - border, border : found.shape[1] - border] = True
    counts &= inner
    if not counts.any():
        raise ValueError(f"no pixel at least {border} px from the border has a truth")
    error = np.abs(found - true)
    known = counts & np.isfinite(error)
    rows = {f"badpix_{round(100 * t):03d}": _share(~(error <= t), counts) for t in THRESHOLDS}
    rows["mse_100"] = float(100 * np.mean(error[known] ** 2)) if known.any() else float("nan")
    ordered = np.sort(error[known])
    rows["q_25"] = float(100 * ordered[int(ordered.size * 0.25)]) if known.any() else float("nan")
    rows["unknown"] = _share(~np.isfinite(found), counts)
    masks = {} if regions is None else regions
    for name, mask in masks.items():
        if np.shape(mask) != found.shape:
            raise ValueError(f"region {name} is of shape {np.shape(mask)}: {found.shape} is needed")
        rows[f"badpix_007_{name}"] = _share(~(error <= THRESHOLDS[-1]), counts & mask)
    if "thin" in masks:
        around = ndimage.binary_dilation(masks["thin"], iterations=3) & ~masks["thin"]
        rows["fine_fattening"] = _share(true - found < -FINE, counts & around)
        rows["fine_thinning"] = _share(true - found > FINE, counts & masks["thin"])
    if camera is not None:
        angle = angle_errors(found, true, camera)
        for name in {"planes", "surfaces"} & masks.keys():
            chosen = angle[counts & masks[name] & np.isfinite(angle)]
            rows[f"mae_{name}"] = float(np.median(chosen)) if chosen.size else float("nan")
    return rows


def angle_errors(found: NDArray[np.float64], true: NDArray[np.float64], camera: IICamera) -> NDArray[np.float64]:
    """Return the angles between the normals of two disparity maps, degrees, in the toolkit's frame.

    There x and y are half the column and row over the last one, times the width of the field at the pixel's depth.
    """
    if camera.viewer_mm is None:
        raise ValueError("the camera's views are parallel: angle errors are for views that meet")
    cosine = (_normals(found, camera) * _normals(true, camera)).sum(axis=2)
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def _normals(disparity: NDArray[np.float64], camera: IICamera) -> NDArray[np.float64]:
    assert camera.viewer_mm is not None
    rows, cols = disparity.shape
    z = depth_of_disparity(camera, disparity) - camera.origin_mm[2] - camera.gap_mm + camera.viewer_mm
    z[~np.isfinite(z)] = np.nan
    width = camera.lenses[0] * camera.lens_pitch_mm[0] / camera.viewer_mm * z
    across, down = np.meshgrid(np.arange(cols) / (cols - 1) / 2, np.arange(rows) / (rows - 1) / 2)
    place = np.stack([across * width, down * width, z])
    dx = ndimage.convolve(place, SCHARR.T[None], mode="nearest")
    dy = ndimage.convolve(place, SCHARR[None], mode="nearest")
    normal = np.cross(dx, dy, axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.moveaxis(normal / np.linalg.norm(normal, axis=0), 0, -1))


@checks.checked(truth=checks.numbers, view=checks.array)
def depth_regions(truth: ArrayLike, view: NDArray[Any]) -> dict[str, Mask]:
    """Return regions of a view by its true disparity and its pixels, where the benchmark has masks drawn by hand.

    Parameters
    ----------
    truth : array_like, (rows, columns)
    view : ndarray, (rows, columns, 3)
        sRGB of 8 or 16 bits, or light.

    Returns
    -------
    dict of str to ndarray of bool
        ``outlines``: within 2 px of a jump above 0.2 px. ``textureless``: luma differs by less than 2 codes of 8
        bits, as a standard deviation in 5×5 px. ``thin``: nearer than its surroundings on both sides within 7 px.
        ``planes`` and ``surfaces``: the rest, with disparity linear in place or bent.
    """
    true = np.asarray(truth, np.float64)
    if true.ndim != 2 or np.shape(view) != (*true.shape, 3):
        raise ValueError(
            f"truth is of shape {true.shape}, view of {np.shape(view)}: a map and its picture are needed"
        )
    filled = np.where(np.isfinite(true), true, np.nanmin(true) if np.isfinite(true).any() else 0.0)
    spread = ndimage.maximum_filter(filled, AROUND) - ndimage.minimum_filter(filled, AROUND)
    top = 1.0 if view.dtype.kind == "f" else np.iinfo(view.dtype).max
    luma = view.astype(np.float64) @ [KR, KG, KB] * (255 / top)
    mean = ndimage.uniform_filter(luma, AROUND)
    deviation = np.sqrt(np.maximum(ndimage.uniform_filter(luma**2, AROUND) - mean**2, 0))
    outlines = spread > JUMP
    thin = filled - ndimage.grey_opening(filled, (THIN, THIN)) > JUMP
    bent = np.hypot(ndimage.gaussian_filter(filled, 2, (0, 2)), ndimage.gaussian_filter(filled, 2, (2, 0))) > BENT
    rest = ~outlines & np.isfinite(true)
    return {
        "outlines": outlines, "textureless": deviation < EVEN, "thin": thin, "planes": rest & ~bent,
        "surfaces": rest & bent,
    }  # fmt: skip


def _share(which: Mask, counts: Mask) -> float:
    """Return the percentage of the counted pixels; NaN without any."""
    return float(100 * which[counts].mean()) if counts.any() else float("nan")
