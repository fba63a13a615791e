"""Q_depth: layers, values, missing pixels."""

import math

import numpy as np
import pytest

from ii_core import IICamera, IIPicture, orthoscopic, view_image
from ii_core.depth.layers import virtual_camera_pixels
from metrics import covering_layers, depth_from_focus, linear_layers, logarithmic_layers, q_depth, report

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
    q = q_depth(a, a.with_pixels(pixels), depth=depth, layers_mm=linear_layers(a.camera))
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
    q = q_depth(a, a.with_pixels(pixels), depth=depth, layers_mm=linear_layers(a.camera))
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
    q = q_depth(a, a, depth=np.full(a.pixels.shape[:2], d * 2.0), layers_mm=linear_layers(a.camera))
    assert np.flatnonzero(q.counts).tolist() == ([] if layer is None else [layer - 1])
    assert q.outside == (96 if layer is None else 0)


def test_q_depth_without_hits_is_nan():
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


def test_elementary_images_narrower_than_their_lenses_give_a_pixel_of_their_own():
    """Seen from Λ − K·Λ the outer lenses of a packed picture showed pixels beyond its border: IndexError."""
    camera = IICamera(
        pixels=(280, 220), lenses=(56, 44), pixel_pitch_mm=0.1, gap_mm=2.0, lens_pitch_mm=(0.7, 0.7), packed=True
    )
    n, m = virtual_camera_pixels(camera)
    np.testing.assert_array_equal(m[0] // 5, np.arange(56))
    np.testing.assert_array_equal(n[:, 0] // 5, np.arange(44))


def test_depth_is_taken_at_the_very_pixel():
    a = picture()
    n, m = virtual_camera_pixels(a.camera)
    depth = np.full(a.pixels.shape[:2], np.nan)
    depth[n, m] = GAP * (1 + np.arange(96).reshape(8, 12))
    pixels = a.pixels.copy()
    pixels[n[3], m[0, 5]] += 1
    q = q_depth(a, a.with_pixels(pixels), depth=depth, layers_mm=linear_layers(a.camera))
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
    q = q_depth(a, a.with_pixels(pixels), depth=depth, layers_mm=linear_layers(a.camera))
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
    q = q_depth(a, a.with_pixels(pixels), depth=depth, mask=mask, layers_mm=linear_layers(a.camera))
    assert q.counts[99] == q.outside == 24 and q.counts.sum() == 24
    assert q.values[99] == pytest.approx(20 * math.log10(255 / 2), rel=1e-14)
    assert np.isnan(q.error[:4]).all() and (q.layer[:4] == -1).all()
    with pytest.raises(ValueError, match="mask is float64"):
        q_depth(a, a, depth=depth, mask=depth)


def test_default_layers_cover_the_picture():
    a = picture()
    n, m = virtual_camera_pixels(a.camera)
    depth = np.full(a.pixels.shape[:2], 1.0)  # nothing in view is as near
    depth[n, m] = np.geomspace(3 * GAP, 4000 * GAP, 96).reshape(8, 12)
    depth[n[0], m[0, 0]] = np.nan
    q = q_depth(a, a, depth=depth)
    seen = depth[n, m].ravel()[1:]
    # The outer layers are the nearest and the farthest depth in view; steps between are alike in ratio.
    assert q.depth_mm.size == 250 and q.depth_mm[[0, -1]] == pytest.approx([seen[0], seen[-1]], rel=1e-12)
    assert np.ptp(np.diff(np.log(q.depth_mm))) < 1e-12
    assert q.outside == 0 and q.missing == 1 and q.counts.sum() == 95 and q.outside_share == 0
    # Every depth is within half a layer of its own.
    assert abs(np.log(q.depth_mm[q.layer.ravel()[1:]] / seen)).max() < 0.51 * math.log(q.depth_mm[1] / q.depth_mm[0])
    # The dissertation's layers leave out what lies beyond 250 gaps, and the share is told.
    old = q_depth(a, a, depth=depth, layers_mm=linear_layers(a.camera))
    assert old.outside == (seen >= 250.5 * GAP).sum() and old.outside_share == old.outside / 95 > 0.3
    told = report(a, a, over_depth=True, depth=depth, layers_mm=linear_layers(a.camera))
    assert f"{old.outside / 95:.1%} of view pixels outside all layers" in told.rows["Q_depth"]
    assert told.numbers["q_depth"]["outside_share"] == old.outside_share
    assert "0.0% of view pixels outside" in report(a, a, over_depth=True, depth=depth).rows["Q_depth"]


def test_default_layers_of_pictures_with_little_depth():
    a = picture()
    for z in (12.0, np.float32(13.7)):
        q = q_depth(a, a, depth=np.full(a.pixels.shape[:2], z))
        assert q.depth_mm.tolist() == [float(z)] and q.counts.tolist() == [96] and q.outside == 0
    # What is not in front of the pixels is no depth to cover, nor is nothing.
    depth = halves(a, -3.0, 20.0)
    q = q_depth(a, a, depth=depth)
    assert q.counts.tolist() == [48] and q.outside == 48 and q.outside_share == 0.5
    q = q_depth(a, a, depth=depth * np.nan)
    assert q.missing == 96 and math.isnan(q.outside_share)
    np.testing.assert_array_equal(q.depth_mm, covering_layers(a.camera))


def test_layers_without_a_map_reach_as_far_as_disparity():
    a = picture((12, 8), (6, 6))
    layers = covering_layers(a.camera)
    (near, far), width = layers[[0, -1]] - GAP, a.size[0]
    # Λ/z' elementary images a lens: half of one at the nearest; one pixel over 12 lenses at the farthest.
    assert GAP / near == pytest.approx(1 / 2) and 12 * 6 * GAP / far == pytest.approx(1) and width == 72
    aside = IICamera(pixels=a.size, lenses=a.lenses, pixel_pitch_mm=0.1, gap_mm=GAP, origin_mm=(0, 0, 2.5))
    np.testing.assert_allclose(covering_layers(aside), layers + 2.5, rtol=1e-14)
