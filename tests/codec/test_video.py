"""Encoders of pseudo video sequences: settings, rates, structure of streams; CPU time of their threads."""

import os
import threading
import time
from fractions import Fraction

import av
import numpy as np
import pytest

from codec import decode, encode
from codec.clock import TASKS, OwnThreads, cpu_seconds
from codec.coders.video import open_encoder
from codec.coders.x264 import START_CODE, without_sei
from codec.contract import parse_scheme
from codec.order import ORDERS
from ii_core import IIPicture
from tests.codec.test_contract import large, psnr, textured
from tests.support.slow import first_fast


def slices(payload):
    """The NAL unit types of a stream, and the picture types in display order."""
    units = [payload[match.end()] & 31 for match in START_CODE.finditer(payload)]
    context = av.CodecContext.create("h264", "r")
    packets = context.parse(payload) + context.parse(None)
    frames = [frame for packet in [*packets, None] for frame in context.decode(packet)]
    return units, "".join(av.video.frame.PictureType(frame.pict_type).name for frame in frames)


def test_default_stream_is_one_i_picture_then_p_pictures_without_messages():
    units, types = slices(encode(textured(), "si-h264", qp=30).payload)
    assert types == "I" + 63 * "P"
    assert units[:3] == [7, 8, 5]
    assert 6 not in units


def test_gop_and_b_pictures():
    assert slices(encode(textured(), "si-h264:gop=16", qp=30).payload)[1] == 4 * ("I" + 15 * "P")
    assert slices(encode(textured(), "si-h264:gop=1", qp=30).payload)[1] == 64 * "I"
    assert slices(encode(textured(), "si-h264:bframes=3", qp=30).payload)[1].startswith("IBBBPBBBP")
    assert slices(encode(textured(), "si-h264:bframes=1", qp=30).payload)[1].startswith("IBPBP")


@pytest.mark.parametrize("options", ["bframes=3", "bframes=2,gop=16", "bframes=3,merange=64", "gop=1"])
def test_every_structure_repeats_to_the_byte_at_a_rate(options):
    coded = [encode(textured(), f"si-h264:{options},rate=cbr", bpp=1.2) for _ in range(3)]
    assert len({c.payload for c in coded}) == 1
    assert coded[0].reached
    assert psnr(textured(), decode(coded[0])) > 24


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("kind", ["ei", "si", "ri"])
def test_lossless_is_exact_up_to_colour_in_every_order(kind, order):
    picture = textured()
    decoded = decode(encode(picture, f"{kind}-h264:order={order},bframes=1", qp=0))
    assert np.abs(decoded.pixels.astype(int) - picture.pixels).max() <= 1


@pytest.mark.parametrize("kind", ["ei", "si", "ri"])
@pytest.mark.parametrize("bpp", first_fast([1.0, 0.75, 3.0]))
def test_rates_of_a_textured_picture_are_met_within_two_percent(kind, bpp):
    coded = encode(large(), f"{kind}-h264", bpp=bpp)
    assert coded.reached
    assert coded.bpp == pytest.approx(bpp, rel=0.02)


@pytest.mark.slow
def test_low_rates_of_sub_images_are_met():
    for bpp in (0.1, 0.2):
        assert encode(large(), "si-h264", bpp=bpp).reached


def test_elementary_images_have_a_floor_that_one_run_settles():
    coded = encode(large(), "ei-h264", bpp=0.05)
    assert not coded.reached
    assert coded.runs == 1
    assert coded.payload == encode(large(), "ei-h264", qp=51).payload


def test_quality_follows_the_quantiser():
    sizes, qualities = zip(
        *(
            (c.nbytes, psnr(textured(), decode(c)))
            for c in (encode(textured(), "si-h264", qp=q) for q in (10, 28, 46))
        ),
        strict=True,
    )
    assert sizes[0] > sizes[1] > sizes[2]
    assert qualities[0] > qualities[1] > qualities[2]


def test_reusing_one_frame_object_does_not_change_bytes():
    """The bytes equal those from separate frame objects that are kept alive."""
    picture = textured()
    coded = encode(picture, "si-h264:bframes=3", qp=30)
    coder, options = parse_scheme("si-h264")
    film = coder.film(picture, options)
    planes = film.batch()
    assert list(film.gathered(picture.pixels, planes)) == [64]
    context = av.CodecContext.create("libx264", "w")
    context.width, context.height, context.pix_fmt = 32, 16, "yuv444p"
    context.color_range, context.colorspace = 2, 1
    context.time_base, context.framerate, context.thread_count = Fraction(1, 25), 25, 1
    context.options = {
        "x264-params": "keyint=infinite:min-keyint=1:scenecut=0:bframes=3:b-adapt=0:b-pyramid=none:"
        "me=umh:merange=16:mvrange=512:"
        "weightp=0:psy=0:mbtree=0:qp=30"
    }
    frames = []
    for number, own in enumerate(zip(*planes, strict=True)):
        frame = av.VideoFrame(32, 16, "yuv444p")
        frame.color_range, frame.pts, frame.time_base = 2, number, context.time_base
        for plane, rows in zip(frame.planes, own, strict=True):
            np.frombuffer(plane, np.uint8).reshape(16, -1)[:, :32] = rows
        frames.append(frame)
    chunks = [bytes(packet) for frame in [*frames, None] for packet in context.encode(frame)]
    chunks[0] = without_sei(chunks[0])
    assert b"".join(chunks) == coded.payload


def test_only_the_sei_message_is_removed():
    sps, pps, idr = b"\0\0\0\1\x67abc", b"\0\0\0\1\x68de", b"\0\0\1\x65slice\0\0\3\1"
    assert without_sei(sps + pps + b"\0\0\1\x06x264" + idr) == sps + pps + idr
    assert without_sei(b"\0\0\0\1\x06x264" + idr) == idr
    assert without_sei(sps + pps + idr) == sps + pps + idr


@pytest.mark.parametrize("more", first_fast([1.2, 1.0, 1.4]))
def test_high_target_rates_take_lossless_coding(more):
    """At 4:4:4 the quantisers from 1 up take more than lossless coding does."""
    lossless = encode(large(), "ei-h264", qp=0)
    coded = encode(large(), "ei-h264", bpp=more * lossless.bpp)
    assert encode(large(), "ei-h264", qp=1).nbytes > more * 0.95 * lossless.nbytes
    assert coded.payload == lossless.payload
    assert coded.runs == 1
    assert coded.reached == (more == 1.0)


ON_LINUX = pytest.mark.skipif(not os.path.isdir(TASKS), reason="only Linux tells the time of each thread")


@ON_LINUX
def test_cpu_time_excludes_threads_of_others():
    """Threads that have ended, and Python's own threads, are distinguished from those of the encoder."""
    ended = threading.Thread(target=lambda: None)
    ended.start()
    ended.join()
    stop = threading.Event()

    def busy():
        while not stop.is_set():
            sum(range(1000))

    python = threading.Thread(target=busy)
    python.start()
    time.sleep(0.05)
    own = OwnThreads(lambda: None)
    own._ids = {ended.native_id, python.native_id}
    before = cpu_seconds()
    own.end()
    assert cpu_seconds() - before < 0.02
    stop.set()
    python.join()


@ON_LINUX
def test_no_encoder_makes_the_process_a_real_time_task():
    """SVT-AV1 run by root does: other processes of the machine then got no CPU time."""
    coder, options = parse_scheme("si-av1:fast")
    film = coder.film(IIPicture(np.zeros((64, 128, 3), np.uint8), (8, 4), (16, 16)), options)
    context = open_encoder(coder, film, coder.constant(30, film, options))
    usual = os.sched_getscheduler(0)
    OwnThreads(context.open)
    assert {os.sched_getscheduler(int(number)) for number in os.listdir(TASKS)} == {usual}
