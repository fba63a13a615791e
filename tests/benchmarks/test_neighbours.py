"""Block-wise prediction of sub-images from their neighbours, its estimated rate, and correlations of the crossing."""

import numpy as np
import pytest

from benchmarks.coding.crossing import likeness, moving
from benchmarks.coding.neighbours import (
    BLOCK,
    REACH,
    SAME,
    _vector_bits,
    compensated,
    neighbours,
    residual_bits,
    squared_error,
)
from ii_core import IIPicture, video_of


@pytest.fixture(scope="module")
def smooth():
    """Waves of 8 to 25 pixels in all directions: no block is like one beside it, and the spline errs by 0.1."""
    rng = np.random.default_rng(0)
    y, x = np.mgrid[:48, :80]
    waves = [(rng.uniform(8, 25), rng.uniform(0, 2 * np.pi), rng.uniform(0, 2 * np.pi)) for _ in range(12)]

    def at(down, across):
        total = np.zeros(y.shape)
        for length, turn, phase in waves:
            along = (x + across) * np.cos(turn) + (y + down) * np.sin(turn)
            total += 20 * np.sin(2 * np.pi * along / length + phase)
        return total.astype(np.float32)

    return at


@pytest.mark.parametrize("move", [(0, 0), (3, -2), (REACH, -REACH), (0.25, -1.25), (-1.75, 7.25)])
def test_block_matching_predicts_a_moved_image(smooth, move):
    found = compensated(smooth(*move)[None], smooth(0, 0)[None], 0.0)[0][0]
    low, high = ([max(0, int(np.ceil(sign * n))) + 4 for n in move] for sign in (-1, 1))  # content of the reference
    blocks = np.s_[-(-low[0] // BLOCK) * BLOCK : (48 - high[0]) // BLOCK * BLOCK,
                   -(-low[1] // BLOCK) * BLOCK : (80 - high[1]) // BLOCK * BLOCK]  # fmt: skip
    assert found[blocks].size >= 10 * BLOCK**2
    assert np.abs(found - smooth(*move))[blocks].max() < 0.5


def test_blocks_have_motion_vectors_of_their_own():
    rng = np.random.default_rng(1)
    reference = rng.normal(0, 50, (1, 32, 32)).astype(np.float32)
    image = reference.copy()
    image[0, 8:16, 8:16] = reference[0, 11:19, 4:12]
    assert squared_error(image, compensated(image, reference, 0.0)[0]).max() == pytest.approx(0, abs=1e-6)
    assert squared_error(image, reference)[0, 1, 1] > 1000


def test_bits_by_hand():
    """Δ = 16 at quantiser 28: blocks of at most Δ²/12 cost nothing, a factor of 4 one bit a pixel."""
    theta, blank = 16**2 / 12, np.zeros((1, 8, 8), np.float32)
    found = [residual_bits(blank, blank + np.float32(np.sqrt(f * theta)), 28)[0, 0, 0] / 64 for f in (0, 0.5, 4, 16)]
    assert found == pytest.approx([0, 0, 1, 2], abs=1e-6)


def test_vectors_cost_bits_and_are_chosen_by_them(smooth):
    """A move of (0.75, −1.25): numbers 3 and −5, codes 6 and 10, 5 and 7 bits; then twice the same."""
    image, reference = smooth(0.75, -1.25)[None], smooth(0, 0)[None]
    _, bits = compensated(image, reference, 0.0)
    assert bits[0, 0, 3] == 2 * SAME and bits[0, 2:5].max() == 2 * SAME
    assert compensated(image[:, 8:16, 8:16], reference[:, 8:16, 8:16], 0.0)[1].shape == (1, 1, 1)
    still, none = compensated(image, reference, 1e9)  # no vector is worth its bits
    np.testing.assert_allclose(still, reference, atol=1e-3)
    assert (none == 2 * SAME).all()
    assert _vector_bits.py_func(3, -5) == 12 and _vector_bits.py_func(0, 0) == 2 * SAME


def test_neighbours_are_the_last_instant_and_the_last_view():
    """Grey of sub-image (u, v) at instant t is 16·t + 4·u + v."""
    frames = []
    for t in range(3):
        field = np.empty((8, 2, 8, 3), np.uint8)  # (l, v, k, u)
        field[:] = (16 * t + 4 * np.arange(3) + np.arange(2)[:, None])[None, :, None, :]
        frames.append(IIPicture(np.repeat(field.reshape(16, 24, 1), 3, axis=2), (8, 8), (3, 2)))
    now, last = neighbours(video_of(frames))
    assert now.shape == (2 * 2 * 2, 8, 8)
    np.testing.assert_allclose(now - last["time"], 16, atol=1e-4)
    np.testing.assert_allclose(now - last["view"], 4, atol=1e-4)


def test_correlation_and_residual_by_hand():
    a = np.arange(64, dtype=np.float32).reshape(1, 8, 8)
    same, turned, other = likeness(a, a + 5), likeness(a, -a), likeness(np.stack([a[0]] * 2), np.stack([a[0], -a[0]]))
    assert same == {"correlation": pytest.approx(1), "energy": pytest.approx(25)}
    assert turned["correlation"] == pytest.approx(-1) and other["correlation"] == pytest.approx(0)


def test_the_camera_of_the_sweep_moves_and_its_lenses_have_their_pitch():
    """Sub-images are parallel projections: a camera path of 4 lenses shifts them by 4 pixels at every depth."""
    video = moving(32, 8, 4 * 8 * 0.1952)
    assert video.structure.ei_pixels == (8, 8) and video.structure.lenses == (32, 16)
    a, b = (video.component(t, "si", (4, 4)).astype(int) for t in (1, 2))
    apart = [np.abs(b[:, : 32 - s] - a[:, s:]).mean() for s in range(8)]
    assert int(np.argmin(apart)) == 4
