"""Volumes and component images coded alone; test_contract.py has the tests common to all schemes."""

from dataclasses import replace

import imagecodecs
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from codec import decode, encode
from codec.bitstream.jpeg2000 import whole_codestream
from codec.coders import lifting
from codec.coders.planes import decode_planes, encode_planes
from codec.coders.volume import GROUP, MAX_SLICES, principal_axes
from codec.frames import layout
from ii_core import IIPicture
from tests.codec.test_contract import many, psnr, textured


@pytest.mark.parametrize("dtype", ["int16", "int32"])
def test_planes_come_back_exactly_and_others_read_the_codestream(dtype):
    planes = np.random.default_rng(0).integers(-2000, 2000, (7, 40, 33)).astype(dtype)
    stream = encode_planes(planes, 0, wavelet="5/3")
    np.testing.assert_array_equal(decode_planes(stream, planes.shape, dtype, wavelet="5/3", lossless=True), planes)
    whole = whole_codestream(stream, planes.shape, dtype, wavelet="5/3", lossless=True)
    np.testing.assert_array_equal(imagecodecs.jpeg2k_decode(whole, planar=True), planes)


@pytest.mark.parametrize("wavelet", ["5/3", "9/7"])
@pytest.mark.parametrize("error", [4.0, 100.0, 2500.0])
def test_the_error_over_all_planes_meets_its_target(wavelet, error):
    """A rough plane beside smooth ones: one slope for all, not one error."""
    rng = np.random.default_rng(1)
    planes = np.cumsum(np.cumsum(rng.standard_normal((4, 128, 128)), 1), 2) * np.array([1, 1, 4, 30])[:, None, None]
    planes = np.clip(planes, -32768, 32767).astype(np.int16)
    stream = encode_planes(planes, error, wavelet=wavelet)
    decoded = decode_planes(stream, planes.shape, "int16", wavelet=wavelet, lossless=False)
    # The encoder estimates distortion from coefficients, and the 5/3's waveforms are less orthogonal.
    assert np.mean((decoded.astype(float) - planes) ** 2) == pytest.approx(
        error, rel=0.1 if wavelet == "9/7" else 0.5
    )


@pytest.mark.parametrize("quality", [25, 35, 45])
@pytest.mark.parametrize("dtype", ["uint8", "uint16"])
def test_quality_is_the_psnr(quality, dtype):
    """The gains are right: an error in the bands is as large in the picture."""
    picture = many()
    peak = np.iinfo(dtype).max
    picture = picture.with_pixels((picture.pixels.astype(dtype)) * dtype_scale(dtype))
    decoded = decode(encode(picture, "si-jp3d", quality=quality))
    assert psnr(picture, decoded, peak=peak) == pytest.approx(quality, abs=0.4)


def dtype_scale(dtype):
    return np.array({"uint8": 1, "uint16": 257}[dtype], dtype)


def test_the_wavelet_along_the_slices_lowers_the_rate():
    picture = many()
    volume, alone = (encode(picture, s, quality=32) for s in ("si-jp3d", "si-jpeg2000"))
    assert volume.nbytes < 0.9 * alone.nbytes
    assert abs(psnr(picture, decode(volume)) - psnr(picture, decode(alone))) < 0.3


def test_colours_are_turned_by_a_rotation_to_their_principal_axes():
    rng = np.random.default_rng(3)
    grey, tint = rng.normal(128, 30, (500, 1)), rng.normal(0, 5, (500, 1))
    pixels = np.clip(grey * [1, 1, 1] + tint * [1, 0, -1] + rng.normal(0, 1, (500, 3)), 0, 255).astype(np.uint8)
    axes = principal_axes(pixels) / (1 << 14)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=2e-4)
    np.testing.assert_allclose(axes[0], 3**-0.5, atol=0.02)
    np.testing.assert_allclose(np.abs(axes[1]), [2**-0.5, 0, 2**-0.5], atol=0.05)


def test_more_slices_than_a_codestream_holds_make_several_volumes():
    lenses, ei_pixels = (45, 31), (3, 2)
    picture = IIPicture(np.random.default_rng(4).integers(0, 256, (62, 135, 3), np.uint8), lenses, ei_pixels)
    assert layout(lenses, ei_pixels, "ei").frames > MAX_SLICES > GROUP
    coded = encode(picture, "ei-jp3d:lossless=1")
    np.testing.assert_array_equal(decode(coded).pixels, picture.pixels)
    with pytest.raises(ValueError, match="does not consist of exactly 2 codestreams"):
        decode(replace(coded, payload=coded.payload + b"\0"))


def test_rates_above_lossless_coding_are_lossless():
    picture = textured(16, 8, 4, 4)
    coded = encode(picture, "si-jp3d", bpp=100)
    np.testing.assert_array_equal(decode(coded).pixels, picture.pixels)
    assert coded.payload == encode(picture, "si-jp3d:lossless=1").payload


@pytest.mark.parametrize("shape", [(3, 16, 16), (1, 257, 511), (6, 1, 700), (3, 40, 1), (2, 600, 300)])
@pytest.mark.parametrize("lossless", [False, True])
def test_a_stream_has_a_byte_for_every_packet(shape, lossless):
    """Planes of zeros have empty packets alone, the least there is."""
    wavelet = "5/3" if lossless else "9/7"
    stream = encode_planes(np.zeros(shape, np.int16), 0.0 if lossless else 1e6, wavelet=wavelet)
    assert not decode_planes(stream, shape, "int16", wavelet=wavelet, lossless=lossless).any()


def test_a_stream_too_short_for_its_packets_is_refused_before_memory_is_taken():
    """A forged size of 4096×2048 needs 3·(128 + 32 + 8 + 2 + 1 + 1) packets."""
    stream = encode_planes(np.zeros((3, 256, 256), np.int16), 1e6, wavelet="9/7")
    with pytest.raises(ValueError, match="its packets alone have 516"):
        decode_planes(stream, (3, 2048, 4096), "int16", wavelet="9/7", lossless=False)


@pytest.mark.parametrize("value", [0, 255])
def test_a_constant_picture_costs_little_and_comes_back(value):
    picture = textured(16, 8, 4, 4).with_pixels(np.full((32, 64, 3), value, np.uint8))
    coded = encode(picture, "si-jp3d", quality=40)
    assert np.abs(decode(coded).pixels.astype(int) - value).max() <= 6  # one coefficient, cut at a bit plane
    assert coded.nbytes < 300


@pytest.mark.parametrize(
    ("at", "value", "said"),
    [
        (0, 7, "unknown mode or step"),
        (1, 120, "unknown mode or step"),
        (20, 255, "does not consist of exactly 1 codestreams"),
        (24 + 7, 200, "coding style"),  # number of layers
        (24 + 9, 31, "coding style"),  # levels
    ],
)
def test_false_headers_are_refused(at, value, said):
    coded = encode(textured(16, 8, 4, 4), "si-jp3d", quality=30)
    payload = bytearray(coded.payload)
    payload[at] = value
    with pytest.raises(ValueError, match=said):
        decode(replace(coded, payload=bytes(payload)))
    with pytest.raises(ValueError, match="is damaged"):
        decode(replace(coded, payload=bytes(payload[:10])))


# -- wavelets along the slice axis: exact inverses, gains against the filters of the standard


# Synthesis filters of JPEG 2000 Part 1, Annex F.
LOW = {
    "5/3": [0.5, 1, 0.5],
    "9/7": [
        *(-0.091271763114, -0.057543526229, 0.591271763114, 1.115087052457),
        *(0.591271763114, -0.057543526229, -0.091271763114),
    ],
}
HIGH = {
    "5/3": [-0.125, -0.25, 0.75, -0.25, -0.125],
    "9/7": [
        *(0.026748757411, 0.016864118443, -0.078223266529, -0.266864118443, 0.602949018236),
        *(-0.266864118443, -0.078223266529, 0.016864118443, 0.026748757411),
    ],
}
# The standard scales the bands of the 9/7 after lifting; ours hold K times its low band and 1/K times its high one.
K = {"5/3": 1.0, "9/7": 1.230174104914001}


@given(
    arrays(np.int32, st.tuples(st.integers(1, 70), st.integers(1, 3)), elements=st.integers(-(2**18), 2**18)),
    st.integers(0, 8),
)
def test_reversible_wavelet_is_undone_exactly(rows, levels):
    there = rows.copy()
    lifting.forward_reversible(there, levels)
    lifting.backward_reversible(there, levels)
    np.testing.assert_array_equal(there, rows)


@given(st.integers(1, 70), st.integers(0, 8), st.sampled_from(["5/3", "9/7"]))
def test_wavelet_is_undone(count, levels, wavelet):
    rows = np.random.default_rng(count).uniform(-128, 128, (count, 3)).astype(np.float32)
    there = rows.copy()
    lifting.forward(there, lifting.steps(wavelet), levels)
    lifting.backward(there, lifting.steps(wavelet), levels)
    np.testing.assert_allclose(there, rows, atol=128 * 2e-5)  # single precision, four steps a level


def synthesis_waveform(wavelet, levels, high):
    """The samples that one coefficient makes, by upsampling and the standard's filters."""
    wave = np.array([1.0])
    for level in range(levels):
        taps = np.array(HIGH[wavelet]) * K[wavelet] if high and level == 0 else np.array(LOW[wavelet]) / K[wavelet]
        spread = np.zeros(2 * len(wave) - 1)
        spread[::2] = wave
        wave = np.convolve(spread, taps)
    return wave


@pytest.mark.parametrize("wavelet", ["5/3", "9/7"])
@pytest.mark.parametrize("levels", [1, 2, 3, 5])
def test_gains_are_those_of_the_standards_filters(wavelet, levels):
    gains = lifting.synthesis_gains(wavelet, levels, 1 << levels)
    assert gains[0] == pytest.approx(np.linalg.norm(synthesis_waveform(wavelet, levels, False)), rel=1e-5)
    for level in range(1, levels + 1):
        high = np.linalg.norm(synthesis_waveform(wavelet, level, True))
        np.testing.assert_allclose(gains[1 << (level - 1) :: 1 << level], high, rtol=1e-5)
