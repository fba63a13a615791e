"""MPEG-2 coder, by FFmpeg, as in the first coders of integral images (Yeom et al. 2004)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from ..contract import Option, Options
from ..frames import Film
from ..search import CodingResult, Run, meet_rate, nearest
from .pseudo_video import Source
from .video import COMMON, Settings, Video

FINEST, COARSEST = 1, 31
FRAME_RATE = 25  # the standard allows a few rates
MAX_BIT_RATE = 1 << 30
RERUNS = 6  # FFmpeg's rate control converges slowly on few frames


class Mpeg2(Video):
    """Component images of one kind as an MPEG-2 pseudo video sequence, 4:2:0."""

    standard = "MPEG-2"
    encoder = "mpeg2video"
    decoder = "mpeg2video"
    min_side = 16
    max_side = 4095
    min_coded_frame = 8
    min_frame_bytes = 12
    qp_range = (FINEST, COARSEST)
    scale_about = "constant quantiser"
    options: ClassVar[Mapping[str, Option]] = {
        **COMMON,
        "gop": Option(
            about="frames from I picture to I picture, 0 for as many as FFmpeg allows", default=0, low=0, high=600
        ),
        "bframes": Option(about="B pictures between P pictures", default=2, low=0, high=3),
    }

    def constant(self, quantiser: float, film: Film, options: Options) -> Settings:
        """Return settings with one quantiser in every macroblock."""
        scale = f"{quantiser:g}"
        return _settings(options, {"qmin": scale, "qmax": scale, "mbqmin": scale})

    def meet(self, target: float, source: Source[Settings]) -> CodingResult:
        """Meet a target by the quantiser; then by FFmpeg's rate control between two quantisers."""
        tried = self.quantisers(target, source)
        pair = self.pair(tried, source)
        if pair is None:
            return CodingResult(run=nearest(tried).result, runs=len(tried))
        coarse, fine = pair

        def at_rate(size: float) -> Run:
            bits = round(min(max(8 * size / source.film.frames * FRAME_RATE, 1), MAX_BIT_RATE))
            bounds = {"qmin": f"{fine.setting:g}", "qmax": f"{coarse.setting:g}"}
            return source.run(_settings(source.options, bounds, bits))

        rated = meet_rate(at_rate, target, coarsest=lambda: coarse.result, finest=lambda: fine.result, reruns=RERUNS)
        run = self.kept(tried, [rated.run], target, source)
        return CodingResult(run=run, runs=len(tried) + rated.runs)


def _settings(options: Options, rate: Mapping[str, str], bit_rate: int | None = None) -> Settings:
    parameters = {
        "g": str(options["gop"] or 600),
        "bf": str(options["bframes"]),
        "sc_threshold": "1000000000",
        "flags": "+cgop",  # closed groups: no B picture refers beyond its group
        **rate,
    }
    return Settings(parameters=parameters, bit_rate=bit_rate)
