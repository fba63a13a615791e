"""JPEG 2000 Part 1 coder of the whole II-picture: the anchor of comparisons."""

from __future__ import annotations

import io
import math
import time
from functools import partial
from typing import ClassVar

import numpy as np
import PIL
from numpy.typing import NDArray
from PIL import Image, features
from PIL.Jpeg2KImagePlugin import Jpeg2KImageFile

from ii_core import IIPicture

from ..bitstream.jpeg2000 import check_picture_stream
from ..contract import Coder, Goal, Options
from ..search import CodingResult, Run, meet_rate

LEVELS = 5
RAW_BPP = 24
LOSSLESS = 0.0  # OpenJPEG's compression ratio for lossless coding
COARSEST = 1e9


class Jpeg2000(Coder):
    """CDF 5/3, five levels, one tile, one layer, reversible colour transform, by OpenJPEG through Pillow.

    The payload is the raw codestream. 8 bit only, since Pillow has no RGB of 16 bit.

    References
    ----------
    Olsson 2008, §5.7.
    """

    name = "jpeg2000"
    about = "The II-picture itself, JPEG 2000 (CDF 5/3, 5 levels, one tile) by OpenJPEG"
    dtypes: ClassVar[tuple[str, ...]] = ("uint8",)

    @property
    def versions(self) -> dict[str, str]:
        """Return the versions of Pillow and its OpenJPEG."""
        return {"pillow": PIL.__version__, "openjpeg": str(features.version("jpg_2000"))}

    def check(self, picture: IIPicture, options: Options) -> None:
        """Accept any size."""

    def encode(self, picture: IIPicture, options: Options, goal: Goal) -> CodingResult:
        """Meet a rate; a rate above that of lossless coding gives the lossless picture."""
        assert goal.bpp is not None
        width, height = picture.size
        raw_bytes = width * height * RAW_BPP / 8
        at_ratio = partial(_encode, picture.pixels)
        return meet_rate(
            lambda size: at_ratio(min(raw_bytes / size, COARSEST)),
            width * height * goal.bpp / 8,
            coarsest=lambda: at_ratio(COARSEST),
            finest=lambda: at_ratio(LOSSLESS),
        )

    def decode(self, payload: bytes, blank: IIPicture, options: Options) -> tuple[NDArray[np.uint8], float]:
        """Decode; a stream of another size is refused before it takes memory."""
        started = time.thread_time()
        try:
            # Not `Image.open`, which refuses large pictures by a limit that is global to the process.
            with Jpeg2KImageFile(io.BytesIO(payload)) as image:
                if image.size != blank.size or image.mode != "RGB":
                    raise ValueError(f"its JPEG 2000 stream is {image.size} {image.mode}, {blank.size} RGB is needed")
                check_picture_stream(payload, blank.size, _levels(blank.size))
                pixels = np.array(image)
        except (OSError, SyntaxError) as error:
            raise ValueError(f"its JPEG 2000 stream does not decode ({error})") from None
        return pixels, time.thread_time() - started


def _levels(size: tuple[int, int]) -> int:
    """Return the wavelet levels: OpenJPEG does not halve a side of one pixel."""
    return min(LEVELS, int(math.log2(min(size))))


def _encode(pixels: NDArray[np.uint8], ratio: float) -> Run:
    """Run the encoder at a compression ratio against 24 bits per pixel."""
    image = Image.fromarray(pixels)
    started = time.thread_time()
    out = io.BytesIO()
    image.save(
        out,
        "JPEG2000",
        no_jp2=True,
        quality_mode="rates",
        quality_layers=[ratio],
        num_resolutions=_levels(image.size) + 1,
        irreversible=False,
        mct=1,
    )
    return Run(out.getvalue(), time.thread_time() - started)
