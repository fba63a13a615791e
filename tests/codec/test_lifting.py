"""Wavelets along the slice axis: exact inverses, gains against the filters of the standard."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from codec.coders import lifting

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
