import math

import numpy as np
import pytest

from ii_core import IICamera, IIPicture, orthoscopic, view_image
from metrics import depth_from_focus, logarithmic_layers, q_depth
from metrics.depth.q_depth import virtual_camera_pixels

GAP = 1.5


def picture(lenses=(12, 8), ei_pixels=(6, 6), seed=0, dtype="uint8"):
    size = lenses[0] * ei_pixels[0], lenses[1] * ei_pixels[1]
    camera = IICamera(pixels=size, lenses=lenses, pixel_pitch_mm=0.1, gap_mm=GAP)
    pixels = np.random.default_rng(seed).integers(10, 240, (size[1], size[0], 3)).astype(dtype)
    return IIPicture(pixels, lenses, ei_pixels, camera)


def halves(a, left, right):
    depth = np.full(a.pixels.shape[:2], left)
    depth[:, a.pixels.shape[1] // 2 :] = right
    return depth


def test_noise_on_one_layer_is_found_there_and_nowhere_else():
    a = picture()
    depth = halves(a, 20 * GAP, 100 * GAP)
    pixels = a.pixels.copy()
    pixels[depth == 100 * GAP] += 4
    q = q_depth(a, a.with_pixels(pixels), depth=depth)
    assert q.depth_mm[[0, 19, 249]] == pytest.approx([GAP, 20 * GAP, 250 * GAP], rel=1e-15)  # one product
    assert q.values[19] == math.inf
    assert q.values[99] == pytest.approx(20 * math.log10(255 / 4), rel=1e-14)  # exact sums, one logarithm
    empty = np.ones(250, bool)
    empty[[19, 99]] = False
    assert np.isnan(q.values[empty]).all() and (q.counts[empty] == 0).all()
    assert q.counts[19] == q.counts[99] == 48 and q.outside == 0
    assert (q.min, q.mean, q.max) == (q.values[99], math.inf, math.inf)


def test_psnr_is_normalised_by_the_layers_own_pixels():
    a = picture()
    depth = np.full(a.pixels.shape[:2], 30 * GAP)
    depth[:6, :6] = 7 * GAP  # one lens
    pixels = a.pixels.copy()
    pixels[:6, :6, 1] += 3
    q = q_depth(a, a.with_pixels(pixels), depth=depth)
    assert q.counts[6] == 1
    assert q.values[6] == pytest.approx(20 * math.log10(255 / math.sqrt(3)), rel=1e-14)  # 9 over 3 values


@pytest.mark.parametrize(
    ("d", "layer"), [(0.5, 1), (1.49, 1), (1.5, 2), (2.49, 2), (250.25, 250), (0.49, None), (250.5, None), (-3, None)]
)
def test_nearest_layer_and_what_lies_beyond(d, layer):
    a = picture()
    a = IIPicture(
        a.pixels, a.lenses, a.ei_pixels, IICamera(pixels=a.size, lenses=a.lenses, pixel_pitch_mm=1, gap_mm=2)
    )
    q = q_depth(a, a, depth=np.full(a.pixels.shape[:2], d * 2.0))
    assert np.flatnonzero(q.counts).tolist() == ([] if layer is None else [layer - 1])
    assert q.outside == (96 if layer is None else 0)


def test_nothing_hit_is_nan_throughout():
    a = picture()
    q = q_depth(a, a, depth=np.full(a.pixels.shape[:2], np.nan))
    assert np.isnan(q.values).all() and q.counts.sum() == q.outside == 0
    assert np.isnan([q.min, q.mean, q.max]).all()


@pytest.mark.parametrize("lenses", [(12, 8), (8, 12), (1, 1), (7, 7)])
@pytest.mark.parametrize("erect", [False, True])
def test_pixels_are_those_of_the_nearest_view_image(lenses, erect):
    a = picture(lenses)
    a = orthoscopic(a) if erect else a
    n, m = virtual_camera_pixels(a.camera, erect=erect)
    view, valid = view_image(a, (0, 0, GAP - lenses[0] * GAP), interpolation="nearest")
    rows = valid.all(axis=1)
    np.testing.assert_array_equal(a.pixels[n, m], view[rows])
    assert valid[rows].all() and not valid[~rows].any()
    if lenses[0] >= lenses[1]:  # every elementary image gives one of its own pixels
        assert rows.all()
        np.testing.assert_array_equal(m[0] // 6, np.arange(lenses[0]))
        np.testing.assert_array_equal(n[:, 0] // 6, np.arange(lenses[1]))


def test_depth_is_taken_at_the_very_pixel():
    a = picture()
    n, m = virtual_camera_pixels(a.camera)
    depth = np.full(a.pixels.shape[:2], np.nan)
    depth[n, m] = GAP * (1 + np.arange(96).reshape(8, 12))
    pixels = a.pixels.copy()
    pixels[n[3], m[0, 5]] += 1
    q = q_depth(a, a.with_pixels(pixels), depth=depth)
    assert (q.counts[:96] == 1).all()
    assert np.flatnonzero(np.isfinite(q.values)).tolist() == [3 * 12 + 5]


def test_refusals():
    a = picture()
    depth = np.full(a.pixels.shape[:2], 10.0)
    with pytest.raises(ValueError, match=r"shape \(48, 71\): numbers of shape \(48, 72\)"):
        q_depth(a, a, depth=depth[:, 1:])
    with pytest.raises(ValueError, match="depth is bool"):
        q_depth(a, a, depth=depth > 0)
    with pytest.raises(ValueError, match="depth is infinite"):
        q_depth(a, a, depth=depth * np.inf)
    with pytest.raises(ValueError, match="no camera"):
        q_depth(IIPicture(a.pixels, a.lenses, a.ei_pixels), a, depth=depth)
    f = picture(dtype="float32")
    with pytest.raises(ValueError, match=r"decoded pixel \(0, 0\) is \[nan"):
        q_depth(f, f.with_pixels(f.pixels * np.float32(np.nan)), depth=depth)


def test_depth_found_before_serves_again():
    a = picture()
    b = a.with_pixels(a.pixels + np.uint8(3))
    layers = logarithmic_layers(3 * GAP, 30 * GAP, 9)
    found = depth_from_focus(a, layers_mm=layers, method="robust")
    again, now = q_depth(a, b, depth=found), q_depth(a, b, layers_mm=layers, method="robust")
    np.testing.assert_array_equal(again.values, now.values)
    assert again.source == now.source == "focus (robust)" and (again.depth_mm == layers).all()
    with pytest.raises(ValueError, match=r"\(12, 8\) lenses and 9 layers: those of picture"):
        q_depth(a, b, depth=found, layers_mm=layers[:5])
    with pytest.raises(ValueError, match=r"\(6, 4\) lenses and 9 layers"):
        q_depth(picture((6, 4)), picture((6, 4)), depth=found)


def test_error_maps_lie_where_the_errors_are():
    a = picture()
    depth = halves(a, 20 * GAP, 100 * GAP)
    n, m = virtual_camera_pixels(a.camera)
    pixels = a.pixels.copy()
    pixels[n[2], m[0, 9]] += np.array([3, 0, 4], np.uint8)
    q = q_depth(a, a.with_pixels(pixels), depth=depth)
    assert q.layer.shape == q.error.shape == (8, 12)
    assert (q.layer[:, :6] == 19).all() and (q.layer[:, 6:] == 99).all()
    map_ = q.error_map(99)
    assert np.isnan(map_[:, :6]).all() and np.nansum(map_) == map_[2, 9] == pytest.approx((25 / 3) ** 0.5 / 255)
    assert (q.error_map(19)[:, :6] == 0).all() and np.isnan(q.error_map(5)).all()
    with pytest.raises(ValueError, match="layer is 250: 0 to 249"):
        q.error_map(250)


def test_masked_pixels_count_in_no_layer():
    a = picture()
    mask = np.ones(a.pixels.shape[:2], bool)
    mask[:24] = False  # four rows of lenses
    depth = np.full(a.pixels.shape[:2], 500 * GAP)  # beyond all layers
    depth[:, 36:] = 100 * GAP
    pixels = a.pixels + np.uint8(2)
    pixels[:24] += 9
    q = q_depth(a, a.with_pixels(pixels), depth=depth, mask=mask)
    assert q.counts[99] == q.outside == 24 and q.counts.sum() == 24
    assert q.values[99] == pytest.approx(20 * math.log10(255 / 2), rel=1e-14)
    assert np.isnan(q.error[:4]).all() and (q.layer[:4] == -1).all()
    with pytest.raises(ValueError, match="mask is float64"):
        q_depth(a, a, depth=depth, mask=depth)
