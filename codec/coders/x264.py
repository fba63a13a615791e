"""H.264 coder, by x264.

The default follows the dissertation: one I picture, then P pictures, no B pictures, motion range 16. Its constant bit
rate needs ``rate=cbr``: without it a target rate is met by the quantiser, which gives a better picture. Frames are
4:4:4 in full range. The default is one thread, since x264's bytes depend on the number of threads.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import ClassVar

import av

from ..contract import Option, Options
from ..frames import Film
from ..search import CodingResult, Run, meet_rate
from .pseudo_video import Source
from .video import COMMON, MAX_KBIT, THREADS, Settings, Video, chroma, fine_rate, finer_rate, two_passes, with_zone

COARSEST, LOSSLESS = 51, 0  # quantisers; 0 is lossless coding of YCbCr at 4:4:4 and 8 bit

# Constant bit rate: at the frame rate of `fine_rate` the sequence ends before x264's long-term control starts. Only
# the buffer limits the rate. x264 keeps it between 0.5 and 0.8 full; a buffer that starts in between ends about as
# full, so that the sequence has the target size.
BUFFER_FRAMES = 32
BUFFER_START = 0.65

START_CODE = re.compile(rb"\x00?\x00\x00\x01")
NAL_SEI = 6

SPEEDS = ("ultrafast", "superfast", "veryfast", "faster", "fast", "medium", "slow", "slower", "veryslow", "placebo")


class H264(Video):
    """Component images of one kind as an H.264 pseudo video sequence."""

    standard = "H.264"
    encoder = "libx264"
    decoder = "h264"
    # Start code of three bytes, header, one byte of data.
    min_coded_frame = 5
    # The smallest P frame of x264: start code, headers, one skipped macroblock.
    min_frame_bytes = 10
    quantiser_step = 0.05
    qp_range = (LOSSLESS, COARSEST)
    finest_lossless = True
    # Constant bit rate is 0.4–2.7 dB below the quantisers (25 views of 64×64 pixels of a Lytro flower, 2026-11-23).
    rated: ClassVar[Options] = {"rate": "cq"}
    scale_about = "quantiser: constant, or x264's constant rate factor with rate=crf; 0 is lossless but for colour"
    options: ClassVar[Mapping[str, Option]] = {
        **COMMON,
        "bframes": Option(about="fixed number of B pictures between P pictures", default=0, low=0, high=16),
        "merange": Option(about="motion range in pixels", default=16, low=16, high=128),
        "rate": Option(
            about="rate control: constant bit rate, constant quantiser, constant rate factor with macroblock tree, "
            "two passes",
            default="cbr",
            choices=("cbr", "cq", "crf", "2pass"),
        ),
        "pyramid": Option(about="whether B pictures predict B pictures", default=0, low=0, high=1),
        "pbratio": Option(about="quantiser step of B over that of P pictures", default=1.3, low=0.5, high=4.0),
        "preset": Option(about="x264's preset, the effort", default="medium", choices=SPEEDS),
        "refs": Option(about="reference pictures, 0 for the preset's", default=0, low=0, high=16),
        "chroma": chroma("444"),
        "depth": Option(about="bits of a sample inside the coder", default="8", choices=("8", "10")),
        "threads": THREADS,
    }

    presets: ClassVar[Mapping[str, Options]] = {
        "fast": {"bframes": 3, "pyramid": 1, "rate": "crf"},
        "balanced": {"bframes": 3, "pyramid": 1, "rate": "crf", "preset": "slow"},
        "best": {"bframes": 7, "pyramid": 1, "rate": "crf", "preset": "veryslow", "merange": 64, "depth": "10"},
    }

    def step(self, options: Options) -> float:
        """Return 1 for a constant quantiser, which is a whole number."""
        return 1.0 if options["rate"] == "cq" else self.quantiser_step

    def constant(self, quantiser: float, film: Film, options: Options) -> Settings:
        """Return a constant quantiser, or rate factor."""
        if options["rate"] == "crf":
            return _settings(options, film, f"crf={quantiser:g}")
        return _settings(options, film, f"qp={_qp(quantiser, options)}")

    def mixed(
        self, fine: float, coarse: float, frames: int, film: Film, options: Options
    ) -> list[tuple[Film, Settings]]:
        """Return one sequence whose first frames are a zone with a quantiser of its own."""
        settings = self.constant(coarse, film, options)
        finer = f"q={_qp(fine, options)}" if options["rate"] == "cq" else finer_rate(fine, coarse)
        return [(film, with_zone(settings, "x264-params", frames, finer))]

    def meet(self, target: float, source: Source[Settings]) -> CodingResult:
        """Meet a target by the rate control of the options."""
        film, options = source.film, source.options
        if options["rate"] in ("crf", "cq"):
            return super().meet(target, source)

        def at_rate(size: float) -> Run:
            if options["rate"] == "cbr":
                return source.run(_settings(options, film, *_constant_rate(size, film)))
            try:
                return _two_passes(size, source)
            except av.error.ExternalError:  # after the first pass x264 refuses a rate that is too low
                return source.run_at(COARSEST)

        return meet_rate(
            at_rate, target, coarsest=lambda: source.run_at(COARSEST), finest=lambda: source.run_at(LOSSLESS)
        )

    def trimmed(self, packet: bytes) -> bytes:
        """Return the packet without x264's SEI message: over 600 bytes of settings that no decoder needs."""
        return without_sei(packet)


def _settings(options: Options, film: Film, rate: str, frame_rate: int = 25) -> Settings:
    # x264's macroblock tree reads uninitialised memory unless rows are a multiple of 8 macroblocks.
    tree = options["rate"] == "crf" and -(-film.width // 16) % 8 == 0
    pyramid = "normal" if options["pyramid"] else "none"
    parameters = [
        f"keyint={options['gop'] or 'infinite'}:min-keyint=1:scenecut=0",
        f"bframes={options['bframes']}:b-adapt=0:b-pyramid={pyramid}:pbratio={options['pbratio']}",
        # The same search for every range: x264's default search stays within 16 pixels.
        f"me=umh:merange={options['merange']}:mvrange=512",
        f"weightp=0:psy=0:mbtree={int(tree)}",
        *(["rc-lookahead=250:aq-mode=0"] if options["rate"] == "crf" else []),
        *([f"ref={options['refs']}"] if options["refs"] else []),
        # Without a limit x264 exceeds the standard's coarsest quantiser to hold a rate, and drops residuals.
        f"qpmax={_qp(COARSEST, options)}",
        rate,
    ]
    return Settings(
        parameters={"preset": str(options["preset"]), "x264-params": ":".join(parameters)},
        frame_rate=frame_rate,
        threads=int(options["threads"]),
    )


def _qp(quantiser: float, options: Options) -> int:
    """Return x264's number of a quantiser: 12 more at 10 bit; 0 stays lossless."""
    return round(quantiser) + (12 if options["depth"] == "10" and quantiser > 0 else 0)


def _constant_rate(size: float, film: Film) -> tuple[str, int]:
    """Return x264's parameters and the frame rate for a sequence of ``size`` bytes."""
    rate, frame_rate = fine_rate(size, film)
    # At most half the sequence: a larger buffer does not limit the rate.
    frames = min(BUFFER_FRAMES, max(1.0, film.frames / 2))
    buffer = max(1, round(min(8 * size / film.frames * frames / 1000, MAX_KBIT)))
    return f"bitrate={rate}:vbv-maxrate={rate}:vbv-bufsize={buffer}:vbv-init={BUFFER_START}", frame_rate


def _two_passes(size: float, source: Source[Settings]) -> Run:
    kilobits, frame_rate = fine_rate(size, source.film)
    return two_passes(source, kilobits, lambda rate: _settings(source.options, source.film, rate, frame_rate))


def without_sei(packet: bytes) -> bytes:
    """Return an Annex B packet without supplemental enhancement information (SEI)."""
    starts = [match.start() for match in START_CODE.finditer(packet)]
    units = [packet[start:end] for start, end in zip(starts, [*starts[1:], len(packet)], strict=True)]
    return b"".join(unit for unit in units if START_CODE.sub(b"", unit, count=1)[0] & 31 != NAL_SEI)
