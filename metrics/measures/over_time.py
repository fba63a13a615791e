"""Quality of II-video over time: per frame, per angle, for a moving viewer, and flicker."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ii_core import IIVideo
from ii_core.base import checks

from .global_angle import angle_psnr, global_psnr, psnr
from .pair import PicturePair
from .view import view_quality

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class TakeQuality:
    """Quality of a decoded II-video, frame by frame.

    Attributes
    ----------
    fps : float
        Frames a second.
    q_global : ndarray, (T,)
        PSNR of each frame, dB.
    q_angle : ndarray, (T, V, U)
        PSNR of each sub-image of each frame, dB.
    flicker : ndarray, (T,)
        Mean of |e_τ − e_{τ−1}| over the pixels at which the original has not changed since the last frame, in 8-bit
        steps, where e is the coding error; NaN of the first frame, and where every pixel has changed.
    error_change : ndarray, (T,)
        The same over all pixels.
    view_ssim, view_psnr : ndarray, (T,), or None
        MSSIM and PSNR of the view image from the viewpoint of each frame; None without viewpoints.
    pooled_psnr : float
        PSNR of the squared errors pooled over all frames, dB.
    """

    fps: float
    q_global: Floats
    q_angle: Floats
    flicker: Floats
    error_change: Floats
    view_ssim: Floats | None = None
    view_psnr: Floats | None = None
    pooled_psnr: float = math.nan

    @property
    def mean_psnr(self) -> float:
        """Mean of the frames' PSNRs, dB; at least ``pooled_psnr``, by whole dB where quality varies over time."""
        return float(self.q_global.mean())

    @property
    def worst_psnr(self) -> float:
        """PSNR of the worst frame, dB."""
        return float(self.q_global.min())

    @property
    def mean_flicker(self) -> float:
        """Mean of ``flicker`` over the frames that have it; NaN if none has."""
        known = self.flicker[~np.isnan(self.flicker)]
        return float(known.mean()) if known.size else math.nan

    def to_json(self) -> dict[str, Any]:
        """All numbers; the rule of pooling is in the name."""
        view = {} if self.view_ssim is None or self.view_psnr is None else {
            "view_ssim": self.view_ssim.tolist(), "view_psnr": self.view_psnr.tolist()
        }  # fmt: skip
        return {
            "frames": len(self.q_global),
            "fps": self.fps,
            "psnr_of_pooled_mse": self.pooled_psnr,
            "psnr_mean_of_frames": self.mean_psnr,
            "psnr_worst_frame": self.worst_psnr,
            "flicker_mean_of_frames": self.mean_flicker,
            "q_global": self.q_global.tolist(),
            "q_angle": self.q_angle.tolist(),
            "flicker": self.flicker.tolist(),
            "error_change": self.error_change.tolist(),
            **view,
        }


@checks.checked(
    reference=checks.instance(IIVideo),
    decoded=checks.instance(IIVideo),
    viewpoints_mm=checks.numbers,
    progress=checks.callable_,
)
def measure_take(
    reference: IIVideo,
    decoded: IIVideo,
    *,
    viewpoints_mm: Sequence[ArrayLike] | Floats | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> TakeQuality:
    """Compare two II-videos frame by frame; two frames of each are in memory.

    Parameters
    ----------
    reference, decoded : IIVideo
        Of the same structure. The decoded one may be shorter, as before damage; then the first frames count.
    viewpoints_mm : (n, 3), optional
        A moving viewer: frame τ is seen from viewpoint τ, over and over if there are fewer. Needs a camera.
    progress : callable, optional
        Called with frames done and in all.

    Returns
    -------
    TakeQuality

    Raises
    ------
    TypeError, ValueError
        If structures differ, the decoded video is longer, or a viewpoint is none.
    """
    if decoded.frames > reference.frames:
        raise ValueError(f"decoded has {decoded.frames} frames, reference {reference.frames}: at most as many")
    shape = None if viewpoints_mm is None else np.asarray(viewpoints_mm).shape
    if shape is not None and (shape[1:] != (3,) or not shape[0]):
        raise ValueError(f"viewpoints_mm is {shape}: (n, 3) with at least one viewpoint is needed")
    count = decoded.frames
    rows: list[tuple[float, Floats, float, float]] = []
    views: list[tuple[float, float]] = []
    last: tuple[NDArray[Any], NDArray[Any]] | None = None
    squared, dtype = 0.0, np.dtype(np.uint8)
    for frame in range(count):
        pair = PicturePair(reference[frame], decoded[frame])
        a, b = pair.reference.pixels, pair.decoded.pixels
        error = b.astype(np.float32) - a
        squared, dtype = squared + float(np.square(error, dtype=np.float64).sum()), pair.dtype
        flicker = change = math.nan
        if last is not None:
            step, still = np.abs(error - last[1]).mean(axis=2) * (255 / pair.peak), (a == last[0]).all(axis=2)
            change = float(step.mean(dtype=np.float64))
            flicker = float(step[still].mean(dtype=np.float64)) if still.any() else math.nan
        last = a, error
        rows.append((global_psnr(pair), angle_psnr(pair).values, flicker, change))
        if viewpoints_mm is not None:
            seen = view_quality(pair, {"moving": viewpoints_mm[frame % len(viewpoints_mm)]})
            views.append((seen.mean, seen.pooled_psnr))
        if progress:
            progress(frame + 1, count)
    q_global, q_angle, flickers, changes = zip(*rows, strict=True)
    values = count * math.prod(reference.size) * 3
    more = {} if not views else {"view_ssim": np.array(views)[:, 0], "view_psnr": np.array(views)[:, 1]}
    return TakeQuality(
        fps=float(reference.fps),
        q_global=np.array(q_global),
        q_angle=np.array(q_angle),
        flicker=np.array(flickers),
        error_change=np.array(changes),
        pooled_psnr=float(psnr(squared, values, dtype)),
        **more,
    )
