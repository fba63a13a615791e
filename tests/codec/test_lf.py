"""`si-lf`: structure, prediction and stream."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from codec import decode, decode_component, decode_levels, decode_view, encode
from codec.coders.lf import coder as lf
from codec.coders.lf import planes, ranges, stream
from codec.coders.lf.pyramid import pyramid
from codec.contract import checked_options
from ii_core import IIPicture, sub_images
from metrics import q_ctc_psnr, q_global
from tests.support.slow import first_fast


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
        # Views of one phase do not predict each other: they are coded at the same time.
        phase_of = {(node.row, node.col): node.phase for node in nodes}
        for node in nodes:
            assert all(phase_of.get(place, -1) < node.phase for place in (*node.references, *node.sources))
    assert done == {(row, col) for row in range(rows) for col in range(cols)}


def test_a_view_amid_four_is_predicted_by_them():
    nodes = {(node.row, node.col): node for level in pyramid(9, 9, 3, 4, 6) for node in level}
    assert not nodes[4, 4].references and nodes[4, 4].level == 0
    assert set(nodes[2, 2].references) == {(0, 0), (0, 4), (4, 0), (4, 4)}
    assert set(nodes[1, 1].references) == {(0, 0), (0, 2), (2, 0), (2, 2)}


def test_the_axes_are_those_of_detail_not_of_areas():
    """Sky above ground differ in blue; all texture is along (2, 1, 1)."""
    rng = np.random.default_rng(3)
    light = rng.integers(-20, 20, (24, 3, 32, 3, 1))
    area = np.where(np.arange(24)[:, None, None, None, None] < 12, [0, 0, 60], [0, 0, -60])
    pixels = (128 + area + light * [2, 1, 1]).astype(np.uint8).reshape(72, 96, 3)
    axes = planes.detail_axes(pixels, (3, 3)) / (1 << 14)
    # One of 24 differences down is that of the areas: it turns the axis by less than 9 degrees.
    assert axes[0] @ [2, 1, 1] / 6**0.5 > 0.988
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-4)


def test_views_of_one_sample_have_axes():
    """Such views have no neighbouring samples."""
    axes = planes.detail_axes(np.full((3, 4, 3), 7, np.uint8), (3, 4)) / (1 << 14)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-4)


@pytest.mark.parametrize(("disparity", "down"), [((3, 3), 1), ((-2, -2), 1), ((2, -2), -1)])
def test_the_range_of_disparity_is_found(disparity, down):
    """If the texture moves by d a column, the next view shows at x - d what this one shows at x."""
    picture = shifted_plane(disparity)
    source = lf.Source(picture, checked_options(lf.LightField(), {}))
    low, high, lattice = ranges.estimated(source.view, source.grid)
    assert lattice == (0, 0, down * stream.UPRIGHT)
    assert low <= -256 * disparity[1] <= high
    # Zero is always within the range; beyond it and beyond the disparity there is at most the margin.
    assert low >= min(0, -256 * disparity[1]) - ranges.MARGIN
    assert high <= max(0, -256 * disparity[1]) + ranges.MARGIN


@pytest.mark.slow
def test_disparities_of_the_sides_are_within_the_range():
    """A plane of disparity 4 that the middle view does not show: it is flat there."""
    moved = shifted_plane((4, 4), grid=(7, 7), height=48, width=48)
    pixels = moved.pixels.copy().reshape(48, 7, 48, 7, 3)
    pixels[:, 2:5, :, 2:5] = 90
    source = lf.Source(moved.with_pixels(pixels.reshape(336, 336, 3)), checked_options(lf.LightField(), {}))
    low, high, _ = ranges.estimated(source.view, source.grid)
    assert low <= -4 * 256 and high == ranges.MARGIN


def test_flat_sky_determines_no_disparity():
    """Above a textured ground that does not move, flat sky fits at every disparity."""
    field = shifted_plane((0, 0), grid=(3, 3), height=48, width=48)
    pixels = field.pixels.copy().reshape(48, 3, 48, 3, 3)
    sky = 200 + np.random.default_rng(7).integers(-1, 2, (24, 3, 48, 3, 3))
    pixels[:24] = sky
    source = lf.Source(field.with_pixels(pixels.reshape(144, 144, 3)), checked_options(lf.LightField(), {}))
    low, high, _ = ranges.estimated(source.view, source.grid)
    assert (low, high) == (-ranges.MARGIN, ranges.MARGIN)


def test_small_things_before_a_far_ground_are_within_the_range():
    """A ground that moves by nine samples a view, and a sticker of 6×6 that does not move."""
    ground = shifted_plane((9, 9), grid=(3, 3), height=48, width=48)
    pixels = ground.pixels.copy().reshape(48, 3, 48, 3, 3)
    pixels[20:26, :, 20:26] = np.random.default_rng(5).integers(0, 256, (6, 1, 6, 1, 3))
    source = lf.Source(ground.with_pixels(pixels.reshape(144, 144, 3)), checked_options(lf.LightField(), {}))
    low, high, _ = ranges.estimated(source.view, source.grid)
    assert low <= -9 * 256 <= 0 <= high


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
    """The encoder predicts from decoded views; else errors would grow from level to level."""
    picture = shifted_plane((1, 1), grid=(4, 3))
    options = checked_options(lf.LightField(), {})
    source = lf.Source(picture, options)
    payload, encoded = source.coded(30 * lf.FRACTIONS)
    header, levels = stream.unpack(payload, picture.pixels.size // 3)
    field = lf.Field(header, source.grid, source.height, source.width, np.uint8)
    for _ in lf.decoded_batches(field, levels):
        pass
    np.testing.assert_array_equal(field.views, encoded.views)
    np.testing.assert_array_equal(field.disparities, encoded.disparities)


@pytest.mark.parametrize("scheme", ["si-lf", "si-lf:lossless=1"])
def test_threads_change_no_byte(scheme):
    picture = shifted_plane((1, 1), grid=(5, 4))
    goal = {} if "lossless" in scheme else {"qp": 30}
    joint = "," if ":" in scheme else ":"
    one, two = (encode(picture, f"{scheme}{joint}threads={threads}", **goal) for threads in (1, 2))
    assert one.payload == two.payload
    np.testing.assert_array_equal(decode(one).pixels, decode(two).pixels)


def coloured_noise(seed=2):
    """Return unrelated views with one colour per quarter: the mean axis is that of none of them."""
    rng = np.random.default_rng(seed)
    light = rng.normal(0, 30, (32, 3, 48, 3, 1))
    colours = np.array([[1, 1, 1], [1, 0.6, 0], [0, 0.6, 1], [0.8, 0, 0.6]])
    quarter = 2 * (np.arange(32)[:, None] < 16) + (np.arange(48) < 24)
    pixels = np.clip(128 + light * colours[quarter][:, None, :, None], 0, 255).astype(np.uint8)
    return IIPicture(pixels.reshape(96, 144, 3), (48, 32), (3, 3))


def test_colours_follow_from_the_first_plane():
    """Colours that lie on a line in each block cost little: 6.6 kB where they are coded alone in 10.4."""
    picture = coloured_noise()
    crossed, plain = (encode(picture, f"si-lf:tune=rgb,cross={cross}", qp=34) for cross in (1, 0))
    errors = [np.mean((decode(coded).pixels.astype(float) - picture.pixels) ** 2) for coded in (crossed, plain)]
    assert crossed.nbytes < 0.75 * plain.nbytes
    assert errors[0] < errors[1]


def test_lossless_streams_without_factors_are_of_the_second_version():
    """The decoder reads both; of others, flags of the header say which tools they have."""
    picture = coloured_noise()
    for cross, version in (0, stream.UNCROSSED), (1, stream.VERSION):
        coded = encode(picture, f"si-lf:fast,cross={cross},lossless=1")
        assert coded.payload[0] == version
        np.testing.assert_array_equal(decode(coded).pixels, picture.pixels)


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


@pytest.mark.parametrize("place", first_fast([((2, 1),), ((0, 0),), ((4, 3),), ((2, 2),)]))
def test_one_view_alone_is_that_of_the_whole(place):
    """Only the levels above and a part of its own level are decoded."""
    picture = shifted_plane((1, 1), grid=(4, 5))
    coded = encode(picture, "si-lf", qp=34)
    alone = decode_view(coded, place)
    levels = pyramid(4, 5, 3, 4, 4)
    level = next(i for i, nodes in enumerate(levels) if place in [(node.col, node.row) for node in nodes])
    above = sum(map(len, levels[:level]))
    assert above < alone.views_decoded <= above + len(levels[level])
    assert alone.bytes_read <= alone.payload_bytes == len(coded.payload)
    np.testing.assert_array_equal(alone.pixels, sub_images(decode(coded))[place[1], place[0]])
    np.testing.assert_array_equal(decode_component(coded, place), alone.pixels)


def test_the_middle_view_takes_few_bytes():
    coded = encode(shifted_plane((1, 1), grid=(5, 5)), "si-lf", qp=20)
    cost = decode_view(coded, (2, 2))
    assert cost.views_decoded == 1
    payload = coded.payload[: cost.bytes_read] + bytes(len(coded.payload) - cost.bytes_read)
    damaged = replace(coded, payload=payload)
    np.testing.assert_array_equal(decode_view(damaged, (2, 2)).pixels, cost.pixels)


def test_a_view_beyond_the_grid_is_refused():
    coded = encode(shifted_plane((1, 1), grid=(2, 2)), "si-lf:fast", qp=40)
    with pytest.raises(ValueError, match=r"place is \(2, 0\): there are 2×2 views"):
        decode_view(coded, (2, 0))


@pytest.mark.parametrize("scheme", ["si-lf", "si-lf:lossless=1"])
def test_levels_come_nearer_to_the_picture(scheme):
    """The last level is the decoded picture."""
    picture = shifted_plane((1, 1), grid=(5, 5))
    coded = encode(picture, scheme, **({} if "lossless" in scheme else {"qp": 24}))
    stages = list(decode_levels(coded))
    assert stages[0].decoded.sum() == 1 and stages[0].decoded[2, 2]
    assert stages[-1].decoded.all()
    np.testing.assert_array_equal(stages[-1].picture.pixels, decode(coded).pixels)
    errors = [np.mean((stage.picture.pixels.astype(float) - picture.pixels) ** 2) for stage in stages]
    assert all(later < earlier for earlier, later in pairwise(errors))
    read = [stage.bytes_read for stage in stages]
    assert read == sorted(read) and read[-1] <= len(coded.payload)
    first = sub_images(stages[0].picture)
    np.testing.assert_array_equal(first[0, 0], first[2, 2])


def test_other_schemes_have_no_levels():
    coded = encode(shifted_plane((1, 1), grid=(2, 2)), "jpegxl:lossless=1")
    with pytest.raises(ValueError, match="scheme jpegxl codes no levels: only si-lf does"):
        next(decode_levels(coded))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("grid", [(1, 1), (3, 4)])
def test_lossless_keeps_every_bit(dtype, grid):
    """Noise, a plane and the extreme codes; sides that are no multiples of 4."""
    rng = np.random.default_rng(6)
    top = np.iinfo(dtype).max
    pixels = shifted_plane((1, 1), grid=grid, height=13, width=18).pixels.astype(dtype) * (top // 255)
    pixels[: 5 * grid[0]] = rng.integers(0, top + 1, pixels[: 5 * grid[0]].shape)
    pixels[-2:] = rng.choice([0, top], pixels[-2:].shape)
    picture = IIPicture(pixels, (18, 13), grid[::-1])
    coded = encode(picture, "si-lf:lossless=1")
    np.testing.assert_array_equal(decode(coded).pixels, pixels)
    np.testing.assert_array_equal(decode_component(coded, (0, 0)), sub_images(picture)[0, 0])


def test_lossless_takes_less_than_general_coders():
    """A textured plane with noise of one code, whose entropy of 2.05 bits per sample no coder can save."""
    picture = shifted_plane((1, 1), grid=(5, 5))
    noise = np.random.default_rng(8).standard_normal(picture.pixels.shape)
    pixels = np.clip(np.rint(picture.pixels * 0.8 + 20 + noise), 0, 255).astype(np.uint8)
    noisy = picture.with_pixels(pixels)
    ours = encode(noisy, "si-lf:lossless=1").bpp
    assert 3 * 2.05 < ours
    assert ours < 0.8 * min(encode(noisy, scheme).bpp for scheme in ("si-ffv1", "jpegxl:lossless=1"))


@pytest.mark.parametrize("tune", ["rgb", "ctc"])
@pytest.mark.parametrize("quality", first_fast([41.5, 30]))
def test_a_quality_is_met_by_the_measure_that_is_tuned_for(quality, tune):
    picture = shifted_plane((1, 1), grid=(3, 3))
    coded = encode(picture, f"si-lf:fast,tune={tune}", quality=quality)
    measure = q_ctc_psnr(picture, decode(coded)).mean if tune == "ctc" else q_global(picture, decode(coded))
    # The quantisers' fractions are sixteenths, of 0.06 dB each.
    assert measure == pytest.approx(quality, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("level", range(5))
def test_a_level_that_ends_early_is_named(level):
    picture = shifted_plane((1, 1), grid=(9, 9))
    noise = np.random.default_rng(3).normal(0, 3, picture.pixels.shape)  # without it some levels have eight bytes
    picture = picture.with_pixels(np.clip(picture.pixels + noise, 0, 255).astype(np.uint8))
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


@pytest.mark.slow
def test_large_views_are_searched_further():
    """At full size, 0.22 bits a sample are more than most blocks cost: nothing but synthesis was tried."""
    assert threshold(128, 64) == threshold(16, 8) == pytest.approx(lf.GOOD[2])
    assert threshold(512, 256) == pytest.approx(lf.GOOD[2] / 16)
    assert threshold(513, 256) < threshold(512, 256)


def threshold(width, height):
    """Cost in bits a sample below which a block of views of this size is tried in no other way."""
    picture = IIPicture(np.zeros((2 * height, 2 * width, 3), np.uint8), (width, height), (2, 2))
    source = lf.Source(picture, checked_options(lf.LightField(), {}))
    field = source.field(replace(source.header, steps=source.steps(480)))
    job, _ = field.job(field.levels[0][0])
    return float(source._search(job, source.view(0, 0)).good)
