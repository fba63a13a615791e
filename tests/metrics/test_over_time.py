"""Quality over time against closed forms: constant offsets, errors that alternate, a moving viewer."""

import json
import math

import numpy as np
import pytest

from ii_core import IIPicture, preset, video_of
from ii_core.display.look import viewpoints_across
from metrics import measure_take, q_angle, q_global, q_view, time_chart

CAMERA = preset("setup1", scale=32)


def shown(values, seed=0):
    """Frames of one random picture plus offsets."""
    (k, l), (u, v) = CAMERA.lenses, CAMERA.ei_pixels
    base = np.random.default_rng(seed).integers(50, 150, (l * v, k * u, 3))
    return video_of(
        [IIPicture((base + value).astype(np.uint8), CAMERA.lenses, CAMERA.ei_pixels, CAMERA) for value in values],
        fps=10,
    )


def test_constant_offsets_in_closed_form():
    quality = measure_take(shown([0, 0, 0, 0]), shown([2, 2, 4, 4]))
    expected = [20 * math.log10(255 / offset) for offset in (2, 2, 4, 4)]
    np.testing.assert_allclose(quality.q_global, expected)
    np.testing.assert_allclose(quality.flicker, [math.nan, 0, 2, 0])
    np.testing.assert_allclose(quality.error_change, [math.nan, 0, 2, 0])
    assert quality.mean_flicker == pytest.approx(2 / 3)
    assert quality.pooled_psnr == pytest.approx(20 * math.log10(255 / math.sqrt((4 + 4 + 16 + 16) / 4)))
    assert quality.mean_psnr == pytest.approx(np.mean(expected)) and quality.mean_psnr > quality.pooled_psnr
    assert quality.worst_psnr == pytest.approx(expected[2])


def test_flicker_leaves_out_what_moves():
    """The left half moves, and its error changes by 9; the right half is still, and its error changes by 3."""
    reference, decoded = shown([0, 0]), shown([0, 0])
    half = reference[0].pixels.shape[1] // 2
    moved, coded = reference[1].pixels.copy(), decoded[1].pixels.copy()
    moved[:, :half] += 1
    coded[:, :half] += 10
    coded[:, half:] += 3
    quality = measure_take(
        video_of([reference[0], reference[1].with_pixels(moved)]),
        video_of([decoded[0], decoded[1].with_pixels(coded)]),
    )
    assert quality.flicker[1] == pytest.approx(3) and quality.error_change[1] == pytest.approx(6)


def test_where_everything_moves_there_is_no_flicker():
    quality = measure_take(shown([0, 1]), shown([1, 1]))
    assert np.isnan(quality.flicker).all() and math.isnan(quality.mean_flicker) and quality.error_change[1] == 1


def test_each_frame_is_measured_as_a_still():
    reference, decoded = shown([0, 5, 9]), shown([3, 5, 1], seed=0)
    quality = measure_take(reference, decoded)
    for frame in range(3):
        a, b = reference[frame], decoded[frame]
        assert quality.q_global[frame] == q_global(a, b)
        np.testing.assert_array_equal(quality.q_angle[frame], np.asarray(q_angle(a, b)))
    assert quality.view_ssim is None


def test_a_moving_viewer_sees_each_frame_from_its_place():
    camera = preset("setup1", scale=16)
    rng = np.random.default_rng(1)
    (k, l), (u, v) = camera.lenses, camera.ei_pixels
    frames = [
        IIPicture(rng.integers(0, 200, (l * v, k * u, 3), np.uint8), camera.lenses, (u, v), camera) for _ in "ab"
    ]
    worse = [f.with_pixels(f.pixels + rng.integers(0, 9, f.pixels.shape, np.uint8)) for f in frames]
    path = viewpoints_across(frames[0], 2)
    quality = measure_take(video_of(frames), video_of(worse), viewpoints_mm=path)
    for frame in range(2):
        seen = q_view(frames[frame], worse[frame], viewpoints={"moving": path[frame]})
        assert quality.view_ssim[frame] == seen.mean and quality.view_psnr[frame] == seen.pooled_psnr


def test_a_shorter_decoded_take_counts_its_frames():
    assert len(measure_take(shown([0, 0, 0]), shown([1, 1])).q_global) == 2
    with pytest.raises(ValueError, match="decoded has 3 frames, reference 2"):
        measure_take(shown([0, 0]), shown([1, 1, 1]))
    with pytest.raises(ValueError, match="at least one viewpoint"):
        measure_take(shown([0]), shown([1]), viewpoints_mm=[])


def test_a_chart_over_time(tmp_path):
    quality = measure_take(shown([0, 0, 0]), shown([1, 2, 1]))
    assert time_chart({"a": quality}, tmp_path / "t.png").stat().st_size > 5000
    with pytest.raises(ValueError, match="at least one"):
        time_chart({}, tmp_path / "t.png")


def test_the_command_measures_takes(run, tmp_path):
    shown([0, 0, 0]).save(tmp_path / "a")
    shown([2, 2, 4]).save(tmp_path / "b")
    code, out, err = run(
        "measure", tmp_path / "a", tmp_path / "b", "--json", tmp_path / "m.json", "--plots", tmp_path / "p"
    )
    assert code == 0, err
    numbers = json.loads((tmp_path / "m.json").read_text())
    assert numbers["psnr_of_pooled_mse"] == pytest.approx(20 * math.log10(255 / math.sqrt(8)))
    assert numbers["flicker"][0] is None and numbers["flicker"][2] == 2
    assert (tmp_path / "p" / "time.png").is_file() and "flicker" in out
