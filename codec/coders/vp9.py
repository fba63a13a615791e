"""VP9 by libvpx, in one pass: its notes for a second do not reach Python."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import ClassVar

from ..contract import Option, Options
from ..frames import Film
from ..rate import Run, nearest, nearest_quantiser, nearest_rate, straddling, within
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
    scale_about = "libvpx's constant quality; 0 is lossless but for colour"
    options: ClassVar[Mapping[str, Option]] = {
        **COMMON,
        "speed": Option(about="libvpx's cpu-used, 0 is the greatest effort", default=1, low=0, high=8),
        "chroma": chroma("444"),
    }

    presets: ClassVar[Mapping[str, Options]] = {"fast": {"speed": 4}, "balanced": {"speed": 1}, "best": {"speed": 0}}

    def constant(self, quantiser: float, film: Film, options: Options) -> Settings:
        """A constant quality."""
        return _settings(options, {"crf": f"{quantiser:g}", "b": "0", "lossless": str(int(quantiser == 0))})

    def meet(self, target: float, film: Film, options: Options, run: Callable[[Settings], Run]) -> tuple[Run, int]:
        """By the quality; its steps are coarse, so that the rest is done by a rate between two of them."""
        runs = nearest_quantiser(
            lambda quantiser: run(self.constant(quantiser, film, options)),
            target,
            low=0,
            high=63,
            step=1,
            octave=self.octave,
        )
        best, pair = nearest(runs.values(), target), straddling(runs, target)
        if within(len(best.payload), target) or pair is None:
            return best, len(runs)
        fine, coarse = pair

        def at_rate(size: float) -> Run:
            kilobits, frame_rate = fine_rate(size, film)
            bounds = {"qmin": f"{fine:g}", "qmax": f"{coarse:g}"}
            return run(_settings(options, bounds, frame_rate, 1000 * kilobits))

        better, more = nearest_rate(at_rate, target, coarsest=lambda: runs[coarse], finest=lambda: runs[fine])
        if within(len(better.payload), target):
            return better, len(runs) + more
        found, tried = self.between(runs, target, film, options, run)
        return nearest([better, found], target), tried + more

    def mixed(self, fine: float, coarse: float, frames: int, film: Film, options: Options) -> Settings:
        """Two sequences one after the other: there is one more I picture."""
        if not 0 < frames < film.frames:
            return self.constant(fine if frames else coarse, film, options)
        then = self.constant(coarse, film, options)
        return replace(self.constant(fine, film, options), frames=frames, then=then)


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
