"""Arrays of cameras as II-cameras: against pinhole cameras in closed form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ii_core import (
    IICamera,
    IIPicture,
    Rig,
    depth_of_disparity,
    disparity_of_depth,
    estimate_depth,
    find_views,
    five_viewpoints,
    picture_of,
    preset,
    refocus,
    sub_images,
    view_image,
    with_assumed_camera,
    write_hci,
)
from ii_core.camera.presets import scaled
from ii_core.depth.layers import disparity_layers
from ii_core.formats.hci import view_disparity
from ii_core.formats.rig import rig_of
from metrics import q_depth, q_view

RIG = Rig(baseline_mm=20, focal_mm=50, sensor_mm=35, focus_mm=900)
CAMERA = RIG.camera((5, 5), (64, 48))
LENGTHS = st.floats(1, 100)


def seen(camera, texture, z):
    """A textured wall at depth z through L and D, 8 bit."""
    L, D = camera.rays()
    at = L + (z - L[..., 2:]) / D[..., 2:] * D
    value = np.rint(127 + 100 * texture(at[..., 0], at[..., 1])).astype(np.uint8)
    return IIPicture(np.repeat(value[..., None], 3, axis=2), camera.lenses, camera.ei_pixels, camera)


def waves(x, y):
    return np.sin(x / 60) * np.cos(y / 50 + 0.3)


@given(
    baseline=LENGTHS, focal=LENGTHS, sensor=LENGTHS, focus=st.floats(200, 10000),
    views=st.tuples(st.integers(1, 9), st.integers(1, 9)),
)  # fmt: skip
def test_every_view_is_that_of_a_pinhole_camera(baseline, focal, sensor, focus, views):
    """Camera u stands at (u − (U−1)/2)·B; pixel k of all cameras sees the same place of the zero-disparity plane."""
    rig = Rig(baseline_mm=baseline, focal_mm=focal, sensor_mm=sensor, focus_mm=focus)
    camera, (u, v) = rig.camera(views, (8, 6)), views
    L, D = camera.rays()
    np.testing.assert_allclose(L[..., 2], 0, atol=1e-6)
    across, down = ((np.arange(n) - (n - 1) / 2) * baseline for n in views)
    np.testing.assert_allclose(L[0, :, 0].reshape(8, u), np.tile(across, (8, 1)), atol=1e-6 * baseline)
    np.testing.assert_allclose(L[:, 0, 1].reshape(6, v), np.tile(-down, (6, 1)), atol=1e-6 * baseline)
    on_plane, pixel = L + focus / D[..., 2:] * D, focus * sensor / 8 / focal
    columns, rows = (np.arange(8) - 3.5) * pixel, (2.5 - np.arange(6)) * pixel
    np.testing.assert_allclose(on_plane[0, :, 0], np.repeat(columns, u), atol=1e-6 * focus)
    np.testing.assert_allclose(on_plane[:, 0, 1], np.repeat(rows, v), atol=1e-6 * focus)
    assert camera.regular and camera.ei_pixels == views and camera.packed == (u != v)
    assert IICamera.from_json(camera.to_json()) == camera


@given(z=st.floats(300, 5000))
def test_disparity_has_both_signs_and_the_closed_form(z):
    pixel = 35 / 64
    expected = 20 * 50 / pixel * (1 / z - 1 / 900)
    assert disparity_of_depth(CAMERA, z) == pytest.approx(expected, rel=1e-9, abs=1e-9)
    assert depth_of_disparity(CAMERA, expected) == pytest.approx(z)
    assert (expected > 0) == (z < 900) or abs(z - 900) < 1e-6


@pytest.mark.parametrize("views", [(5, 5), (9, 1)], ids=str)
def test_fewer_lenses_are_larger_pixels_of_the_same_cameras(views):
    fewer, wanted = scaled(RIG.camera(views, (64, 48)), 4), RIG.camera(views, (16, 12))
    for z in (0.0, 900.0, 2000.0):
        places = []
        for camera in (fewer, wanted):
            L, D = camera.rays()
            places.append(L + (z - L[..., 2:]) / D[..., 2:] * D)
        np.testing.assert_allclose(*places, atol=1e-9 * 2000)
    np.testing.assert_allclose(*(disparity_of_depth(camera, [500, 5000]) for camera in (fewer, wanted)))


@pytest.mark.parametrize("views", [(9, 1), (1, 7), (3, 5)], ids=str)
@pytest.mark.parametrize("z", [600.0, 1600.0])
def test_rows_and_other_grids_have_depth_in_millimetres(views, z):
    """A wall whose pattern no shift repeats: its depth, the wall refocused, and the middle view of each grid."""
    picture = seen(RIG.camera(views, (64, 48)), lambda x, y: waves(x, y) * np.cos(x * y / 9000), z)
    stack, camera = sub_images(picture), picture.camera
    found = estimate_depth(picture)
    assert np.median(found.depth_mm) == pytest.approx(z, rel=0.02)
    front, valid = view_image(picture, five_viewpoints(camera)["front"], interpolation="nearest")
    np.testing.assert_array_equal(front, stack[views[1] // 2, views[0] // 2])
    sharp = refocus(picture, z)
    inner = (slice(10, -10), slice(10, -10), 0)
    assert valid.all() and np.abs(sharp[inner] - front[inner].astype(float)).max() < 4
    assert camera.vertical_parallax == (views[1] > 1)


@pytest.mark.parametrize("z", [600.0, 900.0, 1600.0])
def test_views_shift_by_the_disparity_before_and_behind(z):
    """A wall, moved by its disparity from view to view; refocused on itself it is the middle view."""
    picture = seen(CAMERA, waves, z)
    d = float(disparity_of_depth(CAMERA, z))
    stack = sub_images(picture)[..., 0].astype(float)
    columns = np.arange(10, 54)
    for u in (0, 1, 3, 4):
        moved = np.stack([np.interp(columns - d * (u - 2), np.arange(64), row) for row in stack[2, u]])
        assert np.abs(moved - stack[2, 2][:, 10:54]).max() < 3  # rounding, and linear interpolation of waves
    sharp = refocus(picture, z)[10:-10, 10:-10, 0]
    assert np.abs(sharp - stack[2, 2][10:-10, 10:-10]).max() < 3


def test_the_middle_camera_is_the_front_viewpoint():
    picture = seen(CAMERA, waves, 700.0)
    view, valid = view_image(picture, five_viewpoints(CAMERA)["front"], interpolation="nearest")
    assert valid.all()
    np.testing.assert_array_equal(view, sub_images(picture)[2, 2])


def test_parallel_cameras_agree_at_infinity():
    camera = Rig(baseline_mm=20, focal_mm=50, sensor_mm=35).camera((5, 5), (64, 48))
    assert disparity_of_depth(camera, 1000.0) == pytest.approx(20 * 50 / (35 / 64) / 1000, abs=2e-4)


def test_measures_of_a_field_with_content_on_both_sides():
    near, far = seen(CAMERA, waves, 500.0), seen(CAMERA, lambda x, y: waves(y, x), 1500.0)
    left = np.arange(CAMERA.pixels[0]) < CAMERA.pixels[0] // 2
    picture = near.with_pixels(np.where(left[None, :, None], near.pixels, far.pixels))
    depth = np.broadcast_to(np.where(left, 500.0, 1500.0), picture.pixels.shape[:2])
    noisy = picture.pixels.astype(int) + np.random.default_rng(0).integers(-3, 4, picture.pixels.shape)
    decoded = picture.with_pixels(noisy.clip(0, 255).astype(np.uint8))
    layers = disparity_layers(CAMERA, -1.5, 2.0, 8)
    assert (disparity_of_depth(CAMERA, layers) > 0).any() and (disparity_of_depth(CAMERA, layers) < 0).any()
    found = q_depth(picture, decoded, depth=depth, layers_mm=layers)
    assert found.outside == 0 and np.isfinite(found.values).sum() == 2
    assert found.counts.sum() == 64 * 48
    covering = q_depth(picture, decoded, depth=depth)
    assert covering.depth_mm[0] == pytest.approx(500) and covering.depth_mm[-1] == pytest.approx(1500)
    assert 0.5 < q_view(picture, decoded).mean < 1


def test_an_hci_folder_brings_its_camera(tmp_path):
    picture = seen(CAMERA, waves, 700.0)
    depth = np.full(picture.pixels.shape[:2], 700.0)
    (tmp_path / "h").mkdir()
    write_hci(picture, tmp_path / "h", depth=depth)
    assert view_disparity(picture, depth) == pytest.approx(float(disparity_of_depth(CAMERA, 700.0)))
    back, _ = picture_of(find_views(tmp_path / "h"))
    np.testing.assert_array_equal(back.pixels, picture.pixels)
    for name in ("lens_pitch_mm", "viewer_mm", "gap_mm", "pixel_pitch_mm", "origin_mm", "start_mm"):
        assert getattr(back.camera, name) == pytest.approx(getattr(CAMERA, name), rel=1e-9)
    assert rig_of(preset("setup1")) is None


def test_parameters_of_the_benchmark_are_read(tmp_path):
    """Keys and units of a parameters.cfg of K. Honauer et al., 2016."""
    write_hci(seen(CAMERA, waves, 700.0), tmp_path)
    (tmp_path / "parameters.cfg").write_text(
        "[intrinsics]\nfocal_length_mm = 100.0\nimage_resolution_x_px = 512\nsensor_size_mm = 35.0\nfstop = 100.0\n"
        "[extrinsics]\nnum_cams_x = 5\nnum_cams_y = 5\nbaseline_mm = 60.0\nfocus_distance_m = 3.5\n"
        "[meta]\nscene = boxes\ndisp_min = -1.1\n"
    )
    camera = picture_of(find_views(tmp_path))[0].camera
    assert camera.viewer_mm == 3500 and rig_of(camera).baseline_mm == pytest.approx(60)
    (tmp_path / "parameters.cfg").write_text((tmp_path / "parameters.cfg").read_text().replace("60.0", "-1"))
    with pytest.raises(ValueError, match=r"parameters\.cfg: baseline_mm is -1"):
        find_views(tmp_path)


def test_assumed_cameras_of_older_files_have_square_view_pixels():
    older = {"name": "nominal", "pixels": [36, 6], "lenses": [4, 6], "pixel_pitch_mm": 1.0, "gap_mm": 25.5}
    read = IICamera.from_json(older)
    assert read.packed and read.lens_pitch_mm == (9, 9)
    assert not IICamera.from_json(older | {"pixels": [36, 54]}).packed
    assert not IICamera.from_json(older | {"name": "panel"}).packed
    bare = with_assumed_camera(IIPicture(np.zeros((6, 36, 3), np.uint8), (4, 6), (9, 1))).camera
    assert IICamera.from_json(bare.to_json()) == bare


def test_invalid_lengths_and_grids_are_refused():
    with pytest.raises(ValueError, match="focal_mm is 0"):
        Rig(baseline_mm=1, focal_mm=0, sensor_mm=1)
    measures = {"pixel_pitch_mm": 1.0, "gap_mm": 2.0, "packed": True}
    with pytest.raises(ValueError, match="packed pixels are 9×4 under 2×2 lenses: whole elementary images"):
        IICamera(pixels=(9, 4), lenses=(2, 2), **measures)
    with pytest.raises(ValueError, match="packed pixels have lattice hexagonal"):
        IICamera(pixels=(8, 4), lenses=(2, 2), lattice="hexagonal", **measures)
    with pytest.raises(ValueError, match="no depth before the camera"):
        disparity_layers(CAMERA, -100, 1)
