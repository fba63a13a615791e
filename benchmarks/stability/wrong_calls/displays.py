"""Good calls of raw lenslet pictures, displays, eyes and viewers."""

from __future__ import annotations

import numpy as np

import ii_core
from ii_core import DisplayModel, Eye

from .good import CAMERA, DEPTH, PICTURE, Call


def display_calls() -> dict[str, Call]:
    """Return a good call of each function of raw pictures and of displays by name."""
    x, y = np.meshgrid(np.arange(126) + 0.5, np.arange(108) + 0.5)
    raw = (1000 * np.sin(x * np.pi / 9.3) ** 2 * np.sin(y * np.pi / 9.3) ** 2).astype(np.uint16)
    calibration = ii_core.calibrate(raw, white=raw)
    picture = ii_core.calibrated_picture(calibration, raw)
    display, eye = DisplayModel(camera=CAMERA), Eye(position_mm=(0.0, 0.0, -300.0))
    frames = {"raw": raw, "white": raw, "dark": np.zeros_like(raw), "mosaic": "rggb"}
    named = {
        "calibrate": (ii_core.calibrate, {**frames, "lattice": "rectangular", "pixel_pitch_mm": 0.01, "gap_mm": 0.2,
            "name": "a"}),
        "calibrated_picture": (ii_core.calibrated_picture, {**frames, "calibration": calibration, "curve": "linear",
            "full_scale": 250.0, "bits": 8}),
        "centres_picture": (ii_core.centres_picture, {"calibration": calibration, "picture": picture, "zoom": 2}),
        "DisplayModel": (DisplayModel, {"camera": CAMERA, "lens_pitch_mm": 0.4, "gap_mm": 1.5, "shift_mm": (0.0, 0.0),
            "turn_deg": 0.0, "layout": "square", "fill": 1.0, "lobe": 0.0, "brightness": 1.0, "black": 0.0,
            "crosstalk": 0.0}),
        "Eye": (Eye, {"position_mm": (0.0, 0.0, -300.0), "pupil_mm": 3.0, "focus_mm": 300.0}),
        "Eye.pair": (eye.pair, {"apart_mm": 63.0}),
        "eye_image": (ii_core.eye_image, {"picture": PICTURE, "display": display, "eye": eye, "size": (12, 12),
            "rays": 1}),
        "viewing_zone": (ii_core.viewing_zone, {"display": display, "distance_mm": 300.0}),
        "converging_distance": (ii_core.converging_distance, {"display": display}),
        "crosstalk": (ii_core.crosstalk, {"pupil_mm": 3.0, "border_mm": 1.0}),
        "embed_viewer": (ii_core.embed_viewer, {"picture": PICTURE, "decoded": PICTURE, "depth": DEPTH,
            "height": 600}),
    }  # fmt: skip
    return {name: Call(*call) for name, call in named.items()}
