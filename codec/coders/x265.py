"""HEVC coder, by x265."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from ..contract import Option, Options
from ..frames import Film
from ..search import CodingResult, Run, meet_rate
from .pseudo_video import DEPTH, Source
from .video import COMMON, MAX_KBIT, THREADS, Settings, Video, chroma, finer_rate, two_passes, with_zone
from .x264 import SPEEDS

FINEST, COARSEST = 0, 51
FRAME_RATE = 250  # x265 allows a few hundred


class Hevc(Video):
    """Component images of one kind as an HEVC pseudo video sequence."""

    standard = "HEVC"
    encoder = "libx265"
    decoder = "hevc"
    min_side = 16
    # x265 predicts pictures one block wide from uninitialised memory, and decoders then differ from it.
    min_width = 24
    min_coded_frame = 6
    min_frame_bytes = 10
    quantiser_step = 0.05
    qp_range = (FINEST, COARSEST)
    scale_about = "x265's constant rate factor, or a constant quantiser with rate=cq"
    options: ClassVar[Mapping[str, Option]] = {
        **COMMON,
        "bframes": Option(about="fixed number of B pictures between P pictures", default=4, low=0, high=16),
        "merange": Option(about="motion range in pixels", default=57, low=16, high=128),
        "rate": Option(
            about="rate control: constant rate factor, constant quantiser, two passes",
            default="crf",
            choices=("crf", "cq", "2pass"),
        ),
        "preset": Option(about="x265's preset, the effort", default="slow", choices=SPEEDS),
        "refs": Option(about="reference pictures, 0 for the preset's", default=0, low=0, high=8),  # x265 refuses 12
        "chroma": chroma("444"),
        "depth": DEPTH,
        "threads": THREADS,
    }

    presets: ClassVar[Mapping[str, Options]] = {
        "fast": {"preset": "medium"},
        "balanced": {"preset": "slow"},
        "best": {"preset": "slower", "merange": 128},
    }

    def step(self, options: Options) -> float:
        """Return 1 for a constant quantiser, which is a whole number."""
        return 1.0 if options["rate"] == "cq" else self.quantiser_step

    def constant(self, quantiser: float, film: Film, options: Options) -> Settings:
        """Return a constant rate factor, or quantiser."""
        return _settings(options, film, f"qp={round(quantiser)}" if options["rate"] == "cq" else f"crf={quantiser:g}")

    def mixed(
        self, fine: float, coarse: float, frames: int, film: Film, options: Options
    ) -> list[tuple[Film, Settings]]:
        """Return one sequence whose first frames are a zone with a quantiser of its own."""
        settings = self.constant(coarse, film, options)
        finer = f"q={round(fine)}" if options["rate"] == "cq" else finer_rate(fine, coarse)
        return [(film, with_zone(settings, "x265-params", frames, finer))]

    def meet(self, target: float, source: Source[Settings]) -> CodingResult:
        """Meet a target by the rate control of the options."""
        if source.options["rate"] != "2pass":
            return super().meet(target, source)

        def at_rate(size: float) -> Run:
            kilobits = max(1, round(min(8 * size / source.film.frames * FRAME_RATE / 1000, MAX_KBIT)))
            return two_passes(source, kilobits, lambda rate: _settings(source.options, source.film, rate, FRAME_RATE))

        return meet_rate(
            at_rate, target, coarsest=lambda: source.run_at(COARSEST), finest=lambda: source.run_at(FINEST)
        )


def _settings(options: Options, film: Film, rate: str, frame_rate: int = 25) -> Settings:
    block = max(size for size in (16, 32, 64) if size == 16 or (size < film.width and size <= film.height))
    # x265's coding unit tree writes beyond the end of rows unless they are a multiple of 8 blocks of 16×16.
    tree = options["rate"] != "cq" and -(-film.width // 16) % 8 == 0
    # One frame at a time and no pool of threads: the bytes are reproducible.
    pools = "none" if options["threads"] == 1 else options["threads"]
    parameters = [
        f"keyint={options['gop'] or -1}:min-keyint=1:scenecut=0:open-gop=0",
        f"bframes={options['bframes']}:b-adapt=0:rc-lookahead=40",
        f"merange={options['merange']}:ctu={block}",
        # Weighted prediction reads uninitialised memory: the bytes would differ from run to run.
        "weightp=0:weightb=0",
        f"psy-rd=0:psy-rdoq=0:aq-mode=0:cutree={int(tree)}:pools={pools}:wpp={int(pools != 'none')}:frame-threads=1",
        "info=0:log-level=none",
        *([f"ref={options['refs']}"] if options["refs"] else []),
        rate,
    ]
    return Settings(
        parameters={"preset": str(options["preset"]), "x265-params": ":".join(parameters)}, frame_rate=frame_rate
    )
