"""Coders of single pictures; test_contract.py has the tests common to all schemes."""

import io
from dataclasses import replace

import imagecodecs
import numpy as np
import pytest
from PIL import Image

from codec import decode, encode
from codec.coders.libaom import samples
from codec.coders.stills import jpeg_tables, jpegxl_codestream, jpegxl_distance, jpegxl_size
from ii_core import IIPicture
from tests.codec.test_contract import many, psnr, textured


@pytest.mark.parametrize("quality", [1, 13, 49, 50, 51, 75, 99, 100])
def test_jpeg_tables_are_libjpegs(quality):
    out = io.BytesIO()
    Image.new("RGB", (8, 8)).save(out, "JPEG", quality=quality)
    with Image.open(out) as image:
        theirs = image.quantization
    for ours, table in zip(jpeg_tables(quality), (theirs[0], theirs[1]), strict=True):
        np.testing.assert_allclose(ours, table, rtol=5e-3, atol=1)  # libjpeg rounds the scale to a hundredth first


def test_qualities_in_between_make_sizes_in_between():
    sizes = [encode(many(), "jpeg", quality=q).nbytes for q in (20, 20.25, 20.5, 20.75, 21)]
    assert sizes == sorted(sizes)
    assert len(set(sizes)) == 5


@pytest.mark.parametrize("scheme", ["jpeg", "jpeg:chroma=420"])
def test_the_payload_is_a_jpeg_file(scheme):
    coded = encode(textured(), scheme, quality=80)
    with Image.open(io.BytesIO(coded.payload)) as image:
        np.testing.assert_array_equal(np.array(image), decode(coded).pixels)


def test_subsampled_colour_costs_less_and_is_worse():
    full, less = (encode(many(), f"jpeg:chroma={c}", quality=95) for c in ("444", "420"))
    assert less.nbytes < 0.95 * full.nbytes
    assert psnr(many(), decode(less)) < psnr(many(), decode(full)) - 1


def test_pictures_beyond_jpeg_sizes_are_refused():
    picture = IIPicture(np.zeros((1, 70_000, 3), np.uint8), (70_000, 1), (1, 1))
    with pytest.raises(ValueError, match="70000×1 pixels: JPEG takes 65500"):
        encode(picture, "jpeg", quality=50)


def test_jpegxl_distances_are_libjxls():
    """`JxlEncoderDistanceFromQuality`: 1 at 90, 25 at 0, continuous at 30."""
    assert jpegxl_distance(90) == pytest.approx(1.0)
    assert jpegxl_distance(0) == 25
    assert jpegxl_distance(30) == pytest.approx(jpegxl_distance(29.9999), abs=1e-3)


@pytest.mark.parametrize(
    "size", [(1, 1), (8, 8), (9, 8), (256, 256), (264, 256), (200, 100), (4096, 3), (70, 1025), (16, 9)]
)
def test_size_of_a_jpegxl_codestream(size):
    stream = imagecodecs.jpegxl_encode(np.zeros((size[1], size[0], 3), np.uint8), usecontainer=False, effort=1)
    assert jpegxl_size(stream) == size
    assert jpegxl_size(b"\xff\xd8" + stream) is None


def test_jpegxl_of_16_bits_loses_its_container():
    pixels = np.random.default_rng(0).integers(0, 65536, (9, 11, 3), np.uint16)
    boxed = imagecodecs.jpegxl_encode(pixels, lossless=True, usecontainer=True)
    bare = jpegxl_codestream(boxed)
    assert len(bare) < len(boxed)
    np.testing.assert_array_equal(imagecodecs.jpegxl_decode(bare), pixels)


@pytest.mark.parametrize("scheme", ["jpegxl", "htj2k"])
def test_a_rate_beyond_lossless_is_lossless(scheme):
    coded = encode(textured(16, 8, 4, 4), scheme, bpp=200)
    np.testing.assert_array_equal(decode(coded).pixels, textured(16, 8, 4, 4).pixels)


def test_six_quantisers_of_htj2k_double_the_error():
    noise = IIPicture(np.random.default_rng(1).integers(64, 192, (64, 64, 3), np.uint8), (8, 8), (8, 8))
    fine, coarse = (psnr(noise, decode(encode(noise, "htj2k", qp=qp))) for qp in (15, 21))
    assert 3 < fine - coarse < 9  # 6.02 dB but for coefficients that fall to zero, and clipping


@pytest.mark.parametrize("scheme", ["jpeg", "jpegxl", "htj2k"])
def test_another_size_than_the_structures_is_refused(scheme):
    coded = encode(textured(16, 8, 4, 4), scheme, bpp=3)
    other = encode(textured(8, 16, 4, 4), scheme, bpp=3)
    with pytest.raises(ValueError, match="is damaged"):
        decode(replace(coded, payload=other.payload))


def test_the_av1_stream_of_an_avif_file_is_complete():
    frames = np.random.default_rng(0).integers(0, 256, (5, 16, 24, 3), np.uint8)
    for some in (frames, frames[:1]):
        boxes = bytes(imagecodecs.avif_encode(some, 60, codec="aom", numthreads=1))
        found = samples(boxes)
        assert len(found) == len(some)
        assert b"".join(found) in boxes


def test_libaom_keeps_all_of_the_colour():
    """Against SVT-AV1, which subsamples it, on a picture of saturated noise."""
    pixels = np.random.default_rng(5).integers(0, 256, (32, 64, 3), np.uint8)
    picture = IIPicture(pixels, (16, 8), (4, 4))
    full, less = (
        decode(encode(picture, scheme, qp=low)) for scheme, low in (("si-avif:fast", 0), ("si-av1:fast", 1))
    )
    assert np.abs(full.pixels.astype(int) - pixels).max() <= 1
    assert psnr(picture, less) < 25


def test_errors_that_openjph_only_prints_are_raised(capfd):
    """Its binding would print twice and return a picture of uninitialised memory."""
    coded, rng = encode(textured(16, 8, 4, 4), "htj2k", qp=20), np.random.default_rng(0)
    refused = 0
    for _ in range(60):
        payload = bytearray(coded.payload)
        for at in rng.integers(150, len(payload), 3):
            payload[at] ^= 1 << rng.integers(8)
        try:
            decode(replace(coded, payload=bytes(payload)))
        except ValueError as error:
            refused += "(ojph error)" in str(error)
    assert refused > 5
    assert "ojph" not in capfd.readouterr().err
