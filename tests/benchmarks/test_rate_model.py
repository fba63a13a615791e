"""The rate–distortion model of light fields against closed forms."""

import numpy as np
import pytest

from benchmarks.coding.rate_model import (
    CrossSpectra,
    fitted,
    jitter_coherence,
    markov_spectrum,
    rate_and_distortion,
    rate_at,
    view_gains,
)

EVEN = 1 / 256  # weight of each of 16×16 frequencies


def views_rate(alpha, beta, grid, theta, spectrum=1.0):
    """Bits and error a sample of views of a flat spectrum."""
    gains = view_gains(alpha, beta, grid)
    return rate_and_distortion(spectrum * gains, 1 / gains.size, theta)


def test_a_white_picture_takes_half_the_logarithm():
    bits, error = rate_and_distortion(np.full((16, 16), 64.0), EVEN, 4.0)
    assert (bits, error) == pytest.approx((2, 4))


@pytest.mark.parametrize("correlation", [0, 0.5, 0.9])
def test_a_markov_picture_saves_its_prediction_gain(correlation):
    """R(D) = ½ log₂((1 − ρ²)² / D) below the least value of the spectrum; 256 frequencies sum it to 1e-9."""
    spectrum = markov_spectrum(correlation, 256)
    theta = spectrum.min() / 2
    bits, error = rate_and_distortion(spectrum, 1 / spectrum.size, theta)
    assert spectrum.mean() == pytest.approx(1)
    assert error == pytest.approx(theta)
    assert bits == pytest.approx(0.5 * np.log2((1 - correlation**2) ** 2 / theta), abs=1e-9)


@pytest.mark.parametrize("grid", [(1, 1), (2, 2), (4, 8), (16, 16)])
def test_equal_views_cost_as_much_as_one(grid):
    """N·R_N(D) = R_1(D) at N times the water level; at the same level the eigenvalue N gives ½ log₂ N bits more."""
    count = grid[0] * grid[1]
    bits, error = views_rate(1, 1, grid, theta=count / 100)
    assert error == pytest.approx(1 / 100)
    assert count * bits == pytest.approx(0.5 * np.log2(100))
    assert count * views_rate(1, 1, grid, theta=1 / 100)[0] == pytest.approx(
        0.5 * np.log2(100) + 0.5 * np.log2(count)
    )


def test_views_without_anything_in_common_cost_as_much_as_apart():
    for alpha, beta in ((0, 1), (1, 0), (0, 0)):
        assert views_rate(alpha, beta, (4, 4), 0.01) == pytest.approx((0.5 * np.log2(100), 0.01))


def test_eigenvalues_of_equal_coherence_are_those_of_ramanathan_and_girod():
    """One of 1 + (N − 1) α, the others 1 − α."""
    found = np.sort(view_gains(0.8, 1, (3, 4)))
    assert found == pytest.approx([0.2] * 11 + [1 + 11 * 0.8])


def test_eigenvalues_are_those_of_the_whole_matrix():
    row, col = (axis.ravel() for axis in np.mgrid[:3, :4])
    steps = np.abs(row[:, None] - row) + np.abs(col[:, None] - col)
    matrix = 0.9 * 0.7**steps + 0.1 * np.eye(12)
    assert np.sort(view_gains(0.9, 0.7, (3, 4))) == pytest.approx(np.linalg.eigvalsh(matrix))


def test_a_chain_of_views_saves_its_prediction_gain():
    """The determinant of β^|i−j| is (1 − β²)^(n−1)."""
    beta, count, theta = 0.8, 8, 1e-3
    bits, _ = views_rate(1, beta, (1, count), theta)
    assert bits == pytest.approx(0.5 * np.log2((1 - beta**2) ** ((count - 1) / count) / theta))


def test_the_rate_at_a_psnr():
    """White noise of three planes: D is 255² / 10^(PSNR / 10) a plane."""
    variance, psnr = 1000.0, 38.0
    wanted = 3 * 0.5 * np.log2(variance / (255**2 / 10 ** (psnr / 10)))
    assert rate_at(np.full((3, 16, 16), variance), EVEN, psnr) == pytest.approx(wanted)
    assert rate_at(np.full((3, 16, 16), variance), EVEN, 10.0) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(("alpha", "beta"), [(1, 0.9), (0.8, 1), (0.7, 0.95), (0.5, 0.2)])
def test_coherence_at_two_distances_gives_the_model(alpha, beta):
    assert np.ravel(fitted(alpha * beta, alpha * beta**4, 4)) == pytest.approx([alpha, beta])


def test_a_fall_too_steep_for_the_model_keeps_the_nearest_coherence():
    alpha, beta = fitted(0.9, 0.1, 4)
    assert alpha * beta == pytest.approx(0.9) and alpha <= 1


def test_coherence_of_a_displaced_texture():
    """Random displacements of σ = 0.6 samples of a periodic texture: 1500 blocks tell the mean to 0.03."""
    rng = np.random.default_rng(3)
    tool, sigma = CrossSpectra(16), 0.6
    texture = np.fft.fft2(rng.standard_normal((48, 48)))
    along = 2 * np.pi * np.fft.fftfreq(48)
    one, other = [], []
    for _ in range(60):
        moved = np.fft.ifft2(texture * np.exp(-1j * along * rng.normal(0, sigma))).real
        one.append(tool.blocks(np.fft.ifft2(texture).real[None]))
        other.append(tool.blocks(moved[None]))
    found = tool.coherence(np.concatenate(one), np.concatenate(other))[0]
    across = tool.frequencies()
    # The window spreads each frequency over its neighbours, which lowers the coherence where it is curved.
    for k in (1, 3, 5):
        assert found[:, k].mean() == pytest.approx(jitter_coherence(sigma, across[k]), abs=0.03)


def test_blocks_keep_the_variance():
    rng = np.random.default_rng(0)
    power = np.abs(CrossSpectra(16).blocks(rng.normal(0, 3, (2, 128, 128)))) ** 2
    assert power.mean() == pytest.approx(9, rel=0.05)  # 225 blocks of 256 samples, half of them new: 1 %, and windows
