"""Good values that calls of several packages share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from ii_core import IICamera, IIPicture, disparity_of_depth


class Call(NamedTuple):
    """A function, and good values of its arguments."""

    function: Callable[..., Any]
    good: Mapping[str, Any]


CAMERA = IICamera(pixels=(48, 48), lenses=(12, 12), pixel_pitch_mm=0.1, gap_mm=1.5)
PIXELS = np.random.default_rng(0).integers(0, 256, (48, 48, 3), np.uint8)
PICTURE = IIPicture(PIXELS, (12, 12), (4, 4), CAMERA)
DEPTH = np.full((48, 48), 15.0)
MASK = np.ones((48, 48), bool)
LOW, HIGH = sorted(map(float, disparity_of_depth(CAMERA, [10.0, 100.0])))
FRONT = (0.0, 0.0, -150.0)
CURVE = [1.0, 2.0, 3.0, 4.0]
BLOCK = {"rows": slice(0, 2), "cols": slice(0, 2)}
SAMPLE = {"sample": (0.5, 0.5), "place": (0.5, 0.5)}
PAIR = {"reference": PICTURE, "decoded": PICTURE}
