"""VP9 coder, by libvpx in one pass; PyAV does not expose first-pass statistics."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from ..contract import Option, Options
from ..frames import Film
from ..search import CodingResult, Run, meet_rate, nearest, within
from .pseudo_video import Source
from .video import COMMON, Settings, Video, chroma, fine_rate


class Vp9(Video):
    """Component images of one kind as a VP9 pseudo video sequence."""

    standard = "VP9"
    encoder = "libvpx-vp9"
    decoder = "vp9"
    framed = True
    min_coded_frame = 2
    octave = 9.0
    qp_range = (0, 63)
    finest_lossless = True
    scale_about = "libvpx's constant quality; 0 is lossless but for colour"
    options: ClassVar[Mapping[str, Option]] = {
        **COMMON,
        "speed": Option(about="libvpx's cpu-used, 0 is the greatest effort", default=1, low=0, high=8),
        "chroma": chroma("444"),
    }

    presets: ClassVar[Mapping[str, Options]] = {"fast": {"speed": 4}, "balanced": {"speed": 1}, "best": {"speed": 0}}

    def constant(self, quantiser: float, film: Film, options: Options) -> Settings:
        """Return a constant quality."""
        return _settings(options, {"crf": f"{quantiser:g}", "b": "0", "lossless": str(int(quantiser == 0))})

    def meet(self, target: float, source: Source[Settings]) -> CodingResult:
        """Meet a target by the quality; then by rate control between two qualities; then by two sequences."""
        tried = self.quantisers(target, source)
        pair = self.pair(tried, source)
        if pair is None:
            return CodingResult(run=nearest(tried).result, runs=len(tried))
        coarse, fine = pair

        def at_rate(size: float) -> Run:
            kilobits, frame_rate = fine_rate(size, source.film)
            bounds = {"qmin": f"{fine.setting:g}", "qmax": f"{coarse.setting:g}"}
            return source.run(_settings(source.options, bounds, frame_rate, 1000 * kilobits))

        rated = meet_rate(at_rate, target, coarsest=lambda: coarse.result, finest=lambda: fine.result)
        if within(len(rated.run.payload), target) and source.on_curve(rated.run, coarse.result, fine.result):
            return CodingResult(run=rated.run, runs=len(tried) + rated.runs)
        mixed = self.mixes(coarse, fine, target, source)
        run = self.kept(tried, [rated.run, *mixed], target, source)
        return CodingResult(run=run, runs=len(tried) + rated.runs + len(mixed))

    def mixed(
        self, fine: float, coarse: float, frames: int, film: Film, options: Options
    ) -> list[tuple[Film, Settings]]:
        """Return two sequences one after the other."""
        return self.two_sequences(fine, coarse, frames, film, options)


def _settings(
    options: Options, rate: Mapping[str, str], frame_rate: int = 25, bit_rate: int | None = None
) -> Settings:
    parameters = {
        "g": str(options["gop"] or 1 << 30),
        "cpu-used": str(options["speed"]),
        "deadline": "good",
        "lag-in-frames": "25",
        "row-mt": "0",
        **rate,
    }
    return Settings(parameters=parameters, frame_rate=frame_rate, bit_rate=bit_rate)
