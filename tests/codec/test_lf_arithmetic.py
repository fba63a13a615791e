"""Arithmetic coder and transforms of `si-lf`: exact inverses, distance to the entropy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from codec.coders.lf import arithmetic, transform
from codec.coders.lf.contexts import starting_contexts
from codec.coders.lf.transform import forward, inverse
from ii_core.base.jit import array_kernel


@array_kernel
def coded(coder, bits, contexts, numbers):
    """Code bits, each in its context, then numbers, in place."""
    for i in range(bits.size):
        bits[i] = arithmetic.code_bit(coder, contexts[i], bits[i])
    for i in range(numbers.size):
        numbers[i] = arithmetic.code_number(coder, np.int64(4), np.int64(8), np.int64(0), numbers[i])


def round_trip(bits, contexts, numbers, refined=False):
    def states():
        return starting_contexts(refined) if refined else arithmetic.new_contexts(12)

    coder = arithmetic.writer(states(), 4 * (bits.size + 40 * numbers.size) + 64, refined=refined)
    coded(coder, bits.copy(), contexts, numbers.copy())
    data = arithmetic.finish(coder)
    coder = arithmetic.reader(states(), data, refined=refined)
    found_bits, found_numbers = np.zeros_like(bits), np.zeros_like(numbers)
    coded(coder, found_bits, contexts, found_numbers)
    np.testing.assert_array_equal(found_bits, bits)
    np.testing.assert_array_equal(found_numbers, numbers)
    assert not arithmetic.overrun(coder)
    return data


@given(
    st.lists(st.tuples(st.integers(0, 1), st.integers(0, 3)), max_size=300),
    st.lists(st.integers(0, (1 << 23) - 1), max_size=20),
    st.booleans(),
)
def test_coded_bits_and_numbers_round_trip(bits, numbers, refined):
    pairs = np.array(bits, np.int64).reshape(-1, 2)
    round_trip(pairs[:, 0].copy(), pairs[:, 1].copy(), np.array(numbers, np.int64), refined)


def test_carries_run_through():
    """Long runs of likely bits, then unlikely ones, bring the low end near a carry time and again."""
    rng = np.random.default_rng(1)
    for seed in range(20):
        bits = (rng.random(3000) < 0.003 * seed).astype(np.int64)
        round_trip(bits, np.zeros(3000, np.int64), np.zeros(0, np.int64))


def test_the_length_is_near_the_entropy():
    rng = np.random.default_rng(0)
    contexts = rng.integers(0, 4, 200_000)
    ones = np.array([0.5, 0.02, 0.2, 0.9])[contexts]
    bits = (rng.random(contexts.size) < ones).astype(np.int64)
    data = round_trip(bits, contexts, np.zeros(0, np.int64))
    entropy = -(ones * np.log2(ones) + (1 - ones) * np.log2(1 - ones)).sum() / 8
    # Probabilities that follow the bits at 1/16 and 1/140 cost 2 % on a source that does not change.
    assert len(data) < 1.025 * entropy


def test_bits_that_depend_on_those_before_cost_less_from_version_12_on():
    """A source that changes its bit once in eight, in four contexts by chance: 0.54 bits each, one without memory."""
    rng = np.random.default_rng(3)
    bits = (np.cumsum(rng.random(40_000) < 1 / 8) % 2).astype(np.int64)
    contexts, none = rng.integers(0, 4, bits.size), np.zeros(0, np.int64)
    entropy = -(np.log2(1 / 8) / 8 + np.log2(7 / 8) * 7 / 8) * bits.size / 8
    assert len(round_trip(bits, contexts, none)) > 0.9 * bits.size / 8
    assert entropy < len(round_trip(bits, contexts, none, refined=True)) < 1.06 * entropy


def test_a_reader_detects_the_end_of_the_code():
    coder = arithmetic.reader(arithmetic.new_contexts(12), b"")
    bits = np.zeros(4000, np.int64)
    coded(coder, bits, np.arange(4000) % 4, np.full(20, 5))
    assert arithmetic.overrun(coder)


@pytest.mark.parametrize("kind", [0, 1, 2, 3])
@pytest.mark.parametrize("shape", [(2, 2), (3, 3), (4, 4), (5, 5), (2, 5), (4, 3)])
def test_transforms_invert_and_keep_the_energy(shape, kind):
    h, w = 1 << shape[0], 1 << shape[1]
    rng = np.random.default_rng(shape)
    block, half, out, back = (np.zeros((32, 32), np.int32) for _ in range(4))
    block[:h, :w] = rng.integers(-7000, 7001, (h, w))
    forward(block, shape, half, out, np.int64(kind))
    inverse(out, shape, np.int64(h), np.int64(w), half, back, np.int64(kind))
    # Matrices rounded to 2^-10 are off by 2^-12 in the mean, those of sines by twice as much.
    assert np.abs(back - block)[:h, :w].max() < 7000 * (max(h, w) + 4) / 2**11
    assert not out[h:].any() and not out[:, w:].any()
    assert np.square(out.astype(float)).sum() == pytest.approx(np.square(block.astype(float)).sum(), rel=3e-3)


def test_a_constant_block_is_one_coefficient():
    block, half, out = (np.zeros((32, 32), np.int32) for _ in range(3))
    block[:8, :8] = 100
    forward(block, (3, 3), half, out, np.int64(0))
    assert abs(out[0, 0] - 800) <= 1
    out[0, 0] = 0
    assert not out.any()


def test_sines_compact_what_grows_away_from_a_border():
    """A ramp from zero at the block's upper border is one coefficient more nearly than by cosines."""
    block, half = (np.zeros((32, 32), np.int32) for _ in range(2))
    block[:8, :8] = 100 * (1 + np.arange(8))[:, None]
    shares = []
    for kind in (transform.SINE_DOWN, 0, transform.SINE_ACROSS):
        out = np.zeros((32, 32), np.int32)
        forward(block, (3, 3), half, out, np.int64(kind))
        shares.append(out[0, 0] ** 2 / np.square(out.astype(float)).sum())
    assert shares[0] > 0.95 > 0.85 > shares[1] > shares[2]


def test_costs_of_bits_are_the_information_of_the_nearest_probability():
    """The table has 4096 probabilities: a cost lies between those of the neighbours half a step away."""
    p = np.arange(2 * arithmetic.LEAST, arithmetic.ONE - 2 * arithmetic.LEAST, 7)
    costs = arithmetic.bit_costs(np.stack([p, p], axis=1).astype(np.int32))
    for bit, share in ((1, p), (0, arithmetic.ONE - p)):
        least, most = (-np.log2((share + half) / arithmetic.ONE) for half in (8.5, -8.5))
        assert (least <= costs[:, bit]).all() and (costs[:, bit] <= most).all()
