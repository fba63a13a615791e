"""Anchors of the benchmark: coders as their users have them, through FFmpeg of the package imageio-ffmpeg.

Settings are those of the least error that each program has, without any tuning to perception.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

Order = Callable[[int, int], list[tuple[int, int]]]


def serpentine(rows: int, columns: int) -> list[tuple[int, int]]:
    """Return (row, column) of views: even rows from the left, odd ones from the right."""
    return [
        (row, column if row % 2 == 0 else columns - 1 - column) for row in range(rows) for column in range(columns)
    ]


def hierarchy(rows: int, columns: int) -> list[tuple[int, int]]:
    """Return (row, column) of views level by level: a coarse grid first, each further level halves its step."""
    places = serpentine(rows, columns)
    return sorted(places, key=lambda place: level_of(place, rows, columns))  # stable: serpentine inside a level


def level_of(place: tuple[int, int], rows: int, columns: int) -> int:
    """Return the level of a view in the hierarchy, 0 for the coarsest grid."""
    top = max(rows, columns, 2).bit_length() - 1
    both = [(number & -number).bit_length() - 1 if number else top for number in place]
    return top - min(top, *both)


@dataclass(frozen=True, kw_only=True)
class Anchor:
    """Coder of FFmpeg with settings for the least error.

    Parameters
    ----------
    about : str
    encoder : str
        Arguments of the encoder; ``{q}`` is the quantiser, ``{zones}`` that of each level of the hierarchy.
    muxer : str
        Format of the bare stream.
    pixels : str
        Pixel format: ``yuv420p10le``, ``yuv444p10le`` or ``rgb48le``.
    finest, coarsest, step : float
        Range of the quantiser and its finest step.
    order : callable
        Order of the views as frames.
    mosaic : bool
        Whether all views form one still picture.
    """

    about: str
    encoder: str
    muxer: str
    pixels: str
    finest: float
    coarsest: float
    step: float = 1.0
    order: Order = serpentine
    mosaic: bool = False

    def command(self, size: tuple[int, int], quantiser: float, zones: str = "") -> list[str]:
        """Return the encoder's arguments, without the program."""
        source = ["-f", "rawvideo", "-pix_fmt", self.pixels, "-s", f"{size[0]}x{size[1]}", "-r", "25", "-i", "-"]
        words = self.encoder.replace("{q}", f"{quantiser:g}").replace("{zones}", zones).split()
        return [*source, *words, "-f", self.muxer, "-"]

    def quantiser(self, index: int) -> float:
        """Return a quantiser of the scale, 0 for the coarsest."""
        return self.coarsest - index * self.step


X265 = (
    "-c:v libx265 -preset veryslow {rate} -x265-params keyint=-1:scenecut=0:open-gop=0:aq-mode=0:psy-rd=0:psy-rdoq=0:"
    "merange=92:pools=none:frame-threads=1:log-level=none:info=0"
)
AOM = (
    "-c:v libaom-av1 -cpu-used 0 -usage good -crf {q} -b:v 0 -tune psnr -aq-mode 0 -g 9999 -lag-in-frames 48 "
    "-row-mt 0 -threads 1"
)
ANCHORS = {
    "vvenc": Anchor(
        about="VVC by VVenC, preset slower, hierarchical B pictures along the serpentine, 4:2:0",
        encoder="-c:v libvvenc -preset slower -qp {q} -qpa 0 -period 1000000 -threads 1",
        muxer="vvc", pixels="yuv420p10le", finest=0, coarsest=63,
    ),
    "x265": Anchor(
        about="HEVC by x265, preset veryslow, 4:4:4",
        encoder=X265.replace("{rate}", "-crf {q}"),
        muxer="hevc", pixels="yuv444p10le", finest=0, coarsest=51, step=0.25,
    ),
    "x265-420": Anchor(
        about="HEVC by x265, preset veryslow, 4:2:0",
        encoder=X265.replace("{rate}", "-crf {q}"),
        muxer="hevc", pixels="yuv420p10le", finest=0, coarsest=51, step=0.25,
    ),
    "x265-2d": Anchor(
        about="HEVC by x265, preset veryslow, 4:4:4, views in two-dimensional hierarchical order, P pictures",
        encoder=X265.replace("{rate}", "-qp {q}") + ":bframes=0:ref=8{zones}",
        muxer="hevc", pixels="yuv444p10le", finest=0, coarsest=51, order=hierarchy,
    ),
    "x264": Anchor(
        about="H.264 by x264, preset placebo, 16 B pictures, 4:4:4",
        encoder="-c:v libx264 -preset placebo -tune psnr -x264-params crf={q}:keyint=infinite:scenecut=0:ref=16:"
        "bframes=16:b-adapt=2:b-pyramid=normal:rc-lookahead=250:threads=1 -bsf:v filter_units=remove_types=6",
        muxer="h264", pixels="yuv444p10le", finest=-12, coarsest=51, step=0.25,
    ),
    "libaom": Anchor(
        about="AV1 by libaom, speed 0, 4:4:4",
        encoder=AOM, muxer="obu", pixels="yuv444p10le", finest=0, coarsest=63,
    ),
    "libaom-chroma": Anchor(
        about="AV1 by libaom, speed 0, 4:4:4, chroma quantised by an offset of its own",
        encoder=AOM + " -aom-params enable-chroma-deltaq=1",
        muxer="obu", pixels="yuv444p10le", finest=0, coarsest=63,
    ),
    "svtav1": Anchor(
        about="AV1 by SVT-AV1, preset 0, 4:2:0",
        encoder="-c:v libsvtav1 -preset 0 -crf {q} -svtav1-params keyint=-1:lp=1:scd=0:tune=1",
        muxer="obu", pixels="yuv420p10le", finest=1, coarsest=63,
    ),
    "jpegxl": Anchor(
        about="JPEG XL by libjxl, effort 9, all views as one still picture",
        encoder="-c:v libjxl -effort 9 -distance {q}",
        muxer="image2pipe", pixels="rgb48le", finest=0.1, coarsest=15.0, step=0.05, mosaic=True,
    ),
}  # fmt: skip
