"""`si-lf`: structure, prediction and stream."""

import numpy as np
import pytest

from codec import decode, decode_component, encode
from codec.coders.lf import coder as lf
from codec.coders.lf import ranges, stream
from codec.coders.lf.pyramid import pyramid
from codec.contract import checked_options
from ii_core import IIPicture, sub_images


def shifted_plane(disparity, grid=(5, 5), height=32, width=48, seed=0):
    """A light field of one fronto-parallel plane: view (v, u) shows its texture moved by whole disparities."""
    rng = np.random.default_rng(seed)
    texture = rng.integers(0, 256, (height + 64, width + 64, 3), np.uint8)
    for axis in (0, 1):
        total = texture.astype(int) + np.roll(texture, 1, axis) + np.roll(texture, 2, axis)
        texture = (total // 3).astype(np.uint8)
    down, across = disparity
    field = np.empty((height, grid[0], width, grid[1], 3), np.uint8)
    for v in range(grid[0]):
        for u in range(grid[1]):
            y, x = 32 + down * (v - grid[0] // 2), 32 + across * (u - grid[1] // 2)
            field[:, v, :, u] = texture[y : y + height, x : x + width]
    return IIPicture(field.reshape(height * grid[0], width * grid[1], 3), (width, height), grid[::-1])


@pytest.mark.parametrize("rows", [1, 2, 3, 9, 16, 17])
@pytest.mark.parametrize("cols", [1, 3, 16])
def test_the_pyramid_has_every_view_once_and_refers_to_decoded_ones(rows, cols):
    done = set()
    for level, nodes in enumerate(pyramid(rows, cols, 3, 4, 6)):
        for node in nodes:
            assert node.level == level
            assert (node.row, node.col) not in done
            assert set(node.references) <= done and set(node.sources) <= done
            assert bool(node.references) == bool(done)
            assert len(node.references) <= 4 and len(node.sources) <= 6
            done.add((node.row, node.col))
    assert done == {(row, col) for row in range(rows) for col in range(cols)}


def test_a_view_amid_four_is_predicted_by_them():
    nodes = {(node.row, node.col): node for level in pyramid(9, 9, 3, 4, 6) for node in level}
    assert set(nodes[4, 4].references) == {(0, 0), (0, 8), (8, 0), (8, 8)}
    assert set(nodes[1, 1].references) == {(0, 0), (0, 2), (2, 0), (2, 2)}


@pytest.mark.parametrize(("disparity", "down"), [((3, 3), 1), ((-2, -2), 1), ((2, -2), -1)])
def test_the_range_of_disparity_is_found(disparity, down):
    """If the texture moves by d a column, the next view shows at x - d what this one shows at x."""
    picture = shifted_plane(disparity)
    source = lf._Source(picture, checked_options(lf.LightField(), {}))
    low, high, found = ranges.estimated(source.view, source.grid)
    assert found == down
    assert low <= -256 * disparity[1] <= high
    assert high - low <= 2 * ranges.MARGIN


def test_a_moved_plane_costs_little_more_than_one_view():
    """Twenty-five views of a plane, each moved by whole samples: all but new borders is predicted."""
    field = shifted_plane((2, 2))
    alone = shifted_plane((2, 2), grid=(1, 1))
    coded, single = (encode(picture, "si-lf", qp=20) for picture in (field, alone))
    # The views see 48 % more of the texture than one does, and coarse levels are quantised finer than a lone view.
    assert coded.nbytes < 3.2 * single.nbytes
    error = np.mean((decode(coded).pixels.astype(float) - field.pixels) ** 2)
    assert 10 * np.log10(255**2 / error) > 40


def test_decoding_repeats_the_encoder_to_the_bit():
    """The encoder predicts from what the decoder shows, or errors would grow from level to level."""
    picture = shifted_plane((1, 1), grid=(4, 3))
    options = checked_options(lf.LightField(), {})
    source = lf._Source(picture, options)
    payload, encoded = source.coded(30 * lf.FRACTIONS)
    header, levels = stream.unpack(payload, picture.pixels.size // 3)
    field = lf.Field(header, source.grid, source.height, source.width)
    for _ in lf.decoded_views(field, levels):
        pass
    np.testing.assert_array_equal(field.views, encoded.views)
    np.testing.assert_array_equal(field.disparities, encoded.disparities)


@pytest.mark.parametrize("name", ["empty", "short", "long"])
def test_a_payload_of_another_length_is_refused(name):
    picture = shifted_plane((1, 1), grid=(2, 2))
    payload = encode(picture, "si-lf:fast", qp=40).payload
    damaged = {"empty": b"", "short": payload[:-3], "long": payload + b"\x01"}[name]
    with pytest.raises(ValueError, match="its light field has"):
        stream.unpack(damaged, picture.pixels.size // 3)


def test_few_bytes_do_not_claim_a_large_picture():
    picture = shifted_plane((1, 1), grid=(2, 2))
    payload = encode(picture, "si-lf:fast", qp=40).payload
    with pytest.raises(ValueError, match="too few for"):
        stream.unpack(payload, 1 << 31)


@pytest.mark.parametrize("place", [(0, 0), (2, 1), (4, 3)])
def test_one_view_alone_is_that_of_the_whole(place, monkeypatch):
    """And what is decoded for it are the levels above and a part of its own."""
    picture = shifted_plane((1, 1), grid=(4, 5))
    coded = encode(picture, "si-lf", qp=34)
    decoded = []
    original = lf.decode_view
    monkeypatch.setattr(lf, "decode_view", lambda *given: decoded.append(1) or original(*given))
    alone = decode_component(coded, place)
    nodes = [(node.col, node.row) for level in pyramid(4, 5, 3, 4, 6) for node in level]
    assert len(decoded) == nodes.index(place) + 1
    np.testing.assert_array_equal(alone, sub_images(decode(coded))[place[1], place[0]])


@pytest.mark.parametrize("level", [0, 1, 2, 3])
def test_a_level_that_ends_early_is_named(level):
    picture = shifted_plane((1, 1), grid=(9, 9))
    payload = encode(picture, "si-lf:fast", qp=12).payload
    header, levels = stream.unpack(payload, picture.pixels.size // 3)
    levels[level] = levels[level][: len(levels[level]) // 3]
    damaged = stream.pack(header, levels, picture.pixels.size // 3)
    blank = picture.with_pixels(np.zeros_like(picture.pixels))
    with pytest.raises(ValueError, match=f"level {level} of its light field ends early"):
        lf.LightField().decode(damaged, blank, checked_options(lf.LightField(), {}))


def test_numbers_of_sixteen_bits_keep_more_than_eight():
    """PSNR at the finest quantiser: an 8-bit picture has 58.9 dB at best."""
    rng = np.random.default_rng(4)
    pixels = rng.integers(0, 65536, (32, 48, 3)).astype(np.uint16)
    picture = IIPicture(pixels, (12, 8), (4, 4))
    decoded = decode(encode(picture, "si-lf", qp=0))
    error = np.mean((decoded.pixels.astype(float) - pixels) ** 2)
    assert 10 * np.log10(65535**2 / error) > 52


def test_too_many_views_are_refused_before_long_work():
    picture = IIPicture(np.zeros((256, 256, 3), np.uint8), (1, 1), (256, 256))
    with pytest.raises(ValueError, match="the picture has 256×256 views: at most 16384"):
        encode(picture, "si-lf", qp=30)
