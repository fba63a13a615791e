"""Light fields through other cameras, against the same field, closed forms and renders."""

from dataclasses import replace

import numpy as np
import pytest

from ii_core import IICamera, IIPicture, disparity_of_depth, orthoscopic, preset, retarget
from ii_core.base.files import read_image

PARALLEL = IICamera(pixels=(120, 100), lenses=(24, 20), pixel_pitch_mm=0.1, gap_mm=1.0)
SQUAT = IICamera(pixels=(120, 120), lenses=(24, 30), pixel_pitch_mm=0.1, gap_mm=1.0)  # lenses of 0.5×0.4 mm
MEETING = IICamera(pixels=(120, 100), lenses=(24, 20), pixel_pitch_mm=0.1, gap_mm=1.0, start_mm=40, viewer_mm=40)


def plane_through(camera, z_mm):
    """Picture of a wall at z with smooth light, and the disparity of its views; rays are the camera's own."""
    start, way = camera.rays()
    place = start + (z_mm - start[..., 2:]) / way[..., 2:] * way
    light = 0.5 + 0.2 * np.sin(place[..., :1] * [0.5, 0.6, 0.7]) + 0.2 * np.cos(place[..., 1:2] * [0.7, 0.5, 0.6])
    picture = IIPicture(light.astype(np.float32), camera.lenses, camera.ei_pixels, camera, camera.erect)
    (k, l), (u, v) = camera.lenses, camera.ei_pixels
    return picture, np.full((v, u, l, k), disparity_of_depth(camera, z_mm), np.float32)


@pytest.mark.parametrize("camera", [PARALLEL, MEETING], ids=["parallel", "meeting"])
def test_the_same_camera_gives_the_same_picture(camera):
    pixels = np.random.default_rng(0).integers(0, 256, (100, 120, 3), np.uint8)
    picture = IIPicture(pixels, camera.lenses, camera.ei_pixels, camera)
    made = retarget(picture, camera, np.full((5, 5, 20, 24), -0.3, np.float32))
    assert np.abs(made.picture.pixels.astype(int) - pixels).max() <= 1 and made.shares == (1, 0, 0)


def test_upright_elementary_images_of_the_same_lenses():
    """A gradient-index array sees what each elementary image holds, turned: `orthoscopic`."""
    picture, disparity = plane_through(PARALLEL, 9.0)
    made = retarget(picture, replace(PARALLEL, optics=({"kind": "grin"},)), disparity)
    assert made.picture.erect
    np.testing.assert_allclose(made.picture.pixels, orthoscopic(picture).pixels, atol=1e-4)


@pytest.mark.parametrize("source", [PARALLEL, MEETING, SQUAT], ids=["parallel", "meeting", "squat"])
def test_a_wall_through_cameras_of_other_lenses_and_pixels(source):
    picture, disparity = plane_through(source, 6.0)
    target = IICamera(pixels=(112, 91), lenses=(16, 13), pixel_pitch_mm=0.09, gap_mm=1.3)
    made = retarget(picture, target, disparity)
    wanted, _ = plane_through(target, 6.0)
    seen = made.mask == 2
    assert seen.mean() > 0.6 and not (made.mask == 1).any()
    inner = seen & (np.abs(made.picture.pixels - wanted.pixels).max(axis=2) < 0.02)
    assert inner.sum() > 0.97 * seen.sum()
    assert (made.picture.pixels[made.mask == 0] == 0).all()


def test_a_wall_behind_a_main_lens():
    """Rays are affine in lens and pixel before and behind an ideal lens; the target's rim blocks a part of them."""
    lens = {"kind": "lens", "z_mm": 20.0, "focal_mm": 8.0}
    picture, disparity = plane_through(replace(PARALLEL, optics=("pinhole", lens)), 50.0)
    bare = IICamera(pixels=(112, 91), lenses=(16, 13), pixel_pitch_mm=0.09, gap_mm=1.3, optics=("pinhole", lens))
    target = replace(bare, optics=("pinhole", {**lens, "diameter_mm": 9.0}))
    made = retarget(picture, target, disparity)
    open_, seen = target.weighted_rays()[2] > 0, made.mask == 2
    assert 0.3 < open_.mean() < 0.9 and 0.9 * open_.sum() < seen.sum() and not (made.mask[~open_] > 0).any()
    inner = seen & (np.abs(made.picture.pixels - plane_through(bare, 50.0)[0].pixels).max(axis=2) < 0.02)
    assert inner.sum() > 0.95 * seen.sum()


def test_a_hole_beside_a_near_square_is_filled_by_the_wall():
    """A quarter of a view outside the last one, the wall beside the square was hidden from both views."""
    row = {"lenses": (24, 20), "gap_mm": 1.0, "lens_pitch_mm": 0.2, "packed": True}
    two = IICamera(pixels=(48, 20), pixel_pitch_mm=0.1, **row)
    disparity = np.full((1, 2, 20, 24), -3.0, np.float32)
    disparity[0, :, 8:12, 8:12] = -0.2  # nearer; in both views at the same pixels
    pixels = np.full((20, 24, 2, 3), 60, np.uint8)
    pixels[8:12, 8:12] = 200
    picture = IIPicture(pixels.reshape(20, 48, 3), two.lenses, two.ei_pixels, two)
    finer = IICamera(pixels=(96, 40), pixel_pitch_mm=0.05, **row)  # pixels at views −0.25, 0.25, 0.75 and 1.25
    made = retarget(picture, finer, disparity)
    lenses = made.mask.reshape(20, 2, 24, 4)[:, 0], made.picture.pixels.reshape(20, 2, 24, 4, 3)[:, 0, ..., 0]
    assert (lenses[0][8:12, 12, 3] == 1).all() and (lenses[1][8:12, 12, 3] == 60).all()
    assert (lenses[0][8:12, 9:11] == 2).all() and (lenses[1][8:12, 9:11] == 200).all()
    assert (lenses[0][:6] == 2).all() and (lenses[1][:6] == 60).all()


def test_a_near_square_stays_out_of_the_far_sky():
    """The line from a ray of the sky to the farthest disparity ends at the outline of the square, half sky."""
    disparity = np.full((5, 5, 20, 24), -40.0, np.float32)
    disparity[:, :, 8:12, 8:14] = 0.0  # on the lenses
    pixels = np.full((20, 24, 5, 5, 3), 60, np.uint8)
    pixels[7:13, 7:15] = 130
    pixels[8:12, 8:14] = 200
    source = IIPicture(pixels.transpose(0, 2, 1, 3, 4).reshape(100, 120, 3), (24, 20), (5, 5), PARALLEL)
    finer = replace(PARALLEL, pixels=(240, 200), pixel_pitch_mm=0.05)
    made = retarget(source, finer, disparity)
    by_lens = made.picture.pixels.reshape(20, 10, 24, 10, 3).transpose(0, 2, 1, 3, 4)
    far = np.ones((20, 24), bool)
    far[3:17, 3:19] = False
    assert (by_lens[far] == 60).all() and (by_lens[9:11, 9:13] == 200).all()


def test_refined_directions():
    """Pixels that are means over their directions: halved, they come nearer to means over half of them."""
    far = 30.0  # 3 lens pitches between views

    def integrated(camera):
        start, way = camera.rays()
        place = start + (far - start[..., 2:]) / way[..., 2:] * way
        width = far * camera.pixel_pitch_mm / camera.gap_mm
        waves = [np.sin(k * place[..., axis]) * np.sinc(k * width / 2 / np.pi) for k in (0.8, 1.3) for axis in (0, 1)]
        light = np.repeat(0.5 + 0.1 * np.sum(waves, axis=0)[..., None], 3, 2)
        return IIPicture(light.astype(np.float32), camera.lenses, camera.ei_pixels, camera)

    disparity = np.full((5, 5, 20, 24), disparity_of_depth(PARALLEL, far), np.float32)
    finer = replace(PARALLEL, pixels=(240, 200), pixel_pitch_mm=0.05)
    wanted = integrated(finer).pixels
    inner = np.s_[70:130, 70:170]
    plain, refined = (retarget(integrated(PARALLEL), finer, disparity, refine=refine) for refine in (False, True))
    error = [np.sqrt(np.mean((made.picture.pixels - wanted)[inner] ** 2)) for made in (plain, refined)]
    assert error[1] < 0.75 * error[0] and (plain.mask == refined.mask).all()


@pytest.mark.parametrize(
    ("picture", "disparity", "said"),
    [
        (IIPicture(np.zeros((8, 8, 3), np.uint8), (4, 4), (2, 2)), np.zeros((2, 2, 4, 4)), "no camera"),
        (plane_through(PARALLEL, 9.0)[0], np.zeros((5, 5, 4, 4)), "that of all views"),
        (plane_through(PARALLEL, 9.0)[0], np.full((5, 5, 20, 24), np.nan), "nowhere known"),
    ],
)
def test_refused(picture, disparity, said):
    with pytest.raises(ValueError, match=said):
        retarget(picture, PARALLEL, disparity)


def test_the_command(run, tmp_path):
    picture, _ = plane_through(preset("setup1", scale=32), 30.0)
    path = picture.save(tmp_path / "f.exr")
    made = ["-o", tmp_path / "o.exr", "--mask", tmp_path / "m.png"]
    code, out, err = run("retarget", path, "--camera", "setup1", "--scale", "32", *made)
    assert code == 0 and "100.0% seen, 0.0% filled, 0.0% outside" in out, err
    np.testing.assert_allclose(read_image(tmp_path / "o.exr"), picture.pixels, atol=1e-4)
    assert (read_image(tmp_path / "m.png") == 255).all()
    code, _, err = run("retarget", path, "--camera", "nothing", "-o", tmp_path / "x.exr")
    assert code == 2 and "nothing" in err
