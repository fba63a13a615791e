"""Tests of causes of differences from Olsson 2008: framing, motion search, x264 as of 2008, number of frames."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import av
import numpy as np

from benchmarks.coding.bframes import QUANTISERS, curve
from benchmarks.speed.bare import bare_encoder
from codec import encode, register, schemes
from codec.coders.video import Settings
from codec.coders.x264 import H264
from codec.contract import Options
from codec.frames import Film
from ii_core import IIPicture
from metrics import bd_psnr

from .coding import CODED, shot
from .rates import BFRAMES, RANGES, SI
from .runner import Step

FRAMES = 4096
SIDE = 16  # pixels of an elementary image of setup 1
CONTAINERS = ("h264", "mkv", "mp4", "avi")
SEARCHES = ("umh", "esa")  # x264's uneven multi-hexagon search, our default; exhaustive search
QUANTISER = 30
SIZES = (1, 2, 4)  # divisors of the number of lenses


def steps(scale: int) -> list[Step]:
    """Return all steps."""
    searched = [
        Step(
            name=f"search-{scene}",
            shows=f"Table 5.6 with exhaustive search, {scene}",
            run=searches,
            parameters={"scene": scene, "scale": scale},
            uses=(*CODED, "benchmarks.speed.bare"),
        )
        for scene in ("apples", "twins")
    ]
    uses = (*CODED, "benchmarks.coding.bframes")
    given = {"scene": "apples", "scale": scale}
    older = [
        Step(
            name="types-2008" + (f"-{part}" if part > 1 else ""),
            shows="Table 5.5, x264 set as in 2008",
            run=types_2008,
            parameters={**given, "scale": scale * part},
            uses=uses,
        )
        for part in SIZES
        if scale * part <= 16
    ]
    return [
        Step(name="framing", shows="the lowest rate of EI-PVS in Figure 5.10", run=framing),
        *searched,
        *older,
        Step(name="frames", shows="Table 5.8, time by number of frames", run=frames, parameters=given, uses=CODED),
    ]


class H264of2008(H264):
    """x264 with features and defaults as of the beginning of 2008."""

    # One reference, no trellis, no 8×8 transform, no adaptive quantiser, no weighted B pictures.
    SET = "ref=1:subme=5:trellis=0:8x8dct=0:mixed-refs=0:aq-mode=0:weightb=0"

    def constant(self, quantiser: float, film: Film, options: Options) -> Settings:
        """Return settings of 2008: `SET`, and exhaustive search (Table 5.6)."""
        settings = super().constant(quantiser, film, options)
        parameters = settings.parameters["x264-params"].replace("me=umh", "me=esa") + f":{self.SET}"
        return replace(settings, parameters={**settings.parameters, "x264-params": parameters})


class PlainH264(H264of2008):
    """The same with the simplest macroblocks: no direct mode or partitions, least sub-pixel refinement, CAVLC."""

    SET = H264of2008.SET.replace("subme=5", "subme=1") + ":direct=none:partitions=none:chroma-me=0:cabac=0"


def framing(_folder: Path) -> dict[str, Any]:
    """Return bytes per frame of black elementary images at the coarsest quantiser, by container."""
    rows = []
    for container in CONTAINERS:
        for delimiters in (0, 1):
            size = file_size(container, delimiters) / FRAMES
            rows.append({"container": container, "delimiters": delimiters, "bytes": size, "bpp": 8 * size / SIDE**2})
    return {"rows": rows}


def file_size(container: str, delimiters: int, frames: int = FRAMES) -> int:
    """Return the size of a file of black frames by x264, with or without access unit delimiters."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"black.{container}"
        with av.open(str(path), "w") as output:
            stream = output.add_stream("libx264", rate=25)
            stream.width = stream.height = SIDE
            stream.pix_fmt = "yuv420p"
            stream.codec_context.thread_count = 1
            parameters = f"qp=51:keyint=infinite:scenecut=0:bframes=0:weightp=0:aud={delimiters}"
            stream.options = {"x264-params": parameters}
            black = av.VideoFrame.from_ndarray(np.zeros((SIDE * 3 // 2, SIDE), np.uint8), format="yuv420p")
            for i in range(frames):
                black.pts = i
                output.mux(stream.encode(black))
            output.mux(stream.encode(None))
        return path.stat().st_size


def searches(_folder: Path, *, scene: str, scale: int) -> dict[str, Any]:
    """Return bytes and CPU seconds of SI-PVS at one quantiser by motion range, for both searches."""
    picture = shot(scene, "setup1", scale).picture
    rows = []
    for search in SEARCHES:
        for reach in RANGES:
            encode = bare_encoder(picture, f"{SI},rate=cq,merange={reach}", QUANTISER, search=search)
            started = time.thread_time()
            size = encode()
            rows.append({"search": search, "range": reach, "bytes": size, "seconds": time.thread_time() - started})
    return {"rows": rows}


def types_2008(_folder: Path, *, scene: str, scale: int) -> dict[str, Any]:
    """Return Bjøntegaard differences in dB of one, two and three B pictures to none, at constant quantisers."""
    register_older("si")
    picture = shot(scene, "setup1", scale).picture
    goals = [{"qp": quantiser} for quantiser in QUANTISERS]
    rows = []
    for what, scheme, reach in (
        ("today, range 128", "si-h264", 128),
        ("today", "si-h264", 16),
        ("2008", "si-h264of2008", 16),
        ("2008, plain", "si-plainh264", 16),
    ):
        for fine, ratio in (("B coarser by 1.3", 1.3), ("B as fine as P", 1)):
            named = f"{scheme}:rate=cq,chroma=420,merange={reach},pbratio={ratio}"
            curves = [curve(picture, named, count, goals) for count in BFRAMES]
            rows.append({"set": what, "b": fine, "db": [bd_psnr(*curves[0], *one) for one in curves[1:]]})
    return {"lenses": picture.lenses, "rows": rows}


def frames(_folder: Path, *, scene: str, scale: int) -> dict[str, Any]:
    """Return CPU seconds of EI-PVS by number of elementary images: the upper lens rows of one picture."""
    register_older("ei")
    picture = shot(scene, "setup1", scale).picture
    columns, rows = picture.lenses
    parts = [part for part in (64, 16, 4, 1) if part <= rows]
    found = []
    for what, run in counted(picture):
        run(rows // parts[0])  # load libraries and compile kernels
        for part in parts:
            started = time.thread_time()
            runs = run(rows // part)
            seconds = (time.thread_time() - started) / runs
            found.append({"set": what, "frames": columns * (rows // part), "seconds": seconds})
    return {"rows": found}


def counted(picture: IIPicture) -> Iterator[tuple[str, Callable[[int], int]]]:
    """Return encoders of a number of lens rows, and their repetitions, for parts of the time per frame."""

    def coded(rows: int, scheme: str, goal: Mapping[str, Any]) -> int:
        upper = IIPicture(picture.pixels[: rows * picture.ei_pixels[1]], (picture.lenses[0], rows), picture.ei_pixels)
        return encode(upper, f"ei-{scheme}", **goal).runs

    def filed(rows: int, container: str) -> int:
        file_size(container, 0, picture.lenses[0] * rows)
        return 1

    for what, scheme, goal in (
        ("constant quantiser", "h264:chroma=420", {"qp": QUANTISER}),
        ("constant bit rate", "h264:chroma=420,rate=cbr", {"bpp": 1.0}),
        ("two passes", "h264:chroma=420,rate=2pass", {"bpp": 1.0}),
        ("2008, range 128", "h264of2008:chroma=420,rate=cq,merange=128", {"qp": QUANTISER}),
    ):
        yield what, partial(coded, scheme=scheme, goal=goal)
    for container in ("avi", "mp4"):
        yield f"black, into {container.upper()}", partial(filed, container=container)


def register_older(kind: str) -> None:
    """Register the encoders of 2008 as schemes."""
    for encoder in (H264of2008(kind), PlainH264(kind)):
        if encoder.name not in schemes():
            register(encoder)
