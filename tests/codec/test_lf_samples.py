"""Residuals of `si-lf` without a transform, by a dependent quantiser, and signs; intra blocks of version 14."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codec import decode, encode
from codec.coders.lf import arithmetic, coefficients, contexts, cross, intra, samples, signs, stream, transform
from codec.coders.lf import coder as lf
from codec.coders.lf.field import Field
from codec.coders.lf.state import CODED, FOLLOWS, SKIPPED, TALL, WIDE, new_work
from codec.contract import checked_options
from ii_core import IIPicture
from metrics import q_global


def specks(dtype="uint8", grid=(5, 5), lenses=(24, 16), seed=0):
    """A grey light field with single samples, one in sixty, that no other view has."""
    rng = np.random.default_rng(seed)
    shape = lenses[1] * grid[1], lenses[0] * grid[0]
    light = np.where(rng.random(shape) < 1 / 60, rng.choice([-70, 70], shape), 0)
    top = np.iinfo(dtype).max
    pixels = np.repeat(((128 + light) * top // 255)[..., None], 3, 2).astype(dtype)
    return IIPicture(pixels, lenses, grid)


def decoded_blocks(coded, monkeypatch):
    """Blocks of all views, from the decoder."""
    found, code = [], Field.code

    def noting(field, coder, job, work, *same):
        code(field, coder, job, work, *same)
        found.append(job.blocks.copy())

    monkeypatch.setattr(Field, "code", noting)
    decode(coded)
    return found


def test_isolated_samples_are_coded_without_a_transform(monkeypatch):
    picture = specks()
    skipping, transformed = (encode(picture, f"si-lf:tune=rgb,skip={skip}", qp=34) for skip in (1, 0))
    found = [stream.unpack(coded.payload, picture.pixels.size // 3)[0].skipping for coded in (skipping, transformed)]
    assert found == [True, False]
    assert skipping.nbytes < 0.9 * transformed.nbytes
    # The same quantiser: the error is no larger.
    assert q_global(picture, decode(skipping)) > q_global(picture, decode(transformed)) - 0.1
    blocks = np.concatenate(
        [found.reshape(len(found), -1) for found in decoded_blocks(skipping, monkeypatch)], axis=1
    )
    small = (blocks[CODED] == 1) & (blocks[TALL] + blocks[WIDE] <= samples.LARGEST_SKIPPED)
    skipped = blocks[SKIPPED] == 1
    assert skipped[small].mean() > 0.5
    assert not skipped[~small].any()


@pytest.mark.parametrize("dtype", ["uint8", "uint16"])
@pytest.mark.parametrize("options", [{}, {"cross": 0}])
def test_decoding_repeats_the_encoder_to_the_bit(dtype, options):
    picture = specks(dtype, grid=(3, 4), lenses=(19, 10))
    source = lf.Source(picture, checked_options(lf.LightField(), options))
    payload, field = source.coded(30 * lf.FRACTIONS)
    assert payload[0] == stream.LEARNT
    shown = np.empty_like(picture.pixels)
    field.show(shown)
    coded = encode(picture, "si-lf:cross=0" if options else "si-lf", qp=30)
    assert coded.payload == payload
    np.testing.assert_array_equal(decode(coded).pixels, shown)


def test_lossless_streams_keep_their_version():
    assert encode(specks(grid=(2, 2)), "si-lf:lossless=1").payload[0] == stream.VERSION


@settings(max_examples=30, deadline=None)
@given(
    st.sampled_from([(2, 2), (2, 3), (3, 3), (4, 2)]),
    st.integers(0, 2),
    st.integers(0, 2**32 - 1),
    st.sampled_from([0.02, 0.3, 1.0]),
)
def test_any_levels_are_read_as_they_were_written(shape, plane, seed, density):
    """Two blocks one after the other, at any place of a view, up to the greatest level."""
    rng = np.random.default_rng(seed)
    h, w = 1 << shape[0], 1 << shape[1]
    planes = rng.integers(-3, 4, (3, 24, 24)).astype(np.int16)
    places = [(4, 8), (8, 0)]
    written = [_some_levels(rng, 16, density) for _ in places]
    for levels in written:
        levels[h:], levels[:, w:] = 0, 0
    coder = arithmetic.writer(contexts.starting_contexts(), 4096)
    for levels, (y, x) in zip(written, places, strict=True):
        samples.code_samples(coder, levels, planes, y, x, plane, shape)
    reader = arithmetic.reader(contexts.starting_contexts(), arithmetic.finish(coder))
    for levels, (y, x) in zip(written, places, strict=True):
        found = np.zeros((32, 32), np.int32)
        samples.code_samples(reader, found, planes, y, x, plane, shape)
        np.testing.assert_array_equal(found, levels)


def _some_levels(rng, n, density):
    levels = np.zeros((32, 32), np.int32)
    sizes = np.minimum(rng.geometric(0.3, (n, n)) ** rng.integers(1, 5, (n, n)), samples.MOST_LEVEL)
    levels[:n, :n] = sizes * rng.choice([-1, 1], (n, n)) * (rng.random((n, n)) < density)
    return levels


NEXT_STATE = {(0, 0): 0, (0, 1): 2, (1, 0): 2, (1, 1): 0, (2, 0): 1, (2, 1): 3, (3, 0): 3, (3, 1): 1}


def places_from_the_last(levels, shape):
    """Rows and columns in the order of coding, by the definition of the scan."""
    h, w = 1 << shape[0], 1 << shape[1]
    order = sorted((y + x, y if (x + y) % 2 else x, y, x) for y in range(h) for x in range(w))
    last = max(i for i, (_, _, y, x) in enumerate(order) if levels[y, x])
    return [(y, x) for _, _, y, x in order[last::-1]]


def values_by_definition(levels, shape):
    """Values in halves of a distance that a decoder gives magnitudes with signs."""
    state, values = 0, np.zeros_like(levels)
    for y, x in places_from_the_last(levels, shape):
        size = abs(int(levels[y, x]))
        values[y, x] = np.sign(levels[y, x]) * (2 * size - (state >> 1) * (size > 0))
        state = NEXT_STATE[state, size & 1]
    return values


@settings(max_examples=20, deadline=None)
@given(
    st.tuples(*2 * [st.integers(2, 4)]),
    st.integers(0, 2),
    st.integers(0, 2**32 - 1),
    st.sampled_from([0.02, 0.3, 1.0]),
    st.booleans(),
)
def test_levels_of_a_dependent_quantiser_are_read_as_they_were_written(shape, plane, seed, density, refined):
    """Before version 12, and from it on in contexts of earlier planes beside them."""
    rng = np.random.default_rng(seed)
    levels = np.zeros((32, 32), np.int32)
    h, w = 1 << shape[0], 1 << shape[1]
    levels[:h, :w] = _some_levels(rng, max(h, w), density)[:h, :w] // 2
    levels[rng.integers(4), rng.integers(4)] = 1
    values = values_by_definition(levels, shape)
    where = rng.integers(-2, 3, (3, 40, 44)).astype(np.int16), (8, 12), 3
    coder = arithmetic.writer(contexts.starting_contexts(), 1 << 14, refined=refined)
    coefficients.code_coefficients(coder, values, plane, shape, 1, (1, 1), *where, 1)
    reader = arithmetic.reader(contexts.starting_contexts(), arithmetic.finish(coder), refined=refined)
    found = np.zeros((32, 32), np.int32)
    coefficients.code_coefficients(reader, found, plane, shape, 1, (1, 1), *where, 1)
    np.testing.assert_array_equal(found, values)


def quantised(block, shape, step, weight, dependent):
    """Levels, bits and squared error by the encoder, with the contexts of a stream's beginning."""
    levels, costs = np.zeros((32, 32), np.int32), arithmetic.bit_costs(contexts.starting_contexts())
    given = costs, block, 0, shape, np.float32(step), np.float32(weight), levels, 1
    if dependent:
        return levels, *coefficients.quantise_dependent(*given, coefficients.new_trellis())
    return levels, *coefficients.quantise(*given)


@pytest.mark.parametrize(
    ("shape", "seed"), [((2, 2), 0), ((3, 3), 1), ((4, 4), 2), ((2, 4), 3), ((4, 3), 4)], ids=str
)
def test_a_dependent_quantiser_keeps_to_its_states_and_knows_its_error(shape, seed):
    """Levels are those of a walk through the states; error and bits are what decoder and stream have."""
    rng = np.random.default_rng(seed)
    h, w, step = 1 << shape[0], 1 << shape[1], 40
    block = np.zeros((32, 32), np.int32)
    block[:h, :w] = rng.laplace(0, 90 / (1 + np.add.outer(np.arange(h), np.arange(w)) / 4))
    levels, bits, error = quantised(block, shape, step, 0.12 * step**2, True)
    assert levels.any() and (np.sign(levels) * np.sign(block) >= 0).all()
    np.testing.assert_array_equal(values_by_definition(np.sign(levels) * ((abs(levels) + 1) // 2), shape), levels)
    decoded = np.zeros((32, 32), np.int32)
    coefficients.dequantise(levels, shape, 16 * step, decoded, True)
    np.testing.assert_allclose(decoded, levels * step * 9 / 16, atol=0.5)
    np.testing.assert_allclose(np.square(decoded - block).sum(), error, rtol=0.05)  # the decoder rounds
    coder = arithmetic.writer(contexts.starting_contexts(), 1 << 14)
    where = np.zeros((3, 32, 32), np.int16), (0, 0), 0
    coefficients.code_coefficients(coder, levels, 0, shape, 1, (1, 1), *where, 1)
    # Contexts learn while they are written, and costs leave out those that are mixed with others.
    assert abs(8 * len(arithmetic.finish(coder)) / bits - 1) < 0.15


def test_a_dependent_quantiser_costs_less():
    """Squared error and weighted bits of blocks with many coefficients, against one level after another."""
    rng, step = np.random.default_rng(5), 40
    costs = np.zeros(2)
    for _ in range(8):
        block = np.zeros((32, 32), np.int32)
        block[:8, :8] = rng.laplace(0, 80, (8, 8))
        for dependent in (0, 1):
            _, bits, error = quantised(block, (3, 3), step, 0.12 * step**2, dependent)
            costs[dependent] += error + 0.12 * step**2 * bits
    assert costs[1] < 0.98 * costs[0]


def test_halves_fit_bars():
    """Bars of two widths and random grey save a twentieth of the bytes that squares alone take."""
    rng = np.random.default_rng(6)
    bars = np.repeat(rng.integers(40, 216, (4, 24)), rng.choice([3, 8], 24), axis=1)[:, :96]
    pixels = np.repeat(np.repeat(bars, 24, axis=0)[..., None], 3, axis=2).astype(np.uint8)
    picture = IIPicture(np.ascontiguousarray(pixels), pixels.shape[1::-1], (1, 1))
    source = lf.Source(picture, checked_options(lf.LightField(), {}))
    source.header = replace(source.header, refined=False, limited=False, guided=False)
    halved, _ = source.coded(30 * lf.FRACTIONS)
    source.header = replace(source.header, parted=False)
    squares, _ = source.coded(30 * lf.FRACTIONS)
    assert (halved[0], squares[0]) == (stream.PARTED, stream.DIRECTED)
    assert len(halved) < 0.95 * len(squares)


@pytest.mark.parametrize("mode", range(2, intra.ALL_MODES))
def test_a_plane_without_change_along_a_direction_goes_on(mode):
    """Directions turn by eighths of a sample a row from straight, up to one, and by 3/64 less and more."""
    coarse, beside = (mode - 2, 0) if mode < intra.MODES else ((mode - intra.MODES) // 2, 2 * (mode % 2) - 1)
    slope = np.clip((coarse % 17 - 8) / 8 + beside * 3 / 64, -1, 1)

    def plane(y, x):
        return 2000 + 90 * (y + slope * x if coarse >= 17 else x + slope * y)

    border, out = np.zeros((4, 66), np.int32), np.zeros((3, 32, 32), np.int32)
    places = np.arange(-1, 8)
    border[0, :9], border[1, :9] = np.rint(plane(-1, places)), np.rint(plane(places, -1))
    intra.predict_intra(border, mode, (2, 2), out, 1, 1)
    expected = plane(*np.mgrid[:4, :4])
    # Where the 34 directions meet the other side is rounded down to eighths.
    np.testing.assert_allclose(out[1, :4, :4], expected, atol=12 if mode < intra.MODES else 2)


def surroundings(planes, y0=8, x0=12):
    """All of a job that prediction of a block at (y0, x0) reads: decoded planes (3, H, W)."""
    views = np.rint(planes)[None].astype(np.int16)
    return SimpleNamespace(views=views, at=0, step=640), y0, x0


@pytest.mark.parametrize(("y0", "x0"), [(8, 12), (0, 12), (8, 0)])
@pytest.mark.parametrize("slope", [-3.0, -0.4, 0.0, 0.7, 5.0])
def test_colours_follow_the_line_that_fits_the_samples_around(slope, y0, x0):
    """By least squares of numpy, where the slope is not limited to 4."""
    rng = np.random.default_rng(3)
    planes_ = rng.uniform(300, 700, (3, 24, 28))
    planes_[1] = slope * planes_[0] + 50 + rng.normal(0, 20, (24, 28))
    planes_ = np.rint(planes_)
    around = np.zeros((24, 28), bool)
    around[max(y0 - 1, 0), x0 : x0 + 16] = y0 > 0
    around[y0 : y0 + 8, max(x0 - 1, 0)] |= x0 > 0
    xs, ys = planes_[0][around], planes_[1][around]
    fitted = np.clip(np.polyfit(xs, ys, 1)[0], -4, 4)
    job, y0, x0 = surroundings(planes_, y0, x0)
    first = job.views[0, 0, y0:, x0:]
    work = new_work()
    cross.predict_following.py_func(job, first, work, 1, y0, x0, (3, 4))
    expected = fitted * (first[:8, :16] - xs.mean()) + ys.mean()
    np.testing.assert_allclose(work.predicted[1, :8, :16], expected, atol=1)


def test_colours_around_without_a_line_give_their_mean():
    job, y0, x0 = surroundings(np.stack([np.full((24, 28), 100.0), np.full((24, 28), -40.0), np.zeros((24, 28))]))
    work = new_work()
    first = np.random.default_rng(0).integers(0, 999, (32, 32)).astype(np.int16)
    cross.predict_following.py_func(job, first, work, 1, y0, x0, (2, 2))
    assert (work.predicted[1, :4, :4] == -40).all()


@pytest.mark.slow
def test_colours_that_follow_save_rate(monkeypatch):
    """Texture whose colours are a line of its grey takes a sixth less than with factors of residuals alone."""
    rng = np.random.default_rng(8)
    grey = np.kron(rng.uniform(40, 200, (24, 24)), np.ones((4, 4)))[..., None]
    pixels = np.clip(grey * [1.0, 0.7, 0.4] + [0, 20, 60], 0, 255).astype(np.uint8)
    picture = IIPicture(pixels, (96, 96), (1, 1))
    source = lf.Source(picture, checked_options(lf.LightField(), {}))
    followed, field = source.coded(32 * lf.FRACTIONS)
    quality = source.psnr(field)
    source.header = replace(source.header, guided=False)
    alone, field = source.coded(32 * lf.FRACTIONS)
    assert len(followed) < 0.85 * len(alone) and quality > source.psnr(field) - 0.4
    blocks = decoded_blocks(encode(picture, "si-lf", qp=32), monkeypatch)[0]
    assert blocks[FOLLOWS].mean() > 0.5


def block_and_surroundings(seed, shape, kind):
    """Levels of a smooth surface without a prediction, in halves of a step of 40, and what lies around it."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:40, :44] / 40
    a, b, c, d = rng.uniform(-2, 2, 4)
    surface = 900 * np.sin(a + 3 * b * x + 3 * c * y + d * x * y)
    job, y0, x0 = surroundings(np.stack([surface] * 3))
    h, w = 1 << shape[0], 1 << shape[1]
    down, across = transform.MATRICES[kind & 1, shape[0]] / 1024, transform.MATRICES[kind >> 1, shape[1]] / 1024
    block = surface[y0 : y0 + h, x0 : x0 + w]
    values = down[:h, :h] @ block @ across[:w, :w].T / (job.step / 16 * 9 / 16)
    levels = np.zeros((32, 32), np.int32)
    levels[:h, :w] = np.rint(values)
    return job, y0, x0, levels


@pytest.mark.parametrize("kind", range(4))
def test_signs_are_read_as_they_were_written_and_mostly_guessed(kind):
    """Of smooth surfaces that go on from their surroundings, six tenths of a bit a sign."""
    written, read = (contexts.starting_contexts(True) for _ in range(2))
    coder, blocks, count = arithmetic.writer(written, 1 << 16, refined=True), [], 0
    for seed in range(40):
        shape = (2 + seed % 3, 2 + seed // 3 % 3)
        job, y0, x0, levels = block_and_surroundings(seed, shape, kind)
        count += np.count_nonzero(levels)
        blocks.append((job, y0, x0, levels.copy(), shape))
        signs.code_signs.py_func(coder, job, new_work(), levels, y0, x0, shape, kind)
        np.testing.assert_array_equal(levels, blocks[-1][3])
    data = arithmetic.finish(coder)
    assert 8 * len(data) < 0.6 * count
    reader = arithmetic.reader(read, data, refined=True)
    for job, y0, x0, levels, shape in blocks:
        found = abs(levels)
        signs.code_signs.py_func(reader, job, new_work(), found, y0, x0, shape, kind)
        np.testing.assert_array_equal(found, levels)


def test_signs_without_surroundings_are_bits_of_even_probabilities():
    """Also of levels that are all above zero, which a context would learn."""
    job, _, _, levels = block_and_surroundings(1, (5, 5), 0)
    levels[:] = 1
    coder = arithmetic.writer(contexts.starting_contexts(True), 1 << 12, refined=True)
    signs.code_signs.py_func(coder, job, new_work(), levels, 0, 0, (5, 5), 0)
    assert abs(8 * len(arithmetic.finish(coder)) - 1024) <= 16
