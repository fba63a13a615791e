"""AV1 coder, by SVT-AV1; 4:2:0 only."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import ClassVar

from ..contract import Option, Options
from ..frames import Film
from .pseudo_video import DEPTH
from .video import COMMON, Settings, Video

# Errors only: by default it prints its settings to the error stream at every start.
os.environ.setdefault("SVT_LOG", "1")


class Av1(Video):
    """Component images of one kind as an AV1 pseudo video sequence."""

    standard = "AV1"
    encoder = "libsvtav1"
    decoder = "libdav1d"
    # SVT-AV1 accepts sides of 4, but its output buffer overflows on noise of that size.
    min_side = 8
    max_side = 8192
    min_coded_frame = 4
    min_frame_bytes = 5
    quantiser_step = 0.25
    octave = 9.0
    qp_range = (1, 63)
    scale_about = "SVT-AV1's constant rate factor, or a constant quantiser with rate=cq"
    options: ClassVar[Mapping[str, Option]] = {
        **COMMON,
        "rate": Option(
            about="constant rate factor, with finer pictures where others are predicted from them, or constant "
            "quantiser in each level of the hierarchy",
            default="crf",
            choices=("crf", "cq"),
        ),
        # Presets from 8 on: decoded small frames of noise have errors above 100 codes at the finest rate factor.
        "preset": Option(about="SVT-AV1's preset, 0 is the greatest effort", default=4, low=0, high=7),
        "depth": DEPTH,
        "threads": Option(about="levels of parallelism; the bytes do not depend on it", default=1, low=1, high=6),
    }

    presets: ClassVar[Mapping[str, Options]] = {
        "fast": {"preset": 7},
        "balanced": {"preset": 4},
        "best": {"preset": 2},
    }

    def constant(self, quantiser: float, film: Film, options: Options) -> Settings:
        """Return a constant rate factor, or quantiser."""
        parameters = [
            f"crf={quantiser:g}:keyint={options['gop'] or -1}:lp={options['threads']}:scd=0",
            *(["aq-mode=0"] if options["rate"] == "cq" else []),
        ]
        return Settings(parameters={"preset": str(options["preset"]), "svtav1-params": ":".join(parameters)})
