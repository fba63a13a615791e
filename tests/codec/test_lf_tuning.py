"""What `si-lf` is tuned for: planes of BT.709, their scales, the header of version 7, the loop filter."""

from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.lib.stride_tricks import sliding_window_view
from skimage import data

import assets
from benchmarks.coding import learnt_filter
from codec import decode, encode
from codec.coders.lf import (
    arithmetic,
    contexts,
    denoise,
    learnt,
    loop_filter,
    loop_filter_search,
    planes,
    ranges,
    rig,
    rig_search,
    stream,
)
from codec.coders.lf import coder as lf
from codec.coders.lf.field import NO_GUESS
from codec.coders.lf.state import CODED, FIELDS, TALL, WIDE
from codec.contract import checked_options
from ii_core import IIPicture, sub_images
from metrics import bd_rate, q_ctc_psnr, q_global
from tests.codec.test_lf import shifted_plane
from tests.support.slow import first_fast


@pytest.mark.parametrize("scales", [(64, 64), (35, 20), (12, 255), (1, 1)])
def test_colours_invert_the_axes(scales):
    axes, colours = planes.bt709_axes(scales) / (1 << 14), planes.bt709_colours(scales) / (1 << 14)
    # Rows of the axes of small scales are rounded to 2^-14 and have magnitudes of about the scale over 64.
    np.testing.assert_allclose(axes @ colours.T, np.eye(3), atol=2e-2 / min(scales))


def test_grey_has_the_same_length_by_both_tunings():
    grey = np.ones(3)
    assert planes.bt709_axes((35, 35)) @ grey / (1 << 14) == pytest.approx([3**0.5, 0, 0], abs=1e-4)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_the_measure_is_that_of_the_test_conditions(dtype):
    rng = np.random.default_rng(1)
    top = np.iinfo(dtype).max
    original = shifted_plane((1, 1), grid=(2, 3), height=8, width=12)
    original = original.with_pixels(original.pixels.astype(dtype) * (top // 255))
    noise = np.rint(rng.normal(0, top / 60, original.pixels.shape))
    decoded = original.with_pixels(np.clip(original.pixels + noise, 0, top).astype(dtype))
    pairs = zip(sub_images(original).reshape(-1, 8, 12, 3), sub_images(decoded).reshape(-1, 8, 12, 3), strict=True)
    ours = [planes.psnr_yuv(a, b) for a, b in pairs]
    np.testing.assert_allclose(ours, q_ctc_psnr(original, decoded).values.ravel(), rtol=1e-9)


def test_planes_are_scaled_so_that_errors_count_as_the_measure_counts_them():
    """Of Y with twice the error, Cb's squared error changes the mean of logarithms by 2/6 of what Y's does."""
    scales = 40, 40  # squares of errors in planes: 3 of Y, 3 · (40/64)² of Cb and Cr
    errors = np.array([3 * 2e6, 3 * (40 / 64) ** 2 * 1e6, 3 * (40 / 64) ** 2 * 2e6])
    for views, more in [(1, 1), (25, 1), (45, 1.3**0.5), (81, 1.3), (256, 1.3)]:
        found = np.array(planes.better_scales(scales, errors, views))
        np.testing.assert_allclose((found / 64) ** 2, np.multiply([2 / 6 / 1, 2 / 6 / 2], more**2), rtol=0.05)
    assert planes.better_scales(scales, np.array([1e6, 0, 1e12]), 25) == (planes.MOST_SCALE, planes.LEAST_SCALE)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_grey_pictures_are_tuned_by_rgb(dtype):
    picture = shifted_plane((1, 1), grid=(3, 2), height=11, width=17)
    grey = picture.with_pixels(np.repeat(picture.pixels[..., 1:2].astype(dtype), 3, axis=2))
    by_default, by_rgb = (encode(grey, scheme, qp=30) for scheme in ("si-lf", "si-lf:tune=rgb"))
    assert by_default.payload == by_rgb.payload
    assert stream.unpack(by_default.payload, grey.pixels.size // 3)[0].scales is None


@pytest.mark.slow
def test_each_tuning_is_better_by_its_own_measure():
    """Unrelated views with much colour, at sizes that differ by less than the measures do."""
    rng = np.random.default_rng(3)
    noise = rng.normal(0, 25, (24, 3, 32, 3, 3))
    for axis in (0, 2):
        noise = (noise + np.roll(noise, 1, axis)) / 2**0.5
    picture = IIPicture(np.clip(128 + noise, 0, 255).astype(np.uint8).reshape(72, 96, 3), (32, 24), (3, 3))
    ctc = encode(picture, "si-lf", qp=34)
    rgb = encode(picture, "si-lf:tune=rgb", bpp=ctc.bpp)
    assert q_ctc_psnr(picture, decode(ctc)).mean > q_ctc_psnr(picture, decode(rgb)).mean + 1
    assert q_global(picture, decode(ctc)) < q_global(picture, decode(rgb)) - 1


@settings(max_examples=60, deadline=None)
@given(
    st.tuples(st.integers(0, 6), st.integers(0, 8), st.sampled_from([0, 2, 3])),
    st.sampled_from([(0, 0, 1024), (0, 0, -1024)]) | st.tuples(*2 * [st.integers(-4096, 4096)], st.integers(1, 4096)),
    st.tuples(st.booleans(), st.booleans()),
    st.none() | st.tuples(st.integers(1, 255), st.integers(1, 255)),
    st.sampled_from(stream.FLAGGED),
    st.integers(0, 2**32 - 1),
)
def test_headers_are_read_as_they_were_written(numbers, lattice, tools, scales, version, seed):
    rng = np.random.default_rng(seed)
    log_stride, sources, crossed = numbers
    low, high = sorted(rng.integers(-(1 << 14), (1 << 14) + 1, 2).tolist())
    header = stream.Header(
        log_stride=log_stride,
        sources=sources,
        exact=False,
        lattice=lattice,
        low=low,
        high=high,
        colours=planes.bt709_colours(scales)
        if scales
        else rng.integers(-(1 << 15), 1 << 15, (3, 3)).astype(np.int32),
        scales=scales,
        crossed=crossed,
        skipping=tools[0],
        tuned=True,
        filtered=tools[1],
        dependent=version > stream.TUNED,
        directed=version > stream.DEPENDENT,
        parted=version > stream.DIRECTED,
        refined=version >= stream.REFINED,
        limited=version >= stream.LIMITED,
        guided=version >= stream.GUIDED,
        learnt=version >= stream.LEARNT,
        rig=rng.bytes(int(rng.integers(1, 300))) if version >= stream.RIGGED else b"",
        steps=tuple(rng.integers(1, (1 << 18) + 1, log_stride + 2).tolist()),
    )
    levels = [rng.bytes(int(rng.integers(0, 300))) for _ in header.steps]
    payload = stream.pack(header, levels, 1000)
    found, parts = stream.unpack(payload, 1000)
    assert parts == levels and stream.head_bytes(found, parts) == len(payload) - sum(map(len, levels))
    for name in header.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(found, name), getattr(header, name))


@pytest.mark.parametrize(
    ("at", "value"), [(1, 32 | 128), (1, 128 | 1), (1, 32 | 1), (2, 7), (2, 3 | 9 << 3), (7, 0), (8, 0)]
)
def test_headers_that_no_encoder_writes_are_refused(at, value):
    picture = shifted_plane((1, 1), grid=(2, 2))
    payload = bytearray(encode(picture, "si-lf:fast", qp=40).payload)
    payload[at] = value
    with pytest.raises(ValueError, match=r"values that no encoder writes|its light field has"):
        stream.unpack(bytes(payload), picture.pixels.size // 3)


def test_a_header_that_ends_early_is_refused():
    payload = encode(shifted_plane((1, 1), grid=(2, 2)), "si-lf:fast", qp=40).payload
    for length in range(1, 20):
        with pytest.raises(ValueError, match="its light field has"):
            stream.unpack(payload[:length], length)


def turned_plane(turn, grid=(5, 5), height=40, width=48, step=5.0):
    """A plane seen from a grid of cameras, turned against their pixels by ``turn`` rad, and 1.1 times as high."""
    rng = np.random.default_rng(4)
    waves = rng.normal(0, 1, (40, 2)) * 0.35
    phases, colours = rng.uniform(0, 6, 40), rng.normal(0, 12, (40, 3))
    field = np.empty((height, grid[0], width, grid[1], 3))
    for v in range(grid[0]):
        for u in range(grid[1]):
            x = np.arange(width) + step * (u * np.cos(turn) - 1.1 * v * np.sin(turn))
            y = np.arange(height) + step * (u * np.sin(turn) + 1.1 * v * np.cos(turn))
            angles = waves[:, 0] * x[:, None] + waves[:, 1] * y[:, None, None] + phases
            field[:, v, :, u] = 128 + np.sin(angles) @ colours
    pixels = np.clip(field, 0, 255).astype(np.uint8).reshape(height * grid[0], width * grid[1], 3)
    return IIPicture(pixels, (width, height), grid[::-1])


@pytest.mark.slow
def test_views_of_a_turned_grid_are_predicted(monkeypatch):
    """The lattice is found, and saves a third of the bytes."""
    picture = turned_plane(0.06)
    source = lf.Source(picture, checked_options(lf.LightField(), {}))
    # How far a column leads across is the unit.
    np.testing.assert_allclose(np.array(source.header.lattice) / 1024, [-0.066, 0.06, 1.1], atol=0.012)
    turned = encode(picture, "si-lf", qp=26)
    shown = np.empty_like(picture.pixels)
    payload, field = source.coded(26 * lf.FRACTIONS)
    field.show(shown)
    assert payload == turned.payload
    np.testing.assert_array_equal(decode(turned).pixels, shown)
    monkeypatch.setattr(ranges, "FAR", 1 << 20)
    assert turned.nbytes < 0.7 * encode(picture, "si-lf", qp=26).nbytes


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 30), st.sampled_from([0, 1, 40, rig.MOST]), st.integers(0, 2**32 - 1))
def test_entries_of_a_rig_are_read_as_they_were_written(views, most, seed):
    rng = np.random.default_rng(seed)
    entries, middle = rng.integers(-most, most + 1, (views, rig.FIELDS)), int(rng.integers(views))
    entries[middle] = 0
    np.testing.assert_array_equal(rig.unpack(rig.pack(entries, middle), views, middle), entries)


def test_a_damaged_rig_is_refused():
    with pytest.raises(ValueError, match="places of its views"):
        rig.unpack(b"", 600, 0)
    with pytest.raises(ValueError, match="places of its views"):
        rig.unpack(rig.pack(np.full((3, rig.FIELDS), 2 * rig.MOST), 1), 3, 1)


def test_references_depart_as_defined():
    """Places in 2^-8 of a view; shifts in 2^-5 samples, which grow by as much over half the longer side."""
    entries = np.zeros((3, rig.FIELDS), np.int64)
    entries[0], entries[2] = (3, -2, 16, 0, 32, 0, 0, -64), (0, 1, 0, -8, 0, 0, 0, 0)
    found = rig.departing(np.array([[0, -1024, 0], [1, 0, 1024]]), 2, [0, 1], rig.rig(entries, 64, 128))
    np.testing.assert_array_equal(found[:, :3], [[0, -1024 + 12, -12], [1, 0, 1024 - 4]])
    shifts = found[:, 3:].reshape(2, 2, 4, 2)  # of references, and of squares down and across
    middles = np.array([-48, -16, 16, 48]) / 64
    np.testing.assert_array_equal(shifts[0, :, :, 0], 128 + 256 * np.tile(middles, (2, 1)))
    np.testing.assert_array_equal(shifts[0, :, :, 1], 64 - 512 * np.tile([[-16 / 64], [16 / 64]], 4))
    np.testing.assert_array_equal(shifts[1], np.broadcast_to([0, 64], (2, 4, 2)))


def moved_planes(entries, grid=(5, 5), height=96, width=104, seed=4):
    """Two planes beside each other, of disparities 2 and -1.5, by cameras that depart from their places."""
    rng = np.random.default_rng(seed)
    waves, phases, colours = rng.normal(0, 0.3, (40, 2)), rng.uniform(0, 6, 40), rng.normal(0, 12, (40, 3))
    field, side = np.empty((height, grid[0], width, grid[1], 3)), max(height, width)
    y, x = np.mgrid[:height, :width]
    for at, (v, u) in enumerate(np.ndindex(grid)):
        place_x, place_y, *moved = entries[at] / [256, 256, *6 * [32]]
        by_x, by_y = (2 * x - width) / side, (2 * y - height) / side
        # The pixel of the middle view that lies here, approximately: departures are small.
        back_x = x - moved[0] - moved[2] * by_x - moved[3] * by_y
        back_y = y - moved[1] - moved[4] * by_x - moved[5] * by_y
        disparity = np.where(y < height // 2, 2.0, -1.5)
        back_x, back_y = back_x - disparity * (u - 2 + place_x), back_y - disparity * (v - 2 + place_y)
        angles = waves[:, 0] * back_x[..., None] + waves[:, 1] * back_y[..., None] + phases
        field[:, v, :, u] = 128 + np.sin(angles) @ colours
    pixels = np.clip(np.rint(field), 0, 255).astype(np.uint8).reshape(height * grid[0], width * grid[1], 3)
    return IIPicture(pixels, (width, height), grid[::-1])


@pytest.mark.slow
def test_views_beside_their_places_are_predicted(monkeypatch):
    """Their entries are found, and save a third of the bytes; decoding repeats the encoder."""
    entries = np.random.default_rng(7).normal(0, [12, 12, 16, 16, 8, 8, 8, 8], (25, 8))
    entries[12] = 0
    picture = moved_planes(entries)
    source = lf.Source(picture, checked_options(lf.LightField(), {}))
    payload, field = source.coded(32 * lf.FRACTIONS)
    assert payload[0] == stream.LEARNT and payload[1] & 128
    found = rig.unpack(source.header.rig, 25, 12)
    shown = np.empty_like(picture.pixels)
    field.show(shown)
    coded = encode(picture, "si-lf", qp=32)
    assert coded.payload == payload
    np.testing.assert_array_equal(decode(coded).pixels, shown)
    np.testing.assert_array_less(np.abs(found - entries).mean(axis=0), 5)
    monkeypatch.setattr(rig_search, "departures", lambda *_: None)
    plain = encode(picture, "si-lf", qp=32)
    assert not plain.payload[1] & 128
    assert coded.nbytes < 0.67 * plain.nbytes


@pytest.mark.parametrize("places", [(5, 5), (1, 9)], ids=str)
def test_views_in_their_places_have_no_rig(places):
    picture = moved_planes(np.zeros((places[0] * places[1], 8)), places)
    assert not lf.Source(picture, checked_options(lf.LightField(), {})).header.rig


def filtered_by_definition(view, modes, taps, limit, guess):
    """The filter by its definition in docs/lf.md, with arrays shifted as a whole."""
    planes_, (height, width) = view.astype(np.int64), view.shape[1:]

    def moved(plane, down, across):
        rows = np.clip(np.arange(height) + down, 0, height - 1)
        return plane[rows][:, np.clip(np.arange(width) + across, 0, width - 1)]

    pairs = [(0, 1), (1, 0), (1, 1), (1, -1), (0, 2), (2, 0)]

    def even(plane):
        return [moved(plane, *by) + moved(plane, -by[0], -by[1]) - 2 * plane for by in pairs]

    curved = sum(abs(difference) for difference in even(planes_[0])[:2])
    across = sum(moved(curved, 0, i) for i in range(-2, 3))
    bins = np.minimum(sum(moved(across, i, 0) for i in range(-2, 3)) // 8, 4095)
    below = np.searchsorted(np.sort(bins, axis=None), bins)  # samples of lower bins
    classes = np.minimum(8 * below // bins.size, 7)
    limited = [
        sum(np.clip(moved(planes_[0], *by) - planes_[0], -limit, limit) for by in (pair, (-pair[0], -pair[1])))
        for pair in pairs
    ]
    out = view.copy()
    for p, mode in enumerate(modes):
        if mode:
            odd = [moved(planes_[p], *by) - moved(planes_[p], -by[0], -by[1]) for by in pairs[:2]]
            found = even(planes_[p]) + odd + (even(planes_[0]) if p else [*limited, guess])
            weights = taps[p].astype(np.int64)[classes * (0, 1, 4, 8)[mode] // 8]
            total = sum(weights[..., i] * difference for i, difference in enumerate(found))
            out[p] = np.clip(planes_[p] + ((total + 128) >> 8), -8191, 8191)
    return out


@pytest.mark.parametrize("modes", [(1, 2, 3), (3, 1, 2), (2, 3, 0), (0, 0, 1), (3, 3, 3)])
@pytest.mark.parametrize("shape", [(4, 4), (8, 20)])
@pytest.mark.parametrize("limit", [0, 300])
def test_a_view_is_filtered_as_defined(modes, shape, limit):
    rng = np.random.default_rng(sum(modes))
    smooth = np.add.outer(np.arange(shape[0]) ** 2, 9 * np.arange(shape[1]))
    views = (smooth + rng.integers(-800, 800, (2, 3, *shape))).astype(np.int16)
    views[1, :, 0] = rng.choice([-8191, 8191], shape[1])
    filters = loop_filter.new_filters(2)
    filters.modes[1] = modes
    filters.taps[1] = rng.integers(-127, 128, filters.taps[1].shape)
    guess = rng.integers(-100, 100, shape, np.int32) if limit else np.zeros((0, 0), np.int32)
    expected = filtered_by_definition(views[1], modes, filters.taps[1], limit, guess if limit else 0)
    other = views[0].copy()
    loop_filter.filter_view(views, 1, filters, np.int32(limit), guess, *loop_filter.memory(*shape))
    np.testing.assert_array_equal(views[1], expected)
    np.testing.assert_array_equal(views[0], other)


@pytest.mark.parametrize("own", [loop_filter.OWN, loop_filter.COMMON, loop_filter.TAPS])
def test_filters_are_read_as_they_were_written(own):
    """Several views: not filtered, with new filters in each precision, and with those before."""
    rng = np.random.default_rng(9)
    written, read = loop_filter.new_filters(12), loop_filter.new_filters(12)
    coder = arithmetic.writer(contexts.starting_contexts(), 1 << 16)
    for view in range(12):
        same = int(rng.integers(8)) if view else 0
        for p in range(3):
            mode = written.modes[view, p] = rng.integers(4)
            taps, shift = loop_filter.COMMON if p else own, int(rng.integers(4))
            values = rng.integers(-(127 >> shift), (127 >> shift) + 1, (loop_filter.COUNTS[mode], taps)) << shift
            written.taps[view, p, : len(values), :taps] = values
        loop_filter.code_filter(coder, written, view, same, own)
    reader = arithmetic.reader(contexts.starting_contexts(), arithmetic.finish(coder))
    for view in range(12):
        loop_filter.code_filter(reader, read, view, 0, own)
    for one, other in zip(written, read, strict=True):
        np.testing.assert_array_equal(one, other)


def test_least_squares_undo_a_blur_and_the_gain_is_the_error_that_they_save():
    rng = np.random.default_rng(2)
    original = rng.normal(0, 300, (3, 40, 48)).astype(np.int16)
    sums = sum(np.roll(original, i, axis).astype(int) for i in (-1, 1) for axis in (1, 2))
    views = ((4 * original.astype(int) + sums) // 8).astype(np.int16)[None]
    before = np.square(views[0].astype(float) - original).sum(axis=(1, 2))
    weight = 2000.0
    found = loop_filter_search.search_filters(views, 0, original, np.int32(0), NO_GUESS, weight)
    filters = loop_filter.new_filters(1)
    filters.modes[0], filters.taps[0] = found.modes, found.taps
    loop_filter.filter_view(views, 0, filters, np.int32(0), NO_GUESS, *loop_filter.memory(40, 48))
    saved = before - np.square(views[0].astype(float) - original).sum(axis=(1, 2))
    assert (saved > 0.4 * before).all()
    # Bits of three filters of 8 to 14 taps lie between 10 and 2000; rounding adds 1/12 a sample.
    assert ((saved - np.array(found.gains)) / weight > 10).all()
    assert ((saved - np.array(found.gains)) / weight < 2000).all()


def test_limited_differences_take_noise_beside_an_edge_and_leave_the_edge():
    """Rings of 1600 with noise of 16: a filter with limited differences leaves a third of what others leave."""
    rng = np.random.default_rng(3)
    rings = np.hypot(*np.mgrid[-24:24, -32:32]) % 24 < 12
    original = np.stack([np.where(rings, 800, -800)] * 3).astype(np.int16)
    noisy = (original + np.rint(rng.normal(0, 16, original.shape))).astype(np.int16)
    left = []
    for limit in np.int32(0), np.int32(40):
        views, filters = noisy[None].copy(), loop_filter.new_filters(1)
        found = loop_filter_search.search_filters(views, 0, original, limit, NO_GUESS, 1.0)
        filters.modes[0], filters.taps[0] = found.modes, found.taps
        loop_filter.filter_view(views, 0, filters, limit, NO_GUESS, *loop_filter.memory(48, 64))
        left.append(np.square(views[0, 0].astype(float) - original[0]).sum())
    assert left[1] < left[0] / 3


def weights_in_file():
    """Arrays as docs/lf.md lists them."""
    numbers, c, layers = np.load(Path(assets.__file__).with_name("learnt_filter.npy")), 24, 3
    shapes = (c, 27), (layers, c, c, 9), (c, 9), (layers + 1, c)
    ends = np.cumsum([np.prod(shape) for shape in shapes])
    assert ends[-1] == len(numbers) and numbers.dtype == np.int16
    return [part.reshape(s).astype(np.int64) for part, s in zip(np.split(numbers, ends), shapes, strict=False)]


def guessed_by_definition(plane, blocks, step):
    """The guess by its definition in docs/lf.md, in int64, layer by layer."""
    net, reach = weights_in_file(), learnt.REACH
    around = np.pad(plane.astype(np.int64), reach + 2, mode="edge")
    height, width = plane.shape[0] + 2 * reach, plane.shape[1] + 2 * reach
    own = around[2:-2, 2:-2]
    inputs = [
        np.clip(around[i : i + height, j : j + width] - own, -(step >> 3), step >> 3) * ((1 << 26) // step) >> 16
        for i, j in np.ndindex(5, 5)
        if (i, j) != (2, 2)
    ]
    y, x = np.indices(plane.shape)
    tall, wide, coded = (blocks[k].repeat(4, axis=0).repeat(4, axis=1).astype(int) for k in (TALL, WIDE, CODED))
    beside = [(at % (1 << side) == 0) | ((at + 1) % (1 << side) == 0) for at, side in ((x, wide), (y, tall))]
    inputs += [np.pad(64 * mark.astype(int), reach) for mark in (*beside, coded > 0)]
    hidden = np.clip((np.einsum("oi,iyx->oyx", net[0], inputs) + net[3][0][:, None, None]) >> 8, 0, 255)
    for weights, biases in zip(net[1].reshape(len(net[1]), -1, len(hidden), 3, 3), net[3][1:], strict=True):
        windows = sliding_window_view(hidden, (3, 3), axis=(1, 2))
        hidden = np.clip((np.einsum("oimn,iyxmn->oyx", weights, windows) + biases[:, None, None]) >> 8, 0, 255)
    windows = sliding_window_view(hidden, (3, 3), axis=(1, 2))
    part = np.clip(np.einsum("imn,iyxmn->yx", net[2].reshape(-1, 3, 3), windows) >> 7, -4096, 4096)
    return (part * step + (1 << 15)) >> 16


@pytest.mark.parametrize("step", [1, 580, 2580, 1 << 18])
def test_a_network_guesses_as_defined(step):
    rng = np.random.default_rng(step)
    views = np.clip(rng.normal(0, step / 40, (2, 3, 24, 36)), -8191, 8191).astype(np.int16)
    blocks = np.zeros((FIELDS, 6, 9), np.int16)
    blocks[TALL], blocks[WIDE], blocks[CODED] = 3, rng.integers(2, 4, (6, 9)), rng.integers(2, size=(6, 9))
    memory = learnt.memory(24, 36)
    learnt.guess(views, 1, blocks, step, learnt.net(), *memory)
    np.testing.assert_array_equal(memory[-1], guessed_by_definition(views[1, 0], blocks, step))
    assert step == 1 or np.abs(memory[-1]).max() > 0


def test_training_follows_the_slopes_of_the_error_of_what_the_decoder_computes():
    """The script's forward pass is the decoder's guess but for rounding; its slopes are quotients of differences."""
    first, between, last, biases = weights_in_file()
    parts = [first.T / 256]
    for layer, own in zip(between, biases, strict=False):
        parts += [own / (1 << 14), layer.reshape(24, 24, 9).transpose(2, 1, 0).reshape(216, 24) / 256]
    net = [*parts, biases[-1] / (1 << 14), last.T.reshape(216, 1) / (1 << 14), np.zeros(1)]
    np.testing.assert_array_equal(
        learnt_filter.whole(net), np.load(Path(assets.__file__).with_name("learnt_filter.npy"))
    )
    rng, step, m = np.random.default_rng(0), 2580, learnt.MARGIN
    views = np.clip(rng.normal(0, step / 40, (1, 3, 24, 36)), -8191, 8191).astype(np.int16)
    blocks = np.zeros((FIELDS, 6, 9), np.int16)
    blocks[TALL], blocks[WIDE], blocks[CODED] = 3, 2, rng.integers(2, size=(6, 9))
    memory = learnt.memory(24, 36)
    learnt.guess(views, 0, blocks, step, learnt.net(), *memory)
    marks = np.pad(learnt_filter.marks_of(blocks, (24, 36)), ((m, m), (m, m), (0, 0)))
    plane = np.pad(views[0, 0] / (step / 16), m, mode="edge")
    inputs = learnt_filter.inputs_of(plane, marks)[None]
    guess = learnt_filter.forward(net, inputs)[0][0] * step / 16
    np.testing.assert_allclose(memory[-1] / 2, guess, atol=0.03 * step / 16)
    assert np.std(guess) > 0.02 * step / 16
    lacks, weights = rng.normal(0, 0.1, (1, 24, 36)), np.ones(1)
    slopes = learnt_filter.slopes_of(net, inputs, lacks, weights)
    for part, slope in zip(net, slopes, strict=True):
        at, kept, errors = np.unravel_index(np.argmax(np.abs(slope)), slope.shape), part.copy(), []
        for moved in (1e-5, -1e-5):
            part[at] = kept[at] + moved
            errors.append(np.mean((learnt_filter.forward(net, inputs)[0] - lacks) ** 2))
        part[at] = kept[at]
        assert (errors[0] - errors[1]) / 2e-5 == pytest.approx(slope[at], rel=0.02)


def test_sums_of_a_network_are_exact_in_float32():
    """Below 2^24 in any order."""
    first, between, last, biases = (np.abs(part) for part in weights_in_file())
    assert 128 * first[:, :-3].sum(axis=1).max() + 64 * first[:, -3:].sum(axis=1).max() + biases[0].max() < 1 << 24
    assert 255 * between.sum(axis=(2, 3)).max() + biases.max() < 1 << 24
    assert 255 * last.sum() < 1 << 24


@pytest.mark.slow
def test_a_network_guesses_what_a_photograph_lacks():
    """One on which it was not trained: with the guess the filter saves more error than without."""
    picture = IIPicture(np.ascontiguousarray(data.astronaut()[20:180, 140:300]), (160, 160), (1, 1))
    saved, search = [], loop_filter_search.search_filters

    def searched(views, view, original, limit, guess, weight):
        saved.extend(search(views, view, original, limit, part, weight).gains[0] for part in (guess, NO_GUESS))
        return search(views, view, original, limit, guess, weight)

    with patch.object(loop_filter_search, "search_filters", searched):
        encode(picture, "si-lf", qp=44)
    assert saved[0] > 1.4 * saved[1] > 0


def smooth_plane(grid, height, width):
    """Texture without sharp edges, and sensor noise: coarse quantisers leave errors that neighbours tell."""
    rng = np.random.default_rng(0)
    texture = rng.normal(0, 1, (height + 8, width + 8, 3))
    for axis in 4 * (0, 1):
        texture = (np.roll(texture, 1, axis) + texture + np.roll(texture, -1, axis)) / 3
    field = np.empty((height, grid[0], width, grid[1], 3))
    for v in range(grid[0]):
        for u in range(grid[1]):
            field[:, v, :, u] = 128 + texture[v : v + height, u : u + width] * (40 / texture.std())
    noisy = np.clip(field + rng.normal(0, 2, field.shape), 0, 255).astype(np.uint8)
    return IIPicture(noisy.reshape(height * grid[0], width * grid[1], 3), (width, height), grid[::-1])


@pytest.mark.slow
@pytest.mark.parametrize("tune", first_fast(["ctc", "rgb"]))
def test_filtered_views_predict(monkeypatch, tune):
    """A quarter of a decibel more at equal size; decoders repeat the filters, and threads change no byte."""
    monkeypatch.setattr(lf, "FINER_FIRST", 14.0)
    monkeypatch.setattr(lf, "DENOISED_LEVELS", 0)
    picture, scheme = smooth_plane((3, 4), 41, 50), f"si-lf:tune={tune}"
    filtered = encode(picture, scheme, qp=34)
    assert encode(picture, f"{scheme},threads=2", qp=34).payload == filtered.payload
    source = lf.Source(picture, checked_options(lf.LightField(), {"tune": tune}))
    payload, field = source.coded(34 * lf.FRACTIONS)
    assert payload == filtered.payload and len(set(field.filters.modes.ravel().tolist())) > 1
    shown = np.empty_like(picture.pixels)
    field.show(shown)
    for threads in "", ",threads=2":
        np.testing.assert_array_equal(decode(encode(picture, scheme + threads, qp=34)).pixels, shown)
    monkeypatch.setattr(loop_filter_search, "HEAD", 1e9)
    plain = encode(picture, scheme, qp=34)
    measured = [source.psnr(field), source.psnr(source.coded(34 * lf.FRACTIONS)[1])]
    assert measured[0] - measured[1] > 6 * np.log2(filtered.nbytes / plain.nbytes) + 0.25


def noisy_plane(disparity, sigma):
    """A plane at whole disparities without noise and with it, and the source of the noisy one."""
    clean = shifted_plane(disparity, grid=(5, 5), height=36, width=52)
    smooth = clean.with_pixels((64 + clean.pixels // 2).astype(np.uint8))
    noise = np.random.default_rng(6).normal(0, sigma, clean.pixels.shape)
    noisy = smooth.with_pixels(np.clip(np.rint(smooth.pixels + noise), 0, 255).astype(np.uint8))
    return tuple(lf.Source(picture, checked_options(lf.LightField(), {})) for picture in (smooth, noisy)), noisy


@pytest.mark.parametrize("place", [(2, 2), (0, 4)], ids=["middle", "corner"])
@pytest.mark.parametrize("disparity", [(0, 0), (2, -2)], ids=str)
def test_neighbours_take_noise_and_leave_everything_else(disparity, place):
    (clean, noisy), _ = noisy_plane(disparity, 4.0)
    step, header = 128 * 32, noisy.header
    found = denoise.denoised(noisy.view, noisy.grid, place, header.lattice, (header.low, header.high), step).astype(
        float
    )
    inner = np.s_[:, 8:-8, 8:-8]  # borders show what neighbours do not
    before, after = (
        np.square(planes_.astype(float) - clean.view(*place))[inner].mean() for planes_ in (noisy.view(*place), found)
    )
    assert after < (0.35 if place == (2, 2) else 0.55) * before
    same = denoise.denoised(clean.view, clean.grid, place, header.lattice, (header.low, header.high), step)
    np.testing.assert_allclose(same[inner], clean.view(*place)[inner], atol=8)  # of one code


def test_a_fine_step_hides_no_noise_and_a_view_alone_has_no_neighbours():
    (_, noisy), _ = noisy_plane((1, 1), 4.0)
    header = noisy.header
    for grid, step in [(noisy.grid, 64), ((1, 1), 4096)]:
        place = grid[0] // 2, grid[1] // 2
        found = denoise.denoised(noisy.view, grid, place, header.lattice, (header.low, header.high), step)
        np.testing.assert_allclose(found, noisy.view(*place), atol=1)


@pytest.mark.slow
def test_noise_that_is_not_coded_saves_rate(monkeypatch):
    """A tenth of the bytes at equal quality against the noisy original."""
    _, picture = noisy_plane((1, 1), 4.0)
    results = []
    for levels in (2, 0):
        monkeypatch.setattr(lf, "DENOISED_LEVELS", levels)
        source = lf.Source(picture, checked_options(lf.LightField(), {}))
        payload, field = source.coded(36 * lf.FRACTIONS)
        results.append((source.psnr(field), len(payload)))
    (with_less, fewer), (psnr, more) = results
    assert with_less - psnr > 6 * np.log2(0.9 * fewer / more)


@pytest.mark.parametrize("views", [(1, 1), (1, 7), (5, 1)])
@pytest.mark.parametrize("size", first_fast([((33, 18),), ((1, 1),), ((3, 2),)]))
def test_rows_single_views_and_tiny_ones_are_coded(views, size):
    rng = np.random.default_rng(5)
    pixels = rng.integers(0, 65536, (size[1] * views[1], size[0] * views[0], 3)).astype(np.uint16)
    picture = IIPicture(pixels, size, views)
    coarse, fine = (q_global(picture, decode(encode(picture, "si-lf", qp=qp))) for qp in (40, 4))
    assert fine > coarse + 12


def test_damaged_streams_decode_to_something_or_are_refused():
    picture = shifted_plane((1, 1), grid=(3, 3), height=16, width=20)
    whole = encode(picture, "si-lf", qp=30).payload
    blank, options = picture.with_pixels(np.zeros_like(picture.pixels)), checked_options(lf.LightField(), {})
    rng = np.random.default_rng(0)
    for _ in range(60):
        damaged = bytearray(whole)
        damaged[rng.integers(len(damaged))] ^= 1 << rng.integers(8)
        try:
            pixels, _ = lf.LightField().decode(bytes(damaged), blank, options)
        except ValueError:
            continue
        assert pixels.shape == picture.pixels.shape


def test_an_error_of_quality_names_the_measure():
    with pytest.raises(ValueError, match=r"quality is 5: .* is needed \(.*quality is PSNR in dB by the measure"):
        encode(shifted_plane((1, 1), grid=(2, 2)), "si-lf", quality=5)


def test_the_first_view_is_finer_the_more_views_it_predicts_and_a_view_alone_is_not():
    first = []
    for grid in [(1, 1), (1, 2), (3, 3), (5, 5)]:
        source = lf.Source(shifted_plane((1, 1), grid=grid, height=16), checked_options(lf.LightField(), {}))
        steps = source.steps(26 * lf.FRACTIONS)
        assert steps[-1] == 128 * 2**3  # of quantiser 26
        first.append(steps[0])
    assert first[0] == 128 * 2**3 and sorted(first, reverse=True) == first
    assert 8 < 6 * np.log2(first[0] / first[-1]) < 12


@pytest.mark.slow
def test_the_preset_best_needs_less_of_single_views():
    """In the mean of two: the search is no finer than half a percent."""
    saved = []
    for grey in (data.camera()[100:292, 100:292], data.astronaut()[:192, 150:342, 1]):
        picture, curves = IIPicture(np.repeat(grey[..., None], 3, axis=2), grey.shape, (1, 1)), {}
        for scheme in ("si-lf", "si-lf:best"):
            files = [encode(picture, scheme, qp=qp) for qp in (30, 36, 42, 48)]
            curves[scheme] = [coded.bpp for coded in files], [q_global(picture, decode(coded)) for coded in files]
        saved.append(bd_rate(*curves["si-lf"], *curves["si-lf:best"]))
    assert np.mean(saved) < -0.5
