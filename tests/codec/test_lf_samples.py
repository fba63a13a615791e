"""Residuals of `si-lf` without a transform."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codec import decode, encode
from codec.coders.lf import arithmetic, contexts, samples, stream
from codec.coders.lf import coder as lf
from codec.coders.lf.blocks import CODED, LOG, SKIPPED
from codec.coders.lf.field import Field
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
    small = (blocks[CODED] == 1) & (blocks[LOG] <= samples.LARGEST_SKIPPED)
    assert blocks[SKIPPED][small].mean() > 0.5
    assert not blocks[SKIPPED][~small].any()


@pytest.mark.parametrize("dtype", ["uint8", "uint16"])
@pytest.mark.parametrize("options", [{}, {"cross": 0}])
def test_decoding_repeats_the_encoder_to_the_bit(dtype, options):
    picture = specks(dtype, grid=(3, 4), lenses=(19, 10))
    source = lf.Source(picture, checked_options(lf.LightField(), options))
    payload, field = source.coded(30 * lf.FRACTIONS)
    assert payload[0] == stream.TUNED
    shown = np.empty_like(picture.pixels)
    field.show(shown)
    coded = encode(picture, "si-lf:cross=0" if options else "si-lf", qp=30)
    assert coded.payload == payload
    np.testing.assert_array_equal(decode(coded).pixels, shown)


def test_lossless_streams_keep_their_version():
    assert encode(specks(grid=(2, 2)), "si-lf:lossless=1").payload[0] == stream.VERSION


@settings(max_examples=30, deadline=None)
@given(st.integers(2, 3), st.integers(0, 2), st.integers(0, 2**32 - 1), st.sampled_from([0.02, 0.3, 1.0]))
def test_any_levels_are_read_as_they_were_written(log, plane, seed, density):
    """Two blocks one after the other, at any place of a view, up to the greatest level."""
    rng = np.random.default_rng(seed)
    n = 1 << log
    planes = rng.integers(-3, 4, (3, 16, 16)).astype(np.int16)
    places = [(4, 8), (8, 0)]
    written = [_some_levels(rng, n, density) for _ in places]
    coder = arithmetic.writer(contexts.starting_contexts(), 4096)
    for levels, (y, x) in zip(written, places, strict=True):
        samples.code_samples(coder, levels, planes, y, x, plane, log)
    reader = arithmetic.reader(contexts.starting_contexts(), arithmetic.finish(coder))
    for levels, (y, x) in zip(written, places, strict=True):
        found = np.zeros((32, 32), np.int32)
        samples.code_samples(reader, found, planes, y, x, plane, log)
        np.testing.assert_array_equal(found[:n, :n], levels[:n, :n])


def _some_levels(rng, n, density):
    levels = np.zeros((32, 32), np.int32)
    sizes = np.minimum(rng.geometric(0.3, (n, n)) ** rng.integers(1, 5, (n, n)), samples.MOST_LEVEL)
    levels[:n, :n] = sizes * rng.choice([-1, 1], (n, n)) * (rng.random((n, n)) < density)
    return levels
