"""SPERR decoder process; test_contract.py has the tests common to all schemes."""

import math
import os
import struct
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import imagecodecs
import numpy as np
import pytest

from codec import decode, decode_frame, encode, timed_decode
from codec.coders.sperr import coder as sperr
from codec.coders.sperr import stream as sperr_stream
from codec.coders.sperr import worker as sperr_worker
from ii_core import IIPicture
from tests.codec.test_contract import many, psnr, textured

CONSTANT = 54  # bytes of the header


def field(shape=(6, 20, 30)):
    """Return a smooth volume with a rough part."""
    z, y, x = np.ogrid[: shape[0], : shape[1], : shape[2]]
    rough = np.random.default_rng(0).standard_normal(shape)
    return (60 * np.sin(x / 5 + z) * np.cos(y / 4) + 8 * rough).astype(np.float32)


@pytest.mark.parametrize("step", [0.5, 4.0, 32.0])
def test_a_stream_without_its_header_is_decoded_as_the_library_does(step):
    """The rebuilt header equals the library's, and the other process decodes the same volume."""
    volume = field()
    part = sperr_stream.encode_volume(volume, step)
    whole = imagecodecs.sperr_encode(
        volume, 8 * len(part.stream) / volume.size, "bpp", chunks=volume.shape, numthreads=1
    )
    expected = imagecodecs.sperr_decode(whole, shape=volume.shape, dtype=np.float32)
    (decoded,), _ = sperr_stream.decode_volumes([part], volume.shape)
    # The library's own stream may go on for up to 64 bits that round up its words.
    assert np.sqrt(np.mean((decoded - expected) ** 2)) < 0.02 * step
    assert sperr_stream.squared_error(part, volume) == pytest.approx(np.mean((decoded - volume) ** 2), rel=1e-5)


@pytest.mark.parametrize("step", [16.0, 64.0])
def test_cut_streams_beat_rounded_ones(step, monkeypatch):
    """At the length that a wide step takes the error is well below that of the step."""
    volume = field((16, 32, 32))
    cut = sperr_stream.encode_volume(volume, step)
    library = bytes(imagecodecs.sperr_encode(volume, step / 1.5, "pwe", chunks=volume.shape, numthreads=1))
    rounded, bits = sperr_stream._split(library, volume.shape)
    assert len(cut.stream) == math.ceil(bits / 8)
    error = sperr_stream.squared_error(cut, volume)
    monkeypatch.setattr(sperr_stream, "BIT_PLANES", library[sperr_stream._LIBRARY.size - 9])
    assert error < 0.95 * sperr_stream.squared_error(
        replace(rounded, stream=rounded.stream[: len(cut.stream)]), volume
    )


@pytest.mark.parametrize("quality", [20, 40])
@pytest.mark.parametrize("scale", [1, 257])
def test_quality_is_the_psnr(quality, scale):
    """To the rounding of 8-bit codes, which takes 0.06 dB at 40."""
    picture = many()
    picture = picture.with_pixels(picture.pixels * np.array(scale, "uint8" if scale == 1 else "uint16"))
    coded = encode(picture, "si-sperr", quality=quality)
    assert psnr(picture, decode(coded), peak=255 * scale) == pytest.approx(quality, abs=0.15)
    assert coded.runs <= sperr.QUALITY_RUNS


@pytest.mark.parametrize("value", [0, 7, 255])
@pytest.mark.parametrize("asked", [{"quality": 40}, {"bpp": 0.5}])
def test_a_constant_picture_is_its_means(value, asked):
    picture = textured().with_pixels(np.full(textured().pixels.shape, value, np.uint8))
    coded = encode(picture, "si-sperr", **asked)
    np.testing.assert_array_equal(decode(coded).pixels, value)
    assert len(coded.payload) == CONSTANT


def test_a_large_constant_picture_has_the_least_payload():
    picture = IIPicture(np.zeros((1024, 1024, 3), np.uint8), (64, 64), (16, 16))
    coded = encode(picture, "si-sperr", quality=40)
    assert len(coded.payload) == 1024**2 // sperr.PIXELS_A_BYTE
    np.testing.assert_array_equal(decode(coded).pixels, 0)
    for payload in (coded.payload[:-1], coded.payload + b"\0", coded.payload[:-1] + b"\1"):
        with pytest.raises(ValueError, match="is damaged: its volume has"):
            decode(replace(coded, payload=payload))


def test_one_slice_is_coded_as_two():
    picture = textured(16, 8, 1, 1)
    decoded = decode(encode(picture, "si-sperr", quality=40))
    assert psnr(picture, decoded) == pytest.approx(40, abs=0.3)


def test_volumes_decode_no_frames():
    with pytest.raises(ValueError, match="scheme si-sperr codes the picture as a whole"):
        decode_frame(encode(textured(), "si-sperr", quality=20), 0)


@pytest.mark.parametrize(
    ("at", "value", "said"),
    [
        (18, math.nan, "a mean nan"),
        (18, 1e30, "a mean 1"),
        (30, math.inf, "a step inf"),
        (30, -1.0, "a step -1"),
        (30, 0.0, "a step 0"),
    ],
)
def test_false_headers_are_refused(at, value, said):
    coded = encode(textured(), "si-sperr", quality=30)
    payload = bytearray(coded.payload)
    struct.pack_into("<f", payload, at, value)
    with pytest.raises(ValueError, match=said):
        decode(replace(coded, payload=bytes(payload)))


def test_an_abort_of_the_library_does_not_end_this_process(monkeypatch):
    """A whole stream of another size makes the library abort."""
    part = sperr_stream.encode_volume(field(), 4.0)
    monkeypatch.setattr(sperr_stream, "_with_header", lambda part, shape: b"\0" * 40)
    with pytest.raises(ValueError, match="does not decode"):
        sperr_stream.decode_volumes([part], (6, 20, 30))


def test_a_worker_that_cannot_start_is_not_the_file_s_fault(monkeypatch):
    part = sperr_stream.encode_volume(field(), 4.0)
    monkeypatch.setattr(sperr_worker, "__file__", "/nowhere/sperr_worker.py")
    with pytest.raises(ChildProcessError, match=r"SPERR decoder does not start: .*sperr_worker"):
        sperr_stream.decode_volumes([part], (6, 20, 30))


def test_the_worker_needs_nothing_of_this_package(tmp_path):
    """The worker runs by its path, without its folder on the module path, which has names like `header`."""
    volume = field()
    part = sperr_stream.encode_volume(volume, 1.0)
    stream = sperr_stream._with_header(part, volume.shape)
    request = sperr_worker.HEAD.pack(*volume.shape, 1) + sperr_worker.LENGTH.pack(len(stream)) + stream
    copy = tmp_path / "elsewhere.py"
    copy.write_bytes(Path(sperr_worker.__file__).read_bytes())
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    answer = subprocess.run([sys.executable, "-P", copy], input=request, capture_output=True, env=environment).stdout
    assert len(answer) == len(sperr_worker.READY) + 4 * volume.size + sperr_worker.TIMES.size


def test_the_worker_s_time_counts():
    decoding = timed_decode(encode(textured(), "si-sperr", quality=40))
    assert decoding.seconds - decoding.codec_seconds > 0.01  # starting an interpreter takes longer than that


@pytest.mark.skipif(sys.platform != "linux", reason="limits of a process as Linux has them")
def test_the_worker_s_memory_has_an_end():
    script = "import sys; sys.path[:0] = [sys.argv[1]]; import worker as w; w.bound(1 << 26, 5); bytes(1 << 28)"
    folder = str(Path(sperr_worker.__file__).parent)
    ended = subprocess.run([sys.executable, "-P", "-c", script, folder], capture_output=True, text=True)
    assert ended.stderr.splitlines()[-1] == "MemoryError"
