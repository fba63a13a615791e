"""Third-party measures of views, for comparison with Q_view: multi-scale SSIM, FLIP, and consistency over angle.

Multi-scale SSIM and FLIP are computed by sewar and flip-evaluator, which only this comparison needs: ``pip install
sewar flip-evaluator``. Without them their values are missing.

References
----------
Wang, Simoncelli and Bovik 2003: multi-scale SSIM. Andersson et al. 2020: FLIP.
"""

from __future__ import annotations

import importlib
import math
import warnings
from collections.abc import Callable
from functools import partial
from importlib.metadata import version
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core import IIPicture, five_viewpoints, view_image
from ii_core.picture.view import camera_of

CANDIDATES = ("ms_ssim", "flip", "epi_psnr")
PEERS = {"ms_ssim": ("sewar", "sewar"), "flip": ("flip_evaluator", "flip-evaluator")}
WEIGHTS = (0.0448, 0.2856, 0.3001, 0.2363, 0.1333)  # of the scales, from fine to coarse
WINDOW = 11  # pixels across SSIM's window, which the coarsest scale must hold

Views = list[NDArray[np.uint8]]


def available() -> dict[str, str]:
    """Return the versions of the peers that are installed, by the name of their measure."""
    return {name: version(package) for name, (module, package) in PEERS.items() if find_spec(module)}


def candidates(reference: IIPicture) -> Callable[[IIPicture], dict[str, float]]:
    """Return a function that measures all available candidates of a decoded picture."""
    places = list(five_viewpoints(camera_of(reference)).values())
    seen, there = partial(_views, places=places), available()
    first = seen(reference)

    def measure(decoded: IIPicture) -> dict[str, float]:
        second = seen(decoded)
        found = {"epi_psnr": epi_psnr(reference, decoded)}
        if "ms_ssim" in there:
            found["ms_ssim"] = float(np.mean([ms_ssim(a, b) for a, b in zip(first, second, strict=True)]))
        if "flip" in there:  # FLIP is a difference: its negative rises with quality
            found["flip"] = -float(np.mean([flip(a, b) for a, b in zip(first, second, strict=True)]))
        return found

    return measure


def _views(picture: IIPicture, places: list[Any]) -> Views:
    return [view_image(picture, place)[0] for place in places]


def ms_ssim(a: NDArray[Any], b: NDArray[Any]) -> float:
    """Multi-scale SSIM over as many scales as the view holds, at most five; their weights sum to 1."""
    scales = min(len(WEIGHTS), 1 + int(math.log2(min(a.shape[:2]) / WINDOW)))
    weights = np.array(WEIGHTS[:scales])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        value = importlib.import_module("sewar").msssim(a, b, weights=list(weights / weights.sum()))
    return float(np.real(value))


def flip(a: NDArray[Any], b: NDArray[Any]) -> float:
    """Mean FLIP of two views, at its default of 67 pixels a degree."""
    first, second = (np.ascontiguousarray(image, np.float32) / 255 for image in (a, b))
    return float(importlib.import_module("flip_evaluator").evaluate(first, second, "LDR", applyMagma=False)[1])


def epi_psnr(reference: IIPicture, decoded: IIPicture) -> float:
    """Consistency over angle, dB: PSNR of the change of the error from each sub-image to the next.

    An error that is equal in all views does not change when the viewer moves; an error that changes along the lines
    of epipolar images flickers.
    """
    (k, l), (u, v) = reference.lenses, reference.ei_pixels
    error = (decoded.pixels.astype(np.int32) - reference.pixels).reshape(l, v, k, u, 3)
    across, down = np.diff(error, axis=3), np.diff(error, axis=1)
    squared = float(np.square(across).sum() + np.square(down).sum()) / (across.size + down.size)
    return 10 * math.log10(255**2 / squared) if squared else math.inf
