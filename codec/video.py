"""Pseudo video sequences: component images as the frames of an H.264 stream, by x264 through PyAV.

The default is the dissertation's structure: one I picture, then P pictures only, no B, motion range 16, constant bit
rate. Frames are 4:4:4 in full range; everything runs in the calling thread, since x264 makes another stream with
every number of threads.
"""

from __future__ import annotations

import itertools
import re
import time
from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import Any, ClassVar

import av
import numpy as np
from numpy.typing import NDArray

from ii_core import IIPicture

from .base import Coder, Coding, Goal, Option, Options
from .order import ORDERS
from .rate import Run, nearest_rate
from .sequence import Layout, gathered, layout, scatter

NAMES = {"ei": "Elementary images", "si": "Sub-images", "ri": "Ray-space images"}

MAX_SIDE = 16384  # of a frame, in x264
COARSEST, LOSSLESS = 51, 0  # quantisers; at 4:4:4 x264 takes 0 for lossless coding of YCbCr
# The smallest P frame x264 writes: start code, headers, one skipped macroblock.
MIN_FRAME_BYTES = 10
# The smallest any H.264 frame can be: a three-byte start code, a header, one byte.
MIN_CODED_FRAME = 5

# Constant bit rate. Time means nothing in a pseudo video, so the frame rate f in R = S·T·r·f (5.10) is free. It is
# set so that R is always the same large number: x264's whole kilobits are fine steps of that, and the sequence is
# over before its long-term control wakes. The buffer alone rules, and frames count in it, not seconds. x264 keeps it
# between half and 0.8 full: started between them it ends about as full, and the sequence has the size asked for.
BIT_RATE = 1e9
MAX_FRAME_RATE = 10**8
BUFFER_FRAMES = 32
BUFFER_START = 0.65
MAX_KBIT = 2_000_000  # x264 multiplies by 1000 in 32 bits

CHUNK = 1 << 16  # bytes of a stream parsed at once

START_CODE = re.compile(rb"\x00?\x00\x00\x01")
NAL_SEI = 6


class H264(Coder):
    """Component images of one kind as an H.264 pseudo video sequence.

    References
    ----------
    Olsson 2008, §5.5.1 (5.1), §5.5.3 (5.8)–(5.10), §5.7.
    """

    options: ClassVar[Mapping[str, Option]] = {
        "order": Option(about="of the component images", default="parallel", choices=tuple(ORDERS)),
        "gop": Option(about="frames from I picture to I picture, 0 for only one", default=0, low=0, high=1 << 30),
        "bframes": Option(about="B pictures between P pictures", default=0, low=0, high=3),
        "merange": Option(about="motion range in pixels", default=16, low=16, high=128),
    }
    qp_range = (LOSSLESS, COARSEST)
    scale_about = "constant quantiser, 0 is lossless but for colour"

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self.name = f"{kind}-h264"
        self.about = f"{NAMES[kind]} as a pseudo video sequence, H.264 4:4:4 by x264"

    @property
    def versions(self) -> dict[str, str]:
        """PyAV and the libavcodec in it."""
        return {"av": av.__version__, "libavcodec": ".".join(map(str, av.library_versions["libavcodec"]))}

    def check(self, picture: IIPicture, options: Options) -> None:
        """Frames must not be larger than x264 takes."""
        shape = self._layout(picture)
        if max(shape.width, shape.height) > MAX_SIDE:
            raise ValueError(
                f"frames of scheme {self.name} would have {shape.width}×{shape.height} pixels: "
                f"at most {MAX_SIDE}×{MAX_SIDE} are allowed"
            )

    def encode(self, picture: IIPicture, options: Options, goal: Goal) -> Coding:
        """An Annex B byte stream, parameter sets in band."""
        pixels, shape = np.ascontiguousarray(picture.pixels), self._layout(picture)

        def constant(quantiser: int) -> Run:
            return _encode(pixels, shape, options, f"qp={quantiser}", frame_rate=25)

        def at_rate(size: float) -> Run:
            return _encode(pixels, shape, options, *_rate_control(size, shape))

        if goal.qp is not None:
            return Coding(run=constant(goal.qp))
        assert goal.bpp is not None
        target = goal.bpp * picture.size[0] * picture.size[1] / 8
        if target < MIN_FRAME_BYTES * shape.frames:  # no need to ask for what headers alone exceed
            return Coding(run=constant(COARSEST))
        run, runs = nearest_rate(
            at_rate, target, coarsest=lambda: constant(COARSEST), finest=lambda: constant(LOSSLESS)
        )
        return Coding(run=run, runs=runs)

    def decode(self, payload: bytes, blank: IIPicture, options: Options) -> tuple[NDArray[np.uint8], float]:
        """Frame by frame, never more of them than a batch."""
        shape = self._layout(blank)
        try:
            return _decode(payload, shape, str(options["order"]), blank.pixels.shape)
        except av.FFmpegError as error:
            raise ValueError(f"its H.264 stream does not decode ({error.strerror})") from None

    def _layout(self, picture: IIPicture) -> Layout:
        return layout(picture.lenses, picture.ei_pixels, self.kind)


def _rate_control(size: float, shape: Layout) -> tuple[str, int]:
    """x264's parameters and the frame rate that make a sequence of ``size`` bytes."""
    frame_bits = 8 * size / shape.frames
    frame_rate = round(min(max(BIT_RATE / frame_bits, 1), MAX_FRAME_RATE))
    kilobits = max(1, round(min(frame_bits * frame_rate / 1000, MAX_KBIT)))
    # Half the sequence at most: a buffer that holds more binds nothing.
    frames = min(BUFFER_FRAMES, max(1.0, shape.frames / 2))
    buffer = max(1, round(min(frame_bits * frames / 1000, MAX_KBIT)))
    rate = f"bitrate={kilobits}:vbv-maxrate={kilobits}:vbv-bufsize={buffer}:vbv-init={BUFFER_START}"
    return rate, frame_rate


def _parameters(options: Options, rate: str) -> str:
    gop = options["gop"] or "infinite"
    return ":".join(
        [
            f"keyint={gop}:min-keyint=1:scenecut=0",
            f"bframes={options['bframes']}:b-adapt=0",
            # One search for every range: x264's default search would not go beyond 16 whatever the range.
            f"me=umh:merange={options['merange']}:mvrange=512",
            # Macroblock tree repeats to the byte only without B pictures, and no coder of 2008 had it.
            "weightp=0:psy=0:mbtree=0",
            # To hold a rate x264 would go beyond the standard's coarsest quantiser, and drop residuals altogether.
            f"qpmax={COARSEST}",
            rate,
        ]
    )


def _encode(pixels: NDArray[np.uint8], shape: Layout, options: Options, rate: str, frame_rate: int) -> Run:
    """One run of the encoder over all frames."""
    context = _encoder(shape, _parameters(options, rate), frame_rate)
    frame: Any = av.VideoFrame(shape.width, shape.height, "yuv444p")
    frame.color_range = av.video.reformatter.ColorRange.JPEG
    frame.time_base = context.time_base
    # x264 copies a frame before `encode` returns, so that one serves for all.
    views = [np.frombuffer(plane, np.uint8) for plane in frame.planes]
    planes = shape.batch(frame.planes[0].line_size)
    chunks: list[bytes] = []
    seconds, number = 0.0, 0
    for count in gathered(pixels, shape, str(options["order"]), planes):
        started = time.thread_time()
        for rows in planes[:count].reshape(count, 3, -1):
            views[0][:], views[1][:], views[2][:] = rows
            frame.pts = number
            number += 1
            chunks.extend(map(bytes, context.encode(frame)))
        seconds += time.thread_time() - started
    started = time.thread_time()
    chunks.extend(map(bytes, context.encode(None)))
    seconds += time.thread_time() - started
    chunks[0] = without_sei(chunks[0])
    return Run(b"".join(chunks), seconds)


def _encoder(shape: Layout, parameters: str, frame_rate: int) -> Any:
    context: Any = av.CodecContext.create("libx264", "w")
    context.width, context.height, context.pix_fmt = shape.width, shape.height, "yuv444p"
    context.color_range = av.video.reformatter.ColorRange.JPEG
    context.framerate, context.time_base = Fraction(frame_rate), Fraction(1, frame_rate)
    context.thread_count = 1
    context.options = {"x264-params": parameters}
    return context


def without_sei(packet: bytes) -> bytes:
    """The packet without x264's message to the reader: over 600 bytes of settings that no decoder needs."""
    starts = [match.start() for match in START_CODE.finditer(packet)]
    units = [packet[start:end] for start, end in zip(starts, [*starts[1:], len(packet)], strict=True)]
    return b"".join(unit for unit in units if START_CODE.sub(b"", unit, count=1)[0] & 31 != NAL_SEI)


def _decode(payload: bytes, shape: Layout, order: str, size: tuple[int, ...]) -> tuple[NDArray[np.uint8], float]:
    if len(payload) < MIN_CODED_FRAME * shape.frames:  # before anything as long as the sequence is laid out
        raise ValueError(f"its H.264 stream of {len(payload)} bytes cannot hold {shape.frames} frames")
    origins = shape.origins(order)
    planes = shape.batch(shape.width)
    frames = _frames(payload, shape)
    pixels = np.empty((0, 0, 3), np.uint8)
    seconds, done = 0.0, 0
    while True:
        started = time.thread_time()
        batch = list(itertools.islice(frames, len(planes)))
        seconds += time.thread_time() - started
        if not batch:
            break
        if done == 0:
            pixels = np.empty(size, np.uint8)
        if done + len(batch) > shape.frames:
            raise ValueError(f"its H.264 stream has more than {shape.frames} frames")
        for frame, target in zip(batch, planes, strict=False):
            _copy_planes(frame, target)
        scatter(planes, origins[done : done + len(batch)], shape, pixels)
        done += len(batch)
    if done < shape.frames:
        raise ValueError(f"its H.264 stream has {done} frames, {shape.frames} are needed")
    return pixels, seconds


def _frames(payload: bytes, shape: Layout) -> Iterator[Any]:
    """The frames of a stream in display order, each checked for its size."""
    context: Any = av.CodecContext.create("h264", "r")
    context.thread_count = 1
    # A stream of larger frames is refused before they take memory. The decoder counts what it would allocate: whole
    # macroblocks, rows padded for its vector instructions.
    coded = (-(-shape.width // 128) * 128) * (-(-shape.height // 16) * 16)
    context.options = {"max_pixels": str(coded), "err_detect": "explode"}
    view = memoryview(payload)
    chunks = [view[start : start + CHUNK] for start in range(0, len(view), CHUNK)]
    for chunk in [*chunks, None]:
        for packet in context.parse(chunk):
            yield from _checked(context.decode(packet), shape)
    yield from _checked(context.decode(None), shape)


def _checked(frames: list[Any], shape: Layout) -> list[Any]:
    for frame in frames:
        found = frame.width, frame.height, frame.format.name.replace("yuvj", "yuv")
        if found != (shape.width, shape.height, "yuv444p"):
            raise ValueError(
                f"its H.264 stream has frames of {found}, ({shape.width}, {shape.height}) in yuv444p needed"
            )
    return frames


def _copy_planes(frame: Any, target: NDArray[np.uint8]) -> None:
    for plane, rows in zip(frame.planes, target, strict=True):
        height, width = rows.shape
        rows[:] = np.frombuffer(plane, np.uint8, height * plane.line_size).reshape(height, -1)[:, :width]
