"""Groups of elementary images by a 3-D cosine transform: round trips, rate and damage."""

import numpy as np
import pytest

from codec import Encoded, decode, encode
from codec.coders.forman import parts
from ii_core import IIPicture


def textured(lenses, ei_pixels, dtype=np.uint8, seed=0):
    """Smooth elementary images that change slowly from lens to lens."""
    rng = np.random.default_rng(seed)
    height, width = lenses[1] * ei_pixels[1], lenses[0] * ei_pixels[0]
    y, x = np.mgrid[:height, :width]
    lens_x, at_x, at_y = x // ei_pixels[0], x % ei_pixels[0], y % ei_pixels[1]
    shade = 0.5 + 0.3 * np.sin(at_x / 3 + lens_x / 6) * np.cos(at_y / 4 + y / 40) + 0.01 * rng.random((height, width))
    pixels = np.stack([shade, 1 - shade, shade**2], axis=-1) * np.iinfo(dtype).max
    return IIPicture(pixels.astype(dtype), lenses, ei_pixels)


def psnr(a, b):
    top = np.iinfo(a.pixels.dtype).max
    error = np.mean((a.pixels.astype(float) - b.pixels) ** 2)
    return 10 * np.log10(top**2 / max(error, 1e-9))


@pytest.mark.parametrize(
    ("lenses", "ei_pixels"),
    [((1, 1), (1, 1)), ((9, 1), (8, 24)), ((5, 3), (9, 5)), ((8, 2), (16, 16)), ((3, 7), (2, 1))],
)
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_any_structure_comes_back(lenses, ei_pixels, dtype):
    """The error of a uniform quantiser with a step of half a code is 54 dB; rounding and 8 bits add to it."""
    picture = textured(lenses, ei_pixels, dtype)
    assert psnr(picture, decode(encode(picture, "ei-dct3d", qp=0))) > 50


def test_the_third_dimension_lowers_the_rate():
    """Against the same transform of single elementary images, at the same step and within 0.5 dB."""
    picture = textured((16, 4), (16, 16))
    flat, deep = (encode(picture, f"ei-dct3d:group={group}", qp=20) for group in (1, 8))
    assert psnr(picture, decode(deep)) > psnr(picture, decode(flat)) - 0.5
    assert deep.nbytes < 0.7 * flat.nbytes


def test_a_rate_is_met():
    picture = textured((16, 4), (16, 16))
    assert encode(picture, "ei-dct3d", bpp=1.0).bpp == pytest.approx(1.0, rel=0.02)


def test_parts_are_nearly_equal():
    assert parts(9, 8).tolist() == [0, 4, 9]
    assert parts(16, 8).tolist() == [0, 8, 16]
    assert parts(1, 8).tolist() == [0, 1]


@pytest.mark.parametrize("keep", [10, 60])
def test_a_stream_that_ends_early_is_refused(keep):
    picture = textured((8, 4), (16, 16))
    coded = encode(picture, "ei-dct3d", qp=4)
    cut = Encoded(**{**vars(coded), "payload": coded.payload[:keep]})
    with pytest.raises(ValueError, match="its stream"):
        decode(cut)
