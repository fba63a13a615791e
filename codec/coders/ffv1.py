"""FFV1 coder, by FFmpeg: lossless RGB with 8 and 16 bit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from ..colour import RGB8, RGB16, Format
from ..contract import Option, Options
from ..frames import Film
from .video import COMMON, Settings, Video


class Ffv1(Video):
    """Component images of one kind without loss; frames share statistics of the entropy coder, not pixels."""

    standard = "FFV1"
    encoder = "ffv1"
    decoder = "ffv1"
    framed = True
    min_coded_frame = 2
    dtypes = ("uint8", "uint16")
    rate_control = False
    options: ClassVar[Mapping[str, Option]] = {
        **COMMON,
        "context": Option(about="1 for the larger context model", default=0, low=0, high=1),
    }

    def lossless(self, options: Options) -> bool:
        """Return True."""
        return True

    def format(self, options: Options, dtype: str) -> Format:
        """Return RGB; colours are not converted."""
        return RGB8 if dtype == "uint8" else RGB16

    def constant(self, quantiser: float, film: Film, options: Options) -> Settings:
        """Return version 1 of the format for 8 bit, which has no slices and takes any size; 16 bit need version 3."""
        version = {"level": "1"} if film.format == RGB8 else {"level": "3", "slices": "1", "slicecrc": "0"}
        parameters = {"g": str(options["gop"] or (1 << 30)), "coder": "1", "context": str(options["context"])}
        return Settings(parameters=version | parameters)
