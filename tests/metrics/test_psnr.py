"""Q_global and Q_angle."""

import math

import numpy as np
import pytest
from skimage.metrics import peak_signal_noise_ratio

from ii_core import IICamera, IIPicture, preset
from metrics import angle_axes, mean_q_angle, q_angle, q_angle_ssim, q_angle_ycbcr, q_depth, q_global, q_view, report
from metrics.measures.global_angle import sum_masked_errors, sum_squared_errors

PEAKS = {"uint8": 255, "uint16": 65535, "float32": 1.0}


def picture(dtype="uint8", lenses=(5, 3), ei_pixels=(4, 7), seed=0):
    shape = (lenses[1] * ei_pixels[1], lenses[0] * ei_pixels[0], 3)
    values = np.random.default_rng(seed).random(shape) * PEAKS[dtype]
    return IIPicture(values.astype(dtype), lenses, ei_pixels)


@pytest.mark.parametrize("dtype", PEAKS)
def test_q_global_is_the_psnr_of_another_implementation(dtype):
    a, b = picture(dtype), picture(dtype, seed=1)
    expected = peak_signal_noise_ratio(
        a.pixels.astype(np.float64), b.pixels.astype(np.float64), data_range=PEAKS[dtype]
    )
    # Both sum in float64; only the order of summation differs.
    assert q_global(a, b) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("dtype", "offset"), [("uint8", 3), ("uint16", 700), ("float32", 0.125)])
def test_constant_offset_in_closed_form(dtype, offset):
    a = picture(dtype).with_pixels(np.zeros((21, 20, 3), dtype))
    b = a.with_pixels(a.pixels + np.array(offset, dtype))
    # Every value is exact in binary; what is left is one logarithm against another.
    assert q_global(a, b) == pytest.approx(20 * math.log10(PEAKS[dtype] / offset), rel=1e-14)
    np.testing.assert_allclose(q_angle(a, b), q_global(a, b), rtol=1e-14)


def test_black_against_white_uint16_is_exactly_0_db():
    # The largest error there is, in a sum beyond 2**32: any narrow accumulator would wrap.
    a = picture("uint16", (64, 64), (2, 2))
    black, white = a.with_pixels(np.zeros_like(a.pixels)), a.with_pixels(np.full_like(a.pixels, 65535))
    assert q_global(black, white) == 0


def test_identical_pictures_are_infinitely_good():
    a = picture()
    assert q_global(a, a.with_pixels(a.pixels.copy())) == math.inf
    assert (q_angle(a, a).values == math.inf).all()


def test_distortion_of_one_sub_image_shows_there_only():
    a = picture()
    pixels = a.pixels.copy()
    pixels.reshape(3, 7, 5, 4, 3)[:, 6, :, 1] ^= 1
    q = q_angle(a, a.with_pixels(pixels)).values
    assert q.shape == (7, 4)
    assert q[6, 1] == pytest.approx(20 * math.log10(255), rel=1e-14)  # every value off by 1
    q[6, 1] = math.inf
    assert (q == math.inf).all()


def test_pooling_and_averaging_are_different_rules():
    a, b = picture(), picture(seed=1)
    q = q_angle(a, b).values
    # Same sums, pooled in another order.
    assert q_global(a, b) == pytest.approx(-10 * np.log10(np.mean(10 ** (-q / 10))), rel=1e-12)
    assert mean_q_angle(a, b) == q.mean() > q_global(a, b)


@pytest.mark.parametrize("dtype", PEAKS)
def test_kernel_against_its_python(dtype):
    rng = np.random.default_rng(5)
    a, b = (rng.integers(0, 255, (2, 3, 4, 6)).astype(dtype) for _ in range(2))
    outs = []
    for kernel in (sum_squared_errors, sum_squared_errors.py_func):
        outs.append(np.zeros((3, 2)))
        kernel(a, b, np.empty(6), outs[-1])
    np.testing.assert_array_equal(*outs)  # whole numbers: exact


def test_pixels_in_any_memory_order():
    a, b = picture(), picture(seed=1)
    assert q_global(a, b.with_pixels(np.asfortranarray(b.pixels))) == q_global(a, b)


@pytest.mark.parametrize("metric", [q_global, q_angle])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_first_pixel_that_is_not_finite_is_named(metric, bad):
    a = picture("float32")
    pixels = a.pixels.copy()
    pixels[4, 9, 1] = pixels[5, 2, 0] = bad
    with pytest.raises(ValueError, match=r"decoded pixel \(9, 4\)"):
        metric(a, a.with_pixels(pixels))
    with pytest.raises(ValueError, match=r"reference pixel \(9, 4\)"):
        metric(a.with_pixels(pixels), a)


@pytest.mark.parametrize("metric", [q_global, q_angle])
def test_different_structure_or_type_is_refused(metric):
    a = picture()
    with pytest.raises(ValueError, match="ei_pixels"):
        metric(a, picture(ei_pixels=(4, 6)))
    with pytest.raises(ValueError, match="lenses"):
        metric(a, IIPicture(a.pixels, (10, 3), (2, 7)))
    with pytest.raises(ValueError, match="uint8 against uint16"):
        metric(a, a.with_pixels(a.pixels.astype(np.uint16)))
    with pytest.raises(TypeError, match="decoded is a ndarray"):
        metric(a, a.pixels)
    with pytest.raises(TypeError, match="reference is a ndarray"):
        metric(a.pixels, a)


def test_angles_are_those_of_the_rays():
    camera = preset("setup3", scale=16)
    _, d = camera.rays(rows=slice(0, 64), cols=slice(0, 64))
    u_deg, v_deg = angle_axes(camera)
    # 1e-9 degrees: differences of coordinates of tens of mm, in float64, over a gap of as much.
    np.testing.assert_allclose(u_deg, np.degrees(np.arctan2(d[0, :, 0], d[0, :, 2])), atol=1e-9)
    np.testing.assert_allclose(v_deg, np.degrees(np.arctan2(d[:, 0, 1], d[:, 0, 2])), atol=1e-9)
    assert u_deg[0] > 0 > v_deg[0]  # the top left pixel looks right and down
    for upright, plain in zip(angle_axes(camera, erect=True), (u_deg, v_deg), strict=True):
        np.testing.assert_array_equal(upright, -plain)


@pytest.mark.parametrize("dtype", PEAKS)
def test_only_masked_pixels_count(dtype):
    a, b = picture(dtype), picture(dtype, seed=1)
    mask = np.random.default_rng(2).random((21, 20)) < 0.6
    squares = np.square(a.pixels.astype(float) - b.pixels)
    top = PEAKS[dtype] ** 2
    assert q_global(a, b, mask=mask) == pytest.approx(10 * np.log10(top / squares[mask].mean()), rel=1e-12)
    field = (slice(2, None, 7), slice(3, None, 4))  # SI_{3,2}
    assert q_angle(a, b, mask=mask).values[2, 3] == pytest.approx(
        10 * np.log10(top / squares[field][mask[field]].mean()), rel=1e-12
    )
    np.testing.assert_allclose(q_angle(a, b, mask=np.ones_like(mask)), q_angle(a, b), rtol=1e-14)


def test_where_no_pixel_counts_there_is_no_quality():
    a, b = picture(), picture(seed=1)
    mask = np.ones((21, 20), bool)
    mask[2::7, 3::4] = False
    q = q_angle(a, b, mask=mask).values
    assert np.isnan(q[2, 3]) and np.isfinite(q).sum() == 27
    assert mean_q_angle(a, b, mask=mask) == pytest.approx(q[np.isfinite(q)].mean(), rel=1e-14)
    nothing = np.zeros((21, 20), bool)
    assert math.isnan(q_global(a, b, mask=nothing)) and math.isnan(mean_q_angle(a, b, mask=nothing))


def test_pixels_that_do_not_count_may_be_anything():
    a = picture("float32")
    pixels = a.pixels.copy()
    pixels[4, 9] = np.nan
    mask = np.ones((21, 20), bool)
    mask[4, 9] = False
    assert q_global(a, a.with_pixels(pixels), mask=mask) == math.inf
    pixels[5, 2, 0] = np.inf
    with pytest.raises(ValueError, match=r"decoded pixel \(2, 5\)"):
        q_global(a, a.with_pixels(pixels), mask=mask)
    for bad in (mask[1:], mask.astype(int), mask[..., None]):
        with pytest.raises(ValueError, match=r"mask is .*: bool of shape \(21, 20\) is needed"):
            q_global(a, a, mask=bad)


def test_masked_kernel_against_its_python():
    rng = np.random.default_rng(5)
    a, b = (rng.integers(0, 255, (2, 3, 4, 5, 3)).astype(np.uint8) for _ in range(2))
    mask = rng.random((2, 3, 4, 5)) < 0.5
    outs = []
    for kernel in (sum_masked_errors, sum_masked_errors.py_func):
        outs.append((np.zeros((3, 5)), np.zeros((3, 5), np.int64)))
        kernel(a, b, mask, *outs[-1])
    np.testing.assert_array_equal(outs[0][0], outs[1][0])  # whole numbers: exact
    np.testing.assert_array_equal(outs[0][1], outs[1][1])


# -- measures of plain arrays, whose structure is given beside them


CAMERA = IICamera(pixels=(64, 48), lenses=(16, 12), pixel_pitch_mm=0.25, gap_mm=2.0)
A, B = (np.random.default_rng(seed).integers(0, 256, (48, 64, 3), np.uint8) for seed in (1, 2))
PICTURES = [IIPicture(pixels, CAMERA.lenses, CAMERA.ei_pixels, CAMERA) for pixels in (A, B)]
DEPTH = np.full((48, 64), 30.0)


@pytest.mark.parametrize("structure", [CAMERA, PICTURES[0], {"lenses": (16, 12), "ei_pixels": (4, 4)}])
def test_arrays_measure_as_the_pictures_that_they_are(structure):
    """On b1dc540 arrays were a TypeError, whatever structure was known."""
    for measure in (q_global, mean_q_angle, lambda *a, **o: q_angle_ycbcr(*a, **o).mean):
        assert measure(A, B, structure=structure) == measure(*PICTURES)
    np.testing.assert_array_equal(q_angle(A, B, structure=structure).values, q_angle(*PICTURES).values)
    assert q_angle_ssim(A, B, structure=structure).mean == q_angle_ssim(*PICTURES).mean
    if not isinstance(structure, dict):  # without a camera there are no views
        assert q_view(A, B, structure=structure).values == q_view(*PICTURES).values
        assert q_depth(A, B, depth=DEPTH, structure=structure).mean == q_depth(*PICTURES, depth=DEPTH).mean
        assert report(A, B, structure=structure).numbers == report(*PICTURES).numbers


def test_an_array_beside_a_picture():
    assert q_global(PICTURES[0], B, structure=PICTURES[0]) == q_global(*PICTURES)


@pytest.mark.parametrize(
    ("structure", "said"),
    [
        (None, "reference is a ndarray: an IIPicture is needed, or an array and structure="),
        ({"lenses": (16, 12)}, "a picture, a camera or lenses and ei_pixels are needed"),
        (4, "structure is 4"),
        ({"lenses": (16, 12), "ei_pixels": (5, 4)}, "elementary image 5×4 px does not divide"),
    ],
)
def test_arrays_without_a_structure_that_fits_are_refused(structure, said):
    with pytest.raises((TypeError, ValueError), match=said):
        q_global(A, B, structure=structure)
