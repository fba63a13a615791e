"""AV1 by libaom, which takes 4:4:4: through imagecodecs, as an image sequence (AVIF) whose box is taken off.

imagecodecs wants RGB and converts it by itself. Told that the matrix is the identity it leaves alone what it is
given, which is our YCbCr in the places of G, B and R. The payload is the bare AV1 stream.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Any, ClassVar

import imagecodecs
import numpy as np
from numpy.typing import NDArray

from ii_core import IIPicture

from ..colour import Format
from ..contract import Coding, Goal, Option, Options
from ..frames import Film
from ..rate import Run
from .clock import cpu_seconds
from .video import COMMON, DEPTH, Settings, Video

# The temporal delimiter that every frame begins with. A box leaves it out; libaom's sequences have it all the same.
DELIMITER = b"\x12\x00"
IDENTITY = 0
MOST = 1e300  # bytes: what is asked may overflow


class Avif(Video):
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
    scale_about = "libaom's quantiser; 0 is lossless but for colour"
    # The stream says identity matrix, and its G, B and R are Y, Cb and Cr of BT.709.
    relabel = "av1_metadata=color_primaries=1:transfer_characteristics=13:matrix_coefficients=1:color_range=pc"
    options: ClassVar[Mapping[str, Option]] = {
        "order": COMMON["order"],
        "by": COMMON["by"],
        "speed": Option(about="libaom's cpu-used, 0 is the greatest effort", default=6, low=0, high=9),
        "depth": Option(about=DEPTH.about, default="8", choices=("8", "10")),
    }
    presets: ClassVar[Mapping[str, Options]] = {"fast": {"speed": 8}, "balanced": {"speed": 6}, "best": {"speed": 4}}

    @property
    def versions(self) -> dict[str, str]:
        """imagecodecs, its libavif, and PyAV, which decodes."""
        return {"imagecodecs": imagecodecs.__version__, "libavif": imagecodecs.avif_version().split()[-1]} | (
            super().versions
        )

    def format(self, options: Options, dtype: str) -> Format:
        """4:4:4, under the name of what an identity matrix makes of the planes."""
        depth = int(options["depth"])
        return Format(name="gbrp" if depth == 8 else "gbrp10le", chroma="444", depth=depth)

    def constant(self, quantiser: float, film: Film, options: Options) -> Settings:
        """One quantiser for all frames."""
        level = str(100 - round(quantiser * 100 / 63))
        speed = str(options["speed"])
        return Settings(parameters={"first": level, "then": level, "frames": "0", "speed": speed})

    def mixed(self, fine: float, coarse: float, frames: int, film: Film, options: Options) -> Settings | None:
        """Two sequences one after the other: there is one more I picture."""
        if not 0 < frames < film.frames:
            return self.constant(fine if frames else coarse, film, options)
        first, then = (self.constant(quantiser, film, options).parameters["then"] for quantiser in (fine, coarse))
        return Settings(
            parameters={"first": first, "then": then, "frames": str(frames), "speed": str(options["speed"])}
        )

    def encode(self, picture: IIPicture, options: Options, goal: Goal) -> Coding:
        """All frames lie in memory once, for libavif takes no fewer."""
        film = self.film(picture, options)
        frames = _frames(np.ascontiguousarray(picture.pixels), film)

        def run(settings: Settings) -> Run:
            return _encoded(frames, film, settings)

        if goal.bpp is None:
            return Coding(run=run(self.constant(goal.qp or 0, film, options)))
        target = min(goal.bpp * picture.size[0] * picture.size[1] / 8, MOST)
        found, runs = self.meet(target, film, options, run)
        return Coding(run=found, runs=runs)


def _frames(pixels: NDArray[Any], film: Film) -> NDArray[Any]:
    """(J, height, width, 3) with Cr, Y and Cb where imagecodecs takes R, G and B."""
    frames = np.empty((film.frames, film.height, film.width, 3), film.format.dtype)
    planes, done = film.batch(), 0
    for count in film.gathered(pixels, planes):
        for colour, plane in zip((1, 2, 0), planes, strict=True):
            frames[done : done + count, :, :, colour] = plane[:count]
        done += count
    return frames


def _encoded(frames: NDArray[Any], film: Film, settings: Settings) -> Run:
    started = cpu_seconds()
    cut = int(settings.parameters["frames"])
    stream = b""
    for some, level in ((frames[:cut], settings.parameters["first"]), (frames[cut:], settings.parameters["then"])):
        if len(some):
            boxes = imagecodecs.avif_encode(
                some,
                int(level),
                speed=int(settings.parameters["speed"]),
                bitspersample=film.format.depth,
                pixelformat="yuv444",
                codec="aom",
                matrix=IDENTITY,
                numthreads=1,
            )
            stream += b"".join(DELIMITER + sample.removeprefix(DELIMITER) for sample in samples(bytes(boxes)))
    return Run(stream, cpu_seconds() - started)


def samples(boxes: bytes) -> list[bytes]:
    """The coded frames of an AVIF file, one image or a sequence (ISO/IEC 14496-12: stsz and stco, or iloc)."""
    data = boxes.index(b"mdat") + 4
    if (at := boxes.find(b"stsz")) < 0:  # a single image: nothing else is in the data
        return [boxes[data:]]
    size, count = struct.unpack_from(">4xII", boxes, at + 4)
    sizes = [size] * count if size else list(struct.unpack_from(f">{count}I", boxes, at + 16))
    found = []
    for length in sizes:
        found.append(boxes[data : data + length])
        data += length
    return found
