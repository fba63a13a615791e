"""H.264 by x264.

The default is the dissertation's structure: one I picture, then P pictures only, no B, motion range 16, constant bit
rate. Frames are 4:4:4 in full range; everything runs in the calling thread, since x264 makes another stream with
every number of threads.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import ClassVar

import av

from ..contract import Option, Options
from ..frames import Film
from ..rate import TOLERANCE, Run, nearest_rate
from .video import COMMON, MAX_KBIT, THREADS, Settings, Video, chroma, fine_rate

COARSEST, LOSSLESS = 51, 0  # quantisers; at 4:4:4 and 8 bit x264 takes 0 for lossless coding of YCbCr

# From here on lossless coding is tried first: where it takes what is asked, or less, quantisers from 1 up take more
# bytes for a worse picture, and rate control would choose among them.
NEARLY_LOSSLESS_BPP = 2.0

# Constant bit rate: at the frame rate of `fine_rate` the sequence is over before x264's long-term control wakes. The
# buffer alone rules, and frames count in it, not seconds. x264 keeps it between half and 0.8 full: started between
# them it ends about as full, and the sequence has the size asked for.
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
    # A three-byte start code, a header, one byte.
    min_coded_frame = 5
    # Start code, headers, one skipped macroblock: the smallest P frame x264 writes.
    min_frame_bytes = 10
    quantiser_step = 0.05
    qp_range = (LOSSLESS, COARSEST)
    scale_about = "quantiser: constant, or x264's constant rate factor with rate=crf; 0 is lossless but for colour"
    options: ClassVar[Mapping[str, Option]] = {
        **COMMON,
        "bframes": Option(about="B pictures between P pictures, always as many", default=0, low=0, high=16),
        "merange": Option(about="motion range in pixels", default=16, low=16, high=128),
        "rate": Option(
            about="how a rate is met: constant bit rate, constant quantiser, constant rate factor with macroblock "
            "tree, two passes",
            default="cbr",
            choices=("cbr", "cq", "crf", "2pass"),
        ),
        "pyramid": Option(about="whether B pictures predict B pictures", default=0, low=0, high=1),
        "pbratio": Option(about="quantiser step of B over that of P pictures", default=1.3, low=0.5, high=4.0),
        "preset": Option(about="x264's, the effort", default="medium", choices=SPEEDS),
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
        """A constant quantiser is a whole number."""
        return 1.0 if options["rate"] == "cq" else self.quantiser_step

    def constant(self, quantiser: float, film: Film, options: Options) -> Settings:
        """A constant quantiser, or rate factor."""
        if options["rate"] == "crf":
            return _settings(options, film, f"crf={quantiser:g}")
        return _settings(options, film, f"qp={_fixed(quantiser, options)}")

    def mixed(self, fine: float, coarse: float, frames: int, film: Film, options: Options) -> Settings:
        """By a zone of its own for the first frames."""
        settings = self.constant(coarse, film, options)
        finer = f"q={_fixed(fine, options)}" if options["rate"] == "cq" else f"b={2 ** ((coarse - fine) / 6):.4f}"
        parameters = settings.parameters["x264-params"] + f":zones=0,{max(0, frames - 1)},{finer}"
        return replace(settings, parameters={**settings.parameters, "x264-params": parameters})

    def meet(self, target: float, film: Film, options: Options, run: Callable[[Settings], Run]) -> tuple[Run, int]:
        """By the rate control asked for."""
        if options["rate"] in ("crf", "cq"):
            return super().meet(target, film, options, run)

        def at_rate(size: float) -> Run:
            if options["rate"] == "cbr":
                return run(_settings(options, film, *_constant_rate(size, film)))
            with tempfile.TemporaryDirectory() as folder:
                try:
                    return _two_passes(size, film, options, run, Path(folder) / "notes")
                except av.error.ExternalError:  # x264 knows after the first pass that the rate is too low for it
                    return run(self.constant(COARSEST, film, options))

        finest = cache(lambda: run(self.constant(LOSSLESS, film, options)))
        pixels = film.frames * film.layout.height * film.layout.width
        near = 8 * target >= NEARLY_LOSSLESS_BPP * pixels
        if near and len(finest().payload) <= (1 + TOLERANCE) * target:
            return finest(), 1
        coarsest = partial(run, self.constant(COARSEST, film, options))
        kept, runs = nearest_rate(at_rate, target, coarsest=coarsest, finest=finest)
        return kept, runs + near

    def trimmed(self, packet: bytes) -> bytes:
        """The packet without x264's message to the reader: over 600 bytes of settings that no decoder needs."""
        return without_sei(packet)


def _settings(options: Options, film: Film, rate: str, frame_rate: int = 25) -> Settings:
    # Its macroblock tree reads what nobody wrote where rows of macroblocks are not whole vectors.
    tree = options["rate"] == "crf" and -(-film.width // 16) % 8 == 0
    pyramid = "normal" if options["pyramid"] else "none"
    parameters = [
        f"keyint={options['gop'] or 'infinite'}:min-keyint=1:scenecut=0",
        f"bframes={options['bframes']}:b-adapt=0:b-pyramid={pyramid}:pbratio={options['pbratio']}",
        # One search for every range: x264's default search would not go beyond 16 whatever the range.
        f"me=umh:merange={options['merange']}:mvrange=512",
        f"weightp=0:psy=0:mbtree={int(tree)}",
        *(["rc-lookahead=250:aq-mode=0"] if options["rate"] == "crf" else []),
        # To hold a rate x264 would go beyond the standard's coarsest quantiser, and drop residuals altogether.
        f"qpmax={_fixed(COARSEST, options)}",
        rate,
    ]
    return Settings(
        parameters={"preset": str(options["preset"]), "x264-params": ":".join(parameters)},
        frame_rate=frame_rate,
        threads=int(options["threads"]),
    )


def _fixed(quantiser: float, options: Options) -> int:
    """x264's own number for it, which at 10 bit begins 12 further; 0 stays lossless."""
    return round(quantiser) + (12 if options["depth"] == "10" and quantiser > 0 else 0)


def _constant_rate(size: float, film: Film) -> tuple[str, int]:
    """x264's parameters and the frame rate that make a sequence of ``size`` bytes."""
    rate, frame_rate = fine_rate(size, film)
    # Half the sequence at most: a buffer that holds more binds nothing.
    frames = min(BUFFER_FRAMES, max(1.0, film.frames / 2))
    buffer = max(1, round(min(8 * size / film.frames * frames / 1000, MAX_KBIT)))
    return f"bitrate={rate}:vbv-maxrate={rate}:vbv-bufsize={buffer}:vbv-init={BUFFER_START}", frame_rate


def _two_passes(size: float, film: Film, options: Options, run: Callable[[Settings], Run], notes: Path) -> Run:
    kilobits, frame_rate = fine_rate(size, film)
    rate = f"bitrate={kilobits}:stats={notes}"
    first, second = (run(_settings(options, film, f"{rate}:pass={number}", frame_rate)) for number in (1, 2))
    return Run(second.payload, first.codec_seconds + second.codec_seconds)


def without_sei(packet: bytes) -> bytes:
    """The packet without supplemental messages."""
    starts = [match.start() for match in START_CODE.finditer(packet)]
    units = [packet[start:end] for start, end in zip(starts, [*starts[1:], len(packet)], strict=True)]
    return b"".join(unit for unit in units if START_CODE.sub(b"", unit, count=1)[0] & 31 != NAL_SEI)
