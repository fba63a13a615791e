"""AV1 coder at 4:4:4, by libaom through imagecodecs: an AVIF image sequence without its boxes.

imagecodecs takes RGB and converts it to YCbCr. With an identity matrix it does not convert: our Y, Cb and Cr stand in
the places of G, B and R. The payload is the AV1 stream alone.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ii_core.base.extras import Lazy

from ..clock import cpu_seconds
from ..colour import Format
from ..contract import Option, Options
from ..frames import Film
from .pseudo_video import DEPTH, ORDER, Packets, PseudoVideo

imagecodecs = Lazy("imagecodecs")

# The temporal delimiter at the start of every frame. AVIF omits it, but libaom's sequences contain it.
DELIMITER = b"\x12\x00"
IDENTITY = 0


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of libavif: quality from 0 to 100, and libaom's speed."""

    level: int
    speed: int


class Avif(PseudoVideo[Settings]):
    """Component images of one kind as an AV1 pseudo video sequence in 4:4:4."""

    standard = "AV1"
    encoder = "libaom"
    decoder = "libdav1d"
    min_side = 16
    max_side = 16384
    min_coded_frame = 4
    min_frame_bytes = 4
    octave = 9.0
    qp_range = (0, 63)
    finest_lossless = True
    scale_about = "libaom's quantiser; 0 is lossless but for colour"
    # The stream names an identity matrix; its G, B and R are Y, Cb and Cr of BT.709.
    relabel = "av1_metadata=color_primaries=1:transfer_characteristics=13:matrix_coefficients=1:color_range=pc"
    options: ClassVar[Mapping[str, Option]] = {
        **ORDER,
        "speed": Option(about="libaom's cpu-used, 0 is the greatest effort", default=6, low=0, high=9),
        "depth": Option(about=DEPTH.about, default="8", choices=("8", "10")),
    }
    presets: ClassVar[Mapping[str, Options]] = {"fast": {"speed": 8}, "balanced": {"speed": 6}, "best": {"speed": 4}}

    @property
    def versions(self) -> dict[str, str]:
        """Return the versions of imagecodecs, of its libavif, and of PyAV, which decodes."""
        return {"imagecodecs": imagecodecs.__version__, "libavif": imagecodecs.avif_version().split()[-1]} | (
            super().versions
        )

    def format(self, options: Options, dtype: str) -> Format:
        """Return 4:4:4; an identity matrix makes FFmpeg call the planes G, B and R."""
        depth = int(options["depth"])
        return Format(name="gbrp" if depth == 8 else "gbrp10le", chroma="444", depth=depth)

    def constant(self, quantiser: float, film: Film, options: Options) -> Settings:
        """Return one quantiser for all frames."""
        return Settings(level=100 - round(quantiser * 100 / 63), speed=int(options["speed"]))

    def mixed(
        self, fine: float, coarse: float, frames: int, film: Film, options: Options
    ) -> list[tuple[Film, Settings]]:
        """Return two sequences one after the other."""
        return self.two_sequences(fine, coarse, frames, film, options)

    def run_encoder(self, pixels: NDArray[Any], film: Film, settings: Settings) -> Packets:
        """Code the frames of a film once; libavif needs all of them in memory."""
        frames = _frames(pixels, film)
        started = cpu_seconds()
        boxes = imagecodecs.avif_encode(
            frames,
            settings.level,
            speed=settings.speed,
            bitspersample=film.format.depth,
            pixelformat="yuv444",
            codec="aom",
            matrix=IDENTITY,
            numthreads=1,
        )
        packets = [DELIMITER + sample.removeprefix(DELIMITER) for sample in samples(bytes(boxes))]
        return Packets(packets=packets, seconds=cpu_seconds() - started)


def _frames(pixels: NDArray[Any], film: Film) -> NDArray[Any]:
    """Return frames (J, height, width, 3) with Cr, Y and Cb in the places of R, G and B."""
    frames = np.empty((film.frames, film.height, film.width, 3), film.format.dtype)
    planes, done = film.batch(), 0
    for count in film.gathered(pixels, planes):
        for colour, plane in zip((1, 2, 0), planes, strict=True):
            frames[done : done + count, :, :, colour] = plane[:count]
        done += count
    return frames


def samples(boxes: bytes) -> list[bytes]:
    """Return the coded frames of an AVIF file, one image or a sequence (ISO/IEC 14496-12: stsz and stco, or iloc)."""
    data = boxes.index(b"mdat") + 4
    if (at := boxes.find(b"stsz")) < 0:  # a single image fills the data box
        return [boxes[data:]]
    size, count = struct.unpack_from(">4xII", boxes, at + 4)
    sizes = [size] * count if size else list(struct.unpack_from(f">{count}I", boxes, at + 16))
    found = []
    for length in sizes:
        found.append(boxes[data : data + length])
        data += length
    return found
