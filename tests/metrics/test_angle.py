"""YCbCr PSNR, SSIM and MS-SSIM of sub-images."""

import math

import numpy as np
import pytest
from skimage.metrics import structural_similarity

from ii_core import IIPicture
from metrics import q_angle_ssim, q_angle_ycbcr

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
