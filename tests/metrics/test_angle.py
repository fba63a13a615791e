"""YCbCr PSNR, SSIM and MS-SSIM of sub-images."""

import math

import numpy as np
import pytest
from skimage.metrics import structural_similarity

from ii_core import IIPicture
from metrics import q_angle_ssim, q_angle_ycbcr, q_ctc_psnr, q_ctc_ssim
from metrics.measures.ctc import codes

PEAKS = {"uint8": 255, "uint16": 65535, "float32": 1.0}


def picture(dtype="uint8", lenses=(24, 22), ei_pixels=(3, 2), seed=0):
    values = np.random.default_rng(seed).random((lenses[1] * ei_pixels[1], lenses[0] * ei_pixels[0], 3))
    return IIPicture((values * PEAKS[dtype]).astype(dtype), lenses, ei_pixels)


def worse(a, u, v, offset):
    """Return the picture with other values in one sub-image; even values only rise, so that the mean changes."""
    pixels = a.pixels.copy()
    l, k = a.lenses[::-1]
    field = pixels.reshape(l, a.ei_pixels[1], k, a.ei_pixels[0], 3)
    field[:, v, :, u] = np.clip(field[:, v, :, u].astype(float) + offset, 0, PEAKS[a.pixels.dtype.name])
    return a.with_pixels(pixels)


@pytest.mark.parametrize("dtype", PEAKS)
def test_identical_is_best_and_one_bad_view_is_found(dtype):
    a = picture(dtype)
    assert (q_angle_ycbcr(a, a).values == math.inf).all()
    assert (q_angle_ssim(a, a).values == 1).all()
    b = worse(a, 2, 1, PEAKS[dtype] * 0.2)
    for measure, best in ((q_angle_ycbcr, math.inf), (q_angle_ssim, 1.0)):
        q = measure(a, b)
        assert q.values.shape == (2, 3) and q.worst_view == (2, 1) and q.worst == q.values[1, 2] < best
        assert (q.values == best).sum() == 5


def test_ycbcr_of_colour_steps_in_closed_form():
    a = picture().with_pixels(np.full((44, 72, 3), 100, np.uint8))
    for step in ((0, 0, 10), (7, 0, 3)):
        b = a.with_pixels((a.pixels + np.array(step)).astype(np.uint8))
        r, g, blue = step
        y = 0.2126 * r + 0.7152 * g + 0.0722 * blue
        parts = y, (blue - y) / 1.8556, (r - y) / 1.5748  # BT.709
        expected = np.dot([6, 1, 1], [20 * math.log10(255 / abs(x)) for x in parts]) / 8
        np.testing.assert_allclose(q_angle_ycbcr(a, b).values, expected, rtol=1e-9)  # differences of float64 shares


def test_a_grey_step_leaves_colour_at_its_ceiling():
    a = picture().with_pixels(np.full((44, 72, 3), 100, np.uint8))
    b = a.with_pixels(a.pixels + np.uint8(5))
    expected = (6 * 20 * math.log10(255 / 5) + 120 + 120) / 8
    np.testing.assert_allclose(q_angle_ycbcr(a, b).values, expected, rtol=1e-9)


def test_ssim_is_that_of_another_implementation():
    a, b = picture(), picture(seed=1)
    b = a.with_pixels((0.7 * a.pixels + 0.3 * b.pixels).astype(np.uint8))
    q = q_angle_ssim(a, b).values
    for v, u in np.ndindex(2, 3):
        x, y = (p.pixels[v::2, u::3] @ [0.2989, 0.587, 0.114] for p in (a, b))
        expected = structural_similarity(x, y, data_range=255, gaussian_weights=True, use_sample_covariance=False)
        # Variances are differences of squares: float64 rounding, amplified.
        assert q[v, u] == pytest.approx(expected, abs=1e-9)


def test_ms_ssim_by_hand():
    a, b = picture(), picture(seed=1)
    b = a.with_pixels((0.7 * a.pixels + 0.3 * b.pixels).astype(np.uint8))
    offset = np.arange(11) - 5
    window = np.exp(-(offset[:, None] ** 2 + offset**2) / (2 * 1.5**2))
    window /= window.sum()
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2

    def parts(x, y):
        found = []
        for i, j in np.ndindex(x.shape[0] - 10, x.shape[1] - 10):
            p, q = x[i : i + 11, j : j + 11], y[i : i + 11, j : j + 11]
            mp, mq = (window * p).sum(), (window * q).sum()
            vp, vq = (window * (p - mp) ** 2).sum(), (window * (q - mq) ** 2).sum()
            cov = (window * (p - mp) * (q - mq)).sum()
            cs = (2 * cov + c2) / (vp + vq + c2)
            found.append((cs, cs * (2 * mp * mq + c1) / (mp**2 + mq**2 + c1)))
        return np.mean(found, axis=0)

    x, y = (p.pixels[1::2, ::3] @ [0.2989, 0.587, 0.114] for p in (a, b))
    fine, _ = parts(x, y)
    x, y = ((p[::2, ::2] + p[1::2, ::2] + p[::2, 1::2] + p[1::2, 1::2]) / 4 for p in (x, y))
    _, coarse = parts(x, y)
    weights = np.array([0.0448, 0.2856]) / (0.0448 + 0.2856)
    expected = fine ** weights[0] * coarse ** weights[1]
    assert q_angle_ssim(a, b, scales=2).values[1, 0] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("scales", [1, 2])
def test_negative_means_count_as_nothing(scales):
    """A negative has a negative contrast term everywhere: SSIM shows it, a product of powers ends at 0."""
    a = picture()
    values = q_angle_ssim(a, a.with_pixels(255 - a.pixels), scales=scales).values
    assert (values < -0.5).all() if scales == 1 else (values == 0).all()


def test_even_pictures_have_a_quality():
    a = picture()
    black = a.with_pixels(np.zeros_like(a.pixels))
    grey = a.with_pixels(np.full_like(a.pixels, 128))
    assert (q_angle_ssim(black, black).values == 1).all()
    assert 0 <= q_angle_ssim(black, grey).worst < 0.01
    assert q_angle_ssim(black, grey, scales=2).worst < 1


def test_refusals():
    a = picture()
    with pytest.raises(ValueError, match=r"24×22 .* 3 scales need at least 44×44"):
        q_angle_ssim(a, a, scales=3)
    with pytest.raises(ValueError, match="scales is 6"):
        q_angle_ssim(a, a, scales=6)
    with pytest.raises(ValueError, match="different type"):
        q_angle_ycbcr(a, picture("uint16"))
    f = picture("float32")
    bad = f.pixels.copy()
    bad[4, 9, 1] = np.nan
    for measure in (q_angle_ycbcr, q_angle_ssim):
        with pytest.raises(ValueError, match=r"decoded pixel \(9, 4\)"):
            measure(f, f.with_pixels(bad))


# -- JPEG Pleno's common test conditions


def test_codes_of_ten_bit_are_those_of_colour_bars():
    """Bars of 100 % in 10 bit: the values of BT.709's colour bars in every waveform manual."""
    bars = {
        (1, 1, 1): (940, 512, 512), (1, 1, 0): (877, 64, 553), (0, 1, 1): (754, 615, 64), (0, 1, 0): (691, 167, 105),
        (1, 0, 1): (313, 857, 919), (1, 0, 0): (250, 409, 960), (0, 0, 1): (127, 960, 471), (0, 0, 0): (64, 512, 512),
    }  # fmt: skip
    for rgb, expected in bars.items():
        assert tuple(codes(np.array(rgb, float))) == expected


def test_psnr_of_the_conditions_by_hand():
    a = picture().with_pixels(np.full((44, 72, 3), 100, np.uint8))
    b = a.with_pixels((a.pixels + np.array([7, 0, 3])).astype(np.uint8))
    steps = []
    for pixels in (a.pixels, b.pixels):
        r, g, blue = (round(1023 * int(c) / 255) / 1023 for c in pixels[0, 0])
        y = 0.2126 * r + 0.7152 * g + 0.0722 * blue
        steps.append(
            (round(64 + 876 * y), round(512 + 896 * (blue - y) / 1.8556), round(512 + 896 * (r - y) / 1.5748))
        )
    parts = [20 * math.log10(1023 / abs(x - y)) for x, y in zip(*steps, strict=True)]
    np.testing.assert_allclose(q_ctc_psnr(a, b).values, np.dot([6, 1, 1], parts) / 8, rtol=1e-12)
    assert (q_ctc_psnr(a, a).values == math.inf).all()
    # Against full-range, unrounded values: 20·log10 of 1023/876 for luma and 1023/896 for chroma. Rounding moves a
    # code by 0.4 rms, errors are 20 codes and more, and 528 pixels average their product to 0.2 %: 0.01 dB.
    a = picture(seed=3)
    noisy = worse(a, 2, 1, np.random.default_rng(1).normal(0, 8, (22, 24, 3)))
    higher = q_ctc_psnr(a, noisy).values[1, 2] - q_angle_ycbcr(a, noisy).values[1, 2]
    expected = (6 * 20 * math.log10(1023 / 876) + 2 * 20 * math.log10(1023 / 896)) / 8
    assert higher == pytest.approx(expected, abs=0.02)


def test_ssim_of_the_conditions_is_that_of_another_implementation():
    a, b = picture(), picture(seed=1)
    b = a.with_pixels((0.7 * a.pixels + 0.3 * b.pixels).astype(np.uint8))
    assert (q_ctc_ssim(a, a).values == 1).all()
    q = q_ctc_ssim(a, b).values
    for v, u in np.ndindex(2, 3):
        # The border repeats; this implementation leaves five pixels of border out of its mean.
        x, y = (np.pad(codes(p.pixels[v::2, u::3] / 255)[..., 0] / 1023, 5, mode="edge") for p in (a, b))
        expected = structural_similarity(x, y, data_range=1, gaussian_weights=True, use_sample_covariance=False)
        assert q[v, u] == pytest.approx(expected, abs=1e-9)
